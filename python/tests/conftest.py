"""What the tests share: the problem, the kept design, and the program."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import coaxdesign as cx

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def problem() -> cx.Problem:
    return cx.Problem.load("coax2d")


@pytest.fixture(scope="session")
def schedule() -> cx.Schedule:
    return cx.Schedule.load(ROOT / "designs" / "coax2d")


@pytest.fixture(scope="session")
def program() -> Callable[..., str]:
    """Runs the program and gives what it prints: that of COAXDESIGN, or of a debug build."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    path = Path(os.environ.get("COAXDESIGN", target / "debug" / "coaxdesign"))
    if not path.exists():
        pytest.skip("no program to compare with: run cargo build, or set COAXDESIGN")

    def run(*arguments: str) -> str:
        result = subprocess.run(
            [str(path), *arguments], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run

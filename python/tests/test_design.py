"""Tuning and verification."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest

import coaxdesign as cx


@pytest.fixture(scope="module")
def small(root: Path) -> cx.Specification:
    """The built-in specification at two breakpoints."""
    lines = (root / "problems" / "hq.toml").read_text().splitlines(keepends=True)
    speeds = next(k for k, line in enumerate(lines) if line.startswith("speeds"))
    lines[speeds] = 'speeds = ["0 kt", "10 kt"]\n'
    return cx.Specification.load("".join(lines))


@pytest.fixture(scope="module")
def tuned(problem: cx.Problem, small: cx.Specification) -> cx.Tuned:
    return cx.tune(problem, small, nominal_only=True)


def test_a_schedule_with_its_verification(
    tuned: cx.Tuned, problem: cx.Problem, small: cx.Specification
) -> None:
    assert len(tuned.speeds) == 2
    assert tuned.provenance["problem_hash"] == problem.hash
    rows = tuned.verification.rows
    assert {"roll", "pitch", "yaw", "heave"} <= set(rows["axis"])
    assert rows.units["speed_m_s"] == "m/s"
    assert tuned.requirements_met == tuned.verification.met
    assert len(tuned.verification.missed) == (~rows["passed"]).sum()
    again = pickle.loads(pickle.dumps(tuned))
    assert again == tuned
    assert again.verification.document == tuned.verification.document


def test_saved_as_the_program_saves(tuned: cx.Tuned, tmp_path: Path) -> None:
    tuned.save(tmp_path)
    assert cx.Schedule.load(tmp_path) == tuned
    assert json.loads((tmp_path / "verification.json").read_text()) == tuned.verification.document


def test_verifying_again_gives_the_same_rows(
    tuned: cx.Tuned, problem: cx.Problem, small: cx.Specification
) -> None:
    again = tuned.verify(problem, small)
    nominal = {
        (row["axis"], row["speed_m_s"]): row
        for row in again.document["rows"]
        if row["model"] == small.models[0]
    }
    for row in tuned.verification.document["rows"]:
        if row["breakpoint"]:
            assert nominal[row["axis"], row["speed_m_s"]]["drb_rad_s"] == row["drb_rad_s"]


def test_refusals(problem: cx.Problem) -> None:
    with pytest.raises(cx.DesignError, match="heave"):
        cx.tune(problem, channels=["hover"])
    with pytest.raises(cx.SpecificationError) as caught:
        cx.Specification.load("nothing = 1\n")
    assert caught.value.findings[0].line == 1
    assert len(cx.Specification.load().models) > 1

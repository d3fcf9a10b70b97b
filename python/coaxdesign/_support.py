"""Packages that are not always there, progress, and files."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .errors import MissingPackage

Progress = bool | Callable[[int, int], object] | None
"""``True`` for a bar, a function of (parts done, parts in all), or nothing."""


def need(module: str, extra: str, purpose: str) -> Any:
    """A module of a package that is no dependency, imported when it is needed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        raise MissingPackage(
            f"{purpose} needs the package {package}: pip install 'coaxdesign[{extra}]'"
        ) from error


Tell = Callable[[int, int, str], object]


@contextmanager
def reporting(progress: Progress, label: str) -> Iterator[Tell | None]:
    """The function that long work calls with (parts done, parts in all, task)."""
    if progress is None or progress is False:
        yield None
        return
    if callable(progress):
        told = progress
        yield lambda done, total, task: told(done, total)
        return
    try:
        bars = importlib.import_module("tqdm.auto")
    except ImportError:
        yield from _plain(label)
        return
    with bars.tqdm(desc=label, leave=False) as bar:

        def tell(done: int, total: int, task: str) -> None:
            if (bar.total, bar.desc) != (total, task):
                bar.reset(total)
                bar.set_description(task, refresh=False)
            bar.update(done - bar.n)

        yield tell


def _plain(label: str) -> Iterator[Tell]:
    def tell(done: int, total: int, task: str) -> None:
        sys.stderr.write(f"\r{label}: {task} {done} of {total}")
        sys.stderr.flush()

    try:
        yield tell
    finally:
        sys.stderr.write("\n")


def write_whole(path: Path, content: bytes, force: bool) -> None:
    """Writes a file whole or not at all; one that is there stays unless forced."""
    if path.exists() and not force:
        raise FileExistsError(f"{path} is already there; force=True replaces it")
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise

"""Gain schedules."""

from __future__ import annotations

import os
import warnings as python_warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._support import Progress, write_whole
from .errors import ScheduleError
from .units import floats

if TYPE_CHECKING:
    from .design import Specification, Verification
    from .models import Models
    from .problem import Problem


class LawAt:
    """The law at speeds: arrays by name, the speed's index first.

    Gains are ``roll.k_p`` and the like, the trim ``trim.theta``, ``trim.lat_stick``
    and the like; matrices such as ``feedback`` have the shape (n, rows, columns).
    ``units`` tells the unit of each; a matrix whose entries have several says
    ``"mixed"``.
    """

    def __init__(self, columns: dict[str, tuple[str, NDArray[np.float64]]]) -> None:
        self._values = {name: values for name, (_, values) in columns.items()}
        self.units = {name: unit for name, (unit, _) in columns.items()}

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        try:
            return self._values[name]
        except KeyError:
            raise KeyError(f"{name!r}; there are {', '.join(self._values)}") from None

    def keys(self) -> list[str]:
        """Names."""
        return list(self._values)

    def __repr__(self) -> str:
        return f"<LawAt {len(self['airspeed'])} speeds: {', '.join(self.keys()[:6])}, ...>"


class Schedule:
    """A gain schedule: the law over speed, with its trims and matrices.

    Made by :meth:`load` or by :func:`coaxdesign.tune`. It can be pickled.
    """

    def __init__(self, core: _core.Schedule) -> None:
        self._core = core

    @classmethod
    def load(cls, source: str | os.PathLike[str]) -> Schedule:
        """A schedule from a file, a folder with a ``schedule.json``, or JSON text."""
        if isinstance(source, str) and source.lstrip().startswith("{"):
            return cls(_core.Schedule.parse(source))
        path = Path(source)
        if path.is_dir():
            path = path / "schedule.json"
        try:
            return cls(_core.Schedule.parse(path.read_text(encoding="utf-8")))
        except ScheduleError as error:
            raise ScheduleError(f"{path}: {error}") from None

    @property
    def name(self) -> str:
        """Name of the aircraft."""
        return self._core.name

    @property
    def requirements_met(self) -> bool:
        """Whether every requirement was met when it was tuned."""
        return self._core.requirements_met

    @property
    def speeds(self) -> NDArray[np.float64]:
        """Breakpoints, true airspeed in m/s, increasing; shape (n,)."""
        return np.asarray(self._core.speeds, dtype=np.float64)

    @property
    def provenance(self) -> dict[str, str]:
        """Program, and hashes of the problem and the specification."""
        names = ("generator", "problem_hash", "specification_hash")
        return dict(zip(names, self._core.provenance, strict=True))

    def __repr__(self) -> str:
        met = "requirements met" if self.requirements_met else "requirements not known to be met"
        return f"<Schedule of {self.name!r}: {len(self.speeds)} breakpoints, {met}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Schedule) and self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.to_json())

    def __reduce__(self) -> tuple[Any, ...]:
        return (Schedule.load, (self.to_json(),))

    def to_json(self) -> str:
        """The text of its ``schedule.json``."""
        return self._core.to_json()

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes ``schedule.json`` into a folder, or the file that ends in ``.json``."""
        path = Path(path)
        if path.suffix != ".json":
            path = path / "schedule.json"
        write_whole(path, self.to_json().encode(), force)
        return path

    def at(self, speeds: ArrayLike | Iterable[float]) -> LawAt:
        """The law at true airspeeds, m/s, as it flies: linear between breakpoints, constant beyond."""
        return LawAt(self._core.at(floats(speeds).ravel().tolist()))

    def verify(
        self,
        problem: Problem | Models,
        spec: Specification | str | os.PathLike[str] | None = None,
        *,
        progress: Progress = None,
    ) -> Verification:
        """Verifies the schedule; see :func:`coaxdesign.verify`."""
        from .design import verify

        return verify(self, problem, spec, progress=progress)

    @staticmethod
    def formats() -> dict[str, str]:
        """Forms of :meth:`export`, and what each holds."""
        return {name: f"{content}: {files}" for name, content, files in _core.export_formats()}

    def export(
        self,
        format: str,
        directory: str | os.PathLike[str],
        *,
        name: str | None = None,
        step: float = 0.01,
        precision: Literal["double", "single"] = "double",
        speed: float = 0.0,
        unverified: bool = False,
        force: bool = False,
    ) -> list[Path]:
        """Writes the schedule in the form of another program; gives the files' paths.

        :param format: one of :meth:`formats`.
        :param name: name of files and prefix of identifiers; the aircraft's where not given.
        :param step: interval at which the law is stepped, s.
        :param precision: width of numbers, for C and Rust.
        :param speed: true airspeed of the one condition, m/s, for ArduPilot.
        :param unverified: export even a schedule that is not known to meet its requirements.
        :param force: replace files that are there.
        """
        files, told = self._core.export(
            format, name, step, precision == "single", speed, unverified
        )
        for warning in told:
            python_warnings.warn(warning, stacklevel=2)
        directory = Path(directory)
        paths = [directory / file for file, _ in files]
        there = [str(path) for path in paths if path.exists()]
        if there and not force:
            raise FileExistsError(f"{', '.join(there)} already there; force=True replaces")
        for path, (_, content) in zip(paths, files, strict=True):
            write_whole(path, content, force)
        return paths

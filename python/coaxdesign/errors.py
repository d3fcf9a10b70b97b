"""What can go wrong, one class a kind; all are :class:`CoaxError`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

__all__ = [
    "CoaxError",
    "DesignError",
    "ExportError",
    "Finding",
    "InputError",
    "LinearError",
    "ManeuverError",
    "MissingPackage",
    "ModelsError",
    "ProblemError",
    "ScheduleError",
    "SimulationError",
    "SpecificationError",
    "StudyError",
    "TrimError",
    "UnitError",
]


class Finding(NamedTuple):
    """One thing that is wrong with a file, or odd about it."""

    severity: str
    """``"error"`` or ``"warning"``."""
    file: str
    """Name of the file."""
    line: int
    """Line, from 1; 0 where the whole file is meant."""
    column: int
    """Column in characters, from 1; 0 where the whole file is meant."""
    key: str
    """Key path such as ``rotors.upper.radius``; empty where there is none."""
    message: str
    """What is wrong."""
    help: str
    """What to write instead."""


class CoaxError(Exception):
    """Base of all errors of the package."""


class InputError(CoaxError, ValueError):
    """A file or text is wrong. ``findings`` holds everything at once."""

    findings: tuple[Finding, ...]

    def __init__(
        self, message: str, findings: Sequence[tuple[str, str, int, int, str, str, str]] = ()
    ) -> None:
        super().__init__(message, findings)
        self.findings = tuple(Finding(*finding) for finding in findings)

    def __str__(self) -> str:
        return str(self.args[0])


class ProblemError(InputError):
    """A problem file is wrong, or no model can be built of it."""


class SpecificationError(InputError):
    """A specification file is wrong."""


class ManeuverError(InputError):
    """A manoeuvre file is wrong."""


class ModelsError(InputError):
    """A set of linear models from elsewhere cannot be used."""


class UnitError(CoaxError, ValueError):
    """A quantity has the wrong unit, or is out of range."""


class TrimError(CoaxError):
    """There is no trim where one is needed."""


class LinearError(CoaxError):
    """A linear model cannot be made as asked."""


class ScheduleError(CoaxError, ValueError):
    """A text is no schedule, or a schedule cannot be used."""


class DesignError(CoaxError):
    """A tuning or a verification could not be done."""


class ExportError(CoaxError, ValueError):
    """A schedule cannot be exported as asked."""


class SimulationError(CoaxError, ValueError):
    """A flight cannot begin as asked."""


class StudyError(CoaxError):
    """A Monte Carlo study does not fit the files that are there."""


class MissingPackage(CoaxError, ImportError):
    """A package that is not installed is needed for this."""

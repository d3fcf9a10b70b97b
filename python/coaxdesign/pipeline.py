"""The whole way of a design in one call."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from . import _core
from ._support import Progress, write_whole
from .design import Specification, Tuned, Verification, as_specification, tune
from .problem import Problem
from .simulation import Flight, Maneuver, as_maneuver, simulate
from .trim import Trim
from .units import kt

if TYPE_CHECKING:
    from .linear import LinearModels

MANEUVER = "accel-climb-turn"
"""What a design flies unless it is told otherwise, as ``coaxdesign design`` does."""


@dataclass(frozen=True)
class Design:
    """What :func:`design` made."""

    problem: Problem
    specification: Specification
    trim: Trim
    """Trims over speed."""
    models: LinearModels
    """Reduced linear models at the breakpoints."""
    schedule: Tuned
    flight: Flight
    folder: Path | None = None
    """Where its files are."""
    exports: list[Path] = field(default_factory=list)
    """Files of the exports."""

    @property
    def verification(self) -> Verification:
        """How the schedule was judged."""
        return self.schedule.verification

    @property
    def met(self) -> bool:
        """Whether every requirement is met and the flight went to its end."""
        return self.verification.met and self.flight.status == "completed"

    def __repr__(self) -> str:
        word = "all requirements met" if self.verification.met else "requirements missed"
        return f"<Design of {self.problem.name!r}: {word}, flight {self.flight.status}>"


def design(
    problem: Problem,
    spec: Specification | str | os.PathLike[str] | None = None,
    *,
    maneuver: Maneuver | str | os.PathLike[str] = MANEUVER,
    exports: Iterable[str] = (),
    out: str | os.PathLike[str] | None = None,
    unverified: bool = False,
    force: bool = False,
    progress: Progress = None,
) -> Design:
    """Trims, linearises, tunes, verifies, flies and exports: ``coaxdesign design`` in one call.

    :param spec: specification; the built-in one where not given.
    :param maneuver: what is flown with the full nonlinear vehicle.
    :param exports: forms of the schedule to write, of
        :meth:`Schedule.formats <coaxdesign.Schedule.formats>`; needs ``out``.
    :param out: folder of the design, as the program's commands take it:
        ``design.json``, the problem and the specification, ``schedule.json``,
        ``verification.json`` and ``exports``.
    :param unverified: export even where requirements are missed.
    :param force: replace files that are there.

    Requirements that are missed, and a flight that ends early, are no errors:
    see :attr:`Design.met`.
    """
    wanted = list(exports)
    if wanted and out is None:
        raise ValueError("exports need a folder: give out")
    folder = None if out is None else Path(out)
    if folder is not None and (folder / "schedule.json").exists() and not force:
        # Said now, and not after the tuning.
        raise FileExistsError(f"{folder / 'schedule.json'} is already there; force=True replaces it")
    requirements = as_specification(spec)
    flown = as_maneuver(maneuver)
    top = float(max(requirements.speeds))
    step = kt(5.0)
    speeds = [k * step for k in range(int(top / step + 1e-6) + 1)]
    trims = problem.trim(speeds, progress=progress)
    schedule = tune(problem, requirements, progress=progress)
    models = problem.models(schedule.speeds, reduce="residualize", progress=progress)
    flight = simulate(problem, schedule, flown, progress=progress)
    written: list[Path] = []
    if folder is not None:
        for name, content in _core.design_files(problem._core, requirements._core):
            write_whole(folder / name, content, force)
        schedule.save(folder, force=force)
        for form in wanted:
            written += schedule.export(
                form, folder / "exports" / form, unverified=unverified, force=force
            )
    return Design(problem, requirements, trims, models, schedule, flight, folder, written)

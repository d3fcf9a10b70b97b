"""Monte Carlo studies, here or on a cluster.

A study's runs are numbered; run k is the same wherever it is flown. Results
go into a folder: ``study.json`` says what the study is, and ``runs`` is a
Parquet dataset in blocks of a thousand runs. A study that is started again
flies what is missing.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from . import _core
from ._engine import Dataset, Numbered, Row, array, work
from ._support import Progress, Tell
from .problem import Problem
from .schedule import Schedule
from .simulation import Maneuver, Variation, as_maneuver, as_schedule
from .table import Table, Values
from .units import ft_s, inch, kt

LARGEST_BATCH = 50
"""Most runs of one task: what is lost with a worker."""


@dataclass(frozen=True)
class Ranges:
    """What is drawn, evenly, by a Latin hypercube."""

    mass: float = 0.1
    """Mass off nominal, either way, as a fraction."""
    inertia: float = 0.1
    """Inertia off nominal, either way, as a fraction."""
    center_of_gravity: float = inch(1.0)
    """Shift of the centre of gravity, either way, m."""
    delay: float = 0.01
    """Largest extra delay, s."""
    turbulence: float = kt(15.0)
    """Largest wind at 20 ft for turbulence, m/s; zero keeps the manoeuvre's own air."""
    inflow: float = 0.2
    """Inflow that rotors induce in one another off nominal, as a fraction."""
    gust: float = ft_s(5.0)
    """Largest component of a gust half way, either way, m/s."""


@dataclass(frozen=True)
class Criterion:
    """What makes a run a success, beside that it was flown to its end."""

    velocity_peak: float = kt(10.0)
    """Largest error of any velocity, m/s."""
    saturated: float = 0.5
    """Longest time at actuator limits, s."""


class Study(Numbered):
    """A study that is ready to be flown. It can be pickled, and so goes to workers."""

    def __init__(
        self,
        problem: Problem,
        schedule: Schedule | None,
        maneuver: Maneuver,
        variation: Variation,
        equipment: Mapping[str, Any],
        runs: int,
        ranges: Ranges,
        criterion: Criterion,
    ) -> None:
        self._made_of = (
            problem, schedule, maneuver, variation, equipment, runs, ranges, criterion
        )
        self._core = _core.Study(
            problem._core,
            None if schedule is None else schedule._core,
            maneuver._core,
            variation.to_json(),
            dict(equipment),
            runs,
            json.dumps(asdict(ranges)),
            json.dumps(asdict(criterion)),
        )
        self.runs = runs
        self.count = runs
        self.noun = "flights"
        self.key = "run"

    @property
    def columns(self) -> list[tuple[str, str, str]]:
        """Name, unit and type of every column."""
        return [(name, unit, TYPES.get(name, "float64")) for name, unit in _core.study_columns()]

    @property
    def head(self) -> dict[str, Any]:
        """All that changes a result."""
        head: dict[str, Any] = json.loads(self._core.head())
        return head

    @property
    def hash(self) -> str:
        """Hash of the head."""
        return self._core.hash()

    def differences(self, head: dict[str, Any]) -> list[str]:
        """Where the head of another study differs."""
        return self._core.differences(json.dumps(head))

    def __reduce__(self) -> tuple[Any, ...]:
        return (Study, self._made_of)

    def work(self, indices: list[int], threads: int = 1) -> list[Row]:
        """As :meth:`fly`."""
        return self.fly(indices, threads=threads)

    def fly(
        self, indices: Iterable[int], *, threads: int = 1, progress: Tell | None = None
    ) -> list[dict[str, Any]]:
        """Flies these runs, and gives each as a row; ``threads=0`` takes every core."""
        rows = self._core.fly(list(indices), threads, progress)
        return [json.loads(row) for row in rows]


TYPES = {
    "run": "int64",
    "seed": "int64",
    "status": "string",
    "state": "string",
    "success": "bool",
    "interactions": "bool",
}
"""Types of the columns that are no numbers with a fraction."""


class MonteCarlo(Table):
    """Runs of a study, a row a run in order: see :class:`~coaxdesign.table.Table`."""

    def __init__(self, rows: list[dict[str, Any]], head: dict[str, Any], flown: int) -> None:
        columns: dict[str, tuple[str, Values]] = {}
        for name, unit in _core.study_columns():
            # Whether interactions are on is a word here: it may be unknown.
            kind = "string" if name == "interactions" else TYPES.get(name, "float64")
            columns[name] = (unit, array(kind, [row[name] for row in rows]))
        super().__init__(columns, {"study": json.dumps(head)})
        self.head = head
        self.flown = flown
        """Runs that this call flew; the others were there."""

    @property
    def success_rate(self) -> float:
        """Part of the runs that are a success."""
        return float(np.mean(self["success"])) if len(self) else float("nan")

    @property
    def confidence(self) -> tuple[float, float]:
        """Wilson's interval of the success rate at 95 %."""
        low, high = _core.confidence(int(self["success"].sum()), len(self))
        return low, high

    def __repr__(self) -> str:
        low, high = self.confidence
        return (
            f"<MonteCarlo of {self.head['maneuver']['name']!r}: {len(self)} of "
            f"{self.head['runs']} runs, success {100 * self.success_rate:.1f} % "
            f"({100 * low:.1f} to {100 * high:.1f} %)>"
        )


def montecarlo(
    problem: Problem,
    schedule: Schedule | str | os.PathLike[str] | None,
    maneuver: Maneuver | str | os.PathLike[str],
    *,
    runs: int = 200,
    seed: int = 0,
    client: Any = None,
    out: str | os.PathLike[str] | None = None,
    batch: int | None = None,
    retries: int = 3,
    variation: Variation | None = None,
    ranges: Ranges | None = None,
    criterion: Criterion | None = None,
    control_rate: float = 100.0,
    steps_per_revolution: int = 36,
    pitch_rate_limit: float | None = None,
    progress: Progress = None,
) -> MonteCarlo:
    """Flies a manoeuvre many times with the aircraft and the air varied.

    :param runs: number of runs of the study.
    :param client: a ``dask.distributed.Client``, or the module ``ray`` after
        ``ray.init()``; every core of this machine where not given.
    :param out: folder of the results; a study that is there is gone on with,
        and another one raises :class:`~coaxdesign.errors.StudyError` that
        names what differs.
    :param batch: runs of one task; a fifth of a worker's share, 50 at most,
        where not given.
    :param retries: how often a failed task is tried again; tasks of a lost
        worker go to another one by themselves.
    :param variation: what is varied in every run alike.
    :param ranges: what is drawn.
    :param criterion: what makes a run a success.

    The rest as in :func:`~coaxdesign.simulate`. Rows do not depend on where
    and in which order they are flown.
    """
    equipment = {
        "control_rate": control_rate,
        "steps_per_revolution": steps_per_revolution,
        "pitch_rate_limit": pitch_rate_limit,
        "seed": seed,
    }
    study = Study(
        problem,
        as_schedule(schedule),
        as_maneuver(maneuver),
        variation or Variation(),
        equipment,
        runs,
        ranges or Ranges(),
        criterion or Criterion(),
    )
    rows, flown = work(
        study,
        client=client,
        out=out,
        batch=batch,
        largest_batch=LARGEST_BATCH,
        retries=retries,
        progress=progress,
    )
    return MonteCarlo(rows, study.head, flown)

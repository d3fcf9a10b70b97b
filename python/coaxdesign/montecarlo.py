"""Monte Carlo studies, here or on a cluster.

A study's runs are numbered; run k is the same wherever it is flown. Results
go into a folder: ``study.json`` says what the study is, and ``runs`` is a
Parquet dataset in blocks of a thousand runs. A study that is started again
flies what is missing.
"""

from __future__ import annotations

import importlib
import json
import os
import pickle
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._support import Progress, Tell, need, reporting, write_whole
from .errors import StudyError
from .problem import Problem
from .schedule import Schedule
from .simulation import Maneuver, Variation, as_maneuver, as_schedule
from .table import Table, Values
from .units import ft_s, inch, kt

BLOCK = 1000
"""Runs of one block of the dataset."""
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


class Study:
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

    @property
    def head(self) -> dict[str, Any]:
        """All that changes a result."""
        head: dict[str, Any] = json.loads(self._core.head())
        return head

    @property
    def hash(self) -> str:
        """Hash of the head."""
        return self._core.hash()

    def __reduce__(self) -> tuple[Any, ...]:
        return (Study, self._made_of)

    def fly(
        self, indices: Iterable[int], *, threads: int = 1, progress: Tell | None = None
    ) -> list[dict[str, Any]]:
        """Flies these runs, and gives each as a row; ``threads=0`` takes every core."""
        rows = self._core.fly(list(indices), threads, progress)
        return [json.loads(row) for row in rows]


def fly_batch(study: Study, indices: list[int]) -> list[dict[str, Any]]:
    """What a worker does: a batch of runs on one thread."""
    return study.fly(indices)


class MonteCarlo(Table):
    """Runs of a study, a row a run in order: see :class:`~coaxdesign.table.Table`."""

    def __init__(self, rows: list[dict[str, Any]], head: dict[str, Any], flown: int) -> None:
        columns: dict[str, tuple[str, Values]] = {}
        for name, unit in _core.study_columns():
            columns[name] = (unit, _column(name, [row[name] for row in rows]))
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


def _lock(handle: int) -> None:
    """Locks an open file for as long as it is open, or raises OSError at once."""
    if os.name == "nt":
        windows: Any = importlib.import_module("msvcrt")
        windows.locking(handle, windows.LK_NBLCK, 1)
    else:
        posix: Any = importlib.import_module("fcntl")
        posix.flock(handle, posix.LOCK_EX | posix.LOCK_NB)


INTEGERS = ("run", "seed")
WORDS = ("status", "state")


def _column(name: str, values: list[Any]) -> Values:
    if name in INTEGERS:
        return np.array(values, dtype=np.int64)
    if name == "success":
        return np.array(values, dtype=np.bool_)
    if name in WORDS or name == "interactions":
        return np.array(["" if value is None else str(value) for value in values], dtype=np.str_)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


class Dataset:
    """The folder of a study: ``study.json``, and ``runs`` in blocks of Parquet files."""

    def __init__(self, folder: str | os.PathLike[str], study: Study) -> None:
        self.folder = Path(folder)
        self.study = study
        self._arrow = need("pyarrow", "cluster", "a dataset of runs")
        self._parquet = need("pyarrow.parquet", "cluster", "a dataset of runs")
        types = {"run": "int64", "seed": "int64", "status": "string", "state": "string"}
        types |= {"success": "bool", "interactions": "bool"}
        self._schema = self._arrow.schema(
            [
                self._arrow.field(
                    name,
                    self._arrow.type_for_alias(types.get(name, "float64")),
                    metadata={"unit": unit},
                )
                for name, unit in _core.study_columns()
            ],
            metadata={"study": study.hash, "head": json.dumps(study.head)},
        )

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps other programs out of the folder meanwhile."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ".lock").open("w") as handle:
            try:
                _lock(handle.fileno())
            except OSError:
                raise StudyError(f"{self.folder}: another program is flying into it") from None
            yield

    def begin(self) -> list[dict[str, Any]]:
        """Writes ``study.json``, or compares it; gives the rows that are there."""
        path = self.folder / "study.json"
        if path.exists():
            found = json.loads(path.read_text())
            differences = self.study._core.differences(json.dumps(found["head"]))
            if differences:
                listed = "\n  ".join(differences)
                raise StudyError(f"{self.folder} holds another study:\n  {listed}")
        else:
            units = dict(_core.study_columns())
            document = {"study": self.study.hash, "head": self.study.head, "units": units}
            write_whole(path, (json.dumps(document, indent=2) + "\n").encode(), force=False)
        return self.rows()

    def rows(self) -> list[dict[str, Any]]:
        """Every row, in the order of the runs."""
        found: dict[int, dict[str, Any]] = {}
        for path in sorted(self.folder.glob("runs/block=*/*.parquet")):
            # The file alone: the block is no column of the rows.
            for row in self._parquet.ParquetFile(path).read().to_pylist():
                found[row["run"]] = row
        return [found[run] for run in sorted(found)]

    def add(self, rows: list[dict[str, Any]]) -> None:
        """Adds runs, a file a block, each whole or not at all."""
        blocks: dict[int, list[dict[str, Any]]] = {}
        for row in rows:
            blocks.setdefault(row["run"] // BLOCK, []).append(row)
        for block, part in blocks.items():
            sink = self._arrow.BufferOutputStream()
            table = self._arrow.Table.from_pylist(part, schema=self._schema)
            self._parquet.write_table(table, sink, compression="zstd")
            name = f"runs-{part[0]['run']:08d}-{part[-1]['run']:08d}-{len(part)}.parquet"
            path = self.folder / "runs" / f"block={block}" / name
            write_whole(path, sink.getvalue().to_pybytes(), force=True)


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
    if out is None:
        rows = _fly(study, range(runs), client, batch, retries, progress, None)
        return MonteCarlo(sorted(rows, key=lambda row: int(row["run"])), study.head, len(rows))
    dataset = Dataset(out, study)
    with dataset.locked():
        known = {row["run"] for row in dataset.begin()}
        missing = [run for run in range(runs) if run not in known]
        _fly(study, missing, client, batch, retries, progress, dataset)
        return MonteCarlo(dataset.rows(), study.head, len(missing))


def _fly(
    study: Study,
    missing: Iterable[int],
    client: Any,
    batch: int | None,
    retries: int,
    progress: Progress,
    dataset: Dataset | None,
) -> list[dict[str, Any]]:
    wanted = list(missing)
    flown: list[dict[str, Any]] = []
    if not wanted:
        return flown
    workers = _workers(client)
    size = batch or max(1, min(LARGEST_BATCH, len(wanted) // (5 * workers)))
    batches = [wanted[k : k + size] for k in range(0, len(wanted), size)]
    if client is None:
        done = _here(study, batches)
    elif getattr(client, "__name__", "") == "ray":
        done = _on_ray(client, study, batches, retries)
    else:
        done = _on_dask(client, study, batches, retries)
    with reporting(progress, "flights") as tell:
        for rows in done:
            if dataset is not None:
                dataset.add(rows)
            flown += rows
            if tell is not None:
                tell(len(flown), len(wanted), "flights")
    return flown


def _workers(client: Any) -> int:
    if client is None:
        return 1
    if getattr(client, "__name__", "") == "ray":
        return max(1, int(client.cluster_resources().get("CPU", 1)))
    return max(1, int(sum(client.nthreads().values())))


def _here(study: Study, batches: list[list[int]]) -> Iterator[list[dict[str, Any]]]:
    for indices in batches:
        yield study.fly(indices, threads=0)


def _on_dask(
    client: Any, study: Study, batches: list[list[int]], retries: int
) -> Iterator[list[dict[str, Any]]]:
    distributed = need("distributed", "cluster", "a Dask client")
    # A task makes the study on a worker, so that it is made again where that
    # worker is lost.
    shared = client.submit(pickle.loads, pickle.dumps(study), pure=False)
    futures = [
        client.submit(fly_batch, shared, indices, retries=retries, pure=False)
        for indices in batches
    ]
    waiting = distributed.as_completed(futures)
    try:
        for future in waiting:
            yield future.result()
            future.release()
    finally:
        # Whether it is all done, has failed, or was interrupted.
        client.cancel(futures)


def _on_ray(
    ray: Any, study: Study, batches: list[list[int]], retries: int
) -> Iterator[list[dict[str, Any]]]:
    shared = ray.put(study)
    task = ray.remote(max_retries=retries, num_cpus=1)(fly_batch)
    waiting = [task.remote(shared, indices) for indices in batches]
    try:
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1)
            yield from ray.get(ready)
    finally:
        for reference in waiting:
            ray.cancel(reference)

"""Numbered rows of a study, made here or on a cluster, and the dataset that holds them."""

from __future__ import annotations

import importlib
import json
import os
import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ._support import Progress, need, reporting, write_whole
from .errors import StudyError
from .table import Values

Row = dict[str, Any]
Rows = Generator[list[Row], None, None]

BLOCK = 1000
"""Rows of one block of the dataset."""


class Numbered(ABC):
    """A study with numbered rows, each the same wherever it is made.

    It can be pickled, and so goes to workers.
    """

    count: int
    """Rows of the whole study."""
    noun: str
    """What the rows are, for people."""
    key: str
    """The column of the number."""

    @property
    @abstractmethod
    def columns(self) -> list[tuple[str, str, str]]:
        """Name, unit and Arrow's name of the type of every column."""

    @property
    @abstractmethod
    def head(self) -> dict[str, Any]:
        """All that changes a row."""

    @property
    @abstractmethod
    def hash(self) -> str:
        """Hash of the head."""

    @abstractmethod
    def differences(self, head: dict[str, Any]) -> list[str]:
        """Where the head of another study differs."""

    @abstractmethod
    def work(self, indices: list[int], threads: int = 1) -> list[Row]:
        """Makes these rows; ``threads=0`` takes every core."""


def work_batch(study: Numbered, indices: list[int]) -> list[Row]:
    """What a worker does: a batch of rows on one thread."""
    return study.work(indices)


def array(kind: str, values: list[Any]) -> Values:
    """A column as an array; what is missing is NaN, an empty text, or false."""
    if kind == "int64":
        return np.array(values, dtype=np.int64)
    if kind == "bool":
        return np.array(values, dtype=np.bool_)
    if kind == "string":
        return np.array(["" if value is None else str(value) for value in values], dtype=np.str_)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _lock(handle: int) -> None:
    """Locks an open file for as long as it is open, or raises OSError at once."""
    if os.name == "nt":
        windows: Any = importlib.import_module("msvcrt")
        windows.locking(handle, windows.LK_NBLCK, 1)
    else:
        posix: Any = importlib.import_module("fcntl")
        posix.flock(handle, posix.LOCK_EX | posix.LOCK_NB)


class Dataset:
    """The folder of a study: ``study.json``, and ``runs`` in blocks of Parquet files."""

    def __init__(self, folder: str | os.PathLike[str], study: Numbered) -> None:
        self.folder = Path(folder)
        self.study = study
        self._arrow = need("pyarrow", "cluster", "a dataset of runs")
        self._parquet = need("pyarrow.parquet", "cluster", "a dataset of runs")
        arrow = self._arrow
        self._schema = arrow.schema(
            [
                arrow.field(name, arrow.type_for_alias(kind), metadata={"unit": unit})
                for name, unit, kind in study.columns
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
                raise StudyError(f"{self.folder}: another program is writing into it") from None
            yield

    def begin(self) -> list[dict[str, Any]]:
        """Writes ``study.json``, or compares it; gives the rows that are there."""
        path = self.folder / "study.json"
        if path.exists():
            found = json.loads(path.read_text())
            differences = self.study.differences(found["head"])
            if differences:
                listed = "\n  ".join(differences)
                raise StudyError(f"{self.folder} holds another study:\n  {listed}")
        else:
            units = {name: unit for name, unit, _ in self.study.columns}
            document = {"study": self.study.hash, "head": self.study.head, "units": units}
            write_whole(path, (json.dumps(document, indent=2) + "\n").encode(), force=False)
        return self.rows()

    def rows(self) -> list[dict[str, Any]]:
        """Every row, in order."""
        found: dict[int, dict[str, Any]] = {}
        for path in sorted(self.folder.glob("runs/block=*/*.parquet")):
            # The file alone: the block is no column of the rows.
            for row in self._parquet.ParquetFile(path).read().to_pylist():
                found[row[self.study.key]] = row
        return [found[index] for index in sorted(found)]

    def add(self, rows: list[dict[str, Any]]) -> None:
        """Adds rows, a file a block, each whole or not at all."""
        key = self.study.key
        blocks: dict[int, list[dict[str, Any]]] = {}
        for row in rows:
            blocks.setdefault(row[key] // BLOCK, []).append(row)
        for block, part in blocks.items():
            sink = self._arrow.BufferOutputStream()
            table = self._arrow.Table.from_pylist(part, schema=self._schema)
            self._parquet.write_table(table, sink, compression="zstd")
            name = f"{key}s-{part[0][key]:08d}-{part[-1][key]:08d}-{len(part)}.parquet"
            path = self.folder / "runs" / f"block={block}" / name
            write_whole(path, sink.getvalue().to_pybytes(), force=True)


def work(
    study: Numbered,
    *,
    client: Any,
    out: str | os.PathLike[str] | None,
    batch: int | None,
    largest_batch: int,
    retries: int,
    progress: Progress,
    take: Callable[[Row], Row] = lambda row: row,
) -> tuple[list[Row], int]:
    """Every row of a study in order, and how many were made by this call.

    With ``out``, rows go into the dataset of that folder as they come, and
    those that are there are not made again. ``take`` is given every row that
    comes, and gives what is to be kept.
    """
    if out is None:
        rows = _work(study, range(study.count), client, batch, largest_batch, retries, progress, take, None)
        return sorted(rows, key=lambda row: int(row[study.key])), len(rows)
    dataset = Dataset(out, study)
    with dataset.locked():
        known = {row[study.key] for row in dataset.begin()}
        missing = [index for index in range(study.count) if index not in known]
        _work(study, missing, client, batch, largest_batch, retries, progress, take, dataset)
        return dataset.rows(), len(missing)


def _work(
    study: Numbered,
    wanted: list[int] | range,
    client: Any,
    batch: int | None,
    largest_batch: int,
    retries: int,
    progress: Progress,
    take: Callable[[Row], Row],
    dataset: Dataset | None,
) -> list[Row]:
    made: list[Row] = []
    if not wanted:
        return made
    workers = _workers(client)
    size = batch or max(1, min(largest_batch, len(wanted) // (5 * workers)))
    batches = [list(wanted[k : k + size]) for k in range(0, len(wanted), size)]
    if client is None:
        done = _here(study, batches)
    elif getattr(client, "__name__", "") == "ray":
        done = _on_ray(client, study, batches, retries)
    else:
        done = _on_dask(client, study, batches, retries)
    # Closed at once where progress ends the work: while the client still lives.
    with reporting(progress, study.noun) as tell, closing(done):
        for rows in done:
            kept = [take(row) for row in rows]
            if dataset is not None:
                dataset.add(kept)
            made += kept
            if tell is not None:
                tell(len(made), len(wanted), study.noun)
    return made


def _workers(client: Any) -> int:
    if client is None:
        return 1
    if getattr(client, "__name__", "") == "ray":
        return max(1, int(client.cluster_resources().get("CPU", 1)))
    return max(1, int(sum(client.nthreads().values())))


def _here(study: Numbered, batches: list[list[int]]) -> Rows:
    for indices in batches:
        yield study.work(indices, threads=0)


def _on_dask(
    client: Any, study: Numbered, batches: list[list[int]], retries: int
) -> Rows:
    distributed = need("distributed", "cluster", "a Dask client")
    # A task makes the study on a worker, so that it is made again where that
    # worker is lost.
    shared = client.submit(pickle.loads, pickle.dumps(study), pure=False)
    futures = [
        client.submit(work_batch, shared, indices, retries=retries, pure=False)
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
    ray: Any, study: Numbered, batches: list[list[int]], retries: int
) -> Rows:
    shared = ray.put(study)
    task = ray.remote(max_retries=retries, num_cpus=1)(work_batch)
    waiting = [task.remote(shared, indices) for indices in batches]
    try:
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1)
            yield from ray.get(ready)
    finally:
        for reference in waiting:
            ray.cancel(reference)

"""Designs for many problems or specifications, here or on a cluster."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from . import _core
from ._engine import Numbered, Row, array, work
from ._support import Progress, write_whole
from .design import Specification, Tuned, Verification, as_specification
from .errors import StudyError
from .problem import Problem
from .schedule import Schedule
from .simulation import as_schedule
from .table import Table, Values

TYPES = {"case": "int64", "missed": "int64", "left_out": "int64"}
WORDS = ("status", "reason", "least_margin_axis", "least_margin_model")


class Sweep(Numbered):
    """A sweep that is ready to be worked on. It can be pickled, and so goes to workers."""

    def __init__(
        self,
        problems: Mapping[str, Problem],
        specifications: Mapping[str, Specification],
        schedule: Schedule | None,
        channels: Sequence[str],
        plan: str,
    ) -> None:
        self._made_of = (problems, specifications, schedule, channels, plan)
        self._core = _core.Sweep(
            [(name, problem._core) for name, problem in problems.items()],
            [(name, spec._core) for name, spec in specifications.items()],
            None if schedule is None else schedule._core,
            list(channels),
            plan,
        )
        self.keys: list[str] = self.head["plan"]["keys"]
        self.count = len(self.head["plan"]["cases"])
        self.noun = "cases"
        self.key = "case"

    @property
    def columns(self) -> list[tuple[str, str, str]]:
        """Name, unit and type of every column."""
        return [(name, unit, self._type(name)) for name, unit in self._core.columns()]

    def _type(self, name: str) -> str:
        if name in self.keys or name in WORDS:
            return "string"
        return TYPES.get(name, "float64")

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
        """Where the head of another sweep differs."""
        return self._core.differences(json.dumps(head))

    def work(self, indices: list[int], threads: int = 1) -> list[Row]:
        """Works on these cases; a row has the texts of its schedule and verification beside."""
        rows: list[Row] = []
        for text, schedule, verification in self._core.design(indices, threads):
            row: Row = json.loads(text)
            # What is varied may be of any kind; a column has one.
            for key in self.keys:
                row[key] = row[key] if isinstance(row[key], str) else json.dumps(row[key])
            # Counts are zero where there is no design.
            for key in ("missed", "left_out"):
                row[key] = row[key] or 0
            row["files"] = (schedule, verification)
            rows.append(row)
        return rows

    def __reduce__(self) -> tuple[Any, ...]:
        return (Sweep, self._made_of)


class Designs(Table):
    """Cases of a sweep, a row a case in order: see :class:`~coaxdesign.table.Table`.

    The varied keys are columns of words, as a file has them: ``"250 kg"``.
    ``status`` is ``met``, ``missed`` or ``no_design``, which ``reason`` explains.
    """

    def __init__(
        self,
        study: Sweep,
        rows: list[Row],
        made: int,
        files: Mapping[int, tuple[str, str]],
        folder: Path | None,
    ) -> None:
        columns: dict[str, tuple[str, Values]] = {
            name: (unit, array(kind, [row[name] for row in rows]))
            for name, unit, kind in study.columns
        }
        super().__init__(columns, {"study": json.dumps(study.head)})
        self.head = study.head
        self.made = made
        """Cases that this call worked on; the others were there."""
        self._files = dict(files)
        self._folder = folder

    def schedule(self, case: int) -> Tuned:
        """The schedule of a case, with its verification."""
        if self._folder is not None:
            place = self._folder / f"case-{case:04d}"
            if not (place / "verification.json").exists():
                raise StudyError(f"{place}: there is no design of case {case}")
            texts = [(place / name).read_text() for name in ("schedule.json", "verification.json")]
        elif case in self._files:
            texts = list(self._files[case])
        else:
            raise StudyError(f"there is no design of case {case}")
        return Tuned(_core.Schedule.parse(texts[0]), Verification(json.loads(texts[1])))

    def __repr__(self) -> str:
        met = int((self["status"] == "met").sum())
        keys = ", ".join(self.head["plan"]["keys"])
        return f"<Designs over {keys}: {len(self)} cases, {met} meet all requirements>"


def sweep(
    problem: Problem | Mapping[str, Problem],
    spec: Specification | str | os.PathLike[str] | Mapping[str, Specification] | None = None,
    *,
    vary: Mapping[str, Iterable[object]] | None = None,
    cases: Sequence[Mapping[str, object]] | None = None,
    schedule: Schedule | str | os.PathLike[str] | None = None,
    channels: Iterable[str] = (),
    client: Any = None,
    out: str | os.PathLike[str] | None = None,
    batch: int = 1,
    retries: int = 3,
    progress: Progress = None,
) -> Designs:
    """Tunes a schedule for each of many problems or specifications, as ``coaxdesign sweep``.

    :param problem: the problem, or several by name, over which is swept too.
    :param spec: the specification, or several by name, over which is swept too.
    :param vary: values by key of the problem file, such as
        ``{"mass.mass": ["250 kg", "300 kg"]}``, or, after ``spec.``, of the
        specification, such as ``"spec.hardware.delay"``. Values are as a file
        has them. Every combination is a case.
    :param cases: cases one by one instead, each with a value of every key.
    :param schedule: verify this schedule in every case, instead of tuning.
    :param channels: outer loops to tune; all of the specification where none is named.
    :param client: a ``dask.distributed.Client``, or the module ``ray`` after
        ``ray.init()``; every core of this machine where not given.
    :param out: folder of the results: ``study.json``, the dataset, and the
        schedule of every case; a sweep that is there is gone on with.
    :param batch: cases of one task.
    :param retries: how often a failed task is tried again.

    A mistake in a key or a value raises before anything is tuned. A case
    without a design is a row that says why.
    """
    problems = dict(problem) if isinstance(problem, Mapping) else {problem.name: problem}
    if isinstance(spec, Mapping):
        specifications = dict(spec)
    else:
        one = as_specification(spec)
        specifications = {one._core.file[0]: one}
    if cases is not None and vary is not None:
        raise ValueError("give vary or cases, not both")
    if cases is not None:
        keys = list(cases[0]) if cases else []
        wrong = [k for k, case in enumerate(cases) if set(case) != set(keys)]
        if wrong:
            raise ValueError(f"case {wrong[0]} has other keys than the first")
        plan = json.dumps({"keys": keys, "cases": [[case[key] for key in keys] for case in cases]})
    else:
        factors: list[tuple[str, list[object]]] = [
            (key, list(values)) for key, values in (vary or {}).items()
        ]
        named = [key for key, _ in factors]
        if isinstance(problem, Mapping) and "problem" not in named:
            factors.append(("problem", list(problems)))
        if isinstance(spec, Mapping) and "specification" not in named:
            factors.append(("specification", list(specifications)))
        plan = _core.sweep_grid(json.dumps(factors))
    law = None if schedule is None else as_schedule(schedule)
    study = Sweep(problems, specifications, law, list(channels), plan)
    folder = None if out is None else Path(out)
    files: dict[int, tuple[str, str]] = {}

    def take(row: Row) -> Row:
        text, verification = row.pop("files")
        if text is not None and folder is not None:
            # Before the row, so that no row lacks its schedule.
            place = folder / f"case-{row['case']:04d}"
            write_whole(place / "schedule.json", text.encode(), force=True)
            write_whole(place / "verification.json", verification.encode(), force=True)
        elif text is not None:
            files[row["case"]] = (text, verification)
        return row

    rows, made = work(
        study,
        client=client,
        out=out,
        batch=batch,
        largest_batch=1,
        retries=retries,
        progress=progress,
        take=take,
    )
    return Designs(study, rows, made, files, folder)

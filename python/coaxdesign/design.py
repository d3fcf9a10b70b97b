"""Tuning and verification."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._support import Progress, reporting, write_whole
from .models import Models
from .problem import Problem
from .schedule import Schedule
from .table import Table, Values


class Specification:
    """What gains must meet: made by :meth:`load`. It can be pickled."""

    def __init__(self, core: _core.Specification) -> None:
        self._core = core

    @classmethod
    def load(cls, source: str | os.PathLike[str] | None = None) -> Specification:
        """A specification from a file or TOML text, or the built-in one.

        Raises :class:`~coaxdesign.errors.SpecificationError` with everything
        that is wrong.
        """
        if source is None:
            return cls(_core.Specification.builtin())
        if isinstance(source, str) and "\n" in source:
            return cls(_core.Specification.parse("<text>", source))
        return cls(_core.Specification.read(Path(source)))

    @property
    def speeds(self) -> Values:
        """Breakpoints, true airspeed in m/s; shape (n,)."""
        return np.asarray(self._core.speeds)

    @property
    def models(self) -> list[str]:
        """Names of the models, the nominal first."""
        return self._core.models

    @property
    def text(self) -> str:
        """The text that it was read from, to be changed and loaded again."""
        return self._core.file[1]

    def __repr__(self) -> str:
        name, _ = self._core.file
        return f"<Specification {name!r}: {len(self.speeds)} speeds, {len(self.models)} models>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_specification_again, self._core.file)


def _specification_again(name: str, text: str) -> Specification:
    return Specification(_core.Specification.parse(name, text))


class Verification:
    """Every metric of a law at and between its breakpoints.

    ``document`` is what ``verification.json`` holds, ``rows`` a table with a
    row for every axis, speed and model.
    """

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document

    @property
    def met(self) -> bool:
        """Whether every requirement is met and no model was left out."""
        return bool(self.document["passed"]) and not self.document["left_out"]

    @property
    def rows(self) -> Table:
        """A row for every axis, speed and model; what is infinite or missing is NaN."""
        rows = self.document["rows"]
        columns: dict[str, tuple[str, Values]] = {}
        for name in dict.fromkeys(name for row in rows for name in row if name != "missed"):
            values = [row.get(name) for row in rows]
            numeric = any(isinstance(value, float) for value in values)
            if numeric:
                array = np.array([np.nan if v is None else v for v in values], dtype=np.float64)
            elif all(isinstance(value, bool) for value in values):
                array = np.array(values, dtype=np.bool_)
            else:
                array = np.array(["" if value is None else str(value) for value in values])
            columns[name] = (_unit(name), array)
        columns["missed"] = (
            "",
            np.array([", ".join(str(m["requirement"]) for m in row["missed"]) for row in rows]),
        )
        return Table(columns)

    @property
    def missed(self) -> Table:
        """The rows that miss a requirement."""
        rows = self.rows
        wanted = ~rows["passed"]
        return Table({name: (rows.units[name], rows[name][wanted]) for name in rows})

    @property
    def explanations(self) -> list[dict[str, Any]]:
        """Why targets are missed, an entry an axis; of a tuning only."""
        found: list[dict[str, Any]] = self.document["explanations"]
        return found

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes ``verification.json`` into a folder, or the file that ends in ``.json``."""
        path = Path(path)
        if path.suffix != ".json":
            path = path / "verification.json"
        write_whole(path, (json.dumps(self.document, indent=2) + "\n").encode(), force)
        return path

    def __repr__(self) -> str:
        rows = self.document["rows"]
        missed = sum(not row["passed"] for row in rows)
        return f"<Verification: {len(rows)} rows, {missed} miss a requirement>"


UNITS = {"_m_s": "m/s", "_rad_s": "rad/s", "_db": "dB", "_deg": "deg", "_s": "s", "_percent": "%"}


def _unit(name: str) -> str:
    return next((unit for ending, unit in UNITS.items() if name.endswith(ending)), "1")


def as_specification(spec: Specification | str | os.PathLike[str] | None) -> Specification:
    """The specification itself, or loaded; the built-in one where none is given."""
    return spec if isinstance(spec, Specification) else Specification.load(spec)


class Tuned(Schedule):
    """A schedule that was tuned here, with its verification."""

    def __init__(self, core: _core.Schedule, verification: Verification) -> None:
        super().__init__(core)
        self.verification = verification

    def explain(self) -> list[dict[str, Any]]:
        """Why targets are missed: for every axis at its hardest breakpoint, each target with
        what it could be; see ``explain`` of :func:`tune`."""
        return self.verification.explanations

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Writes ``schedule.json`` and ``verification.json`` into a folder, or one ``.json``."""
        written = super().save(path, force=force)
        if written.name == "schedule.json":
            self.verification.save(written.parent, force=force)
        return written

    def __reduce__(self) -> tuple[Any, ...]:
        return (_tuned_again, (self.to_json(), self.verification.document))


def _tuned_again(text: str, document: dict[str, Any]) -> Tuned:
    return Tuned(_core.Schedule.parse(text), Verification(document))


def tune(
    problem: Problem | Models,
    spec: Specification | str | os.PathLike[str] | None = None,
    *,
    channels: Iterable[str] = (),
    nominal_only: bool = False,
    explain: bool = False,
    progress: Progress = None,
) -> Tuned:
    """Tunes a schedule to a specification and verifies it, as ``coaxdesign tune-gains`` does.

    :param problem: a problem, or linear models from elsewhere.
    :param spec: specification, a file or TOML text; the built-in one where not given.
    :param channels: outer loops to tune; all of the specification where none is named.
    :param nominal_only: tune on the nominal model alone.
    :param explain: explain every axis, not only what misses.

    Requirements that cannot be met are no error: the least-violating schedule
    comes back, and ``requirements_met`` is false.
    """
    wanted = as_specification(spec)
    if nominal_only:
        wanted = Specification(wanted._core.nominal_only())
    with reporting(progress, "tuning") as tell:
        if isinstance(problem, Models):
            models = problem.under(wanted)
            core, document = _core.tune_models(
                models, wanted._core, list(channels), explain, tell
            )
        else:
            core, document = _core.tune(
                problem._core, wanted._core, list(channels), explain, tell
            )
    return Tuned(core, Verification(json.loads(document)))


def verify(
    schedule: Schedule | str | os.PathLike[str],
    problem: Problem | Models,
    spec: Specification | str | os.PathLike[str] | None = None,
    *,
    progress: Progress = None,
) -> Verification:
    """Verifies a schedule, tuned here or elsewhere, against a specification, whose hardware it takes."""
    law = schedule if isinstance(schedule, Schedule) else Schedule.load(schedule)
    with reporting(progress, "verifying") as tell:
        wanted = as_specification(spec)
        if isinstance(problem, Models):
            document = _core.verify_models(
                law._core, problem.under(wanted), wanted._core, tell
            )
        else:
            document = _core.verify(law._core, problem._core, wanted._core, tell)
    return Verification(json.loads(document))

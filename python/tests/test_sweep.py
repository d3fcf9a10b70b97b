"""Sweeps and whole designs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import coaxdesign as cx

VARY = {"spec.hardware.delay": ["20 ms", "35 ms"], "mass.mass": ["450 kg", "470 kg"]}


@pytest.fixture(scope="module")
def small(root: Path) -> cx.Specification:
    """The built-in specification in hover, for the nominal model."""
    lines = (root / "problems" / "hq.toml").read_text().splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if line.startswith("speeds"))
    lines[at] = 'speeds = ["0 kt"]\n'
    begin = next(k for k, line in enumerate(lines) if line.startswith("[models.no_inter"))
    end = next(k for k, line in enumerate(lines) if line.startswith("[margins.nominal"))
    return cx.Specification.load("".join(lines[:begin] + lines[end:]))


@pytest.fixture(scope="module")
def whole(problem: cx.Problem, small: cx.Specification) -> cx.Designs:
    return cx.sweep(problem, small, vary=VARY)


def same(a: cx.Designs, b: cx.Designs) -> None:
    assert a.columns == b.columns
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_every_case_has_a_design(
    whole: cx.Designs, problem: cx.Problem, small: cx.Specification
) -> None:
    assert whole["case"].tolist() == [0, 1, 2, 3]
    assert whole["mass.mass"].tolist() == ["450 kg", "470 kg"] * 2
    assert whole.units["least_phase_margin_deg"] == "deg"
    assert set(whole["status"]) <= {"met", "missed"}
    # A case is the tuning of that problem and that specification.
    heavy = cx.Problem.load('extends = "coax2d.toml"\n[mass]\nmass = "470 kg"\n')
    at = small.text.index("delay =")
    text = small.text[:at] + 'delay = "35 ms"\n' + small.text[small.text.index("\n", at) + 1 :]
    alone = cx.tune(heavy, cx.Specification.load(text))
    found = whole.schedule(3)
    assert alone.speeds.tolist() == found.speeds.tolist()
    for channel in ("roll.k_p", "pitch.k_p", "yaw.k_p", "heave.k_p"):
        assert alone.at(0.0)[channel] == found.at(0.0)[channel]
    assert found.verification.rows["pm_deg"].min() >= whole["least_phase_margin_deg"][3]


def test_it_goes_on_where_it_was_left_and_is_the_programs(
    whole: cx.Designs,
    problem: cx.Problem,
    small: cx.Specification,
    tmp_path: Path,
    program: Callable[..., str],
) -> None:
    jsonschema = pytest.importorskip("jsonschema")

    class Enough(Exception):
        pass

    def enough(done: int, total: int) -> None:
        if done >= 2:
            raise Enough

    with pytest.raises(Enough):
        cx.sweep(problem, small, vary=VARY, out=tmp_path / "a", progress=enough)
    rest = cx.sweep(problem, small, vary=VARY, out=tmp_path / "a")
    assert rest.made == 2
    same(rest, whole)
    assert rest.schedule(1) == whole.schedule(1)
    study = json.loads((tmp_path / "a" / "study.json").read_text())
    jsonschema.validate(study, json.loads(program("schema", "study")))
    with pytest.raises(cx.StudyError, match="another study"):
        cx.sweep(problem, small, vary={"mass.mass": ["450 kg"]}, out=tmp_path / "a")
    # The program's rows, to the last digit.
    (tmp_path / "small.toml").write_text(small.text)
    vary = [f"{key}={','.join(values)}" for key, values in VARY.items()]
    text = program(
        "sweep", "--spec", str(tmp_path / "small.toml"), "--quiet", "--format", "json",
        "--vary", vary[0], "--vary", vary[1],
    )
    for row, margin in zip(json.loads(text)["rows"], whole["least_margin_percent"], strict=True):
        assert row["least_margin_percent"] == margin


def test_dask_gives_the_same_rows(
    whole: cx.Designs, problem: cx.Problem, small: cx.Specification
) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as local,
        distributed.Client(local) as client,
    ):
        same(cx.sweep(problem, small, vary=VARY, client=client), whole)


def test_problems_and_a_schedule_are_swept(
    problem: cx.Problem, small: cx.Specification, schedule: cx.Schedule
) -> None:
    heavy = cx.Problem.load('extends = "coax2d.toml"\n[mass]\nmass = "5000 kg"\n')
    found = cx.sweep({"own": problem, "heavy": heavy}, small, schedule=schedule)
    assert found["problem"].tolist() == ["own", "heavy"]
    assert found["status"][1] == "no_design"
    assert "trim" in found["reason"][1]
    assert np.isnan(found["least_margin_percent"][1])
    with pytest.raises(cx.StudyError, match="no design of case 1"):
        found.schedule(1)


def test_mistakes_are_said_before_anything_is_tuned(
    problem: cx.Problem, small: cx.Specification
) -> None:
    with pytest.raises(cx.ProblemError, match="mas"):
        cx.sweep(problem, small, vary={"mass.mas": ["450 kg"]})
    with pytest.raises(cx.StudyError, match="nothing is varied"):
        cx.sweep(problem, small)
    with pytest.raises(ValueError, match="not both"):
        cx.sweep(problem, small, vary=VARY, cases=[{}])


def test_a_design_in_one_call(
    problem: cx.Problem, small: cx.Specification, tmp_path: Path, program: Callable[..., str]
) -> None:
    hold = 'title = "Hold"\nduration = "1 s"\nmode = "velocity"\n'
    made = cx.design(
        problem, small, maneuver=hold, out=tmp_path / "d", exports=["json"], unverified=True
    )
    assert made.flight.status == "completed"
    assert made.trim.converged.all()
    assert made.models.a.shape == (1, 8, 8)
    assert made.met == made.verification.met
    assert [path.suffix for path in made.exports] == [".json"]
    assert cx.Schedule.load(tmp_path / "d") == made.schedule
    # A design that the program reads: aircraft, specification, schedule.
    shown = json.loads(program("check", str(tmp_path / "d"), "--format", "json"))
    assert shown["name"] == problem.name
    with pytest.raises(FileExistsError):
        cx.design(problem, small, maneuver=hold, out=tmp_path / "d")
    with pytest.raises(ValueError, match="give out"):
        cx.design(problem, small, exports=["json"])

"""Monte Carlo studies: rows, the dataset, and clusters."""

from __future__ import annotations

import json
import os
import pickle
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coaxdesign as cx

HOLD = """
title = "A second of hover"
duration = "1 s"
mode = "velocity"
"""


def fly(problem: cx.Problem, schedule: cx.Schedule, **more: Any) -> cx.MonteCarlo:
    return cx.montecarlo(problem, schedule, HOLD, **({"runs": 24, "seed": 3} | more))


@pytest.fixture(scope="module")
def here(problem: cx.Problem, schedule: cx.Schedule) -> cx.MonteCarlo:
    """The study on this machine alone."""
    return fly(problem, schedule)


def same(a: cx.MonteCarlo, b: cx.MonteCarlo) -> None:
    assert a.columns == b.columns
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_rows(here: cx.MonteCarlo) -> None:
    assert len(here) == here.flown == 24
    assert here["run"].tolist() == list(range(24))
    assert np.unique(here["seed"]).size == 24
    assert (np.abs(here["mass_factor"] - 1.0) <= 0.1).all()
    assert here.units["forward_velocity_peak_m_s"] == "m/s"
    assert 0.0 <= here.confidence[0] <= here.success_rate <= here.confidence[1] <= 1.0
    assert "A second of hover" in repr(here)


def test_a_run_is_that_flight(
    here: cx.MonteCarlo, problem: cx.Problem, schedule: cx.Schedule
) -> None:
    """A run of the study, flown by itself with its variation and seed."""
    k = 5
    drawn = cx.Variation(
        mass=here["mass_factor"][k],
        inertia=here["inertia_factor"][k],
        center_of_gravity=here["center_of_gravity_shift_m"][k],
        delay=here["extra_delay_s"][k],
        turbulence=here["turbulence_m_s"][k],
        inflow=here["interference_factor"][k],
        gust=tuple(here[f"gust_{way}_m_s"][k] for way in ("forward", "right", "up")),
    )
    flown = cx.simulate(problem, schedule, HOLD, variation=drawn, seed=int(here["seed"][k]))
    assert flown.status == here["status"][k]
    assert flown.metrics["roll_peak_rad"] == here["phi_peak_rad"][k]


def test_a_study_goes_on_where_it_was_left(
    here: cx.MonteCarlo, problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path
) -> None:
    class Enough(Exception):
        pass

    def enough(done: int, total: int) -> None:
        if done >= 10:
            raise Enough

    with pytest.raises(Enough):
        fly(problem, schedule, out=tmp_path, batch=5, progress=enough)
    rest = fly(problem, schedule, out=tmp_path, batch=5)
    assert rest.flown == 14
    same(rest, here)
    assert fly(problem, schedule, out=tmp_path).flown == 0


def test_study_json_follows_its_schema(
    problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path, program: Callable[..., str]
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    fly(problem, schedule, out=tmp_path, runs=2)
    study = json.loads((tmp_path / "study.json").read_text())
    jsonschema.validate(study, json.loads(program("schema", "study")))


def test_another_study_is_refused_by_what_differs(
    problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path
) -> None:
    fly(problem, schedule, out=tmp_path, runs=2)
    with pytest.raises(cx.StudyError, match=r"model.mass: 1.0 there, 1.05 here"):
        fly(problem, schedule, out=tmp_path, runs=2, variation=cx.Variation(mass=1.05))
    with pytest.raises(cx.StudyError, match=r"runs: 2 there, 3 here"):
        fly(problem, schedule, out=tmp_path, runs=3)
    other = cx.Problem.load('extends = "coax2d.toml"\n[mass]\nmass = "451 kg"\n')
    with pytest.raises(cx.StudyError, match=r"problem.hash"):
        fly(other, schedule, out=tmp_path, runs=2)


def test_two_programs_do_not_fly_into_one_folder(
    problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path
) -> None:
    def second(done: int, total: int) -> None:
        with pytest.raises(cx.StudyError, match="another program"):
            fly(problem, schedule, out=tmp_path)

    fly(problem, schedule, out=tmp_path, runs=2, progress=second)


def test_the_dataset_is_parquet_with_units(
    here: cx.MonteCarlo, problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path
) -> None:
    duckdb = pytest.importorskip("duckdb")
    import polars
    import pyarrow.parquet as parquet

    fly(problem, schedule, out=tmp_path, batch=7)
    files = sorted(tmp_path.glob("runs/block=0/*.parquet"))
    assert len(files) == 4
    field = parquet.read_schema(files[0]).field("phi_peak_rad")
    assert field.metadata == {b"unit": b"rad"}
    pattern = f"{tmp_path}/runs/*/*.parquet"
    found = duckdb.sql(f"select count(*), max(phi_peak_rad) from '{pattern}'").fetchall()[0]
    assert found == (24, here["phi_peak_rad"].max())
    frame = polars.scan_parquet(pattern).filter(polars.col("success")).collect()
    assert len(frame) == here["success"].sum()


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


def test_dask_gives_the_same_rows(
    cluster: Any, here: cx.MonteCarlo, problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path
) -> None:
    same(fly(problem, schedule, client=cluster, out=tmp_path), here)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs SIGKILL")
def test_a_lost_worker_loses_no_run(
    cluster: Any, here: cx.MonteCarlo, problem: cx.Problem, schedule: cx.Schedule, tmp_path: Path
) -> None:
    killed: list[int] = []

    def kill(done: int, total: int) -> None:
        if not killed and done >= 4:
            victim = next(iter(cluster.run(os.getpid).values()))
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    flown = fly(problem, schedule, client=cluster, out=tmp_path, batch=2, progress=kill)
    assert killed
    same(flown, here)


def test_a_study_travels(problem: cx.Problem, schedule: cx.Schedule) -> None:
    from coaxdesign.montecarlo import Criterion, Ranges, Study

    equipment = {
        "control_rate": 100.0, "steps_per_revolution": 36, "pitch_rate_limit": None, "seed": 1,
    }
    study = Study(
        problem, schedule, cx.Maneuver.load(HOLD), cx.Variation(), equipment, 9, Ranges(),
        Criterion(),
    )
    again = pickle.loads(pickle.dumps(study))
    assert again.hash == study.hash
    assert again.fly([4]) == study.fly([4])
    with pytest.raises(cx.StudyError, match="0 to 8"):
        study.fly([9])

"""Trims."""

from __future__ import annotations

import csv
import io
import pickle
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import coaxdesign as cx


@pytest.fixture(scope="module")
def trim(problem: cx.Problem) -> cx.Trim:
    return problem.trim(cx.kt(range(0, 91, 30)))


def test_val_hover_of_the_paper(problem: cx.Problem) -> None:
    """Thrust and power beside the published ones; the parts of the power make the whole."""
    hover = problem.trim(0.0, interactions=False)
    for rotor in problem.rotors:
        # Kreienkamp et al., Table 2: 494.8 lbf and 23.08 hp a rotor.
        assert cx.to_lbf(hover[f"{rotor}.thrust"][0]) == pytest.approx(494.8, rel=0.01)
        assert cx.to_hp(hover[f"{rotor}.power"][0]) == pytest.approx(23.08, rel=0.05)
    assert hover["power"][0] == pytest.approx(hover["upper.power"][0] + hover["lower.power"][0])
    parts = [hover[f"power.{part}"][0] for part in ("profile", "induced", "parasite", "climb")]
    assert sum(parts) == pytest.approx(hover["power"][0], rel=0.02)


def test_same_numbers_as_the_program(trim: cx.Trim, program: Callable[..., str]) -> None:
    text = program(
        "trim", "--speeds", "0:90:30kt", "--interactions", "on", "--format", "csv", "--units", "si"
    )
    rows = list(csv.DictReader(io.StringIO(text)))
    pairs = {
        "speed_m_s": "airspeed",
        "roll_rad": "phi",
        "pitch_rad": "theta",
        "lat_percent": "lat_stick",
        "col_percent": "col_stick",
        "upper.thrust_n": "upper.thrust",
        "lower.power_w": "lower.power",
        "upper.beta_1s_rad": "upper.beta_1s",
        "total_power_w": "power",
    }
    for theirs, ours in pairs.items():
        np.testing.assert_allclose(
            trim[ours], [float(row[theirs]) for row in rows], rtol=1e-11, atol=1e-13, err_msg=ours
        )
    assert [row["status"] for row in rows] == trim["status"].tolist()


def test_columns_have_units_and_share_memory(trim: cx.Trim) -> None:
    assert len(trim) == 4
    assert trim.units["airspeed"] == "m/s"
    assert trim.units["upper.power"] == "W"
    assert trim.units["lat_stick"] == "%"
    assert trim.units["theta"] == "rad"
    for name in trim:
        assert trim[name].shape == (4,)
    # NumPy looks at the library's own memory.
    assert not trim["power"].flags.owndata
    with pytest.raises(KeyError, match="airspeed"):
        trim["speed"]


def test_orbits_are_periodic(trim: cx.Trim) -> None:
    names = [name for name, _ in trim.states]
    assert names[:8] == ["u", "v", "w", "p", "q", "r", "phi", "theta"]
    for orbit, steps in zip(trim.orbits, trim["steps"], strict=True):
        assert orbit.shape == (steps, len(names))
        # The step from the last sample to the first is like any other.
        jumps = np.abs(np.diff(np.vstack([orbit, orbit[:1]]), axis=0))
        assert (jumps[-1] <= 1.5 * jumps[:-1].max(axis=0) + 1e-9).all()


def test_points_that_fail_say_why(problem: cx.Problem) -> None:
    far = problem.trim(cx.kt([40, 250]))
    assert far.converged.tolist() == [True, False]
    assert far["reason"][0] == ""
    assert far["reason"][1] != ""
    assert "svg" in far.plot().svg


def test_frames(trim: cx.Trim) -> None:
    arrow = trim.to_arrow()
    assert arrow.schema.field("power").metadata == {b"unit": b"W"}
    assert arrow.schema.metadata[b"problem"] == b"coax2d"
    polars = trim.to_polars(units_in_names=True)
    assert polars["power [W]"].to_list() == trim["power"].tolist()
    pandas = trim.to_pandas()
    assert pandas.attrs["units"]["power"] == "W"
    dataset = trim.to_xarray()
    assert dataset["power"].attrs["units"] == "W"
    np.testing.assert_array_equal(dataset["airspeed"], trim["airspeed"])


def test_parquet_carries_units(trim: cx.Trim, tmp_path: Path) -> None:
    import pyarrow.parquet as parquet

    path = tmp_path / "trim.parquet"
    trim.write_parquet(path)
    back = parquet.read_table(path)
    assert back.schema.field("upper.thrust").metadata[b"unit"] == b"N"
    assert parquet.ParquetFile(path).metadata.row_group(0).column(0).compression == "ZSTD"
    with pytest.raises(FileExistsError):
        trim.write_parquet(path)
    trim.write_parquet(path, force=True)


def test_shown_in_notebooks(trim: cx.Trim) -> None:
    figure = trim.plot()
    assert figure._repr_svg_().startswith("<svg")
    assert "airspeed" in figure.svg
    assert trim._repr_html_().count("<tr>") == 5


def test_travels(trim: cx.Trim) -> None:
    again = pickle.loads(pickle.dumps(trim))
    assert again["power"].tolist() == trim["power"].tolist()
    assert again.plot().svg == trim.plot().svg


def test_bad_conditions_are_refused(problem: cx.Problem) -> None:
    with pytest.raises(cx.UnitError, match="speed of sound"):
        problem.trim([-1.0])
    with pytest.raises(cx.UnitError, match="both"):
        problem.trim(0.0, sideslip=0.0, bank=0.0)
    with pytest.raises(cx.UnitError, match="degrees"):
        problem.trim(10.0, bank=45.0)
    with pytest.raises(ValueError, match="one dimension"):
        problem.trim([[1.0]])


def test_progress_tells_every_point(problem: cx.Problem) -> None:
    told: list[tuple[int, int]] = []
    problem.trim(cx.kt([0, 10, 20]), progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (3, 3)
    assert all(a <= b for a, b in zip(told, told[1:], strict=False))


def test_a_fault_of_the_callback_ends_the_work(problem: cx.Problem) -> None:
    class Enough(Exception):
        pass

    def enough(done: int, total: int) -> None:
        assert done < total, "the work went on to its end"
        raise Enough

    with pytest.raises(Enough):
        problem.trim(cx.kt(np.linspace(0, 90, 1000)), progress=enough)


def test_other_threads_run_meanwhile(problem: cx.Problem) -> None:
    work = threading.Thread(target=lambda: problem.trim(cx.kt(np.linspace(0, 90, 60))))
    work.start()
    turns = 0
    while work.is_alive():
        turns += 1
        time.sleep(0.001)
    # A library that kept the interpreter's lock would leave one or two.
    assert turns > 10


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent as on POSIX")
def test_control_c_ends_the_work(problem: cx.Problem) -> None:
    import os
    import signal

    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    told = 0

    def tell(done: int, total: int) -> None:
        nonlocal told
        told = done

    with pytest.raises(KeyboardInterrupt):
        problem.trim(cx.kt(np.linspace(0, 90, 1000)), progress=tell)
    timer.join()
    assert told < 1000

"""Flights."""

from __future__ import annotations

import csv
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import coaxdesign as cx

SHORT = """
title = "Two seconds of hover"
duration = "2 s"
mode = "velocity"
"""


@pytest.fixture(scope="module")
def flight(problem: cx.Problem, schedule: cx.Schedule) -> cx.Flight:
    return cx.simulate(problem, schedule, SHORT)


def test_hover_stays(flight: cx.Flight) -> None:
    assert flight.status == "completed"
    assert len(flight) == 201
    np.testing.assert_allclose(flight["time"], np.arange(201) * 0.01, atol=1e-12)
    assert np.hypot(flight["north"], flight["east"]).max() < 1.0
    assert flight.metrics["end"]["status"] == "completed"
    assert flight.units["upper.power"] == "W"
    assert flight.units["heading"] == "rad"


def test_the_figure_shows_what_was_flown(flight: cx.Flight) -> None:
    us, si = flight.plot().svg, flight.plot("si").svg
    for word in ("forward velocity", "reference", "command", "height", "upper power", "lat stick"):
        assert word in us, word
    assert "kW" in si
    assert "kW" not in us


def test_units_are_in_the_fields(flight: cx.Flight) -> None:
    schema = flight.to_arrow().schema
    assert schema.field("lat_stick").metadata == {b"unit": b"%"}
    assert schema.metadata[b"maneuver"] == b"Two seconds of hover"
    assert b"mass" in schema.metadata[b"variation"]


def test_same_flight_as_the_program(
    problem: cx.Problem, schedule: cx.Schedule, program: Callable[..., str], tmp_path: Path
) -> None:
    path = tmp_path / "short.toml"
    path.write_text(SHORT + '\n[turbulence]\nwind_at_20_ft = "10 kt"\n')
    output = tmp_path / "flight.csv"
    program(
        "simulate", "designs/coax2d", "-m", str(path), "--units", "si", "--seed", "3",
        "--model", "mass=1.05", "-o", str(output),
    )
    flown = cx.simulate(
        problem, schedule, path, seed=3, variation=cx.Variation(mass=1.05)
    )
    with output.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(flown)
    for theirs, ours in {"time_s": "time", "north_m": "north", "u_m_per_s": "u"}.items():
        # The program writes nine digits, so a relative 5e-9 is lost.
        np.testing.assert_allclose(
            flown[ours], [float(row[theirs]) for row in rows], rtol=6e-9, atol=1e-15
        )
    assert np.ptp(flown["wind_north"]) > 0.1


def test_every_tenth_period(problem: cx.Problem, schedule: cx.Schedule, flight: cx.Flight) -> None:
    sparse = cx.simulate(problem, schedule, SHORT, every=10)
    np.testing.assert_array_equal(sparse["theta"], flight["theta"][::10])


def test_maneuvers_by_name_file_and_text(tmp_path: Path) -> None:
    assert "slalom" in cx.Maneuver.names()
    slalom = cx.Maneuver.load("slalom")
    assert slalom.duration > 0
    path = tmp_path / "mine.toml"
    path.write_text(SHORT)
    assert cx.Maneuver.load(path).title == cx.Maneuver.load(SHORT).title
    again = pickle.loads(pickle.dumps(slalom))
    assert again.title == slalom.title
    with pytest.raises(cx.ManeuverError) as caught:
        cx.Maneuver.load(SHORT + 'duraton = "3 s"\n')
    assert caught.value.findings[0].line == 5
    with pytest.raises(cx.ManeuverError, match="slalom"):
        cx.Maneuver.load("slalm")


def test_refusals(problem: cx.Problem, schedule: cx.Schedule) -> None:
    with pytest.raises(cx.SimulationError, match="schedule"):
        cx.simulate(problem, None, SHORT)
    with pytest.raises(cx.SimulationError):
        cx.simulate(problem, schedule, SHORT, control_rate=-1.0)


def test_an_open_loop_flight_needs_no_law(problem: cx.Problem) -> None:
    flown = cx.simulate(problem, None, "lateral-doublet")
    assert "forward_velocity_command" not in flown
    assert np.ptp(flown["lat_stick"]) > 0

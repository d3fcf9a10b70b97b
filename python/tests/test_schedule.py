"""Schedules."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import coaxdesign as cx


def test_loads_from_folder_file_and_text(schedule: cx.Schedule, root: Path) -> None:
    path = root / "designs" / "coax2d" / "schedule.json"
    assert cx.Schedule.load(path) == schedule == cx.Schedule.load(path.read_text())
    assert schedule.to_json() == path.read_text()
    assert schedule.requirements_met
    assert schedule.provenance["generator"].startswith("coaxdesign")


def test_law_at_breakpoints_and_between(schedule: cx.Schedule) -> None:
    points = json.loads(schedule.to_json())["points"]
    speeds = schedule.speeds
    at = schedule.at(speeds)
    assert at["roll.k_p"].tolist() == [p["gains"]["roll"]["k_p"] for p in points]
    assert at["trim.theta"].tolist() == [p["trim"]["pitch"] for p in points]
    np.testing.assert_array_equal(
        at["feedback"], [p["matrices"]["feedback"] for p in points]
    )
    middle = schedule.at(0.5 * (speeds[1:] + speeds[:-1]))
    for name in at.keys():
        mean = 0.5 * (at[name][1:] + at[name][:-1])
        np.testing.assert_allclose(middle[name], mean, rtol=1e-12, atol=1e-12, err_msg=name)
    beyond = schedule.at([speeds[-1] + 50.0])
    np.testing.assert_array_equal(beyond["allocation"][0], at["allocation"][-1])
    assert at.units["roll.k_p"] == "1/s^2"
    with pytest.raises(cx.ScheduleError):
        schedule.at([np.nan])


def test_saves_whole_and_asks_before_replacing(schedule: cx.Schedule, tmp_path: Path) -> None:
    path = schedule.save(tmp_path / "design")
    assert path.name == "schedule.json"
    with pytest.raises(FileExistsError, match="force=True"):
        schedule.save(tmp_path / "design")
    schedule.save(tmp_path / "design", force=True)
    assert cx.Schedule.load(tmp_path / "design") == schedule
    assert [p.name for p in (tmp_path / "design").iterdir()] == ["schedule.json"]


def test_exports(schedule: cx.Schedule, tmp_path: Path) -> None:
    paths = schedule.export("c", tmp_path, name="law")
    assert sorted(p.name for p in paths) == ["law_law.c", "law_law.h"]
    with pytest.raises(FileExistsError):
        schedule.export("c", tmp_path, name="law")
    with pytest.raises(cx.ExportError, match="jsbsim"):
        schedule.export("simulink", tmp_path)
    assert "c" in cx.Schedule.formats()


def test_unmet_requirements_are_not_exported_in_silence(
    schedule: cx.Schedule, tmp_path: Path
) -> None:
    value = json.loads(schedule.to_json())
    value["requirements_met"] = False
    unmet = cx.Schedule.load(json.dumps(value))
    with pytest.raises(cx.ExportError, match="unverified=True"):
        unmet.export("json", tmp_path)
    with pytest.warns(UserWarning, match="do not fly"):
        unmet.export("json", tmp_path, unverified=True)


def test_bad_texts_are_refused(tmp_path: Path) -> None:
    with pytest.raises(cx.ScheduleError, match="schema"):
        cx.Schedule.load('{"schema": "coaxdesign.schedule/99"}')
    bad = tmp_path / "schedule.json"
    bad.write_text("{}")
    with pytest.raises(cx.ScheduleError, match="schedule.json"):
        cx.Schedule.load(tmp_path)


def test_travels(schedule: cx.Schedule) -> None:
    assert pickle.loads(pickle.dumps(schedule)) == schedule

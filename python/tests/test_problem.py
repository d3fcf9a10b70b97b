"""Problems: where they come from, what is said of wrong ones, how they travel."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import coaxdesign as cx


def test_builtin_names_load(problem: cx.Problem) -> None:
    assert cx.Problem.names()[0] == "coax2d"
    assert problem.rotors == ["upper", "lower"]
    # The paper's Table 1: 450 kg.
    assert problem.mass == pytest.approx(450, abs=0.5)
    assert "coax2d" in repr(problem)


def test_file_text_and_name_are_the_same_problem(problem: cx.Problem, root: Path) -> None:
    path = root / "problems" / "coax2d.toml"
    from_file = cx.Problem.load(path)
    from_text = cx.Problem.load(path.read_text())
    from_base = cx.Problem.load('extends = "coax2d.toml"\n', base=root / "problems")
    assert from_file.hash == problem.hash == from_text.hash
    assert from_base.mass == problem.mass
    assert from_base.hash != problem.hash


def test_everything_wrong_is_said_at_once() -> None:
    text = 'extends = "coax2d.toml"\n[mass]\nmas = "600 lb"\nmass = "600 ft"\n'
    with pytest.raises(cx.ProblemError) as caught:
        cx.Problem.load(text)
    error = caught.value
    assert isinstance(error, (cx.InputError, ValueError))
    errors = [finding for finding in error.findings if finding.severity == "error"]
    assert [(f.line, f.column) for f in errors] == [(3, 1), (4, 8)]
    assert "mass" in errors[0].help
    assert errors[0].file == "<text>"
    assert "<text>:3:1" in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.findings) == (str(error), error.findings)


def test_a_missing_file_is_an_error_with_help() -> None:
    with pytest.raises(cx.ProblemError, match="no such file"):
        cx.Problem.load("nothing-here.toml")
    with pytest.raises(cx.ProblemError) as caught:
        cx.Problem.load("coax2D")
    assert caught.value.findings


def test_a_problem_travels_with_its_texts(root: Path, tmp_path: Path) -> None:
    for name in ("coax2d.toml", "airfoils/naca23012.c81"):
        target = tmp_path / name
        target.parent.mkdir(exist_ok=True)
        target.write_text((root / "problems" / name).read_text())
    mine = cx.Problem.load('extends = "coax2d.toml"\nname = "Mine"\n', base=tmp_path)
    packed = pickle.dumps(mine)
    for path in tmp_path.rglob("*.*"):
        path.unlink()
    again = pickle.loads(packed)
    assert (again.name, again.mass, again.hash) == ("Mine", mine.mass, mine.hash)

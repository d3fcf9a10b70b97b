"""Linear models from elsewhere."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coaxdesign as cx

SPEEDS = cx.kt([0.0, 10.0])


@pytest.fixture(scope="module")
def small(root: Path) -> cx.Specification:
    """The built-in specification at two breakpoints, for the nominal model."""
    text = (root / "problems" / "hq.toml").read_text()
    lines = text.splitlines(keepends=True)
    at = next(k for k, line in enumerate(lines) if line.startswith("speeds"))
    lines[at] = 'speeds = ["0 kt", "10 kt"]\n'
    begin = next(k for k, line in enumerate(lines) if line.startswith("[models.no_inter"))
    end = next(k for k, line in enumerate(lines) if line.startswith("[margins.nominal"))
    return cx.Specification.load("".join(lines[:begin] + lines[end:]))


@pytest.fixture(scope="module")
def models(problem: cx.Problem) -> cx.Models:
    """The aircraft's own reduced models, as somebody else would bring them."""
    own = problem.models(np.linspace(0.0, SPEEDS[1], 3), reduce="residualize")
    # The rigid body's trims by the names of its states.
    trims: dict[str, Any] = {name: own.trims[name] for name in ("phi", "theta")}
    trims |= {"u": own.speeds * np.cos(trims["theta"]), "w": own.speeds * np.sin(trims["theta"])}
    trims |= {name: own.trims[f"{name}_stick"] for name in ("lat", "lon", "col", "ped")}
    return cx.Models.from_control(own.to_control(), own.speeds, trims, name="mine")


def test_models_of_control_are_tuned_and_verified_on(
    models: cx.Models, small: cx.Specification
) -> None:
    pytest.importorskip("control")
    tuned = cx.tune(models, small)
    assert tuned.name == "mine"
    np.testing.assert_allclose(tuned.speeds, SPEEDS)
    rows = tuned.verification.rows
    assert {"roll", "pitch", "yaw", "heave"} <= set(rows["axis"])
    again = tuned.verify(models, small)
    assert again.met == tuned.verification.met
    np.testing.assert_array_equal(again.rows["pm_deg"], rows["pm_deg"])


def test_they_travel_and_follow_the_schema(
    models: cx.Models, small: cx.Specification, program: Callable[..., str]
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    assert models.text is not None
    jsonschema.validate(json.loads(models.text), json.loads(program("schema", "lti-set")))
    again = pickle.loads(pickle.dumps(models))
    assert again.text == models.text
    assert repr(again) == "<Models 'mine': 3 speeds>"
    assert isinstance(again.notes(small), list)


def test_a_set_of_files_is_that_of_the_program(root: Path) -> None:
    spec = cx.Specification.load(root / "problems" / "hq-uh60a.toml")
    models = cx.Models.load(root / "examples" / "models" / "uh60a")
    assert len(models.under(spec).speeds) == 6
    assert models.text is None


def test_what_is_wrong_is_said(models: cx.Models, small: cx.Specification) -> None:
    size = 8
    names = ["u", "v", "w", "p", "q", "r", "phi", "theta"]
    system = SimpleNamespace(
        A=np.zeros((size, size)),
        B=np.zeros((size, 4)),
        C=np.eye(size),
        D=np.zeros((size, 4)),
        state_labels=names,
        input_labels=["lat", "lon", "col", "ped"],
        output_labels=names,
    )
    with pytest.raises(ValueError, match="1 models and 2 speeds"):
        cx.Models.from_control([system], SPEEDS)
    with pytest.raises(ValueError, match="no model has a state or an input x_9"):
        cx.Models.from_control([system], [0.0], {"x_9": [0.0]})
    with pytest.raises(ValueError, match="'theta' has 2 values for 1 speeds"):
        cx.Models.from_control([system], [0.0], {"theta": [0.0, 0.0]})
    odd = SimpleNamespace(**(vars(system) | {"input_labels": ["lat", "lon", "col", "tail"]}))
    with pytest.raises(ValueError, match="no unit of tail"):
        cx.Models.from_control([odd], [0.0])
    broken = SimpleNamespace(**(vars(system) | {"A": np.full((size, size), np.nan)}))
    with pytest.raises(cx.CoaxError):
        cx.tune(cx.Models.from_control([broken], [0.0]), small)
    with pytest.raises(cx.ModelsError, match="none.json"):
        cx.Models.load("none.json").notes(small)

"""Linear models."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable

import numpy as np
import pytest

import coaxdesign as cx


@pytest.fixture(scope="module")
def models(problem: cx.Problem) -> cx.LinearModels:
    return problem.models(cx.kt([20, 40]), reduce="residualize")


def test_one_speed_is_a_state_space_with_names(problem: cx.Problem) -> None:
    control = pytest.importorskip("control")
    plant = problem.linearize(cx.kt(20))
    assert isinstance(plant, control.StateSpace)
    assert plant.state_labels[:8] == ["u", "v", "w", "p", "q", "r", "phi", "theta"]
    assert plant.input_labels == ["lat", "lon", "col", "ped"]
    assert "v_forward" in plant.output_labels
    # Signals are found by name, and rotor states keep theirs.
    roll = plant["p", "lat"]
    assert roll.ninputs == roll.noutputs == 1
    assert "upper_beta_1c" in plant.state_labels


def test_several_speeds_are_a_dataset(problem: cx.Problem, models: cx.LinearModels) -> None:
    dataset = problem.linearize(cx.kt([20, 40]), reduce="residualize")
    assert dataset.sizes["speed"] == 2
    a = dataset["A"].sel(rate_of="q", state="u").to_numpy()
    k, j = (next(i for i, (n, _) in enumerate(models.states) if n == name) for name in "qu")
    np.testing.assert_array_equal(a, models.a[:, k, j])
    assert dataset["state_unit"].sel(state="q").item() == "rad/s"
    assert dataset["trim.power"].attrs["units"] == "W"


def test_shapes_and_dc_gain(problem: cx.Problem, models: cx.LinearModels) -> None:
    full = problem.models(cx.kt([20, 40]))
    assert models.a.shape == (2, 8, 8)
    assert models.b.shape == (2, 8, 4)
    for k in range(2):
        # Residualising keeps the steady answer.
        gain = [m.d[k] - m.c[k] @ np.linalg.solve(m.a[k], m.b[k]) for m in (full, models)]
        rows = [i for i, (n, _) in enumerate(models.outputs) if n in ("u", "w", "q", "theta")]
        np.testing.assert_allclose(gain[0][rows], gain[1][rows], rtol=1e-6, atol=1e-8)


def test_same_numbers_as_the_program(models: cx.LinearModels, program: Callable[..., str]) -> None:
    text = program(
        "linearize", "--speed", "20 kt", "--reduce", "residualize", "--format", "json",
        "--units", "si", "--quiet",
    )
    theirs = json.loads(text)
    # These states have the same unit for people as inside.
    for name, ours in {"a": models.a, "b": models.b}.items():
        np.testing.assert_allclose(theirs[name], ours[0], rtol=1e-9, atol=1e-12)


def test_harmonics_and_rotor_inputs(problem: cx.Problem) -> None:
    harmonic = problem.models(cx.kt(20), harmonics=1)
    averaged = problem.models(cx.kt(20), inputs="rotors")
    assert len(harmonic.states) == 3 * len(averaged.states)
    assert ("upper.theta_0", "rad") in averaged.inputs


def test_errors(problem: cx.Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(cx.TrimError, match="no trim at"):
        problem.models(cx.kt(250))
    with pytest.raises(cx.LinearError, match="nothing"):
        problem.models(cx.kt(20), reduce="truncate", keep=["nothing"])
    with pytest.raises(cx.LinearError, match="residualize"):
        problem.models(cx.kt(20), reduce="balance")  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(cx.MissingPackage, match=r"coaxdesign\[control\]"):
        problem.linearize(cx.kt(20))

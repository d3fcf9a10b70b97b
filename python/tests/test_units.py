"""Units."""

from __future__ import annotations

import numpy as np
import pytest

import coaxdesign as cx


def test_val_definitions() -> None:
    # NIST SP 811: the knot is 1852 m/h, the foot 0.3048 m, the pound 0.45359237 kg.
    assert cx.kt(1) == pytest.approx(1852 / 3600, rel=1e-15)
    assert cx.ft(1) == 0.3048
    assert cx.lb(1) == 0.45359237
    assert cx.lbf(1) == pytest.approx(0.45359237 * 9.80665, rel=1e-15)
    assert cx.deg(180) == pytest.approx(np.pi, rel=1e-15)
    assert cx.ft_min(60) == pytest.approx(cx.ft_s(1), rel=1e-15)
    assert cx.inch(12) == pytest.approx(cx.ft(1), rel=1e-15)


@pytest.mark.parametrize("name", ["kt", "ft", "inch", "ft_s", "ft_min", "deg", "deg_s", "hp", "lb", "lbf"])
def test_there_and_back(name: str) -> None:
    there, back = getattr(cx, name), getattr(cx, f"to_{name}")
    values = np.array([[0.0, 1.5], [-2.0, 90.0]])
    assert there(values).shape == values.shape
    np.testing.assert_allclose(back(there(values)), values, rtol=1e-15)
    assert isinstance(there(2), float)


def test_ranges_and_lists() -> None:
    np.testing.assert_array_equal(cx.kt(range(0, 91, 5)), cx.kt(np.arange(0, 91, 5)))
    np.testing.assert_array_equal(cx.kt(x for x in (1, 2)), [cx.kt(1), cx.kt(2)])


def test_quantities_with_units() -> None:
    assert cx.quantity("20 kt", "Airspeed") == cx.kt(20)
    with pytest.raises(cx.UnitError, match="lb"):
        cx.quantity("20 lb", "Airspeed")
    with pytest.raises(cx.UnitError, match="not a kind"):
        cx.quantity("20 kt", "Sped")

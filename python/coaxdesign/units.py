"""Units: functions that turn numbers into SI and radians, and back.

Every function of the package takes and gives SI and radians. These say what
a number is: ``cx.kt(20)`` is 10.288..., ``cx.to_kt(t["airspeed"])`` goes back.
The factors are those of the library.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core

__all__ = [
    "deg",
    "deg_s",
    "ft",
    "ft_min",
    "ft_s",
    "hp",
    "inch",
    "kt",
    "lb",
    "lbf",
    "quantity",
    "to_deg",
    "to_deg_s",
    "to_ft",
    "to_ft_min",
    "to_ft_s",
    "to_hp",
    "to_inch",
    "to_kt",
    "to_lb",
    "to_lbf",
]

Floats = NDArray[np.float64]


def quantity(text: str, kind: str) -> float:
    """A quantity with its unit, such as ``"20 kt"``, in SI and radians.

    ``kind`` is what it is to measure, such as ``"Airspeed"``, ``"Length"`` or
    ``"Angle"``. Raises :class:`~coaxdesign.errors.UnitError` where the unit
    does not measure that.
    """
    return _core.quantity(text, kind)


def floats(values: object) -> Floats:
    """Numbers of any kind as an array: a number, a sequence, a range, an array."""
    if isinstance(values, Iterable) and not isinstance(values, np.ndarray):
        values = list(values)
    return np.asarray(values, dtype=np.float64)


def _values(values: object) -> Floats | float:
    array = floats(values)
    return float(array) if array.ndim == 0 else array


class _Unit:
    """Turns numbers of one unit into SI."""

    def __init__(self, name: str, one: str, kind: str, back: bool = False) -> None:
        factor = _core.quantity(one, kind)
        self.__name__ = name
        self._factor = factor
        self._back = back
        si = {"Angle": "rad", "AngularRate": "rad/s", "Power": "W", "Mass": "kg"}
        si |= {"Force": "N", "Length": "m"}
        unit = one.split(" ", 1)[1]
        pair = (si.get(kind, "m/s"), unit) if back else (unit, si.get(kind, "m/s"))
        self.__doc__ = f"Numbers in {pair[0]}, in {pair[1]}: a float, or an array of the same shape."

    @overload
    def __call__(self, values: float) -> float: ...
    @overload
    def __call__(self, values: ArrayLike | Iterable[float]) -> Floats: ...
    def __call__(self, values: ArrayLike | Iterable[float]) -> Floats | float:
        numbers = _values(values)
        return numbers / self._factor if self._back else numbers * self._factor

    def __repr__(self) -> str:
        return f"<unit function {self.__name__}>"


kt = _Unit("kt", "1 kt", "Airspeed")
ft = _Unit("ft", "1 ft", "Length")
inch = _Unit("inch", "1 in", "Length")
ft_s = _Unit("ft_s", "1 ft/s", "Velocity")
ft_min = _Unit("ft_min", "1 ft/min", "ClimbRate")
deg = _Unit("deg", "1 deg", "Angle")
deg_s = _Unit("deg_s", "1 deg/s", "AngularRate")
hp = _Unit("hp", "1 hp", "Power")
lb = _Unit("lb", "1 lb", "Mass")
lbf = _Unit("lbf", "1 lbf", "Force")
to_kt = _Unit("to_kt", "1 kt", "Airspeed", back=True)
to_ft = _Unit("to_ft", "1 ft", "Length", back=True)
to_inch = _Unit("to_inch", "1 in", "Length", back=True)
to_ft_s = _Unit("to_ft_s", "1 ft/s", "Velocity", back=True)
to_ft_min = _Unit("to_ft_min", "1 ft/min", "ClimbRate", back=True)
to_deg = _Unit("to_deg", "1 deg", "Angle", back=True)
to_deg_s = _Unit("to_deg_s", "1 deg/s", "AngularRate", back=True)
to_hp = _Unit("to_hp", "1 hp", "Power", back=True)
to_lb = _Unit("to_lb", "1 lb", "Mass", back=True)
to_lbf = _Unit("to_lbf", "1 lbf", "Force", back=True)

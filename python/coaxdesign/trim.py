"""Trims over speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _core
from .table import Svg, Table, Values


class Trim(Table):
    """Trims, a row a speed: see :class:`~coaxdesign.table.Table`.

    Columns: the condition (``airspeed``, ``climb_rate``, ``turn_rate``),
    ``status`` (``converged``, ``beyond_limits``, ``failed``) and its ``reason``,
    mean attitude ``phi``, ``theta`` and ``sideslip``, sticks ``lat_stick``...
    in percent, for each rotor ``NAME.thrust``, ``.torque``, ``.power``,
    coefficients, inflow, flapping and blade pitch, ``power`` of all rotors and
    its parts, the least ``margin`` to a control limit as a fraction of the
    travel, and what the solver needed.
    """

    def __init__(
        self,
        columns: Mapping[str, tuple[str, Values | Sequence[str]]],
        metadata: Mapping[str, str],
        orbits: Sequence[NDArray[np.float64]],
        states: Sequence[tuple[str, str]],
        rotors: Sequence[str],
    ) -> None:
        super().__init__(columns, metadata)
        self.orbits = list(orbits)
        """One array a point: steps of the period by states, SI."""
        self.states = list(states)
        """Name and unit of each state."""
        self.rotors = list(rotors)
        """Names of the rotors."""

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Which points lie on a periodic orbit, controls within limits; shape (n,)."""
        return np.asarray(self["status"] == "converged")

    def plot(self, units: Literal["us", "si"] = "us") -> Svg:
        """Attitude, sticks, power and thrust shares over airspeed, as the program draws them."""
        good = self["status"] != "failed"

        def column(name: str) -> list[float]:
            values: list[float] = self[name][good].tolist()
            return values

        return Svg(
            _core.trim_svg(
                f"{self.metadata['problem']}: trim",
                units == "us",
                column("airspeed"),
                [column("theta"), column("phi")],
                [column(f"{stick}_stick") for stick in ("lat", "lon", "col", "ped")],
                column("power"),
                [(rotor, column(f"{rotor}.thrust")) for rotor in self.rotors],
            )
        )

    def to_xarray(self, dimension: str = "airspeed") -> Any:
        """An ``xarray.Dataset`` over airspeed."""
        return super().to_xarray(dimension)

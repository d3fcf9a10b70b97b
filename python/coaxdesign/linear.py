"""Linear models over speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._support import need
from .table import Table, Values

Floats = NDArray[np.float64]
Channels = list[tuple[str, str]]


class LinearModels:
    """Models x' = A x + B u, y = C x + D u at increasing speeds, SI and radians.

    ``a`` has the shape (speeds, states, states), ``b`` (speeds, states, inputs),
    ``c`` (speeds, outputs, states), ``d`` (speeds, outputs, inputs). ``states``,
    ``inputs`` and ``outputs`` are lists of (name, unit).
    """

    def __init__(
        self,
        speeds: Sequence[float],
        channels: Sequence[Channels],
        matrices: Sequence[Floats],
        trims: Mapping[str, tuple[str, Values | Sequence[str]]],
        metadata: Mapping[str, str],
        rotors: Sequence[str],
    ) -> None:
        self.speeds: Floats = np.asarray(speeds, dtype=np.float64)
        self.states, self.inputs, self.outputs = channels
        self.a, self.b, self.c, self.d = matrices
        self.trims = Table(trims, metadata)
        """The trims, a row a speed."""
        self.metadata = dict(metadata)
        self.rotors = list(rotors)

    def __len__(self) -> int:
        return len(self.speeds)

    def __repr__(self) -> str:
        return (
            f"<LinearModels of {self.metadata['problem']!r}: {len(self)} speeds, "
            f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs>"
        )

    def to_control(self) -> list[Any]:
        """One ``control.StateSpace`` a speed, states, inputs and outputs named.

        The package control keeps dots for its own use, so ``upper.beta_1c``
        becomes ``upper_beta_1c``.
        """
        control = need("control", "control", "a control.StateSpace")

        def names(channels: Channels) -> list[str]:
            return [name.replace(".", "_") for name, _ in channels]

        return [
            control.ss(
                self.a[k],
                self.b[k],
                self.c[k],
                self.d[k],
                states=names(self.states),
                inputs=names(self.inputs),
                outputs=names(self.outputs),
                name=f"{_word(self.metadata['problem'])}_{speed:.3f}_m_s".replace(".", "_"),
                remove_useless_states=False,
            )
            for k, speed in enumerate(self.speeds)
        ]

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset``: matrices over speed, and the trims as ``trim.NAME``."""
        xarray = need("xarray", "frames", "a set of models")
        states = [name for name, _ in self.states]
        inputs = [name for name, _ in self.inputs]
        outputs = [name for name, _ in self.outputs]
        variables: dict[str, Any] = {
            "A": (("speed", "rate_of", "state"), self.a),
            "B": (("speed", "rate_of", "input"), self.b),
            "C": (("speed", "output", "state"), self.c),
            "D": (("speed", "output", "input"), self.d),
        }
        for name in self.trims:
            unit = {"units": self.trims.units[name]}
            variables[f"trim.{name}"] = ("speed", self.trims[name], unit)
        coordinates = {
            "speed": ("speed", self.speeds, {"units": "m/s"}),
            "rate_of": states,
            "state": states,
            "input": inputs,
            "output": outputs,
            "state_unit": ("state", [unit for _, unit in self.states]),
            "input_unit": ("input", [unit for _, unit in self.inputs]),
            "output_unit": ("output", [unit for _, unit in self.outputs]),
        }
        return xarray.Dataset(variables, coordinates, attrs=self.metadata)


def _word(text: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in text)

"""Linear models from elsewhere, to tune and to verify on."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from .units import floats

if TYPE_CHECKING:
    from .design import Specification

SI_UNITS = {
    **dict.fromkeys(("u", "v", "w", "v_forward", "v_right", "v_down"), "m/s"),
    **dict.fromkeys(("p", "q", "r", "heading_rate"), "rad/s"),
    **dict.fromkeys(("a_x", "a_y", "a_z"), "m/s^2"),
    **dict.fromkeys(("phi", "theta"), "rad"),
    **dict.fromkeys(("lat", "lon", "col", "ped"), "%"),
}
"""Units of the channels by name, where :meth:`Models.from_control` is told no others."""


class Models:
    """A set of linear models x' = A x + B u over speed, each about a trim.

    Made by :meth:`from_control` or :meth:`load`, and taken by
    :func:`coaxdesign.tune` and :func:`coaxdesign.verify` in place of a
    problem. Which name is which of ours stands in ``[models_from]`` of the
    specification, so names are looked up there and then. It can be pickled:
    one of :meth:`load` travels as its path.
    """

    def __init__(self, source: Path | str) -> None:
        self._source = source

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Models:
        """A JSON, MAT or CSV file, or a directory of CSV tables."""
        return cls(Path(path))

    @classmethod
    def from_control(
        cls,
        systems: Sequence[Any],
        speeds: ArrayLike | Iterable[float],
        trims: Mapping[str, ArrayLike] | None = None,
        *,
        name: str = "models",
        units: Mapping[str, str] | None = None,
        hardware: Literal["separate", "included"] = "separate",
    ) -> Models:
        """Models as ``control.StateSpace``, or anything with ``A, B, C, D`` and labels.

        :param systems: a model a speed, with ``state_labels``, ``input_labels``
            and ``output_labels`` such as u, v, w, p, q, r, phi, theta and lat,
            lon, col, ped.
        :param speeds: true airspeeds, m/s, increasing.
        :param trims: totals of states and inputs in trim by name, a value a
            speed, in the units of the channels; what is not named is zero.
        :param name: name of the aircraft.
        :param units: unit by name of a channel, such as ``{"u": "ft/s"}``; SI,
            radians and percent of stick where not given.
        :param hardware: whether actuators, delays and sensors are in the
            models already.

        A model that cannot be used raises
        :class:`~coaxdesign.errors.ModelsError` when it is tuned or verified on.
        """
        at = floats(speeds).ravel()
        if len(systems) != len(at):
            raise ValueError(f"{len(systems)} models and {len(at)} speeds")
        known = SI_UNITS | dict(units or {})
        values = {key: floats(value).ravel() for key, value in (trims or {}).items()}
        for key, value in values.items():
            if len(value) != len(at):
                raise ValueError(f"the trim of {key!r} has {len(value)} values for {len(at)} speeds")

        def channels(labels: Sequence[str]) -> list[dict[str, str]]:
            missing = [label for label in labels if label not in known]
            if missing:
                raise ValueError(
                    f"no unit of {', '.join(missing)}; give units={{{missing[0]!r}: '1'}} and the like"
                )
            return [{"name": label, "unit": known[label]} for label in labels]

        def matrix(value: Any) -> list[list[float]]:
            rows: list[list[float]] = np.asarray(value, dtype=np.float64).tolist()
            return rows

        models = []
        seen: set[str] = set()
        for k, (system, speed) in enumerate(zip(systems, at, strict=True)):
            states, inputs = list(system.state_labels), list(system.input_labels)
            seen.update(states, inputs)
            model: dict[str, Any] = {
                "speed": f"{float(speed)!r} m/s",
                "states": channels(states),
                "inputs": channels(inputs),
                "outputs": channels(list(system.output_labels)),
                "a": matrix(system.A),
                "b": matrix(system.B),
                "c": matrix(system.C),
                "d": matrix(system.D),
            }
            if values:
                for key, labels in (("x0", states), ("u0", inputs)):
                    model[key] = [
                        float(values[label][k]) if label in values else 0.0 for label in labels
                    ]
            models.append(model)
        unknown = [key for key in values if key not in seen]
        if unknown:
            raise ValueError(f"no model has a state or an input {', '.join(unknown)}")
        document = {
            "schema": "coaxdesign.lti-set/1",
            "name": name,
            "hardware": hardware,
            "models": models,
        }
        return cls(json.dumps(document))

    @property
    def text(self) -> str | None:
        """The set as JSON of schema ``coaxdesign.lti-set/1``; none for one of a file."""
        return self._source if isinstance(self._source, str) else None

    def under(self, spec: Specification) -> _core.Models:
        """The set in our names and units, as a specification says."""
        if isinstance(self._source, str):
            return _core.Models.parse("<models>", self._source, spec._core)
        return _core.Models.read(self._source, spec._core)

    def notes(self, spec: Specification | str | os.PathLike[str] | None = None) -> list[str]:
        """What is done to the models under a specification that their owner should know."""
        from .design import as_specification

        return self.under(as_specification(spec)).notes

    def __repr__(self) -> str:
        if isinstance(self._source, str):
            document = json.loads(self._source)
            return f"<Models {document['name']!r}: {len(document['models'])} speeds>"
        return f"<Models of {str(self._source)!r}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (Models, (self._source,))

"""Flights of the full nonlinear vehicle."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from . import _core
from ._support import Progress, reporting
from .problem import Problem
from .schedule import Schedule
from .table import Svg, Table, Values


@dataclass(frozen=True)
class Variation:
    """How the flown model differs from the problem's."""

    interactions: bool | None = None
    """Rotor-on-rotor interactions, if not the problem's."""
    mass: float = 1.0
    """Factor on the mass."""
    inertia: float = 1.0
    """Factor on the moments and products of inertia."""
    center_of_gravity: float = 0.0
    """Shift of the centre of gravity aft, m."""
    delay: float = 0.0
    """Delay on top, s."""
    turbulence: float | None = None
    """Wind at 20 ft that sets the turbulence, m/s, if not the manoeuvre's."""
    inflow: float = 1.0
    """Factor on the inflow that rotors induce in one another."""
    gust: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """A gust half way: velocity of the air forward, to starboard and up, m/s."""
    governor: float | None = None
    """Time constant of a governor given to every rotor, s."""

    def to_json(self) -> str:
        """The variation as JSON."""
        return json.dumps(asdict(self))


class Maneuver:
    """A manoeuvre: made by :meth:`load`. It can be pickled."""

    def __init__(self, core: _core.Maneuver) -> None:
        self._core = core

    @classmethod
    def load(cls, source: str | os.PathLike[str]) -> Maneuver:
        """A manoeuvre by its built-in name, from a file, or from TOML text.

        Raises :class:`~coaxdesign.errors.ManeuverError` with everything that
        is wrong.
        """
        if isinstance(source, str) and "\n" in source:
            return cls(_core.Maneuver.parse("<text>", source))
        return cls(_core.Maneuver.read(Path(source)))

    @staticmethod
    def names() -> list[str]:
        """Names of the built-in manoeuvres."""
        return _core.maneuver_names()

    @property
    def title(self) -> str:
        """Title."""
        return self._core.title

    @property
    def duration(self) -> float:
        """How long it takes, s."""
        return self._core.duration

    def __repr__(self) -> str:
        return f"<Maneuver {self.title!r}, {self.duration:g} s>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_maneuver_again, self._core.file)


def _maneuver_again(name: str, text: str) -> Maneuver:
    return Maneuver(_core.Maneuver.parse(name, text))


def as_maneuver(maneuver: Maneuver | str | os.PathLike[str]) -> Maneuver:
    """The manoeuvre itself, or loaded."""
    return maneuver if isinstance(maneuver, Maneuver) else Maneuver.load(maneuver)


def as_schedule(schedule: Schedule | str | os.PathLike[str] | None) -> Schedule | None:
    """The schedule itself, or loaded."""
    if schedule is None or isinstance(schedule, Schedule):
        return schedule
    return Schedule.load(schedule)


class Flight(Table):
    """A flight's history, a row an instant: see :class:`~coaxdesign.table.Table`.

    ``status`` is ``completed``, ``limit`` or ``diverged``; ``metrics`` is what
    the flight amounts to, as the program's JSON has it.
    """

    def __init__(
        self,
        columns: Mapping[str, tuple[str, Values | Sequence[str]]],
        metadata: Mapping[str, str],
        status: str,
        metrics: dict[str, Any],
    ) -> None:
        super().__init__(columns, metadata)
        self.status = status
        self.metrics = metrics

    def __repr__(self) -> str:
        end = self["time"][-1]
        return f"<Flight {self.metadata['maneuver']!r}: {self.status} at {end:.1f} s>"


    def plot(self, units: Literal["us", "si"] = "us") -> Svg:
        """Velocities, attitude, height, sticks and power over time, with what was commanded."""
        every = max(1, -(-len(self) // PLOTTED))

        def values(name: str) -> list[float]:
            found: list[float] = self[name][::every].tolist()
            return found

        def panel(
            quantity: str, kind: str, span: float, names: Mapping[str, str]
        ) -> tuple[str, str, float, list[tuple[str, list[float]]]] | None:
            lines = [(label, values(name)) for label, name in names.items() if name in self]
            return (quantity, kind, span, lines) if lines else None

        panels = []
        for quantity, kind, span, flown, followed, commanded in HISTORY:
            names = {"flown": flown, "reference": followed, "command": commanded}
            panels.append(panel(quantity, kind, span, names))
        for stick in ("lat", "lon", "col", "ped"):
            panels.append(panel(f"{stick} stick", "Percent", 2.0, {"flown": f"{stick}_stick"}))
        for name in self:
            if self.units[name] == "W":
                panels.append(panel(name.replace(".", " "), "Power", 5.0, {"flown": name}))
        return Svg(
            _core.history_svg(
                self.metadata["maneuver"],
                "" if self.status == "completed" else self.status,
                units == "us",
                values("time"),
                [panel for panel in panels if panel is not None],
            )
        )


PLOTTED = 1500
"""Most points of a plotted curve."""

HISTORY = (
    ("forward velocity", "Airspeed", 2.0, "forward_velocity", "forward_velocity_reference",
     "forward_velocity_command"),
    ("velocity to starboard", "Airspeed", 2.0, "right_velocity", "right_velocity_reference",
     "right_velocity_command"),
    ("climb rate", "ClimbRate", 100.0, "climb_rate", "climb_rate_reference", "climb_rate_command"),
    ("yaw rate", "AngularRate", 2.0, "r", "yaw_rate_reference", "turn_rate_command"),
    ("bank", "Angle", 2.0, "phi", "phi_reference", ""),
    ("pitch", "Angle", 2.0, "theta", "theta_reference", ""),
    ("heading", "Angle", 2.0, "heading", "", ""),
    ("height", "Length", 10.0, "height", "", ""),
)
"""Panels: quantity, kind, smallest span shown, and the columns flown, followed and commanded."""


def simulate(
    problem: Problem,
    schedule: Schedule | str | os.PathLike[str] | None,
    maneuver: Maneuver | str | os.PathLike[str],
    *,
    variation: Variation | None = None,
    seed: int = 0,
    control_rate: float = 100.0,
    steps_per_revolution: int = 36,
    pitch_rate_limit: float | None = None,
    every: int = 1,
    progress: Progress = None,
) -> Flight:
    """Flies a manoeuvre with the full nonlinear vehicle.

    :param schedule: the law; ``None`` for an open-loop manoeuvre.
    :param variation: how the flown model differs from the problem's.
    :param seed: seed of sensor noise and turbulence.
    :param control_rate: rate of the control computer, Hz.
    :param steps_per_revolution: fewest integration steps in a revolution of
        the reference rotor.
    :param pitch_rate_limit: largest rate of blade pitch, rad/s; that of the
        built-in specification where not given.
    :param every: control periods from one row of the history to the next.

    A flight that leaves its limits ends early and says so in ``status``.
    Raises :class:`~coaxdesign.errors.TrimError` without a trim to start from.
    """
    flown = as_maneuver(maneuver)
    law = as_schedule(schedule)
    chosen = variation or Variation()
    equipment = {
        "control_rate": control_rate,
        "steps_per_revolution": steps_per_revolution,
        "pitch_rate_limit": pitch_rate_limit,
        "seed": seed,
    }
    with reporting(progress, "flying") as tell:
        columns, metrics, status = _core.simulate(
            problem._core,
            None if law is None else law._core,
            flown._core,
            chosen.to_json(),
            equipment,
            every,
            tell,
        )
    metadata = {
        "problem": problem.name,
        "problem_hash": problem.hash,
        "maneuver": flown.title,
        "variation": chosen.to_json(),
        "equipment": json.dumps(equipment),
        "status": status,
        "generator": f"coaxdesign {_core.__version__}",
    }
    return Flight(columns, metadata, status, json.loads(metrics))

"""Problems: what flies."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._support import Progress, need, reporting
from .errors import Finding
from .linear import LinearModels
from .trim import Trim
from .units import floats

Speeds = ArrayLike | Iterable[float]


def speed_list(speeds: Speeds) -> tuple[list[float], bool]:
    """Speeds as a list, and whether it was one number."""
    array = floats(speeds)
    if array.ndim > 1:
        raise ValueError(f"speeds have one dimension, not {array.ndim}")
    return [float(speed) for speed in np.atleast_1d(array)], array.ndim == 0


class Problem:
    """A rotorcraft, checked: made by :meth:`load`.

    It can be pickled: it travels with the texts of its files.
    """

    def __init__(self, core: _core.Problem) -> None:
        self._core = core

    @classmethod
    def load(
        cls, source: str | os.PathLike[str] = "coax2d", *, base: str | os.PathLike[str] | None = None
    ) -> Problem:
        """A problem by its built-in name, from a file, or from TOML text.

        A text is one with a line break or an equals sign. Files that a text
        names (``extends``, airfoil tables) are looked for in the folder
        ``base``, or among the built-in ones where ``base`` is not given.

        Raises :class:`~coaxdesign.errors.ProblemError`, whose ``findings`` list
        everything that is wrong, each with file, line, column and help.
        """
        if isinstance(source, str) and not os.path.exists(source):
            if source in _core.problem_names():
                return cls(_core.Problem.builtin(source))
            if "\n" in source or "=" in source:
                return cls(_core.Problem.parse(source, None if base is None else Path(base)))
        return cls(_core.Problem.read(Path(source)))

    @staticmethod
    def names() -> list[str]:
        """Names of the built-in problems."""
        return _core.problem_names()

    @property
    def name(self) -> str:
        """Name of the aircraft."""
        return self._core.name

    @property
    def rotors(self) -> list[str]:
        """Names of the rotors."""
        return self._core.rotors

    @property
    def mass(self) -> float:
        """Mass, kg."""
        return self._core.mass

    @property
    def hash(self) -> str:
        """Hash of the texts of its files, as results carry it."""
        return self._core.hash

    @property
    def warnings(self) -> list[Finding]:
        """What is odd about it."""
        return [Finding(*finding) for finding in self._core.warnings]

    def __repr__(self) -> str:
        return f"<Problem {self.name!r}: {self.mass:.1f} kg, rotors {', '.join(self.rotors)}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, (self._core.files,))

    def trim(
        self,
        speeds: Speeds,
        *,
        climb_rate: float = 0.0,
        turn_rate: float = 0.0,
        sideslip: float | None = None,
        bank: float | None = None,
        interactions: bool | None = None,
        altitude: float | None = None,
        progress: Progress = None,
    ) -> Trim:
        """Periodic trims at true airspeeds, m/s, each from its neighbour.

        :param speeds: n speeds, m/s; ``cx.kt(range(0, 91, 5))`` for knots.
        :param climb_rate: rate of climb, m/s.
        :param turn_rate: rate of turn, rad/s, positive to starboard.
        :param sideslip: sideslip to hold, rad; zero where no bank is held.
        :param bank: bank to hold in its place, rad.
        :param interactions: whether rotors wash each other; the problem's
            choice where not given.
        :param altitude: pressure altitude in place of the problem's, m.
        :param progress: ``True`` for a bar, or a function of (done, total).

        Points that do not converge are in the table with their reason; see
        :attr:`Trim.converged`.
        """
        wanted, _ = speed_list(speeds)
        path = (float(climb_rate), float(turn_rate), sideslip, bank)
        with reporting(progress, "trimming") as tell:
            columns, orbits, states = _core.trim(
                self._core, wanted, path, interactions, altitude, tell
            )
        metadata = {"problem": self.name, "problem_hash": self.hash}
        return Trim(columns, metadata, orbits, states, self.rotors)

    def models(
        self,
        speeds: Speeds,
        *,
        climb_rate: float = 0.0,
        turn_rate: float = 0.0,
        sideslip: float | None = None,
        bank: float | None = None,
        harmonics: int = 0,
        reduce: Literal["residualize", "truncate"] | None = None,
        keep: Iterable[str] | None = None,
        inputs: Literal["sticks", "rotors"] = "sticks",
        interactions: bool | None = None,
        altitude: float | None = None,
        progress: Progress = None,
    ) -> LinearModels:
        """Linear models of the trims at true airspeeds, m/s, as arrays.

        The model is averaged over the azimuth; with ``harmonics`` n it has the
        first n harmonics of the state beside the mean. ``reduce`` takes the
        fast states out, down to the states of ``keep``, or to u, v, w, p, q, r,
        phi, theta. ``inputs`` are the four sticks in percent, or the blade
        controls of every rotor in rad. The rest as in :meth:`trim`.

        Raises :class:`~coaxdesign.errors.TrimError` at a speed without trim.
        """
        wanted, _ = speed_list(speeds)
        path = (float(climb_rate), float(turn_rate), sideslip, bank)
        with reporting(progress, "linearising") as tell:
            channels, matrices, trims = _core.linearize(
                self._core,
                wanted,
                path,
                harmonics,
                reduce,
                None if keep is None else list(keep),
                inputs == "rotors",
                interactions,
                altitude,
                tell,
            )
        metadata = {"problem": self.name, "problem_hash": self.hash}
        return LinearModels(wanted, channels, matrices, trims, metadata, self.rotors)

    def linearize(self, speeds: Speeds, **options: Any) -> Any:
        """The linear model at a speed, or the set over several.

        One speed gives a ``control.StateSpace`` with named signals, several an
        ``xarray.Dataset`` with the matrices A, B, C, D and the trims over
        speed. Options as in :meth:`models`, which gives the same as arrays.
        """
        _, one = speed_list(speeds)
        # What is missing is said before the work is done.
        if one:
            need("control", "control", "a control.StateSpace")
        else:
            need("xarray", "frames", "a set of models")
        models = self.models(speeds, **options)
        return models.to_control()[0] if one else models.to_xarray()


def _again(files: list[tuple[str, str]]) -> Problem:
    return Problem(_core.reload(files))

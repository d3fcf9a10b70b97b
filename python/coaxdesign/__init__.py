"""Rotorcraft flight-control design: trim, linear models, gain schedules, flight.

>>> import coaxdesign as cx
>>> p = cx.Problem.load("coax2d")
>>> t = p.trim(cx.kt([0, 20, 40]))
>>> bool(t.converged.all())
True

Every number is SI and radians; :mod:`coaxdesign.units` has the functions that
convert. Faults are the classes of :mod:`coaxdesign.errors`. Packages beyond
NumPy are imported when they are needed.
"""

from __future__ import annotations

from . import errors, units
from ._core import __version__
from .design import Specification, Tuned, Verification, tune, verify
from .errors import *  # noqa: F403
from .linear import LinearModels
from .models import Models
from .montecarlo import Criterion, MonteCarlo, Ranges, montecarlo
from .pipeline import Design, design
from .problem import Problem
from .schedule import LawAt, Schedule
from .simulation import Flight, Maneuver, Variation, simulate
from .sweep import Designs, sweep
from .table import Svg, Table
from .trim import Trim
from .units import *  # noqa: F403

__all__ = [
    "Criterion",
    "Design",
    "Designs",
    "Flight",
    "LawAt",
    "LinearModels",
    "Maneuver",
    "Models",
    "MonteCarlo",
    "Problem",
    "Ranges",
    "Schedule",
    "Specification",
    "Svg",
    "Table",
    "Trim",
    "Tuned",
    "Variation",
    "Verification",
    "__version__",
    "design",
    "montecarlo",
    "simulate",
    "sweep",
    "tune",
    "verify",
]
__all__ += errors.__all__
__all__ += units.__all__

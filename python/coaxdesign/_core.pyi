from collections.abc import Callable
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Finding = tuple[str, str, int, int, str, str, str]
Columns = dict[str, tuple[str, NDArray[Any] | list[str]]]
Flown = tuple[float, float, float | None, float | None]
Tell = Callable[[int, int, str], object] | None

__version__: str

@final
class Problem:
    @staticmethod
    def builtin(name: str) -> Problem: ...
    @staticmethod
    def read(path: Path) -> Problem: ...
    @staticmethod
    def parse(text: str, base: Path | None = None) -> Problem: ...
    @property
    def name(self) -> str: ...
    @property
    def rotors(self) -> list[str]: ...
    @property
    def mass(self) -> float: ...
    @property
    def warnings(self) -> list[Finding]: ...
    @property
    def files(self) -> list[tuple[str, str]]: ...
    @property
    def hash(self) -> str: ...

def reload(files: list[tuple[str, str]]) -> Problem: ...
def problem_names() -> list[str]: ...
def quantity(text: str, kind: str) -> float: ...
def trim(
    problem: Problem,
    speeds: list[float],
    path: Flown,
    interactions: bool | None = None,
    altitude: float | None = None,
    progress: Tell = None,
) -> tuple[Columns, list[Floats], list[tuple[str, str]]]: ...
def trim_svg(
    title: str,
    us: bool,
    speed: list[float],
    attitude: list[list[float]],
    sticks: list[list[float]],
    power: list[float],
    thrust: list[tuple[str, list[float]]],
) -> str: ...
def linearize(
    problem: Problem,
    speeds: list[float],
    path: Flown,
    harmonics: int = 0,
    reduce: str | None = None,
    keep: list[str] | None = None,
    rotor_inputs: bool = False,
    interactions: bool | None = None,
    altitude: float | None = None,
    progress: Tell = None,
) -> tuple[list[list[tuple[str, str]]], list[Floats], Columns]: ...
@final
class Schedule:
    @staticmethod
    def parse(text: str) -> Schedule: ...
    def to_json(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def requirements_met(self) -> bool: ...
    @property
    def speeds(self) -> list[float]: ...
    @property
    def provenance(self) -> tuple[str, str, str]: ...
    def at(self, speeds: list[float]) -> dict[str, tuple[str, Floats]]: ...
    def export(
        self,
        format: str,
        name: str | None = None,
        step: float = 0.01,
        single: bool = False,
        speed: float = 0.0,
        unverified: bool = False,
    ) -> tuple[list[tuple[str, bytes]], list[str]]: ...

def export_formats() -> list[tuple[str, str, str]]: ...
@final
class Maneuver:
    @staticmethod
    def parse(name: str, text: str) -> Maneuver: ...
    @staticmethod
    def read(path: Path) -> Maneuver: ...
    @property
    def title(self) -> str: ...
    @property
    def duration(self) -> float: ...
    @property
    def file(self) -> tuple[str, str]: ...

def maneuver_names() -> list[str]: ...
def simulate(
    problem: Problem,
    schedule: Schedule | None,
    maneuver: Maneuver,
    variation: str,
    equipment: dict[str, Any],
    every: int = 1,
    progress: Tell = None,
) -> tuple[Columns, str, str]: ...

@final
class Specification:
    @staticmethod
    def builtin() -> Specification: ...
    @staticmethod
    def read(path: Path) -> Specification: ...
    @staticmethod
    def parse(name: str, text: str) -> Specification: ...
    def nominal_only(self) -> Specification: ...
    @property
    def file(self) -> tuple[str, str]: ...
    @property
    def speeds(self) -> list[float]: ...
    @property
    def models(self) -> list[str]: ...
    @property
    def hash(self) -> str: ...

def tune(
    problem: Problem,
    specification: Specification,
    channels: list[str],
    explain_all: bool = False,
    progress: Tell = None,
) -> tuple[Schedule, str]: ...
def design_files(
    problem: Problem, specification: Specification
) -> list[tuple[str, bytes]]: ...
def verify(
    schedule: Schedule,
    problem: Problem,
    specification: Specification,
    progress: Tell = None,
) -> str: ...

@final
class Models:
    @staticmethod
    def read(path: Path, specification: Specification) -> Models: ...
    @staticmethod
    def parse(name: str, text: str, specification: Specification) -> Models: ...
    @property
    def name(self) -> str: ...
    @property
    def speeds(self) -> list[float]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def hardware_included(self) -> bool: ...

def tune_models(
    models: Models,
    specification: Specification,
    channels: list[str],
    explain_all: bool = False,
    progress: Tell = None,
) -> tuple[Schedule, str]: ...
def verify_models(
    schedule: Schedule,
    models: Models,
    specification: Specification,
    progress: Tell = None,
) -> str: ...
@final
class Sweep:
    def __new__(
        cls,
        problems: list[tuple[str, Problem]],
        specifications: list[tuple[str, Specification]],
        schedule: Schedule | None,
        channels: list[str],
        plan: str,
    ) -> Sweep: ...
    def head(self) -> str: ...
    def hash(self) -> str: ...
    def differences(self, head: str) -> list[str]: ...
    def columns(self) -> list[tuple[str, str]]: ...
    def design(
        self, indices: list[int], threads: int = 1, progress: Tell = None
    ) -> list[tuple[str, str | None, str | None]]: ...

def sweep_grid(factors: str) -> str: ...
@final
class Study:
    def __new__(
        cls,
        problem: Problem,
        schedule: Schedule | None,
        maneuver: Maneuver,
        variation: str,
        equipment: dict[str, Any],
        runs: int,
        ranges: str,
        criterion: str,
    ) -> Study: ...
    def head(self) -> str: ...
    def hash(self) -> str: ...
    def differences(self, head: str) -> list[str]: ...
    def fly(
        self, indices: list[int], threads: int = 1, progress: Tell = None
    ) -> list[str]: ...

def study_columns() -> list[tuple[str, str]]: ...
def confidence(successes: int, runs: int) -> tuple[float, float]: ...
def history_svg(
    title: str,
    subtitle: str,
    us: bool,
    time: list[float],
    panels: list[tuple[str, str, float, list[tuple[str, list[float]]]]],
) -> str: ...

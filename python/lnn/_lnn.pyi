from collections.abc import Callable, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Subject",
    "check",
    "compare_lagrangians",
    "configuration",
    "find_constraints",
    "fit",
    "formula",
    "identify",
    "inverse_dynamics",
    "learn",
    "read_constraints",
    "read_robot",
    "rewritten_robot",
    "shadow",
    "surfaces",
    "sweep",
    "systems",
    "train",
    "unit_factor",
]

_Doubles = NDArray[np.float64]
_Bounds = Sequence[tuple[str, float, float]]
_Force = Callable[[float, _Doubles, _Doubles], _Doubles]
_Driving = tuple[tuple[Sequence[float], Sequence[Sequence[float]], str | None] | None, _Force | None]
_Receiver = Callable[[str, float, float, str], None] | None
_Numbers = Sequence[float]
_Track = tuple[str, _Numbers, _Numbers, _Numbers, _Numbers, _Numbers]
_Motion = tuple[Sequence[str], Sequence[_Track], str]
_Happened = tuple[str, float, _Doubles, _Doubles, tuple[_Doubles, float, float] | None]
_Learned = tuple[list[Subject], str, str, tuple[str, str], str | None]

@final
class Subject:
    @staticmethod
    def system(name: str, parameters: Sequence[tuple[str, str]]) -> Subject: ...
    @staticmethod
    def described(text: str, json: bool, parameters: Sequence[tuple[str, str]]) -> Subject: ...
    @staticmethod
    def model(bytes: bytes) -> Subject: ...
    def to_bytes(self) -> bytes: ...
    def facts(self) -> str: ...
    def terms(
        self, q: _Doubles, v: _Doubles, t: _Doubles | None, threads: int
    ) -> tuple[list[_Doubles], list[tuple[int, str]]]: ...
    def term(
        self,
        name: str,
        q: _Doubles,
        v: _Doubles,
        t: _Doubles | None,
        threads: int,
        force: _Doubles | None = None,
        friction: bool = True,
    ) -> _Doubles: ...
    def rollout(
        self,
        q: _Doubles,
        v: _Doubles,
        times: tuple[float, float, float],
        method: str,
        accuracy: tuple[float, float, float | None],
        acting: tuple[bool, bool],
        forces: _Driving,
        inputs: _Driving,
        threads: int,
    ) -> list[tuple[_Doubles, _Doubles, _Doubles, _Doubles, str | None, int, list[_Happened]]]: ...
    def linearize(
        self, q: _Doubles, v: _Doubles, force: _Doubles | None, friction: bool
    ) -> list[_Doubles]: ...
    def geometry(
        self, points: _Doubles, velocity: Sequence[float]
    ) -> tuple[dict[str, _Doubles], NDArray[np.int64], list[tuple[int, str]]]: ...
    def symmetries(
        self, region: _Bounds, degrees: str | None, points: int | None, seed: int, tolerance: float | None
    ) -> str: ...
    def constraints(self, seed: int) -> str: ...
    def formula(self, choices: str) -> str: ...
    def certify(
        self,
        region: _Bounds,
        signature: tuple[int, int] | None,
        condition: float | None,
        seconds: float,
        boxes: int,
        threads: int,
    ) -> str: ...
    def page(self) -> str: ...
    def evaluate(self, system: Subject | None, plan: tuple[int, int, int], progress: _Receiver) -> str: ...

def systems() -> str: ...
def read_robot(text: str) -> tuple[str, list[str]]: ...
def rewritten_robot(text: str, values: Sequence[tuple[str, float]]) -> str: ...
def configuration(
    system: Subject, preset_name: str, structure: str | None, epochs: int | None, changes: str
) -> str: ...
def train(
    system: Subject, config: str, plan: tuple[int, int], out: tuple[str, bool] | None, progress: _Receiver
) -> _Learned: ...
def sweep(
    configurations: Sequence[tuple[Sequence[tuple[str, str]], str]],
    plan: tuple[int, int],
    out: tuple[str, bool],
    progress: _Receiver,
) -> tuple[str, tuple[str, str], int]: ...
def learn(
    q: _Doubles,
    v: _Doubles,
    a: _Doubles,
    columns: tuple[Sequence[str], Sequence[str]],
    choices: str,
    progress: _Receiver,
) -> _Learned: ...
def fit(motion: _Motion, choices: str, out: tuple[str, bool] | None, progress: _Receiver) -> _Learned: ...
def find_constraints(motion: _Motion, degrees: tuple[int, int]) -> str: ...
def formula(motion: _Motion, choices: str) -> str: ...
def identify(motion: _Motion, system: Subject, choices: str) -> str: ...
def inverse_dynamics(
    subject: Subject, q: _Doubles, v: _Doubles, a: _Doubles, t: _Doubles | None
) -> list[_Doubles]: ...
def check(motion: _Motion) -> str: ...
def compare_lagrangians(
    first: Subject, second: Subject, region: _Bounds, degrees: str | None, points: int | None, seed: int
) -> str: ...
def surfaces(
    subject: Subject,
    block: Sequence[int],
    ends: tuple[Sequence[float], Sequence[float]],
    velocity: Sequence[float],
    steps: int,
) -> list[tuple[Sequence[float], str]]: ...
def shadow(
    exact: Subject | None, learned: Subject | None, choices: str, progress: _Receiver
) -> tuple[str, bytes, tuple[int, int]]: ...
def unit_factor(column: str, unit: str) -> float: ...
def read_constraints(path: str) -> dict[str, str]: ...

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Subject",
    "configuration",
    "find_constraints",
    "fit",
    "formula",
    "identify",
    "learn",
    "read_constraints",
    "systems",
    "train",
]

_Doubles = NDArray[np.float64]
_Bounds = Sequence[tuple[str, float, float]]
_Receiver = Callable[[str, float, float, str], None] | None
_Motion = tuple[Sequence[str], Sequence[tuple[Any, ...]], str]
_Learned = tuple[list[Subject], str, str, str, str | None]

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
    def terms(self, q: _Doubles, v: _Doubles, threads: int) -> tuple[list[_Doubles], list[tuple[int, str]]]: ...
    def term(self, name: str, q: _Doubles, v: _Doubles, threads: int) -> _Doubles: ...
    def rollout(
        self,
        q: _Doubles,
        v: _Doubles,
        times: tuple[float, float, float],
        method: str,
        accuracy: tuple[float, float, float | None],
        bounded: bool,
        threads: int,
    ) -> list[tuple[_Doubles, _Doubles, _Doubles, _Doubles, str | None, int]]: ...
    def linearize(self, q: _Doubles, v: _Doubles, force: _Doubles | None) -> list[_Doubles]: ...
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
def configuration(
    system: Subject, preset_name: str, structure: str | None, epochs: int | None, changes: str
) -> str: ...
def train(
    system: Subject, config: str, plan: tuple[int, int], out: tuple[str, bool] | None, progress: _Receiver
) -> _Learned: ...
def learn(
    q: _Doubles,
    v: _Doubles,
    a: _Doubles,
    columns: tuple[Sequence[str], Sequence[str]],
    choices: str,
    progress: _Receiver,
) -> tuple[Subject, str, float, float, str | None]: ...
def fit(motion: _Motion, choices: str, out: tuple[str, bool] | None, progress: _Receiver) -> _Learned: ...
def find_constraints(motion: _Motion, degrees: tuple[int, int]) -> str: ...
def formula(motion: _Motion, choices: str) -> str: ...
def identify(motion: _Motion, system: Subject, choices: str) -> str: ...
def read_constraints(path: str) -> dict[str, str]: ...

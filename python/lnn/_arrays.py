"""Arrays of callers as the contiguous arrays of doubles that the library takes, without a copy where they are that."""

from __future__ import annotations

import json
import math
import operator
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, SupportsFloat, SupportsIndex, cast

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    class DLPack(Protocol):
        """An array of another library."""

        def __dlpack__(self, *, stream: None = ...) -> object: ...

    class Frame(Protocol):
        """A DataFrame of pandas."""

        @property
        def columns(self) -> object: ...
        @property
        def loc(self) -> object: ...

    Numbers = ArrayLike | DLPack
    Path = str | os.PathLike[str]
    # Recorded motion, what there is beside it, and what columns of files mean.
    Recorded = Numbers | Sequence[Numbers] | Frame | Path | Sequence[Path]
    Beside = Numbers | Sequence[Numbers] | Sequence[str]
    Meaning = Mapping[str, str | float | Sequence[str]]
    Units = Mapping[str, str | float]
    # Choices by their path in a configuration.
    Choices = Mapping[str, object]

DOUBLE = np.dtype(np.float64)
# Largest whole number that configurations hold, seeds for one.
MOST = 2**63 - 1


def doubles(what: str, x: object) -> np.ndarray:
    """Anything that is an array, or says by DLPack that it is, as doubles."""
    if type(x) is np.ndarray and x.dtype is DOUBLE:
        return x
    if isinstance(x, (Mapping, set, frozenset, str, bytes)):
        raise TypeError(f"{what}: expected an array of numbers, found a {type(x).__name__}")
    if isinstance(x, np.ma.MaskedArray):
        if np.ma.is_masked(x):
            raise ValueError(f"{what}: {np.ma.count_masked(x)} of {x.size} values are masked: leave their samples out")
        x = x.data
    if not isinstance(x, np.ndarray):
        if hasattr(x, "__dlpack__") and not hasattr(x, "__array__"):
            x = np.from_dlpack(cast(Any, x))
        try:
            x = np.asarray(x)
        except ValueError as error:
            raise ValueError(f"{what}: expected an array, found lists of different lengths") from error
    if x.dtype == np.float64 and x.dtype.isnative:
        return x
    if x.dtype.kind not in "fiub":
        raise TypeError(f"{what}: expected real numbers, found an array of type {x.dtype}")
    return x.astype(np.float64)


def states(q: Numbers, v: Numbers, n: int) -> tuple[np.ndarray, np.ndarray, tuple[int, ...]]:
    """States ``(..., n)`` as two arrays ``(b, n)``, and the shape before the last axis."""
    q, v = doubles("q", q), doubles("v", v)
    shape = q.shape
    if len(shape) == 2 and shape[1] == n and shape == v.shape and q.flags.c_contiguous and v.flags.c_contiguous:
        return q, v, shape[:1]
    if n == 1 and q.ndim == 0 and v.ndim == 0:
        return q.reshape(1, 1), v.reshape(1, 1), ()
    for what, x in ("q", q), ("v", v):
        if x.ndim == 0 or x.shape[-1] != n:
            raise ValueError(f"{what}: expected an array (..., {n}), found the shape {x.shape}")
    if q.shape != v.shape:
        q, v = np.broadcast_arrays(q, v)
    shape = q.shape[:-1]
    return np.ascontiguousarray(q.reshape(-1, n)), np.ascontiguousarray(v.reshape(-1, n)), shape


def thread_count(given: int | None) -> int:
    """Threads, those of the machine if none are given."""
    if given is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return whole("threads", given, 1, 256)


def whole(what: str, given: SupportsIndex, least: int = 0, most: int = MOST) -> int:
    """A whole number within bounds."""
    try:
        number = operator.index(given)
    except TypeError:
        raise TypeError(f"{what}: expected a whole number, found {given!r}") from None
    if not least <= number <= most:
        raise ValueError(f"{what}: expected a whole number from {least} to {most}, found {number}")
    return number


def real(what: str, given: SupportsFloat | str, *, positive: bool = False) -> float:
    """A finite number."""
    if isinstance(given, (str, bytes)):
        raise TypeError(f"{what}: expected a number, found {given!r}")
    try:
        number = float(given)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{what}: expected a number, found {given!r}") from None
    if not math.isfinite(number) or (positive and number <= 0):
        raise ValueError(f"{what}: expected a {'positive' if positive else 'finite'} number, found {number}")
    return number


def doubles_list(what: str, given: object, *, positive: bool = False) -> list[float]:
    """A list of finite numbers."""
    return [real(what, x, positive=positive) for x in doubles(what, given).ravel().tolist()]


def names(what: str, given: Sequence[str]) -> list[str]:
    """A list of names; a text alone is none."""
    if isinstance(given, (str, bytes)) or not hasattr(given, "__iter__"):
        raise TypeError(f"{what}: expected a list of names, found {given!r}")
    return [str(name) for name in given]


def read_result(text: str) -> dict[str, Any]:
    """A result of the library, with what it says for a terminal and for a notebook."""
    whole = json.loads(text)
    return {**whole["result"], "_text": whole["text"], "_html": whole["html"]}


def as_json(given: Choices) -> str:
    """Choices as JSON; one that JSON does not hold is named."""
    return json.dumps({str(key): _held(str(key), x) for key, x in given.items()})


def as_text(what: str, given: object) -> str:
    """A choice as it is written in tables."""
    held = _held(what, given)
    return held if isinstance(held, str) else json.dumps(held)


def _held(what: str, x: object) -> object:
    """A value as JSON holds it."""
    if isinstance(x, np.ndarray):
        x = x.tolist()
    elif isinstance(x, np.generic):
        x = x.item()
    if isinstance(x, Mapping):
        return {str(key): _held(f"{what}.{key}", x) for key, x in x.items()}
    if isinstance(x, (list, tuple)):
        return [_held(what, x) for x in x]
    if isinstance(x, float) and not math.isfinite(x):
        raise ValueError(f"{what}: expected finite numbers, found {x}")
    if isinstance(x, os.PathLike):
        return os.fspath(x)
    if x is not None and not isinstance(x, (bool, int, float, str)):
        raise TypeError(f"{what}: expected numbers, texts, lists or dictionaries of them, found a {type(x).__name__}")
    return x


def bounds_of(given: Mapping | None) -> list[tuple[str, float, float]]:
    """Bounds by column, those of an argument `region`."""
    bounds = []
    for name, pair in (given or {}).items():
        what = f"region: {name}"
        ends = doubles_list(what, pair)
        if len(ends) != 2 or not ends[0] < ends[1]:
            raise ValueError(f"{what}: expected a lower and an upper bound, found {ends}")
        bounds.append((str(name), ends[0], ends[1]))
    return bounds

"""Arrays of callers as the contiguous arrays of doubles that the library takes, without a copy where they are that."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    class DLPack(Protocol):
        """An array of another library."""

        def __dlpack__(self, **options: Any) -> Any: ...

    Numbers = ArrayLike | DLPack

DOUBLE = np.dtype(np.float64)


def doubles(what: str, x: Any) -> np.ndarray:
    """Anything that is an array, or says by DLPack that it is, as doubles."""
    if type(x) is np.ndarray and x.dtype is DOUBLE:
        return x
    if not isinstance(x, np.ndarray):
        if hasattr(x, "__dlpack__") and not hasattr(x, "__array__"):
            x = np.from_dlpack(x)
        x = np.asarray(x)
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
    if not 1 <= given <= 256:
        raise ValueError(f"threads: expected a number from 1 to 256, found {given}")
    return given


def bounds_of(given: Mapping | None) -> list[tuple[str, float, float]]:
    """Bounds by column."""
    return [(name, float(low), float(high)) for name, (low, high) in (given or {}).items()]

"""Recorded motion: arrays of different lengths, a DataFrame, files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._arrays import as_json, doubles, names, real

if TYPE_CHECKING:
    from ._lnn import _Motion


def recorded(
    data: Any,
    coordinates: Sequence[str] | None,
    angles: Sequence[str],
    *,
    dt: float | None = None,
    t: Any = None,
    v: Any = None,
    a: Any = None,
    force: Any = None,
    trajectory: str | None = None,
    columns: Mapping[str, Any] | None = None,
) -> _Motion:
    """Recorded motion as the library takes it: files, trajectories, the meaning of their columns."""
    if coordinates is not None:
        coordinates = names("coordinates", coordinates)
    angles = names("angles", angles)
    files: list[str] = []
    tracks: list[tuple[Any, ...]] = []
    meaning = dict(columns or {})
    if _is_path(data) or (isinstance(data, (list, tuple)) and data and all(map(_is_path, data))):
        if coordinates is None:
            raise TypeError("coordinates: expected the columns of the files")
        for what, given in {"dt": dt, "t": t, "v": v, "a": a, "force": force}.items():
            if given is not None:
                raise TypeError(f"{what}: files have columns of their own, see `columns`")
        files = [os.fspath(path) for path in ([data] if _is_path(data) else data)]
        if trajectory is not None:
            meaning["trajectory"] = trajectory
    else:
        if dt is not None and t is not None:
            raise ValueError("dt: expected the time between samples or the times `t`, found both")
        if hasattr(data, "columns") and hasattr(data, "loc"):
            if coordinates is None:
                raise TypeError("coordinates: expected the columns of the coordinates")
            data, t, v, a, force = _of_frame(data, coordinates, trajectory, (t, v, a, force), dt)
        elif trajectory is not None:
            raise TypeError("trajectory: expected a column of files or of a DataFrame; give arrays as a list of trajectories")
        arrays, beside = _tracks(data, t, dt, v, a, force)
        n = arrays[0].shape[1]
        coordinates = [f"q{i + 1}" for i in range(n)] if coordinates is None else list(coordinates)
        if len(coordinates) != n:
            raise ValueError(f"coordinates: expected {n} names, found {len(coordinates)}")
        # Angles go on past a full turn, as those of files do.
        turning = [i for i, name in enumerate(coordinates) if name in angles]
        flat = lambda x: np.ravel(x).tolist()
        for k, (q, times, *others) in enumerate(zip(arrays, *beside)):
            if turning:
                q = q.copy()
                q[:, turning] = np.unwrap(q[:, turning], axis=0)
            tracks.append((f"trajectory {k + 1}", flat(times), flat(q), *map(flat, others)))
    unknown = [name for name in angles if name not in coordinates]
    if unknown:
        raise ValueError(f"angles: {unknown[0]!r} is none of the coordinates {list(coordinates)}")
    return files, tracks, as_json({"coordinates": list(coordinates), "angles": list(angles), "columns": meaning})


def errors_beside(data: Any, error: Any, trajectory: str | None) -> tuple[dict[str, Any], list[list[float]]]:
    """Standard deviations of positions: their columns in files, or numbers of every trajectory in memory."""
    if error is None:
        return {}, []
    if _is_path(data) or (isinstance(data, (list, tuple)) and data and all(map(_is_path, data))):
        return {"errors": [str(name) for name in error]}, []
    if hasattr(data, "columns") and hasattr(data, "loc"):
        groups = [data] if trajectory is None else [group for _, group in data.groupby(trajectory, sort=False)]
        given = [group[list(error)].to_numpy(float) for group in groups]
    else:
        several = isinstance(data, (list, tuple)) and len(data) > 0 and np.ndim(data[0]) == 2
        given = list(error) if several else [error]
    return {}, [np.ravel(doubles("error", x)).tolist() for x in given]


def _is_path(x: Any) -> bool:
    return isinstance(x, (str, os.PathLike))


def _is_trajectory(x: Any) -> bool:
    """Whether an element of a list is an array (samples, n)."""
    if isinstance(x, (list, tuple)):
        return len(x) > 0 and not np.isscalar(x[0])
    return np.ndim(x) == 2


def _of_frame(
    frame: Any, coordinates: Sequence[str], trajectory: str | None, others: tuple[Any, ...], dt: float | None
) -> Any:
    """Lists of arrays, one per trajectory, of a DataFrame."""
    time, *beside = others
    if time is None and dt is None:
        time = next((name for name in ("t", "time") if name in frame.columns), None)
        if time is None:
            raise ValueError("t: expected the column of the times, found none called t or time")
    groups = [frame] if trajectory is None else [group for _, group in frame.groupby(trajectory, sort=False)]
    of = lambda names: None if names is None else [group[list(names)].to_numpy(float) for group in groups]
    times = None if time is None else [group[time].to_numpy(float) for group in groups]
    return of(coordinates), times, *map(of, beside)


def _tracks(data: Any, t: Any, dt: float | None, v: Any, a: Any, force: Any) -> tuple[list[np.ndarray], Any]:
    """Positions of the trajectories, and times, velocities, accelerations and forces beside them."""
    several = isinstance(data, (list, tuple)) and len(data) > 0 and _is_trajectory(data[0])
    arrays = list(data) if several else [data]
    arrays = [doubles("data", x) for x in arrays]
    for x in arrays:
        if x.ndim not in (1, 2) or (x.ndim == 1 and several):
            raise ValueError(f"data: expected arrays (samples, n), found the shape {x.shape}")
    arrays = [x[:, None] if x.ndim == 1 else x for x in arrays]
    if any(x.shape[1] != arrays[0].shape[1] for x in arrays):
        raise ValueError("data: the trajectories have different numbers of coordinates")
    beside = {"t": t, "v": v, "a": a, "force": force}
    for name, given in beside.items():
        given = given if several or given is None else [given]
        if given is not None and len(given) != len(arrays):
            raise ValueError(f"{name}: expected one array for each of {len(arrays)} trajectories, found {len(given)}")
        beside[name] = [np.empty(0)] * len(arrays) if given is None else [doubles(name, x) for x in given]
    if t is None:
        if dt is None:
            raise ValueError("dt: expected the time between samples, or times `t`")
        dt = real("dt", dt, positive=True)
        beside["t"] = [dt * np.arange(len(x)) for x in arrays]
    return arrays, beside.values()

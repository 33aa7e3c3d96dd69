"""Recorded motion: arrays of different lengths, a DataFrame, files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _lnn
from ._arrays import as_json, doubles, names, real

if TYPE_CHECKING:
    from ._arrays import Meaning, Units
    from ._lnn import _Motion, _Track


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
    columns: Meaning | None = None,
    units: Units | None = None,
    guess: bool = False,
) -> _Motion:
    """Recorded motion as the library takes it: files, trajectories, the meaning of their columns."""
    if coordinates is not None:
        coordinates = names("coordinates", coordinates)
    angles = names("angles", angles)
    files: list[str] = []
    tracks: list[_Track] = []
    meaning: dict[str, object] = dict(columns or {})
    if "units" in meaning:
        raise TypeError("columns: units are an argument, see `units`")
    if _is_path(data) or (isinstance(data, (list, tuple)) and data and all(map(_is_path, data))):
        if coordinates is None and not guess:
            raise TypeError("coordinates: expected the columns of the files")
        coordinates = coordinates or []
        for what, given in {"dt": dt, "t": t, "v": v, "a": a, "force": force}.items():
            if given is not None:
                raise TypeError(f"{what}: files have columns of their own, see `columns`")
        files = [os.fspath(path) for path in ([data] if _is_path(data) else data)]
        if trajectory is not None:
            meaning["trajectory"] = trajectory
        if units:
            meaning["units"] = {str(name): str(unit) for name, unit in units.items()}
    else:
        if dt is not None and t is not None:
            raise ValueError("dt: expected the time between samples or the times `t`, found both")
        if hasattr(data, "columns") and hasattr(data, "loc"):
            if coordinates is None:
                raise TypeError("coordinates: expected the columns of the coordinates")
            if t is None and dt is None:
                t = _time_of(data)
            factors = _factors(units, {"t": None if t is None else [t], "data": coordinates, "v": v, "a": a, "force": force})
            data, t, v, a, force = _of_frame(data, coordinates, trajectory, (t, v, a, force))
            arrays, beside = _tracks(data, t, dt, v, a, force)
        elif trajectory is not None:
            raise TypeError("trajectory: expected a column of files or of a DataFrame; give arrays as a list of trajectories")
        else:
            given = {"t": t, "v": v, "a": a, "force": force}
            arrays, beside = _tracks(data, t, dt, v, a, force)
            n = arrays[0].shape[1]
            coordinates = [f"q{i + 1}" for i in range(n)] if coordinates is None else coordinates
            ends = {"data": "", "v": "_dot", "a": "_ddot", "force": "_force"}
            used = {what: [name + end for name in coordinates] if given.get(what, data) is not None else None for what, end in ends.items()}
            factors = _factors(units, {"t": None if t is None else ["t"], **used})
        if len(coordinates) != arrays[0].shape[1]:
            raise ValueError(f"coordinates: expected {arrays[0].shape[1]} names, found {len(coordinates)}")
        if factors:
            arrays = [_scaled(x, factors["data"]) for x in arrays]
            beside = [[_scaled(x, factors[what]) for x in parts] for what, parts in zip(("t", "v", "a", "force"), beside)]
        # Angles go on past a full turn, as those of files do.
        turning = [i for i, name in enumerate(coordinates) if name in angles]
        flat = lambda x: np.ravel(x).tolist()
        for k, (q, times, *others) in enumerate(zip(arrays, *beside)):
            if turning:
                q = q.copy()
                q[:, turning] = np.unwrap(q[:, turning], axis=0)
            velocities, accelerations, forces = map(flat, others)
            tracks.append((f"trajectory {k + 1}", flat(times), flat(q), velocities, accelerations, forces))
    unknown = [name for name in angles if name not in coordinates and coordinates]
    if unknown:
        raise ValueError(f"angles: {unknown[0]!r} is none of the coordinates {list(coordinates)}")
    return files, tracks, as_json({"coordinates": list(coordinates), "angles": list(angles), "columns": meaning})


def errors_beside(
    data: Any, error: Any, trajectory: str | None, coordinates: Sequence[str], units: Units | None
) -> tuple[dict[str, Any], list[list[float]]]:
    """Standard deviations of positions, in the units of these: their columns in files, or numbers of every trajectory in memory."""
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
    units = {name: unit for name, unit in (units or {}).items() if name in coordinates}
    factors = _factors(units, {"error": coordinates}).get("error", np.ones(1))
    return {}, [np.ravel(_scaled(doubles("error", x), factors)).tolist() for x in given]


def measured_columns(
    data: Any, quantities: Sequence[Mapping[str, Any]], t: Any, error: Any
) -> tuple[Any, list[str], list[str], Any, Any]:
    """Measured quantities as columns: the data, the columns, those that are angles, times and columns of errors."""
    columns = [own["column"] for own in quantities]
    angles = [own["column"] for own in quantities if own["periodic"]]
    of_files = _is_path(data) or (isinstance(data, (list, tuple)) and bool(data) and all(map(_is_path, data)))
    if isinstance(data, Mapping):
        by_name = {own["name"]: own["column"] for own in quantities}
        missing = [name for name, column in by_name.items() if name not in data and column not in data]
        if missing:
            raise ValueError(f"data: expected the measured quantities {', '.join(by_name)}, found none called {missing[0]}")
        t = data["t"] if t is None and "t" in data else t
        data = np.column_stack([np.asarray(data[name if name in data else by_name[name]], float) for name in by_name])
    elif error is None and quantities[0]["error"] and (of_files or hasattr(data, "loc")):
        error = [own["error"] for own in quantities]
    return data, columns, angles, t, error


def inputs_beside(
    data: Any, inputs: Any, trajectory: str | None, names: Sequence[str]
) -> tuple[dict[str, Any], list[list[float]]]:
    """Inputs of a system: their columns in files, or numbers of every trajectory in memory."""
    if not names:
        if inputs is not None:
            raise ValueError("inputs: the system has none")
        return {}, []
    if _is_path(data) or (isinstance(data, (list, tuple)) and data and all(map(_is_path, data))):
        return {"inputs": [str(name) for name in (names if inputs is None else inputs)]}, []
    if hasattr(data, "columns") and hasattr(data, "loc"):
        groups = [data] if trajectory is None else [group for _, group in data.groupby(trajectory, sort=False)]
        given = [group[list(names if inputs is None else inputs)].to_numpy(float) for group in groups]
    elif inputs is None:
        raise ValueError(f"inputs: expected values of {', '.join(names)}")
    else:
        several = isinstance(data, (list, tuple)) and len(data) > 0 and np.ndim(data[0]) == 2
        given = list(inputs) if several else [inputs]
    return {}, [np.ravel(doubles("inputs", x)).tolist() for x in given]


def _is_path(x: object) -> bool:
    return isinstance(x, (str, os.PathLike))


def _is_trajectory(x: Any) -> bool:
    """Whether an element of a list is an array (samples, n)."""
    if isinstance(x, (list, tuple)):
        return len(x) > 0 and not np.isscalar(x[0])
    return np.ndim(x) == 2


def _factors(units: Units | None, used: Mapping[str, Sequence[str] | None]) -> dict[str, np.ndarray]:
    """Factors to SI of the columns that are used, by what they are; none without units."""
    if not units:
        return {}
    known = [name for columns in used.values() for name in columns or ()]
    for name in units:
        if name not in known:
            raise ValueError(f"units: no column {name!r}, expected one of {known}")
    factor = lambda name: _lnn.unit_factor(name, str(units[name])) if name in units else 1.0
    return {what: np.array([factor(name) for name in columns or ()]) for what, columns in used.items()}


def _scaled(x: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Columns in SI; what has other columns is refused by the library."""
    return x * factors if x.size and len(factors) in (1, *x.shape[-1:]) else x


def _time_of(frame: Any) -> str:
    """The column of the times that no argument names."""
    time = next((name for name in ("t", "time") if name in frame.columns), None)
    if time is None:
        raise ValueError("t: expected the column of the times, found none called t or time")
    return time


def _of_frame(frame: Any, coordinates: Sequence[str], trajectory: str | None, others: tuple[Any, ...]) -> Any:
    """Lists of arrays, one per trajectory, of a DataFrame."""
    time, *beside = others
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

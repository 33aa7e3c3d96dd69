"""Trainings and fits."""

from __future__ import annotations

import itertools
import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from . import _lnn
from ._arrays import as_json, as_text, doubles, names, states, thread_count, whole
from ._mechanics import Model, System
from ._progress import Progress, receiver
from ._recorded import recorded
from ._results import Constraints, Learned, Swept

if TYPE_CHECKING:
    from ._arrays import Beside, Choices, Meaning, Numbers, Recorded, Units


def _learned(found: _lnn._Learned) -> Learned:
    subjects, history, summary, (text, html), stop = found
    models = [Model(subject) for subject in subjects]
    return Learned(models[0], _history(history), json.loads(summary), stop, models, text, html)


def _history(text: str) -> dict[str, np.ndarray]:
    epochs = json.loads(text)
    none = lambda x: np.nan if x is None else x
    return {name: np.array([none(epoch[name]) for epoch in epochs]) for name in (epochs[0] if epochs else ())}


def train(
    system: System | str,
    *,
    preset: str = "quick",
    structure: str | None = None,
    known: System | None = None,
    hidden: Sequence[int] | None = None,
    epochs: int | None = None,
    precision: str | None = None,
    seed: int = 0,
    threads: int | None = None,
    starts: int = 4,
    out: str | os.PathLike | None = None,
    overwrite: bool = False,
    progress: Progress = None,
    config: Choices | None = None,
) -> Learned:
    """Learns a system from sampled states, and judges the model on fresh ones; Ctrl-C ends it with the best model so far.

    Parameters
    ----------
    system : System or str
        The system, or its name in the catalogue.
    preset : str
        ``"quick"`` (a minute on two cores), ``"best"``, or ``"paper"``.
    structure : str, optional
        ``"black-box"``, ``"mechanical"`` or ``"metric"``.
    known : System, optional
        A formula that is added to what the network learns; its parameters marked ``learn`` are found, see `Model.constants`.
    hidden : sequence of int, optional
        Widths of the hidden layers.
    epochs : int, optional
        Passes through the states of every phase.
    precision : str, optional
        ``"f32"`` or ``"f64"`` in training.
    threads : int, optional
        Threads; results do not depend on them.
    out : path, optional
        Directory for model, tables, pictures and report; one that holds a run is refused unless `overwrite` is set.
    progress : bool or callable, optional
        True for a line at the terminal, or a function of kind, two numbers and a text.
    config : dict, optional
        Any other choice by its path in the configuration: ``{"optimizer.batch": 64, "phase.0.rate": 1e-3}``.
    """
    system = System(system) if isinstance(system, str) else system
    changes: dict[str, object] = {"seed": whole("seed", seed), **_known(known)}
    if hidden is not None:
        changes["network.hidden"] = _widths(hidden)
    if precision is not None:
        changes["precision"] = precision
    changes |= dict(config or {})
    epochs = None if epochs is None else whole("epochs", epochs, 1)
    complete = _lnn.configuration(system._subject, preset, structure, epochs, as_json(changes))
    plan = whole("starts", starts, 1), thread_count(threads)
    return _learned(_lnn.train(system._subject, complete, plan, _target(out, overwrite), receiver(progress)))


def sweep(
    system: System | str,
    vary: Mapping[str, Sequence[object]],
    *,
    out: str | os.PathLike,
    seeds: int = 1,
    preset: str = "quick",
    structure: str | None = None,
    epochs: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    overwrite: bool = False,
    progress: Progress = None,
    config: Choices | None = None,
) -> Swept:
    """Trains a system with every combination of the values of some choices, and collects the runs in a table; finished runs are not run again.

    Parameters
    ----------
    system : System or str
        The system, or its name in the catalogue.
    vary : dict of str to sequence
        Choices by their paths in the configuration and the values that each takes: ``{"optimizer.batch": [32, 64]}``.
    out : path
        Directory of the runs, each in one of its own, with table and report; finished runs of other choices are refused unless `overwrite`
        is set.
    seeds : int
        Seeds of every combination, from `seed` on.
    threads : int, optional
        Threads; as many runs are trained side by side.
    preset, structure, epochs, progress, config
        As of `train`.
    """
    system = System(system) if isinstance(system, str) else system
    counts = [len(values) for values in vary.values()] + [whole("seeds", seeds, 1, 10_000)]
    if not 1 <= math.prod(counts) <= 10_000:
        raise ValueError(f"vary: expected 1 to 10000 runs, found {math.prod(counts)}")
    epochs = None if epochs is None else whole("epochs", epochs, 1)
    runs = []
    for values in itertools.product(*vary.values()):
        choice = dict(zip(vary, values))
        changes = as_json({"seed": whole("seed", seed), **(config or {}), **choice})
        complete = _lnn.configuration(system._subject, preset, structure, epochs, changes)
        runs.append(([(str(key), as_text(str(key), value)) for key, value in choice.items()], complete))
    if len({complete for _, complete in runs}) < len(runs):
        raise ValueError("vary: expected values that differ")
    target = os.fspath(out), bool(overwrite)
    rows, (text, html), finished = _lnn.sweep(runs, (counts[-1], thread_count(threads)), target, receiver(progress))
    return Swept(json.loads(rows), finished, os.fspath(out), text, html)


def _target(out: str | os.PathLike | None, overwrite: bool) -> tuple[str, bool] | None:
    """Where files go, and whether they replace those of another run."""
    return None if out is None else (os.fspath(out), bool(overwrite))


def _widths(hidden: Sequence[int]) -> list[int]:
    if isinstance(hidden, (str, bytes)) or not hasattr(hidden, "__iter__"):
        raise TypeError(f"hidden: expected the widths of the hidden layers, found {hidden!r}")
    return [whole("hidden", width, 1) for width in hidden]


def _known(known: System | None) -> dict[str, object]:
    """Choices of a known part: it has a kinetic energy of its own, and the network begins with next to nothing beside it."""
    if known is None:
        return {}
    choices = {"known": _description(known), "alpha": 0.0, "initialization": "near-zero"}
    return {f"network.{key}": choice for key, choice in choices.items()}


def _description(known: System) -> dict:
    if known.description is None:
        raise ValueError("known: expected a system with a formula of its own")
    return known.description


def _constraints(given: str | os.PathLike | Mapping[str, str] | Constraints | None) -> str | dict[str, str]:
    """Constraints by name as the library takes them: ``"find"``, ``"none"``, or formulas."""
    if given is None:
        return "none"
    if isinstance(given, Constraints):
        given = given.formulas
    if isinstance(given, Mapping):
        return {str(name): str(formula) for name, formula in given.items()} or "none"
    path = os.fspath(given)
    return path if path in ("find", "none") else _lnn.read_constraints(path)


def learn(
    q: Numbers,
    v: Numbers,
    a: Numbers,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    structure: str | None = None,
    hidden: Sequence[int] | None = None,
    epochs: int | None = None,
    dissipation: int | None = None,
    constraints: Mapping[str, str] | Constraints | None = None,
    precision: str = "f32",
    seed: int = 0,
    threads: int | None = None,
    progress: Progress = None,
    config: Choices | None = None,
) -> Learned:
    """Learns from states with their accelerations; Ctrl-C ends it with the best model so far.

    Parameters
    ----------
    q, v, a : array_like (b, n)
        Coordinates, velocities, accelerations. A tenth of the states chooses the best epoch, another tenth judges the result.
    coordinates : sequence of str, optional
        Names; ``q1``, ``q2``, .. by default.
    angles : sequence of str
        Coordinates that are angles in rad.
    dissipation : int, optional
        Units of a friction that is learned beside the Lagrangian.
    constraints : dict of str to str, optional
        Formulas by name that vanish at every state; they are kept in the model.
    """
    rows = doubles("a", a)
    if rows.ndim != 2:
        raise ValueError(f"a: expected an array (b, n), found the shape {rows.shape}")
    n = rows.shape[1]
    q, v, shape = states(q, v, n)
    if shape != rows.shape[:1]:
        raise ValueError(f"expected as many states as accelerations, found {shape} and {rows.shape[:1]}")
    columns = [f"q{i + 1}" for i in range(n)] if coordinates is None else names("coordinates", coordinates)
    if len(columns) != n:
        raise ValueError(f"coordinates: expected {n} names, found {len(columns)}")
    choices = _choices(structure, hidden, epochs, precision, seed, threads, config)
    choices["dissipation"] = None if dissipation is None else whole("dissipation", dissipation, 1)
    choices["constraints"] = _constraints(constraints)
    described = columns, names("angles", angles)
    return _learned(_lnn.learn(q, v, np.ascontiguousarray(rows), described, as_json(choices), receiver(progress)))


def _choices(
    structure: str | None,
    hidden: Sequence[int] | None,
    epochs: int | None,
    precision: str,
    seed: int,
    threads: int | None,
    config: Choices | None,
) -> dict[str, object]:
    return {
        "structure": structure,
        "hidden": None if hidden is None else _widths(hidden),
        "epochs": None if epochs is None else whole("epochs", epochs, 1),
        "precision": precision,
        "seed": whole("seed", seed),
        "threads": thread_count(threads),
        "changes": dict(config or {}),
    }


def fit(
    data: Recorded,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    dt: float | None = None,
    t: Beside | None = None,
    v: Beside | None = None,
    a: Beside | None = None,
    force: Beside | None = None,
    trajectory: str | None = None,
    columns: Meaning | None = None,
    units: Units | None = None,
    friction: bool = False,
    constraints: str | os.PathLike | Mapping[str, str] | Constraints | None = None,
    structure: str | None = None,
    known: System | None = None,
    hidden: Sequence[int] | None = None,
    epochs: int | None = None,
    precision: str = "f32",
    seed: int = 0,
    members: int = 1,
    formula: bool = False,
    threads: int | None = None,
    out: str | os.PathLike | None = None,
    overwrite: bool = False,
    progress: Progress = None,
    config: Choices | None = None,
) -> Learned:
    """Learns from recorded motion, and judges the model by motion that was held out; Ctrl-C ends it with the best model so far.

    Parameters
    ----------
    data : array_like (samples, n), a list of such of different lengths, a DataFrame, or paths
        Coordinates of one trajectory or of several; or CSV, NPY and NPZ files, whose columns `coordinates` names.
    coordinates : sequence of str
        Names, or columns; ``q1``, ``q2``, .. for arrays by default.
    angles : sequence of str
        Coordinates that are angles in rad.
    dt : float
        Time between samples of arrays in s, if `t` is not given.
    t, v, a, force : array_like, or lists of such
        Times, and measured velocities, accelerations and known forces of the trajectories, as far as they are known. Of a DataFrame, names of
        columns.
    trajectory : str, optional
        Column whose value distinguishes the trajectories of a file or a DataFrame.
    columns : dict, optional
        More about the columns of files: ``time``, ``rate``, ``velocities``, ``accelerations``, ``forces``, and
        ``wide``, whether trajectories are side by side.
    units : dict of str to str or float, optional
        Units of columns that are not SI, or factors to SI, such as ``{"theta": "deg", "t": "ms", "x": 0.01}``. Arrays have the columns ``t``,
        the coordinates, and ``x_dot``, ``x_ddot`` and ``x_force`` of a coordinate ``x``.
    friction : bool
        Whether a friction is learned beside the Lagrangian.
    constraints : str, path or dict, optional
        What holds the coordinates together: ``"find"`` reads it off the motion, ``"none"`` is the default; or formulas by name that vanish,
        what `find_constraints` returned, or a file with a table ``constraints``. They are kept in the model.
    known : System, optional
        A formula that is added to what the network learns; its parameters marked ``learn`` are found, see `Model.constants`.
    members : int
        Networks that are trained one after another on the same recording, by `seed` and those that follow it, 32 at most: what they say
        differently is what the recording leaves open, or the training. ``summary["members"]`` compares them.
    formula : bool
        Whether a formula of the Lagrangian is looked for in the motion that is learned from, with friction if there is one: minutes.
        ``summary["formula"]`` has it.
    out : path, optional
        Directory for model, tables, pictures and report; one that holds a run is refused unless `overwrite` is set.
    config : dict, optional
        Any other choice by its path in the configuration of a fit: ``{"held_out": 0.3, "training.optimizer.batch": 64}``.
    """
    motion = recorded(
        data, coordinates, angles, dt=dt, t=t, v=v, a=a, force=force, trajectory=trajectory, columns=columns, units=units
    )
    choices = _choices(structure, hidden, epochs, precision, seed, threads, config)
    choices |= {"friction": bool(friction), "members": whole("members", members, 1, 32), "formula": bool(formula), "constraints": _constraints(constraints)}
    choices["known"] = None if known is None else _description(known)
    return _learned(_lnn.fit(motion, as_json(choices), _target(out, overwrite), receiver(progress)))

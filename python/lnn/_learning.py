"""Trainings and fits."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from . import _lnn
from ._arrays import doubles, states, thread_count
from ._mechanics import Model, System
from ._progress import Progress, receiver
from ._recorded import recorded
from ._results import Learned


def _learned(found) -> Learned:
    subject, history, summary, text, stop = found
    return Learned(Model(subject), _history(history), json.loads(summary), text, stop)


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
    progress: Progress = None,
    config: Mapping[str, Any] | None = None,
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
        Directory for model, tables, pictures and report.
    progress : bool or callable, optional
        True for a line at the terminal, or a function of kind, two numbers and a text.
    config : dict, optional
        Any other choice by its path in the configuration: ``{"optimizer.batch": 64, "phase.0.rate": 1e-3}``.
    """
    system = System(system) if isinstance(system, str) else system
    changes: dict[str, Any] = {"seed": seed, **_known(known)}
    if hidden is not None:
        changes["network.hidden"] = [int(width) for width in hidden]
    if precision is not None:
        changes["precision"] = precision
    changes |= dict(config or {})
    whole = _lnn.configuration(system._subject, preset, structure, epochs, json.dumps(changes))
    directory = None if out is None else os.fspath(out)
    return _learned(_lnn.train(system._subject, whole, (starts, thread_count(threads)), directory, receiver(progress)))


def _known(known: System | None, prefix: str = "") -> dict[str, Any]:
    """Choices of a known part: it has a kinetic energy of its own, and the network begins with next to nothing beside it."""
    if known is None:
        return {}
    if known.description is None:
        raise ValueError("known: expected a system with a formula of its own")
    choices = {"known": known.description, "alpha": 0.0, "initialization": "near-zero"}
    return {f"{prefix}network.{key}": choice for key, choice in choices.items()}


def learn(
    q,
    v,
    a,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    structure: str | None = None,
    hidden: Sequence[int] | None = None,
    epochs: int | None = None,
    dissipation: int | None = None,
    precision: str = "f32",
    seed: int = 0,
    threads: int | None = None,
    config: Mapping[str, Any] | None = None,
) -> Learned:
    """Learns from states with their accelerations.

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
    """
    a = doubles("a", a)
    if a.ndim != 2:
        raise ValueError(f"a: expected an array (b, n), found the shape {a.shape}")
    n = a.shape[1]
    q, v, shape = states(q, v, n)
    if shape != a.shape[:1]:
        raise ValueError(f"expected as many states as accelerations, found {shape} and {a.shape[:1]}")
    names = [f"q{i + 1}" for i in range(n)] if coordinates is None else list(coordinates)
    if len(names) != n:
        raise ValueError(f"coordinates: expected {n} names, found {len(names)}")
    choices = _choices(structure, hidden, epochs, precision, seed, threads, config) | {"dissipation": dissipation}
    found = _lnn.learn(q, v, np.ascontiguousarray(a), (names, list(angles)), json.dumps(choices))
    subject, history, validation, test = found
    summary = {"validation_loss": validation, "test_loss": test}
    text = f"loss (paper): validation {validation:.4g}, fresh states {test:.4g}\n"
    return Learned(Model(subject), _history(history), summary, text)


def _choices(structure, hidden, epochs, precision, seed, threads, config) -> dict:
    return {
        "structure": structure,
        "hidden": None if hidden is None else [int(width) for width in hidden],
        "epochs": epochs,
        "precision": precision,
        "seed": seed,
        "threads": thread_count(threads),
        "changes": dict(config or {}),
    }


def fit(
    data,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    dt: float | None = None,
    t=None,
    v=None,
    a=None,
    force=None,
    trajectory: str | None = None,
    columns: Mapping[str, Any] | None = None,
    friction: bool = False,
    structure: str | None = None,
    known: System | None = None,
    hidden: Sequence[int] | None = None,
    epochs: int | None = None,
    precision: str = "f32",
    seed: int = 0,
    threads: int | None = None,
    out: str | os.PathLike | None = None,
    progress: Progress = None,
    config: Mapping[str, Any] | None = None,
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
        More about the columns of files: ``time``, ``rate``, ``velocities``, ``accelerations``, ``forces``, ``units``.
    friction : bool
        Whether a friction is learned beside the Lagrangian.
    known : System, optional
        A formula that is added to what the network learns; its parameters marked ``learn`` are found, see `Model.constants`.
    config : dict, optional
        Any other choice by its path in the configuration of a fit: ``{"training.optimizer.batch": 64}``.
    """
    more = {"dt": dt, "t": t, "v": v, "a": a, "force": force, "trajectory": trajectory, "columns": columns}
    motion = recorded(data, coordinates, angles, **more)
    config = {**_known(known, "training."), **(config or {})}
    choices = _choices(structure, hidden, epochs, precision, seed, threads, config)
    directory = None if out is None else os.fspath(out)
    return _learned(_lnn.fit(motion, json.dumps({**choices, "friction": friction}), directory, receiver(progress)))

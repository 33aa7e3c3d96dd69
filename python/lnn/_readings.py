"""What is read off recorded motion: its constraints, and its Lagrangian as a formula."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from . import _lnn
from ._arrays import thread_count
from ._recorded import recorded
from ._results import Constraint, Constraints, Formula


def find_constraints(
    data,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    dt: float | None = None,
    t=None,
    v=None,
    trajectory: str | None = None,
    columns: Mapping[str, Any] | None = None,
    degree: int = 2,
    velocity_degree: int = 1,
) -> Constraints:
    """Finds what the coordinates of recorded motion obey.

    Parameters
    ----------
    data, coordinates, angles, dt, t, v, trajectory, columns
        The motion, as in `fit`.
    degree : int
        Largest total degree of the functions of the coordinates that are tried, 1 to 8; angles take part by sine and cosine.
    velocity_degree : int
        The same of the factors of velocities, 0 to 8.
    """
    more = {"dt": dt, "t": t, "v": v, "trajectory": trajectory, "columns": columns}
    motion = recorded(data, coordinates, angles, **more)
    found = json.loads(_lnn.find_constraints(motion, (degree, velocity_degree)))
    of = lambda c: Constraint(**{**c, "range": {name: tuple(ends) for name, ends in c["range"].items()}})
    found["constraints"], found["noise"] = tuple(map(of, found["constraints"])), np.array(found["noise"])
    return Constraints(**found)


def formula(
    data,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    dt: float | None = None,
    t=None,
    v=None,
    force=None,
    trajectory: str | None = None,
    columns: Mapping[str, Any] | None = None,
    friction: bool = False,
    noise: Sequence[float] | None = None,
    basis: str | None = None,
    functions: Sequence[str] = (),
    gyroscopic: bool = True,
    scale: tuple[str, float] | None = None,
    bootstraps: int = 40,
    seed: int = 0,
    threads: int | None = None,
    name: str = "formula",
) -> Formula:
    """The Lagrangian of recorded motion as a formula.

    Parameters
    ----------
    data, coordinates, angles, dt, t, v, force, trajectory, columns
        The motion, as in `fit`.
    friction : bool
        Whether a Rayleigh dissipation function is looked for beside L.
    noise : sequence of float, optional
        Standard deviation of the noise of every coordinate in SI units; estimated by default.
    basis : str, optional
        Functions that terms are made of, by family and total degree; ``"polynomial:2,trigonometric:2"`` by default, ``radial`` and
        ``reciprocal`` are others.
    functions : sequence of str
        Functions of the coordinates beside them, such as ``"exp(-x)"``.
    gyroscopic : bool
        Whether terms that are linear in the velocities are tried, those of magnetic fields and turning frames.
    scale : (str, float), optional
        Term and coefficient that fix the common factor; the first square of a velocity and 1/2 by default, known forces where there are some.
    bootstraps : int
        Resamplings of the trajectories that give every term a probability, 10000 at most.
    threads : int, optional
        Threads; the result does not depend on them.
    name : str
        Name of the system that the formula makes.
    """
    more = {"dt": dt, "t": t, "v": v, "force": force, "trajectory": trajectory, "columns": columns}
    motion = recorded(data, coordinates, angles, **more)
    noise = None if noise is None else [float(x) for x in noise]
    choices = formula_choices(basis, functions, gyroscopic, friction, noise, scale, bootstraps, seed, threads, name)
    return read_formula(_lnn.formula(motion, choices))


def formula_choices(basis, functions, gyroscopic, friction, noise, scale, bootstraps, seed, threads, name) -> str:
    """Choices of a search as the library takes them."""
    given = {"basis": basis, "functions": list(functions), "gyroscopic": gyroscopic, "friction": friction, "noise": noise}
    given |= {"scale": scale, "bootstraps": bootstraps, "seed": seed, "threads": thread_count(threads), "name": name}
    return json.dumps(given)


def read_formula(text: str) -> Formula:
    """The formula that the library found."""
    found = json.loads(text)
    number = lambda x: np.nan if x is None else x
    terms = found["terms"]
    column = lambda key: np.array([number(term[key]) for term in terms], float)
    return Formula(
        verdict=found["verdict"],
        lagrangian=found["lagrangian"],
        dissipation=found["dissipation"],
        terms=tuple(term["term"] for term in terms),
        coefficients=column("coefficient"),
        standard_errors=column("standard_error"),
        probabilities=column("probability"),
        dissipative=np.array([term["dissipation"] for term in terms], bool),
        near=tuple(term["near"] for term in terms),
        residual=number(found["residual"]),
        noise=np.array(found["noise"], float),
        noise_resolved=found["noise_resolved"],
        left=tuple(map(tuple, found["left"])),
        searched=found["searched"],
        removed=found["removed"],
        coordinates=tuple(found["coordinates"]),
        toml=found["toml"],
        rust=found["rust"],
        _latex=tuple(found["latex"]),
    )

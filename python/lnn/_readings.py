"""What is read off recorded motion: its constraints, its Lagrangian as a formula, the constants of a form that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _lnn
from ._arrays import as_json, doubles_list, names, read_result, real, thread_count, whole
from ._recorded import errors_beside, inputs_beside, measured_columns, recorded
from ._mechanics import System
from ._results import Bodies, ByTrajectory, Checked, Combination, Constraint, Constraints, Formula, Identified, IdentifiedConstant, OfTrajectory, Outlier
from ._results import PeriodicDrive, Residual, Scatter, SensorConstant, Undetermined

if TYPE_CHECKING:
    from ._arrays import Beside, Meaning, Recorded, Units


def check(
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
) -> Checked:
    """A first look at recorded motion, before anything learns from it.

    Parameters
    ----------
    data, coordinates, angles, dt, t, v, a, force, trajectory, columns, units
        The motion, as in `fit`. Columns of files are guessed from names and numbers if `coordinates` are not given.
    """
    motion = recorded(
        data, coordinates, angles, dt=dt, t=t, v=v, a=a, force=force, trajectory=trajectory, columns=columns, units=units, guess=True
    )
    found = read_result(_lnn.check(motion))
    facts = found["facts"]
    return Checked(
        samples=facts["samples"],
        trajectories=len(facts["tracks"]),
        step=facts["step"],
        coordinates={one["name"]: one for one in facts["coordinates"]},
        warnings=tuple(facts["warnings"]),
        suspicious=tuple(facts["suspicious"]),
        obstacle=facts["obstacle"],
        constraints=found["constraints"],
        formula=facts["formula"],
        next=facts["next"],
        call=found["call"],
        facts=facts,
        _text=found["_text"],
        _html=found["_html"],
    )


def find_constraints(
    data: Recorded,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    dt: float | None = None,
    t: Beside | None = None,
    v: Beside | None = None,
    trajectory: str | None = None,
    columns: Meaning | None = None,
    units: Units | None = None,
    degree: int = 2,
    velocity_degree: int = 1,
) -> Constraints:
    """Finds what the coordinates of recorded motion obey.

    Parameters
    ----------
    data, coordinates, angles, dt, t, v, trajectory, columns, units
        The motion, as in `fit`.
    degree : int
        Largest total degree of the functions of the coordinates that are tried, 1 to 8; angles take part by sine and cosine.
    velocity_degree : int
        The same of the factors of velocities, 0 to 8.
    """
    motion = recorded(
        data, coordinates, angles, dt=dt, t=t, v=v, trajectory=trajectory, columns=columns, units=units
    )
    degrees = whole("degree", degree, 1, 8), whole("velocity_degree", velocity_degree, 0, 8)
    found = read_result(_lnn.find_constraints(motion, degrees))
    of = lambda c: Constraint(**{**c, "range": {name: tuple(ends) for name, ends in c["range"].items()}})
    found["constraints"], found["noise"] = tuple(map(of, found["constraints"])), np.array(found["noise"])
    return Constraints(**found)


def formula(
    data: Recorded,
    *,
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] = (),
    dt: float | None = None,
    t: Beside | None = None,
    v: Beside | None = None,
    force: Beside | None = None,
    trajectory: str | None = None,
    columns: Meaning | None = None,
    units: Units | None = None,
    friction: bool = False,
    noise: Sequence[float] | None = None,
    basis: str | None = None,
    functions: Sequence[str] = (),
    gyroscopic: bool = True,
    drive: bool = True,
    scale: tuple[str, float] | None = None,
    bootstraps: int = 40,
    seed: int = 0,
    threads: int | None = None,
    between: str | None = None,
    name: str = "formula",
) -> Formula:
    """The Lagrangian of recorded motion as a formula.

    Parameters
    ----------
    data, coordinates, angles, dt, t, v, force, trajectory, columns, units
        The motion, as in `fit`.
    friction : bool
        Whether a Rayleigh dissipation function is looked for beside L, first with constant coefficients, then with functions of the
        coordinates.
    noise : sequence of float, optional
        Standard deviation of the noise of every coordinate in SI units; estimated by default.
    basis : str, optional
        Functions that terms are made of, by family and total degree, such as ``"polynomial:2,trigonometric:2"``; ``radial`` and
        ``reciprocal`` are others. By default larger and larger ones, until one explains the motion.
    functions : sequence of str
        Functions of the coordinates beside them, such as ``"exp(-x)"``.
    gyroscopic : bool
        Whether terms that are linear in the velocities are tried, those of magnetic fields and turning frames.
    drive : bool
        Whether a periodic drive of unknown frequency is looked for where no formula without one is found.
    scale : (str, float), optional
        Term and coefficient that fix the common factor; the first square of a velocity and 1/2 by default, known forces where there are some.
    bootstraps : int
        Resamplings of the trajectories that give every term a probability, 10000 at most.
    threads : int, optional
        Threads; the result does not depend on them.
    between : str, optional
        Known forces between the samples, as in `identify`; what meets the motion best by default.
    name : str
        Name of the system that the formula makes.
    """
    motion = recorded(
        data, coordinates, angles, dt=dt, t=t, v=v, force=force, trajectory=trajectory, columns=columns, units=units
    )
    noise = None if noise is None else doubles_list("noise", noise, positive=True)
    choices = formula_choices(basis, functions, gyroscopic, friction, noise, scale, bootstraps, seed, threads, name, between, drive)
    return read_formula(_lnn.formula(motion, choices))


def identify(
    data: Recorded,
    system: System | str,
    *,
    constants: Sequence[str] = (),
    coordinates: Sequence[str] | None = None,
    angles: Sequence[str] | None = None,
    dt: float | None = None,
    t: Beside | None = None,
    v: Beside | None = None,
    force: Beside | None = None,
    trajectory: str | None = None,
    columns: Meaning | None = None,
    units: Units | None = None,
    offsets: Sequence[str] = (),
    gains: Sequence[str] = (),
    delays: Sequence[str] = (),
    noise: Sequence[float] | None = None,
    error: Beside | None = None,
    inputs: Beside | None = None,
    targets: str | None = None,
    between: str | None = None,
    segment: float | None = None,
    robust: bool = False,
    by_trajectory: bool = False,
    threads: int | None = None,
) -> Identified:
    """Finds the constants of a system whose form is known, from recorded motion, without a network.

    Parameters
    ----------
    data, dt, t, v, force, trajectory, columns, units
        The motion, as in `fit`.
    system : System or str
        The form, or its name in the catalogue; the search starts at the values of its parameters. If it has `measured` quantities, these are the
        data: an array in their order, a mapping of arrays by their names with ``t`` beside them, or their columns.
    constants : sequence of str
        Symbols of the unknown constants; those that a file marks ``learn`` by default, all if it marks none.
    coordinates, angles : sequence of str, optional
        Columns in the order of the system, and which of them are angles; the names and the angles of the system by default.
    offsets, gains, delays : sequence of str
        Coordinates whose sensor has an unknown offset, an unknown gain, or is late by an unknown time.
    noise : sequence of float, optional
        Standard deviation of the noise of every coordinate in SI units; estimated by default.
    error : optional
        Standard deviations of the positions, sample by sample: an array like the data, or a list of them; of files and DataFrames the names of
        their columns. Residuals are weighed by them.
    inputs : optional
        The `inputs` of the system at the samples, in their order: an array ``(samples, k)``, or a list of them; of files and DataFrames the
        names of their columns, by default those of the inputs.
    targets : str, optional
        What is met, ``"motion"`` or ``"forces"``; the forces of a chain of links, else the motion by default.
    between : str, optional
        Known forces between the samples: ``"held"``, ``"linear"``, ``"cubic"`` or ``"band-limited"``; what meets the motion best by default.
    segment : float, optional
        Length of the segments that are followed in s; what makes the constants best known by default.
    robust : bool
        Whether residuals beyond three standard deviations count linearly, so that outliers move little.
    by_trajectory : bool
        Whether every trajectory is identified alone, too, and the constants are compared; 64 trajectories at most.
    threads : int, optional
        Threads; the result does not depend on them.

    Examples
    --------
    >>> import lnn
    >>> swing = lnn.System("n-pendulum", n=1, l=0.7).rollout([1.0], [0.0], 6.0, 0.02)
    >>> found = identify(swing.q, lnn.System("n-pendulum", n=1), constants=["l"], dt=0.02)
    >>> round(found.constants["l"].value, 4)
    0.7
    """
    system = System(system) if isinstance(system, str) else system
    if system.measured and coordinates is None:
        data, coordinates, angles, t, error = measured_columns(data, system._facts["measured"], t, error)
    coordinates = list(system.coordinates) if coordinates is None else list(coordinates)
    if angles is None:
        turning = [name in system.angles for name in system.coordinates]
        angles = [name for name, angle in zip(coordinates, turning) if angle]
    if noise is not None and error is not None:
        raise ValueError("error: expected either errors sample by sample or the noise of every coordinate, found both")
    beside, errors = errors_beside(data, error, trajectory, coordinates, units)
    more, measured = inputs_beside(data, inputs, trajectory, system.inputs)
    beside |= more
    motion = recorded(
        data, coordinates, angles, dt=dt, t=t, v=v, force=force, trajectory=trajectory, columns={**(columns or {}), **beside}, units=units
    )
    named = {"constants": constants, "offsets": offsets, "gains": gains, "delays": delays}
    choices: dict[str, object] = {key: names(key, given) for key, given in named.items()}
    choices["noise"] = None if noise is None else doubles_list("noise", noise, positive=True)
    choices["segment"] = None if segment is None else real("segment", segment, positive=True)
    choices |= {"targets": targets, "between": between, "robust": bool(robust), "by_trajectory": bool(by_trajectory), "threads": thread_count(threads), "errors": errors, "inputs": measured}
    found = read_result(_lnn.identify(motion, system._subject, as_json(choices)))
    found["constants"] = {symbol: IdentifiedConstant(**constant) for symbol, constant in found["constants"].items()}
    found["obstacles"] = tuple(found["obstacles"])
    found["sensors"] = tuple(SensorConstant(**sensor) for sensor in found["sensors"])
    unknowns = len(found["constants"]) + len(found["sensors"])
    found["correlations"] = np.array(found["correlations"]["matrix"], float).reshape(unknowns, unknowns)
    found["undetermined"] = tuple(_undetermined(**direction) for direction in found["undetermined"])
    found["combinations"] = tuple(Combination(**known) for known in found["combinations"])
    found["bodies"] = Bodies(**{**found["bodies"], "moved": tuple(found["bodies"]["moved"])}) if found["bodies"] else None
    found["residuals"] = {residual["coordinate"]: Residual(**residual) for residual in found["residuals"]}
    if found["by_trajectory"]:
        found["by_trajectory"] = _by_trajectory(**found["by_trajectory"])
    found["force_noise"] = tuple(found["force_noise"])
    found["outliers"] = tuple(Outlier(**outlier) for outlier in found["outliers"])
    return Identified(**found, _form=system)


def _by_trajectory(trajectories: list[dict[str, Any]], scatter: list[dict[str, Any]]) -> ByTrajectory:
    def alone(constants: list[dict[str, Any]], **more: Any) -> OfTrajectory:
        return OfTrajectory(constants={constant["symbol"]: IdentifiedConstant(**constant) for constant in constants}, **more)

    return ByTrajectory(tuple(alone(**one) for one in trajectories), tuple(Scatter(**one) for one in scatter))


def _undetermined(constants: list[str], directions: object, known: list[dict[str, Any]], **more: Any) -> Undetermined:
    combinations = {one["name"]: Combination(**one) for one in known}
    return Undetermined(tuple(constants), np.array(directions, float).reshape(-1, len(constants)), combinations, **more)


def formula_choices(
    basis: str | None,
    functions: Sequence[str],
    gyroscopic: bool,
    friction: bool,
    noise: Sequence[float] | None,
    scale: tuple[str, float] | None,
    bootstraps: int,
    seed: int,
    threads: int | None,
    name: str,
    between: str | None = None,
    drive: bool = True,
) -> str:
    """Choices of a search as the library takes them."""
    given: dict[str, object] = {"basis": basis, "functions": names("functions", functions), "gyroscopic": bool(gyroscopic)}
    given |= {"friction": bool(friction), "drive": bool(drive), "noise": noise, "scale": scale, "bootstraps": whole("bootstraps", bootstraps, 1, 10_000)}
    return as_json(given | {"seed": whole("seed", seed), "threads": thread_count(threads), "name": str(name), "between": between})


def read_formula(text: str) -> Formula:
    """The formula that the library found."""
    found = read_result(text)
    number = lambda x: np.nan if x is None else x
    terms = found["terms"]
    column = lambda key: np.array([number(term[key]) for term in terms], float)
    return Formula(
        verdict=found["verdict"],
        lagrangian=found["lagrangian"],
        dissipation=found.get("dissipation", "0"),
        terms=tuple(term["term"] for term in terms),
        coefficients=column("coefficient"),
        standard_errors=column("standard_error"),
        probabilities=column("probability"),
        dissipative=np.array([term["dissipation"] for term in terms], bool),
        near=tuple(term["near"] for term in terms),
        drive=None if found["drive"] is None else PeriodicDrive(**found["drive"]),
        residual=number(found["residual"]),
        noise=np.array(found["noise"], float),
        noise_resolved=found["noise_resolved"],
        several=found["several"],
        rival=None if found["rival"] is None else (tuple(found["rival"]["terms"]), found["rival"]["cost"]),
        blocks=tuple(map(tuple, found["blocks"])),
        basis=found["basis"],
        tried=tuple(found["tried"]),
        doubts=tuple(found["doubts"]),
        notes=tuple(found["notes"]),
        left=tuple((found["coordinates"][part.pop("coordinate")], *part.values()) for part in found["left"]),
        searched=found["searched"],
        removed=found["removed"],
        coordinates=tuple(found["coordinates"]),
        toml=found["toml"],
        rust=found["rust"],
        _latex=tuple(found["latex"]),
        _text=found["_text"],
        _html=found["_html"],
    )

"""Systems and models."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from . import _lnn
from ._arrays import as_json, bounds_of, doubles, doubles_list, names, read_result, real, states, thread_count, whole
from ._results import Certificate, Event, Formula, Geometry, InverseDynamics, Linearization, OwnConstraints, Surface, Symmetries, Trajectory
from .reader import files
from .reader.functions import DescribedModel, Functions, Terms
from .reader.model_file import ModelFile

if TYPE_CHECKING:
    import torch

    from ._arrays import Numbers
    from ._progress import Progress

    Drive = Numbers | tuple[Numbers, Numbers] | Callable[[float, np.ndarray, np.ndarray], Numbers]
    Inputs = Numbers | tuple[Numbers, Numbers] | Callable[[float], Numbers]

TENSORS = {"metric": 2, "inverse": 2, "christoffel": 3, "riemann": 4, "ricci": 2, "einstein": 2, "weyl": 4}


def _event(name: str, t: float, q: np.ndarray, v: np.ndarray, impact: tuple[np.ndarray, float, float] | None) -> Event:
    """What happened, with what an impact changed."""
    return Event(name, t, q, v, *(impact or ()))


def _times(t: Numbers | None, shape: tuple[int, ...]) -> np.ndarray | None:
    """Times of states, one for each or one for all of them, ``(b,)``."""
    if t is None:
        return None
    given = doubles("t", t)
    try:
        return np.ascontiguousarray(np.broadcast_to(given, shape).reshape(-1))
    except ValueError:
        raise ValueError(f"t: expected an array {shape}, one time for each state, found the shape {given.shape}") from None


class Mechanics:
    """What systems and models have in common: a Lagrangian, its terms, its motion, its geometry."""

    def __init__(self, subject: _lnn.Subject) -> None:
        self._subject = subject
        self._facts: dict[str, Any] = json.loads(subject.facts())
        self._n = len(self._facts["columns"]) // 2

    @property
    def name(self) -> str:
        """Name of the system."""
        return self._facts["name"]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the coordinates, then of the velocities."""
        return tuple(self._facts["columns"])

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return self.columns[: self._n]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the measured quantities on which the forces of a system depend."""
        return tuple(self._facts.get("inputs", ()))

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of what the sensors of a system read in place of its coordinates: the table ``[measured]`` of its file."""
        return tuple(own["name"] for own in self._facts.get("measured", ()))

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of the coordinates that are angles in rad."""
        return tuple(name for name, angle in zip(self.coordinates, self._facts["periodic"]) if angle)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of the states of interest by column: those that a model learned from, or that a system is judged by."""
        return dict(zip(self.columns, map(tuple, self._facts["position"] + self._facts["velocity"])))

    def terms(self, q: Numbers, v: Numbers, *, t: Numbers | None = None, threads: int = 1) -> Terms:
        """All terms of states.

        Parameters
        ----------
        q, v : array_like (..., n)
            Coordinates and velocities in SI units and rad.
        t : array_like (...), optional
            Times in s, which only a system that depends on the time needs.
        threads : int
            Threads; results do not depend on them.

        Returns
        -------
        Terms
            L ``(...)``, p ``(..., n)``, dL/dq, M ``(..., n, n)``, c, -dD/dv, a, E. Where a mass matrix is singular or a number is not
            finite, accelerations are NaN and `Terms.failures` says why.
        """
        n = self._n
        q, v, shape = states(q, v, n)
        found, failures = self._subject.terms(q, v, _times(t, shape), threads if threads == 1 else thread_count(threads))
        vector, matrix = (*shape, n), (*shape, n, n)
        lagrangian, momentum, dl_dq, mass_matrix, coriolis, acceleration, energy, *friction = found
        return Terms(
            lagrangian.reshape(shape),
            momentum.reshape(vector),
            dl_dq.reshape(vector),
            mass_matrix.reshape(matrix),
            coriolis.reshape(vector),
            friction[0].reshape(vector) if friction else np.zeros(vector),
            acceleration.reshape(vector),
            energy.reshape(shape),
            tuple(failures),
        )

    def _term(
        self, name: str, width: tuple[int, ...], q: Numbers, v: Numbers, t: Numbers | None, threads: int
    ) -> np.ndarray:
        q, v, shape = states(q, v, self._n)
        threads = threads if threads == 1 else thread_count(threads)
        return self._subject.term(name, q, v, _times(t, shape), threads).reshape(shape + width)

    def lagrangian(self, q: Numbers, v: Numbers, *, t: Numbers | None = None, threads: int = 1) -> np.ndarray:
        """L, ``(...)``, of states ``(..., n)``."""
        return self._term("lagrangian", (), q, v, t, threads)

    def momentum(self, q: Numbers, v: Numbers, *, t: Numbers | None = None, threads: int = 1) -> np.ndarray:
        """p = dL/dv, ``(..., n)``."""
        return self._term("momentum", (self._n,), q, v, t, threads)

    def mass_matrix(self, q: Numbers, v: Numbers, *, t: Numbers | None = None, threads: int = 1) -> np.ndarray:
        """M = d2L/dv2, ``(..., n, n)``."""
        return self._term("mass_matrix", (self._n, self._n), q, v, t, threads)

    def acceleration(
        self,
        q: Numbers,
        v: Numbers,
        *,
        t: Numbers | None = None,
        force: Numbers | None = None,
        friction: bool = True,
        threads: int = 1,
    ) -> np.ndarray:
        """a, ``(..., n)``, NaN where it is not determined: ``M a = dL/dq - c - dD/dv + force``.

        Parameters
        ----------
        q, v : array_like (..., n)
            Coordinates and velocities in SI units and rad.
        t : array_like (...), optional
            Times in s, which only a system that depends on the time needs.
        force : array_like (..., n), optional
            Generalized forces from outside, such as torques of motors; none by default.
        friction : bool
            Whether its own friction acts, ``-dD/dv``.
        """
        q, v, shape = states(q, v, self._n)
        threads = threads if threads == 1 else thread_count(threads)
        given = None if force is None else self._forces(force, shape)
        found = self._subject.term("acceleration", q, v, _times(t, shape), threads, given, bool(friction))
        return found.reshape(*shape, self._n)

    def _forces(self, force: Numbers, shape: tuple[int, ...], n: int | None = None, what: str = "force") -> np.ndarray:
        """Forces on states, one for each or one for all of them, ``(b, n)``."""
        given, n = doubles(what, force), self._n if n is None else n
        try:
            return np.ascontiguousarray(np.broadcast_to(given, (*shape, n)).reshape(-1, n))
        except ValueError:
            raise ValueError(f"{what}: expected an array (..., {n}) for states {shape}, found the shape {given.shape}") from None

    def inverse_dynamics(self, q: Numbers, v: Numbers, a: Numbers, *, t: Numbers | None = None) -> InverseDynamics:
        """Forces that give states their accelerations: the torques that an arm's motors need, or a controller sends ahead.

        Parameters
        ----------
        q, v, a : array_like (..., n)
            Coordinates, velocities and accelerations in SI units and rad.
        t : array_like (...), optional
            Times in s, which only a system that depends on the time needs.

        Returns
        -------
        InverseDynamics
            ``external`` is the force from outside, ``M a + c - dL/dq + dD/dv``, and its parts are beside it:
            ``acceleration(q, v, force=external)`` is `a` again.

        Raises
        ------
        ValueError
            If a force is not finite, or constraints do not allow an acceleration.
        """
        n = self._n
        q, v, shape = states(q, v, n)
        given = doubles("a", a)
        if given.shape[-1:] != (n,) and not given.shape == shape == ():
            raise ValueError(f"a: expected an array (..., {n}), found the shape {given.shape}")
        accelerations = np.ascontiguousarray(np.broadcast_to(given, (*shape, n)).reshape(-1, n))
        found = _lnn.inverse_dynamics(self._subject, q, v, accelerations, _times(t, shape))
        every = len(q) or 1
        parts = [numbers.reshape(*shape, len(numbers) // every) for numbers in found]
        return InverseDynamics(*(part if part.shape[-1] or k == 4 else np.zeros((*shape, n)) for k, part in enumerate(parts)))

    def linearize(self, q: Numbers, v: Numbers, *, force: Numbers | None = None, friction: bool = True) -> Linearization:
        """Accelerations and their derivatives, exact, friction and constraints included.

        Parameters
        ----------
        q, v : array_like (..., n)
            Coordinates and velocities in SI units and rad.
        force : array_like (..., n), optional
            Generalized forces from outside, such as torques of motors; none by default.
        friction : bool
            Whether its own friction acts; derivatives without it are differences of the fourth order, good to about 1e-12.

        Returns
        -------
        Linearization
            a ``(..., n)``, and ``da/dq``, ``da/dv``, ``da/dF`` ``(..., n, n)``, a row for each acceleration.

        Raises
        ------
        ValueError
            If an acceleration is not determined.
        """
        n = self._n
        q, v, shape = states(q, v, n)
        forces = None if force is None else self._forces(force, shape)
        acceleration, *matrices = self._subject.linearize(q, v, forces, bool(friction))
        by_q, by_v, by_force = (matrix.reshape(*shape, n, n) for matrix in matrices)
        return Linearization(acceleration.reshape(*shape, n), by_q, by_v, by_force)

    def energy(self, q: Numbers, v: Numbers, *, t: Numbers | None = None, threads: int = 1) -> np.ndarray:
        """E = v.p - L, ``(...)``."""
        return self._term("energy", (), q, v, t, threads)

    def rollout(
        self,
        q: Numbers,
        v: Numbers,
        t_end: float,
        dt: float,
        *,
        t0: float = 0.0,
        method: str = "dopri5",
        rtol: float = 1e-6,
        atol: float = 1e-8,
        step: float | None = None,
        bounded: bool = True,
        force: Drive | None = None,
        between: str | None = None,
        friction: bool = True,
        inputs: Inputs | None = None,
        threads: int | None = None,
    ) -> Trajectory:
        """Motion from one start, or from a batch of them.

        Parameters
        ----------
        q, v : array_like (..., n)
            Starts.
        t_end, dt : float
            Time of the last sample, and between samples; a time before `t0` runs backwards.
        method : str
            ``"dopri5"`` or ``"dop853"`` with error control by `rtol` and `atol`; ``"midpoint"``, ``"gauss4"``, ``"gauss6"`` or
            ``"variational"``, symplectic, with fixed steps of at most `step`.
        bounded : bool
            Whether a motion ends where it leaves the states that a model learned from.
        force : array_like (..., n), pair of array_like, or callable, optional
            Generalized forces from outside, such as torques of motors: constants, of every start or of all of them; times ``(m,)`` with
            values ``(..., m, n)``, which cover the motion; or a function of t, q ``(n,)`` and v ``(n,)`` that returns them, ``(n,)``.
        between : str, optional
            Values of forces between their times: ``"held"``, ``"linear"``, the default, ``"cubic"`` or ``"band-limited"``.
        friction : bool
            Whether its own friction acts.
        inputs : array_like (k,), pair of array_like, or callable, optional
            The `inputs` of a system, in their order: constants, times ``(m,)`` with values ``(m, k)``, or a function of t that returns
            them, ``(k,)``.
        """
        n = self._n
        starts, velocities, shape = states(q, v, n)
        times = real("t0", t0), real("t_end", t_end), real("dt", dt, positive=True)
        accuracy = real("rtol", rtol), real("atol", atol), None if step is None else real("step", step, positive=True)
        acting = bool(bounded), bool(friction)
        if self.inputs and inputs is None:
            raise ValueError(f"inputs: expected values of {', '.join(self.inputs)}")
        if inputs is not None and not self.inputs:
            raise ValueError(f"inputs: {self.name} has none")
        forces = self._driving("force", force, between if force is not None or inputs is None else None, (n, shape))
        known = self._driving("inputs", inputs, between if force is None else None, (len(self.inputs), ()))
        found = self._subject.rollout(starts, velocities, times, method, accuracy, acting, forces, known, thread_count(threads))
        # The longest motion has all times that any has.
        t = max((motion[0] for motion in found), key=len, default=np.empty(0))
        parts = [np.full((len(found), len(t), n), np.nan) for _ in range(2)] + [np.full((len(found), len(t)), np.nan)]
        for k, (_, *motion, _, _, _) in enumerate(found):
            for part, numbers in zip(parts, motion):
                rows = numbers.reshape(-1, *part.shape[2:])
                part[k, : len(rows)] = rows
        along = [part.reshape(shape + part.shape[1:]) for part in parts]
        stop = found[0][4] if shape == () else np.array([motion[4] for motion in found], dtype=object).reshape(shape)
        happened = np.empty(len(found), dtype=object)
        happened[:] = [tuple(_event(*event) for event in motion[6]) for motion in found]
        events = happened[0] if shape == () else happened.reshape(shape)
        return Trajectory(t, along[0], along[1], along[2], stop, self.columns, events)

    def _driving(
        self, what: str, force: Drive | Inputs | None, between: str | None, size: tuple[int, tuple[int, ...]]
    ) -> _lnn._Driving:
        """Forces or inputs that drive motions as the library takes them: samples, or a function."""
        (n, shape), pair = size, None
        if isinstance(force, tuple) and len(force) == 2:
            times, values = (doubles(what, part) for part in force)
            if times.ndim == 1 and (values.ndim > 1 or n == 1 < len(times)):
                pair = times, values[:, None] if values.ndim == 1 else values
        if between is not None and pair is None:
            raise ValueError(f"between: expected {what} at times, (times, values)")
        if force is None:
            return None, None
        if callable(force):
            function = cast("Callable[..., Numbers]", force)

            def call(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
                found = doubles(what, function(t, q, v) if what == "force" else function(t))
                if found.size != n:
                    raise ValueError(f"{what}: expected {n} numbers, found the shape {found.shape}")
                return np.ascontiguousarray(found.reshape(n))

            return None, call
        if pair is None:
            return ([0.0], [row.tolist() for row in self._forces(cast("Numbers", force), shape, n, what)], None), None
        times, values = pair
        if values.shape[-2:] != (len(times), n):
            raise ValueError(f"{what}: expected values (..., {len(times)}, {n}) at {len(times)} times, found the shape {values.shape}")
        if values.ndim > 2:
            values = np.broadcast_to(values, (*shape, len(times), n))
        return (times.tolist(), values.reshape(-1, len(times) * n).tolist(), between), None

    def geometry(self, q: Numbers, *, velocity: Numbers | None = None) -> Geometry:
        """Metric, connection and curvature at points.

        Parameters
        ----------
        q : array_like (..., n)
            Points.
        velocity : array_like (n,), optional
            Where the mass matrix of a Lagrangian that is more than quadratic in the velocities is taken; zeros by default.
        """
        n = self._n
        points, _, shape = states(q, q, n)
        velocity = [0.0] * n if velocity is None else doubles_list("velocity", velocity)
        numbers, signatures, failures = self._subject.geometry(points, velocity)
        width = lambda name: (n,) * TENSORS.get(name, 0)
        fields: dict[str, Any] = {name: x.reshape(shape + width(name)) for name, x in numbers.items()}
        return Geometry(**fields, signature=signatures.reshape(*shape, 2), failures=tuple(failures))

    def surfaces(
        self,
        block: Sequence[str],
        start: Numbers,
        end: Numbers,
        *,
        velocity: Numbers | None = None,
        steps: int = 200,
    ) -> tuple[Surface, ...]:
        """Where the determinant of a block of the metric changes its sign on a line: ergosurfaces, horizons, changes of signature.

        Parameters
        ----------
        block : sequence of str
            Coordinates of the block: the time for an ergosurface, time and the angle of a symmetry axis for a horizon.
        start, end : array_like (n,)
            Ends of the line.
        velocity : array_like (n,), optional
            Where the mass matrix is taken, as of `geometry`.
        steps : int
            Pieces into which the line is cut.
        """
        places = []
        for name in names("block", block):
            if name not in self.coordinates:
                raise ValueError(f"block: no coordinate {name!r} among {list(self.coordinates)}")
            places.append(self.coordinates.index(name))
        if len(set(places)) < len(places):
            raise ValueError(f"block: expected different coordinates, found {list(block)}")
        ends = doubles_list("start", start), doubles_list("end", end)
        velocity = [0.0] * self._n if velocity is None else doubles_list("velocity", velocity)
        found = _lnn.surfaces(self._subject, places, ends, velocity, whole("steps", steps, 1, 1_000_000))
        return tuple(Surface(dict(zip(self.coordinates, point)), change) for point, change in found)

    def symmetries(
        self,
        *,
        region: Mapping[str, tuple[float, float]] | None = None,
        basis: str | None = None,
        points: int | None = None,
        seed: int = 0,
        tolerance: float | None = None,
    ) -> Symmetries:
        """Point symmetries: what the Lagrangian conserves.

        Parameters
        ----------
        region : dict of str to (low, high), optional
            Bounds of the states that are looked at, by column.
        basis : str, optional
            Functions that fields are made of, such as ``"polynomial:2,trigonometric:1"``.
        """
        points = None if points is None else whole("points", points, 1)
        tolerance = None if tolerance is None else real("tolerance", tolerance, positive=True)
        fields = read_result(self._subject.symmetries(bounds_of(region), basis, points, whole("seed", seed), tolerance))
        for name in "structure_constants", "singular_values":
            fields[name] = np.array(fields[name], float)
        return Symmetries(**fields)

    def constraints(self, *, seed: int = 0) -> OwnConstraints:
        """The constraints, and the directions that no equation moves.

        Parameters
        ----------
        seed : int
            Of the states at which the mass matrix is looked at.
        """
        found = read_result(self._subject.constraints(whole("seed", seed)))
        of = lambda key: {constraint["name"]: constraint[key] for constraint in found["constraints"]}
        return OwnConstraints(
            formulas=of("formula"),
            kinds=of("kind"),
            redundant=tuple(found["redundant"]),
            null_directions=np.array(found["null_directions"], float).reshape(-1, self._n),
            signature=found["signature"] and tuple(found["signature"]),
            states=found["states"],
            open_states=found["open_states"],
            _text=found["_text"],
            _html=found["_html"],
        )

    def formula(
        self,
        *,
        friction: bool = False,
        basis: str | None = None,
        functions: Sequence[str] = (),
        gyroscopic: bool = True,
        scale: tuple[str, float] | None = None,
        seed: int = 0,
        threads: int | None = None,
        name: str = "formula",
    ) -> Formula:
        """The Lagrangian as a formula; arguments are those of `lnn.formula`."""
        from ._readings import formula_choices, read_formula

        # A model is asked, not resampled.
        choices = formula_choices(basis, functions, gyroscopic, friction, None, scale, 1, seed, threads, name)
        return read_formula(self._subject.formula(choices))

    def certify(
        self,
        *,
        region: Mapping[str, tuple[float, float]] | None = None,
        signature: tuple[int, int] | None = None,
        condition: float | None = None,
        seconds: float = 10.0,
        boxes: int = 10_000_000,
        threads: int | None = None,
    ) -> Certificate:
        """Where in a region the mass matrix is proven to have its signature.

        Parameters
        ----------
        region : dict of str to (low, high), optional
            Bounds by column; those of the states that a model learned from, all of one turn of an angle, by default.
        signature : (int, int), optional
            Positive and negative eigenvalues; all positive but one for a time by default.
        condition : float, optional
            Largest condition number that is allowed.
        seconds, boxes
            Where the search ends.
        """
        if signature is not None:
            positive, negative = signature
            signature = whole("signature", positive), whole("signature", negative)
        condition = None if condition is None else real("condition", condition, positive=True)
        limits = real("seconds", seconds, positive=True), whole("boxes", boxes, 1), thread_count(threads)
        fields = read_result(self._subject.certify(bounds_of(region), signature, condition, *limits))
        fields["limit"], fields["condition"] = fields["condition"], fields.pop("condition_bound")
        return Certificate(**{**fields, "signature": tuple(fields["signature"])})


class System(Mechanics):
    """A system whose Lagrangian is written down.

    Parameters
    ----------
    name : str, optional
        A system of the catalogue, see `systems`; with `lagrangian` or `metric` the name of the new one.
    lagrangian : str, optional
        L as a formula of coordinates ``x``, velocities ``x_dot``, parameters and definitions.
    coordinates : sequence of str, or dict of str to dict
        Names; or names with ``bounds``, ``velocity_bounds``, ``periodic``, ``unit``, ``time_like``. Bounds are (-1, 1) where none are given.
    parameters : dict
        Values, or dicts of ``default``, ``unit``, ``range``, ``learn``.
    **more
        Values of the parameters of a system of the catalogue; other keys of a system file, such as ``definitions``, ``constraints`` or
        ``metric``.

    Examples
    --------
    >>> System("double-pendulum", m2=0.5).mass_matrix([0.0, 0.0], [0.0, 0.0]).tolist()
    [[1.5, 0.5], [0.5, 0.5]]
    >>> spring = System(lagrangian="m*x_dot^2/2 - k*x^2/2", coordinates=["x"], parameters={"m": 1, "k": 4})
    >>> spring.acceleration([0.5], [0.0]).tolist()
    [-2.0]
    """

    def __init__(
        self,
        name: str | None = None,
        *,
        lagrangian: str | None = None,
        coordinates: Sequence[str] | Mapping[str, Mapping] | None = None,
        parameters: Mapping[str, object] | None = None,
        **more: object,
    ) -> None:
        if lagrangian is None and "metric" not in more:
            if name is None or coordinates is not None:
                raise TypeError("expected the name of a system, or a `lagrangian` or `metric` with its `coordinates`")
            given = _texts({**(parameters or {}), **more})
            super().__init__(_lnn.Subject.system(name, given))
            self._made: tuple = ("system", name, given)
            return
        if coordinates is None:
            raise TypeError("expected the names of the coordinates")
        if not isinstance(coordinates, Mapping):
            coordinates = {name: {} for name in coordinates}
        description: dict[str, object] = {"name": name or "own"}
        if lagrangian is not None:
            description["lagrangian"] = lagrangian
        described: list[dict[str, object]] = []
        for coordinate, keys in coordinates.items():
            whole = {"name": coordinate, **keys}
            for key in ["velocity_bounds"] if whole.get("periodic") else ["bounds", "velocity_bounds"]:
                whole.setdefault(key, [-1.0, 1.0])
            whole = {key: list(x) if isinstance(x, tuple) else x for key, x in whole.items() if x is not None}
            described.append(whole)
        self._describe(as_json({**description, "coordinates": described, "parameters": dict(parameters or {}), **more}), True, [])

    def _describe(self, text: str, is_json: bool, given: list) -> None:
        Mechanics.__init__(self, _lnn.Subject.described(text, is_json, given))
        self._made = ("described", text, is_json, given)

    @classmethod
    def from_toml(cls, text: str, **parameters: object) -> System:
        """A system by the text of its file, or by the file's path."""
        system = cls.__new__(cls)
        system._describe(files.text(text, ".toml"), False, _texts(parameters))
        return system

    @classmethod
    def from_robot(cls, text: str, **parameters: object) -> System:
        """A robot by the text of its URDF or MJCF file, or by the file's path. Warns of elements that say something of motion and are not read."""
        description, notes = _lnn.read_robot(files.text(text, ".urdf", ".xml"))
        for note in notes:
            warnings.warn(note, stacklevel=2)
        system = cls.__new__(cls)
        system._describe(description, True, _texts(parameters))
        return system

    def __reduce__(self) -> tuple[object, ...]:
        return _system, self._made

    def __repr__(self) -> str:
        values = "".join(f", {name}={value:g}" for name, value in self.parameters.items())
        return f"System({self.name!r}{values})"

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters."""
        return dict(self._facts["parameters"])

    @property
    def description(self) -> dict | None:
        """What the system's file says; None for one of the catalogue."""
        return self._facts["description"]

    def with_parameters(self, **parameters: object) -> System:
        """The same system with other values of some of its parameters."""
        kind, *text, given = self._made
        return _system(kind, *text, list({**dict(given), **dict(_texts(parameters))}.items()))

    def _functions(self, xp: Any, kind: type[Functions]) -> Functions:
        from .reader.constraints import Constraints
        from .reader.formula import Described

        if self.description is None:
            raise ValueError("only a system with a formula of its own is a function of other libraries")
        header = {"columns": list(self.columns), "parameters": self.parameters, "description": self.description}
        model = DescribedModel(Described(self.description), self.parameters)
        return kind(xp, model, {}, Constraints(header))

    def to_numpy(self) -> Functions:
        """The formula as functions of NumPy arrays."""
        from .reader.functions import NUMPY, NumpyFunctions

        return self._functions(NUMPY, NumpyFunctions)

    def to_jax(self) -> Functions:
        """The formula as functions of JAX arrays."""
        from .reader.jax_functions import JAX, Differentiated

        return self._functions(JAX, Differentiated)

    def to_torch(self, dtype: torch.dtype | None = None) -> Functions:
        """The formula as functions of PyTorch tensors."""
        import torch

        from .reader.torch_functions import Differentiated, backend

        return self._functions(backend(dtype or torch.float64), Differentiated)


def _system(kind: str, *made: Any) -> System:
    """A pickled system."""
    if kind == "system":
        return System(made[0], **dict(made[1]))
    system = System.__new__(System)
    system._describe(*made)
    return system


def _texts(parameters: Mapping[str, object]) -> list[tuple[str, str]]:
    return [(name, x if isinstance(x, str) else repr(_plain(name, x))) for name, x in parameters.items()]


def _plain(name: str, x: Any) -> int | float:
    try:
        return int(x) if int(x) == x else float(x)
    except (TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"{name}: expected a number, found {x!r}") from error


def systems() -> dict[str, dict]:
    """The systems of the catalogue by name: title, columns, units, parameters, bounds."""
    return {system["name"]: system for system in json.loads(_lnn.systems())}


class Model(Mechanics):
    """A learned Lagrangian."""

    @classmethod
    def load(cls, path: str | os.PathLike) -> Model:
        """Reads a model file, or that of the directory of a run."""
        path = Path(path)
        return cls.from_bytes(files.read(path / "model.safetensors" if path.is_dir() else path))

    @classmethod
    def from_bytes(cls, data: bytes) -> Model:
        """A model from the bytes of its file."""
        return cls(_lnn.Subject.model(data))

    def to_bytes(self) -> bytes:
        """The bytes of the file."""
        return self._subject.to_bytes()

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Writes the file that the program and `load` read; one that is there already is kept unless `overwrite` is set."""
        files.write(path, self.to_bytes(), overwrite)

    def __reduce__(self) -> tuple[object, ...]:
        return Model.from_bytes, (self.to_bytes(),)

    def __repr__(self) -> str:
        net = self.header["architecture"]
        structure = net.get("form", {}).get("structure", "black-box")
        return f"Model({self.name!r}, {structure}, coordinates {list(self.coordinates)}, hidden {net['hidden']})"

    @property
    def header(self) -> dict:
        """Everything but the weights, by the keys of the model format."""
        return self._facts["header"]

    @property
    def file(self) -> ModelFile:
        """Header and tensors."""
        return ModelFile.from_bytes(self.to_bytes())

    @property
    def constants(self) -> dict[str, float]:
        """Values of the constants of the known part, those that were learned included; empty without a known part."""
        from .reader.formula import Described
        from .reader.functions import NUMPY

        known = self.header["architecture"].get("form", {}).get("known")
        if known is None:
            return {}
        learned = self.file.tensors.get("known", np.empty(0)).astype(float)
        return {name: float(x) for name, x in Described(known).constants(NUMPY, learned).items()}

    def to_numpy(self) -> Functions:
        """The model as functions of NumPy arrays, without compiled code."""
        return self.file.to_numpy()

    def to_jax(self) -> Functions:
        """The model as functions of JAX arrays; see `ModelFile.to_jax`."""
        return self.file.to_jax()

    def to_torch(self, dtype: torch.dtype | None = None) -> Functions:
        """The model as functions of PyTorch tensors; see `ModelFile.to_torch`."""
        return self.file.to_torch(dtype)

    def page(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Writes an interactive page: one HTML file that computes the motion, the exact one beside if it is known.

        A file that is there already is kept unless `overwrite` is set.
        """
        files.write(path, self._subject.page().encode(), overwrite)

    def evaluate(
        self,
        system: System | None = None,
        *,
        starts: int = 4,
        seed: int = 0,
        threads: int | None = None,
        progress: Progress = None,
    ) -> dict:
        """The model beside the exact system: errors of accelerations, mass matrix and motion, and what is read off both.

        Parameters
        ----------
        system : System, optional
            The system to compare with; the one that the model learned by default.
        starts : int
            Motions that are compared.
        """
        from ._progress import receiver

        exact = None if system is None else system._subject
        plan = whole("starts", starts, 1), whole("seed", seed), thread_count(threads)
        return json.loads(self._subject.evaluate(exact, plan, receiver(progress)))

"""Results: dataclasses with arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    import sympy
    import xarray as xr
    from matplotlib.axes import Axes

    from ._mechanics import Model, System


def _axes(ax: Axes | None) -> Axes:
    """The axes that are given, or new ones."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots()[1]


class _Shown:
    """A result that prints as the program prints it, and as tables in a notebook."""

    _text: str
    _html: str

    def __str__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return self._html


@dataclass(frozen=True)
class Linearization:
    """Accelerations and their derivatives, a row for each acceleration.

    Attributes
    ----------
    acceleration : (..., n)
        a.
    by_q, by_v : (..., n, n)
        da/dq and da/dv.
    by_force : (..., n, n)
        da/dF by a generalized force; the inverse of the mass matrix where there are no constraints.
    """

    acceleration: np.ndarray
    by_q: np.ndarray
    by_v: np.ndarray
    by_force: np.ndarray


@dataclass(frozen=True)
class InverseDynamics:
    """Generalized forces that make a known motion, ``(..., n)`` each: N for a length, N m for an angle.

    ``generalized = friction + external + constraint``, and ``external + constraint = inertial + coriolis + gravity - friction``.

    Attributes
    ----------
    generalized
        All force beside that of L, ``M a + c - dL/dq``.
    friction
        Force of its own friction, ``-dD/dv``: negative where the velocity is positive.
    external
        Force from outside, such as the torques of motors; under constraints the smallest that makes the motion.
    constraint
        Force of the constraints under it.
    multipliers : (..., m)
        Multipliers of the constraints.
    inertial, coriolis, gravity
        ``M a``, what the velocities add to it, and what holds the state where it is, against gravity and springs.
    """

    generalized: np.ndarray
    friction: np.ndarray
    external: np.ndarray
    constraint: np.ndarray
    multipliers: np.ndarray
    inertial: np.ndarray
    coriolis: np.ndarray
    gravity: np.ndarray


@dataclass(frozen=True)
class Event:
    """An event of the system that happened along a motion.

    Attributes
    ----------
    name : str
        Its name in the table ``events`` of the system.
    t : float
        Its time.
    q, v : (n,)
        Coordinates and velocities there; velocities after an impact.
    v_before : (n,), or None
        Velocities before an impact.
    energy_before, energy_after : float, or None
        E before and after an impact, in the unit of the Lagrangian.
    """

    name: str
    t: float
    q: np.ndarray
    v: np.ndarray
    v_before: np.ndarray | None = None
    energy_before: float | None = None
    energy_after: float | None = None


@dataclass(frozen=True)
class Trajectory:
    """Motion at ``t``, of one start or of a batch of them.

    Attributes
    ----------
    t : (m,)
        Times of the samples.
    q, v : (..., m, n)
        Coordinates and velocities; angles are not wrapped. NaN behind the end of a motion that stopped early.
    energy : (..., m)
        E at the samples, in the unit of the Lagrangian.
    stop : None, str, or an array of them
        Why a motion ended early, of every start.
    columns : tuple of str
        Names of the coordinates, then of the velocities.
    events : tuple of Event, or an array of them
        What happened of the events of the system, in the order of time, of every start.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    energy: np.ndarray
    stop: str | None | np.ndarray
    columns: tuple[str, ...]
    events: tuple[Event, ...] | np.ndarray = ()

    @property
    def complete(self) -> bool:
        """Whether every motion reached its end."""
        return all(stop is None for stop in np.asarray(self.stop, dtype=object).ravel())

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame of the samples of one motion, or of a batch under an index ``start``."""
        import pandas as pd

        n, m = self.q.shape[-1], len(self.t)
        state = np.concatenate([self.q, self.v, self.energy[..., None]], -1)
        names = [*self.columns, "energy"]
        if state.ndim == 2:
            return pd.DataFrame(state, pd.Index(self.t, name="t"), names)
        rows = state.reshape(-1, 2 * n + 1)
        index = pd.MultiIndex.from_product([range(len(rows) // m), self.t], names=["start", "t"])
        return pd.DataFrame(rows, index, names)

    def to_xarray(self) -> xr.Dataset:
        """A Dataset with the dimensions ``t`` and, of a batch, ``start``."""
        import xarray as xr

        n, m = self.q.shape[-1], len(self.t)
        state = np.concatenate([self.q, self.v, self.energy[..., None]], -1)
        dims = ["t"] if state.ndim == 2 else ["start", "t"]
        state = state if state.ndim == 2 else state.reshape(-1, m, 2 * n + 1)
        names = [*self.columns, "energy"]
        return xr.Dataset({name: (dims, state[..., k]) for k, name in enumerate(names)}, {"t": self.t})

    def plot(self, column: str | None = None, *, ax: Axes | None = None, **style: Any) -> Axes:
        """Draws one column over time, ``"energy"`` or by default the first coordinate, into `ax` or new axes of matplotlib, and returns these.

        `style` goes to ``Axes.plot``.
        """
        column = column or self.columns[0]
        names = [*self.columns, "energy"]
        if column not in names:
            raise ValueError(f"expected one of the columns {names}, found {column!r}")
        state = np.concatenate([self.q, self.v, self.energy[..., None]], -1)[..., names.index(column)]
        ax = _axes(ax)
        ax.plot(self.t, state.reshape(-1, len(self.t)).T, **style)
        ax.set(xlabel="t", ylabel=column)
        return ax


@dataclass(frozen=True)
class Geometry:
    """Metric, connection and curvature at points, conventions of Misner, Thorne and Wheeler; NaN where there are none.

    Attributes
    ----------
    metric, inverse : (..., n, n)
    determinant, scalar, kretschmann : (...)
        Of the metric; R; R_abcd R^abcd.
    signature : (..., 2)
        Numbers of positive and negative eigenvalues.
    christoffel : (..., n, n, n)
        G^k_ij as [k, i, j].
    riemann, weyl : (..., n, n, n, n)
        R^a_bcd and the Weyl tensor.
    ricci, einstein : (..., n, n)
    failures : tuple of (int, str)
        Points, counted over the batch, without geometry, and why.
    """

    metric: np.ndarray
    inverse: np.ndarray
    determinant: np.ndarray
    signature: np.ndarray
    christoffel: np.ndarray
    riemann: np.ndarray
    ricci: np.ndarray
    einstein: np.ndarray
    weyl: np.ndarray
    scalar: np.ndarray
    kretschmann: np.ndarray
    failures: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True)
class Symmetries(_Shown):
    """Point symmetries found in a Lagrangian.

    Attributes
    ----------
    count : int or None
        Their number; None if there is no gap between singular values.
    gap : float or None
        The first singular value that is not zero over the last that is.
    name : str or None
        Of the Lie algebra.
    fields, gauge_functions : list of str
        Every vector field as a formula, and the function by whose rate it changes L.
    structure_constants : (k, k, k)
    time_translation : bool
        Whether what `invariant` names is conserved.
    singular_values : (unknowns,)
    basis : str
        Highest degrees of the functions that fields are made of.
    system : str
    functions, seed : int
        Functions of the basis, and the seed of the states.
    points, singular_states : int
        States that were looked at, and those among them at which the mass matrix is singular.
    killing_form_signature : (int, int, int) or None
        Negative, positive and zero eigenvalues of the Killing form.
    closure, closes : float or None, bool or None
        Relative remainder of the commutators outside the span of the fields, and whether it is zero to rounding, so that the fields form an algebra.
    conserved : list of bool
        Of every field, whether its charge is conserved: friction may change it.
    invariant : str
        What is conserved because L does not depend on time: ``"energy"``, ``"g(v, v)"``, ``"p.v - L"`` or ``"nothing"``.
    """

    count: int | None
    gap: float | None
    name: str | None
    fields: list[str]
    gauge_functions: list[str]
    structure_constants: np.ndarray
    time_translation: bool
    singular_values: np.ndarray
    basis: str
    points: int
    killing_form_signature: tuple[int, int, int] | None
    closure: float | None
    conserved: list[bool]
    invariant: str
    singular_states: int
    system: str
    closes: bool | None
    functions: int
    seed: int
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    def plot(self, *, ax: Axes | None = None, **style: Any) -> Axes:
        """Draws the singular values, those of symmetries before the gap, into `ax` or new axes of matplotlib, and returns these."""
        ax = _axes(ax)
        ax.semilogy(np.arange(1, len(self.singular_values) + 1), np.sort(self.singular_values), "o", **style)
        if self.count is not None:
            ax.axvline(self.count + 0.5, color="gray", linestyle=":")
        ax.set(xlabel="field", ylabel="singular value")
        return ax


@dataclass(frozen=True)
class Constraint:
    """A constraint that was found in motion.

    Attributes
    ----------
    kind : str
        ``"holonomic"``, ``"nonholonomic"``, or ``"per-trajectory"``: constant along each trajectory, conserved and not imposed.
    formula : str
        What vanishes, or is constant.
    coefficients, range : dict of str to float, and to (low, high)
        Factors of the terms, the leading one of the formula 1, and ranges of 95 % of them.
    defect : float
        Root of the mean square defect over what noise makes.
    """

    kind: str
    formula: str
    coefficients: dict[str, float]
    range: dict[str, tuple[float, float]]
    defect: float


@dataclass(frozen=True)
class Constraints(_Shown):
    """Constraints that were found in motion.

    Attributes
    ----------
    count : int
        Constraints of the system: holonomic and nonholonomic ones.
    constraints : tuple of Constraint
        All that was found.
    gap : float or None
        The next combination of coordinates varies by so many times as much.
    trajectories, refuted : int
        Trajectories, and candidates that did not hold on those that were left out.
    coordinates : list of str
    noise : (n,)
        Of each coordinate over its size: smaller deviations are not seen.
    still : dict of str to str
        Columns that do not move, in words; they take no part.
    limits : list of str
        Where the search was cut short, in words.
    """

    count: int
    constraints: tuple[Constraint, ...]
    gap: float | None
    trajectories: int
    refuted: int
    noise: np.ndarray
    still: dict[str, str]
    limits: list[str]
    coordinates: list[str]
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    @property
    def formulas(self) -> dict[str, str]:
        """Formulas of the constraints of the system, as `System` takes them under ``constraints``."""
        of_system = [found.formula for found in self.constraints if found.kind in ("holonomic", "nonholonomic")]
        return {f"found {k + 1}": text for k, text in enumerate(of_system)}


@dataclass(frozen=True)
class OwnConstraints(_Shown):
    """Constraints of a system, and the directions that no equation moves.

    Attributes
    ----------
    formulas : dict of str to str
        Formulas of the constraints by name; empty texts where none is known.
    kinds : dict of str to str
        ``"holonomic"`` or ``"nonholonomic"``.
    redundant : tuple of str
        Constraints that follow from the others.
    null_directions : (k, n)
        Directions that no equation moves, at a state that has the most of them.
    signature : (int, int) or None
        Positive and negative eigenvalues of the mass matrix within the constraints.
    states, open_states : int
        States that were looked at, and those among them with such directions.
    """

    formulas: dict[str, str]
    kinds: dict[str, str]
    redundant: tuple[str, ...]
    null_directions: np.ndarray
    signature: tuple[int, int] | None
    states: int
    open_states: int
    _text: str = field(repr=False)
    _html: str = field(repr=False)


@dataclass(frozen=True)
class PeriodicDrive:
    """A periodic drive of a formula.

    Attributes
    ----------
    name : str
        Name of its angular frequency in the terms.
    frequency, standard_error : float
        The angular frequency in rad by unit of time.
    """

    name: str
    frequency: float
    standard_error: float


@dataclass(frozen=True)
class Formula(_Shown):
    """A Lagrangian as a formula, and a dissipation function if there is one; arrays have an entry for each term.

    Attributes
    ----------
    verdict : str
        ``"found"``, ``"not in the library"``, or ``"undecided"`` for the reasons of `doubts`.
    several : bool
        Whether other formulas explain the motion as well; `rival` is the next best one, its terms and its cost in units of noise.
    blocks : tuple of tuple of str
        Coordinates in groups that do not act on each other: the masses of one group relative to those of another are not determined.
    basis, tried : str, tuple of str
        Functions that the formula was found among, and all that were searched.
    doubts, notes : tuple of str
        Why the verdict is in doubt, and what else is to be known of the search.
    lagrangian, dissipation : str
        L, and Rayleigh's function D, in the grammar of system files.
    terms : tuple of str
    coefficients, standard_errors, probabilities : (k,)
        Probabilities are the shares of resamplings in which terms were chosen.
    dissipative : (k,)
        Which terms are those of D.
    near : tuple of str or None
        Simple fractions within the errors of the coefficients.
    drive : PeriodicDrive or None
        The periodic drive, if terms have one.
    residual : float
        What is left of held-out motion over its noise, or of the accelerations of a model over their size.
    noise : (n,)
        Of every coordinate; an upper bound if it is not `noise_resolved`.
    left : tuple of (coordinate, low, high, residual, samples)
        What is left over in parts of the ranges of coordinates.
    searched, removed : int
        Terms, and those among them that are total derivatives or sums of others.
    coordinates : tuple of str
    toml, rust : str
        A system file, and a type of Rust, with this Lagrangian.
    """

    verdict: str
    lagrangian: str
    dissipation: str
    terms: tuple[str, ...]
    coefficients: np.ndarray
    standard_errors: np.ndarray
    probabilities: np.ndarray
    dissipative: np.ndarray
    near: tuple[str | None, ...]
    drive: PeriodicDrive | None
    residual: float
    noise: np.ndarray
    noise_resolved: bool
    several: bool
    rival: tuple[tuple[str, ...], float] | None
    blocks: tuple[tuple[str, ...], ...]
    basis: str
    tried: tuple[str, ...]
    doubts: tuple[str, ...]
    notes: tuple[str, ...]
    left: tuple[tuple[str, float, float, float, int], ...]
    searched: int
    removed: int
    coordinates: tuple[str, ...]
    toml: str = field(repr=False)
    rust: str = field(repr=False)
    _latex: tuple[str, str] = field(repr=False)
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    def latex(self, dissipation: bool = False) -> str:
        """L, or D, in LaTeX."""
        return self._latex[dissipation]

    def sympy(self, dissipation: bool = False) -> sympy.Expr:
        """L, or D, as an expression of SymPy in real symbols: ``x`` for a coordinate, ``x_dot`` for its velocity."""
        from .reader.sympy_functions import expression

        chosen = self.dissipative == dissipation
        terms = zip(np.array(self.terms, object)[chosen], self.coefficients[chosen])
        return expression([(float(coefficient), term) for term, coefficient in terms])

    def system(self) -> System:
        """The system with this Lagrangian, without the dissipation; its coefficients are parameters that a training may learn."""
        from ._mechanics import System

        return System.from_toml(self.toml)

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame of the terms."""
        import pandas as pd

        names = ["coefficients", "standard_errors", "probabilities", "dissipative", "near"]
        return pd.DataFrame({name: getattr(self, name) for name in names}, pd.Index(self.terms, name="term"))


@dataclass(frozen=True)
class IdentifiedConstant:
    """A constant of a system.

    Attributes
    ----------
    symbol : str
    value : float
    standard_error : float or None
        None where the motion says nothing of it; its value is then the one that the search started with.
    unit : str
    start : float
        Value at which the search started.
    at_bound : bool
        Whether it lies at the bound of its range, beyond which the data would be met better: it has no symmetric error.
    """

    symbol: str
    value: float
    standard_error: float | None
    unit: str
    start: float
    at_bound: bool


@dataclass(frozen=True)
class SensorConstant:
    """A constant of the sensor of a coordinate, whose positions are ``gain * q(t - delay) + offset``.

    Attributes
    ----------
    kind : str
        ``"offset"``, ``"gain"`` or ``"delay"``, which is in s.
    coordinate : str
    value : float
    standard_error : float or None
        None where the motion says nothing of it.
    """

    kind: str
    coordinate: str
    value: float
    standard_error: float | None


@dataclass(frozen=True)
class Undetermined:
    """Constants that can change, alone or together, without an effect on the recorded motion.

    Attributes
    ----------
    constants : tuple of str
        The constants.
    directions : (d, k)
        Relative change of each constant along each open direction, the largest 1; none where sums alone are known.
    known : dict of str to Combination
        Combinations that are known nevertheless, by their formula.
    relative_error : float or None
        Largest standard error along a direction over the values; None where the motion does not depend on one at all.
    text, advice : str
        What is open, and what would determine it, in words.
    """

    constants: tuple[str, ...]
    directions: np.ndarray
    known: dict[str, Combination]
    relative_error: float | None
    text: str
    advice: str


@dataclass(frozen=True)
class Combination:
    """A sum or a product of powers of constants that is known though they are not, such as a base parameter of a robot.

    Attributes
    ----------
    name : str
        Its formula.
    product : bool
        Whether it is a product.
    terms : dict of str to float
        Factors of the constants by symbol, exponents in a product.
    value, standard_error : float
    unit : str
    """

    name: str
    product: bool
    terms: dict[str, float]
    value: float
    standard_error: float
    unit: str


@dataclass(frozen=True)
class Bodies:
    """How the inertias of a chain of links became those of bodies.

    Attributes
    ----------
    moved : tuple of int
        Links whose constants had to be moved, from 1.
    largest_change : float
        Largest change of a known sum by it, in standard errors of the sum.
    exist : bool
        Whether bodies have the known sums within their errors.
    """

    moved: tuple[int, ...]
    largest_change: float
    exist: bool


@dataclass(frozen=True)
class OfTrajectory:
    """What one trajectory alone says of the constants.

    Attributes
    ----------
    trajectory : str
    constants : dict of str to IdentifiedConstant
        Empty if they cannot be identified from it.
    says : str
        The verdict, or why there are no constants.
    explained : bool
    """

    trajectory: str
    constants: dict[str, IdentifiedConstant]
    says: str
    explained: bool


@dataclass(frozen=True)
class Scatter:
    """The scatter of a constant over the trajectories that determine it.

    Attributes
    ----------
    symbol : str
    mean : float
        Each value weighted by its variance.
    count : int
        Number of the values.
    ratio : float
        Standard deviation from the mean in standard errors; 1 if the errors are right.
    probability : float
        That values of one and the same constant scatter as much.
    differs : bool
        Whether that is less than 1 % over the number of constants.
    """

    symbol: str
    mean: float
    count: int
    ratio: float
    probability: float
    differs: bool


@dataclass(frozen=True)
class ByTrajectory:
    """The constants by every trajectory alone, and their scatter.

    Attributes
    ----------
    trajectories : tuple of OfTrajectory
    scatter : tuple of Scatter
    """

    trajectories: tuple[OfTrajectory, ...]
    scatter: tuple[Scatter, ...]


@dataclass(frozen=True)
class Residual:
    """What the identified system leaves of the motion of one coordinate, or of the averaged equations of its force.

    Attributes
    ----------
    coordinate : str
    rms, noise : float
        Root mean square, and the standard deviation of the noise as it was known before.
    spread : float
        Standard deviation of what is met: of the positions, or of the forces.
    autocorrelation : float
        Correlation of residuals that follow each other; that of noise is 0.
    white : bool
        Whether they follow each other as noise does.
    """

    coordinate: str
    rms: float
    noise: float
    spread: float
    autocorrelation: float
    white: bool


@dataclass(frozen=True)
class Outlier:
    """A sample far from the motion.

    Attributes
    ----------
    trajectory : str
    row : int
        Line of the file, or sample of an array, from 1.
    time : float
        In s.
    coordinate : str
    size : float
        Residual over the usual one.
    """

    trajectory: str
    row: int
    time: float
    coordinate: str
    size: float


@dataclass(frozen=True)
class Identified(_Shown):
    """Constants of a system with their errors, and how far they can be trusted.

    Attributes
    ----------
    constants : dict of str to IdentifiedConstant
        By symbol, in the order of the system.
    sensors : tuple of SensorConstant
    correlations : (m, m)
        Of the errors of the constants, then of the sensors; 0 beside those without an error.
    undetermined : tuple of Undetermined
        What the motion leaves open.
    combinations : tuple of Combination
        Sums of constants that are known, where forces are met and are linear in the constants.
    bodies : Bodies or None
        How inertias became those of bodies; None for a system that is no chain of links.
    residuals : dict of str to Residual
        By coordinate.
    over_noise : float
        Residuals over the noise, root mean square, all coordinates together.
    obstacles : tuple of str
        What is to be known before all else: coordinates that stand still, forces of which too little is known between the samples.
    converged : bool
        Whether the search arrived; if not, the constants are where it stopped.
    decrement : float
        The decrease of the sum of squares that was left to gain, over the variance of the noise.
    explained : bool
        Whether the form explains the motion.
    verdict : dict
        Why: the ``kind`` of the verdict, with the numbers behind it.
    outliers : tuple of Outlier
        The farthest first, 100 at most of `outlier_count`.
    inflation : float
        Mean factor by which variances are larger than those of independent residuals; 1 for these.
    force_noise : tuple of float
        Standard deviation of the noise of the known forces, as the motion shows it; empty if it shows none.
    samples, segments, segment_seconds, substeps
        Samples and segments that were followed, the usual length of these in s, integration steps from sample to sample.
    between : str or None
        How known forces were taken between the samples.
    robust : bool
        Whether residuals beyond three standard deviations counted linearly.
    by_trajectory : ByTrajectory or None
        The constants by every trajectory alone, if that was asked for.
    """

    constants: dict[str, IdentifiedConstant]
    sensors: tuple[SensorConstant, ...]
    correlations: np.ndarray
    undetermined: tuple[Undetermined, ...]
    combinations: tuple[Combination, ...]
    bodies: Bodies | None
    residuals: dict[str, Residual]
    over_noise: float
    obstacles: tuple[str, ...]
    converged: bool
    decrement: float
    explained: bool
    verdict: dict
    outliers: tuple[Outlier, ...]
    outlier_count: int
    inflation: float
    force_noise: tuple[float, ...]
    samples: int
    segments: int
    segment_seconds: float
    substeps: int
    between: str | None
    robust: bool
    by_trajectory: ByTrajectory | None
    _form: System = field(repr=False)
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    def system(self) -> System:
        """The system with the constants that were found."""
        return self._form.with_parameters(**{symbol: constant.value for symbol, constant in self.constants.items()})

    def urdf(self, text: str) -> str:
        """A URDF, by its text or its path, with the constants that were found: numbers of inertials and dynamics change, all else stays."""
        from . import _lnn
        from .reader import files

        values = list(self.system().parameters.items())
        return _lnn.rewritten_robot(files.text(text, ".urdf"), values)

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame of the constants."""
        import pandas as pd

        names = ["value", "standard_error", "unit", "start"]
        rows = [[getattr(constant, name) for name in names] for constant in self.constants.values()]
        return pd.DataFrame(rows, pd.Index(list(self.constants), name="constant"), names)


@dataclass(frozen=True)
class Comparison(_Shown):
    """What two Lagrangians A and B have in common beyond factor and gauge: the best ``A = f(B) + dF/dt + constant``; distances are relative.

    Attributes
    ----------
    factors : (k,)
        Coefficients of f, from the first power of B: a factor, or for geodesics a polynomial.
    group_factors : (g,)
        Factors of groups of coordinates that do not act on each other, which B was first multiplied by; empty if there is one group.
    on_shell : bool
        Whether B is the same at all states, so that f is known at this one value.
    gauge, gauge_formula, constant
        Coefficients of F, F as a formula, and the constant.
    lagrangian, motion, mass_matrix, energy : float
        What is left of each; `motion` is that of the accelerations, NaN where there are none.
    motionless_states : int
        States at which one of the two has no accelerations.
    first, second : str
        Names of A and B.
    points, seed : int
        States that were looked at, and their seed.
    """

    factors: np.ndarray
    group_factors: np.ndarray
    on_shell: bool
    gauge: np.ndarray
    gauge_formula: str
    constant: float
    lagrangian: float
    motion: float
    motionless_states: int
    mass_matrix: float
    energy: float
    first: str
    second: str
    points: int
    seed: int
    _text: str = field(repr=False)
    _html: str = field(repr=False)


@dataclass(frozen=True)
class Surface:
    """A place on a line where the determinant of a block of a metric changes its sign.

    Attributes
    ----------
    point : dict of str to float
        By coordinate.
    change : str
        ``"zero"`` or ``"pole"``.
    """

    point: dict[str, float]
    change: str


@dataclass(frozen=True)
class View:
    """Figures of a picture through a metric; impact parameters are None where the ray of the centre is not captured.

    Attributes
    ----------
    share : float
        Share of the pixels in the shadow.
    area, left, right, bottom, top : float or None
        Area of the shadow in impact parameters, and those of its edge along the two axes of the picture.
    unfinished, steps : int
        Rays that neither were captured nor came from the sky, and steps of all rays.
    drift : float or None
        Largest ``g(k, k)`` at the end of a ray from the sky over the sizes of its terms.
    seconds, rays_per_second : float
    second_share, throat_radius : float or None
        Of a wormhole: share of the pixels that show the second region, and the angular radius of the throat's image in degrees; the edge
        and the area are those of this image.
    """

    share: float
    area: float | None
    left: float | None
    right: float | None
    bottom: float | None
    top: float | None
    unfinished: int
    drift: float | None
    steps: int
    seconds: float
    rays_per_second: float
    second_share: float | None = None
    throat_radius: float | None = None


@dataclass(frozen=True)
class Shadow(_Shown):
    """The shadow of a black hole.

    Attributes
    ----------
    image : (rows, columns, 3)
        The picture in red, green and blue, 0 to 255; of two metrics the exact one, the learned one, and their difference side by side.
    views : dict of str to View
        ``"exact"``, ``"learned"``, or both.
    difference : dict or None
        Of two metrics: shares of `pixels` of another colour and in the `shadow` of one alone, `median_angle` and `angle_99` in degrees.
    free_factor : bool
        Whether the impact parameters of a learned metric are known up to one factor.
    unit : str or None
        Of the coordinates.
    """

    image: np.ndarray = field(repr=False)
    views: dict[str, View]
    difference: dict[str, float] | None
    free_factor: bool
    unit: str | None
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    def plot(self, *, ax: Axes | None = None, **style: Any) -> Axes:
        """Draws the picture into `ax` or new axes of matplotlib, and returns these."""
        ax = _axes(ax)
        ax.imshow(self.image, **style)
        ax.set_axis_off()
        return ax


@dataclass(frozen=True)
class Checked(_Shown):
    """A first look at recorded motion: what it is, whether a simple law explains it, and what to do next.

    Attributes
    ----------
    samples, trajectories : int
    step : float
        Median time between samples in s.
    coordinates : dict of str to dict
        What there is to know of each: ``noise``, ``period``, ``samples_per_period``, ``velocity_error``, ``acceleration_error`` and more.
    warnings : tuple of str
        Facts to know before learning.
    suspicious : tuple of dict
        Places that do not look like smooth motion with noise: ``track``, ``row``, ``coordinate``, ``kind``; of very many the first.
    obstacle : str or None
        Why no fit can learn from the data.
    constraints : dict of str to str
        Formulas that vanish along the motion, by name; empty if there are none, or they were not looked for.
    formula : str or None
        A formula of the Lagrangian that explains the motion.
    next : str
        ``"mend"``, ``"record"``, ``"first-order"``, ``"formula"``, ``"fit-constrained"`` or ``"fit"``.
    call : str or None
        The call that does it.
    facts : dict
        All of the survey, as ``lnn check --json`` prints it.
    """

    samples: int
    trajectories: int
    step: float
    coordinates: dict[str, dict[str, object]]
    warnings: tuple[str, ...]
    suspicious: tuple[dict[str, object], ...]
    obstacle: str | None
    constraints: dict[str, str]
    formula: str | None
    next: str
    call: str | None
    facts: dict[str, object] = field(repr=False)
    _text: str = field(repr=False)
    _html: str = field(repr=False)


@dataclass(frozen=True)
class Certificate(_Shown):
    """Shares of a region in which the mass matrix is proven to have its signature, or not to.

    Attributes
    ----------
    signature : tuple of int
        Positive and negative eigenvalues that are to be proven.
    certified, refuted, open : float
        Shares, which add up to 1.
    witness : dict or None
        A state whose mass matrix is proven to be wrong: ``q``, ``v``, ``eigenvalues``.
    condition : float or None
        Proven bound of the condition number in the certified share.
    limit : float or None
        Largest condition number that was allowed.
    by_construction : bool
        Whether the structure of the model proves it everywhere.
    boxes, seconds
        Work that was done.
    """

    signature: tuple[int, int]
    certified: float
    refuted: float
    open: float
    boxes: int
    witness: dict | None
    condition: float | None
    limit: float | None
    by_construction: bool
    seconds: float
    _text: str = field(repr=False)
    _html: str = field(repr=False)


@dataclass(frozen=True)
class Learned(_Shown):
    """What a training or a fit learned.

    Attributes
    ----------
    model : Model
        The network with its best weights.
    history : dict of str to numpy.ndarray
        A number per epoch: ``training_loss``, ``validation_loss``, ``rate``, ``seconds`` and others.
    summary : dict
        The judgement: beside the exact system for a training, by held-out motion for a fit (``hold_out``), by held-out states
        for `learn`.
    stop : str or None
        Why learning ended before its time: ``"interrupted"``, or a failure.
    members : list of Model
        The model, and those of the other seeds of a fit with `members`.
    """

    model: Model
    history: dict[str, np.ndarray]
    summary: dict
    stop: str | None
    members: list[Model] = field(repr=False)
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    def plot(self, *, ax: Axes | None = None, **style: Any) -> Axes:
        """Draws the losses over the epochs into `ax` or new axes of matplotlib, and returns these."""
        ax = _axes(ax)
        for name in "training_loss", "validation_loss":
            ax.semilogy(self.history["epoch"], self.history[name], label=name.replace("_", " "), **style)
        ax.set(xlabel="epoch", ylabel="loss")
        ax.legend()
        return ax


@dataclass(frozen=True)
class Swept(_Shown):
    """What the runs of a sweep learned.

    Attributes
    ----------
    rows : list of dict
        One for each choice, with the columns of ``table.csv``.
    finished : int
        Runs that are finished.
    out : str
        Their directory, with tables and report.
    """

    rows: list[dict[str, object]]
    finished: int
    out: str
    _text: str = field(repr=False)
    _html: str = field(repr=False)

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame of the rows."""
        import pandas as pd

        return pd.DataFrame(self.rows)

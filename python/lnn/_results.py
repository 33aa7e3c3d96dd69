"""Results: dataclasses with arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._mechanics import Model


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
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    energy: np.ndarray
    stop: Any
    columns: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every motion reached its end."""
        return all(stop is None for stop in np.asarray(self.stop, dtype=object).ravel())

    def to_pandas(self):
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

    def to_xarray(self):
        """A Dataset with the dimensions ``t`` and, of a batch, ``start``."""
        import xarray as xr

        n, m = self.q.shape[-1], len(self.t)
        state = np.concatenate([self.q, self.v, self.energy[..., None]], -1)
        dims = ["t"] if state.ndim == 2 else ["start", "t"]
        state = state if state.ndim == 2 else state.reshape(-1, m, 2 * n + 1)
        names = [*self.columns, "energy"]
        return xr.Dataset({name: (dims, state[..., k]) for k, name in enumerate(names)}, {"t": self.t})


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
class Symmetries:
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
        Whether the energy is conserved.
    singular_values : (unknowns,)
    basis : str
        Highest degrees of the functions that fields are made of.
    points : int
        States that were looked at.
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


@dataclass(frozen=True)
class Certificate:
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
    by_construction: bool
    seconds: float


@dataclass(frozen=True)
class Learned:
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
    text : str
        The same for a terminal.
    stop : str or None
        Why learning ended before its time: ``"interrupted"``, or a failure.
    """

    model: Model
    history: dict[str, np.ndarray]
    summary: dict
    text: str = field(repr=False)
    stop: str | None = None

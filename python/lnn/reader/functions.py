"""A Lagrangian as functions of arrays: L, p, M, a, E, D, for NumPy here, for JAX and PyTorch beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .constraints import Constraints, bordered
from .jets import NUMPY, Jet
from .lagrangian import NetworkModel


#: The terms, in the order in which they are computed.
TERMS = ["lagrangian", "momentum", "dl_dq", "mass_matrix", "coriolis", "force", "acceleration", "energy"]


@dataclass(frozen=True)
class Terms:
    """The terms of states ``(..., n)``, in physical units.

    Attributes
    ----------
    lagrangian : (...)
        L.
    momentum : (..., n)
        p = dL/dv.
    dl_dq : (..., n)
        dL/dq.
    mass_matrix : (..., n, n)
        M = d2L/dv2.
    coriolis : (..., n)
        c = (d2L/dv dq) v.
    force : (..., n)
        -dD/dv, zero for a model without dissipation.
    acceleration : (..., n)
        a with M a = dL/dq - c + force; of a model under constraints with their force beside it.
    energy : (...)
        E = v.p - L.
    failures : tuple of (int, str)
        States, counted over the batch, whose acceleration is not determined, and why; of compiled code alone.
    """

    lagrangian: Any
    momentum: Any
    dl_dq: Any
    mass_matrix: Any
    coriolis: Any
    force: Any
    acceleration: Any
    energy: Any
    failures: tuple[tuple[int, str], ...] = ()


class Functions:
    """L as a function of ``(q, v)``, with its terms; every one takes other weights by the keyword `weights`.

    States are arrays ``(..., n)`` in physical units: one state, or any batch of them.

    Attributes
    ----------
    weights : dict
        The weights by the names of the model format, arrays of the library.
    """

    def __init__(self, xp, model, weights: dict, constraints: Constraints | None = None):
        self._xp, self._model, self.weights = xp, model, weights
        self._constraints = constraints if constraints and constraints.nodes else None

    def __call__(self, q, v, weights: dict | None = None):
        """L, ``(...)``."""
        return self._model.lagrangian(self._xp, self._of(weights), q, v)

    def dissipation(self, q, v, weights: dict | None = None):
        """D, ``(...)``, whose force -dD/dv acts on the motion; zero for a model without."""
        value = self._model.dissipation(self._xp, self._of(weights), q, v)
        return self._xp.sum(0 * v, -1) if value is None else value

    def momentum(self, q, v, weights: dict | None = None):
        """p = dL/dv, ``(..., n)``."""
        return self.terms(q, v, weights).momentum

    def mass_matrix(self, q, v, weights: dict | None = None):
        """M = d2L/dv2, ``(..., n, n)``."""
        return self.terms(q, v, weights).mass_matrix

    def acceleration(self, q, v, weights: dict | None = None):
        """a, ``(..., n)``, by the Euler-Lagrange equation, with the dissipation's force."""
        return self.terms(q, v, weights).acceleration

    def energy(self, q, v, weights: dict | None = None):
        """E = v.p - L, ``(...)``."""
        return self.terms(q, v, weights).energy

    def terms(self, q, v, weights: dict | None = None) -> Terms:
        """All terms of states."""
        raise NotImplementedError

    def _of(self, weights):
        return self.weights if weights is None else weights


class Differentiated(Functions):
    """Functions of a library that has ``grad``."""

    def __init__(self, xp, model, weights: dict, constraints: Constraints | None = None):
        super().__init__(xp, model, weights, constraints)
        self._grad, self._solve = xp.grad, xp.solve

    def momentum(self, q, v, weights=None):
        return self._grad(lambda v: self(q, v, weights).sum())(v)

    def energy(self, q, v, weights=None):
        return (v * self.momentum(q, v, weights)).sum(-1) - self(q, v, weights)

    def _second(self, q, v, weights):
        """M and c, row by row."""
        rows, drift = [], []
        for i in range(q.shape[-1]):
            dq, dv = self._grad(lambda q, v: self.momentum(q, v, weights)[..., i].sum(), (0, 1))(q, v)
            rows.append(dv)
            drift.append((dq * v).sum(-1))
        return self._xp.stack_rows(rows), self._xp.stack(drift)

    def mass_matrix(self, q, v, weights=None):
        return self._second(q, v, weights)[0]

    def terms(self, q, v, weights=None):
        value, p = self(q, v, weights), self.momentum(q, v, weights)
        dl_dq = self._grad(lambda q: self(q, v, weights).sum())(q)
        mass_matrix, drift = self._second(q, v, weights)
        force = -self._grad(lambda v: self.dissipation(q, v, weights).sum())(v)
        matrix, right = mass_matrix, dl_dq - drift + force
        if self._constraints:
            rows, drifts = self._constraints.of_gradients(self._xp, q, v)
            matrix, right = bordered(self._xp, matrix, rows, right, drifts)
        acceleration = self._solve(matrix, right[..., None])[..., : q.shape[-1], 0]
        energy = (v * p).sum(-1) - value
        return Terms(value, p, dl_dq, mass_matrix, drift, force, acceleration, energy)


#: Numbers of a Hessian that are held at a time.
_AT_A_TIME = 1 << 24


class NumpyFunctions(Functions):
    """Functions of NumPy arrays, whose derivatives are exact."""

    def __call__(self, q, v, weights=None):
        return super().__call__(np.asarray(q, float), np.asarray(v, float), weights)

    def dissipation(self, q, v, weights=None):
        return super().dissipation(np.asarray(q, float), np.asarray(v, float), weights)

    def terms(self, q, v, weights=None):
        q, v = np.broadcast_arrays(np.asarray(q, float), np.asarray(v, float))
        n, shape = q.shape[-1], q.shape[:-1]
        q, v = q.reshape(-1, n), v.reshape(-1, n)
        width = max((len(w) for w in self._of(weights).values() if w.ndim), default=1) + 3 * n * n
        chunk = max(1, _AT_A_TIME // (4 * n * n * width))
        parts = [self._chunk(q[k : k + chunk], v[k : k + chunk], weights) for k in range(0, len(q), chunk)]
        parts = parts or [self._chunk(q, v, weights)]
        joined = (np.concatenate(columns) for columns in zip(*parts))
        fields: dict[str, Any] = {name: column.reshape(shape + column.shape[1:]) for name, column in zip(TERMS, joined)}
        return Terms(**fields)

    def _chunk(self, q, v, weights):
        n, weights = q.shape[1], self._of(weights)
        x = Jet.variables(np.concatenate([q, v], -1))
        of = lambda function: function(self._xp, weights, x[..., :n], x[..., n:])
        value, friction = of(self._model.lagrangian), of(self._model.dissipation)
        gradient, hessian = np.moveaxis(value.gradient, 0, -1), np.moveaxis(value.hessian, (0, 1), (-2, -1))
        dl_dq, p, mass_matrix = gradient[:, :n], gradient[:, n:], hessian[:, n:, n:]
        drift = np.einsum("bij,bj->bi", hessian[:, n:, :n], v)
        force = np.zeros_like(v) if friction is None else -np.moveaxis(friction.gradient, 0, -1)[:, n:]
        matrix, right = mass_matrix, dl_dq - drift + force
        if self._constraints:
            rows, drifts = self._constraints.of_jets(self._xp, x, n)
            matrix = np.block([[matrix, np.swapaxes(rows, -1, -2)], [rows, np.zeros((*drifts.shape, drifts.shape[-1]))]])
            right = np.concatenate([right, -drifts], -1)
        try:
            acceleration = np.linalg.solve(matrix, right[..., None])[..., :n, 0]
        except np.linalg.LinAlgError:
            acceleration = np.stack([_solve(m, r) for m, r in zip(matrix, right)])[..., :n]
        return value.value, p, dl_dq, mass_matrix, drift, force, acceleration, np.sum(v * p, -1) - value.value


def _solve(matrix, right):
    """The solution, NaN where there is none."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full_like(right, np.nan)


class DescribedModel:
    """The Lagrangian and the dissipation of a system file, which has no weights."""

    def __init__(self, described, parameters: dict):
        self._described, self._parameters = described, parameters

    def lagrangian(self, xp, weights, q, v):
        return self._described.evaluate(xp, self._constants(xp, weights), q, v)

    def dissipation(self, xp, weights, q, v):
        return self._described.dissipation_of(xp, self._constants(xp, weights), q, v)

    def _constants(self, xp, weights):
        return {**self._described.constants(xp, given=self._parameters), **weights}


def numpy_functions(header: dict, tensors: dict) -> Functions:
    """A model as functions of NumPy arrays."""
    weights = {name: np.asarray(tensor, float) for name, tensor in tensors.items()}
    return NumpyFunctions(NUMPY, NetworkModel(header["architecture"]), weights, Constraints(header))

"""Constraints of a header: formulas that vanish along the motion, and the accelerations under them."""

from __future__ import annotations

import numpy as np

from .formula import Described, Parser, evaluate, names
from .jets import NUMPY, Jet

#: States at which rows are examined, steps of Newton's method to the constraints, and the part of a row at unit length beside the rows
#: before it below which it follows from them: those of the program.
STATES, STEPS, REDUNDANT = 24, 60, 1e-6


class Constraints:
    """Rows A and their drift: accelerations under them have ``A a = -drift``."""

    def __init__(self, header: dict):
        described = header.get("description") or {}
        formulas = header.get("constraints") or described.get("constraints") or {}
        self.nodes = [Parser(text).whole() for _, text in sorted(formulas.items())]
        self.coordinates = header["columns"][: len(header["columns"]) // 2]
        self.described = Described(described) if described.get("constraints") else None
        self.parameters = header.get("parameters", {})
        definitions = self.described.definitions if self.described else {}
        moving = {f"{name}_dot" for name in self.coordinates}
        for name, node in definitions.items():
            moving |= {name} if names(node) & moving else set()
        self.holonomic = [not names(node) & moving for node in self.nodes]
        # Rows of a description may follow from each other, those of a header do not.
        if self.described and not header.get("constraints"):
            kept = self._independent(described)
            self.nodes = [self.nodes[k] for k in kept]
            self.holonomic = [self.holonomic[k] for k in kept]

    def _independent(self, description: dict) -> list[int]:
        """Rows that do not follow from those before them at all of some states on the constraints; all where there is no such state."""
        n, everything = len(self.coordinates), list(range(len(self.nodes)))
        # The bounds of validation; an angle without any goes once around.
        usual = lambda entry: [0.0, 2 * np.pi] if entry.get("periodic") else [-1.0, 1.0]
        known = {entry["name"]: entry.get("bounds") or usual(entry) for entry in description["coordinates"]}
        known |= {f"{entry['name']}_dot": entry.get("velocity_bounds") or [-1.0, 1.0] for entry in description["coordinates"]}
        known |= description.get("validation") or {}
        number = lambda end: float(evaluate(NUMPY, Parser(str(end)).whole(), {}))
        names_of_state = [*self.coordinates, *(f"{name}_dot" for name in self.coordinates)]
        sides = np.array([[number(end) for end in known[name]] for name in names_of_state])
        x = np.random.default_rng(0).uniform(sides[:, 0], sides[:, 1], (STATES, 2 * n))
        with np.errstate(all="ignore"):
            x = self._projected(x, n)
            rows = self._examined(x, n)[0]
        kept = {k for matrix in rows for k in _independent_rows(matrix)}
        return sorted(kept) if len(rows) else everything

    def _examined(self, x, n):
        """A at unit length, ``(batch, m, n)``, and values and rates over the lengths, ``(batch, m)`` each."""
        jets = Jet.variables(x)
        rows, _ = self.of_jets(NUMPY, jets, n)
        found = np.stack([value.value for value in self.values(NUMPY, jets[..., :n], jets[..., n:])], -1)
        holonomic = np.array(self.holonomic)
        rates = np.where(holonomic, np.einsum("bij,bj->bi", rows, x[:, n:]), found)
        size = np.linalg.norm(rows, axis=-1)
        size = np.where(size > 0, size, 1.0)
        return rows / size[..., None], np.where(holonomic, found, 0.0) / size, rates / size

    def _projected(self, x, n):
        """Those of some states, ``(batch, 2 n)``, that come to the constraints by the least changes."""
        holonomic = np.array(self.holonomic)
        for step in range(STEPS + 2):
            rows, values, rates = self._examined(x, n)
            # First the coordinates, then the velocities.
            of, defects, at = (holonomic, values, slice(0, n)) if step < STEPS else (holonomic | True, rates, slice(n, None))
            fine = np.isfinite(rows).all((1, 2)) & np.isfinite(defects).all(1)
            x, rows, defects = x[fine], rows[fine], defects[fine]
            if of.any() and len(x):
                x[:, at] -= np.einsum("bij,bj->bi", np.linalg.pinv(rows[:, of], rcond=1e-7), defects[:, of])
        _, values, rates = self._examined(x, n)
        off = np.maximum(np.abs(values).max(-1, initial=0), np.abs(rates).max(-1, initial=0))
        return x[off <= 1e-9 * np.maximum(1, np.abs(x).max(-1, initial=0))]

    def values(self, xp, q, v):
        """What vanishes, one number of every state for each constraint."""
        if self.described:
            scope = self.described.scope(xp, self.described.constants(xp, given=self.parameters), q, v)
        else:
            scope = {}
            for i, name in enumerate(self.coordinates):
                scope |= {name: q[..., i], f"{name}_dot": v[..., i]}
        return [evaluate(xp, node, scope) for node in self.nodes]

    def of_jets(self, xp, x, n):
        """A, ``(batch, m, n)``, and drift, ``(batch, m)``, from the states as jets."""
        v, rows, drifts = x.value[:, n:], [], []
        for found, holonomic in zip(self.values(xp, x[..., :n], x[..., n:]), self.holonomic):
            gradient = np.moveaxis(found.gradient, 0, -1)
            second = np.moveaxis(found.hessian, (0, 1), (-2, -1))[:, :n, :n]
            rows.append(gradient[:, :n] if holonomic else gradient[:, n:])
            drifts.append(np.einsum("bi,bij,bj->b", v, second, v) if holonomic else np.sum(gradient[:, :n] * v, -1))
        return np.stack(rows, 1), np.stack(drifts, -1)

    def of_gradients(self, xp, q, v):
        """A, a list of ``(..., n)``, and drift, a list of ``(...)``, by the gradients of a library."""
        rows, drifts = [], []
        for k, holonomic in enumerate(self.holonomic):
            row = lambda q, v, k=k: self.values(xp, q, v)[k].sum()
            along = xp.grad(row, 0 if holonomic else 1)
            rate = (lambda q, v, along=along: (along(q, v) * v).sum()) if holonomic else row
            rows.append(along(q, v))
            drifts.append((xp.grad(rate, 0)(q, v) * v).sum(-1))
        return rows, drifts


def bordered(xp, mass_matrix, rows, right, drifts):
    """The matrix ``[M A^T; A 0]`` and the right-hand side ``[right; -drift]``."""
    n, m = right.shape[-1], len(rows)
    a = xp.stack_rows(rows)
    top = [xp.concatenate([mass_matrix[..., i, :], a[..., :, i]]) for i in range(n)]
    below = [xp.concatenate([row, 0 * xp.stack(drifts)]) for row in rows]
    return xp.stack_rows(top + below), xp.concatenate([right, xp.stack([-drift for drift in drifts])])


def _independent_rows(matrix) -> list[int]:
    """Rows at unit length that keep a part beside the kept ones before them."""
    kept: list[int] = []
    basis = np.zeros((0, matrix.shape[1]))
    for k, row in enumerate(matrix):
        if not np.linalg.norm(row) > 0:
            continue
        # Twice, since once leaves rounding.
        rest = row - (basis @ row) @ basis
        rest = rest - (basis @ rest) @ basis
        left = np.linalg.norm(rest)
        if left > REDUNDANT:
            kept.append(k)
            basis = np.vstack([basis, rest / left])
    return kept

"""Constraints of a header: formulas that vanish along the motion, and the accelerations under them."""

from __future__ import annotations

import numpy as np

from .formula import Described, Parser, evaluate, names


class Constraints:
    """Rows A and their drift: accelerations under them have ``A a = -drift``."""

    def __init__(self, header: dict):
        described = header.get("description") or {}
        formulas = header.get("constraints") or described.get("constraints") or {}
        self.nodes = [Parser(text).whole() for _, text in sorted(formulas.items())]
        self.coordinates = header["columns"][: len(header["columns"]) // 2]
        # Rows of a description may follow from each other, those of a header do not.
        self.described = Described(described) if described.get("constraints") else None
        self.parameters = header.get("parameters", {})
        definitions = self.described.definitions if self.described else {}
        moving = {f"{name}_dot" for name in self.coordinates}
        for name, node in definitions.items():
            moving |= {name} if names(node) & moving else set()
        self.holonomic = [not names(node) & moving for node in self.nodes]

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

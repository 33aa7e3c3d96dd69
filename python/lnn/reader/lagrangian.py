"""L and D of a model over the functions of any backend; the page on the model format says the same in words.

States are ``(..., n)``, in physical units; every function works on the last axis.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .activations import ACTIVATIONS, BRANCHES
from .formula import Described


class NetworkModel:
    """The functions of a model's architecture, with weights given by name."""

    def __init__(self, architecture: dict):
        self.net = architecture
        self.n = architecture["coordinates"]
        self.time = architecture.get("time_like")
        usual = {"structure": "black-box", "factor": "triangle", "cyclic": [], "radial": []}
        self.form: dict[str, Any] = usual | architecture.get("form", {})
        known = self.form.get("known")
        self.known = None if known is None else Described(known)
        ones = [1.0] * self.n
        self.sizes = self.form.get("sizes") or {"velocity": ones, "potential": 1.0, "friction": ones}

    def wrap(self, xp, q):
        """Angles reduced to [0, 2 pi)."""
        angles = np.array(self.net["periodic"])
        if not angles.any():
            return q
        return xp.stack([xp.wrap(q[..., i]) if angle else q[..., i] for i, angle in enumerate(angles)])

    def features(self, xp, q):
        """Features of the coordinates, ``(..., F)``."""
        hidden = set(self.form["cyclic"]).union(*(group["coordinates"] for group in self.form["radial"]))
        features = []
        for i in (i for i in range(self.n) if i not in hidden):
            embedded = self.net["periodic"][i] and self.net["embed_periodic"]
            x = q[..., i]
            features += [xp.sin(x), xp.cos(x)] if embedded else [x / self.net["scale"][i]]
        for group in self.form["radial"]:
            x = [q[..., i] for i in group["coordinates"]]
            distance = xp.sqrt(sum(x * x for x in x))
            far, near = xp.log(distance / group["unit"]), group["unit"] / distance
            for x in x:
                features += [x / distance * far, x / distance * near]
        return xp.stack(features) if features else q[..., :0]

    def outputs(self, xp, weights, x):
        """Outputs of the network, ``(..., outputs)``."""
        kind, total = self.net["activation"], 0
        parts = BRANCHES.get(kind)
        branches = {"": kind} if parts is None else {f"branches.{b}.": kind for b, kind in enumerate(parts)}
        for prefix, activation in branches.items():
            h = x
            if self.net.get("input_layer") == "dyt":
                h = weights[prefix + "dyt.gamma"] * xp.tanh(weights[prefix + "dyt.alpha"] * h)
                h = h + weights[prefix + "dyt.beta"]
            layers = len(self.net["hidden"])
            for k in range(layers + 1):
                h = h @ weights[f"{prefix}layers.{k}.weight"].T
                # The output of a black box has no bias.
                if f"{prefix}layers.{k}.bias" in weights:
                    h = h + weights[f"{prefix}layers.{k}.bias"]
                h = ACTIVATIONS[activation](xp, h) if k < layers else h
            total = total + h
        return total

    def half_form(self, xp, numbers, w, time):
        """Q(w): half the quadratic form of scaled velocities from the numbers of its factor."""
        n = self.n
        space = n if time is None else n - 1
        w = w[..., np.array([i for i in range(n) if i != time] + ([] if time is None else [time]))]
        if self.form["factor"] == "triangle":
            i, k = np.indices((n, n))
            strict = numbers[..., np.where(i > k, i * (i + 1) // 2 + k, 0)] * xp.constant((i > k).astype(float))
            diagonal = positive(xp, numbers[..., np.array([i * (i + 1) // 2 + i for i in range(n)])])
            along = xp.sum(strict * w[..., :, None], -2) + diagonal * w
            return 0.5 * xp.sum(along * along * xp.constant(signs(n, n - 1 if time is not None else None)), -1)
        y = w
        if time is not None:
            lapse, last = numbers[..., 3 * space**2 + space], w[..., space]
            y = w[..., :space] + numbers[..., 3 * space**2 : 3 * space**2 + space] * w[..., space:]
        form = 1e-6 * xp.sum(y * y, -1)
        if space > 0:
            rectangle = numbers[..., np.arange(3 * space**2).reshape(3 * space, space)]
            along = xp.sum(rectangle * y[..., None, :], -1)
            form = form + xp.sum(along * along, -1)
        return 0.5 * (form if time is None else form - (positive(xp, lapse) * last) ** 2)

    def lagrangian(self, xp, weights, q, v):
        """L, ``(...)``, in the unit of the network."""
        form, q = self.form, self.wrap(xp, q)
        features, w = self.features(xp, q), v / xp.constant(np.array(self.net["scale"]))
        moving, potential = w * xp.constant(np.array(self.sizes["velocity"])), self.sizes["potential"]
        if form["structure"] == "metric":
            value = self.half_form(xp, self.outputs(xp, weights, features), moving, self.time)
        elif form["structure"] in ("mechanical", "constant-mass"):
            outputs, n = self.outputs(xp, weights, features), self.n
            # The numbers of a constant factor are parameters beside the network.
            constant = form["structure"] == "constant-mass"
            count = 0 if constant else n * (n + 1) // 2 if form["factor"] == "triangle" else 3 * n**2
            numbers = weights["mass"] if constant else outputs[..., :count]
            value = self.half_form(xp, numbers, moving, None) - potential * outputs[..., count]
            # An even Lagrangian has no vector potential.
            if not form.get("even_in_v"):
                value = value + xp.sum(outputs[..., count + 1 :] * moving, -1)
        else:
            output = lambda w: self.outputs(xp, weights, xp.concatenate([features, w]))[..., 0]
            value = 0.5 * (output(w) + output(-w)) if form.get("even_in_v") else output(w)
            alpha = weights["alpha"][0] if form.get("learn_alpha") else self.net["alpha"]
            value = potential * value + alpha * xp.sum(moving * moving * xp.constant(signs(self.n, self.time)), -1)
        if self.known is None:
            return value
        return value + self.known.evaluate(xp, self.known.constants(xp, weights.get("known", ())), q, v)

    def dissipation(self, xp, weights, q, v):
        """D, ``(...)``, whose force is -dD/dv; None for a model without."""
        total, w = None, v / xp.constant(np.array(self.net["scale"]))
        if self.form.get("joint_friction", "none") != "none":
            total = self.joint_friction(xp, weights["joint_friction"], w)
        if not self.net.get("dissipation"):
            return total
        features, along = self.features(xp, self.wrap(xp, q)), w @ weights["dissipation.direction"].T
        strength = xp.softplus(weights["dissipation.gamma"] + features @ weights["dissipation.weight"].T)
        value = xp.sum(strength * xp.log_cosh(along), -1)
        return value if total is None else total + value

    def joint_friction(self, xp, rows, w):
        """The dissipation that every coordinate has by itself."""
        knee = xp.exp(rows[2])
        value = xp.softplus(rows[0]) * w * w / 2 + xp.softplus(rows[1]) * knee * xp.log_cosh(w / knee)
        if self.form["joint_friction"] == "stribeck":
            fall = xp.exp(rows[4])
            value = value + xp.softplus(rows[3]) * fall * (1 - xp.exp(-((w / fall) * (w / fall))))
        return xp.sum(value * xp.constant(np.array(self.sizes["friction"])), -1)


def positive(xp, x):
    """A positive number from any."""
    return xp.softplus(x) + 1e-3


def signs(n, time):
    """-1 for a time, 1 for all others."""
    return np.where(np.arange(n) == time, -1.0, 1.0)


TURN = 2 * math.pi

"""Activations of the hidden layers, over the functions of any backend."""

from __future__ import annotations

import math

ACTIVATIONS = {
    "gelu": lambda xp, x: 0.5 * x * xp.erfc(x * -math.sqrt(0.5)),
    "softplus": lambda xp, x: xp.softplus(x),
    "x-tanh": lambda xp, x: x * xp.tanh(0.5 * x),
    "tanh": lambda xp, x: xp.tanh(x),
    "quadratic": lambda xp, x: x * x,
    "silu": lambda xp, x: 0.5 * x * (1.0 + xp.tanh(0.5 * x)),
}

# Activations of the branches of a hybrid.
BRANCHES = {"quadratic-softplus": ["softplus", "quadratic"]}

"""The keys of a header that are read. Everything else is refused, since it may change the Lagrangian."""

from __future__ import annotations

import json
from typing import Any

from .activations import ACTIVATIONS, BRANCHES

FORMAT = 1

# A list holds the values that are read, None stands for any.
KNOWN: dict[str, Any] = dict.fromkeys(
    ["name", "title", "time_unit", "lagrangian", "coordinates", "parameters", "definitions", "metric"]
    + ["training", "validation", "trajectory", "shell"]
)
FORM: dict[str, Any] = {
    "structure": ["black-box", "mechanical", "constant-mass", "metric"],
    "factor": ["triangle", "rectangle"],
    "cyclic": None,
    "even_in_v": None,
    "learn_alpha": None,
    "radial": {"coordinates": None, "unit": None},
    "known": KNOWN,
    "joint_friction": ["none", "dry", "stribeck"],
    "sizes": {"velocity": None, "potential": None, "friction": None},
}
ARCHITECTURE: dict[str, Any] = {
    **dict.fromkeys(["coordinates", "hidden", "alpha", "time_like", "scale", "periodic", "embed_periodic", "dissipation"]),
    "activation": [*ACTIVATIONS, *BRANCHES],
    "input_layer": ["none", "dyt"],
    "form": FORM,
}
HEADER: dict[str, Any] = {
    **dict.fromkeys(["crate_version", "system", "parameters", "columns", "forces", "constraints", "precision"]),
    **dict.fromkeys(["position", "velocity", "seed", "validation_loss"]),
    # Constraints of a system hold the motion, and its dissipation is what the network learned; those of a known part would change nothing.
    "description": {**KNOWN, "constraints": None, "dissipation": None},
    "format": [FORMAT],
    "architecture": ARCHITECTURE,
}


def check(table: dict, keys: dict = HEADER, path: str = "") -> None:
    """Refuses a header that says what is not read."""
    for key, value in table.items():
        if key not in keys:
            raise ValueError(f"the key {path}{key} is not read by this version of the package")
        if isinstance(keys[key], dict):
            for part in value if isinstance(value, list) else [value]:
                check(part, keys[key], f"{path}{key}.")
        elif keys[key] is not None and value not in keys[key]:
            raise ValueError(f"the value of {path}{key}, {json.dumps(value)}, is not read by this version of the package")

"""A model as functions of PyTorch tensors."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import torch

from .constraints import Constraints
from .functions import Differentiated, Functions
from .lagrangian import TURN, NetworkModel


def backend(dtype) -> SimpleNamespace:
    """The functions of tensors of a type that a Lagrangian is made of."""
    constant = lambda x: torch.tensor(np.asarray(x, float), dtype=dtype)
    zero = constant(0)
    return SimpleNamespace(
        grad=torch.func.grad,
        solve=torch.linalg.solve,
        constant=constant,
        stack=lambda parts: torch.stack(torch.broadcast_tensors(*parts), -1),
        stack_rows=lambda parts: torch.stack(parts, -2),
        concatenate=lambda parts: torch.cat(parts, -1),
        sum=lambda x, axis: x.sum(axis),
        wrap=lambda x: torch.remainder(x, TURN),
        power=torch.pow,
        logistic=torch.sigmoid,
        softplus=lambda x: torch.logaddexp(x, zero),
        log_cosh=lambda x: torch.logaddexp(x, -x) - math.log(2),
        **{name: getattr(torch, name) for name in "maximum minimum atan2 asin acos atan sin cos tan".split()},
        **{name: getattr(torch, name) for name in "sinh cosh tanh exp expm1 log log1p sqrt abs erfc".split()},
    )


def torch_functions(header: dict, tensors: dict, dtype=None) -> Functions:
    """A model as functions of PyTorch tensors."""
    xp = backend(torch.float64 if dtype is None else dtype)
    weights = {name: xp.constant(tensor) for name, tensor in tensors.items()}
    return Differentiated(xp, NetworkModel(header["architecture"]), weights, Constraints(header))

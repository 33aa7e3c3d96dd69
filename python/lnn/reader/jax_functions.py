"""A model as functions of JAX arrays."""

from __future__ import annotations

import math
from dataclasses import fields
from types import SimpleNamespace

import jax
import jax.numpy as jnp
from jax.scipy.special import erfc

from .constraints import Constraints
from .functions import Differentiated, Functions, Terms
from .lagrangian import TURN, NetworkModel

_names = [field.name for field in fields(Terms)]
jax.tree_util.register_dataclass(Terms, data_fields=_names[:-1], meta_fields=_names[-1:])

JAX = SimpleNamespace(
    grad=jax.grad,
    solve=jnp.linalg.solve,
    constant=lambda x: jnp.asarray(x, float),
    stack=lambda parts: jnp.stack(jnp.broadcast_arrays(*parts), -1),
    stack_rows=lambda parts: jnp.stack(parts, -2),
    concatenate=lambda parts: jnp.concatenate(parts, -1),
    sum=jnp.sum,
    wrap=lambda x: jnp.mod(x, TURN),
    atan2=jnp.arctan2,
    asin=jnp.arcsin,
    acos=jnp.arccos,
    atan=jnp.arctan,
    erfc=erfc,
    logistic=jax.nn.sigmoid,
    softplus=lambda x: jnp.logaddexp(x, 0.0),
    log_cosh=lambda x: jnp.logaddexp(x, -x) - math.log(2),
    **{name: getattr(jnp, name) for name in "power maximum minimum sin cos tan sinh cosh tanh".split()},
    **{name: getattr(jnp, name) for name in "exp expm1 log log1p sqrt abs".split()},
)


def jax_functions(header: dict, tensors: dict) -> Functions:
    """A model as functions of JAX arrays."""
    weights = {name: jnp.asarray(tensor, float) for name, tensor in tensors.items()}
    return Differentiated(JAX, NetworkModel(header["architecture"]), weights, Constraints(header))

"""Model files without compiled code: read, written, and evaluated by NumPy, JAX or PyTorch.

>>> model = ModelFile.load("model.safetensors")            # doctest: +SKIP
>>> lagrangian = model.to_jax()                            # doctest: +SKIP
>>> jax.vmap(jax.grad(lagrangian, 1))(q, v)                # momenta, (batch, n)  # doctest: +SKIP
"""

from .functions import Functions, Terms
from .model_file import ModelFile

__all__ = ["Functions", "ModelFile", "Terms"]

"""Model files: header and tensors, read, checked, written, with NumPy alone."""

from __future__ import annotations

import json
import os
import zlib
from dataclasses import dataclass

import numpy as np

from . import files
from .functions import Functions, numpy_functions
from .header import check

TYPES: dict[str, np.dtype] = {"F32": np.dtype("<f4"), "F64": np.dtype("<f8")}


@dataclass(frozen=True)
class ModelFile:
    """A model as its file holds it.

    Attributes
    ----------
    header : dict
        Everything but the weights, by the keys of the page on the model format, without the checksum.
    tensors : dict of str to numpy.ndarray
        Weights by name, all of type ``float32`` or all of type ``float64``.
    """

    header: dict
    tensors: dict[str, np.ndarray]

    def __post_init__(self):
        check(self.header)

    @classmethod
    def load(cls, path: str | os.PathLike) -> ModelFile:
        """Reads a model file.

        Raises
        ------
        ValueError
            If the file is altered, is no model file, or has a key or a value that this reader does not know.
        """
        return cls.from_bytes(files.read(path))

    @classmethod
    def from_bytes(cls, data: bytes) -> ModelFile:
        """Reads the bytes of a model file, as `load` does."""
        length = int.from_bytes(data[:8], "little")
        try:
            table = json.loads(data[8 : 8 + length])
            text = table.pop("__metadata__")["lnn"]
            body = text[: text.rindex(',"checksum"')]
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError("the file is no model of lnn") from error
        payload = memoryview(data)[8 + length :]
        if body + _checksum(body, payload) != text:
            raise ValueError("the checksum is wrong: the file was altered")
        tensors = {}
        for name, entry in table.items():
            first, last = entry["data_offsets"]
            numbers = np.frombuffer(payload[first:last], TYPES[entry["dtype"]])
            tensors[name] = numbers.reshape(entry["shape"])
        return cls(json.loads(body + "}"), tensors)

    def to_bytes(self) -> bytes:
        """The bytes of the file; `lnn` loads them."""
        table, parts, end = {}, [], 0
        for name, tensor in self.tensors.items():
            tensor = np.asarray(tensor)
            kind = next((kind for kind, dtype in TYPES.items() if tensor.dtype == dtype), None)
            if kind is None:
                raise ValueError(f"the tensor {name} has the type {tensor.dtype}: expected float32 or float64")
            parts.append(np.ascontiguousarray(tensor, TYPES[kind]).tobytes())
            entry = {"dtype": kind, "shape": list(tensor.shape), "data_offsets": [end, end + len(parts[-1])]}
            table[name], end = entry, end + len(parts[-1])
        payload = b"".join(parts)
        body = json.dumps(self.header, separators=(",", ":"), ensure_ascii=False)[:-1]
        metadata = {"lnn": body + _checksum(body, payload)}
        text = json.dumps({"__metadata__": metadata, **table}, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 8)
        return len(text).to_bytes(8, "little") + text + payload

    def save(self, path: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Writes the file, which ``lnn`` loads; one that is there already is kept unless `overwrite` is set."""
        files.write(path, self.to_bytes(), overwrite)

    def to_numpy(self) -> Functions:
        """The model as functions of NumPy arrays, in double precision, derivatives exact."""
        return numpy_functions(self.header, self.tensors)

    def to_jax(self) -> Functions:
        """The model as functions of JAX arrays.

        They can be differentiated, compiled by ``jax.jit`` and mapped by ``jax.vmap``. JAX computes in single precision unless
        ``jax.config.update("jax_enable_x64", True)`` says otherwise.
        """
        from .jax_functions import jax_functions

        return jax_functions(self.header, self.tensors)

    def to_torch(self, dtype=None) -> Functions:
        """The model as functions of PyTorch tensors of a type, ``torch.float64`` unless another one is given.

        They can be differentiated by ``backward`` and ``torch.func``, and mapped by ``torch.vmap``.
        """
        from .torch_functions import torch_functions

        return torch_functions(self.header, self.tensors, dtype)


def _checksum(body: str, payload) -> str:
    """CRC-32 of the JSON text up to the comma before "checksum" and of the tensors' bytes as they lie in the file."""
    return f',"checksum":"{zlib.crc32(payload, zlib.crc32(body.encode())):08x}"}}'

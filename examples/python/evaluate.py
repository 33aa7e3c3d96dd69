"""Evaluates a model file of lnn with numpy and safetensors alone, and writes one.

    python evaluate.py MODEL.safetensors STATES.csv

prints {"lagrangian": L, "momentum": [p]} for every state. The CSV has the model's columns as header, in any order.
"""

import csv
import json
import math
import sys
import zlib

import numpy as np
import safetensors.numpy

ERF = np.vectorize(math.erf, otypes=[float])
ACTIVATIONS = {
    "gelu": lambda x: 0.5 * x * (1 + ERF(x / math.sqrt(2))),
    "softplus": lambda x: np.logaddexp(0, x),
    "x-tanh": lambda x: x * np.tanh(x / 2),
    "tanh": np.tanh,
    "quadratic": np.square,
}


def lagrangian(header, tensors, q, v):
    """L of states q, v of shape (batch, n), in the unit of the network."""
    net = header["architecture"]
    scale, features = np.array(net["scale"]), []
    for i, periodic in enumerate(net["periodic"]):
        angle = np.mod(q[:, i], 2 * np.pi) if periodic else q[:, i]
        embedded = periodic and net["embed_periodic"]
        features += [np.sin(angle), np.cos(angle)] if embedded else [angle / scale[i]]
    features = np.stack(features + list((v / scale).T), axis=1)
    hybrid = net["activation"] == "quadratic-softplus"
    branches = {"branches.0.": "softplus", "branches.1.": "quadratic"} if hybrid else {"": net["activation"]}
    total = net["alpha"] * np.sum((v / scale) ** 2, axis=1)
    for prefix, activation in branches.items():
        get, x = lambda name: tensors[prefix + name].astype(float), features
        if net.get("input_layer") == "dyt":
            x = get("dyt.gamma") * np.tanh(get("dyt.alpha") * x) + get("dyt.beta")
        for k in range(len(net["hidden"])):
            x = ACTIVATIONS[activation](x @ get(f"layers.{k}.weight").T + get(f"layers.{k}.bias"))
        total += (x @ get(f"layers.{len(net['hidden'])}.weight").T)[:, 0]
    return total


def momentum(header, tensors, q, v):
    """p = dL/dv, shape (batch, n), by central differences of order 4: about 1e-12 of L."""
    p = np.empty_like(v)
    for i, scale in enumerate(header["architecture"]["scale"]):
        step = np.zeros(v.shape[1])
        step[i] = 1e-3 * scale
        at = lambda k: lagrangian(header, tensors, q, v + k * step)
        p[:, i] = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step[i])
    return p


def checksum(body, data):
    """CRC-32 of the JSON text up to the comma before "checksum" and of the tensors' bytes as they lie in the file."""
    payload = data[8 + int.from_bytes(data[:8], "little") :]
    return f',"checksum":"{zlib.crc32(payload, zlib.crc32(body.encode())):08x}"}}'


def load(path):
    """Header and tensors of a model file; an altered file is refused."""
    with open(path, "rb") as file:
        data = file.read()
    length = int.from_bytes(data[:8], "little")
    text = json.loads(data[8 : 8 + length])["__metadata__"]["lnn"]
    body = text[: text.rindex(',"checksum"')]
    if body + checksum(body, data) != text:
        raise ValueError(f"{path}: the checksum is wrong")
    return json.loads(body + "}"), safetensors.numpy.load(data)


def save(path, header, tensors):
    """Writes a model file that lnn loads: the same header without checksum, tensors all float32 or all float64."""
    body = json.dumps(header, separators=(",", ":"), ensure_ascii=False)[:-1]
    bytes_of = lambda text: safetensors.numpy.save(tensors, {"lnn": text})
    # The order of the tensors in the file is safetensors' own: it writes once for the checksum, once with it.
    data = bytes_of(body + checksum(body, bytes_of("")))
    with open(path, "wb") as file:
        file.write(data)


def main(model, states):
    header, tensors = load(model)
    with open(states, newline="") as file:
        rows = [[float(row[name]) for name in header["columns"]] for row in csv.DictReader(file)]
    q, v = np.split(np.array(rows), 2, axis=1)
    for value, p in zip(lagrangian(header, tensors, q, v), momentum(header, tensors, q, v)):
        print(json.dumps({"lagrangian": value, "momentum": p.tolist()}))


if __name__ == "__main__":
    main(*sys.argv[1:])

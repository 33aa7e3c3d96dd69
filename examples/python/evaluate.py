"""Evaluates a model file of lnn with numpy and safetensors alone, and writes one.

    python evaluate.py MODEL.safetensors STATES.csv

prints {"lagrangian": L, "momentum": [p]} for every state. The CSV has the model's columns as header, in any order.
A file whose header has a key or a value that this script does not read is refused by that name.
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
    "silu": lambda x: x * np.exp(-np.logaddexp(0, -x)),
}

# Every key of a header that is read, or that changes neither L nor p; a list holds the values that are read, None stands for any.
FORM = {
    "structure": ["black-box", "mechanical", "constant-mass", "metric"],
    "factor": ["triangle", "rectangle"],
    "cyclic": None,
    "even_in_v": None,
    "learn_alpha": None,
    "radial": {"coordinates": None, "unit": None},
}
ARCHITECTURE = {
    **dict.fromkeys(["coordinates", "hidden", "alpha", "time_like", "scale", "periodic", "embed_periodic", "dissipation"]),
    "activation": [*ACTIVATIONS, "quadratic-softplus"],
    "input_layer": ["none", "dyt"],
    "form": FORM,
}
HEADER = {
    **dict.fromkeys(["crate_version", "system", "description", "parameters", "columns", "forces", "precision"]),
    **dict.fromkeys(["position", "velocity", "seed", "validation_loss"]),
    "format": [1],
    "architecture": ARCHITECTURE,
}


def check(table, keys=HEADER, path=""):
    """Refuses a header that says what is not read."""
    for key, value in table.items():
        if key not in keys:
            raise ValueError(f"the key {path}{key} is not read by this script")
        if isinstance(keys[key], dict):
            for part in value if isinstance(value, list) else [value]:
                check(part, keys[key], f"{path}{key}.")
        elif keys[key] is not None and value not in keys[key]:
            raise ValueError(f"the value of {path}{key}, {json.dumps(value)}, is not read by this script")


def form_of(net):
    """What is known about the Lagrangian beforehand, keys that the file leaves out included."""
    return {"structure": "black-box", "factor": "triangle", "cyclic": [], "radial": []} | net.get("form", {})


def position_features(net, q):
    """Features made of the coordinates: a list of columns."""
    form, features = form_of(net), []
    hidden = set(form["cyclic"]).union(*(group["coordinates"] for group in form["radial"]))
    for i in (i for i in range(q.shape[1]) if i not in hidden):
        angle = np.mod(q[:, i], 2 * np.pi) if net["periodic"][i] else q[:, i]
        embedded = net["periodic"][i] and net["embed_periodic"]
        features += [np.sin(angle), np.cos(angle)] if embedded else [angle / net["scale"][i]]
    for group in form["radial"]:
        x = q[:, group["coordinates"]].T
        distance = np.sqrt(np.sum(x**2, axis=0))
        for direction in x / distance:
            features += [direction * np.log(distance / group["unit"]), direction * group["unit"] / distance]
    return features


def network(net, tensors, features):
    """Outputs of the network for a list of columns, shape (batch, outputs)."""
    hybrid = net["activation"] == "quadratic-softplus"
    branches = {"branches.0.": "softplus", "branches.1.": "quadratic"} if hybrid else {"": net["activation"]}
    outputs = 0
    for prefix, activation in branches.items():
        get, x = lambda name: tensors[prefix + name].astype(float), np.stack(features, axis=1)
        if net.get("input_layer") == "dyt":
            x = get("dyt.gamma") * np.tanh(get("dyt.alpha") * x) + get("dyt.beta")
        for k in range(len(net["hidden"])):
            x = ACTIVATIONS[activation](x @ get(f"layers.{k}.weight").T + get(f"layers.{k}.bias"))
        last = f"layers.{len(net['hidden'])}."
        # The output of a black box has no bias.
        bias = get(last + "bias") if prefix + last + "bias" in tensors else 0
        outputs = outputs + x @ get(last + "weight").T + bias
    return outputs


def half_form(factor, numbers, v, time):
    """Half the quadratic form of scaled velocities v, shape (batch, n), from the numbers of its factor."""
    n, positive = v.shape[1], lambda x: np.logaddexp(0, x) + 1e-3
    space = n if time is None else n - 1
    v = v[:, [i for i in range(n) if i != time] + ([] if time is None else [time])]
    if factor == "triangle":
        triangle, diagonal = np.zeros((len(v), n, n)), np.arange(n)
        rows, columns = np.tril_indices(n)
        triangle[:, rows, columns] = numbers
        triangle[:, diagonal, diagonal] = positive(triangle[:, diagonal, diagonal])
        squares = np.einsum("bik,bi->bk", triangle, v) ** 2
        return (squares[:, :space].sum(axis=1) - squares[:, space:].sum(axis=1)) / 2
    rectangle, rest = np.split(numbers, [3 * space**2], axis=1)
    # The shift and the lapse of a time; without one there are neither.
    moved = v if time is None else v[:, :space] + rest[:, :space] * v[:, space:]
    lapsed = 0 if time is None else positive(rest[:, space]) * v[:, space]
    squares = np.einsum("brk,bk->br", rectangle.reshape(-1, 3 * space, space), moved) ** 2
    return (squares.sum(axis=1) + 1e-6 * np.sum(moved**2, axis=1) - lapsed**2) / 2


def lagrangian(header, tensors, q, v):
    """L of states q, v of shape (batch, n), in the unit of the network."""
    check(header)
    net = header["architecture"]
    form, time = form_of(net), net.get("time_like")
    positions, scaled = position_features(net, q), v / np.array(net["scale"])
    if form["structure"] == "metric":
        return half_form(form["factor"], network(net, tensors, positions), scaled, time)
    if form["structure"] in ("mechanical", "constant-mass"):
        outputs, n = network(net, tensors, positions), v.shape[1]
        if form["structure"] == "constant-mass":
            # The numbers of the factor are parameters beside the network, the same for every state.
            outputs = np.concatenate([np.tile(tensors["mass"].astype(float), (len(v), 1)), outputs], axis=1)
        count = n * (n + 1) // 2 if form["factor"] == "triangle" else 3 * n**2
        numbers, potential, vector = np.split(outputs, [count, count + 1], axis=1)
        # An even Lagrangian has no vector potential.
        linear = np.sum(vector * scaled, axis=1) if vector.shape[1] else 0
        return half_form(form["factor"], numbers, scaled, None) - potential[:, 0] + linear
    at = lambda sign: network(net, tensors, positions + list(sign * scaled.T))[:, 0]
    output = (at(1) + at(-1)) / 2 if form.get("even_in_v") else at(1)
    signs = np.where(np.arange(v.shape[1]) == time, -1, 1)
    alpha = tensors["alpha"].astype(float)[0] if form.get("learn_alpha") else net["alpha"]
    return output + alpha * np.sum(signs * scaled**2, axis=1)


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
        raise ValueError("the checksum is wrong")
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
    try:
        main(*sys.argv[1:])
    except ValueError as error:
        sys.exit(f"{sys.argv[1]}: {error}")

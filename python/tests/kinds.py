"""A model file of every kind that the program writes, with weights of no meaning."""

import copy

import numpy as np

from lnn.reader import ModelFile

COLUMNS = ["theta", "x", "y", "theta_dot", "x_dot", "y_dot"]
Q = np.array([[0.1, 0.5, -3.0], [7.0, -4.0, 1.5], [-20.0, 0.9, 2.5], [3.0, 2.5, 4.0]])
V = np.array([[1.5, -1.0, 2.0], [0.2, 0.3, 3.0], [0.0, 0.0, 0.0], [1.0, 2.0, -0.5]])


def description(name):
    bounds = [-1.0, 1.0]
    coordinate = lambda name: {"name": name, "periodic": name == "theta", "bounds": bounds, "velocity_bounds": bounds}
    return {
        "name": name,
        "lagrangian": "mass*(theta_dot^2 + x_dot^2 + y_dot^2)/2 - mass*g*y + bend*cos(theta)*shift - x^-2",
        "coordinates": [coordinate(name) for name in ["theta", "x", "y"]],
        "parameters": {
            "mass": {"default": "2", "unit": "kg", "range": "positive", "learn": True},
            "bend": {"default": "0.5", "unit": "J", "range": "any", "learn": True},
            "g": {"default": "9.81", "unit": "1", "range": "any"},
        },
        "definitions": {"shift": "exp(-depth) + atan2(y, 1 + x^2)^3/9", "depth": "softplus(y)^1.5/4 + max(x, y)^2/9"},
    }


def base():
    architecture = {
        "coordinates": 3,
        "hidden": [6, 4],
        "activation": "gelu",
        "alpha": 0.3,
        "scale": [1.5, 2.0, 0.7],
        "periodic": [True, False, False],
        "embed_periodic": True,
        "form": {},
    }
    header = {"format": 1, "crate_version": "0.1.0", "architecture": architecture, "system": "recorded", "parameters": {}}
    header |= {"columns": COLUMNS, "precision": "f64", "position": [[-10.0, 10.0]] * 3, "velocity": [[-10.0, 10.0]] * 3}
    return header | {"seed": 1, "validation_loss": 0.25}


def shapes(net):
    """Shapes of the tensors of an architecture, by name."""
    form = {"structure": "black-box", "factor": "triangle", "cyclic": [], "radial": []} | net["form"]
    n, time = net["coordinates"], net.get("time_like")
    grouped = [i for group in form["radial"] for i in group["coordinates"]]
    features = 0
    for i in (i for i in range(n) if i not in form["cyclic"]):
        features += 2 if i in grouped or (net["periodic"][i] and net["embed_periodic"]) else 1
    space = n - (time is not None)
    numbers = n * (n + 1) // 2 if form["factor"] == "triangle" else 3 * space**2 + (0 if time is None else n)
    potentials = 1 + (0 if form.get("even_in_v") else n)
    outputs = {"black-box": 1, "metric": numbers, "mechanical": numbers + potentials, "constant-mass": potentials}
    black = form["structure"] == "black-box"
    sizes = [features + (n if black else 0), *net["hidden"], outputs[form["structure"]]]
    prefixes = [""]
    if net["activation"] == "quadratic-softplus":
        prefixes, sizes = ["branches.0.", "branches.1."], [sizes[0], *(w // 2 for w in sizes[1:-1]), sizes[-1]]
    found = {}
    for prefix in prefixes:
        if net.get("input_layer") == "dyt":
            found |= {f"{prefix}dyt.alpha": (1,), f"{prefix}dyt.gamma": (sizes[0],), f"{prefix}dyt.beta": (sizes[0],)}
        for k, (inputs, width) in enumerate(zip(sizes, sizes[1:])):
            found[f"{prefix}layers.{k}.weight"] = (width, inputs)
            if not (black and k == len(sizes) - 2):
                found[f"{prefix}layers.{k}.bias"] = (width,)
    if units := net.get("dissipation"):
        found |= {"dissipation.gamma": (units,), "dissipation.weight": (units, features)}
        found["dissipation.direction"] = (units, n)
    if form.get("joint_friction", "none") != "none":
        found["joint_friction"] = ({"dry": 3, "stribeck": 5}[form["joint_friction"]], n)
    if form.get("learn_alpha"):
        found["alpha"] = (1,)
    if form["structure"] == "constant-mass":
        found["mass"] = (numbers,)
    if "known" in form:
        found["known"] = (2,)
    return found


def kinds():
    """Pairs of a name and a model file."""
    found = {}

    def add(name, *changes):
        header = copy.deepcopy(base())
        for change in changes:
            change(header)
        rng = np.random.default_rng(len(found))
        dtype = {"f32": np.float32, "f64": np.float64}[header["precision"]]
        sizes = shapes(header["architecture"]).items()
        found[name] = ModelFile(header, {key: rng.normal(0, 0.4, shape).astype(dtype) for key, shape in sizes})

    def net(**keys):
        return lambda header: header["architecture"].update(keys)

    def form(**keys):
        return lambda header: header["architecture"]["form"].update(keys)

    for activation in ["gelu", "softplus", "x-tanh", "tanh", "silu", "quadratic", "quadratic-softplus"]:
        add(activation, net(activation=activation))
    add("single precision", lambda header: header.update(precision="f32"))
    add("angles as they are", net(embed_periodic=False))
    add("input layer", net(input_layer="dyt"))
    add("input layers of a hybrid", net(input_layer="dyt", activation="quadratic-softplus"))
    add("friction", net(dissipation=3))
    add("joint friction", form(joint_friction="dry"))
    sizes = {"velocity": [1.5, 0.25, 3.0], "potential": 7.0, "friction": [0.5, 2.0, 1.25]}
    add("joint friction beside friction", net(dissipation=3), form(joint_friction="stribeck", sizes=sizes))
    rod = {"rod": "x^2 + y^2 - 2*x*y/3 - 1", "turn": "sin(theta)*x_dot + y_dot - theta_dot/3"}
    add("under constraints", lambda header: header.update(constraints=rod))
    own = {**description("own"), "dissipation": "bend*x_dot^2", "constraints": {"turn": "shift*x_dot + y_dot - mass*theta_dot"}}
    add("learned from a system under constraints with friction", net(dissipation=3), lambda header: header.update(description=own, system="own"))
    add("forces", lambda header: header.update(forces=["f_theta", "f_x", "f_y"]))
    for structure, factor, time in [
        ("black-box", "triangle", None),
        ("black-box", "triangle", 1),
        ("mechanical", "triangle", None),
        ("mechanical", "rectangle", None),
        ("constant-mass", "triangle", None),
        ("constant-mass", "rectangle", None),
        ("metric", "triangle", None),
        ("metric", "rectangle", None),
        ("metric", "triangle", 1),
        ("metric", "rectangle", 0),
    ]:
        shape = [form(structure=structure, factor=factor)] + ([] if time is None else [net(time_like=time)])
        kind = f"{structure}, {factor}, time {time}"
        add(kind, *shape)
        add(f"{kind}, sizes", *shape, form(sizes=sizes))
        add(f"{kind}, even", *shape, form(even_in_v=True))
        add(f"{kind}, cyclic", *shape, form(cyclic=[0, 2]))
        add(f"{kind}, radial", *shape, form(radial=[{"coordinates": [2, 1], "unit": 1.25}]))
        add(f"{kind}, known", *shape, form(known=description("known")))
        if structure == "black-box":
            add(f"{kind}, learned alpha", *shape, form(learn_alpha=True))
    twice = {"again": "turn_and_rod - 3*(sin(theta)*x_dot + y_dot - theta_dot/3)", "rod": rod["rod"], "turn": rod["turn"]}
    twice = {**description("twice"), "constraints": twice}
    twice["definitions"] = {**twice["definitions"], "turn_and_rod": "2*(2*x - 2*y/3)*x_dot + 2*(2*y - 2*x/3)*y_dot"}
    add("under constraints that follow from each other", lambda header: header.update(description=twice, system="twice"))
    return found

"""Models in numpy, JAX and PyTorch are those of the compiled code."""

import json

import numpy as np
import pytest
from kinds import Q, V, kinds

import lnn
from lnn.reader import ModelFile

TERMS = ["lagrangian", "momentum", "dl_dq", "mass_matrix", "coriolis", "force", "acceleration", "energy"]
KINDS = list(kinds())


def jax_functions(model):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    return model.to_jax(), jax.numpy.asarray


def torch_functions(model):
    torch = pytest.importorskip("torch")
    return model.to_torch(), lambda x: torch.tensor(np.array(x), dtype=torch.float64)


BACKENDS = {"numpy": lambda model: (model.to_numpy(), np.asarray), "jax": jax_functions, "torch": torch_functions}


def agree(found, expected, what, tolerance=1e-12):
    found, expected = np.asarray(found), np.asarray(expected)
    size = np.abs(expected).max()
    assert found.shape == expected.shape and np.abs(found - expected).max() <= tolerance * size, what


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_model(models, kind, backend):
    exact = lnn.Model.from_bytes(models[kind].to_bytes()).terms(Q, V)
    functions, array = BACKENDS[backend](models[kind])
    terms = functions.terms(array(Q), array(V))
    # Solving with a mass matrix, and with rows of constraints around it, loses the digits that its condition number has.
    lost = (10 if "constraints" in kind else 1) * np.finfo(float).eps * np.linalg.cond(exact.mass_matrix).max()
    for name in TERMS:
        tolerance = max(1e-12, lost) if name == "acceleration" else 1e-12
        agree(getattr(terms, name), getattr(exact, name), f"{kind}: {name}", tolerance)
    # One state alone.
    agree(functions(array(Q[1]), array(V[1])), exact.lagrangian[1], kind)


def test_a_metric_as_known_part_and_a_description(models):
    description = {
        "name": "polar",
        "coordinates": [
            {"name": "r", "bounds": [1, 2], "velocity_bounds": [-1, 1]},
            {"name": "phi", "periodic": True, "velocity_bounds": [-1, 1]},
        ],
        "parameters": {"m": 2},
        "definitions": {"area": "m*r^2"},
        "metric": {"r,r": "m", "r, phi": "0.1*r", "phi,phi": "area"},
    }
    coordinates = {c["name"]: {k: x for k, x in c.items() if k != "name"} for c in description["coordinates"]}
    more = {key: description[key] for key in ("definitions", "metric", "parameters")}
    system = lnn.System("polar", coordinates=coordinates, **more)
    q, v = np.array([[1.5, 0.3], [1.1, 4.0]]), np.array([[0.2, -0.4], [0.0, 1.0]])
    exact, found = system.terms(q, v), system.to_numpy().terms(q, v)
    for name in TERMS:
        agree(getattr(found, name), getattr(exact, name), name)


@pytest.mark.parametrize("library", ["jax", "torch"])
def test_arrays_of_other_libraries_are_taken(library):
    from lnn._arrays import states

    arm, (q, v) = lnn.System("double-pendulum"), np.random.default_rng(1).normal(size=(2, 6, 2))
    if library == "jax":
        jax = pytest.importorskip("jax")
        jax.config.update("jax_enable_x64", True)
        found = arm.acceleration(jax.numpy.asarray(q), jax.numpy.asarray(v))
    else:
        torch = pytest.importorskip("torch")
        tensor = torch.from_numpy(q)
        assert np.shares_memory(states(tensor, v, 2)[0], q)
        found = arm.acceleration(tensor, v)
    assert isinstance(found, np.ndarray) and np.array_equal(found, arm.acceleration(q, v))


@pytest.mark.parametrize("backend", BACKENDS)
def test_systems_with_friction_and_constraints(backend):
    """Those of the formulas; a constraint that follows from the others has no force of its own."""
    system = lnn.System(
        "rod",
        lagrangian="m*(x_dot^2 + y_dot^2 + z_dot^2)/2 - m*g*y",
        coordinates=["x", "y", "z"],
        parameters={"m": 1.5, "g": 9.8, "c": 0.3},
        dissipation="c*(x_dot^2 + z_dot^2)/2",
        constraints={"rod": "x^2 + y^2 - 1", "rolling": "z_dot - x*y_dot + y*x_dot", "the same rod": "3*x^2 + 3*y^2 - 3"},
    )
    q, v = np.array([[0.6, -0.8, 0.1], [1.0, 0.0, 2.0]]), np.array([[0.8, 0.6, 1.0], [0.0, -0.5, -0.5]])
    exact = system.terms(q, v)
    functions, array = BACKENDS[backend](system)
    terms = functions.terms(array(q), array(v))
    assert np.abs(exact.force).max() > 0.1 and system.constraints().redundant
    for name in TERMS:
        agree(getattr(terms, name), getattr(exact, name), name)


@pytest.mark.parametrize("library", ["jax", "torch"])
def test_constraints_that_follow_from_each_other_have_derivatives(models, library):
    """The derivative of a loss of accelerations by a weight, beside a difference."""
    lagrangian, array = BACKENDS[library](models["under constraints that follow from each other"])
    q, v = array(Q), array(V)
    name = next(name for name in lagrangian.weights if name.endswith("layers.1.weight"))
    loss = lambda w: (lagrangian.acceleration(q, v, weights={**lagrangian.weights, name: w}) ** 2).sum()
    at = lagrangian.weights[name]
    if library == "jax":
        import jax

        slope = jax.grad(loss)(at)
    else:
        import torch

        slope = torch.func.grad(loss)(at)
    step = np.zeros(tuple(at.shape))
    step[0, 0] = 1e-5
    difference = (loss(at + array(step)) - loss(at - array(step))) / 2e-5
    assert np.isfinite(np.asarray(slope)).all() and abs(difference) > 1e-6
    assert abs(slope[0, 0] - difference) <= 1e-5 * abs(difference)


def test_jax_derivatives_vmap_jit_and_weights(models):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    q, v = jax.numpy.asarray(Q), jax.numpy.asarray(V)
    for kind in ["friction", "metric, rectangle, time 0, radial", "black-box, triangle, time None, known"]:
        lagrangian = models[kind].to_jax()
        terms = jax.jit(lagrangian.terms)(q, v)
        agree(jax.vmap(jax.grad(lagrangian, 1))(q, v), terms.momentum, kind)
        agree(jax.vmap(jax.hessian(lagrangian, 1))(q, v), terms.mass_matrix, kind)
        agree(jax.vmap(lagrangian.terms)(q, v).acceleration, terms.acceleration, kind)
        # The derivative of a loss of accelerations by the weights, beside a difference.
        loss = lambda w: (lagrangian.acceleration(q, v, weights=w) ** 2).sum()
        slope = jax.grad(loss)(lagrangian.weights)
        name = next(name for name in lagrangian.weights if name.endswith("layers.1.weight"))
        step = lambda h: {**lagrangian.weights, name: lagrangian.weights[name].at[0, 0].add(h)}
        difference = (loss(step(1e-5)) - loss(step(-1e-5))) / 2e-5
        assert abs(slope[name][0, 0] - difference) <= 1e-5 * max(abs(difference), 1e-3), kind


def test_torch_derivatives_and_vmap(models):
    torch = pytest.importorskip("torch")
    q, v = torch.tensor(Q), torch.tensor(V)
    lagrangian = models["friction"].to_torch()
    terms = lagrangian.terms(q, v)
    agree(torch.vmap(torch.func.grad(lagrangian, 1))(q, v), terms.momentum, "p")
    agree(torch.vmap(lagrangian.acceleration)(q, v), terms.acceleration, "a")
    moving = v.clone().requires_grad_()
    lagrangian(q, moving).sum().backward()
    agree(moving.grad, terms.momentum, "backward")
    assert models["friction"].to_torch(torch.float32)(q.float(), v.float()).dtype == torch.float32


def test_a_file_comes_back_and_an_altered_one_is_refused(models, tmp_path):
    for kind in ["single precision", "input layers of a hybrid"]:
        file = models[kind]
        file.save(tmp_path / "model.safetensors", overwrite=True)
        again = ModelFile.load(tmp_path / "model.safetensors")
        assert again.header == file.header and again.tensors.keys() == file.tensors.keys()
        assert all(np.array_equal(again.tensors[name], file.tensors[name]) for name in file.tensors)
        data = bytearray(file.to_bytes())
        data[-1] ^= 1
        with pytest.raises(ValueError, match="checksum"):
            ModelFile.from_bytes(bytes(data))
        with pytest.raises(ValueError):
            lnn.Model.from_bytes(bytes(data))
    with pytest.raises(ValueError):
        ModelFile.from_bytes(b"no model at all")


def test_what_is_not_known_is_refused(models):
    header = json.loads(json.dumps(models["gelu"].header))
    header["architecture"]["form"]["novelty"] = 1
    with pytest.raises(ValueError, match="architecture.form.novelty"):
        ModelFile(header, models["gelu"].tensors)

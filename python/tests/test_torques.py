"""Forces from outside: what makes a motion, what a motion is under them, and that signs agree."""

import re
from pathlib import Path

import numpy as np
import pytest

import lnn

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def arm():
    return lnn.System.from_toml(ROOT / "examples/systems/triple_arm.toml")


@pytest.fixture(scope="module")
def robot():
    """Seven joints with masses and friction."""
    system = lnn.System.from_toml(ROOT / "examples/systems/seven_joints.toml")
    values = {f"m{k}": 2.0 for k in range(1, 8)} | {f"Fv{k}": 0.5 for k in range(1, 8)}
    values |= {f"I{axis}{k}": 0.05 for k in range(1, 8) for axis in ("xx", "yy", "zz")}
    return system.with_parameters(**{name: value for name, value in values.items() if name in system.parameters})


def states(n, count=5):
    return np.random.default_rng(n).normal(size=(3, count, n))


def test_the_example_of_the_documentation_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs/python.md").read_text()
    (code,) = re.findall(r"## Torques\n\n```python\n(.*?)```", text, re.S)
    names = {}
    exec(code, names)
    assert np.allclose(names["still"].q, names["q"], atol=1e-6) and names["damped"].complete and names["played"].complete


@pytest.mark.parametrize("name", ["arm", "robot"])
def test_torques_and_accelerations_are_inverse(name, request):
    system = request.getfixturevalue(name)
    n = len(system.coordinates)
    q, v, a = states(n)
    torque = system.inverse_dynamics(q, v, a)
    assert np.allclose(system.acceleration(q, v, force=torque.external), a, rtol=1e-7, atol=1e-7)
    assert np.allclose(torque.external, torque.inertial + torque.coriolis + torque.gravity - torque.friction)
    assert np.allclose(torque.generalized, torque.friction + torque.external)
    terms = system.terms(q, v)
    assert np.allclose(torque.friction, terms.force) and (np.sum(terms.force * v, -1) < 0).all()
    assert np.allclose(torque.inertial, np.einsum("bij,bj->bi", terms.mass_matrix, a))
    assert np.allclose(torque.coriolis + torque.gravity, terms.coriolis - terms.dl_dq)
    at_rest = system.inverse_dynamics(q, 0 * v, 0 * a)
    assert np.allclose(at_rest.external, torque.gravity) and torque.multipliers.shape == (5, 0)
    assert system.inverse_dynamics(q[0], v[0], a[0]).external.shape == (n,)
    assert np.allclose(system.inverse_dynamics(q[0], v[0], a[0]).external, torque.external[0])
    # One acceleration for all states.
    assert np.allclose(system.inverse_dynamics(q, v, a[0]).external[0], torque.external[0])


def test_friction_is_left_out_on_demand(arm):
    q, v, _ = states(3)
    bare = arm.with_parameters(**{f"{kind}{k}": 0 for kind in "cd" for k in (1, 2, 3)})
    assert np.allclose(arm.acceleration(q, v, friction=False), bare.acceleration(q, v))
    assert np.abs(arm.acceleration(q, v) - bare.acceleration(q, v)).min() > 1e-6
    force = np.array([0.1, -0.2, 0.05])
    assert np.allclose(arm.acceleration(q, v, force=force, friction=False), bare.acceleration(q, v, force=force))
    slopes, exact = arm.linearize(q, v, force=force, friction=False), bare.linearize(q, v, force=force)
    for name in "acceleration", "by_q", "by_v", "by_force":
        assert np.allclose(getattr(slopes, name), getattr(exact, name), rtol=1e-8, atol=1e-8), name
    kept = arm.rollout(q[0], v[0], 1.0, 0.1, friction=False, rtol=1e-10, atol=1e-12)
    assert np.allclose(kept.q, bare.rollout(q[0], v[0], 1.0, 0.1, rtol=1e-10, atol=1e-12).q, atol=1e-7)
    assert np.ptp(kept.energy) < 1e-7


def test_motion_follows_forces_in_every_form(arm):
    start, still = np.array([3.0, 2.9, 3.2]), np.zeros(3)
    fine = {"rtol": 1e-10, "atol": 1e-12}
    push = np.array([0.02, -0.01, 0.005])
    constant = arm.rollout(start, still, 0.5, 0.05, force=push, **fine)
    called = arm.rollout(start, still, 0.5, 0.05, force=lambda t, q, v: push, **fine)
    times = np.linspace(0, 0.5, 6)
    sampled = arm.rollout(start, still, 0.5, 0.05, force=(times, np.tile(push, (6, 1))), **fine)
    for other in called, sampled:
        assert np.allclose(other.q, constant.q, atol=1e-9)
    # Each start of a batch under its own force.
    pushes = np.array([push, -push])
    batch = arm.rollout(np.stack([start, start]), np.zeros((2, 3)), 0.5, 0.05, force=pushes, **fine)
    assert np.allclose(batch.q[0], constant.q, atol=1e-9) and not np.allclose(batch.q[1], constant.q, atol=1e-4)
    ramps = pushes[:, None, :] * np.linspace(0, 1, 6)[:, None]
    ramped = arm.rollout(np.stack([start, start]), np.zeros((2, 3)), 0.5, 0.05, force=(times, ramps), **fine)
    alone = arm.rollout(start, still, 0.5, 0.05, force=lambda t, q, v: -push * t / 0.5, **fine)
    assert np.allclose(ramped.q[1], alone.q, atol=1e-8)
    held = arm.rollout(start, still, 0.5, 0.05, force=(times, np.outer(np.linspace(0, 1, 6), push)), between="held", **fine)
    assert not np.allclose(held.q, ramped.q[0], atol=1e-6)
    # A controller that knows the torques of a motion makes it.
    along = lambda t: start + 0.1 * np.sin(2 * t), lambda t: 0.2 * np.cos(2 * t) * np.ones(3), lambda t: -0.4 * np.sin(2 * t) * np.ones(3)
    ahead = lambda t, q, v: arm.inverse_dynamics(along[0](t), along[1](t), along[2](t)).external
    followed = arm.rollout(along[0](0), along[1](0), 0.5, 0.1, force=ahead, **fine)
    assert np.allclose(followed.q[-1], along[0](0.5), atol=1e-6)


def test_one_coordinate_takes_plain_numbers():
    spring = lnn.System(lagrangian="m*x_dot^2/2 - k*x^2/2", coordinates=["x"], parameters={"m": 1, "k": 4})
    assert spring.acceleration(0.5, 0.0, force=2.0) == 0.0 and spring.inverse_dynamics(0.5, 0.0, 0.0).external == 2.0
    assert np.allclose(spring.rollout(0.5, 0.0, 1.0, 0.1, force=[2.0]).q, 0.5)
    assert np.allclose(spring.rollout(0.5, 0.0, 1.0, 0.1, force=lambda t, q, v: 2.0).q, 0.5)
    assert np.allclose(spring.rollout(0.5, 0.0, 1.0, 0.1, force=([0.0, 1.0], [2.0, 2.0])).q, 0.5)


def test_constraints_carry_their_part():
    chain = lnn.System("cartesian-chain-1")
    q, v = np.array([0.6, -0.8]), np.array([0.8, 0.6])
    a = chain.acceleration(q, v)
    torque = chain.inverse_dynamics(q, v, a)
    assert np.allclose(torque.external, 0, atol=1e-9) and torque.multipliers.shape == (1,)
    assert np.allclose(torque.generalized, torque.constraint, atol=1e-9)
    with pytest.raises(ValueError, match="constraint"):
        chain.inverse_dynamics(q, v, a + 10 * q)


@pytest.mark.parametrize(
    ("force", "more", "text"),
    [
        ([1.0, 2.0], {}, "force"),
        ([np.nan] * 3, {}, "finite"),
        (([0.0, 0.5], np.zeros((2, 3))), {}, "known from"),
        (([0.0, 1.0], np.zeros((3, 3))), {}, "force"),
        (([0.0, 1.0], np.zeros((2, 3))), {"between": "quintic"}, "between"),
        ([0.0] * 3, {"between": "held"}, "between"),
        (lambda t, q, v: [1.0], {}, "force"),
    ],
)
def test_forces_that_are_none_are_refused(arm, force, more, text):
    with pytest.raises(ValueError, match=text):
        arm.rollout([3.0] * 3, [0.0] * 3, 1.0, 0.1, force=force, **more)


def test_what_a_force_raises_comes_back(arm):
    def fail(t, q, v):
        raise ZeroDivisionError("motor")

    with pytest.raises(ZeroDivisionError, match="motor"):
        arm.rollout([3.0] * 3, [0.0] * 3, 1.0, 0.1, force=fail)
    with pytest.raises(ValueError, match="force"):
        arm.acceleration(np.zeros((4, 3)), np.zeros((4, 3)), force=np.zeros((3, 3)))
    with pytest.raises(ValueError, match="^a: "):
        arm.inverse_dynamics([3.0] * 3, [0.0] * 3, [0.0] * 2)


def test_models_take_torques(shipped):
    model = lnn.Model.load(shipped)
    q, v, a = states(2)
    torque = model.inverse_dynamics(q, v, a)
    assert np.allclose(model.acceleration(q, v, force=torque.external), a, atol=1e-6)
    assert (torque.friction == 0).all()
    many = np.random.default_rng(1).normal(size=(3, 10_000, 2))
    pushed = model.acceleration(many[0], many[1], force=many[2], threads=2)
    assert np.array_equal(pushed, model.acceleration(many[0], many[1], force=many[2]))
    assert np.allclose(pushed[:5], model.acceleration(many[0, :5], many[1, :5], force=many[2, :5]), rtol=1e-9)

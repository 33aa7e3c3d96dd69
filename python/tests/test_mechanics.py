"""Systems and models: terms, motion, geometry, symmetries, certificates; shapes, types, errors, pickles."""

import json
import multiprocessing
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import lnn

ROOT = Path(__file__).parents[2]

SPRING = {"lagrangian": "m*x_dot^2/2 - k*x^2/2", "coordinates": ["x"], "parameters": {"m": 1, "k": 4}}
PENDULUM = """
name = "pendulum"
lagrangian = "m*l^2*theta_dot^2/2 + m*g*l*cos(theta)"
parameters = { m = 1, l = 2, g = 9.8 }
[[coordinates]]
name = "theta"
unit = "rad"
periodic = true
velocity_bounds = [-10, 10]
"""


@pytest.fixture(scope="module")
def arm():
    return lnn.System("double-pendulum", m2=0.5)


def test_systems_by_name_formula_and_file(arm, tmp_path):
    assert {"double-pendulum", "kepler", "kerr-geodesic"} <= lnn.systems().keys()
    assert arm.parameters["m2"] == 0.5 and arm.columns == ("theta1", "theta2", "theta1_dot", "theta2_dot")
    assert arm.angles == ("theta1", "theta2") and arm.bounds["theta1_dot"] == (-10.0, 10.0)
    spring = lnn.System(**SPRING)
    assert spring.acceleration([0.5], [0.0]).tolist() == [-2.0]
    pendulum = lnn.System.from_toml(PENDULUM, l=1.0)
    assert pendulum.parameters["l"] == 1.0
    assert np.allclose(pendulum.acceleration([0.5], [1.0]), -9.8 * np.sin(0.5), rtol=1e-15)
    (tmp_path / "pendulum.toml").write_text(PENDULUM)
    assert lnn.System.from_toml(tmp_path / "pendulum.toml").parameters["l"] == 2.0
    chain = lnn.System("n-pendulum", n=4)
    assert len(chain.coordinates) == 4


def test_a_system_that_depends_on_the_time_takes_times():
    lagrangian = "x_dot^2/2 - x^2/2*(1 + e*cos(2*t))"
    shaken = lnn.System(lagrangian=lagrangian, coordinates=["x"], parameters={"e": 0.5}, forces={"x": "0.3*sin(t)"})
    x, t = np.array([[0.5], [0.7]]), np.array([0.0, 1.3])
    a = shaken.acceleration(x, 0 * x, t=t)
    assert np.allclose(a[:, 0], -x[:, 0] * (1 + 0.5 * np.cos(2 * t)) + 0.3 * np.sin(t), rtol=1e-14)
    assert np.array_equal(shaken.terms(x, 0 * x, t=t).acceleration, a)
    assert np.allclose(shaken.energy(x, 0 * x, t=1.3), x[:, 0] ** 2 / 2 * (1 + 0.5 * np.cos(2.6)), rtol=1e-14)
    assert np.allclose(shaken.inverse_dynamics(x, 0 * x, a, t=t).external, 0, atol=1e-15)
    with pytest.raises(ValueError, match="time"):
        shaken.acceleration(x, 0 * x)
    with pytest.raises(ValueError, match="one time for each state"):
        shaken.acceleration(x, 0 * x, t=[1.0, 2.0, 3.0])


def test_a_system_under_constraints_moves_on_them():
    rod = {"lagrangian": "m*(x_dot^2 + y_dot^2)/2 - m*g*y", "constraints": {"rod": "x^2 + y^2 - 1"}}
    system = lnn.System("rod", coordinates=["x", "y"], parameters={"m": 1, "g": 9.8}, **rod)
    a = system.acceleration([1.0, 0.0], [0.0, 2.0])
    assert np.allclose(a, [-4.0, -9.8])
    again = pickle.loads(pickle.dumps(system))
    assert np.array_equal(again.acceleration([1.0, 0.0], [0.0, 2.0]), a)
    assert np.allclose(system.to_numpy().acceleration([1.0, 0.0], [0.0, 2.0]), a, rtol=1e-14)


def test_systems_of_the_catalogue_under_constraints():
    listed = lnn.systems()
    assert {"cartesian-chain-1", "rigid-body", "rolling-disk", "schwarzschild-by-clock"} <= listed.keys()
    chain = lnn.System("cartesian-chain-2", l=0.5)
    assert chain.coordinates == ("x1", "y1", "x2", "y2") and chain.parameters["l"] == 0.5
    assert set(chain.constraints().kinds.values()) == {"holonomic"}
    again = pickle.loads(pickle.dumps(chain))
    state = [0.0, -0.5, 0.5, -0.5], [0.5, 0.0, 0.5, 1.0]
    assert np.array_equal(again.acceleration(*state), chain.acceleration(*state)) and repr(again) == repr(chain)
    # The rods keep their lengths: x.x' = 0, x.x'' + x'.x' = 0.
    a, (q, v) = chain.acceleration(*state).reshape(2, 2), np.array(state).reshape(2, 2, 2)
    for x, dx, ddx in [(q[0], v[0], a[0]), (q[1] - q[0], v[1] - v[0], a[1] - a[0])]:
        assert abs(x @ ddx + dx @ dx) < 1e-12


def test_other_values_of_parameters():
    for system in [lnn.System("double-pendulum", m2=0.5), lnn.System(**SPRING), lnn.System.from_toml(PENDULUM, l=3)]:
        name = next(iter(system.parameters))
        other = system.with_parameters(**{name: 1 / 3})
        assert other.parameters == {**system.parameters, name: 1 / 3} and other.columns == system.columns
        assert pickle.loads(pickle.dumps(other)).parameters == other.parameters
    with pytest.raises(ValueError):
        lnn.System(**SPRING).with_parameters(mass=1)


def test_terms_have_the_shapes_of_the_states(arm):
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=(2, 3, 5, 2))
    terms = arm.terms(q, v)
    assert terms.lagrangian.shape == (3, 5) and terms.mass_matrix.shape == (3, 5, 2, 2) and terms.failures == ()
    one = arm.terms(q[1, 2], v[1, 2])
    assert one.lagrangian.shape == () and np.array_equal(one.acceleration, terms.acceleration[1, 2])
    assert np.array_equal(arm.acceleration(q, v), terms.acceleration)
    assert np.array_equal(arm.mass_matrix(q, v), terms.mass_matrix)
    assert np.allclose(arm.energy(q, v), np.sum(v * arm.momentum(q, v), -1) - arm.lagrangian(q, v))
    left = np.einsum("...ij,...j->...i", terms.mass_matrix, terms.acceleration)
    assert np.allclose(left, terms.dl_dq - terms.coriolis + terms.force)
    many = rng.normal(size=(2, 10_000, 2))
    assert np.array_equal(arm.acceleration(*many, threads=3), arm.acceleration(*many))
    # A velocity for all states.
    assert np.array_equal(arm.acceleration(q, v[0, 0]), arm.acceleration(q, np.broadcast_to(v[0, 0], q.shape)))


def test_arrays_of_any_kind_are_taken(arm):
    q, v = np.random.default_rng(1).normal(size=(2, 6, 2))
    expected = arm.acceleration(q, v)
    locked = q.copy()
    locked.flags.writeable = False
    wide = np.zeros((6, 4))
    wide[:, ::2] = q
    for other in [q.tolist(), np.asfortranarray(q), wide[:, ::2], locked, q[::-1][::-1], q.astype(">f8")]:
        assert np.array_equal(arm.acceleration(other, v), expected)
    assert np.allclose(arm.acceleration(q.astype(np.float32), v), expected, rtol=1e-4)
    assert arm.acceleration([1, 2], [0, 0]).shape == (2,) and arm.acceleration([True, False], [0, 0]).shape == (2,)

    class Other:
        def __dlpack__(self, **options):
            return q.__dlpack__(**options)

        def __dlpack_device__(self):
            return q.__dlpack_device__()

    assert np.array_equal(arm.acceleration(Other(), v), expected)
    assert arm.acceleration(np.empty((0, 2)), np.empty((0, 2))).shape == (0, 2)
    assert arm.terms(np.empty((3, 0, 2)), np.empty((3, 0, 2))).mass_matrix.shape == (3, 0, 2, 2)
    spring = lnn.System(**SPRING)
    assert spring.acceleration(0.5, 0.0) == -2.0 and spring.terms(np.float64(0.5), 0).mass_matrix.shape == (1, 1)


def test_arrays_are_taken_without_a_copy():
    from lnn._arrays import states

    q, v = np.random.default_rng(1).normal(size=(2, 6, 2))
    taken = states(q, v, 2)
    assert taken[0] is q and taken[1] is v
    assert np.shares_memory(states(q.reshape(2, 3, 2), v.reshape(2, 3, 2), 2)[0], q)


def test_what_is_huge_is_refused_or_said(arm):
    many = np.broadcast_to(0.0, (10**14, 2))
    with pytest.raises(MemoryError):
        arm.acceleration(many, many)
    terms = arm.terms([1e308, 0.0], [1e200, 0.0])
    assert np.isnan(terms.acceleration).all() and len(terms.failures) == 1
    for wrong in [
        lambda: lnn.System("n-pendulum", n=10**9),
        lambda: lnn.System(lagrangian="x_dot^2" + "+(" * 100_000, coordinates=["x"]),
        lambda: arm.rollout([0, 0], [0, 0], 1e12, 1e-9),
        lambda: arm.rollout([0, 0], [0, 0], np.inf, 0.1),
        lambda: arm.acceleration([0, 0], [0, 0], threads=10**6),
        lambda: lnn.System("kepler", mu=10**400),
        lambda: lnn.train("harmonic-oscillator", hidden=[10**9], threads=1),
        lambda: lnn.train("harmonic-oscillator", epochs=10**15, threads=1),
    ]:
        with pytest.raises((ValueError, TypeError, MemoryError)):
            wrong()


def test_a_linearization_has_the_slopes_of_the_accelerations(shipped, arm):
    q, v = np.array([[0.3, 0.2], [1.0, -0.4]]), np.array([[1.0, -1.0], [0.2, 0.5]])
    for mechanics in [arm, lnn.Model.load(shipped)]:
        found = mechanics.linearize(q, v)
        assert np.allclose(found.acceleration, mechanics.acceleration(q, v), rtol=1e-12)
        for k, moved in enumerate(1e-5 * np.eye(2)):
            by_q = (mechanics.acceleration(q + moved, v) - mechanics.acceleration(q - moved, v)) / 2e-5
            by_v = (mechanics.acceleration(q, v + moved) - mechanics.acceleration(q, v - moved)) / 2e-5
            assert np.allclose(found.by_q[..., k], by_q, rtol=1e-4, atol=1e-4)
            assert np.allclose(found.by_v[..., k], by_v, rtol=1e-4, atol=1e-4)
        assert np.allclose(found.by_force @ mechanics.mass_matrix(q, v), np.eye(2), atol=1e-6)
        pushed = mechanics.linearize(q, v, force=[0.1, 0.0])
        assert np.allclose(pushed.acceleration - found.acceleration, 0.1 * found.by_force[..., 0])
    assert arm.linearize([0.3, 0.2], [1.0, -1.0]).by_q.shape == (2, 2)
    with pytest.raises(ValueError):
        arm.linearize(q, v, force=np.zeros((3, 2)))
    with pytest.raises(ValueError, match="singular"):
        lnn.System("sphere-geodesic").linearize([0.0, 1.0], [0.1, 0.2])


def test_every_result_is_pickled(shipped, arm):
    model, sphere = lnn.Model.load(shipped), lnn.System("sphere-geodesic")
    results = [
        arm.terms([0.1, 0.2], [0.0, 1.0]),
        arm.linearize([0.1, 0.2], [0.0, 1.0]),
        arm.rollout([0.1, 0.2], [0.0, 1.0], 1.0, 0.5),
        sphere.geometry([0.5, 0.1]),
        sphere.symmetries(seed=1),
        lnn.System("cartesian-chain-1").constraints(),
        model.certify(boxes=100, threads=1),
        arm.formula(),
    ]
    for result in results:
        again = pickle.loads(pickle.dumps(result))
        assert type(again) is type(result)
        for name, value in vars(result).items():
            np.testing.assert_equal(getattr(again, name), value)


@pytest.mark.parametrize(
    "q, v, error",
    [
        ([0.0], [0.0], ValueError),
        (0.0, 0.0, ValueError),
        ([[0.0, 1.0, 2.0]], [[0.0, 1.0, 2.0]], ValueError),
        (np.zeros((3, 2)), np.zeros((4, 2)), ValueError),
        ([1j, 0], [0, 0], TypeError),
        (["a", "b"], [0, 0], TypeError),
        (None, [0, 0], TypeError),
        ([None, 1], [0, 0], TypeError),
        (np.array(["2020-01-01"] * 2, "M8[D]"), [0, 0], TypeError),
    ],
)
def test_arrays_that_are_no_states_are_refused(arm, q, v, error):
    for call in (arm.terms, arm.acceleration, lambda q, v: arm.rollout(q, v, 1, 0.1)):
        with pytest.raises(error):
            call(q, v)


def test_what_is_not_finite_is_named_and_the_rest_is_right(arm):
    q = np.array([[0.3, 0.1], [np.nan, 0.0], [0.2, np.inf]])
    terms = arm.terms(q, np.zeros((3, 2)))
    assert {row for row, _ in terms.failures} == {1, 2} and np.isnan(terms.acceleration[1:]).all()
    assert np.array_equal(terms.acceleration[0], arm.acceleration([0.3, 0.1], [0, 0]))
    flat = lnn.System(lagrangian="(x_dot + y_dot)^2", coordinates=["x", "y"])
    terms = flat.terms([1.0, 2.0], [0.5, 0.5])
    assert np.isnan(terms.acceleration).all() and "singular" in terms.failures[0][1]
    assert np.array_equal(terms.mass_matrix, [[2, 2], [2, 2]])


def test_mistakes_are_values_and_types():
    for wrong in [
        lambda: lnn.System("double-pendlum"),
        lambda: lnn.System("double-pendulum", m3=1),
        lambda: lnn.System("double-pendulum", m2=-1),
        lambda: lnn.System(lagrangian="x_dot^2 +", coordinates=["x"]),
        lambda: lnn.System(lagrangian="x_dot^2", coordinates=["x"], novelty=1),
        lambda: lnn.System.from_toml("name = "),
        lambda: lnn.Model.from_bytes(b"nothing"),
        lambda: lnn.System("double-pendulum").rollout([0, 0], [0, 0], 1, -0.0),
        lambda: lnn.System("double-pendulum").rollout([0, 0], [0, 0], 1, 0.1, method="euler"),
        lambda: lnn.System("double-pendulum").certify(region={"thta1": (0, 1)}),
        lambda: lnn.System("double-pendulum").rollout([0, 0], [0, 0], 1, 0.1, threads=0),
    ]:
        with pytest.raises(ValueError):
            wrong()
    with pytest.raises(TypeError):
        lnn.System()
    with pytest.raises(TypeError):
        lnn.System("double-pendulum", m2=object())
    with pytest.raises(OSError):
        lnn.Model.load("no such file")


def test_motion_keeps_its_energy(arm):
    motion = arm.rollout([2.0, 1.0], [0.0, 0.0], 5.0, 0.1, method="gauss6", step=0.01)
    assert motion.q.shape == (51, 2) and motion.complete and motion.t[-1] == 5.0
    assert np.ptp(motion.energy) < 1e-7 * abs(motion.energy[0])
    starts = np.array([[[2.0, 1.0], [0.5, 0.1]], [[0.2, 0.0], [1.0, 1.0]]])
    batch = arm.rollout(starts, np.zeros_like(starts), 1.0, 0.1, threads=2)
    assert batch.q.shape == (2, 2, 11, 2) and batch.energy.shape == (2, 2, 11) and batch.complete
    alone = arm.rollout(starts[1, 0], [0, 0], 1.0, 0.1)
    assert np.allclose(batch.q[1, 0], alone.q, atol=1e-12)


def test_a_motion_that_stops_says_why():
    polar = lnn.System("spring-pendulum")
    motion = polar.rollout([[1.0, 0.3], [0.0, 0.3]], [[0.1, 0.2], [0.1, 0.2]], 1.0, 0.1)
    assert motion.stop[0] is None and "t = 0" in motion.stop[1] and not motion.complete
    assert not np.isnan(motion.q[0]).any() and np.isnan(motion.q[1, 1:]).all()


def test_tables_of_motion(arm):
    pytest.importorskip("pandas")
    motion = arm.rollout([0.3, 0.1], [0.0, 0.0], 1.0, 0.5)
    frame = motion.to_pandas()
    assert list(frame.columns) == [*arm.columns, "energy"] and frame.loc[0.0, "theta1"] == 0.3
    batch = arm.rollout([[0.3, 0.1]] * 3, [[0.0, 0.0]] * 3, 1.0, 0.5).to_pandas()
    assert batch.shape == (9, 5) and batch.loc[(2, 0.0), "theta2"] == 0.1


def test_datasets_of_motion(arm):
    pytest.importorskip("xarray")
    motion = arm.rollout([0.3, 0.1], [0.0, 0.0], 1.0, 0.5)
    data = motion.to_xarray()
    assert data.sizes == {"t": 3} and set(data) == {*arm.columns, "energy"} and data.theta1.sel(t=0.0) == 0.3
    batch = arm.rollout([[0.3, 0.1]] * 4, [[0.0, 0.0]] * 4, 1.0, 0.5).to_xarray()
    assert batch.theta2.dims == ("start", "t") and np.array_equal(batch.energy.isel(start=2), motion.energy)


def test_geometry_symmetries_and_certificate(arm):
    space = lnn.System("ads4-geodesic")
    geometry = space.geometry([[0.0, 0.3, -0.2, 1.5], [0.0, 0.0, 0.0, 0.0]])
    assert np.isclose(geometry.scalar[0], -12) and geometry.signature[0].tolist() == [3, 1]
    assert geometry.riemann.shape == (2, 4, 4, 4, 4) and np.isclose(geometry.christoffel[0, 0, 0, 3], -1 / 1.5)
    assert np.isnan(geometry.scalar[1]) and geometry.failures[0][0] == 1
    sphere = lnn.System("sphere-geodesic").symmetries(seed=1)
    assert sphere.count == 3 and sphere.name == "so(3)" and "d_phi" in sphere.fields
    assert sphere.structure_constants.shape == (3, 3, 3) and sphere.time_translation
    proof = arm.certify(region={"theta1_dot": (-1, 1)}, boxes=20_000, threads=1)
    assert proof.certified == 1.0 and proof.signature == (2, 0)


def test_models_are_files_and_pickles(shipped, tmp_path):
    model = lnn.Model.load(shipped)
    model.save(tmp_path / "copy.safetensors")
    assert (tmp_path / "copy.safetensors").read_bytes() == shipped.read_bytes() == model.to_bytes()
    states = np.random.default_rng(2).normal(size=(2, 7, 2))
    for other in [pickle.loads(pickle.dumps(model)), lnn.Model.load(tmp_path / "copy.safetensors")]:
        assert np.array_equal(other.acceleration(*states), model.acceleration(*states))
    assert "double-pendulum" in repr(model) and model.header["system"] == "double-pendulum"
    for system in [lnn.System("double-pendulum", m2="0.5"), lnn.System(**SPRING), lnn.System.from_toml(PENDULUM, l=3)]:
        again = pickle.loads(pickle.dumps(system))
        assert again.parameters == system.parameters and repr(again) == repr(system)
    motion = model.rollout([0.3, 0.1], [0, 0], 1, 0.5)
    again = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(again.q, motion.q) and again.columns == motion.columns


def learned_loss(seed):
    states = {"data.training": 256, "data.validation": 64, "data.test": 64, "optimizer.batch": 32}
    return lnn.train("harmonic-oscillator", hidden=[8], epochs=2, threads=2, starts=1, seed=seed, config=states).summary["validation_loss"]


def test_trainings_run_side_by_side_in_threads_and_in_forks():
    """A process that has trained already forks, and its children train."""
    alone = [learned_loss(seed) for seed in range(2)]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(learned_loss, range(2))) == alone
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as pool:
        assert [run.result(timeout=60) for run in [pool.submit(learned_loss, seed) for seed in range(2)]] == alone


def energy_of(model_and_start):
    model, start = model_and_start
    return float(model.rollout(start, [0.0, 0.0], 0.5, 0.1).energy[-1])


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_models_work_in_other_processes(shipped, method):
    model = lnn.Model.load(shipped)
    model.acceleration([0.1, 0.2], [0.0, 0.0])
    tasks = [(model, [0.1 * k, 0.2]) for k in range(3)]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(method)) as pool:
        assert list(pool.map(energy_of, tasks)) == [energy_of(task) for task in tasks]


def test_models_work_in_threads_and_let_others_run(shipped):
    model = lnn.Model.load(shipped)
    states = np.random.default_rng(3).normal(size=(2, 20_000, 2))
    expected = model.acceleration(*states)
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1

    counter = threading.Thread(target=count)
    counter.start()
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda _: model.acceleration(*states), range(3)))
    stop.set()
    counter.join()
    assert all(np.array_equal(a, expected) for a in found) and counted[0] > 1000


def test_the_package_is_imported_without_what_it_does_not_need():
    code = "import lnn, sys; print([m for m in ('numpy', 'jax', 'torch', 'pandas', 'sklearn', 'lnn._lnn') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
    assert set(dir(lnn)) >= set(lnn.__all__)
    with pytest.raises(AttributeError):
        lnn.nothing


def test_a_model_is_judged(shipped):
    judged = lnn.Model.load(shipped).evaluate(starts=1, threads=2)
    assert judged["wrong_signature"] < 0.05 and len(judged["accelerations"]) == 2
    json.dumps(judged)
    with pytest.raises(ValueError):
        lnn.Model.load(shipped).evaluate(lnn.System("kepler"))


def test_stubs_have_what_the_extension_has():
    import ast
    from pathlib import Path

    from lnn import _lnn

    tree = ast.parse((Path(lnn.__file__).parent / "_lnn.pyi").read_text())
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    (subject,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
    methods = {node.name for node in subject.body if isinstance(node, ast.FunctionDef)}
    public = lambda thing: {name for name in dir(thing) if not name.startswith("_")}
    assert functions | {"Subject"} == public(_lnn) and methods == public(_lnn.Subject)


def test_what_knows_free_coordinates_alone_refuses_constraints(models):
    for moves in [lnn.System("cartesian-chain-1"), lnn.Model.from_bytes(models["under constraints"].to_bytes())]:
        n = len(moves.coordinates)
        refused = "^the motion has constraints, which this command does not support; see `lnn constraints`$"
        for call in [moves.certify, moves.symmetries, moves.formula, lambda: moves.geometry([0.5] * n)]:
            with pytest.raises(ValueError, match=refused):
                call()


def test_a_driven_system_moves_in_time_and_has_no_states() -> None:
    text = """
name = "driven-spring"
lagrangian = "x_dot^2/2 - k*x^2/2"
coordinates = [{ name = "x", bounds = [-3, 3], velocity_bounds = [-5, 5] }]
parameters = { k = 4, F = 0.7, om = 1.3 }
forces = { x = "F*cos(om*t)" }
"""
    spring = lnn.System.from_toml(text)
    motion = spring.rollout([0.0], [0.0], t_end=8.0, dt=0.05, rtol=1e-10, atol=1e-12)
    exact = 0.7 / (4 - 1.3**2) * (np.cos(1.3 * motion.t) - np.cos(2 * motion.t))
    assert np.allclose(motion.q[:, 0], exact, atol=1e-7)
    beside = spring.rollout([0.0], [0.0], t_end=8.0, dt=0.05, force=lambda t, q, v: -0.7 * np.cos(1.3 * t))
    assert np.allclose(beside.q, 0.0, atol=1e-6)
    with pytest.raises(ValueError, match="time t"):
        spring.acceleration([0.0], [0.0])


def test_inputs_drive_and_are_read():
    text = """
name = "motor"
lagrangian = "J*theta_dot^2/2"
dissipation = "b*theta_dot^2/2"
coordinates = [{ name = "theta", bounds = [-9, 9], velocity_bounds = [-20, 20] }]
parameters = { J = 0.02, b = { default = 0.01, learn = true }, K = { default = 0.1, learn = true } }
inputs = { u = "V" }
forces = { theta = "K*u" }
"""
    motor = lnn.System.from_toml(text)
    assert motor.inputs == ("u",) and lnn.System("kepler").inputs == ()
    steady = motor.rollout([0.0], [0.0], t_end=3.0, dt=0.1, inputs=[2.0], rtol=1e-10, atol=1e-12)
    assert np.allclose(motor.rollout([0.0], [0.0], t_end=3.0, dt=0.1, inputs=lambda t: 2.0).q, steady.q, atol=1e-4)
    # J v' = K u - b v
    assert np.allclose(steady.v[:, 0], 20.0 * (1.0 - np.exp(-0.5 * steady.t)), atol=1e-6)
    with pytest.raises(ValueError, match="inputs: expected values of u"):
        motor.rollout([0.0], [0.0], t_end=1.0, dt=0.1)
    with pytest.raises(ValueError, match="has none"):
        lnn.System("kepler").rollout([1.0, 0.0], [0.0, 1.0], t_end=1.0, dt=0.1, inputs=[1.0])
    t = np.linspace(0.0, 8.0, 401)
    u = 3.0 * np.sin(1.7 * t) + np.sin(4.0 * t)
    real = lnn.System.from_toml(text, K=0.13, b=0.015)
    motion = real.rollout([0.0], [0.0], t_end=8.0, dt=0.02, inputs=(t, u), rtol=1e-10, atol=1e-12)
    noisy = motion.q + 1e-3 * np.random.default_rng(0).standard_normal(motion.q.shape)
    found = lnn.identify(noisy, motor, dt=0.02, inputs=u[:, None])
    assert found.explained
    for name, truth in (("K", 0.13), ("b", 0.015)):
        constant = found.constants[name]
        assert abs(constant.value - truth) < 5 * constant.standard_error
    with pytest.raises(ValueError, match="inputs"):
        lnn.identify(noisy, motor, dt=0.02)


def test_events_of_a_system_come_with_its_motion():
    ground = {"when": "y", "falling": True, "then": {"restitution": "e"}}
    apex = {"when": "y_dot", "falling": True}
    ball = lnn.System(
        lagrangian="y_dot^2/2 - g*y", coordinates=["y"], parameters={"g": 9.81, "e": 0.8}, events={"ground": ground, "apex": apex}
    )
    motion = ball.rollout([1.0], [0.0], 1.5, 0.01)
    fall = np.sqrt(2 / 9.81)
    assert [event.name for event in motion.events] == ["ground", "apex", "ground", "apex", "ground"][: len(motion.events)]
    hit, top = motion.events[:2]
    assert abs(hit.t - fall) < 1e-10 and abs(top.t - 1.8 * fall) < 1e-10 and abs(top.q[0] - 0.64) < 1e-10
    assert np.allclose(hit.v, -0.8 * hit.v_before) and top.v_before is None
    assert abs(hit.energy_before - hit.energy_after - 0.36 * 9.81) < 1e-9
    both = ball.rollout([[1.0], [2.0]], [[0.0], [0.0]], 1.5, 0.01)
    assert both.events.shape == (2,) and abs(both.events[1][0].t - np.sqrt(2) * fall) < 1e-10
    assert pickle.loads(pickle.dumps(ball)).rollout([1.0], [0.0], 1.5, 0.01).events[0].t == hit.t
    ended = ball.rollout([1.0], [0.0], 10, 0.1)
    assert not ended.complete and "accumulate" in ended.stop


def test_robots_are_read_and_written_back(tmp_path):
    path = ROOT / "examples/systems/picker.urdf"
    with pytest.warns(UserWarning, match="<transmission>"):
        robot = lnn.System.from_robot(path)
    assert robot.coordinates == ("turn", "lift", "grip")
    with pytest.warns(UserWarning):
        light = lnn.System.from_robot(path.read_text(), mx2=0.2)
    states = [[0.1, 0.5, 0.01], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    torque = robot.inverse_dynamics(*states).external
    assert torque[1] != light.inverse_dynamics(*states).external[1] and torque[0] == pytest.approx(0, abs=1e-12)
    # What is found goes into the file, and nothing else of it changes.
    rng = np.random.default_rng(0)
    t = np.arange(0, 4, 0.01)
    rates = rng.uniform(1, 4, (3, 3))
    phases = rng.uniform(0, 6, (3, 3))
    size = np.array([0.3, 0.3, 0.01])[:, None, None] / rates[..., None]
    angle = rates[..., None] * t + phases[..., None]
    q = (size * np.sin(angle)).sum(1).T
    v = (size * rates[..., None] * np.cos(angle)).sum(1).T
    a = (-size * rates[..., None] ** 2 * np.sin(angle)).sum(1).T
    force = light.inverse_dynamics(q, v, a).external
    noisy = [x + scale * rng.normal(size=x.shape) for x, scale in [(q, 1e-5), (force, 1e-3)]]
    found = lnn.identify(noisy[0], robot, force=noisy[1], dt=0.01)
    assert found.bodies.exist and found.explained
    written = found.urdf(path)
    numbers = ("<inertia ", "<mass ", "<dynamics", "<origin ")
    kept, before = ([line for line in text.splitlines() if not any(tag in line for tag in numbers)] for text in (written, path.read_text()))
    assert written != path.read_text() and kept == before
    with pytest.warns(UserWarning):
        again = lnn.System.from_robot(written)
    left = again.inverse_dynamics(q, v, a).external - force
    assert np.abs(left).max() < 0.02 * np.abs(force).max()
    with pytest.raises(ValueError, match="line 2"):
        lnn.System.from_robot("<robot>\n<link/></robot>")

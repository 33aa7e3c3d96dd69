"""Constraints and formulas, of motion and of models."""

import os
import pickle
import signal
import threading

import numpy as np
import pytest

import lnn

ROD = {
    "lagrangian": "m*(x_dot^2 + y_dot^2)/2 - m*g*y",
    "coordinates": {"x": {"bounds": (-1, 1)}, "y": {"bounds": (-1, 1)}},
    "parameters": {"m": 1, "g": 9.8},
    "constraints": {"rod": "x^2 + y^2 - 1"},
}


def swings(count=6, t_end=3.0):
    """Motions of a pendulum with g / l = 4, as angles."""
    system = lnn.System(lagrangian="a_dot^2/2 + 4*cos(a)", coordinates={"a": {"periodic": True}})
    starts = np.linspace(0.5, 2.5, count)[:, None]
    return system.rollout(starts, np.zeros_like(starts), t_end, 0.02, rtol=1e-10, atol=1e-12)


def test_the_constraint_of_a_rod_is_found_in_its_motion():
    motion = swings()
    tracks = [np.hstack([np.sin(q), -np.cos(q)]) for q in motion.q]
    found = lnn.find_constraints(tracks, coordinates=["x", "y"], dt=0.02)
    assert found.count == 1 and found.constraints[0].kind == "holonomic" and found.trajectories == len(tracks)
    # As a system's own.
    system = lnn.System("rod", **{**ROD, "constraints": found.formulas})
    a = system.acceleration([1.0, 0.0], [0.0, 2.0])
    assert np.allclose(a, lnn.System("rod", **ROD).acceleration([1.0, 0.0], [0.0, 2.0]), atol=1e-3)
    assert pickle.loads(pickle.dumps(found)).formulas == found.formulas
    for wrong in [{"degree": 0}, {"degree": 9}, {"velocity_degree": 9}, {"dt": None}]:
        with pytest.raises(ValueError):
            lnn.find_constraints(tracks, **{"coordinates": ["x", "y"], "dt": 0.02, **wrong})


def test_constraints_of_a_system_are_named():
    own = lnn.System("rod", **ROD).constraints()
    assert own.formulas == {"rod": "x^2 + y^2 - 1"} and own.kinds == {"rod": "holonomic"} and own.signature == (1, 0)
    assert own.null_directions.shape == (0, 2) and own.states > 0 == own.open_states
    flat = lnn.System(lagrangian="(x_dot + y_dot)^2", coordinates=["x", "y"]).constraints()
    assert flat.formulas == {} and flat.open_states == flat.states
    assert np.allclose(np.abs(flat.null_directions), np.sqrt(0.5))


@pytest.fixture(scope="module")
def pendulum():
    motion = swings()
    return lnn.formula(list(motion.q), coordinates=["a"], angles=["a"], dt=0.02, bootstraps=4, threads=2)


def test_the_formula_of_motion(pendulum):
    assert pendulum.verdict == "found" and pendulum.terms == ("a_dot^2", "cos(a)")
    assert np.allclose(pendulum.coefficients, [0.5, 4.0], rtol=1e-3) and pendulum.standard_errors[0] == 0
    assert not pendulum.dissipative.any() and pendulum.probabilities.shape == (2,) and pendulum.dissipation == "0"
    assert r"\cos" in pendulum.latex() and pendulum.latex(dissipation=True) == "0" and "struct" in pendulum.rust
    system = pendulum.system()
    assert np.allclose(system.acceleration([0.3], [0.0]), -4 * np.sin(0.3), rtol=1e-3)
    assert pickle.loads(pickle.dumps(pendulum)).lagrangian == pendulum.lagrangian


def test_angles_that_jump_by_a_turn_are_the_same_motion(pendulum):
    motion = swings()
    jumping = [np.remainder(q, 2 * np.pi) for q in motion.q]
    assert max(np.abs(np.diff(q, axis=0)).max() for q in jumping) > 6
    choices = {"coordinates": ["a"], "angles": ["a"], "dt": 0.02, "bootstraps": 4}
    again = lnn.formula(jumping, **choices)
    assert again.terms == pendulum.terms and np.allclose(again.coefficients, pendulum.coefficients, rtol=1e-5)


def test_a_formula_is_an_expression_of_sympy(pendulum):
    sympy = pytest.importorskip("sympy")
    a, v = sympy.symbols("a a_dot", real=True)
    expression = pendulum.sympy()
    assert expression.free_symbols == {a, v} and pendulum.sympy(dissipation=True) == 0
    value = expression.subs({a: 0.7, v: -1.1})
    assert np.isclose(float(value), pendulum.system().lagrangian([0.7], [-1.1]), rtol=1e-6)


def test_every_function_of_a_formula_is_one_of_sympy():
    sympy = pytest.importorskip("sympy")
    from lnn.reader.sympy_functions import expression

    text = (
        "sqrt(x) + exp(x) + expm1(x) + ln(x) + ln1p(x) + sin(x) + cos(x) + tan(x) + asin(x) + acos(x) + atan(x) + sinh(x) + cosh(x)"
        " + tanh(x) + erfc(x) + logistic(x) + softplus(x) + abs(-x) + recip(x) + atan2(x, 2) + max(x, pi) + min(x, 0.5) + x^2.5 + x^-2"
    )
    system = lnn.System(lagrangian=f"x_dot^2 + {text}", coordinates=["x"])
    value = expression([(1.0, text)]).subs({sympy.Symbol("x", real=True): 0.3})
    assert np.isclose(float(value), system.lagrangian([0.3], [0.0]), rtol=1e-12)


def test_the_formula_of_a_system_and_of_a_model(shipped):
    arm = lnn.System("double-pendulum").formula()
    assert arm.verdict == "found" and len(arm.terms) == 5 and arm.residual < 1e-6
    learned = lnn.Model.load(shipped).formula(seed=1)
    assert set(learned.terms) == set(arm.terms) and learned.residual > arm.residual


def test_the_friction_of_recorded_motion_is_found(shipped):
    columns = {"coordinates": ["theta1", "theta2"], "angles": ["theta1", "theta2"], "trajectory": "run"}
    found = lnn.formula(shipped.parent / "pendulum.csv", **columns, friction=True, bootstraps=2)
    assert found.dissipative.sum() == 3 and found.dissipation != "0" and len(found.noise) == 2


def test_mistakes_are_values():
    motion = list(swings(2).q)
    for wrong in [
        {"basis": "polynomial"},
        {"basis": "polynomial:99"},
        {"functions": ["exp("]},
        {"noise": [0.0]},
        {"noise": [0.1, 0.1]},
        {"scale": ("a_dot^2", 0.0)},
        {"scale": ("nothing", 1.0)},
        {"bootstraps": 0},
        {"threads": 0},
    ]:
        with pytest.raises(ValueError):
            lnn.formula(motion, **{"coordinates": ["a"], "angles": ["a"], "dt": 0.02, "bootstraps": 1, **wrong})


def test_pictures_go_into_axes_that_are_given(shipped):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    model = lnn.Model.load(shipped)
    motion = model.rollout([[0.3, 0.1], [0.2, 0.1]], np.zeros((2, 2)), 1.0, 0.1)
    assert motion.plot(ax=ax, color="red") is ax and len(ax.lines) == 2 and ax.get_ylabel() == "theta1"
    assert motion.plot("energy").get_ylabel() == "energy" and len(pyplot.get_fignums()) == 2
    with pytest.raises(ValueError):
        motion.plot("nothing", ax=ax)
    sphere = lnn.System("sphere-geodesic").symmetries(seed=1)
    assert sphere.plot(ax=pyplot.subplots()[1]).get_yscale() == "log"
    pyplot.close("all")


@pytest.fixture(scope="module")
def swung():
    """A pendulum of 0.7 m and 1 kg with a little noise, two swings."""
    truth = lnn.System("n-pendulum", n=1, l=0.7, m=1.5)
    motion = truth.rollout([[1.0], [0.4]], [[0.0], [0.5]], 6.0, 0.02, rtol=1e-10, atol=1e-12)
    return [q + np.random.default_rng(k).normal(0, 1e-3, q.shape) for k, q in enumerate(motion.q)]


def test_constants_of_a_known_form_are_identified(swung):
    form = lnn.System("n-pendulum", n=1)
    found = lnn.identify(swung, form, constants=["l"], dt=0.02, threads=2)
    length = found.constants["l"]
    assert abs(length.value - 0.7) <= 4 * length.standard_error < 1e-3 and length.unit == "m" and length.start == 1.0
    assert found.explained and found.undetermined == () and found.outlier_count == 0 and found.between is None
    (residual,) = found.residuals.values()
    assert np.isclose(residual.rms, 1e-3, rtol=0.2) and residual.white
    assert found.correlations.shape == (1, 1) and found.samples == 602
    shown, table = str(found), found._repr_html_()
    assert "0.7" in shown and "residual" in shown and table.count("<table>") == 2 and str(pickle.loads(pickle.dumps(found))) == shown
    system = found.system()
    assert system.parameters == {**form.parameters, "l": length.value}
    assert system.acceleration([0.3], [0.0]) == lnn.System("n-pendulum", n=1, l=length.value).acceleration([0.3], [0.0])
    again = pickle.loads(pickle.dumps(found))
    assert again.constants == found.constants and again.system().parameters == system.parameters
    again = lnn.identify(swung, form, constants=["l"], dt=0.02, threads=1, by_trajectory=True)
    assert again.constants == found.constants and found.by_trajectory is None
    # Both swings alone say the same.
    (scatter,) = again.by_trajectory.scatter
    assert scatter.symbol == "l" and scatter.count == 2 and not scatter.differs and abs(scatter.mean - 0.7) < 1e-3
    assert [alone.explained for alone in again.by_trajectory.trajectories] == [True, True] and "l" in again.by_trajectory.trajectories[0].constants


def test_what_motion_leaves_open_is_said_with_its_cure(swung):
    found = lnn.identify(swung, lnn.System("n-pendulum", n=1), dt=0.02)
    open_ones = [direction for direction in found.undetermined if set(direction.constants) >= {"l", "g"}]
    assert len(open_ones) == 1 and open_ones[0].directions.shape == (1, len(open_ones[0].constants))
    (known,) = open_ones[0].known.values()
    assert known.terms in ({"g": 1, "l": -1}, {"l": 1, "g": -1}) and known.product
    truth = 9.8 ** known.terms["g"] * 0.7 ** known.terms["l"]
    assert abs(known.value - truth) < 4 * known.standard_error < 1e-2 * truth
    assert open_ones[0].text and open_ones[0].advice
    mass = [direction for direction in found.undetermined if direction.constants == ("m",)]
    assert len(mass) == 1 and found.constants["m"].standard_error is None and found.constants["m"].value == 1.0


def test_sensors_outliers_and_files_are_identified(swung, shipped, tmp_path):
    form = lnn.System("n-pendulum", n=1)
    off = [0.05 + q for q in swung]
    off[1][100] += 0.2
    found = lnn.identify(off, form, constants=["l"], offsets=["theta"], robust=True, dt=0.02)
    (offset,) = found.sensors
    assert offset.kind == "offset" and abs(offset.value - 0.05) < 5e-4
    assert found.outliers[0].trajectory == "trajectory 2" and found.outliers[0].row == 101 and found.outliers[0].size > 10
    assert found.correlations.shape == (2, 2)
    path = tmp_path / "swing.csv"
    rows = [f"{0.02 * k},{q[0]}" for k, q in enumerate(off[1])]
    path.write_text("\n".join(["t,angle", *rows]) + "\n")
    of_file = lnn.identify(path, form, constants=["l"], coordinates=["angle"], offsets=["angle"], robust=True)
    assert of_file.outliers[0].row == 102 and "swing" in of_file.outliers[0].trajectory
    pandas = pytest.importorskip("pandas")
    assert list(found.to_pandas().index) == ["l"]
    frame = pandas.DataFrame({"t": 0.02 * np.arange(len(swung[0])), "theta": swung[0][:, 0]})
    assert abs(lnn.identify(frame, form, constants=["l"]).constants["l"].value - 0.7) < 1e-3
    columns = {"coordinates": ["theta1", "theta2"], "trajectory": "run"}
    pendula = lnn.System.from_toml(shipped.parents[1] / "systems/damped_pendula.toml")
    arm = lnn.identify(shipped.parent / "pendulum.csv", pendula, **columns)
    assert abs(arm.constants["l1"].value - 1) < 0.01 and arm.explained


def test_forces_tell_the_sums_of_the_constants_of_a_chain():
    rows = "name = 'elbow'\n[[links]]\nalpha = 'pi/2'\n[[links]]\na = 0.4\n"
    masses = {"m1": 2.0, "mx1": 0.6, "Izz1": 0.3, "m2": 1.0, "mx2": 0.2, "Izz2": 0.09}
    arm = lnn.System.from_toml(rows, **masses)
    t = np.arange(0.0, 6.0, 0.01)[:, None]
    q = np.hstack([np.sin(2 * t) + 0.3 * np.cos(5 * t), np.cos(3 * t) - 0.4 * np.sin(4 * t)])
    v = np.hstack([2 * np.cos(2 * t) - 1.5 * np.sin(5 * t), -3 * np.sin(3 * t) - 1.6 * np.cos(4 * t)])
    a = np.hstack([-4 * np.sin(2 * t) - 7.5 * np.cos(5 * t), -9 * np.cos(3 * t) + 6.4 * np.sin(4 * t)])
    terms = arm.terms(q, v)
    force = np.einsum("kij,kj->ki", terms.mass_matrix, a) + terms.coriolis - terms.dl_dq
    noise = np.random.default_rng(0).normal(0, 0.02, force.shape)
    found = lnn.identify(q, lnn.System.from_toml(rows), force=force + noise, dt=0.01)
    assert found.segments == 0 and found.undetermined and "m1" in found.undetermined[0].constants
    truth = {**lnn.System.from_toml(rows, **masses).parameters}
    assert any(len(one.terms) > 1 for one in found.combinations)
    for one in found.combinations:
        exact = sum(factor * truth[symbol] for symbol, factor in one.terms.items())
        assert abs(one.value - exact) < 5 * one.standard_error + 1e-6, one
    assert all(residual.rms < 0.03 < residual.spread for residual in found.residuals.values())
    with pytest.raises(ValueError, match="targets"):
        lnn.identify(q, lnn.System.from_toml(rows), targets="forces", dt=0.01)


def test_ctrl_c_is_raised_when_a_reading_has_ended(swung):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    pressing = threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT])
    pressing.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            for _ in range(100):
                lnn.identify(swung, lnn.System("n-pendulum", n=1), dt=0.02, threads=1)
        pressing.join()
    finally:
        signal.signal(signal.SIGINT, before)


def test_mistakes_of_an_identification_are_values(swung):
    form = lnn.System("n-pendulum", n=1)
    for wrong in [
        {"constants": ["length"]},
        {"constants": ["l", "l"]},
        {"offsets": ["theta7"]},
        {"between": "quintic"},
        {"segment": 0.0},
        {"noise": [1.0, 1.0]},
        {"noise": [-1.0]},
        {"threads": 0},
        {"dt": None},
    ]:
        with pytest.raises(ValueError):
            lnn.identify(swung, form, **{"constants": ["l"], "dt": 0.02, **wrong})
    with pytest.raises(ValueError, match="recorded state"):
        lnn.identify(np.zeros((100, 2)), "cartesian-chain-1", dt=0.02)
    with pytest.raises(ValueError):
        lnn.identify(swung, "double-pendulum", dt=0.02)
    with pytest.raises(ValueError):
        lnn.identify([swung[0][:5]], form, constants=["l"], dt=0.02)


def test_measured_quantities_take_the_place_of_coordinates():
    text = """
name = "watched"
lagrangian = "theta_dot^2/2 + w*cos(theta)"
parameters = { w = { default = 8, learn = true }, far = { default = 2.2, learn = true } }
measured = { range = "sqrt(far^2 + 1 - 2*far*cos(theta))" }
coordinates = [{ name = "theta", periodic = true, velocity_bounds = [-4, 4] }]
"""
    form = lnn.System.from_toml(text)
    assert tuple(form.measured) == ("range",)
    motion = form.with_parameters(w=9.81, far=2).rollout([1.0], [0.3], 8.0, 0.02)
    noise = 1e-3 * np.random.default_rng(0).normal(size=len(motion.t))
    reading = np.sqrt(5 - 4 * np.cos(motion.q[:, 0])) + noise
    for data in [reading[:, None], {"range": reading, "t": motion.t}]:
        found = lnn.identify(data, form, **({} if isinstance(data, dict) else {"dt": 0.02}))
        assert found.explained
        for name, truth in [("w", 9.81), ("far", 2.0)]:
            constant = found.constants[name]
            assert abs(constant.value - truth) < 4 * constant.standard_error < 0.04
    with pytest.raises(ValueError, match="range"):
        lnn.identify({"distance": reading, "t": motion.t}, form)

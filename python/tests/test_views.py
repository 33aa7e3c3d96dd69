"""Comparisons, surfaces, shadows, sweeps; a first look at recorded motion; units; the table of commands."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import lnn

ROOT = Path(__file__).parents[2]


def test_lagrangians_are_compared_up_to_factor_and_gauge():
    one = lnn.System(lagrangian="x_dot^2/2 - x^2/2", coordinates=["x"])
    other = lnn.System(lagrangian="3*x_dot^2/2 - 3*x^2/2 + x*x_dot", coordinates=["x"])
    found = lnn.compare(other, one, basis="polynomial:2")
    assert np.allclose(found.factors, [3.0]) and found.motion < 1e-9 and found.lagrangian < 1e-6 and "x^2" in found.gauge_formula
    assert "quantity" in str(found) and "<table>" in found._repr_html_() and str(pickle.loads(pickle.dumps(found))) == str(found)
    assert lnn.compare("kepler", lnn.System("kepler", mu=2)).motion > 0.1
    for wrong in [("kepler", "ads4-geodesic"), (one, lnn.System("cartesian-chain-1"))]:
        with pytest.raises(ValueError):
            lnn.compare(*wrong)
    with pytest.raises(ValueError, match="basis"):
        lnn.compare(one, one, basis="polynomial:99999")


def test_a_model_is_compared_with_its_system(shipped):
    found = lnn.compare(lnn.Model.load(shipped), "double-pendulum", points=300)
    assert found.motion < 0.2 and found.points == 300 and found.second == "double-pendulum"


def test_the_horizon_of_a_black_hole_is_found():
    hole = lnn.System("schwarzschild-geodesic")
    start, end = np.zeros(4), np.zeros(4)
    place = hole.coordinates.index("r")
    for point, r in (start, 1.1), (end, 5.0):
        point[hole.coordinates.index("theta")] = 1.5
        point[place] = r
    (surface,) = hole.surfaces(["t"], start, end)
    assert np.isclose(surface.point["r"], 2 * hole.parameters.get("M", 1.0)) and surface.change == "zero"
    for wrong in [{"block": ["u"]}, {"block": ["t", "t"]}, {"start": start[:2]}, {"steps": 0}]:
        with pytest.raises(ValueError):
            hole.surfaces(**{"block": ["t"], "start": start, "end": end, **wrong})


def test_a_wormhole_has_a_second_sky():
    system = lnn.System.from_toml(ROOT / "examples/systems/wormhole.toml")
    found = lnn.shadow(system, distance=3.0, inclination=75.0, width=24, edges=8, threads=1)
    view = found.views["exact"]
    assert view.second_share > 0.05 and view.throat_radius > 5.0


def test_the_shadow_of_a_black_hole_has_its_size():
    events = []
    found = lnn.shadow("schwarzschild-cartesian", width=24, edges=8, threads=1, progress=lambda *event: events.append(event))
    assert found.image.shape == (24, 24, 3) and found.image.dtype == np.uint8 and (found.image[12, 12] == 0).all()
    view = found.views["exact"]
    assert np.isclose(view.right, 27**0.5, rtol=1e-4) and np.isclose(view.left, -view.right, rtol=1e-4) and 0 < view.share < 1
    assert found.difference is None and "shadow" in str(found) and "<table>" in found._repr_html_()
    assert events and str(pickle.loads(pickle.dumps(found))) == str(found)
    for wrong in [{"time": "x"}, {"space": ["x", "y"]}, {"width": 2**14}, {"observer": "flies"}, {"tolerance": 1.0}, {"edges": 5000}]:
        with pytest.raises(ValueError):
            lnn.shadow("schwarzschild-cartesian", **{"height": 2**11, "width": 4, **wrong})
    with pytest.raises(ValueError, match="system"):
        lnn.shadow()


def test_a_sweep_trains_every_combination_once(tmp_path):
    states = {"data.training": 64, "data.validation": 16, "data.test": 16, "network.hidden": [4]}
    choices = {"out": tmp_path / "sweep", "epochs": 1, "threads": 2, "config": states}
    swept = lnn.sweep("harmonic-oscillator", {"optimizer.batch": [16, 32]}, seeds=2, **choices)
    assert swept.finished == 4 and len(swept.rows) == 2 and "16" in str(swept)
    assert (tmp_path / "sweep/report.html").exists()
    records = sorted((tmp_path / "sweep").glob("*/record.json"))
    written = [record.stat().st_mtime_ns for record in records]
    again = lnn.sweep("harmonic-oscillator", {"optimizer.batch": [16, 32]}, seeds=2, **choices)
    assert again.rows == swept.rows and [record.stat().st_mtime_ns for record in records] == written and len(records) == 4
    with pytest.raises(FileExistsError):
        lnn.sweep("harmonic-oscillator", {"optimizer.batch": [16, 32]}, seeds=2, **{**choices, "epochs": 2})
    for wrong in [{"optimizer.batch": []}, {"optimizer.batch": [16, 16]}, {"optimizer.novelty": [1]}]:
        with pytest.raises(ValueError):
            lnn.sweep("harmonic-oscillator", wrong, **choices)


def swing(samples=400):
    t = 0.02 * np.arange(samples)
    return t, 0.5 * np.sin(3 * t)[:, None]


def test_recorded_motion_is_looked_at_before_it_is_learned_from(tmp_path, shipped):
    t, x = swing()
    found = lnn.check(x, coordinates=["x"], t=t)
    assert found.samples == 400 and np.isclose(found.step, 0.02) and found.obstacle is None and set(found.coordinates) == {"x"}
    assert found.next == "formula" and found.formula and found.call == 'lnn.formula(data, coordinates=["x"])'
    assert "next:" in str(found) and "<table>" in found._repr_html_() and pickle.loads(pickle.dumps(found)).call == found.call
    # Columns of files are guessed; the call that is advised runs.
    path = tmp_path / "swing.csv"
    path.write_text("t,x\n" + "".join(f"{a},{b[0]}\n" for a, b in zip(t, x)))
    of_file = lnn.check(path)
    assert of_file.call == f'lnn.formula("{path}", coordinates=["x"])' and "taken as" in str(of_file)
    assert eval(of_file.call, {"lnn": lnn}).verdict == "found"
    pandas = pytest.importorskip("pandas")
    assert lnn.check(pandas.DataFrame({"t": t, "x": x[:, 0]}), coordinates=["x"]).formula == found.formula
    rods = lnn.check([np.hstack([np.sin(x), -np.cos(x)])], coordinates=["x", "y"], dt=0.02)
    assert rods.next == "fit-constrained" and rods.constraints and 'constraints="find"' in rods.call
    pendula = lnn.check(shipped.parent / "pendulum.csv", coordinates=["theta1", "theta2"], trajectory="run")
    assert pendula.trajectories > 1 and pendula.facts["samples"] == pendula.samples


def test_units_are_those_of_the_columns(tmp_path):
    """The same motion in degrees and milliseconds, from arrays, a DataFrame and a file."""
    form = lnn.System("n-pendulum", n=1)
    motion = lnn.System("n-pendulum", n=1, l=0.7).rollout([1.0], [0.0], 6.0, 0.02, rtol=1e-10, atol=1e-12)
    t, theta = 1000 * motion.t, np.degrees(motion.q)
    usual = lnn.identify(motion.q, form, constants=["l"], t=motion.t).constants["l"].value
    units = {"theta": "deg", "t": "ms"}
    arrays = lnn.identify(theta, form, constants=["l"], t=t, units=units)
    by_factor = lnn.identify(theta, form, constants=["l"], dt=0.02, units={"theta": np.pi / 180})
    path = tmp_path / "swing.csv"
    path.write_text("t,theta\n" + "".join(f"{float(a)!r},{float(b)!r}\n" for a, b in zip(t, theta[:, 0])))
    of_file = lnn.identify(path, form, constants=["l"], units=units)
    for found in arrays, by_factor, of_file:
        assert np.isclose(found.constants["l"].value, usual, rtol=1e-6)
    measured = lnn.check(theta, coordinates=["theta"], t=t, v=np.degrees(motion.v), units={**units, "theta_dot": "deg/s"})
    plain = lnn.check(motion.q, coordinates=["theta"], t=motion.t, v=motion.v)
    assert np.isclose(measured.coordinates["theta"]["velocity"], plain.coordinates["theta"]["velocity"], rtol=1e-6)
    assert np.isclose(lnn.check(theta, coordinates=["theta"], t=t, units=units).step, 0.02)
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"t": t, "theta": theta[:, 0], "rate": np.degrees(motion.v[:, 0])})
    more = {"v": ["rate"], "units": {**units, "rate": "deg/s"}}
    assert np.isclose(lnn.identify(frame, form, constants=["l"], **more).constants["l"].value, usual, rtol=1e-6)
    for wrong in [{"theta": "degrees"}, {"phi": "deg"}, {"theta": 0}]:
        with pytest.raises(ValueError, match="units"):
            lnn.identify(theta, form, constants=["l"], dt=0.02, units=wrong)
    with pytest.raises(ValueError, match="units"):
        lnn.identify(path, form, constants=["l"], units={"phi": "deg"})
    with pytest.raises(TypeError, match="units"):
        lnn.identify(path, form, constants=["l"], columns={"units": units})


def test_a_fit_finds_a_formula_on_demand():
    _, x = swing()
    learned = lnn.fit([x, 0.5 * x, 0.8 * x], dt=0.02, hidden=[4], epochs=1, threads=1, formula=True)
    assert learned.summary["formula"]["verdict"] == "found" and "<table>" in learned._repr_html_()
    plain = lnn.fit([x, 0.5 * x, 0.8 * x], dt=0.02, hidden=[4], epochs=1, threads=1)
    assert plain.summary.get("formula") is None


def test_the_table_of_the_documentation_has_every_command_and_calls_that_exist():
    commands = re.findall(r"^## (lnn\S*(?: [a-z]+)?)$", (ROOT / "docs/commands.md").read_text(), re.M)
    rows = re.findall(r"^\| \[`(lnn[^`]*)`\]\(commands\.md#\S+\) \| (.*) \|$", (ROOT / "docs/python.md").read_text(), re.M)
    assert [command for command, _ in rows] == commands and len(commands) > 15
    for command, call in rows:
        calls = re.findall(r"`(lnn|model)\.(\w+)\(", call)
        assert calls or "command line only: " in call, command
        for owner, name in calls:
            assert callable(getattr(lnn if owner == "lnn" else lnn.Model, name)), (command, name)
            if owner == "model" and name not in ("evaluate", "page"):
                assert callable(getattr(lnn.System, name)), name

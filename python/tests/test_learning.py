"""Trainings and fits, as small as can be."""

import importlib.util
import multiprocessing
import os
import re
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

import lnn

SMALL = {"hidden": [8], "epochs": 2, "threads": 1}
STATES = {"data.training": 256, "data.validation": 64, "data.test": 64, "optimizer.batch": 32}


def swing(amplitude, samples=400):
    return amplitude * np.sin(0.06 * np.arange(samples))[:, None]


def test_a_system_is_learned(tmp_path):
    result = []
    learned = lnn.train(
        "harmonic-oscillator",
        **{**SMALL, "epochs": 20},
        starts=1,
        config=STATES,
        out=tmp_path / "run",
        progress=lambda *event: result.append(event),
    )
    losses = learned.history["validation_loss"]
    assert losses.shape == (20,) and losses[-1] < losses[0] and learned.stop is None
    assert learned.summary["validation_loss"] == losses.min() and "loss" in str(learned)
    assert {kind for kind, *_ in result} >= {"step", "epoch"}
    same = lnn.Model.load(tmp_path / "run")
    assert same.to_bytes() == learned.model.to_bytes()
    report, page = (tmp_path / "run/report.html").read_text(), (tmp_path / "run/play.html").read_text()
    assert re.search('<a href="play.html">', report) and "<canvas" in page and len(page) < 500_000
    again = lnn.train("harmonic-oscillator", **{**SMALL, "epochs": 20, "threads": 2}, starts=1, config=STATES)
    assert again.model.to_bytes() == learned.model.to_bytes()
    other = lnn.train("harmonic-oscillator", **SMALL, seed=1, starts=1, config=STATES)
    assert other.model.to_bytes() != learned.model.to_bytes()


def test_seeds_are_swept_in_other_processes():
    """Under `spawn`, joblib and Dask: systems go there, results come back, and they are those of this process."""
    system, choices = lnn.System("harmonic-oscillator"), {**SMALL, "starts": 1, "config": STATES}
    here = [lnn.train(system, seed=seed, **choices) for seed in range(2)]
    same = lambda there: all(
        a.model.to_bytes() == b.model.to_bytes()
        and a.history.keys() == b.history.keys()
        and a.summary["accelerations"] == b.summary["accelerations"]
        for a, b in zip(here, there, strict=True)
    )
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert same([run.result() for run in [pool.submit(lnn.train, system, seed=seed, **choices) for seed in range(2)]])
    if importlib.util.find_spec("joblib"):
        from joblib import Parallel, delayed

        assert same(Parallel(n_jobs=2)(delayed(lnn.train)(system, seed=seed, **choices) for seed in range(2)))
    if importlib.util.find_spec("dask"):
        import dask

        tasks = [dask.delayed(lnn.train)(system, seed=seed, **choices) for seed in range(2)]
        assert same(dask.compute(*tasks, scheduler="processes", num_workers=2))


def test_a_system_of_ones_own_is_learned():
    system = lnn.System(lagrangian="m*x_dot^2/2 - k*x^2/2", coordinates=["x"], parameters={"m": 1, "k": 4})
    learned = lnn.train(system, structure="mechanical", **SMALL, starts=1, config=STATES)
    assert learned.model.header["architecture"]["form"]["structure"] == "mechanical"
    assert learned.model.header["description"]["parameters"]


def test_constants_of_a_known_part_are_found():
    kinetic = lnn.System(
        "known",
        lagrangian="m*q_dot^2/2 - k*q^2/2",
        coordinates=["q"],
        parameters={"m": 1, "k": {"default": 0.7, "range": "positive", "learn": True}},
    )
    learned = lnn.train("harmonic-oscillator", known=kinetic, **{**SMALL, "epochs": 30}, starts=1, config=STATES)
    assert learned.model.constants["m"] == 1.0 and learned.model.constants["k"] != 0.7
    assert lnn.Model.from_bytes(learned.model.to_bytes()).constants == learned.model.constants
    with pytest.raises(ValueError, match="known"):
        lnn.train("harmonic-oscillator", known=lnn.System("kepler"), **SMALL)


def test_wrong_choices_are_refused():
    for wrong in [
        {"preset": "quickest"},
        {"structure": "round"},
        {"config": {"network.novelty": 1}},
        {"config": {"phase.9.rate": 1}},
        {"config": {"seed.x": 1}},
        {"config": {"optimizer.batch": -1}},
        {"hidden": []},
        {"epochs": 0},
    ]:
        with pytest.raises(ValueError):
            lnn.train("harmonic-oscillator", **{**SMALL, **wrong})


def test_an_exception_of_the_receiver_ends_the_training():
    def fail(*event):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        lnn.train("harmonic-oscillator", **{**SMALL, "epochs": 10_000}, config=STATES, progress=fail)


X = np.linspace(-1, 1, 600)[:, None]
LONG = {
    "train": lambda choices: lnn.train("harmonic-oscillator", **choices, starts=1, config=STATES),
    "learn": lambda choices: lnn.learn(X, 0.5 * X[::-1], -X, **choices),
    "fit": lambda choices: lnn.fit([swing(0.3), swing(0.2)], dt=0.02, **choices),
}


@pytest.mark.parametrize("work", LONG.values(), ids=LONG)
def test_ctrl_c_ends_a_training_with_the_best_model(work):
    def press():
        time.sleep(1.0)
        os.kill(os.getpid(), signal.SIGINT)

    # A shell lets what runs in its background ignore Ctrl-C.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    pressing = threading.Thread(target=press)
    pressing.start()
    began = time.monotonic()
    try:
        learned = work({**SMALL, "epochs": 1_000_000})
        pressing.join()
    finally:
        signal.signal(signal.SIGINT, before)
    assert learned.stop == "interrupted" and time.monotonic() - began < 30
    assert 0 < len(learned.history["epoch"]) < 1_000_000 and np.isfinite(learned.model.acceleration([0.5], [0.0])).all()


def test_progress_is_a_line_that_is_written_again(capsys):
    lnn.train("harmonic-oscillator", **SMALL, starts=1, config=STATES, progress=True)
    line = capsys.readouterr().err
    assert "\r" in line and "[##" in line and "100%" in line and "validation loss" in line and line.endswith("\n")


def test_states_are_learned():
    rng = np.random.default_rng(0)
    q, v = rng.uniform(0, 2 * np.pi, (600, 1)), rng.uniform(-3, 3, (600, 1))
    seen = []
    receive = lambda *event: seen.append(event[0])
    choices = {"coordinates": ["theta"], "angles": ["theta"], "structure": "mechanical", **SMALL}
    learned = lnn.learn(q, v, -9.81 * np.sin(q), progress=receive, **choices)
    assert {"step", "epoch"} <= set(seen)
    assert learned.model.columns == ("theta", "theta_dot") and len(learned.history["epoch"]) == 2
    assert np.isfinite(learned.summary["test_loss"])
    for wrong in [(q[:, 0], v, q), (q[:10], v, q), (q, v, q[:10])]:
        with pytest.raises(ValueError):
            lnn.learn(*wrong)
    with pytest.raises(ValueError):
        lnn.learn(q[:2], v[:2], q[:2])
    with pytest.raises(ValueError):
        lnn.learn(np.full_like(q, np.nan), v, q)


def test_recorded_motion_is_fitted():
    tracks = [swing(0.3), swing(0.2, 300), swing(0.25)]
    fitted = lnn.fit(tracks, coordinates=["angle"], angles=["angle"], dt=0.02, **SMALL)
    assert fitted.model.columns == ("angle", "angle_dot") and "constant_velocity" in fitted.summary
    times = [0.02 * np.arange(len(track)) for track in tracks]
    again = lnn.fit(tracks, coordinates=["angle"], angles=["angle"], t=times, **SMALL)
    assert again.model.to_bytes() == fitted.model.to_bytes()
    assert lnn.fit(swing(0.3, 900), dt=0.02, friction=True, **SMALL).model.header["architecture"]["dissipation"] == 16
    # As a fit by the program.
    assert fitted.model.name == "measured"
    with pytest.raises(ValueError, match="novelty"):
        lnn.fit(tracks, dt=0.02, config={"novelty": 1}, **SMALL)
    with pytest.raises(ValueError, match="targets"):
        lnn.fit(tracks, dt=0.02, config={"targets": "measured forces"}, **SMALL)
    more = lnn.fit(tracks, coordinates=["angle"], angles=["angle"], dt=0.02, config={"held_out": 0.5}, **SMALL)
    assert more.model.to_bytes() != fitted.model.to_bytes()


def test_constants_beside_recorded_motion_are_found():
    kinetic = lnn.System(
        "known",
        lagrangian="q_dot^2/2 - k*q^2/2",
        coordinates=["q"],
        parameters={"k": {"default": 0.7, "range": "positive", "learn": True}},
    )
    fitted = lnn.fit([swing(0.3), swing(0.2)], coordinates=["q"], dt=0.02, known=kinetic, epochs=2, threads=1)
    # The small network that the program takes beside a known part.
    assert fitted.model.header["architecture"]["hidden"] == [8] and fitted.model.constants["k"] != 0.7


def test_motion_under_constraints_is_fitted(tmp_path):
    motion = lnn.System("cartesian-chain-1").rollout([[0.6, -0.8], [1.0, 0.0], [0.0, -1.0]], [[0, 0], [0, 0], [2, 0]], 4.0, 0.02)
    tracks, choices = list(motion.q), {"coordinates": ["x", "y"], "dt": 0.02, "structure": "mechanical", **SMALL}
    rod = {"rod": "x^2 + y^2 - 1"}
    fitted = lnn.fit(tracks, constraints=rod, **choices)
    assert fitted.model.header["constraints"] == rod and fitted.summary["constraints"]["formulas"] == rod
    held = fitted.model.rollout([0.6, -0.8], [0, 0], 1.0, 0.1)
    assert np.allclose(np.sum(held.q**2, -1), 1, atol=1e-12)
    (tmp_path / "rod.toml").write_text('[constraints]\nrod = "x^2 + y^2 - 1"\n')
    of_file = lnn.fit(tracks, constraints=tmp_path / "rod.toml", **choices)
    assert of_file.model.to_bytes() == fitted.model.to_bytes()
    found = lnn.fit(tracks, constraints="find", **choices)
    (formula,) = found.model.header["constraints"].values()
    assert found.summary["constraints"]["found"] and "x^2" in formula and "y^2" in formula
    given = lnn.fit(tracks, constraints=lnn.find_constraints(tracks, coordinates=["x", "y"], dt=0.02), **choices)
    assert len(given.model.header["constraints"]) == 1
    free = lnn.fit(tracks, constraints="none", **choices)
    assert free.model.to_bytes() == lnn.fit(tracks, **choices).model.to_bytes() != fitted.model.to_bytes()
    for wrong, error in [("rod.toml", OSError), ({"rod": "x^2 + z"}, ValueError), ({"plane": "x - 3"}, ValueError)]:
        with pytest.raises(error):
            lnn.fit(tracks, constraints=wrong, **choices)
    (tmp_path / "none.toml").write_text("a = 1\n")
    with pytest.raises(ValueError, match="constraints"):
        lnn.fit(tracks, constraints=tmp_path / "none.toml", **choices)
    # States with their accelerations, under the same.
    q, v = motion.q.reshape(-1, 2), motion.v.reshape(-1, 2)
    learned = lnn.learn(q, v, lnn.System("cartesian-chain-1").acceleration(q, v), coordinates=["x", "y"], constraints=rod, **SMALL)
    assert learned.model.header["constraints"] == rod


def test_a_system_of_the_catalogue_under_constraints_is_learned():
    learned = lnn.train("cartesian-chain-1", structure="constant-mass", **SMALL, starts=1, config=STATES)
    assert learned.model.evaluate(starts=1, threads=1)["accelerations"]


def test_angles_that_jump_by_a_turn_are_fitted_as_they_go_on():
    turning = 0.05 * np.arange(400)[:, None] + swing(0.3)
    choices = {"coordinates": ["angle"], "angles": ["angle"], "dt": 0.02, **SMALL}
    states = np.array([[0.1], [0.2]]), np.ones((2, 1))
    found = [lnn.fit([q, q[:300]], **choices).model.acceleration(*states) for q in (turning, turning % (2 * np.pi))]
    assert np.allclose(*found, rtol=1e-4, atol=1e-6)


def test_members_of_a_fit_are_models_of_their_seeds(tmp_path):
    tracks, choices = [swing(a) for a in (0.3, 0.2, 0.25)], {"coordinates": ["angle"], "angles": ["angle"], "dt": 0.02, **SMALL}
    fitted = lnn.fit(tracks, members=2, out=tmp_path, **choices)
    assert len(fitted.members) == len(fitted.summary["members"]["each"]) == 2
    assert [one["seed"] for one in fitted.summary["members"]["each"]] == [0, 1]
    alone = lnn.fit(tracks, **choices)
    first, second = (one.to_bytes() for one in fitted.members)
    assert first == fitted.model.to_bytes() == alone.model.to_bytes() != second and len(alone.members) == 1
    assert lnn.Model.load(tmp_path / "member-1.safetensors").to_bytes() == fitted.members[1].to_bytes()
    with pytest.raises(ValueError, match="members"):
        lnn.fit(tracks, members=0, **choices)


def test_tables_and_files_are_fitted(tmp_path):
    pandas = pytest.importorskip("pandas")
    frames = [
        pandas.DataFrame({"t": 0.02 * np.arange(400), "angle": swing(a)[:, 0], "run": run})
        for run, a in enumerate([0.3, 0.2, 0.25])
    ]
    frame = pandas.concat(frames)
    choices = {"coordinates": ["angle"], "angles": ["angle"], "trajectory": "run", **SMALL}
    fitted = lnn.fit(frame, **choices)
    frame.to_csv(tmp_path / "swing.csv", index=False)
    of_file = lnn.fit(tmp_path / "swing.csv", **choices)
    states = np.array([[0.1], [0.2]]), np.zeros((2, 1))
    assert np.allclose(of_file.model.acceleration(*states), fitted.model.acceleration(*states), rtol=1e-6)
    with pytest.raises(ValueError):
        lnn.fit(tmp_path / "swing.csv", **{**choices, "coordinates": ["angel"], "angles": []})
    with pytest.raises(OSError):
        lnn.fit(tmp_path / "nothing.csv", **choices)


@pytest.mark.parametrize(
    "data, more",
    [
        (swing(0.3), {}),
        (swing(0.3), {"dt": 0.0}),
        ([swing(0.3), np.zeros((400, 2))], {"dt": 0.02}),
        (swing(0.3), {"dt": 0.02, "angles": ["none"]}),
        (np.full((400, 1), np.nan), {"dt": 0.02}),
        (np.zeros((0, 1)), {"dt": 0.02}),
        (np.zeros((2, 2, 2)), {"dt": 0.02}),
        (swing(0.3), {"dt": 0.02, "v": swing(0.3)[:10]}),
        (swing(0.3), {"dt": 0.02, "config": {"training.novelty": 1}}),
        (swing(0.3), {"t": np.zeros(400)}),
    ],
)
def test_motion_that_cannot_be_fitted_is_refused(data, more):
    with pytest.raises(ValueError):
        lnn.fit(data, **{**SMALL, **more})

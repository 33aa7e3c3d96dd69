"""Wrong arguments, files that are there, Ctrl-C: nothing is taken in silence, nothing is lost, nothing goes on."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import lnn
from lnn.reader import ModelFile

SWING = np.sin(0.06 * np.arange(200))[:, None]
SPRING = {"lagrangian": "x_dot^2/2 - k*x^2/2", "coordinates": ["x"], "parameters": {"k": 3.0}}
MASKED = np.ma.masked_greater(SWING, 0.9)


def fit(**more):
    return lnn.fit(SWING, **{"dt": 0.02, "hidden": [4], "epochs": 1, "threads": 1, **more})


@pytest.mark.parametrize(
    ("call", "error", "name"),
    [
        (lambda: lnn.fit(MASKED, dt=0.02), ValueError, "data"),
        (lambda: lnn.System("kepler").acceleration(np.ma.masked_less([0.5, 1.0], 0.7), [0.0, 1.0]), ValueError, "q"),
        (lambda: lnn.fit({"x": SWING}, dt=0.02), TypeError, "data"),
        (lambda: lnn.fit([[0.1, 0.2], [0.3]], dt=0.02), ValueError, "data"),
        (lambda: lnn.System("kepler").energy([[1.0, 0.0], [1.0]], [0.0, 1.0]), ValueError, "q"),
        (lambda: lnn.fit(SWING, dt=0.02, t=np.arange(200.0)), ValueError, "dt"),
        (lambda: lnn.fit(SWING, dt=-0.02), ValueError, "dt"),
        (lambda: lnn.fit(SWING, dt=np.nan), ValueError, "dt"),
        (lambda: lnn.fit(SWING, dt="fast"), TypeError, "dt"),
        (lambda: lnn.fit("motion.csv", coordinates=["x"], dt=0.02), TypeError, "dt"),
        (lambda: lnn.fit(SWING, dt=0.02, trajectory="run"), TypeError, "trajectory"),
        (lambda: fit(seed=2**70), ValueError, "seed"),
        (lambda: fit(seed=1.5), TypeError, "seed"),
        (lambda: fit(epochs=0), ValueError, "epochs"),
        (lambda: fit(hidden=[8, 0]), ValueError, "hidden"),
        (lambda: fit(members=33), ValueError, "members"),
        (lambda: fit(threads=0), ValueError, "threads"),
        (lambda: fit(config={"training.optimizer.clip": float("nan")}), ValueError, "training.optimizer.clip"),
        (lambda: fit(config={"training.data.training": 7}), ValueError, "training.data"),
        (lambda: fit(angles="q1"), TypeError, "angles"),
        (lambda: lnn.train("kepler", seed=2**70), ValueError, "seed"),
        (lambda: lnn.train("kepler", starts=-1), ValueError, "starts"),
        (lambda: lnn.formula(SWING, dt=0.02, noise=[float("nan")]), ValueError, "noise"),
        (lambda: lnn.formula(SWING, dt=0.02, scale=("x_dot^2", float("inf"))), ValueError, "scale"),
        (lambda: lnn.formula(SWING, dt=0.02, bootstraps=0), ValueError, "bootstraps"),
        (lambda: lnn.identify(SWING, lnn.System(**SPRING), dt=0.02, segment=float("nan")), ValueError, "segment"),
        (lambda: lnn.identify(SWING, lnn.System(**SPRING), dt=0.02, noise=[-1.0]), ValueError, "noise"),
        (lambda: lnn.identify(SWING, lnn.System(**SPRING), dt=0.02, constants="k"), TypeError, "constants"),
        (lambda: lnn.System("kepler").symmetries(region={"x": (2, 1)}), ValueError, "region"),
        (lambda: lnn.System("kepler").certify(region={"x": (1, np.nan)}), ValueError, "region"),
        (lambda: lnn.System("kepler").symmetries(seed=-1), ValueError, "seed"),
        (lambda: lnn.System("kepler").rollout([1, 0], [0, 1], 1.0, -0.1), ValueError, "dt"),
        (lambda: lnn.System("kepler").geometry(np.ones((10_000_000, 2))), ValueError, "q"),
    ],
)
def test_a_wrong_argument_is_named(call, error, name):
    with pytest.raises(error) as refused:
        call()
    assert name in str(refused.value), refused.value


def test_a_mask_without_masked_values_is_none():
    q = np.ma.masked_greater([1.0, 0.0], 5.0)
    assert np.isfinite(lnn.System("kepler").acceleration(q, [0.0, 1.0])).all()


def test_devices_are_refused(tmp_path):
    for load in (lnn.Model.load, ModelFile.load):
        with pytest.raises(ValueError, match="/dev/zero"):
            load("/dev/zero")
        with pytest.raises(FileNotFoundError):
            load(tmp_path / "none")


def test_files_are_replaced_on_demand_alone(shipped, tmp_path):
    model, path = lnn.Model.load(shipped), tmp_path / "kept"
    for write in (model.save, model.page, model.file.save):
        path.write_text("months of work")
        with pytest.raises(FileExistsError, match="kept.*overwrite=True"):
            write(path)
        assert path.read_text() == "months of work"
        write(path, overwrite=True)
        assert path.stat().st_size > 1000 and [entry.name for entry in tmp_path.iterdir()] == ["kept"]
        path.unlink()
        write(path)
        assert path.stat().st_mode & 0o777 == 0o666 & ~_mask()


def _mask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_a_run_is_replaced_on_demand_alone(tmp_path):
    states = {"data.training": 64, "data.validation": 16, "data.test": 16, "optimizer.batch": 32}
    train = lambda **more: lnn.train("harmonic-oscillator", **{"hidden": [4], "epochs": 1, "starts": 1, "config": states, **more})
    for learn in (lambda **more: fit(out=tmp_path / "fit", **more), lambda **more: train(out=tmp_path / "train", **more)):
        learn()
        with pytest.raises(FileExistsError, match="model.safetensors.*overwrite=True"):
            learn(seed=1)
        assert learn(seed=1, overwrite=True).model.header["seed"] == 1


def test_what_needs_other_packages_is_missing_without_them():
    code = """
import sys
sys.modules["sklearn"] = None
import lnn
print(hasattr(lnn, "LagrangianRegressor"), hasattr(lnn, "System"))
"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert said.stdout.split() == ["False", "True"], said.stderr


ARMS = {
    "lagrangian": "(a*x_dot^2 + b*y_dot^2 + c*z_dot^2)/2 + d*x_dot*y_dot*cos(x - y) - e*cos(x) - f*cos(y*z)",
    "coordinates": ["x", "y", "z"],
    "parameters": dict.fromkeys("abcdef", 1.0),
}


def wide(samples, n):
    t = 0.01 * np.arange(samples)
    return np.stack([np.sin((1 + 0.37 * k) * t + k) for k in range(n)], axis=1)


@pytest.mark.parametrize(
    "work",
    [
        lambda: lnn.formula(wide(20_000, 4), dt=0.01, basis="polynomial:2", threads=1),
        lambda: lnn.identify(wide(20_000, 3), lnn.System(**ARMS), dt=0.01, threads=1),
        lambda: lnn.find_constraints(wide(20_000, 8), dt=0.01, degree=4),
        lambda: lnn.System("triple-pendulum").symmetries(basis="trigonometric:8"),
        lambda: lnn.System("n-pendulum", n=12).certify(seconds=1000.0, boxes=10**9, threads=1),
        lambda: lnn.System("kerr-cartesian").geometry(np.full((100_000, 4), 5.0)),
        lambda: lnn.System("n-pendulum", n=20).terms(np.ones((100_000, 20)), np.ones((100_000, 20))),
        lambda: lnn.System("triple-pendulum").formula(basis="trigonometric:2"),
    ],
)
def test_control_c_ends_it_within_a_second(work):
    def press():
        if not over.wait(0.7):
            began.append(time.monotonic())
            os.kill(os.getpid(), signal.SIGINT)

    began, over = [], threading.Event()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    pressing = threading.Thread(target=press)
    try:
        pressing.start()
        with pytest.raises(KeyboardInterrupt):
            work()
            over.set()
            pytest.skip("the work ends before a key is pressed")
        # Debug builds and busy machines are slower than users.
        assert time.monotonic() - began[0] < 3
    finally:
        over.set()
        pressing.join()
        signal.signal(signal.SIGINT, before)


def test_a_training_that_is_interrupted_while_judged_returns_its_model():
    def receive(kind, *_):
        if kind == "judged" and not pressed:
            pressed.append(True)
            threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()

    pressed = []
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        config = {"data.training": 64, "data.validation": 16, "data.test": 2000, "optimizer.batch": 32}
        learned = lnn.train("triple-pendulum", hidden=[8], epochs=2, starts=50, threads=1, config=config, progress=receive)
    finally:
        signal.signal(signal.SIGINT, before)
    assert learned.stop == "interrupted" and len(learned.history["epoch"]) == 2 and learned.summary == {}
    assert np.isfinite(learned.model.mass_matrix([0.1] * 3, [0.0] * 3)).all()

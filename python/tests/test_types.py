"""Types of the package, and of its stubs beside the compiled part."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")

ROOT = Path(__file__).parents[1]
USE = """
import lnn
import numpy as np

system = lnn.System("kepler", mu=2)
learned = lnn.train(system, epochs=1)
motion: lnn.Trajectory = learned.model.rollout([1.0, 0.0], np.zeros(2), 1.0, 0.1)
error: float | None = lnn.identify(motion.q, system, dt=0.1).constants["mu"].standard_error
torque = system.inverse_dynamics([1.0, 0.0], [0.0, 1.0], [0.0, 0.0]).external
driven = system.rollout([1.0, 0.0], [0.0, 1.0], 1.0, 0.1, force=lambda t, q, v: -0.1 * v, friction=False)
first: lnn.Event = driven.events[0]
look: str = lnn.check(motion.q, dt=0.1, units={"q1": "mm"}).next
wrong: int = system.name
system.terms([1.0, 0.0], [0.0, 1.0], treads=2)
"""


def run(*arguments, **options):
    found = subprocess.run([sys.executable, "-m", *map(str, arguments)], capture_output=True, text=True, **options)
    return found.returncode, found.stdout + found.stderr


def test_the_package_is_typed(tmp_path):
    cache = ["--cache-dir", tmp_path / "cache", "--config-file", ROOT / "pyproject.toml"]
    status, text = run("mypy", *cache, ROOT / "lnn")
    assert status == 0, text
    # A program that uses it: what is right passes, two mistakes are found where they are.
    (tmp_path / "use.py").write_text(USE)
    status, text = run("mypy", *cache, tmp_path / "use.py", cwd=tmp_path)
    found = [line for line in text.splitlines() if "error:" in line]
    wrong = next(number for number, line in enumerate(USE.splitlines(), 1) if line.startswith("wrong"))
    assert status == 1 and len(found) == 2, text
    assert f"use.py:{wrong}:" in found[0] and f"use.py:{wrong + 1}:" in found[1] and "treads" in found[1], text


def test_stubs_are_those_of_the_extension():
    status, text = run("mypy.stubtest", "lnn._lnn", "--mypy-config-file", ROOT / "pyproject.toml")
    assert status == 0, text

"""Measures the package: ``python python/benches/measure.py [MODEL]``. One JSON object; times in seconds, the best of several."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import lnn

STATES = 1_000_000


def best(call, times):
    """The least time of a call."""
    found = []
    for _ in range(times):
        began = time.perf_counter()
        call()
        found.append(time.perf_counter() - began)
    return min(found)


def imported(code):
    """Time of an interpreter that runs a line, less that of one that runs none."""
    run = lambda code: best(lambda: subprocess.run([sys.executable, "-c", code], check=True), 7)
    return run(code) - run("pass")


def overhead(call, count=20_000):
    return best(lambda: [call() for _ in range(count)], 5) / count


def main(path):
    model, arm, threads = lnn.Model.load(path), lnn.System("double-pendulum"), len(os.sched_getaffinity(0))
    q, v = np.random.default_rng(0).uniform(-3, 3, (2, STATES, 2))
    one = np.array([[0.3, 0.1]]), np.array([[0.0, 0.2]])
    found = {
        "threads": threads,
        "import lnn": imported("import lnn"),
        "import lnn and a system": imported("import lnn; lnn.System('kepler')"),
        "import numpy": imported("import numpy"),
        "acceleration of one state, system": overhead(lambda: arm.acceleration(*one)),
        "the same by the extension alone": overhead(lambda: arm._subject.term("acceleration", *one, 1)),
        "terms of one state, system": overhead(lambda: arm.terms(*one)),
        "terms of a million states, system": best(lambda: arm.terms(q, v, threads=threads), 3),
        "terms of a million states, model": best(lambda: model.terms(q, v, threads=threads), 3),
        "accelerations of a million states, model": best(lambda: model.acceleration(q, v, threads=threads), 3),
    }
    try:
        import jax
    except ImportError:
        print(json.dumps(found, indent=1))
        return
    jax.config.update("jax_enable_x64", True)
    functions = model.to_jax()
    compiled = {"terms": jax.jit(jax.vmap(functions.terms)), "accelerations": jax.jit(jax.vmap(functions.acceleration))}
    a, b = jax.numpy.asarray(q), jax.numpy.asarray(v)
    for name, call in compiled.items():
        jax.block_until_ready(call(a, b))
        found[f"{name} of a million states, JAX"] = best(lambda: jax.block_until_ready(call(a, b)), 3)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main(*sys.argv[1:] or [Path(__file__).parents[2] / "examples/data/double_pendulum.safetensors"])

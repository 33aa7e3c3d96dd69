"""Measures the package: ``python python/benches/measure.py [--program lnn]``. One JSON object; processor times in seconds, the least of several.

Processor time counts all threads, and other work on the machine hardly changes it. With the program a fit is compared with the same fit by it,
in turns; ``--epochs`` makes the fit longer, ``--rounds`` says how often, and ``--fits`` leaves the rest out. The load of the machine over the last
minute is stated beside.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import lnn

STATES = 1_000_000
DATA = Path(__file__).parents[2] / "examples/data"


def best(call, times):
    """The least processor time of a call."""
    found = []
    for _ in range(times):
        began = time.process_time()
        call()
        found.append(time.process_time() - began)
    return min(found)


def call_time(call, count=100):
    """Time of one call, the least of many short stretches, which nothing interrupts."""
    found = []
    for _ in range(2000):
        began = time.perf_counter()
        for _ in range(count):
            call()
        found.append((time.perf_counter() - began) / count)
    return min(found)


def spent(command):
    """Processor time of a process."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{command} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime


def imported(code):
    """Processor time of an interpreter that runs a line, less that of one that runs none."""
    run = lambda code: min(spent([sys.executable, "-c", code]) for _ in range(20))
    return run(code) - run("pass")


def fits(program, epochs, rounds):
    """Processor times of a fit by the program and by the package, in turns, and whether their models are the same."""
    angles, found = "theta1,theta2", {"program": [], "package": []}
    choices = "trajectory='run', threads=1, epochs=int(sys.argv[3]), out=sys.argv[2], overwrite=True"
    code = f"import lnn, sys; a = ['theta1', 'theta2']; lnn.fit(sys.argv[1], coordinates=a, angles=a, {choices})"
    with tempfile.TemporaryDirectory() as folder:
        outs = [Path(folder, name) for name in found]
        columns = ["--coords", angles, "--periodic", angles, "--trajectory", "run", "--threads", "1", "--epochs", str(epochs)]
        for _ in range(rounds):
            found["program"].append(spent([program, "fit", DATA / "pendulum.csv", *columns, "--out", outs[0], "--overwrite"]))
            found["package"].append(spent([sys.executable, "-c", code, DATA / "pendulum.csv", outs[1], str(epochs)]))
        same = len({(out / "model.safetensors").read_bytes() for out in outs}) == 1
    # Of a round, which meets one load of the machine.
    ratios = sorted(package / program for program, package in zip(*found.values()))
    least = {f"fit of {epochs} epochs, {name}": min(times) for name, times in found.items()}
    return least | {"package over program, median of the rounds": ratios[rounds // 2], "same model": same, "load": os.getloadavg()[0]}


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--program", help="the program, to compare a fit with")
    arguments.add_argument("--model", default=DATA / "double_pendulum.safetensors")
    arguments.add_argument("--epochs", type=int, default=10, help="epochs of the fit")
    arguments.add_argument("--rounds", type=int, default=5, help="fits of each")
    arguments.add_argument("--fits", action="store_true", help="only the fits, which need --program")
    given = arguments.parse_args()
    if given.fits:
        print(json.dumps(fits(given.program, given.epochs, given.rounds), indent=1))
        return
    model, arm = lnn.Model.load(given.model), lnn.System("double-pendulum")
    q, v = np.random.default_rng(0).uniform(-3, 3, (2, STATES, 2))
    one = np.array([[0.3, 0.1]]), np.array([[0.0, 0.2]])
    none = np.empty((0, 2)), np.empty((0, 2))
    found = {
        "import lnn": imported("import lnn"),
        "import lnn and a system": imported("import lnn; lnn.System('kepler')"),
        "import numpy": imported("import numpy"),
        "call for the acceleration of no state": call_time(lambda: arm.acceleration(*none)),
        "call for the acceleration of one state": call_time(lambda: arm.acceleration(*one)),
        "call for the terms of one state": call_time(lambda: arm.terms(*one)),
        "terms of a million states, system": best(lambda: arm.terms(q, v), 5),
        "terms of a million states, model": best(lambda: model.terms(q, v), 5),
        "accelerations of a million states, model": best(lambda: model.acceleration(q, v), 5),
    }
    if given.program:
        found |= fits(given.program, given.epochs, given.rounds)
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
        found[f"{name} of a million states, JAX"] = best(lambda call=call: jax.block_until_ready(call(a, b)), 5)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()

"""Recordings of the tutorials: python3 tests/scripts/tutorial_data.py LNN [FOLDER]

Writes three films of a mass on a spring (film1.txt to film3.txt, 60 pictures per second, positions with a noise of 0.5 mm, as Tracker exports them
without the line of the track's name) and the log of an arm of three joints (robot.csv, 125 Hz, encoders with a noise of 0.2 mrad, torques with one of
2 %), by default to examples/data. LNN computes the motion and the torques; the noise has a fixed seed.
"""

import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

SPRING = """
name = "spring"
lagrangian = "m*(x_dot^2 + y_dot^2)/2 - m*g*y - k*(sqrt(x^2 + y^2) - l0)^2/2"
dissipation = "c*(x_dot^2 + y_dot^2)/2"
coordinates = [
  { name = "x", unit = "m", bounds = [-1, 1], velocity_bounds = [-3, 3] },
  { name = "y", unit = "m", bounds = [-1, 1], velocity_bounds = [-3, 3] },
]
parameters = { m = 0.2, g = 9.81, k = 10, l0 = 0.25, c = 0.004 }
"""
STARTS = ["0.20,-0.42,0,0", "0.03,-0.62,0.5,0", "-0.25,-0.30,0,0.2"]

ARM = """
name = "three-joints"
chain = { gravity = [0, 0, -9.81], friction = true }
links = [{ d = 0.3 }, { alpha = "pi/2" }, { a = 0.4 }]
"""
# Mass in kg, its centre in m, moments of inertia about the centre in kg m^2, viscous friction in N m s, dry friction in N m.
LINKS = [
    (4.0, (0, 0, -0.05), (0.02, 0.02, 0.015), 0.5, 0.6),
    (3.0, (0.18, 0.0, 0.02), (0.006, 0.045, 0.045), 0.4, 0.5),
    (1.5, (0.15, 0.01, 0.0), (0.002, 0.016, 0.016), 0.2, 0.3),
]
MIDDLE = [0, 0.4, -0.8]


def program(*arguments):
    done = subprocess.run([sys.argv[1], *arguments], capture_output=True, text=True, check=True)
    return [[float(x) for x in line.split(",")] for line in done.stdout.splitlines()[1:]]


def films(place, system):
    system.write_text(SPRING)
    rng = random.Random(1)
    for k, start in enumerate(STARTS, 1):
        exact = ["--system", str(system), f"--state={start}", "--rtol", "1e-10", "--atol", "1e-12"]
        motion = program("rollout", *exact, "--t-end", "10", "--dt", repr(1 / 60), "--out", "-")
        rows = [(t, x + rng.gauss(0, 5e-4), y + rng.gauss(0, 5e-4)) for t, x, y, *_ in motion]
        text = "t\tx\ty\n" + "".join(f"{t:.9E}\t{x:.6E}\t{y:.6E}\n" for t, x, y in rows)
        (place / f"film{k}.txt").write_text(text)


def constants():
    known = {}
    for k, (m, centre, inertia, viscous, dry) in enumerate(LINKS, 1):
        known |= {f"m{k}": m, f"Fv{k}": viscous, f"Fc{k}": dry}
        for i, a in enumerate("xyz"):
            known[f"m{a}{k}"] = m * centre[i]
            for j, b in list(enumerate("xyz"))[i:]:
                about_centre = inertia[i] + m * sum(x * x for x in centre) if i == j else 0
                known[f"I{a}{b}{k}"] = about_centre - m * centre[i] * centre[j]
    return known


def robot(place, system):
    system.write_text(ARM + "[parameters]\n" + "".join(f"{name} = {value!r}\n" for name, value in constants().items()))
    rng = random.Random(2)

    def wave(k):
        size, pace = rng.uniform(0.25, 0.5) / math.sqrt(k), 2 * math.pi * 0.125 * k * rng.uniform(0.8, 1.2)
        return size, pace, rng.uniform(0, 2 * math.pi)

    waves = [[wave(k) for k in range(1, 6)] for _ in MIDDLE]

    def derivative(t, order):
        def one(size, pace, phase):
            return size * pace**order * math.sin(pace * t + phase + order * math.pi / 2)

        shift = MIDDLE if order == 0 else [0, 0, 0]
        return [middle + sum(one(*w) for w in all_of) for middle, all_of in zip(shift, waves)]

    motion = [(0.008 * k, *(derivative(0.008 * k, order) for order in range(3))) for k in range(1250)]
    states = system.with_name("states.csv")
    header = ["t"] + [f"q{i}{end}" for end in ("", "_dot", "_ddot") for i in (1, 2, 3)]
    lines = [",".join(repr(x) for x in (t, *q, *v, *a)) for t, q, v, a in motion]
    states.write_text("\n".join([",".join(header), *lines]) + "\n")
    forces = program("inspect", "--system", str(system), "--inverse", "--states", str(states), "--format", "csv")
    torques = [row[1:] for row in forces]
    sizes = [math.sqrt(sum(row[j] ** 2 for row in torques) / len(torques)) for j in range(3)]
    text = "t,q1,q2,q3,tau1,tau2,tau3\n"
    for (t, q, _, _), torque in zip(motion, torques):
        angles = [f"{x + rng.gauss(0, 2e-4):.4f}" for x in q]
        loads = [f"{x + rng.gauss(0, 0.02 * size):.2f}" for x, size in zip(torque, sizes)]
        text += ",".join([f"{t:.3f}", *angles, *loads]) + "\n"
    (place / "robot.csv").write_text(text)


folder = Path(sys.argv[2] if len(sys.argv) > 2 else "examples/data")
with tempfile.TemporaryDirectory() as scratch:
    films(folder, Path(scratch) / "spring.toml")
    robot(folder, Path(scratch) / "arm.toml")

"""Recordings of the tutorials: python3 tests/scripts/tutorial_data.py LNN [FOLDER]

Writes three films of a mass on a spring (film1.txt to film3.txt, 60 pictures per second, positions with a noise of 0.5 mm, as Tracker exports them
without the line of the track's name), the log of an arm of three joints (robot.csv, 125 Hz, encoders with a noise of 0.2 mrad, torques with one of
2 %), the log of a pendulum on a motor (motor.csv, 100 Hz, angles with a noise of 1 mrad, voltages without), and the log of an arm of six joints
(six_joints.csv, 100 Hz, 0.1 mrad, 1 %), and 80 observations of a binary star (star.csv, 0.01 AU and 0.05 AU/yr), by default to examples/data. LNN computes the motion and the torques; the noise has a fixed seed.
"""

import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

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


def waved(rng, count, middle, sizes):
    """Position, velocity and acceleration of joints at a time: five waves each about a middle."""

    def wave(k):
        size, pace = rng.uniform(*sizes) / math.sqrt(k), 2 * math.pi * 0.125 * k * rng.uniform(0.8, 1.2)
        return size, pace, rng.uniform(0, 2 * math.pi)

    waves = [[wave(k) for k in range(1, 6)] for _ in range(count)]

    def derivative(t, order):
        def one(size, pace, phase):
            return size * pace**order * math.sin(pace * t + phase + order * math.pi / 2)

        shift = middle if order == 0 else [0] * count
        return [at + sum(one(*w) for w in all_of) for at, all_of in zip(shift, waves)]

    return lambda t: [derivative(t, order) for order in range(3)]


def log(path, system, joints, motion, times, rng, noise, digits):
    """Writes positions and the torques that they need, both with noise: that of encoders in rad, that of torques over their size."""
    states = system.with_name("states.csv")
    header = ["t"] + [f"{joint}{end}" for end in ("", "_dot", "_ddot") for joint in joints]
    lines = [",".join(repr(x) for x in (t, *sum(motion(t), []))) for t in times]
    states.write_text("\n".join([",".join(header), *lines]) + "\n")
    forces = program("inspect", "--system", str(system), "--inverse", "--states", str(states), "--format", "csv")
    torques = [row[-len(joints) :] for row in forces]
    sizes = [math.sqrt(sum(row[j] ** 2 for row in torques) / len(torques)) for j in range(len(joints))]
    text = ",".join(["t", *joints, *(f"tau{j + 1}" for j in range(len(joints)))]) + "\n"
    for t, torque in zip(times, torques):
        angles = [f"{x + rng.gauss(0, noise[0]):.{digits[0]}f}" for x in motion(t)[0]]
        loads = [f"{x + rng.gauss(0, noise[1] * size):.{digits[1]}f}" for x, size in zip(torque, sizes)]
        text += ",".join([f"{t:.3f}", *angles, *loads]) + "\n"
    path.write_text(text)


def robot(place, system):
    system.write_text(ARM + "[parameters]\n" + "".join(f"{name} = {value!r}\n" for name, value in constants().items()))
    rng = random.Random(2)
    motion = waved(rng, 3, MIDDLE, (0.25, 0.5))
    log(place / "robot.csv", system, ["q1", "q2", "q3"], motion, [0.008 * k for k in range(1250)], rng, (2e-4, 0.02), (4, 2))


MOTOR = """
name = "motor"
lagrangian = "m*l^2*theta_dot^2/2 + m*g*l*cos(theta)"
dissipation = "b*theta_dot^2/2"
coordinates = [{ name = "theta", unit = "rad", periodic = true, velocity_bounds = [-20, 20] }]
inputs = { u = "V" }
forces = { theta = "K*u - Fc*tanh(theta_dot/0.1)" }
parameters = { m = 0.5, l = 0.2, g = 9.81, K = 0.15, b = 0.01, Fc = 0.03 }
"""


def motor(place, system):
    system.write_text(MOTOR)
    rng = random.Random(3)
    times = [0.01 * k for k in range(1000)]
    levels = [round(rng.uniform(-3, 3), 1) for _ in range(len(times) // 30 + 1)]
    voltages = [levels[k // 30] for k in range(len(times))]
    given = system.with_name("voltage.csv")
    given.write_text("t,u\n" + "".join(f"{t!r},{u!r}\n" for t, u in zip(times, voltages)))
    drive = ["--force", str(given), "--between", "held", "--rtol", "1e-9", "--atol", "1e-11"]
    motion = program("rollout", "--system", str(system), "--state=0.3,0", *drive, "--t-end", "9.99", "--dt", "0.01", "--out", "-")
    rows = [f"{t:.2f},{row[1] + rng.gauss(0, 1e-3):.4f},{u}\n" for t, row, u in zip(times, motion, voltages)]
    (place / "motor.csv").write_text("t,theta,u\n" + "".join(rows))


# The real arm beside its drawings: factors of mass, of moments of inertia, a shift of the centre of mass in m, viscous and dry friction.
REAL = {
    "shoulder": (1.2, 1.3, (0, 0.01, 0), 6.0, 8.0),
    "upper_arm": (1.1, 1.15, (0.015, 0, 0.01), 6.0, 9.0),
    "forearm": (1.25, 1.2, (-0.01, 0.004, 0), 4.0, 5.0),
    "wrist_1": (1.1, 1.4, (0, -0.004, 0.006), 1.0, 1.5),
    "wrist_2": (1.15, 1.3, (0.003, 0, 0), 1.0, 1.2),
    "flange": (1.3, 1.2, (0, 0.002, 0.004), 0.8, 0.9),
}
SIX = ["base_turn", "shoulder_lift", "elbow", "wrist_lift", "wrist_turn", "tool_turn"]


def six_joints(place, system):
    drawn = Path(__file__).parents[2] / "examples/systems/six_joints.urdf"
    tree = ElementTree.parse(drawn)
    for link in tree.getroot().iter("link"):
        if link.get("name") in REAL:
            mass, inertia, shift, _, _ = REAL[link.get("name")]
            own = link.find("inertial")
            own.find("mass").set("value", repr(mass * float(own.find("mass").get("value"))))
            centre = [float(x) + by for x, by in zip(own.find("origin").get("xyz").split(), shift)]
            own.find("origin").set("xyz", " ".join(repr(x) for x in centre))
            for key in ("ixx", "iyy", "izz"):
                own.find("inertia").set(key, repr(inertia * float(own.find("inertia").get(key))))
    for joint in tree.getroot().iter("joint"):
        child = joint.find("child").get("link")
        if child in REAL:
            ElementTree.SubElement(joint, "dynamics", damping=repr(REAL[child][3]), friction=repr(REAL[child][4]))
    system = system.with_suffix(".urdf")
    tree.write(system)
    rng = random.Random(4)
    motion = waved(rng, 6, [0, -0.8, 0.9, 0, 0.5, 0], (0.15, 0.4))
    log(place / "six_joints.csv", system, SIX, motion, [0.01 * k for k in range(2000)], rng, (1e-4, 0.01), (5, 3))


STAR = {"GM": 43.4, "i": 0.7, "node": 0.5, "v0": 0.4}


def star(place):
    system = Path(__file__).parents[2] / "examples/systems/star_in_projection.toml"
    values = sum((["--param", f"{name}={value}"] for name, value in STAR.items()), [])
    span = ["--t-end", "4", "--dt", "0.002", "--rtol", "1e-10", "--atol", "1e-12", "--out", "-"]
    rows = program("rollout", "--system", str(system), *values, "--state=0.8,0.3,0,9", *span)
    rng = random.Random(5)
    text = "t,north,east,rv\n"
    for k in sorted(rng.sample(range(len(rows)), 80)):
        east, north, rv = rows[k][-3:]
        text += f"{rows[k][0]:.3f},{north + rng.gauss(0, 0.01):.4f},{east + rng.gauss(0, 0.01):.4f},{rv + rng.gauss(0, 0.05):.3f}\n"
    (place / "star.csv").write_text(text)


folder = Path(sys.argv[2] if len(sys.argv) > 2 else "examples/data")
with tempfile.TemporaryDirectory() as scratch:
    films(folder, Path(scratch) / "spring.toml")
    robot(folder, Path(scratch) / "arm.toml")
    motor(folder, Path(scratch) / "motor.toml")
    six_joints(folder, Path(scratch) / "six.toml")
    star(folder)

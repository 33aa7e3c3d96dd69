"""A robot that branches, and a log of its motion: `tree_robot.py LNN LINKS SECONDS` writes `truth.urdf`, `start.urdf` and `log.csv`.

The start knows no damping and no products of inertia. The log has 100 rows a second, with a noise of 0.1 mrad of the angles and of 1 % of the torques:

    lnn identify log.csv --system start.urdf --force tau1,..,tauN --out found.urdf
"""

import math
import random
import subprocess
import sys

ENCODER, TORQUE, STEP = 1e-4, 0.01, 0.01
AXES = ["0 0 1", "0 1 0", "1 0 0", "0.6 0 0.8"]


def robot(links: int, damping: float, product: float) -> str:
    text = '<robot name="tree">\n  <link name="l0"/>\n'
    for k in range(1, links + 1):
        wave, other = math.sin(k), math.cos(k)
        text += f"""  <link name="l{k}">
    <inertial>
      <origin xyz="{0.05 * wave} {0.05 * other} 0.1"/>
      <mass value="{0.5 + 1 / k}"/>
      <inertia ixx="{0.02 + 0.01 * wave}" ixy="{product}" ixz="0" iyy="0.02" iyz="0" izz="0.015"/>
    </inertial>
  </link>
  <joint name="j{k}" type="revolute">
    <parent link="l{k // 2}"/>
    <child link="l{k}"/>
    <origin xyz="0.02 {0.1 * wave} 0.2" rpy="{0.4 * other} 0 0.3"/>
    <axis xyz="{AXES[k % 4]}"/>
    <limit lower="-2" upper="2" velocity="3" effort="9"/>
    <dynamics damping="{damping}" friction="0.1"/>
  </joint>
"""
    return text + "</robot>\n"


def main(lnn: str, links: int, seconds: float) -> None:
    rng = random.Random(20)
    with open("truth.urdf", "w") as file:
        file.write(robot(links, 0.2, 0.001))
    with open("start.urdf", "w") as file:
        file.write(robot(links, 0, 0))

    def tone(i: int) -> tuple[float, float, float]:
        return rng.uniform(0.2, 0.4) / math.sqrt(i), math.tau * 0.125 * i * rng.uniform(0.8, 1.2), rng.uniform(0, math.tau)

    tones = [[tone(i) for i in range(1, 6)] for _ in range(links)]
    times = [STEP * k for k in range(int(seconds / STEP))]
    names = [f"j{k}" for k in range(1, links + 1)]

    def derivative(order: int, t: float) -> list[float]:
        return [sum(size * rate**order * math.sin(rate * t + phase + order * math.pi / 2) for size, rate, phase in own) for own in tones]

    with open("states.csv", "w") as file:
        file.write(",".join(name + end for end in ("", "_dot", "_ddot") for name in names) + "\n")
        for t in times:
            file.write(",".join(repr(x) for order in range(3) for x in derivative(order, t)) + "\n")
    command = [lnn, "inspect", "--system", "truth.urdf", "--inverse", "--states", "states.csv", "--format", "csv"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    torques = [[float(x) for x in line.split(",")] for line in lines[1:]]
    sizes = [math.sqrt(sum(row[k] ** 2 for row in torques) / len(torques)) for k in range(links)]
    with open("log.csv", "w") as file:
        file.write(",".join(["t", *names, *(f"tau{k}" for k in range(1, links + 1))]) + "\n")
        for t, row in zip(times, torques):
            angles = [q + ENCODER * rng.gauss(0, 1) for q in derivative(0, t)]
            noisy = [torque + TORQUE * size * rng.gauss(0, 1) for torque, size in zip(row, sizes)]
            file.write(",".join(map(repr, [t, *angles, *noisy])) + "\n")


main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))

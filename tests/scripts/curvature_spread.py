"""Spread of a learned curvature: python3 tests/scripts/curvature_spread.py LNN RUN COMPONENT[:COORDINATE] [POINTS]

Draws points uniformly from the validation bounds of the system that RUN learned, asks `LNN geometry` for them, and prints median and 90 % range of
c R, c^2 K and K/R^2. The factor c is the median of a component of the metric that is 1 in the exact one, such as theta,theta of the unit sphere; with a
coordinate behind it the component is multiplied by its square, as x,x:z of anti-de Sitter space.
"""

import json
import random
import statistics
import subprocess
import sys
import tomllib


def lines(arguments, text=None):
    done = subprocess.run(arguments, input=text, capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def spread(values):
    low, *_, high = statistics.quantiles(values, n=20, method="inclusive")
    return f"{statistics.median(values):.5f} ({low:.4f} to {high:.4f})"


program, run, component = sys.argv[1:4]
count = int(sys.argv[4]) if len(sys.argv) > 4 else 400
with open(run + "/config.toml", "rb") as file:
    name = tomllib.load(file)["system"]
system = next(system for system in lines([program, "systems", "--json"]) if system["name"] == name)
names = system["coordinates"]
bounds = system["bounds"]["validation"]["position"]
generator = random.Random(0)
points = [[generator.uniform(*bound) for bound in bounds] for _ in range(count)]
table = "\n".join([",".join(names)] + [",".join(map(repr, point)) for point in points]) + "\n"
found = lines([program, "geometry", "--model", run, "--points", "-"], table)

component, _, coordinate = component.partition(":")
i, j = (names.index(part) for part in component.split(","))
weight = (lambda point: point[names.index(coordinate)] ** 2) if coordinate else (lambda point: 1.0)
factor = statistics.median(weight(point) * at["metric"][i][j] for point, at in zip(points, found))
scalar = [factor * at["ricci_scalar"] for at in found]
kretschmann = [factor**2 * at["kretschmann"] for at in found]
print(f"{name}, {count} points: c R {spread(scalar)}, c^2 K {spread(kretschmann)}")
print(f"K/R^2 {spread([k / r**2 for k, r in zip(kretschmann, scalar)])}")

"""Places of the planets from the Sun by JPL's ephemeris DE421, as a recording for `examples/mercury.rs`.

    pip install de421 jplephem numpy
    python examples/python/mercury.py planets.csv [FIRST LAST STEP]

writes a row every STEP days (0.5) from the Julian date FIRST (2447892.5, 1 January 1990) to LAST (2455197.5, 1 January 2010), barycentric
dynamical time: the date, and x, y, z of every planet from the Sun in km, in the axes of the ICRF. The Earth is its barycentre with the Moon.
"""

import sys

import de421
import numpy
from jplephem import Ephemeris

BODIES = ["mercury", "venus", "earthmoon", "mars", "jupiter", "saturn", "uranus", "neptune"]


def main() -> None:
    if len(sys.argv) not in (2, 5):
        sys.exit(__doc__)
    first, last, step = (float(word) for word in sys.argv[2:]) if len(sys.argv) == 5 else (2447892.5, 2455197.5, 0.5)
    ephemeris = Ephemeris(de421)
    if not (ephemeris.jalpha <= first < last <= ephemeris.jomega and 0.01 <= step <= 10.0):
        sys.exit(f"expected {ephemeris.jalpha} <= FIRST < LAST <= {ephemeris.jomega} and 0.01 <= STEP <= 10")
    dates = numpy.arange(first, last, step)
    sun = ephemeris.position("sun", dates)
    places = [ephemeris.position(body, dates) - sun for body in BODIES]
    names = [f"{body}_{axis}" for body in BODIES for axis in "xyz"]
    columns = numpy.vstack([dates, *places]).T
    with open(sys.argv[1], "x") as file:
        file.write(",".join(["jd", *names]) + "\n")
        for row in columns:
            file.write(",".join(repr(float(x)) for x in row) + "\n")


if __name__ == "__main__":
    main()

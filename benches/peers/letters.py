"""Letters that an arm of two joints draws, from the file of "Deep Lagrangian networks" as CSV.

    pip install dill numpy
    python benches/peers/letters.py character_data.pickle letters.csv

`character_data.pickle` is in `data` of github.com/milutter/deep_lagrangian_networks (at 18a943d). Positions are enough: the file's velocities and
accelerations are differences of them, which is checked here. Reading a pickle runs what it says: take the file from that repository alone.
"""

import sys

import dill
import numpy as np


def main(source, target):
    with open(source, "rb") as file:
        data = dill.load(file)
    with open(target, "w") as out:
        out.write("letter,t,q1,q2\n")
        for letter, t, q, v, a in zip(*(data[key] for key in ("labels", "t", "qp", "qv", "qa"))):
            step = t[1] - t[0]
            assert np.abs(np.gradient(q, step, axis=0) - v).max() < 1e-12, letter
            assert np.abs(np.gradient(v, step, axis=0) - a).max() < 1e-12, letter
            for time, (q1, q2) in zip(t, q):
                out.write(f"{letter},{float(time)!r},{float(q1)!r},{float(q2)!r}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""One engine at work in a process of its own, by lines of standard input; the same protocol as the Rust side.

`setup DIR N WIDTH BATCH PRECISION ALPHA` answers with the seconds of compiling, `check DIR` with the relative errors of loss
and gradient against those in DIR, `step SECONDS` with the nanoseconds of every run.
"""

import os
import sys
import time

THREADS = 2
for variable in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = str(THREADS)

import numpy as np

from engines import ENGINES


def read(directory, name):
    return np.fromfile(os.path.join(directory, name), dtype="<f8")


def layers(flat, n, width):
    """Weights and biases of three hidden layers, then the output's weights."""
    shapes, weights, start = [(width, 2 * n), (width, width), (width, width)], [], 0
    for out, into in shapes:
        weights.append(flat[start : start + out * into].reshape(out, into))
        weights.append(flat[start + out * into : start + out * into + out])
        start += out * into + out
    return weights + [flat[start : start + width].reshape(1, width)]


def inputs(directory, n, width, alpha):
    weights = layers(read(directory, "weights"), n, width)
    states = {name: read(directory, name).reshape(-1, n) for name in "xwa"}
    return {"weights": weights, "alpha": alpha, **states}


def relative(found, expected):
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def serve(engine):
    evaluate = None
    for line in sys.stdin:
        command, *words = line.split()
        if command == "setup":
            directory, n, width, _batch, precision, alpha = words
            given = inputs(directory, int(n), int(width), float(alpha))
            start = time.perf_counter()
            evaluate = engine(given, precision)
            evaluate()
            print(time.perf_counter() - start, flush=True)
        elif command == "check":
            loss, gradients = evaluate()
            gradient = np.concatenate([np.asarray(g, dtype=np.float64).ravel() for g in gradients])
            found = np.array([float(loss)])
            errors = relative(found, read(words[0], "loss")), relative(gradient, read(words[0], "gradient"))
            print(*errors, flush=True)
        elif command == "step":
            evaluate()
            begin, times = time.perf_counter(), []
            while len(times) < 3 or time.perf_counter() - begin < float(words[0]):
                start = time.perf_counter_ns()
                evaluate()
                times.append(time.perf_counter_ns() - start)
            print(*times, flush=True)


if __name__ == "__main__":
    engine = ENGINES[sys.argv[1]]
    if sys.argv[1].startswith("PyTorch"):
        import torch

        torch.set_num_threads(THREADS)
    serve(engine)

"""Training steps of lnn and of its peers in turns: the same network, inputs, machine and threads; one table.

    python compare.py PROGRAM [--quick] [--out DIR]

PROGRAM is the built benchmark `peers`. Loss and gradient of every engine must agree with lnn's before it is timed, in f64 to
1e-9 and in f32 to 1e-3, with the penalty active and not. Times are medians over rounds in which every engine has its turn;
ratios are medians of the ratios within a round.
"""

import argparse
import csv
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time

from engines import ENGINES

WIDTH, BATCH = 500, 128
CASES = [(2, "f32"), (4, "f32"), (2, "f64")]
TOLERANCE = {"f32": 1e-3, "f64": 1e-9}
HERE = os.path.dirname(os.path.abspath(__file__))


class Engine:
    """A process that answers line by line."""

    def __init__(self, name, command):
        self.name = name
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, *words):
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer or answer.startswith("error"):
            raise SystemExit(f"{self.name}: {words[0]}: {answer.strip() or 'ended without an answer'}")
        return [float(word) for word in answer.split()]

    def time(self, what, seconds):
        # Threads of the engine before may still spin.
        time.sleep(0.2)
        return statistics.median(self.ask(what, seconds)) / 1e6

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def check(ours, engine, directory, n, precision):
    """Agreement at small width, once with all mass matrices positive (alpha = 1) and once without (alpha = 0)."""
    for alpha in (1.0, 0.0):
        setup = ("setup", directory, n, 32, BATCH, precision, alpha)
        ours.ask(*setup)
        engine.ask(*setup)
        errors = engine.ask("check", directory)
        # Indefinite matrices are nearly singular in some states, whose accelerations f32 loses.
        if precision == "f64" or alpha == 1.0:
            if not max(errors) <= TOLERANCE[precision]:
                raise SystemExit(f"{engine.name}: n = {n}, {precision}, alpha = {alpha}: loss and gradient off by {errors}")


def case(ours, engines, n, precision, rounds, seconds):
    with tempfile.TemporaryDirectory() as directory:
        for engine in engines:
            check(ours, engine, directory, n, precision)
        setup = ("setup", directory, n, WIDTH, BATCH, precision, 1.0)
        ours.ask(*setup)
        compile_seconds = {engine.name: engine.ask(*setup)[0] for engine in engines}
        for engine in engines:
            errors = engine.ask("check", directory)
            if not max(errors) <= TOLERANCE[precision]:
                raise SystemExit(f"{engine.name}: n = {n}, {precision}: loss and gradient off by {errors}")
        times = {"lnn": [], "lnn, bare products": [], "lnn, accelerations alone": []} | {e.name: [] for e in engines}
        for _ in range(rounds):
            times["lnn"].append(ours.time("step", seconds))
            times["lnn, bare products"].append(ours.time("products", seconds))
            times["lnn, accelerations alone"].append(ours.time("accelerations", seconds))
            for engine in engines:
                times[engine.name].append(engine.time("step", seconds))
    rows = []
    for name, values in times.items():
        ratios = [value / lnn for value, lnn in zip(values, times["lnn"])]
        rows.append([n, precision, name, statistics.median(values), min(values), statistics.median(ratios),
                     min(ratios), max(ratios), compile_seconds.get(name, 0.0)])
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--quick", action="store_true", help="one round of one case")
    parser.add_argument("--out", default=".")
    options = parser.parse_args()
    rounds, seconds, cases = (1, 0.3, CASES[:1]) if options.quick else (7, 1.0, CASES)
    worker = os.path.join(HERE, "worker.py")
    engines = [Engine(name, [sys.executable, worker, name]) for name in ENGINES]
    ours = Engine("lnn", [options.program, "serve"])
    header = ["n", "precision", "engine", "median ms", "least ms", "times lnn", "least", "most", "compile s"]
    print(f"training step without optimiser, 3 hidden layers of {WIDTH}, batch {BATCH}, 2 threads; {platform.platform()}")
    print("| " + " | ".join(header) + " |\n|" + "---|" * len(header))
    rows = []
    for n, precision in cases:
        for row in case(ours, engines, n, precision, rounds, seconds):
            rows.append(row)
            cells = [f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row]
            print("| " + " | ".join(cells) + " |", flush=True)
    os.makedirs(options.out, exist_ok=True)
    with open(os.path.join(options.out, "peers.csv"), "w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
    for engine in [ours, *engines]:
        engine.close()


if __name__ == "__main__":
    main()

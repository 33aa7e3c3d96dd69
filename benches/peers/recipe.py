"""The paper's training of the double pendulum in PyTorch, validation loss against time.

    python recipe.py PROGRAM [--minutes 30] [--threads 2] [--out FILE.csv]

PROGRAM is the built benchmark `peers`, which writes the states and initial weights of `lnn train double-pendulum --preset
paper`. Three hidden layers of 500, GELU, nested reverse mode, pseudo-inverse, eigenvalue penalty, RAdam with gradient clipping, one phase
after the other with cosine annealing. The curve has a row whenever a minute of training has passed and at every end of an epoch;
time in validation does not count. Draw it with `lnn-studies experiment time-to-accuracy --beside "PyTorch=FILE.csv"`.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time

import numpy as np
import torch
from torch.func import vmap

from engines import torch_model
from worker import layers

VALIDATED = 2000


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--out", default="recipe.csv")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    with tempfile.TemporaryDirectory() as directory:
        subprocess.run([options.program, "recipe", directory], check=True)
        recipe = json.load(open(os.path.join(directory, "recipe.json")))
        n = recipe["n"]
        read = lambda name: torch.tensor(np.fromfile(os.path.join(directory, name), dtype="<f8"), dtype=torch.float32)
        states = lambda name: [read(f"{name}.{part}").reshape(-1, n) for part in "xwa"]
        training = [states(f"training{k}") for k in range(len(recipe["phases"]))]
        validation = [part[:VALIDATED] for part in states("validation")]
        flat = np.fromfile(os.path.join(directory, "weights"), dtype="<f8")
    weights = [torch.tensor(w, dtype=torch.float32).requires_grad_() for w in layers(flat, n, recipe["width"])]
    acceleration, mass = torch_model(weights, recipe["alpha"])

    def loss(x, w, target):
        return (vmap(acceleration)(x, w) - target).abs().sum() / (2 * n * x.shape[0])

    spent, file = 0.0, open(options.out, "w")
    file.write("seconds,validation_loss\n")

    def validate():
        with torch.no_grad():
            found = float(loss(*validation))
        file.write(f"{spent},{found}\n")
        file.flush()
        print(f"{spent:.0f} s: {found:.6f}", flush=True)

    torch.manual_seed(0)
    last = 0.0
    for phase, (x, w, target) in zip(recipe["phases"], training):
        optimizer = torch.optim.RAdam(weights, lr=phase["rate"], weight_decay=recipe["weight_decay"])
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, T_max=phase["t_max"], eta_min=phase["eta_min"])
        for _ in range(phase["epochs"]):
            for rows in torch.randperm(len(x)).split(recipe["batch"]):
                start = time.perf_counter()
                optimizer.zero_grad()
                total = loss(x[rows], w[rows], target[rows])
                spectrum = torch.linalg.eigvalsh(vmap(mass)(x[rows], w[rows]))
                total = total + recipe["lambda"] * torch.relu(-spectrum).sum(1).mean()
                total.backward()
                torch.nn.utils.clip_grad_norm_(weights, recipe["clip"])
                optimizer.step()
                spent += time.perf_counter() - start
                if spent >= 60.0 * options.minutes:
                    return validate()
                if spent - last >= 60.0:
                    last = spent
                    validate()
            schedule.step()
            validate()


if __name__ == "__main__":
    main()

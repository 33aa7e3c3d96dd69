"""``python -m lnn.reader MODEL STATES.csv`` prints the terms of every state, one JSON object per line.

The CSV has the model's columns as header, in any order.
"""

from __future__ import annotations

import csv
import json
import math
import sys

import numpy as np

from . import ModelFile
from .functions import TERMS


def main(model: str, states: str) -> None:
    """Prints the terms of the states of a file."""
    file = ModelFile.load(model)
    with open(states, newline="") as table:
        rows = [[float(row[name]) for name in file.header["columns"]] for row in csv.DictReader(table)]
    q, v = np.split(np.array(rows), 2, axis=1)
    terms = file.to_numpy().terms(q, v)
    for k in range(len(rows)):
        print(json.dumps({name: finite(getattr(terms, name)[k].tolist()) for name in TERMS}))


def finite(value):
    """Numbers of any shape, those that are not finite as None, which JSON can say."""
    if isinstance(value, list):
        return [finite(part) for part in value]
    return value if math.isfinite(value) else None


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except (OSError, ValueError) as error:
        sys.exit(f"{sys.argv[1]}: {error}")

"""Every notebook runs from beginning to end, on its small budget."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
# What a notebook needs beside the package.
NEEDS = {"jax_optimiser": ["jax", "scipy"], "many_seeds": ["joblib", "dask"], "noisy_data": ["pandas"]}
NEEDS |= {"constraints_and_formula": ["sympy", "pandas"]}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    for module in ["ipykernel", "matplotlib", *NEEDS.get(path.stem, [])]:
        pytest.importorskip(module)
    book = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(book, timeout=180, resources={"metadata": {"path": path.parent}}).execute()


def test_progress_in_a_notebook_is_one_output_that_is_replaced():
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    work = """
import lnn
states = {"data.training": 200, "data.validation": 64, "data.test": 64}
learned = lnn.train("harmonic-oscillator", hidden=[4], epochs=300, starts=1, config=states, progress=True)
"""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(work)])
    nbclient.NotebookClient(book, timeout=180).execute()
    (shown,) = book.cells[0].outputs
    assert shown["output_type"] == "display_data"
    lines = shown["data"]["text/plain"].splitlines()
    bars = [line for line in lines if "[" in line and "%" in line]
    assert len(bars) == 1 and "#" * 30 in bars[0] and "100%" in bars[0] and "epoch 300: validation loss" in bars[0]
    assert len(lines) < 20


def test_notebooks_are_stored_without_what_they_print():
    assert len(NOTEBOOKS) >= 6
    for path in NOTEBOOKS:
        for cell in json.loads(path.read_text())["cells"]:
            assert cell["cell_type"] == "markdown" or (cell["outputs"] == [] and cell["execution_count"] is None), path.name

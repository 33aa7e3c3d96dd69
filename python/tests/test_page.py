"""Pages to play with: their JavaScript beside the compiled code, where node is."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from kinds import Q, V, kinds

import lnn

SCRIPT = """
const html = require('fs').readFileSync(process.argv[1], 'utf8');
const parts = [...html.matchAll(/<script([^>]*)>([^]*?)<\\/script>/g)].map((match) => match[2]);
const shell = { module: { exports: {} } };
new Function('module', parts[1])(shell.module);
const { learned, exact } = shell.module.exports.load(JSON.parse(parts[0]));
const states = JSON.parse(process.argv[2]);
const of = (motion) => motion && states.map(([q, v]) => motion.terms(q, v));
console.log(JSON.stringify({ learned: of(learned), exact: of(exact) }));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")
@pytest.mark.parametrize("kind", [*kinds(), "shipped"])
def test_a_page_computes_what_the_package_computes(models, shipped, kind, tmp_path):
    if kind == "shipped":
        model, q, v = lnn.Model.load(shipped), Q[:, :2], V[:, :2]
    else:
        model, q, v = lnn.Model.from_bytes(models[kind].to_bytes()), Q, V
    if "constraints" in kind:
        with pytest.raises(ValueError, match="constraints"):
            model.page(tmp_path / "play.html")
        return
    model.page(tmp_path / "play.html")
    html = (tmp_path / "play.html").read_text()
    assert len(html) < 500_000 and not re.search(r"https?://|\ssrc=", html)
    states = json.dumps([[a.tolist(), b.tolist()] for a, b in zip(q, v)])
    result = subprocess.run(["node", "-e", SCRIPT, tmp_path / "play.html", states], capture_output=True, text=True)
    result = json.loads(result.stdout or result.stderr)
    terms = model.terms(q, v)
    for theirs, ours in [("lagrangian",) * 2, ("momentum",) * 2, ("mass", "mass_matrix"), ("acceleration",) * 2]:
        found = np.array([row[theirs] for row in result["learned"]], float)
        expected = getattr(terms, ours)
        assert np.abs(found - expected).max() <= 1e-5 * np.abs(expected).max(), ours
    if kind == "shipped":
        exact = lnn.System("double-pendulum").terms(q, v)
        found = np.array([row["acceleration"] for row in result["exact"]])
        assert np.abs(found - exact.acceleration).max() <= 1e-12 * np.abs(exact.acceleration).max()

"""Pages to play with: their JavaScript beside the compiled code, where node is, and what they do in a browser, where Chromium is."""

import json
import re
import shutil
import subprocess
from html import unescape

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


CHROMIUM = next(filter(None, map(shutil.which, ["chromium", "chromium-browser", "google-chrome"])), None)

WATCH = "<script>window.problems = []; window.addEventListener('error', (event) => problems.push(event.message))</script>"
REPORT = """<pre id="result"></pre><script>
const send = (type, where, more) => where.dispatchEvent(new (more.key ? KeyboardEvent : PointerEvent)(type, { bubbles: true, cancelable: true, ...more }));
(async () => {
  const result = await (async () => { %s })();
  document.getElementById("result").textContent = JSON.stringify({ problems, ...result });
})();
</script>"""


def in_chromium(page, script, *options):
    """What a script says that runs at the end of the page, problems of the page among it."""
    html = page.read_text().replace("<head>", "<head>" + WATCH, 1).replace("</body>", REPORT % script + "</body>")
    watched = page.with_name("watched.html")
    watched.write_text(html)
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--allow-file-access-from-files"]
    command += [f"--user-data-dir={page.parent}", "--virtual-time-budget=15000", *options, "--dump-dom", watched.as_uri()]
    text = subprocess.run(command, capture_output=True, text=True, timeout=120).stdout
    return json.loads(unescape(re.search('<pre id="result">(.*?)</pre>', text)[1]))


@pytest.fixture
def play(shipped, tmp_path):
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    lnn.Model.load(shipped).page(tmp_path / "play.html")
    return tmp_path / "play.html"


def test_a_page_in_a_browser_computes_what_the_package_computes(play, shipped):
    states = json.dumps([[q.tolist(), v.tolist()] for q, v in zip(Q[:, :2], V[:, :2])])
    script = f"""
      const both = load(JSON.parse(document.getElementById("data").textContent));
      const of = (motion) => {states}.map(([q, v]) => motion.terms(q, v));
      return {{ learned: of(both.learned), exact: of(both.exact) }};
    """
    found = in_chromium(play, script)
    assert found["problems"] == []
    for name, moves, tolerance in [("learned", lnn.Model.load(shipped), 1e-5), ("exact", lnn.System("double-pendulum"), 1e-12)]:
        terms = moves.terms(Q[:, :2], V[:, :2])
        for theirs, ours in [("lagrangian",) * 2, ("momentum",) * 2, ("mass", "mass_matrix"), ("acceleration",) * 2]:
            there, here = np.array([row[theirs] for row in found[name]]), getattr(terms, ours)
            assert np.abs(there - here).max() <= tolerance * np.abs(here).max(), (name, ours)


def test_a_page_is_played_by_keys_and_by_dragging(play):
    script = """
      const text = (id) => document.getElementById(id).textContent, stage = document.getElementById("stage");
      const wait = (time) => new Promise((done) => setTimeout(done, time));
      const seen = { start: text("time"), drawn: stage.getContext("2d").getImageData(0, 0, stage.width, stage.height).data.some((x) => x > 0) };
      stage.focus();
      seen.focus = document.activeElement.id;
      send("keydown", stage, { key: "." });
      seen.stepped = text("time");
      send("keydown", stage, { key: " " });
      seen.playing = text("run");
      // A busy machine draws its first picture late.
      for (let k = 0; k < 100 && text("time") === seen.stepped; k++) await wait(100);
      send("keydown", stage, { key: " " });
      [seen.played, seen.paused] = [text("time"), text("run")];
      send("keydown", stage, { key: "r" });
      seen.again = text("time");
      // The outer bob is taken to the right of the inner one, hanging straight down, and let go.
      stage.setPointerCapture = () => {};
      const box = stage.getBoundingClientRect(), unit = box.width / 2 / 2.2, at = (x, y) => ({
        clientX: box.left + box.width / 2 + unit * x, clientY: box.top + box.height / 2 - unit * y, pointerId: 1,
      });
      player.start.q = [0, 0];
      send("keydown", stage, { key: "r" });
      send("pointerdown", stage, at(0, -2));
      send("pointermove", stage, at(1, -1));
      seen.dragged = player.start.q.concat(player.start.v);
      send("pointerup", stage, at(1, -1));
      seen.dropped = text("run");
      send("keydown", stage, { key: " " });
      // A slider of a parameter moves the exact system.
      const slider = document.querySelector("#parameters input"), before = text("reading");
      slider.value = 2;
      send("input", slider, { pointerId: 1 });
      seen.moved = text("reading") !== before;
      seen.reached = [...document.querySelectorAll("canvas#stage, button, input")].every((x) => x.tabIndex === 0);
      return seen;
    """
    seen = in_chromium(play, script)
    assert seen["problems"] == [] and seen["drawn"] and seen["focus"] == "stage" and seen["reached"] and seen["moved"]
    assert seen["start"].startswith("t = 0.00 s") and seen["stepped"].startswith("t = 0.02 s") and seen["again"] == seen["start"]
    time_of = lambda text: float(text.split()[2])
    assert seen["playing"] == "Pause" and seen["paused"] == "Play" and time_of(seen["played"]) > time_of(seen["stepped"])
    assert np.allclose(seen["dragged"], [0, np.pi / 2, 0, 0], atol=1e-6) and seen["dropped"] == "Pause"


SMALL = {"hidden": [6], "epochs": 2, "threads": 1, "starts": 1, "structure": "constant-mass"}
STATES = {"data.training": 256, "data.validation": 64, "data.test": 64}


@pytest.fixture(scope="module", params=["cartesian-chain-2", "particle-on-sphere"])
def held(request, tmp_path_factory):
    """A system under constraints, a model of it, and its page."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    system, folder = lnn.System(request.param), tmp_path_factory.mktemp("held")
    model = lnn.train(system, **SMALL, config=STATES).model
    model.page(folder / "play.html")
    return system, model, folder / "play.html"


def test_a_page_under_constraints_moves_as_the_package_moves(held):
    system, model, page = held
    script = """
      const data = JSON.parse(document.getElementById("data").textContent), both = load(data), n = data.columns.length / 2;
      const found = { start: data.start, span: data.span / 40 };
      for (const [kind, motion] of Object.entries(both)) {
        const flight = new Flight(motion, data.start.q, data.start.v, 0.01), terms = motion.terms(data.start.q, data.start.v);
        flight.advance(found.span, Infinity, 1e-9, 1e-11);
        const q = flight.y.slice(0, n), v = flight.y.slice(n);
        found[kind] = { ...terms, q, v, off: motion.distance(q, v), ended: flight.ended };
      }
      return found;
    """
    found = in_chromium(page, script)
    assert found["problems"] == [] and page.stat().st_size < 500_000
    q, v = np.array(found["start"]["q"]), np.array(found["start"]["v"])
    for kind, moves, tolerance in [("learned", model, 1e-5), ("exact", system, 1e-7)]:
        there, terms = found[kind], moves.terms(q, v)
        for theirs, ours in [("lagrangian",) * 2, ("momentum",) * 2, ("mass", "mass_matrix"), ("acceleration",) * 2]:
            here = np.asarray(getattr(terms, ours))
            assert np.abs(np.array(there[theirs]) - here).max() <= tolerance * np.abs(here).max(), (kind, ours)
        motion = moves.rollout(q, v, t_end=found["span"], dt=found["span"], method="dop853", rtol=1e-11, atol=1e-12)
        for theirs, ours in [("q", motion.q[-1]), ("v", motion.v[-1])]:
            assert np.abs(np.array(there[theirs]) - ours).max() <= tolerance * max(1, np.abs(ours).max()), (kind, theirs)
        assert there["ended"] is None and there["off"] < 1e-14
    # An orthonormal basis of what the constraints leave: the determinant does not depend on which.
    gradient = 2 * q[None] if len(q) == 3 else 2 * np.array([[*q[:2], 0, 0], [*(q[:2] - q[2:]), *(q[2:] - q[:2])]])
    free = np.linalg.svd(gradient)[2][len(gradient) :]
    for kind, moves in [("learned", model), ("exact", system)]:
        within = np.linalg.det(free @ moves.mass_matrix(q, v) @ free.T)
        assert abs(found[kind]["determinant"] - within) <= 1e-5 * abs(within), kind


def test_a_page_under_constraints_is_played_on_them(held):
    _, model, page = held
    solid = len(model.coordinates) == 3
    script = """
      const text = (id) => document.getElementById(id).textContent, stage = document.getElementById("stage"), solid = SOLID;
      const data = JSON.parse(document.getElementById("data").textContent), { learned } = load(data), picture = pictureOf(data, learned);
      const off = () => learned.distance(player.start.q, player.start.v);
      const pixels = () => stage.toDataURL();
      stage.setPointerCapture = () => {};
      const box = stage.getBoundingClientRect(), unit = box.width / 2 / picture.reach();
      const at = ([x, y]) => ({ clientX: box.left + box.width / 2 + unit * x, clientY: box.top + box.height / 2 - unit * y, pointerId: 1 });
      const bobs = () => picture.joints(player.flights()[0].y).slice(1), last = () => bobs()[bobs().length - 1];
      const seen = { held: text("held"), turned: document.getElementById("turned").hidden, begun: off(), rods: picture.links(player.start.q, learned).length };
      // A bob is dragged to a place that it cannot reach, and to one that it can.
      send("pointerdown", stage, at(last()));
      send("pointermove", stage, at([9, 0]));
      seen.far = [off(), last()[0] - bobs().reduce((least, bob) => Math.min(least, bob[0]), 9)];
      const place = solid ? [0.3, 0.2] : [0.5, -0.9];
      send("pointermove", stage, at(place));
      seen.near = [off(), Math.hypot(last()[0] - place[0], last()[1] - place[1])];
      send("pointerup", stage, at(place));
      seen.dropped = text("run");
      for (let k = 0; k < 20; k++) player.advance(0.02);
      seen.moved = learned.distance(player.flights()[0].y.slice(0, data.columns.length / 2), player.flights()[0].y.slice(data.columns.length / 2));
      send("keydown", stage, { key: " " });
      send("keydown", stage, { key: "r" });
      // The value under the cursor is one on the constraints.
      send("pointermove", stage, at([0.4, -0.5]));
      seen.reading = text("reading");
      send("pointerleave", stage, {});
      // A slider of a coordinate, and one of a parameter of the system.
      const [slider] = document.querySelectorAll("#states input"), parameter = [...document.querySelectorAll("#parameters .slide")].find((row) => /^[lR] /.test(row.textContent)).querySelector("input");
      slider.value = 0.5;
      send("input", slider, { pointerId: 1 });
      seen.slid = [off(), player.start.q[0] - slider.value];
      const before = player.flights()[1].y.slice();
      parameter.value = 0.7;
      send("input", parameter, { pointerId: 1 });
      seen.size = Math.hypot(...player.flights()[1].y.slice(0, solid ? 3 : 2)) - parameter.value;
      seen.other = before.some((x, i) => x !== player.flights()[1].y[i]);
      // The view.
      const [q, drawn] = [player.start.q.slice(), pixels()];
      stage.focus();
      send("keydown", stage, { key: "ArrowLeft" });
      const keyed = pixels();
      send("pointerdown", stage, at([-0.95 * picture.reach(), 0.95 * picture.reach()]));
      send("pointermove", stage, at([-0.5 * picture.reach(), 0.95 * picture.reach()]));
      send("pointerup", stage, at([-0.5 * picture.reach(), 0.95 * picture.reach()]));
      seen.view = [keyed !== drawn, pixels() !== keyed, q.every((x, i) => x === player.start.q[i])];
      return seen;
    """
    seen = in_chromium(page, script.replace("SOLID", "true" if solid else "false"))
    assert seen["problems"] == [] and seen["begun"] < 1e-14 and "= 0" in seen["held"]
    assert seen["rods"] == (1 if solid else 2) and seen["turned"] != solid
    for off, _ in [seen["far"], seen["near"], seen["slid"]]:
        assert off < 1e-14
    # The outer bob is drawn to the right as far as the rods reach, and follows to where it can be.
    assert solid or seen["far"][1] > 0.99
    assert seen["near"][1] < 1e-3 and seen["dropped"] == "Pause" and seen["moved"] < 1e-14
    assert "under the cursor" in seen["reading"] and "det M within the constraints" in seen["reading"]
    assert abs(seen["slid"][1]) < 1e-6 and abs(seen["size"]) < 1e-9 and seen["other"]
    # In space the background turns the view; in a plane there is nothing to turn.
    assert not solid or seen["view"] == [True, True, True]


@pytest.mark.parametrize("width", [420, 1200])
@pytest.mark.parametrize("dark", [False, True])
def test_a_page_fits_its_window_light_and_dark(play, width, dark):
    frame = play.with_name("frame.html")
    frame.write_text(f'<html><head></head><body><iframe id="f" src="play.html" width="{width}" height="900" style="border:0"></iframe></body></html>')
    script = """
      const frame = document.getElementById("f"), inside = frame.contentDocument;
      if (inside.readyState !== "complete" || !inside.getElementById("stage")) await new Promise((done) => frame.addEventListener("load", done));
      const page = frame.contentDocument, box = page.getElementById("stage").getBoundingClientRect();
      const style = frame.contentWindow.getComputedStyle(page.body);
      return { wide: page.documentElement.scrollWidth, stage: box.width, ground: style.backgroundColor, text: style.color };
    """
    # 0 is dark.
    seen = in_chromium(frame, script, "--window-size=1300,1000", f"--blink-settings=preferredColorScheme={0 if dark else 1}")
    assert seen["problems"] == [] and seen["wide"] <= width and seen["stage"] > (360 if width == 420 else 500)
    light = lambda colour: sum(map(int, re.findall(r"\d+", colour)[:3])) / 3
    assert (light(seen["ground"]) < 60 and light(seen["text"]) > 200) if dark else (light(seen["ground"]) > 240 and light(seen["text"]) < 60)

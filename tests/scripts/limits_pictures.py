"""Pictures of docs/limits.md: python3 tests/scripts/limits_pictures.py LNN [FOLDER]

Reads the system files of that page, repeats its experiments from several starts, and writes limits-gauge.svg, limits-factor.svg and limits-blocks.svg,
by default to docs.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
BLUE, ORANGE, DARK, LIGHT = "#0072b2", "#d55e00", "#1c2330", "#e6e9ee"
STARTS = [(0.3, 6), (0.6, 1), (1, 12), (1.5, 3), (2.5, 2), (3, 14), (4, 9), (5, 5)]


def lnn(*arguments):
    done = subprocess.run([program, *arguments], cwd=scratch, capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def panel(left, title, axes, ranges, curves=(), points=(), legend=()):
    """One plot of 300 by 250: curves are (colour, width, dash, xs, ys), points (colour, xs, ys), the legend (colour, text)."""
    (x_name, y_name), ((x0, x1), (y0, y1)) = axes, ranges
    x = lambda value: left + 58 + 232 * (value - x0) / (x1 - x0)
    y = lambda value: 236 - 178 * (value - y0) / (y1 - y0)
    out = [f'<text x="{left + 58}" y="20" font-size="14" font-weight="600">{title}</text>']
    for k, (colour, name) in enumerate(legend):
        out.append(f'<text x="{left + 58 + 132 * k}" y="42" font-size="12" fill="{colour}">{name}</text>')
    for k in range(5):
        tick_x, tick_y = x0 + (x1 - x0) * k / 4, y0 + (y1 - y0) * k / 4
        out.append(f'<path d="M{x(tick_x):.1f} 236V58M{x(x0):.1f} {y(tick_y):.1f}H{x(x1):.1f}" stroke="{LIGHT}" fill="none"/>')
        out.append(f'<text x="{x(tick_x):.1f}" y="252" font-size="12" text-anchor="middle">{tick_x:g}</text>')
        out.append(f'<text x="{x(x0) - 6:.1f}" y="{y(tick_y) + 4:.1f}" font-size="12" text-anchor="end">{tick_y:g}</text>')
    for colour, width, dash, xs, ys in curves:
        line = "L".join(f"{x(a):.1f} {y(b):.1f}" for a, b in zip(xs, ys))
        out.append(f'<path d="M{line}" stroke="{colour}" stroke-width="{width}" stroke-dasharray="{dash}" fill="none"/>')
    for colour, xs, ys in points:
        out += [f'<circle cx="{x(a):.1f}" cy="{y(b):.1f}" r="4.5" fill="{colour}"/>' for a, b in zip(xs, ys)]
    out.append(f'<rect x="{x(x0):.1f}" y="58" width="232" height="178" stroke="{DARK}" stroke-width="0.8" fill="none"/>')
    out.append(f'<text x="{left + 174}" y="272" font-size="13" text-anchor="middle">{x_name}</text>')
    out.append(f'<text transform="translate({left + 14} 147) rotate(-90)" font-size="13" text-anchor="middle">{y_name}</text>')
    return "\n".join(out)


def picture(name, panels):
    width = 310 * len(panels)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} 280" width="{width}" height="280" fill="{DARK}" '
    head += 'font-family="system-ui,-apple-system,Segoe UI,Roboto,Helvetica,Arial,sans-serif">\n<rect width="100%" height="100%" fill="#fff"/>\n'
    (folder / name).write_text(head + "\n".join(panels) + "\n</svg>\n")


def gauge():
    times = [0.05 * k for k in range(161)]
    lnn("rollout", "--system", "oscillator.toml", "--state", "1,0", "--t-end", "8", "--dt", "0.05", "--out", "free.csv")
    first, second = (lnn("inspect", "--system", f"{name}.toml", "--states", "free.csv") for name in ("oscillator", "gauged"))
    panels = []
    kinds = [("L along the motion", "L [J]", "lagrangian", 10), ("momentum", "p [kg m/s]", "momentum", 6), ("acceleration", "a [m/s^2]", "acceleration", 6)]
    for k, (title, unit, key, size) in enumerate(kinds):
        value = lambda term: term[key] if key == "lagrangian" else term[key][0]
        curves = [(BLUE, 4, "none", times, list(map(value, first))), (ORANGE, 1.6, "none", times, list(map(value, second)))]
        panels.append(panel(310 * k, title, ("t [s]", unit), ((0, 8), (-size, size)), curves, legend=[(BLUE, "L"), (ORANGE, "L + dF/dt")]))
    picture("limits-gauge.svg", panels)


def values(data, system, names, starts, fixed=()):
    """Constants that an identification gives from several starts."""
    found = []
    for start in starts:
        given = [word for name, value in zip(names, start) for word in ("--param", f"{name}={value}")]
        constants = lnn("identify", data, "--system", system, *given, *fixed, "--json")[0]["constants"]
        found.append([constants[name]["value"] for name in names])
    return list(zip(*found))


def factor():
    lnn("rollout", "--system", "oscillator.toml", "--state", "1,0", "--t-end", "20", "--dt", "0.05", "--out", "free.csv", "--overwrite")
    lnn("rollout", "--system", "pulled.toml", "--state", "1,0", "--t-end", "20", "--dt", "0.05", "--out", "pulled.csv")
    panels = []
    for k, (title, data, system) in enumerate([("free motion", "free.csv", "oscillator.toml"), ("under a known pull of 2 N", "pulled.csv", "pulled.toml")]):
        masses, springs = values(data, system, ("m", "k"), STARTS)
        ray = ("#9aa4b2", 1, "4 3", (0, 4), (0, 16))
        legend = [(BLUE, "found from 8 starts"), ("#6b7686", "k/m = 4 /s^2")]
        panels.append(panel(310 * k, title, ("m [kg]", "k [N/m]"), ((0, 4), (0, 16)), [ray], [(BLUE, masses, springs)], legend))
    picture("limits-factor.svg", panels)


def blocks():
    lnn("rollout", "--system", "blocks.toml", "--state", "1,0.5,0,0", "--t-end", "20", "--dt", "0.05", "--out", "blocks.csv")
    coupled = ["--param", "k=3"]
    lnn("rollout", "--system", "blocks.toml", *coupled, "--state", "1,0.5,0,0", "--t-end", "20", "--dt", "0.05", "--out", "coupled.csv")
    panels = []
    kinds = [("two springs that do not couple", "blocks.csv", ["--constants", "m1,k1,m2,k2"]), ("coupled by a third spring", "coupled.csv", coupled)]
    for k, (title, data, fixed) in enumerate(kinds):
        first, second = values(data, "blocks.toml", ("m1", "m2"), [(a, b / 2) for a, b in STARTS], fixed)
        ray = ("#9aa4b2", 1, "4 3", (0, 4), (0, 8))
        legend = [(BLUE, "found from 8 starts"), ("#6b7686", "m2/m1 = 2")]
        panels.append(panel(310 * k, title, ("m1 [kg]", "m2 [kg]"), ((0, 4), (0, 8)), [ray], [(BLUE, first, second)], legend))
    picture("limits-blocks.svg", panels)


program = str(Path(sys.argv[1]).resolve())
folder = Path(sys.argv[2] if len(sys.argv) > 2 else DOCS).resolve()
with tempfile.TemporaryDirectory() as scratch:
    page = (DOCS / "limits.md").read_text()
    for name, content in re.findall(r"^```toml\n# (\S+)\n(.*?)^```", page, re.M | re.S):
        (Path(scratch) / name).write_text(content)
    gauge()
    factor()
    blocks()

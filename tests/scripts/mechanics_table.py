"""Writes ../data/mechanics.csv: Euler-Lagrange terms of the systems in 60 digits (needs mpmath).

Derivatives of L by mpmath's numerical differentiation at 120 digits; nothing is shared with the Rust formulas.
Columns: state rows `s,id,system,parameters,q,v`; value rows `v,id,quantity,index,high,low` with high + low exact.
"""
import random
from mpmath import mp, mpf, matrix, lu_solve, cos, sin, sqrt, eigsy

mp.dps = 120

def chain(n, m, l, g, q, v):
    # Cartesian positions and velocities of the masses.
    t = u = mpf(0)
    x = y = dx = dy = mpf(0)
    for i in range(n):
        dx += l[i] * v[i] * cos(q[i])
        dy += l[i] * v[i] * sin(q[i])
        y += l[i] * cos(q[i])
        t += m[i] * (dx * dx + dy * dy) / 2
        u -= m[i] * g * y
    return t - u

SYSTEMS = {
    "double-pendulum": (2, ["m1", "m2", "l1", "l2", "g"], lambda p, q, v: chain(2, p[0:2], p[2:4], p[4], q, v)),
    "triple-pendulum": (3, ["m1", "m2", "m3", "l1", "l2", "l3", "g"],
                        lambda p, q, v: chain(3, p[0:3], p[3:6], p[6], q, v)),
    "n-pendulum": (5, ["m", "l", "g"], lambda p, q, v: chain(5, [p[0]] * 5, [p[1]] * 5, p[2], q, v)),
    "spring-pendulum": (2, ["m", "k", "l0", "g"], lambda p, q, v: p[0] * (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2
                        + p[0] * p[3] * q[0] * cos(q[1]) - p[1] * (q[0] - p[2]) ** 2 / 2),
    "sphere-geodesic": (2, ["m", "R"], lambda p, q, v: p[0] * p[1] ** 2 * (v[0] ** 2 + (sin(q[0]) * v[1]) ** 2) / 2),
}

def interval(metric, v):
    """Half of g(v, v), the metric diagonal."""
    return sum(g * u * u for g, u in zip(metric, v)) / 2

def schwarzschild(mass, q, v):
    lapse = (q[1] - 2 * mass) / q[1]
    return interval([-lapse, 1 / lapse, q[1] ** 2, (q[1] * sin(q[2])) ** 2], v)

def ads(n):
    return n, ["L"], lambda p, q, v: interval([-(p[0] / q[-1]) ** 2] + [(p[0] / q[-1]) ** 2] * (n - 1), v)

def charged(p, q, v):
    m, charge, c, b, e = p
    field = [-b * q[1] / 2, b * q[0] / 2, 0]
    coupling = sum(a * u for a, u in zip(field, v)) + e * q[0]
    return -m * c * sqrt(c * c - sum(u * u for u in v)) + charge * coupling

# Systems with boxes of their own: coordinates and velocities drawn from the parameters.
OTHERS = {
    "constant-force": (1, ["m", "F"], lambda p, q, v: p[0] * v[0] ** 2 / 2 + p[1] * q[0]),
    "harmonic-oscillator": (1, ["m", "k"], lambda p, q, v: p[0] * v[0] ** 2 / 2 - p[1] * q[0] ** 2 / 2),
    "kepler": (2, ["mu"], lambda p, q, v: (v[0] ** 2 + v[1] ** 2) / 2 + p[0] / sqrt(q[0] ** 2 + q[1] ** 2)),
    "henon-heiles": (2, ["lambda"], lambda p, q, v: (v[0] ** 2 + v[1] ** 2 - q[0] ** 2 - q[1] ** 2) / 2
                     - p[0] * (q[0] ** 2 * q[1] - q[1] ** 3 / 3)),
    "charged-particle": (3, ["m", "q", "c", "B", "E"], charged),
    "ads2-geodesic": ads(2),
    "ads3-geodesic": ads(3),
    "ads4-geodesic": ads(4),
    "schwarzschild-geodesic": (4, ["M"], lambda p, q, v: schwarzschild(p[0], q, v)),
}

def draw(name, n, params, case):
    """A state of a system of its own box; the azimuth turns often in later cases."""
    q = [random.uniform(-2.0, 2.0) for _ in range(n)]
    v = [random.uniform(-1.5, 1.5) for _ in range(n)]
    if name == "charged-particle":
        v = [random.uniform(-0.55, 0.55) * params[2] for _ in range(n)]
    if name.startswith("ads"):
        q[-1] = random.uniform(0.3, 6.0)
    if name.startswith("schwarzschild"):
        q[1] = 2 * params[0] + random.uniform(0.05, 10.0)
        q[2] = random.uniform(0.3, 2.8)
        q[3] += [0, 0, 0, 2.0 ** 10, 2.0 ** 20, 2.0 ** 40][case]
    return q, v

def second(f, x, d, e):
    """Mixed second derivative along d and e; exact to about 60 digits by central differences at 1e-30."""
    h = mpf(10) ** -30
    at = lambda s, t: f([a + h * (s * b + t * c) for a, b, c in zip(x, d, e)])
    return (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * h * h)

def first(f, x, d):
    h = mpf(10) ** -30
    at = lambda s: f([a + h * s * b for a, b in zip(x, d)])
    return (at(1) - at(-1)) / (2 * h)

random.seed(7)
ident = 0
with open(__file__.rsplit("/", 2)[0] + "/data/mechanics.csv", "w") as out:
    for name, (n, symbols, lagrangian) in (SYSTEMS | OTHERS).items():
        for case in range(6):
            shift = [0, 0, 0, 2.0 ** 10, 2.0 ** 20, 2.0 ** 40][case]
            params = [1.0 if name in OTHERS or s[0] in "mlR" else 9.8125 if s == "g" else 40.0 for s in symbols]
            if case:
                params = [round(random.uniform(0.5, 3.0) * 64) / 64 for _ in symbols]
            if name in OTHERS:
                q, v = draw(name, n, params, case)
            else:
                q = [random.uniform(0.3, 2.8) + shift for _ in range(n)]
                if name in ("spring-pendulum", "sphere-geodesic"):
                    q[0] = random.uniform(0.3, 2.8)
                v = [random.uniform(-5, 5) for _ in range(n)]
            p = [mpf(x) for x in params]
            f = lambda x: lagrangian(p, x[:n], x[n:])
            x = [mpf(a) for a in q + v]
            e = lambda k: [mpf(int(i == k)) for i in range(2 * n)]
            flow = x[n:] + [mpf(0)] * n
            L = f(x)
            mom = [first(f, x, e(n + i)) for i in range(n)]
            g = [first(f, x, e(i)) for i in range(n)]
            M = matrix(n, n)
            for i in range(n):
                for j in range(n):
                    M[i, j] = second(f, x, e(n + i), e(n + j))
            M = (M + M.T) / 2
            c = [second(f, x, e(n + i), flow) for i in range(n)]
            a = lu_solve(M, matrix([b - d for b, d in zip(g, c)]))
            w = sorted(eigsy(M, eigvals_only=True))
            energy = sum(b * d for b, d in zip(mom, x[n:])) - L
            text = " ".join(f"{s}={t!r}" for s, t in zip(symbols, params))
            if name == "n-pendulum":
                text += " n=5"
            print(f"s,{ident},{name},{text},{' '.join(map(repr, q))},{' '.join(map(repr, v))}", file=out)
            for quantity, values in [("lagrangian", [L]), ("momentum", mom), ("dl_dq", g), ("mass_matrix", list(M)),
                                     ("eigenvalues", w), ("coriolis", c), ("acceleration", list(a)), ("energy", [energy])]:
                for k, value in enumerate(values):
                    high = float(value)
                    print(f"v,{ident},{quantity},{k},{high!r},{float(value - mpf(high))!r}", file=out)
            ident += 1

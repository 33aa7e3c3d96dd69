"""CasADi's interpreter on the functions of `cargo bench --bench hessians`: microseconds a point, the shortest of five means.

Then linearizations of the chain, compared with differences of the closed form, and what it takes to the first call."""
import time

import casadi as ca
import numpy as np


def shortest(call, seconds=0.05):
    call()
    count, times = 1, []
    while len(times) < 5:
        start = time.perf_counter()
        for _ in range(count):
            call()
        elapsed = time.perf_counter() - start
        if elapsed < seconds:
            count *= 2
        else:
            times.append(elapsed / count)
    return min(times) * 1e6


def numbers(count):
    return np.sin(0.37 * np.arange(count) + 0.1) + 0.5


def prepared(function, arguments):
    """The evaluation of a function of vectors, with buffers of its own: no conversion between calls."""
    buffer, call = function.buffer()
    kept = [np.ascontiguousarray(argument) for argument in arguments]
    kept += [np.zeros(function.nnz_out(k)) for k in range(function.n_out())]
    for k, argument in enumerate(kept[: len(arguments)]):
        buffer.set_arg(k, memoryview(argument))
    for k, result in enumerate(kept[len(arguments) :]):
        buffer.set_res(k, memoryview(result))
    # The buffers live as long as the call does.
    return lambda kept=(kept, buffer, function): call()


def equations(n, lagrangian):
    """Coordinates, velocities, the mass matrix M and the right-hand side g - c."""
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    value = lagrangian([q[i] for i in range(n)], [v[i] for i in range(n)])
    momentum = ca.gradient(value, v)
    return q, v, ca.hessian(value, v)[0], ca.gradient(value, q) - ca.jtimes(momentum, q, v)


def terms(name, n, lagrangian):
    """The triangle of M, and the right-hand side g - c."""
    q, v, mass, right = equations(n, lagrangian)
    function = ca.Function("f", [q, v], [ca.triu(mass), right])
    x = numbers(2 * n)
    print(f"| {name}, M and g - c | {n} | {shortest(prepared(function, [x[:n], x[n:]])):.2f} | {function.n_instructions()} |")


def first_call(name, n, lagrangian):
    """Milliseconds from nothing to the first numbers, the least of three."""
    x, times = numbers(2 * n), []
    for _ in range(3):
        start = time.perf_counter()
        q, v, mass, right = equations(n, lagrangian)
        ca.Function("f", [q, v], [ca.triu(mass), right])(x[:n], x[n:])
        times.append(time.perf_counter() - start)
    print(f"| {name} | {n} | {min(times) * 1e3:.1f} |")


def acceleration(q, v):
    """That of the chain in closed form: rods i and j carry n - max(i, j) masses together."""
    n = len(q)
    shared = n - np.maximum.outer(np.arange(n), np.arange(n))
    turn = np.subtract.outer(q, q)
    return np.linalg.solve(shared * np.cos(turn), -(shared * np.sin(turn)) @ v**2 - 9.8 * np.diag(shared) * np.sin(q))


def linearized(n):
    """The acceleration of the chain and its derivatives by q and v: by the derivative of an elimination that is written out, and by one
    elimination of numbers for the acceleration and one for M da = d(g - c - M a), a held."""
    q, v, mass, right = equations(n, chain)
    state, held = ca.vertcat(q, v), ca.SX.sym("a", n)
    a = ca.ldl_solve(right, *ca.ldl(mass))
    yield "written out", ca.Function("f", [q, v], [a, ca.jacobian(a, state)], {"cse": True})
    system = ca.Function("s", [q, v], [mass, right], {"cse": True})
    slopes = ca.Function("d", [q, v, held], [ca.jacobian(right - mass @ held, state)], {"cse": True})
    q, v = ca.MX.sym("q", n), ca.MX.sym("v", n)
    mass, right = system(q, v)
    a = ca.solve(mass, right, "ldl")
    yield "by numbers", ca.Function("f", [q, v], [a, ca.solve(mass, slopes(q, v, a), "ldl")])


def linearization(n):
    x, step = numbers(2 * n), 1e-5
    differences = [acceleration(*np.split(x + dx, 2)) - acceleration(*np.split(x - dx, 2)) for dx in step * np.eye(2 * n)]
    exact = np.stack(differences, 1) / (2 * step)
    times = []
    for way, function in linearized(n):
        a, slopes = (found.full() for found in function(x[:n], x[n:]))
        assert np.allclose(a[:, 0], acceleration(x[:n], x[n:]), rtol=1e-11, atol=1e-11), way
        assert abs(slopes - exact).max() < 1e-8 * abs(exact).max(), way
        times.append(f"{shortest(prepared(function, [x[:n], x[n:]])):.2f}")
    print(f"| chain, da/dq and da/dv | {n} | {' | '.join(times)} |")


def chain(q, v):
    x = y = height = value = 0
    for i in range(len(q)):
        x, y, height = x + v[i] * ca.cos(q[i]), y + v[i] * ca.sin(q[i]), height + ca.cos(q[i])
        value = value + (x**2 + y**2) / 2 + 9.8 * height
    return value


def lattice(q, v):
    springs = [q[0], q[-1]] + [b - a for a, b in zip(q, q[1:])]
    return sum(v**2 / 2 for v in v) - sum(d**2 / 2 + d**4 / 16 for d in springs)


def rosenbrock(n):
    x = ca.SX.sym("x", n)
    value = sum((1 - x[i]) ** 2 + 100 * (x[i + 1] - x[i] ** 2) ** 2 for i in range(n - 1))
    hessian, gradient = ca.hessian(value, x)
    function = ca.Function("f", [x], [value, gradient, ca.triu(hessian)])
    print(f"| Rosenbrock, value, gradient, Hessian | {n} | {shortest(prepared(function, [numbers(n)])):.2f} | {function.n_instructions()} |")


if __name__ == "__main__":
    print("| CasADi", ca.__version__, "| n | us | instructions |\n|---|---|---|---|")
    for n in (2, 4, 8, 16, 32, 64):
        terms("chain", n, chain)
    for n in (2, 8, 64, 256):
        terms("lattice", n, lattice)
    for n in (2, 8, 32, 128, 1024):
        rosenbrock(n)
    print("\n| CasADi, us | n | elimination written out | by numbers |\n|---|---|---|---|")
    for n in (2, 4, 8, 16, 32):
        linearization(n)
    print("\n| CasADi, M and g - c, first call | n | ms |\n|---|---|---|")
    first_call("chain", 64, chain)
    first_call("chain", 256, chain)
    first_call("lattice", 1000, lattice)

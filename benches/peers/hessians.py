"""CasADi's interpreter on the functions of `cargo bench --bench hessians`: microseconds a point, the shortest of five means."""
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


def terms(name, n, lagrangian):
    """The triangle of M, and the right-hand side g - c."""
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    value = lagrangian([q[i] for i in range(n)], [v[i] for i in range(n)])
    momentum = ca.gradient(value, v)
    right = ca.gradient(value, q) - ca.jtimes(momentum, q, v)
    function = ca.Function("f", [q, v], [ca.triu(ca.hessian(value, v)[0]), right])
    x = numbers(2 * n)
    print(f"| {name}, M and g - c | {n} | {shortest(prepared(function, [x[:n], x[n:]])):.2f} | {function.n_instructions()} |")


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


print("| CasADi", ca.__version__, "| n | us | instructions |\n|---|---|---|---|")
for n in (2, 4, 8, 16, 32, 64):
    terms("chain", n, chain)
for n in (2, 8, 64, 256):
    terms("lattice", n, lattice)
for n in (2, 8, 32, 128, 1024):
    rosenbrock(n)

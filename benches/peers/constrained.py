"""A training step under constraints by JAX: what `lnn-studies constraints --part cost` times, in the two ways that users have.

    python constrained.py [--states 1024] [--rounds 20]

The double pendulum in Cartesian coordinates, n = 4 and m = 2, a network of three layers of 128 units, double precision. `solve` takes the
accelerations from jnp.linalg.solve of [M A^T; A 0], `project` from M^-1 and the multipliers (A M^-1 A^T)^-1 (A M^-1 f + gamma), as
constrained Lagrangian networks do (Finzi, Wang and Wilson 2020). Loss and gradient of both have to agree to 1e-9. Give it one core
(taskset -c 0) for the times of one thread.
"""

import argparse
import time

import jax
import jax.numpy as jnp
import numpy as np

SCALE, WIDTH = 10.0, 128
jax.config.update("jax_enable_x64", True)


def initial_weights(generator):
    sizes = [8, WIDTH, WIDTH, WIDTH, 1]
    return [
        (generator.uniform(-1, 1, (b, a)) / np.sqrt(a), generator.uniform(-1, 1, b) / np.sqrt(a))
        for a, b in zip(sizes, sizes[1:])
    ]


def lagrangian(weights, x, w):
    """A network of scaled coordinates and velocities, and `|w|^2`, with which all mass matrices are positive."""
    h = jnp.concatenate([x, w])
    for weight, bias in weights[:-1]:
        h = jax.nn.gelu(weight @ h + bias, approximate=False)
    weight, bias = weights[-1]
    return (weight @ h + bias)[0] + jnp.sum(w * w)


def rods(x):
    q = SCALE * x
    return jnp.stack([q[0] ** 2 + q[1] ** 2 - 1, (q[2] - q[0]) ** 2 + (q[3] - q[1]) ** 2 - 1])


def parts(weights, x, w):
    """M, the force beside it, A and gamma."""
    mass = jax.hessian(lagrangian, 2)(weights, x, w)
    mixed = jax.jacfwd(jax.grad(lagrangian, 2), 1)(weights, x, w) @ w
    rate = lambda x: jax.jvp(rods, (x,), (w,))[1]
    return mass, jax.grad(lagrangian, 1)(weights, x, w) - mixed, jax.jacfwd(rods)(x), jax.jvp(rate, (x,), (w,))[1]


def solve(weights, x, w):
    mass, force, rows, drift = parts(weights, x, w)
    n, m = len(x), len(drift)
    matrix = jnp.block([[mass, rows.T], [rows, jnp.zeros((m, m))]])
    return jnp.linalg.solve(matrix, jnp.concatenate([force, -drift]))[:n]


def project(weights, x, w):
    mass, force, rows, drift = parts(weights, x, w)
    inverse = jnp.linalg.inv(mass)
    loads = jnp.linalg.solve(rows @ inverse @ rows.T, rows @ inverse @ force + drift)
    return inverse @ (force - rows.T @ loads)


def step(accelerations):
    def loss(weights, x, w, target):
        return 0.5 * jnp.mean(jnp.abs(jax.vmap(accelerations, (None, 0, 0))(weights, x, w) - target))

    return jax.jit(jax.value_and_grad(loss))


def states(count, generator):
    """Angles and rates anywhere within a turn and 3 rad/s, with accelerations that are none of this network."""
    angle, rate = generator.uniform(-np.pi, np.pi, (count, 2)), generator.uniform(-3, 3, (count, 2))
    one = lambda k: np.stack([np.sin(angle[:, k]), -np.cos(angle[:, k])], 1)
    speed = lambda k: rate[:, k : k + 1] * np.stack([np.cos(angle[:, k]), np.sin(angle[:, k])], 1)
    q, v = np.hstack([one(0), one(0) + one(1)]), np.hstack([speed(0), speed(0) + speed(1)])
    return q / SCALE, v / SCALE, generator.normal(size=q.shape)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=20)
    options = parser.parse_args()
    generator = np.random.default_rng(0)
    given = initial_weights(generator), *states(options.states, generator)
    outcomes = {}
    print(f"{'way':<10} {'step [ms]':>10} {'accelerations [ms]':>20}")
    for way in (solve, project):
        both = step(way), jax.jit(jax.vmap(way, (None, 0, 0)))
        calls = lambda: jax.block_until_ready(both[0](*given)), lambda: jax.block_until_ready(both[1](*given[:3]))
        least = []
        for call in calls:
            call()
            times = []
            for _ in range(options.rounds):
                started = time.perf_counter()
                call()
                times.append(time.perf_counter() - started)
            least.append(1e3 * min(times))
        outcomes[way] = np.concatenate([np.ravel(leaf) for leaf in jax.tree_util.tree_leaves(both[0](*given))])
        print(f"{way.__name__:<10} {least[0]:>10.1f} {least[1]:>20.1f}")
    # The loss first, then the gradient.
    a, b = outcomes.values()
    worst = max(abs(a[0] / b[0] - 1), np.max(np.abs(a[1:] - b[1:])) / np.max(np.abs(a[1:])))
    print(f"loss and gradient agree to {worst:.1e}")
    assert worst < 1e-9


if __name__ == "__main__":
    main()

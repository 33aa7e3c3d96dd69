"""JAX on the chains of `cargo bench --bench hessians`: accelerations of one state, microseconds, the shortest of five means.

Each call from Python takes some microseconds of its own, which the last row states."""
import jax
import jax.numpy as jnp
import numpy as np
from hessians import acceleration as exact
from hessians import numbers, shortest

jax.config.update("jax_enable_x64", True)


def chain(q, v):
    x, y, height = jnp.cumsum(v * jnp.cos(q)), jnp.cumsum(v * jnp.sin(q)), jnp.cumsum(jnp.cos(q))
    return jnp.sum((x**2 + y**2) / 2 + 9.8 * height)


def acceleration(q, v):
    momentum = jax.grad(chain, 1)
    mass = jax.hessian(chain, 1)(q, v)
    right = jax.grad(chain, 0)(q, v) - jax.jvp(lambda q: momentum(q, v), (q,), (v,))[1]
    return jax.scipy.linalg.solve(mass, right, assume_a="pos")


print("| JAX", jax.__version__, "| n | us |\n|---|---|---|")
for n in (8, 64):
    x = numbers(2 * n)
    q, v = jnp.array(x[:n]), jnp.array(x[n:])
    call = jax.jit(acceleration)
    assert np.allclose(call(q, v), exact(x[:n], x[n:]), rtol=1e-9, atol=1e-9)
    print(f"| chain, acceleration | {n} | {shortest(lambda: call(q, v).block_until_ready()):.1f} |")
call = jax.jit(lambda q, v: q)
print(f"| a call that computes nothing | {n} | {shortest(lambda: call(q, v).block_until_ready()):.1f} |")

"""The loss of a Lagrangian network and its gradient by every weight, the ways a user of PyTorch or JAX would take it.

Scaled coordinates x = q/s, w = v/s; L(x, w) = network(x, w) + alpha |w|^2; acceleration a = M^-1 (dL/dx - (d2L/dw dx) w)
with M = d2L/dw2; loss = mean |a - target| over batch and 2n components (the velocities agree by construction); Sylvester
penalty lambda mean_b sum_k relu(-det M_k) / (c_1 .. c_k + 1e-8), c_i the lower median of |M_ii| over the batch.

Every engine is a function of (inputs, precision) that returns a callable giving (loss + penalty, list of gradients).
"""

import numpy as np

PENALTY = 10.0


def lower_median(values, axis, library):
    """The lower one of the two middle values."""
    ordered = library.sort(values, axis)
    if isinstance(ordered, tuple):
        ordered = ordered[0]
    return ordered[(values.shape[axis] - 1) // 2]


# PyTorch: nested reverse mode, pseudo-inverse, the Hessian once for the loss and once more for the penalty.


def torch_model(weights, alpha):
    """Acceleration and mass matrix of one state (x, w) by nested reverse mode."""
    import torch
    from torch.func import jacrev

    def lagrangian(x, w):
        h = torch.cat([x, w])
        for matrix, bias in zip(weights[0:-1:2], weights[1:-1:2]):
            h = torch.nn.functional.gelu(torch.nn.functional.linear(h, matrix, bias))
        return torch.nn.functional.linear(h, weights[-1])[0] + alpha * (w * w).sum()

    mass = jacrev(jacrev(lagrangian, 1), 1)

    def acceleration(x, w):
        mixed = jacrev(jacrev(lagrangian, 1), 0)(x, w)
        force = jacrev(lagrangian, 0)(x, w)
        return torch.linalg.pinv(mass(x, w)) @ (force - mixed @ w)

    return acceleration, mass


def torch_paper(inputs, precision):
    import torch
    from torch.func import vmap

    dtype = {"f32": torch.float32, "f64": torch.float64}[precision]
    tensor = lambda array: torch.tensor(np.asarray(array), dtype=dtype)
    weights = [tensor(w).requires_grad_() for w in inputs["weights"]]
    x, w, target = (tensor(inputs[k]) for k in ("x", "w", "a"))
    n = x.shape[1]
    acceleration, mass_matrix = torch_model(weights, inputs["alpha"])

    def evaluate():
        for parameter in weights:
            parameter.grad = None
        predicted = vmap(acceleration)(x, w)
        loss = (predicted - target).abs().sum() / (2 * n * x.shape[0])
        mass = vmap(mass_matrix)(x, w)
        diagonal = torch.diagonal(mass, dim1=1, dim2=2).abs().detach()
        scales = torch.cumprod(lower_median(diagonal, 0, torch), 0)
        penalty = 0.0
        for k in range(1, n + 1):
            minor = torch.linalg.det(mass[:, :k, :k])
            penalty = penalty + (torch.relu(-minor) / (scales[k - 1] + 1e-8)).mean()
        total = loss + PENALTY * penalty
        total.backward()
        return total.detach(), [parameter.grad for parameter in weights]

    return evaluate


# JAX: one compiled function each; small systems by elimination written out, which XLA fuses (LAPACK calls per matrix cost
# more).


def eliminate(mass, right):
    """Solves M x = r for small positive definite M, batch first."""
    import jax.numpy as jnp

    n = right.shape[-1]
    rows = [[mass[..., i, j] for j in range(n)] for i in range(n)]
    x = [right[..., i] for i in range(n)]
    for k in range(n):
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            for j in range(k + 1, n):
                rows[i][j] = rows[i][j] - factor * rows[k][j]
            x[i] = x[i] - factor * x[k]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            x[k] = x[k] - rows[k][j] * x[j]
        x[k] = x[k] / rows[k][k]
    return jnp.stack(x, -1)


def minors(mass):
    """Leading principal minors of small matrices, as running products of pivots."""
    n = mass.shape[-1]
    rows = [[mass[..., i, j] for j in range(n)] for i in range(n)]
    product, found = 1.0, []
    for k in range(n):
        product = product * rows[k][k]
        found.append(product)
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            for j in range(k + 1, n):
                rows[i][j] = rows[i][j] - factor * rows[k][j]
    return found


def jax_setup(inputs, precision):
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    dtype = {"f32": jnp.float32, "f64": jnp.float64}[precision]
    array = lambda a: jnp.asarray(np.asarray(a), dtype=dtype)
    weights = [array(w) for w in inputs["weights"]]
    x, w, target = (array(inputs[k]) for k in ("x", "w", "a"))
    alpha = dtype(inputs["alpha"])

    def lagrangian(weights, x, w):
        """Of one state or, with a leading axis, of a batch."""
        h = jnp.concatenate([x, w], -1)
        for matrix, bias in zip(weights[0:-1:2], weights[1:-1:2]):
            h = jax.nn.gelu(h @ matrix.T + bias, approximate=False)
        return (h @ weights[-1].T)[..., 0] + alpha * (w * w).sum(-1)

    return jax, jnp, weights, (x, w, target), lagrangian


def penalty_of(mass, jax, jnp):
    diagonal = jax.lax.stop_gradient(jnp.abs(jnp.diagonal(mass, axis1=1, axis2=2)))
    scales = jnp.cumprod(lower_median(diagonal, 0, jnp), 0)
    return PENALTY * sum(
        (jnp.maximum(-minor, 0) / (scales[k] + 1e-8)).mean() for k, minor in enumerate(minors(mass))
    )


def jax_nested(inputs, precision, terms):
    """Gradient of the whole loss by reverse mode through `terms(lagrangian, weights, x, w) -> (M, c, g)`."""
    jax, jnp, weights, (x, w, target), lagrangian = jax_setup(inputs, precision)

    def loss(weights, x, w, target):
        mass, coriolis, force = terms(lagrangian, weights, x, w)
        residual = eliminate(mass, force - coriolis) - target
        return jnp.abs(residual).sum() / (2 * residual.size) + penalty_of(mass, jax, jnp)

    step = jax.jit(jax.value_and_grad(loss)).lower(weights, x, w, target).compile()
    return lambda: jax.block_until_ready(step(weights, x, w, target))


def jax_hessian(inputs, precision):
    import jax

    def terms(lagrangian, weights, x, w):
        one = lambda x, w: lagrangian(weights, x, w)
        mass = jax.vmap(jax.hessian(one, 1))(x, w)
        mixed = jax.vmap(jax.jacfwd(jax.grad(one, 1), 0))(x, w)
        force = jax.vmap(jax.grad(one, 0))(x, w)
        return mass, (mixed @ w[..., None])[..., 0], force

    return jax_nested(inputs, precision, terms)


def hessian_vector_terms(lagrangian, weights, x, w):
    import jax
    import jax.numpy as jnp

    n = x.shape[-1]
    gradient = jax.grad(lambda x, w: lagrangian(weights, x, w).sum(), (0, 1))
    momentum = lambda x, w: gradient(x, w)[1]
    along = lambda e: jax.jvp(momentum, (x, w), (jnp.zeros_like(x), jnp.broadcast_to(e, w.shape)))[1]
    mass = jnp.moveaxis(jax.vmap(along)(jnp.eye(n, dtype=x.dtype)), 0, -1)
    coriolis = jax.jvp(momentum, (x, w), (w, jnp.zeros_like(w)))[1]
    return mass, coriolis, gradient(x, w)[0]


def jax_hessian_vector(inputs, precision):
    return jax_nested(inputs, precision, hessian_vector_terms)


def jax_adjoint_identity(inputs, precision):
    """d loss = lam^T d(g - c - M a), lam = M^-1 dloss/da: one reverse pass over second directional derivatives."""
    jax, jnp, weights, (x, w, target), lagrangian = jax_setup(inputs, precision)

    def step(weights, x, w, target):
        mass, coriolis, force = hessian_vector_terms(lagrangian, weights, x, w)
        a = eliminate(mass, force - coriolis)
        residual = a - target
        lam = eliminate(mass, jnp.sign(residual) / (2 * residual.size))
        pen, pull = jax.value_and_grad(lambda m: penalty_of(m, jax, jnp))(mass)

        def scalar(weights):
            zero = jnp.zeros_like(x)
            energy = lambda x, w: lagrangian(weights, x, w)
            in_w = lambda x, w: jax.jvp(energy, (x, w), (zero, lam))[1]
            moving = jax.jvp(in_w, (x, w), (w, a))[1]
            return jax.jvp(energy, (x, w), (lam, zero))[1].sum() - moving.sum()

        def pulled(weights):
            """sum of pull_ij M_ij, only where a state is penalised."""
            return (hessian_vector_terms(lagrangian, weights, x, w)[0] * pull).sum()

        gradient = jax.grad(scalar)(weights)
        gradient = jax.lax.cond(
            pen > 0,
            lambda: jax.tree.map(jnp.add, gradient, jax.grad(pulled)(weights)),
            lambda: gradient,
        )
        return jnp.abs(residual).sum() / (2 * residual.size) + pen, gradient

    step = jax.jit(step).lower(weights, x, w, target).compile()
    return lambda: jax.block_until_ready(step(weights, x, w, target))


ENGINES = {
    "PyTorch, nested jacrev": torch_paper,
    "JAX, hessian()": jax_hessian,
    "JAX, Hessian-vector products": jax_hessian_vector,
    "JAX, adjoint identity": jax_adjoint_identity,
}

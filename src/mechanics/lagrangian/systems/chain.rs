//! The formulas of a chain of pendula, shared by the triple and the n-pendulum.
//!
//! Rod `i` of length `l_i` carries the load `mu_i = m_i + m_(i+1) + ..`. Angles enter through their differences first,
//! so that a common turn costs no accuracy.

use crate::scalar::Real;

/// Place of the last point mass, `x = sum_i l_i sin q_i`, `y = -sum_i l_i cos q_i`, the pivot at the origin.
pub fn end(lengths: &[f64], q: &[f64]) -> (f64, f64) {
    lengths.iter().zip(q).fold((0.0, 0.0), |(x, y), (l, q)| (x + l * q.sin(), y - l * q.cos()))
}

/// `L = sum_i mu_i (l_i v_i)^2 / 2 + sum_(i<j) mu_j l_i l_j v_i v_j cos(q_i - q_j) + g sum_i mu_i l_i cos q_i`.
pub fn lagrangian<R: Real>(loads: &[R], lengths: &[R], g: R, q: &[R], v: &[R]) -> R {
    let mut kinetic = R::zero();
    let mut height = R::zero();
    for j in 0..q.len() {
        let speed = lengths[j] * v[j];
        let mut sum = R::half() * speed;
        for i in 0..j {
            sum += lengths[i] * v[i] * (q[i] - q[j]).cos();
        }
        kinetic += loads[j] * speed * sum;
        height += loads[j] * lengths[j] * q[j].cos();
    }
    kinetic + g * height
}

/// Solves `M a = F`, `M_ij = mu_max(i,j) l_i l_j cos(q_i - q_j)`,
/// `F_i = -sum_j mu_max(i,j) l_i l_j v_j^2 sin(q_i - q_j) - mu_i g l_i sin q_i`, by Cholesky's method.
pub fn acceleration<R: Real>(loads: &[R], lengths: &[R], g: R, q: &[R], v: &[R]) -> Vec<R> {
    let n = q.len();
    // Divided by l_i on both sides: unknowns l_j a_j.
    let mut m = vec![R::zero(); n * n];
    let mut force = Vec::with_capacity(n);
    for i in 0..n {
        let mut sum = -(loads[i] * g * q[i].sin());
        for j in 0..n {
            let load = loads[i.max(j)];
            if i == j {
                m[i * n + j] = load;
            } else {
                let (sin, cos) = (q[i] - q[j]).sin_cos();
                m[i * n + j] = load * cos;
                sum -= load * lengths[j] * v[j].sqr() * sin;
            }
        }
        force.push(sum);
    }
    // M = L D L^T; column k below the diagonal keeps L times its pivot.
    for k in 0..n {
        for i in k + 1..n {
            let factor = m[i * n + k] / m[k * n + k];
            for j in k + 1..=i {
                let update = factor * m[j * n + k];
                m[i * n + j] -= update;
            }
            let update = factor * force[k];
            force[i] -= update;
        }
    }
    for k in (0..n).rev() {
        for i in k + 1..n {
            let update = m[i * n + k] * force[i];
            force[k] -= update;
        }
        force[k] /= m[k * n + k];
    }
    force.iter().zip(lengths).map(|(&x, &l)| x / l).collect()
}

//! Small exact systems for tests.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use crate::scalar::{Real, Scalar};

type Force = fn(&[f64], &[f64], &mut [f64]) -> Result<f64, MechanicsError>;

/// A system whose mass matrix is the identity, given by its potential, acceleration and possible failures.
pub(crate) struct Toy {
    n: usize,
    /// `(q, v) -> (acceleration, potential)`.
    force: Force,
}

impl<S: Scalar> EulerLagrange<S> for Toy {
    fn coordinates(&self) -> usize {
        self.n
    }

    fn terms(&self, q: &[S], v: &[S], _: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        let n = self.n;
        let batch = q.len() / n;
        let zero = <S as Real>::zero();
        terms.acceleration = vec![S::nan(); batch * n];
        terms.energy = vec![zero; batch];
        terms.lagrangian = vec![zero; batch];
        terms.mass_matrix = vec![zero; batch * n * n];
        terms.momentum = v.to_vec();
        let mut first = Ok(());
        for row in 0..batch {
            let wide = |x: &[S]| x[row * n..(row + 1) * n].iter().map(|x| x.to_f64()).collect::<Vec<f64>>();
            let (q, v) = (wide(q), wide(v));
            let mut a = vec![0.0; n];
            match (self.force)(&q, &v, &mut a) {
                Ok(potential) => {
                    let kinetic: f64 = v.iter().map(|v| 0.5 * v * v).sum();
                    terms.energy[row] = S::of_f64(kinetic + potential);
                    terms.lagrangian[row] = S::of_f64(kinetic - potential);
                    for (i, &a) in a.iter().enumerate() {
                        terms.acceleration[row * n + i] = S::of_f64(a);
                        terms.mass_matrix[row * n * n + i * n + i] = S::of_f64(1.0);
                    }
                }
                Err(error) => {
                    terms.energy[row] = S::nan();
                    first = first.and(Err(error));
                }
            }
        }
        first
    }
}

/// `q'' = -q`.
pub(crate) const OSCILLATOR: Toy = Toy {
    n: 1,
    force: |q, _, a| {
        a[0] = -q[0];
        Ok(0.5 * q[0] * q[0])
    },
};

/// Pendulum, `g/l = 1`.
pub(crate) const PENDULUM: Toy = Toy {
    n: 1,
    force: |q, _, a| {
        a[0] = -q[0].sin();
        Ok(-q[0].cos())
    },
};

/// Kepler problem, `GM = 1`.
pub(crate) const KEPLER: Toy = Toy {
    n: 2,
    force: |q, _, a| {
        let r = q[0].hypot(q[1]);
        a[0] = -q[0] / r.powi(3);
        a[1] = -q[1] / r.powi(3);
        Ok(-1.0 / r)
    },
};

/// Four uncoupled oscillators of different frequencies.
pub(crate) const FOUR: Toy = Toy {
    n: 4,
    force: |q, _, a| {
        let mut potential = 0.0;
        for (i, a) in a.iter_mut().enumerate() {
            let k = 1.0 + i as f64;
            *a = -k * q[i];
            potential += 0.5 * k * q[i] * q[i];
        }
        Ok(potential)
    },
};

/// Free fall with a mass matrix that is singular below `q = -1`.
pub(crate) const SINGULAR: Toy = Toy {
    n: 1,
    force: |q, _, a| {
        a[0] = -1.0;
        if q[0] < -1.0 { Err(MechanicsError::Singular { row: 0, condition: 1e17 }) } else { Ok(q[0]) }
    },
};

/// Free fall with an acceleration that is `NaN` below `q = -1`.
pub(crate) const BROKEN: Toy = Toy {
    n: 1,
    force: |q, _, a| {
        a[0] = if q[0] < -1.0 { f64::NAN } else { -1.0 };
        Ok(q[0])
    },
};

/// `q'' = 2 q^3`; the solution from `q = v = 1` is `1 / (1 - t)`.
pub(crate) const EXPLODING: Toy = Toy {
    n: 1,
    force: |q, _, a| {
        a[0] = 2.0 * q[0].powi(3);
        Ok(-0.5 * q[0].powi(4))
    },
};

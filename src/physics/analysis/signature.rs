//! Signs of mass matrices: learned against exact.

use crate::lagrangian::{EulerLagrange, ReducedMass, Request, Terms};
use crate::linalg::{Inertia, inertia};
use crate::scalar::{Real, Scalar};

/// Fraction of the states `q`, `v`, both `(states, n)`, whose learned mass matrix has not the inertia (numbers of
/// positive, zero and negative eigenvalues) of the exact one; matrices that are not finite count as wrong. Under constraints those count
/// within the directions that are left.
///
/// A learned Lagrangian is free up to a factor, also a negative one: the sign of all matrices together is chosen so that
/// fewer are wrong. 0 for no states.
pub fn wrong_signatures<S: Scalar>(
    exact: &dyn EulerLagrange<S>,
    learned: &dyn EulerLagrange<S>,
    q: &[S],
    v: &[S],
) -> f64 {
    let (exact, learned) = (inertias(exact, q, v), inertias(learned, q, v));
    let states = exact.len().max(learned.len());
    if states == 0 {
        return 0.0;
    }
    let flipped: fn(Inertia) -> Inertia = |i| Inertia { positive: i.negative, negative: i.positive, ..i };
    let right = |turn: fn(Inertia) -> Inertia| {
        exact.iter().zip(&learned).filter(|(a, b)| a.is_some() && **a == b.map(turn)).count()
    };
    1.0 - right(|i| i).max(right(flipped)) as f64 / states as f64
}

/// Inertia of each state's mass matrix, `None` where it is not finite.
fn inertias<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Vec<Option<Inertia>> {
    let n = model.coordinates();
    let mut terms = Terms::default();
    // Failures of single states leave matrices that are not finite.
    let _ = model.terms(q, v, Request::MASS_MATRIX | Request::CONSTRAINTS, &mut terms);
    let (mut scratch, m) = (vec![<S as Real>::zero(); n * n], terms.constraints);
    let of_state = |(k, matrix): (usize, &[S])| match m {
        0 => inertia(n, matrix, &mut scratch).ok(),
        _ => {
            let rows = terms.constraint_matrix.get(k * m * n..(k + 1) * m * n)?;
            let within = ReducedMass::of(n, matrix, rows).ok()?.matrix;
            inertia(within.len().isqrt(), &within, &mut scratch).ok()
        }
    };
    terms.mass_matrix.chunks_exact(n * n).enumerate().map(of_state).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics};

    /// `L = sum_i m_i v_i^2 / 2`, the first mass of the sign of `q_0`.
    struct Masses([f64; 2]);

    impl Lagrangian for Masses {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            (R::of(self.0[0]) + q[0] * R::of(self.0[1])) * v[0].sqr() + v[1].sqr()
        }
    }

    #[test]
    fn wrong_signs_are_counted_up_to_a_common_sign() {
        let model = |a, b| Mechanics::<_, f64>::new(Masses([a, b]), vec![]);
        let q = [1.0, 0.0, 2.0, 0.0, -1.0, 0.0, 3.0, 0.0];
        let v = [0.1; 8];
        let against = |a: f64, b: f64, c: f64, d: f64| wrong_signatures(&model(a, b), &model(c, d), &q, &v);
        assert_eq!(against(1.0, 0.0, 2.0, 0.0), 0.0);
        // Negative at one of four states.
        assert_eq!(against(1.0, 0.0, 0.0, 1.0), 0.25);
        // Lorentzian everywhere: wrong everywhere, also with the opposite sign of both.
        assert_eq!(against(1.0, 0.0, -1.0, 0.0), 1.0);
        assert_eq!(wrong_signatures(&model(1.0, 0.0), &model(1.0, 0.0), &[], &[]), 0.0);
    }
}

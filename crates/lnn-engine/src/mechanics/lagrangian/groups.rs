//! Groups of coordinates that do not interact. The Lagrangian of each group can be multiplied by any factor, also a negative one, without
//! changing the motion.

use super::{EulerLagrange, MechanicsError, Request, Terms};
use crate::lagrangian::thresholds::COUPLING_STATES;
use crate::linalg::{components, dot};
use crate::scalar::Scalar;

/// A function that computes accelerations at states, `(states, n)` each.
pub(crate) type Accelerations<'a, S> = &'a dyn Fn(&[S], &[S]) -> Vec<f64>;

/// Divides `n` coordinates into interacting groups, using the `accelerations` at states, `(states, n)`; accelerations that are not finite
/// are ignored.
///
/// Coordinate `j` acts on `i` if the acceleration of `i` changes by more than `noise[i]` (root mean square over the states) when the
/// position and velocity of `j` are replaced by those of another state. With a single state this cannot be tested, and all coordinates form
/// one group.
pub fn acting_groups<S: Scalar>(
    n: usize,
    (q, v): (&[S], &[S]),
    accelerations: Accelerations<'_, S>,
    noise: &[f64],
) -> Vec<Vec<usize>> {
    let states = q.len() / n.max(1);
    if n < 2 || states < 2 {
        return vec![(0..n).collect()];
    }
    let own = accelerations(q, v);
    let moved = |x: &[S], j: usize| -> Vec<S> {
        let mut moved = x.to_vec();
        (0..states).for_each(|k| moved[k * n + j] = x[(k + states / 2) % states * n + j]);
        moved
    };
    let changes: Vec<f64> = (0..n)
        .flat_map(|j| {
            let changed = accelerations(&moved(q, j), &moved(v, j));
            (0..n)
                .map(|i| root_mean_square(own.iter().zip(&changed).map(|(a, b)| a - b).skip(i).step_by(n)))
                .collect::<Vec<_>>()
        })
        .collect();
    // Couplings that cannot be evaluated are assumed to exist.
    let acts = |&(j, i): &(usize, usize)| changes[j * n + i] > noise[i] || changes[j * n + i].is_nan();
    components(n, pairs(n).filter(acts))
}

/// Returns the root mean square of the finite numbers, `NaN` without any.
fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.filter(|x| x.is_finite()).fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    f64::sqrt(sum / count)
}

/// Divides the coordinates of an exactly known Lagrangian into groups, using its accelerations and its mass matrix at states `(states, n)`.
/// An influence below the square root of the rounding error does not count. With constraints all coordinates form one group.
pub fn groups<S: Scalar>(model: &dyn EulerLagrange<S>, (q, v): (&[S], &[S])) -> Vec<Vec<usize>> {
    let n = model.coordinates();
    let used = n * COUPLING_STATES.min(q.len() / n.max(1));
    let (q, v) = (&q[..used], &v[..used]);
    let evaluate = |q: &[S], v: &[S]| {
        let mut terms = Terms::default();
        // The terms of states that fail are not finite.
        let _ = model.terms(q, v, Request::ACCELERATION, &mut terms);
        let [m, a] =
            [&terms.mass_matrix, &terms.acceleration].map(|x| x.iter().map(|x| x.to_f64()).collect::<Vec<_>>());
        (m, a)
    };
    let (masses, own) = evaluate(q, v);
    if model.manifold().is_some() || own.len() != used {
        return vec![(0..n).collect()];
    }
    let rounding = S::epsilon().to_f64().sqrt();
    let noise: Vec<f64> = (0..n).map(|i| rounding * root_mean_square(own.iter().copied().skip(i).step_by(n))).collect();
    let acting = acting_groups(n, (q, v), &|q, v| evaluate(q, v).1, &noise);
    let group = |i: usize| acting.iter().position(|group| group.contains(&i));
    let joined = |&(i, j): &(usize, usize)| {
        let apart = |m: &[f64]| m[i * n + j].abs() <= rounding * (m[i * n + i] * m[j * n + j]).abs().sqrt();
        group(i) == group(j) || !masses.chunks_exact(n * n).all(apart)
    };
    components(n, pairs(n).filter(joined))
}

/// Returns all pairs of indices below `n`.
fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n * n).map(move |at| (at / n, at % n))
}

/// Returns for every group the factor `s` that minimizes the sum of `|s a - b|^2 / |b|^2` over matrices `(states, n, n)`; 1 if there is no
/// minimum.
pub fn group_factors(n: usize, groups: &[Vec<usize>], a: &[f64], b: &[f64]) -> Vec<f64> {
    let of = |group: &Vec<usize>| {
        let part = |m: &[f64]| -> Vec<f64> {
            group.iter().flat_map(|i| group.iter().map(move |j| i * n + j)).map(|at| m[at]).collect()
        };
        let (mut product, mut square) = (0.0, 0.0);
        for (a, b) in a.chunks_exact(n * n).zip(b.chunks_exact(n * n)) {
            let (a, b) = (part(a), part(b));
            let scale = dot(&b, &b).recip();
            if (dot(&a, &a) * scale).is_finite() {
                product += scale * dot(&a, &b);
                square += scale * dot(&a, &a);
            }
        }
        let factor = product / square;
        if factor.is_finite() && factor != 0.0 { factor } else { 1.0 }
    };
    groups.iter().map(of).collect()
}

/// A Lagrangian whose groups of coordinates are multiplied by factors, up to a constant: `sum of s_b L_b`, where `L_b` is `L` with the
/// coordinates of the other groups at a reference state. The motion is that of `L`.
pub struct Regrouped<'a> {
    model: &'a dyn EulerLagrange<f64>,
    groups: Vec<Vec<usize>>,
    /// Factor of every group.
    pub factors: Vec<f64>,
    reference: [Vec<f64>; 2],
}

impl<'a> Regrouped<'a> {
    /// Multiplies the groups of `model` by the factors that bring their mass matrices closest to those of `other` at states `(states, n)`.
    /// Returns `None` if all coordinates form one group.
    pub fn nearest(
        model: &'a dyn EulerLagrange<f64>,
        other: &dyn EulerLagrange<f64>,
        (q, v): (&[f64], &[f64]),
    ) -> Option<Self> {
        let (n, groups) = (model.coordinates(), groups(model, (q, v)));
        let reference = [q.get(..n)?.to_vec(), v.get(..n)?.to_vec()];
        if groups.len() < 2 {
            return None;
        }
        let [own, others] = [model, other].map(|model| {
            let mut terms = Terms::default();
            let _ = model.terms(q, v, Request::MASS_MATRIX, &mut terms);
            terms.mass_matrix
        });
        let factors = group_factors(n, &groups, &own, &others);
        Some(Self { model, groups, factors, reference })
    }
}

impl EulerLagrange<f64> for Regrouped<'_> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let (n, mut one) = (self.coordinates(), Terms::default());
        let states = v.len() / n.max(1);
        terms.clear();
        let mut failed = Vec::new();
        for (group, &factor) in self.groups.iter().zip(&self.factors) {
            let [q, v] = [(q, 0), (v, 1)].map(|(x, which)| {
                let mut alone = self.reference[which].repeat(states);
                group.iter().for_each(|i| (0..states).for_each(|k| alone[k * n + i] = x[k * n + i]));
                alone
            });
            let outcome = self.model.terms(&q, &v, request.without_solution(), &mut one);
            failed.extend(one.drain_failures(outcome)?);
            let whole = |sum: &mut Vec<f64>, part: &[f64]| {
                sum.resize(part.len(), 0.0);
                sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += factor * x);
            };
            whole(&mut terms.lagrangian, &one.lagrangian);
            whole(&mut terms.dissipation, &one.dissipation);
            let rows = |sum: &mut Vec<f64>, part: &[f64]| {
                sum.resize(part.len(), 0.0);
                for k in 0..part.len() / n {
                    group.iter().for_each(|i| sum[k * n + i] = factor * part[k * n + i]);
                }
            };
            rows(&mut terms.momentum, &one.momentum);
            rows(&mut terms.dl_dq, &one.dl_dq);
            rows(&mut terms.coriolis, &one.coriolis);
            rows(&mut terms.force, &one.force);
            terms.mass_matrix.resize(one.mass_matrix.len(), 0.0);
            for k in 0..one.mass_matrix.len() / (n * n) {
                for at in group.iter().flat_map(|i| group.iter().map(move |j| (k * n + i) * n + j)) {
                    terms.mass_matrix[at] = factor * one.mass_matrix[at];
                }
            }
        }
        terms.complete_beside(failed, n, v, request)
    }

    fn conserves_energy(&self) -> bool {
        self.model.conserves_energy()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics};
    use crate::random::RngStream;
    use crate::scalar::Real;
    use rand::Rng;

    /// Three oscillators with a mass matrix that depends on the position; `coupling` couples the first and the last.
    struct Three;

    impl Lagrangian for Three {
        fn coordinates(&self) -> usize {
            3
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            let kinetic = (R::one() + q[0].sqr()) * v[0].sqr() + p[1] * v[1].sqr() + v[2].sqr();
            R::half() * kinetic - q[0].sqr().sqr() - p[1] * q[1].cos() - q[2].sqr() - p[0] * q[0] * q[2]
        }
    }

    fn states() -> [Vec<f64>; 2] {
        let mut rng = RngStream::Test.generator(5);
        std::array::from_fn(|_| (0..120).map(|_| rng.random_range(-1.0..1.0)).collect())
    }

    #[test]
    fn groups_are_those_of_the_couplings() {
        let [q, v] = states();
        let of = |coupling: f64| groups(&Mechanics::new(Three, vec![coupling, 1.0]), (&q, &v));
        assert_eq!(of(0.0), [[0], [1], [2]]);
        assert_eq!(of(1e-4), [vec![0, 2], vec![1]]);
        let one = groups(&Mechanics::<_, f64>::new(Three, vec![0.0, 1.0]), (&q[..3], &v[..3]));
        assert_eq!(one, [[0, 1, 2]]);
    }

    #[test]
    fn a_regrouped_lagrangian_is_the_other_one() {
        let [q, v] = states();
        let [exact, heavy] = [1.0, -7.0].map(|mass| Mechanics::<_, f64>::new(Three, vec![0.3, mass]));
        let found = Regrouped::nearest(&exact, &heavy, (&q, &v)).unwrap();
        assert!((found.factors[0] - 1.0).abs() < 1e-12 && (found.factors[1] + 7.0).abs() < 1e-12);
        let (mut a, mut b) = (Terms::default(), Terms::default());
        found.terms(&q, &v, Request::ALL, &mut a).unwrap();
        heavy.terms(&q, &v, Request::ALL, &mut b).unwrap();
        let near = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(&a.mass_matrix, &b.mass_matrix) && near(&a.momentum, &b.momentum) && near(&a.dl_dq, &b.dl_dq));
        assert!(near(&a.acceleration, &b.acceleration));
        let constant = a.energy[0] - b.energy[0];
        assert!(a.energy.iter().zip(&b.energy).all(|(a, b)| (a - b - constant).abs() < 1e-11));
    }
}

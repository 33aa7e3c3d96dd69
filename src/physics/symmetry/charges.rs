//! Charges of symmetries along a motion, and where their drift comes from.

use super::basis::{Basis, Values};
use super::orthonormal::dot;
use super::{Field, SymmetryError};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::rollout::Trajectory;
use serde::Serialize;

/// A charge along a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Charge {
    /// Its values at the samples.
    pub values: Vec<f64>,
    /// Value at the end less that at the start, the sum of the two parts.
    pub drift: f64,
    /// Part of the model: the integral over time of what breaks the symmetry, `xi.dL/dq + (D xi v).dL/dv - dF/dt`, or of the power
    /// of friction, along the motion.
    pub by_model: f64,
    /// Part of the integrator: the rest, to the accuracy of the integral over the samples.
    pub by_integrator: f64,
}

/// States evaluated at once.
const CHUNK: usize = 1024;

/// The energy `E = p.v - L` and the charges `p.xi - F` of fields over a basis along a motion, the energy first.
///
/// A charge would stay the same if the model had the symmetry and the integrator made no error. What the model contributes to its
/// drift is integrated over the samples by Simpson's rule, so that they should be dense.
///
/// # Errors
/// [`SymmetryError::Basis`] for a basis or a motion of another number of coordinates, [`SymmetryError::States`] if terms are not
/// finite somewhere.
pub fn charges(
    model: &dyn EulerLagrange<f64>,
    basis: &Basis,
    fields: &[Field],
    motion: &Trajectory<f64>,
) -> Result<Vec<Charge>, SymmetryError> {
    let n = model.coordinates();
    for found in [basis.names().len(), motion.coordinates] {
        if found != n {
            return Err(SymmetryError::Basis { expected: n, found });
        }
    }
    let request = Request::ENERGY | Request::DL_DQ | Request::FORCE;
    let (mut terms, mut at) = (Terms::default(), Values::default());
    let mut series = vec![(Vec::with_capacity(motion.len()), Vec::with_capacity(motion.len())); fields.len() + 1];
    for (q, v) in motion.q.chunks(CHUNK * n).zip(motion.v.chunks(CHUNK * n)) {
        let found = series[0].0.len();
        let failed = |_| SymmetryError::States { states: motion.len(), found };
        model.terms(q, v, request, &mut terms).map_err(failed)?;
        for (k, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            let one = k * n..(k + 1) * n;
            let (p, g) = (&terms.momentum[one.clone()], &terms.dl_dq[one.clone()]);
            series[0].0.push(terms.energy[k]);
            series[0].1.push(terms.dissipation.get(k).map_or(0.0, |power| -power));
            basis.evaluate(q, &mut at);
            for (field, (values, rates)) in fields.iter().zip(&mut series[1..]) {
                values.push(field.charge(&at, p));
                // Friction turns momenta besides.
                let force = terms.force.get(one.clone()).unwrap_or(&[]);
                let pull: f64 = field.vector(&at, n).iter().zip(force).map(|(x, f)| x * f).sum();
                rates.push(field.breaking(&at, v, p, g) + pull);
            }
        }
    }
    let finite = |(values, rates): &(Vec<f64>, Vec<f64>)| values.iter().chain(rates).all(|x| x.is_finite());
    if !series.iter().all(finite) {
        return Err(SymmetryError::States { states: motion.len(), found: 0 });
    }
    Ok(series
        .into_iter()
        .map(|(values, rates)| {
            let drift = values.last().zip(values.first()).map_or(0.0, |(last, first)| last - first);
            let by_model = integral(&motion.t, &rates);
            Charge { values, drift, by_model, by_integrator: drift - by_model }
        })
        .collect())
}

/// The [`charges`] of an exact Lagrangian along the motion of a learned one.
///
/// They do not depend on the factor and the gauge up to which a learned Lagrangian is determined. The part of the model is the
/// integral of `xi.M (a_learned - a_exact)`, of the energy that of `v.M (a_learned - a_exact)`, `M` and `a_exact` of the exact
/// Lagrangian, which is to have the symmetries and no friction; the rest is the integrator's.
///
/// # Errors
/// As [`charges`].
pub(crate) fn drifts(
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    basis: &Basis,
    fields: &[Field],
    motion: &Trajectory<f64>,
) -> Result<Vec<Charge>, SymmetryError> {
    let mut all = charges(exact, basis, fields, motion)?;
    let n = exact.coordinates();
    let (mut right, mut other, mut at) = (Terms::default(), Terms::default(), Values::default());
    let mut rates = vec![Vec::with_capacity(motion.len()); all.len()];
    for (q, v) in motion.q.chunks(CHUNK * n).zip(motion.v.chunks(CHUNK * n)) {
        let failed = |_| SymmetryError::States { states: motion.len(), found: 0 };
        exact.terms(q, v, Request::MASS_MATRIX | Request::ACCELERATION, &mut right).map_err(failed)?;
        learned.terms(q, v, Request::ACCELERATION, &mut other).map_err(failed)?;
        for (k, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            let one = k * n..(k + 1) * n;
            let excess: Vec<f64> =
                other.acceleration[one.clone()].iter().zip(&right.acceleration[one]).map(|(a, b)| a - b).collect();
            let rows = right.mass_matrix[k * n * n..(k + 1) * n * n].chunks_exact(n);
            let pull: Vec<f64> = rows.map(|row| dot(row, &excess)).collect();
            basis.evaluate(q, &mut at);
            rates[0].push(dot(v, &pull));
            for (field, rates) in fields.iter().zip(&mut rates[1..]) {
                rates.push(dot(&field.vector(&at, n), &pull));
            }
        }
    }
    for (charge, rates) in all.iter_mut().zip(&rates) {
        charge.by_model = integral(&motion.t, rates);
        charge.by_integrator = charge.drift - charge.by_model;
    }
    Ok(all)
}

/// Integral of samples by Simpson's rule for uneven steps, two at a time; a last single step by the parabola through the last three
/// samples.
fn integral(t: &[f64], y: &[f64]) -> f64 {
    let mut sum = 0.0;
    let mut k = 0;
    while k + 2 < t.len() {
        let (h, g) = (t[k + 1] - t[k], t[k + 2] - t[k + 1]);
        let width = (h + g) / 6.0;
        sum += width * ((2.0 - g / h) * y[k] + (h + g).powi(2) / (h * g) * y[k + 1] + (2.0 - h / g) * y[k + 2]);
        k += 2;
    }
    if k + 1 < t.len() {
        let g = t[k + 1] - t[k];
        sum += match k.checked_sub(1) {
            None => 0.5 * g * (y[k] + y[k + 1]),
            Some(before) => {
                let h = t[k] - t[before];
                g * (y[k + 1] * (2.0 * g + 3.0 * h) / (6.0 * (h + g)) + y[k] * (g + 3.0 * h) / (6.0 * h)
                    - y[before] * g * g / (6.0 * h * (h + g)))
            }
        };
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::{Method, Options, rollout};
    use crate::symmetry::{Chart, Degrees};

    /// A particle in the plane under a constant acceleration along `y`, `drop`: `L = m |v|^2 / 2 + m drop y`.
    struct Particle;

    impl crate::lagrangian::Lagrangian for Particle {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: crate::scalar::Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            p[0] * (R::half() * (v[0].sqr() + v[1].sqr()) + p[1] * q[1])
        }
    }

    #[test]
    fn drifts_tell_a_wrong_force_whatever_the_factor() {
        let particle = |mass, drop| crate::lagrangian::Mechanics::new(Particle, vec![mass, drop]);
        let basis =
            Basis::new(&["x", "y"].map(String::from), &[Chart::Line; 2], "polynomial:1".parse::<Degrees>().unwrap());
        // d_x and d_y; a constant is the first function.
        let functions = basis.len();
        let field = |i: usize| {
            let mut coefficients = vec![0.0; 2 * functions];
            coefficients[i * functions] = 1.0;
            Field { coefficients, gauge: vec![0.0; functions] }
        };
        let (exact, learned) = (particle(2.0, 0.0), particle(-5.0, 0.01));
        let options = Options { method: Method::Gauss6, step: Some(0.01), ..Options::new(3.0, 0.01) };
        let motion = rollout(&learned, &[0.0, 0.0], &[0.7, 0.2], &options).complete().unwrap();
        let found = drifts((&exact, &learned), &basis, &[field(0), field(1)], &motion).unwrap();
        // Momenta 2 v, energy |v|^2; v_y grows by 0.03.
        let expected = [0.23 * 0.23 - 0.2 * 0.2, 0.0, 0.06];
        for (charge, expected) in found.iter().zip(expected) {
            assert!((charge.drift - expected).abs() < 1e-12, "{} {expected}", charge.drift);
            assert!((charge.by_model - expected).abs() < 1e-12 && charge.by_integrator.abs() < 1e-12);
        }
        // A motion that nothing moves so is the integrator's.
        let mut wrong = motion.clone();
        wrong.v.iter_mut().skip(2 * wrong.t.len() - 2).for_each(|v| *v += 0.5);
        let found = drifts((&exact, &exact), &basis, &[field(0)], &wrong).unwrap();
        assert!((found[1].by_integrator - 1.0).abs() < 1e-12 && found[1].by_model.abs() < 1e-12);
    }

    #[test]
    fn parabolas_are_integrated_exactly() {
        for count in 2..9 {
            let t: Vec<f64> = (0..count).map(|k| f64::from(k) + 0.1 * f64::from(k * k)).collect();
            let degree = if count == 2 { 1 } else { 2 };
            let y: Vec<f64> = t.iter().map(|t| 1.0 + 2.0 * t + if degree == 2 { 3.0 * t * t } else { 0.0 }).collect();
            let end = t[t.len() - 1];
            let exact = end + end * end + if degree == 2 { end.powi(3) } else { 0.0 };
            assert!((integral(&t, &y) - exact).abs() < 1e-12 * exact, "{count}");
        }
        assert_eq!(integral(&[1.0], &[2.0]), 0.0);
    }
}

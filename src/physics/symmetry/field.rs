//! A vector field over a basis, with its gauge function; its charge along a motion, and where the drift of the charge comes from.

use super::SymmetryError;
use super::basis::{Basis, Values};
use super::null_space::dot;
use super::sample::Sample;
use super::thresholds::{STATES_AT_ONCE, WORKLESS};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::rollout::Trajectory;
use serde::Serialize;

/// `xi = sum of coefficients * function * d_i` and the gauge function `F` that goes with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Coefficients, `(n, functions)`.
    pub coefficients: Vec<f64>,
    /// Coefficients of `F`, `(functions)`.
    pub gauge: Vec<f64>,
}

impl Field {
    /// Component `i` of the field from the values of the functions, or their derivatives.
    fn component(&self, i: usize, values: impl Iterator<Item = f64>) -> f64 {
        let functions = self.gauge.len();
        self.coefficients[i * functions..(i + 1) * functions].iter().zip(values).map(|(c, x)| c * x).sum()
    }

    /// `xi`, `(n)`, at a point.
    pub(crate) fn vector(&self, at: &Values, n: usize) -> Vec<f64> {
        (0..n).map(|i| self.component(i, at.value.iter().copied())).collect()
    }

    /// `d xi^i / dq^j`, `(n, n)`, at a point.
    pub(crate) fn derivative(&self, at: &Values, n: usize) -> Vec<f64> {
        (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| self.component(i, at.gradient.iter().skip(j).step_by(n).copied()))
            .collect()
    }

    /// Charge `p.xi - F` at a state with momentum `p`.
    pub(crate) fn charge(&self, at: &Values, p: &[f64]) -> f64 {
        let gauge: f64 = self.gauge.iter().zip(&at.value).map(|(c, x)| c * x).sum();
        self.vector(at, p.len()).iter().zip(p).map(|(x, p)| x * p).sum::<f64>() - gauge
    }

    /// `xi.dL/dq + (D xi v).dL/dv - dF/dt` at a state: the violation of the symmetry there, which is the rate of the charge.
    fn breaking(&self, at: &Values, v: &[f64], p: &[f64], g: &[f64]) -> f64 {
        let n = p.len();
        let pull: f64 = self.vector(at, n).iter().zip(g).map(|(x, g)| x * g).sum();
        let turn: f64 = self
            .derivative(at, n)
            .chunks_exact(n)
            .zip(p)
            .map(|(row, p)| p * row.iter().zip(v).map(|(d, v)| d * v).sum::<f64>())
            .sum();
        let along = |gradient: &[f64]| gradient.iter().zip(v).map(|(d, v)| d * v).sum::<f64>();
        let gauge: f64 = self.gauge.iter().zip(at.gradient.chunks_exact(n)).map(|(c, d)| c * along(d)).sum();
        pull + turn - gauge
    }

    /// `true` if the forces that are not in `L` do no work along the field, to rounding.
    pub(crate) fn is_workless(&self, sample: &Sample, basis: &Basis) -> bool {
        let (n, mut at, mut work, mut parts) = (sample.n, Values::default(), 0.0_f64, 0.0);
        for (k, q) in sample.q.chunks_exact(n).enumerate().filter(|_| !sample.force.is_empty()) {
            basis.evaluate(q, &mut at);
            let powers = self.vector(&at, n).into_iter().enumerate().map(|(i, xi)| xi * sample.force(k, i));
            let powers: Vec<f64> = powers.collect();
            work += powers.iter().sum::<f64>().abs();
            parts += powers.iter().map(|power| power.abs()).sum::<f64>();
        }
        work <= WORKLESS * parts
    }

    /// Turns the field so that its last term has a positive factor: `-y d_x + x d_y`.
    pub(crate) fn normalise_sign(&mut self) {
        if self.coefficients.iter().rev().find(|c| **c != 0.0).is_some_and(|c| *c < 0.0) {
            self.coefficients.iter_mut().chain(&mut self.gauge).for_each(|c| *c = if *c == 0.0 { 0.0 } else { -*c });
        }
    }

    /// Removes noise from the gauge function, judged by the momentum along the field, and its constant.
    pub(crate) fn clean_gauge(&mut self, sample: &Sample, values: &[Vec<f64>], noise: f64) {
        let (n, functions, states) = (sample.n, self.gauge.len(), sample.len());
        let momentum = |k: usize| -> f64 {
            (0..n)
                .map(|i| {
                    let xi = (0..functions).map(|f| self.coefficients[i * functions + f] * values[f][k]).sum::<f64>();
                    (sample.p[k * n + i] * xi).abs()
                })
                .sum()
        };
        let size = (0..states).map(momentum).sum::<f64>() / states as f64;
        for (c, value) in self.gauge.iter_mut().zip(values) {
            let part = *c * value.iter().map(|x| x.abs()).sum::<f64>() / states as f64;
            if part.abs() < noise * size {
                *c = 0.0;
            }
        }
        // The first function is the constant.
        if let Some(constant) = self.gauge.first_mut() {
            *constant = 0.0;
        }
    }

    /// The field as a formula, such as `-y d_x + x d_y`.
    pub fn text(&self, basis: &Basis) -> String {
        let functions = self.gauge.len();
        let terms = self.coefficients.iter().enumerate().map(|(k, c)| {
            let (i, f) = (k / functions, k % functions);
            (*c, join(&basis.text(f), &format!("d_{}", basis.names()[i]), " "))
        });
        sum(terms)
    }

    /// The gauge function as a formula; `0` without one.
    pub fn gauge_text(&self, basis: &Basis) -> String {
        sum(self.gauge.iter().enumerate().map(|(f, c)| (*c, basis.text(f))))
    }
}

/// Two texts with a separator between them, if neither is empty.
pub(crate) fn join(a: &str, b: &str, separator: &str) -> String {
    if a.is_empty() || b.is_empty() { format!("{a}{b}") } else { format!("{a}{separator}{b}") }
}

/// A sum of terms with their factors, rounded to five digits; terms of factor 0 are left out.
pub(crate) fn sum(terms: impl Iterator<Item = (f64, String)>) -> String {
    let mut text = String::new();
    for (factor, term) in terms.filter(|(factor, _)| *factor != 0.0) {
        let (sign, size) = (if factor < 0.0 { "-" } else { "+" }, digits(factor.abs()));
        let one = match (size.as_str(), term.as_str()) {
            ("1", term) if !term.is_empty() => term.to_string(),
            (_, "") => size,
            (_, term) if term.starts_with("1/") => format!("{size}{}", &term[1..]),
            (_, term) if term.starts_with("d_") => format!("{size} {term}"),
            _ => format!("{size}*{term}"),
        };
        match (text.is_empty(), sign) {
            (true, "+") => text += &one,
            (true, _) => text += &format!("-{one}"),
            (false, sign) => text += &format!(" {sign} {one}"),
        }
    }
    if text.is_empty() { "0".to_string() } else { text }
}

/// Five significant digits, without zeros at the end.
fn digits(x: f64) -> String {
    let text = format!("{x:.4e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if !(-4..6).contains(&exponent) {
        return format!("{}e{exponent}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let text = format!("{x:.*}", usize::try_from(4 - exponent).unwrap_or(0));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A charge along a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Charge {
    /// Its values at the samples.
    pub values: Vec<f64>,
    /// Value at the end less that at the start, the sum of the two parts.
    pub drift: f64,
    /// Part of the model: the integral over time of the violation of the symmetry, `xi.dL/dq + (D xi v).dL/dv - dF/dt`, or of the power of
    /// friction, along the motion.
    pub by_model: f64,
    /// Part of the integrator: the rest, to the accuracy of the integral over the samples.
    pub by_integrator: f64,
}

impl Charge {
    /// The energy `E = p.v - L` and the charges `p.xi - F` of fields over a basis along a motion, the energy first.
    ///
    /// A charge would stay the same if the model had the symmetry and the integrator made no error. The model's contribution to its drift is
    /// integrated over the samples by Simpson's rule, so the samples should be dense.
    ///
    /// # Errors
    /// [`SymmetryError::Basis`] for a basis or a motion of another number of coordinates, [`SymmetryError::States`] if terms are not
    /// finite somewhere.
    pub fn of(
        model: &dyn EulerLagrange<f64>,
        basis: &Basis,
        fields: &[Field],
        motion: &Trajectory<f64>,
    ) -> Result<Vec<Self>, SymmetryError> {
        let n = model.coordinates();
        for found in [basis.names().len(), motion.coordinates] {
            if found != n {
                return Err(SymmetryError::Basis { expected: n, found });
            }
        }
        let request = Request::ENERGY | Request::DL_DQ | Request::FORCE;
        let (mut terms, mut at) = (Terms::default(), Values::default());
        let mut series = vec![(Vec::with_capacity(motion.len()), Vec::with_capacity(motion.len())); fields.len() + 1];
        for (q, v) in motion.q.chunks(STATES_AT_ONCE * n).zip(motion.v.chunks(STATES_AT_ONCE * n)) {
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
                    // Friction changes momenta too.
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
}

/// The [`Charge::of`] of an exact Lagrangian along the motion of a learned one.
///
/// They do not depend on the factor and the gauge up to which a learned Lagrangian is determined. The part of the model is the integral of
/// `xi.M (a_learned - a_exact)`, for the energy that of `v.M (a_learned - a_exact)`, with `M` and `a_exact` of the exact Lagrangian, which
/// must have the symmetries and no friction; the rest is due to the integrator.
///
/// # Errors
/// Returns the same errors as [`Charge::of`].
pub fn drifts(
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    basis: &Basis,
    fields: &[Field],
    motion: &Trajectory<f64>,
) -> Result<Vec<Charge>, SymmetryError> {
    let mut all = Charge::of(exact, basis, fields, motion)?;
    let n = exact.coordinates();
    let (mut right, mut other, mut at) = (Terms::default(), Terms::default(), Values::default());
    let mut rates = vec![Vec::with_capacity(motion.len()); all.len()];
    for (q, v) in motion.q.chunks(STATES_AT_ONCE * n).zip(motion.v.chunks(STATES_AT_ONCE * n)) {
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
    use crate::rollout::{Integrator, RolloutOptions, rollout};
    use crate::symmetry::{Chart, Degrees};

    #[test]
    fn sums_are_readable() {
        let terms = |list: &[(f64, &str)]| sum(list.iter().map(|(c, t)| (*c, t.to_string())));
        assert_eq!(terms(&[(-1.0, "y d_x"), (1.0, "x d_y")]), "-y d_x + x d_y");
        assert_eq!(terms(&[(0.5, ""), (-2.0, "1/r"), (0.0, "x"), (1.0 / 3.0, "x^2")]), "0.5 - 2/r + 0.33333*x^2");
        assert_eq!(terms(&[(3.0, "d_t")]), "3 d_t");
        assert_eq!(terms(&[]), "0");
        assert_eq!([1.0 - 1e-12, 1234.56, 1e-7, 2.5e9].map(digits), ["1", "1234.6", "1e-7", "2.5e9"]);
    }

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
        let options = RolloutOptions::new(3.0, 0.01).method(Integrator::Gauss6).step(0.01);
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

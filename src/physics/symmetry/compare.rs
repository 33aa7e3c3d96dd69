//! Comparison of two Lagrangians of the same coordinates: values, motion, mass matrices and energies.

use super::basis::{Basis, Values, unknowns};
use super::find::check_size;
use super::null_space::{add, dot, norm, orthonormal};
use super::sample::Sample;
use super::thresholds::{INDEPENDENT_COLUMN, METRIC_POWERS, ROUNDING_TERM};
use super::{SymmetryError, field, null_space};
use crate::lagrangian::{EulerLagrange, Regrouped, Request, Terms};
use crate::linalg::{Workspace, eigh};
use serde::Serialize;

/// Differences of two Lagrangians `A` and `B`, after the best `A = f(B) + dF/dt + constant` has been taken out. Every
/// distance is relative, 0 for equal ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Coefficients of `f`, from the first power of `B`: a factor, or for geodesics of a metric a polynomial, whose first coefficient
    /// `f'(0)` is the factor of the mass matrix at rest.
    pub factors: Vec<f64>,
    /// Factors of the groups of coordinates that do not act on each other in `B`, in the order of their first coordinates; empty if all
    /// coordinates are one group. They are applied first: everything here refers to `B` with these factors.
    pub group_factors: Vec<f64>,
    /// `true` if `B` is a metric whose Lagrangian is the same at all states, as on a mass shell, and `A` is not a metric: then the states
    /// determine `f'` only at this value, and mass matrices only up to a part `h p p^T`.
    pub on_shell: bool,
    /// Coefficients of the gauge function `F`, one for every function of the basis.
    pub gauge: Vec<f64>,
    /// `F` as a formula, without functions whose coefficients the states do not determine.
    pub gauge_formula: String,
    /// The constant, in the unit of `A`.
    pub constant: f64,
    /// Residual of the momenta and of the values of `A` after fitting `f(B) + dF/dt + constant`, root mean square over that of `A`, with
    /// values about their mean.
    pub lagrangian: f64,
    /// Difference of the accelerations, root mean square in the frame of `|M|` of `B` over that of the larger ones; `NaN` without
    /// accelerations.
    pub motion: f64,
    /// States at which one of the two has no accelerations because its mass matrix is singular; `motion` is taken over the others.
    pub motionless_states: usize,
    /// Residual of the mass matrix of `A` after fitting that of `f(B)`, root mean square over that of `A`, in the same frame.
    pub mass_matrix: f64,
    /// Residual of the energy of `A` after fitting a polynomial of that of `B`, of first degree unless `f` has a higher one, root mean
    /// square over that of the energy of `A` about its mean, or over the energy where that of `B` is the same at all states.
    pub energy: f64,
}

impl Comparison {
    /// Compares two Lagrangians at states `(q, v)`, `(states, n)`, apart from the freedom that `L` has.
    ///
    /// At best, motion determines `L` up to a factor for each group of coordinates that act on each other, a total derivative, `L -> s L +
    /// dF(q)/dt`, and a constant. For geodesics, along which `L` is the energy, it does so up to a function `f(L)`, where `B` is the metric.
    /// The best `s` (or `f`, a polynomial of degree 3), follows by linear least squares from the mass matrices, which do not depend on a gauge;
    /// `F`, over the functions of a basis, follows from the momenta, both in the frame of `|M|` of `B`; the constant follows from the values.
    /// They are removed, and the residual is reported for each quantity. For two metrics `f` is a factor. Where `B` has the same value `B0` at
    /// all states, as on a mass shell, motion does not depend on `(B - B0)^2 h(q, v)`: `f` is a factor, and the part `h p p^T` of the mass
    /// matrices is ignored at every state.
    ///
    /// # Errors
    /// [`SymmetryError`].
    pub fn of(
        a: &dyn EulerLagrange<f64>,
        b: &dyn EulerLagrange<f64>,
        basis: &Basis,
        (q, v): (&[f64], &[f64]),
    ) -> Result<Self, SymmetryError> {
        if a.coordinates() != b.coordinates() || basis.names().len() != b.coordinates() {
            let found = if a.coordinates() == b.coordinates() { basis.names().len() } else { a.coordinates() };
            return Err(SymmetryError::Basis { expected: b.coordinates(), found });
        }
        check_size(b.coordinates(), unknowns(b.coordinates(), basis.len()), q.len() / b.coordinates().max(1))?;
        let regrouped = Regrouped::nearest(b, a, (q, v));
        let b = regrouped.as_ref().map_or(b, |regrouped| regrouped as &dyn EulerLagrange<f64>);
        // States at which both are finite.
        let of_a = Sample::new(a, q, v)?;
        let of_b = Sample::new(b, &of_a.q, &of_a.v)?;
        let of_a = Sample::new(a, &of_b.q, &of_b.v)?;
        let [mut first, mut second] = [Terms::default(), Terms::default()];
        for (model, terms) in [(a, &mut first), (b, &mut second)] {
            // A state whose mass matrix is singular has no acceleration to compare.
            let _ = model.terms(&of_b.q, &of_b.v, Request::ACCELERATION, terms);
        }
        let fit = Fit::new((&of_a, &of_b), [&first, &second], basis)?;
        let (mass_matrix, motion, motionless_states) = fit.mechanics([&first, &second], &of_b)?;
        let energy = fit.energy(&of_a, &of_b);
        Ok(Comparison {
            gauge_formula: field::sum(fit.known_gauge.iter().enumerate().map(|(f, c)| (*c, basis.text(f)))),
            factors: fit.factors,
            group_factors: regrouped.as_ref().map_or(Vec::new(), |regrouped| regrouped.factors.clone()),
            on_shell: fit.on_shell,
            gauge: fit.gauge,
            constant: fit.constant,
            lagrangian: fit.rest,
            motion,
            motionless_states,
            mass_matrix,
            energy,
        })
    }
}

/// The best `f` and `F`.
struct Fit {
    factors: Vec<f64>,
    on_shell: bool,
    gauge: Vec<f64>,
    /// The gauge function without coefficients that the states do not determine.
    known_gauge: Vec<f64>,
    constant: f64,
    rest: f64,
}

/// Values `L = p.v - E`.
fn lagrangians(sample: &Sample) -> Vec<f64> {
    let pairs = sample.p.chunks_exact(sample.n).zip(sample.v.chunks_exact(sample.n));
    pairs.zip(&sample.energy).map(|((p, v), e)| dot(p, v) - e).collect()
}

impl Fit {
    fn new((a, b): (&Sample, &Sample), terms: [&Terms<f64>; 2], basis: &Basis) -> Result<Self, SymmetryError> {
        let (n, states, functions) = (b.n, b.len(), basis.len());
        let (values, own) = (lagrangians(a), lagrangians(b));
        // If a function of a metric is a metric again, it is a factor.
        let powers = if b.homogeneous && !a.homogeneous { METRIC_POWERS } else { 1 };
        // If both are even in the velocities, no difference is a dF/dt, which is odd.
        let functions = if a.even && b.even { 0 } else { functions };
        let frames = Frames::new(b)?;
        let rms = |x: &[f64]| norm(x) / (x.len() as f64).sqrt();
        let motion: Vec<f64> = b.p.chunks_exact(n).zip(b.v.chunks_exact(n)).map(|(p, v)| dot(p, v)).collect();
        let unit = 1.0 / rms(&motion).max(f64::MIN_POSITIVE.sqrt());
        // Momenta in the frame of B, `(states, n)`, and values, `(states)`, both relative to those of the motion of B.
        let at_states = |momentum: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
            (0..states).flat_map(|k| frames.down(k, &momentum(k))).collect()
        };
        let p = |sample: &Sample, k: usize, factor: f64| -> Vec<f64> {
            sample.p[k * n..(k + 1) * n].iter().map(|p| p * factor).collect()
        };
        let mut at = vec![Values::default(); states];
        at.iter_mut().zip(b.q.chunks_exact(n)).for_each(|(at, q)| basis.evaluate(q, at));
        let gradient = |f: usize, k: usize| &at[k].gradient[f * n..(f + 1) * n];
        let level = own.iter().sum::<f64>() / states as f64;
        let on_shell = powers > 1 && own.iter().all(|x| (x - level).abs() <= INDEPENDENT_COLUMN * level.abs());
        let powers = if on_shell { 1 } else { powers };
        let factors = factors(terms, (b, &own), &frames, (powers, unit, on_shell));
        let found = Self { factors, on_shell, gauge: vec![], known_gauge: vec![], constant: 0.0, rest: 0.0 };
        let columns: Vec<Vec<f64>> = (0..functions).map(|f| at_states(&|k| gradient(f, k).to_vec())).collect();
        if states * n < columns.len() {
            return Err(SymmetryError::TooFew { unknowns: columns.len(), states });
        }
        let (target, scale) = (at_states(&|k| p(a, k, 1.0)), at_states(&|k| p(b, k, 1.0)));
        let mut rest = target.clone();
        add(&mut rest, &at_states(&|k| p(b, k, found.slopes(own[k])[0])), -1.0);
        let plain = orthonormal(&columns, INDEPENDENT_COLUMN);
        let mut gauge = plain.given(&plain.along(&rest), columns.len());
        let mut known_gauge = null_space::significant(&columns, &rest, INDEPENDENT_COLUMN);
        let whole = norm(&target);
        // Rounding errors are not terms.
        for (k, column) in columns.iter().enumerate() {
            for c in [&mut gauge[k], &mut known_gauge[k]] {
                if (*c * norm(column)).abs() <= ROUNDING_TERM * whole {
                    *c = 0.0;
                }
            }
        }
        gauge.iter().zip(&columns).for_each(|(c, column)| add(&mut rest, column, -c));
        let mut left: Vec<f64> = (0..states)
            .map(|k| {
                let f: f64 = found.factors.iter().enumerate().map(|(m, c)| c * own[k].powi(m as i32 + 1)).sum();
                let v = &b.v[k * n..(k + 1) * n];
                values[k] - f - gauge.iter().enumerate().map(|(f, c)| c * dot(gradient(f, k), v)).sum::<f64>()
            })
            .collect();
        gauge.resize(basis.len(), 0.0);
        let constant = left.iter().sum::<f64>() / states as f64;
        left.iter_mut().for_each(|x| *x -= constant);
        let mean = values.iter().sum::<f64>() / states as f64;
        let about: Vec<f64> = values.iter().map(|x| x - mean).collect();
        // Momenta weigh as the values of the motion of B do.
        let weight = rms(&motion) / (norm(&scale) / (states as f64).sqrt()).max(f64::MIN_POSITIVE.sqrt());
        let size = |momenta: &[f64], values: &[f64]| (weight * norm(momenta)).hypot(norm(values));
        let whole = size(&target, &about);
        let rest = if whole > 0.0 { size(&rest, &left) / whole } else { 0.0 };
        Ok(Self { gauge, known_gauge, constant, rest, ..found })
    }

    /// `f'` and `f''` at a value of `B`.
    fn slopes(&self, value: f64) -> [f64; 2] {
        let powers = self.factors.iter().enumerate().map(|(k, c)| (k as i32 + 1, *c));
        powers.fold([0.0, 0.0], |[first, second], (k, c)| {
            let k_ = f64::from(k);
            let curve = if k > 1 { c * k_ * (k_ - 1.0) * value.powi(k - 2) } else { 0.0 };
            [first + c * k_ * value.powi(k - 1), second + curve]
        })
    }

    /// Distances of mass matrices and of accelerations, and the number of states without accelerations.
    fn mechanics(
        &self,
        [first, second]: [&Terms<f64>; 2],
        sample: &Sample,
    ) -> Result<(f64, f64, usize), SymmetryError> {
        let (n, frames) = (sample.n, Frames::new(sample)?);
        let own = lagrangians(sample);
        let (mut left, mut whole, mut apart, mut size, mut motionless) = (0.0, 0.0, 0.0, 0.0, 0);
        for k in 0..sample.len() {
            let (matrix, one) = (k * n * n..(k + 1) * n * n, k * n..(k + 1) * n);
            let [slope, curve] = self.slopes(own[k]);
            let p = &sample.p[one.clone()];
            let (m, mut rest) = (&first.mass_matrix[matrix.clone()], vec![0.0; n * n]);
            for (e, rest) in rest.iter_mut().enumerate() {
                *rest = m[e] - slope * second.mass_matrix[matrix.start + e] - curve * p[e / n] * p[e % n];
            }
            let mut rest = frames.matrix(k, &rest);
            if self.on_shell {
                without(&mut rest, &frames.down(k, p));
            }
            left += dot(&rest, &rest);
            let m = frames.matrix(k, m);
            whole += dot(&m, &m);
            let [x, y] = [first, second].map(|terms| &terms.acceleration[one.clone()]);
            let difference: Vec<f64> = x.iter().zip(y).map(|(x, y)| x - y).collect();
            let [d, x, y] = [&difference[..], x, y].map(|a| norm(&frames.up(k, a)));
            if d.is_finite() {
                apart += d * d;
                size += x.max(y).powi(2);
            } else {
                motionless += 1;
            }
        }
        let ratio = |part: f64, whole: f64| if part == 0.0 { 0.0 } else { (part / whole).sqrt() };
        let motion = if motionless < sample.len() { ratio(apart, size) } else { f64::NAN };
        Ok((ratio(left, whole), motion, motionless))
    }

    /// Distance of the energies.
    fn energy(&self, a: &Sample, b: &Sample) -> f64 {
        let largest = b.energy.iter().fold(f64::MIN_POSITIVE, |m: f64, e| m.max(e.abs()));
        let power = |k: usize| b.energy.iter().map(|e| (e / largest).powi(k as i32)).collect::<Vec<f64>>();
        let known = orthonormal(&(0..=self.factors.len()).map(power).collect::<Vec<_>>(), INDEPENDENT_COLUMN);
        let mut rest = a.energy.clone();
        known.remove(&mut rest);
        let about = |energy: &[f64]| {
            let mut about = energy.to_vec();
            orthonormal(&[vec![1.0; energy.len()]], INDEPENDENT_COLUMN).remove(&mut about);
            norm(&about)
        };
        // On a mass shell the energy is the same everywhere, and only its own size is left to compare with.
        let constant = about(&b.energy) <= ROUNDING_TERM * norm(&b.energy);
        let whole = if constant { norm(&a.energy) } else { about(&a.energy) };
        if norm(&rest) <= f64::EPSILON * norm(&a.energy) { 0.0 } else { norm(&rest) / whole }
    }
}

/// Roots of `|M|` at every state.
struct Frames {
    n: usize,
    values: Vec<f64>,
    vectors: Vec<f64>,
}

impl Frames {
    fn new(sample: &Sample) -> Result<Self, SymmetryError> {
        let (n, states) = (sample.n, sample.len());
        let (mut values, mut vectors) = (vec![0.0; states * n], vec![0.0; states * n * n]);
        eigh(n, &sample.frame, &mut values, &mut vectors, &mut Workspace::new())
            .map_err(|_| SymmetryError::NotFinite { what: "the mass matrix" })?;
        values.iter_mut().for_each(|w| *w = w.max(f64::MIN_POSITIVE).sqrt());
        Ok(Self { n, values, vectors })
    }

    fn at(&self, k: usize) -> impl Iterator<Item = (f64, &[f64])> {
        let n = self.n;
        let values = self.values[k * n..(k + 1) * n].iter().copied();
        values.zip(self.vectors[k * n * n..(k + 1) * n * n].chunks_exact(n))
    }

    /// A velocity or an acceleration in the frame.
    fn up(&self, k: usize, x: &[f64]) -> Vec<f64> {
        self.at(k).map(|(w, u)| w * dot(u, x)).collect()
    }

    /// A momentum in the frame.
    fn down(&self, k: usize, x: &[f64]) -> Vec<f64> {
        self.at(k).map(|(w, u)| dot(u, x) / w).collect()
    }

    /// A symmetric matrix in the frame, `(n, n)`.
    fn matrix(&self, k: usize, matrix: &[f64]) -> Vec<f64> {
        let column = |(w, u): (f64, &[f64])| {
            let mut image = vec![0.0; self.n];
            matrix.chunks_exact(self.n).zip(u).for_each(|(row, u)| add(&mut image, row, u / w));
            self.down(k, &image)
        };
        self.at(k).flat_map(column).collect()
    }
}

/// Removes the part along `p p^T` from a matrix `(n, n)`.
fn without(matrix: &mut [f64], p: &[f64]) {
    let n = p.len();
    let part: f64 = matrix.chunks_exact(n).zip(p).map(|(row, x)| x * dot(row, p)).sum();
    let square = dot(p, p).powi(2);
    if square > 0.0 {
        matrix.iter_mut().enumerate().for_each(|(e, m)| *m -= part / square * p[e / n] * p[e % n]);
    }
}

/// Coefficients of `f`, from the first power: the best ones of `M_A = f' M_B + f'' p p^T`, plus parts along `p p^T` on a mass shell; `unit`
/// is the size of `1/B`.
fn factors(
    [first, second]: [&Terms<f64>; 2],
    (sample, own): (&Sample, &[f64]),
    frames: &Frames,
    (powers, unit, on_shell): (usize, f64, bool),
) -> Vec<f64> {
    let n = sample.n;
    let at_states = |matrix: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        let one = |k: usize| {
            let entries: Vec<f64> = (0..n * n).map(|e| matrix(k, e)).collect();
            let mut entries = frames.matrix(k, &entries);
            if on_shell {
                without(&mut entries, &frames.down(k, &sample.p[k * n..(k + 1) * n]));
            }
            entries
        };
        (0..sample.len()).flat_map(one).collect()
    };
    // The power m of B times the unit, over the unit.
    let power = |m: usize| {
        at_states(&|k, e| {
            let (m_, b, p) = (m as f64, own[k] * unit, &sample.p[k * n..(k + 1) * n]);
            let bent = if m > 1 { m_ * (m_ - 1.0) * unit * b.powi(m as i32 - 2) * p[e / n] * p[e % n] } else { 0.0 };
            m_ * b.powi(m as i32 - 1) * second.mass_matrix[k * n * n + e] + bent
        })
    };
    let columns: Vec<Vec<f64>> = (1..=powers).map(power).collect();
    let target = at_states(&|k, e| first.mass_matrix[k * n * n + e]);
    let plain = orthonormal(&columns, INDEPENDENT_COLUMN);
    let mut solution = plain.given(&plain.along(&target), columns.len());
    let whole = norm(&target);
    // Rounding errors are not terms.
    for (c, column) in solution.iter_mut().zip(&columns).skip(1) {
        if (*c * norm(column)).abs() <= ROUNDING_TERM * whole {
            *c = 0.0;
        }
    }
    while solution.len() > 1 && solution.last() == Some(&0.0) {
        solution.pop();
    }
    solution.iter().enumerate().map(|(m, c)| c * unit.powi(m as i32)).collect()
}

//! Common ground of two Lagrangians of the same coordinates: the motion, and more than that.

use super::basis::{Basis, Values};
use super::orthonormal::{add, dot, norm, orthonormal};
use super::sample::Sample;
use super::{SymmetryError, field};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, eigh};
use serde::Serialize;

/// Differences of two Lagrangians `A` and `B`, after the best `A = f(B) + dF/dt + constant` has been taken out. Every
/// distance is relative, 0 for equal ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Coefficients of `f`, from the first power of `B`: a factor, or for geodesics of a metric a polynomial, whose first coefficient
    /// `f'(0)` is the factor of the mass matrix at rest.
    pub factors: Vec<f64>,
    /// `true` if `B` is a metric whose Lagrangian is the same at all states, as on a mass shell, and `A` is not a metric: then the
    /// states know `f'` and `f''` at this one value, and `f'(0)` is extrapolated.
    pub on_shell: bool,
    /// Coefficients of the gauge function `F`, one for every function of the basis.
    pub gauge: Vec<f64>,
    /// `F` as a formula.
    pub gauge_formula: String,
    /// The constant, in the unit of `A`.
    pub constant: f64,
    /// Rest of the momenta and of the values of `A` beside `f(B) + dF/dt + constant`, root mean square over that of `A`, values
    /// about their mean.
    pub lagrangian: f64,
    /// Difference of the accelerations, root mean square in the frame of `|M|` of `B` over that of the larger ones.
    pub motion: f64,
    /// Rest of the mass matrix of `A` beside that of `f(B)`, root mean square over that of `A`, in the same frame.
    pub mass_matrix: f64,
    /// Rest of the energy of `A` beside the best polynomial of that of `B`, of first degree unless `f` has a higher one, root
    /// mean square over that of the energy of `A` about its mean, or over the energy where that of `B` is the same at all states.
    pub energy: f64,
}

/// Highest power of `B` in `f`, for geodesics.
const POWERS: usize = 3;
/// Part of a column that must be left beside the others.
const DEPENDENT: f64 = 1e-9;

/// Compares two Lagrangians at states `(q, v)`, `(states, n)`: what they have in common beyond the freedom that `L` has.
///
/// The motion determines `L` at best up to a factor and a total derivative, `L -> s L + dF(q)/dt`, and up to a constant; that of
/// geodesics, along which `L` is the energy, up to a function `f(L)`, where `B` is the metric. The best `s` (or `f`, a
/// polynomial of degree 3) and `F`, over the functions of a basis, follow by linear least squares from the momenta of both, in the
/// frame of `|M|` of `B`, the constant from the values. They are taken out, and what is left is stated by quantity. Of two metrics
/// `f` is a factor. Where `B` is the same on all states, as on a mass shell, momenta know `f'` there, and `f''` follows from the mass
/// matrices, `f' M + f'' p p^T`.
///
/// # Errors
/// [`SymmetryError`].
pub fn compare(
    a: &dyn EulerLagrange<f64>,
    b: &dyn EulerLagrange<f64>,
    basis: &Basis,
    (q, v): (&[f64], &[f64]),
) -> Result<Comparison, SymmetryError> {
    if a.coordinates() != b.coordinates() || basis.names().len() != b.coordinates() {
        let found = if a.coordinates() == b.coordinates() { basis.names().len() } else { a.coordinates() };
        return Err(SymmetryError::Basis { expected: b.coordinates(), found });
    }
    // States at which both are finite.
    let of_a = Sample::new(a, q, v)?;
    let of_b = Sample::new(b, &of_a.q, &of_a.v)?;
    let of_a = Sample::new(a, &of_b.q, &of_b.v)?;
    let mut fit = Fit::new(&of_a, &of_b, basis)?;
    let (mass_matrix, motion) = fit.mechanics(a, b, &of_b)?;
    let energy = fit.energy(&of_a, &of_b);
    Ok(Comparison {
        gauge_formula: field::sum(fit.gauge.iter().enumerate().map(|(f, c)| (*c, basis.text(f)))),
        factors: fit.factors,
        on_shell: fit.on_shell,
        gauge: fit.gauge,
        constant: fit.constant,
        lagrangian: fit.rest,
        motion,
        mass_matrix,
        energy,
    })
}

/// The best `f` and `F`.
struct Fit {
    factors: Vec<f64>,
    on_shell: bool,
    gauge: Vec<f64>,
    constant: f64,
    rest: f64,
}

/// Values `L = p.v - E`.
fn lagrangians(sample: &Sample) -> Vec<f64> {
    let pairs = sample.p.chunks_exact(sample.n).zip(sample.v.chunks_exact(sample.n));
    pairs.zip(&sample.energy).map(|((p, v), e)| dot(p, v) - e).collect()
}

impl Fit {
    fn new(a: &Sample, b: &Sample, basis: &Basis) -> Result<Self, SymmetryError> {
        let (n, states, functions) = (b.n, b.len(), basis.len());
        let (values, own) = (lagrangians(a), lagrangians(b));
        // A function of one metric that is another one is a factor.
        let powers = if b.homogeneous && !a.homogeneous { POWERS } else { 1 };
        // Of two that are even in the velocities no difference is a dF/dt, which is odd.
        let functions = if a.even && b.even { 0 } else { functions };
        let frames = Frames::new(b)?;
        let rms = |x: &[f64]| norm(x) / (x.len() as f64).sqrt();
        let motion: Vec<f64> = b.p.chunks_exact(n).zip(b.v.chunks_exact(n)).map(|(p, v)| dot(p, v)).collect();
        let unit = 1.0 / rms(&motion).max(f64::MIN_POSITIVE.sqrt());
        // Momenta in the frame of B, `(states, n)`, and values, `(states)`, both beside those of the motion of B.
        let at_states = |momentum: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
            (0..states).flat_map(|k| frames.down(k, &momentum(k))).collect()
        };
        let p = |sample: &Sample, k: usize, factor: f64| -> Vec<f64> {
            sample.p[k * n..(k + 1) * n].iter().map(|p| p * factor).collect()
        };
        let mut at = vec![Values::default(); states];
        at.iter_mut().zip(b.q.chunks_exact(n)).for_each(|(at, q)| basis.evaluate(q, at));
        let gradient = |f: usize, k: usize| &at[k].gradient[f * n..(f + 1) * n];
        // Higher powers come last: on a mass shell they say nothing that the first does not.
        let power = |k: usize, power: usize| power as f64 * (own[k] * unit).powi(power as i32 - 1);
        let first = std::iter::once(at_states(&|k| p(b, k, 1.0)));
        let gauges = (0..functions).map(|f| at_states(&|k| gradient(f, k).to_vec()));
        let higher = (2..=powers).map(|m| at_states(&|k| p(b, k, power(k, m))));
        let columns: Vec<Vec<f64>> = first.chain(gauges).chain(higher).collect();
        if states * n < columns.len() {
            return Err(SymmetryError::TooFew { unknowns: columns.len(), states });
        }
        let target = at_states(&|k| p(a, k, 1.0));
        let plain = orthonormal(&columns, DEPENDENT);
        let mut solution = plain.given(&plain.along(&target), columns.len());
        let whole = norm(&target);
        // Roundings are no terms.
        for (c, column) in solution.iter_mut().zip(&columns).skip(1) {
            if (*c * norm(column)).abs() <= 1e-9 * whole {
                *c = 0.0;
            }
        }
        let mut rest = target.clone();
        solution.iter().zip(&columns).for_each(|(c, column)| add(&mut rest, column, -c));
        let higher = solution.split_off(functions + 1);
        let mut gauge = solution.split_off(1);
        let factors = solution.into_iter().chain(higher).enumerate();
        let factors: Vec<f64> = factors.map(|(k, c)| c * unit.powi(k as i32)).collect();
        let kept = 1 + factors.iter().skip(1).rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
        let mut left: Vec<f64> = (0..states)
            .map(|k| {
                let f: f64 = factors.iter().enumerate().map(|(m, c)| c * own[k].powi(m as i32 + 1)).sum();
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
        let weight = rms(&motion) / (norm(&columns[0]) / (states as f64).sqrt()).max(f64::MIN_POSITIVE.sqrt());
        let size = |momenta: &[f64], values: &[f64]| (weight * norm(momenta)).hypot(norm(values));
        let whole = size(&target, &about);
        let rest = if whole > 0.0 { size(&rest, &left) / whole } else { 0.0 };
        let level = own.iter().sum::<f64>() / states as f64;
        let on_shell = powers > 1 && own.iter().all(|x| (x - level).abs() <= DEPENDENT * level.abs());
        Ok(Self { factors: factors[..kept].to_vec(), on_shell, gauge, constant, rest })
    }

    /// The `f''` at the one value of `B` on a mass shell that leaves the least of the mass matrices `M_A - f' M_B`, `f'` as it was.
    fn bend(&mut self, [first, second]: [&Terms<f64>; 2], sample: &Sample, frames: &Frames) {
        let (n, own) = (sample.n, lagrangians(sample));
        let level = own.iter().sum::<f64>() / own.len() as f64;
        let [slope, _] = self.slopes(level);
        let (mut along, mut whole) = (0.0, 0.0);
        for k in 0..sample.len() {
            let of = |terms: &Terms<f64>| terms.mass_matrix[k * n * n..(k + 1) * n * n].to_vec();
            let (mut rest, metric) = (of(first), of(second));
            add(&mut rest, &metric, -slope);
            // Beside p p^T a matrix X has the part p.X p, both in the frame.
            let raised: Vec<f64> = frames.raised(k, &sample.p[k * n..(k + 1) * n]);
            let size = dot(&raised, &sample.p[k * n..(k + 1) * n]);
            let image = rest.chunks_exact(n).map(|row| dot(row, &raised));
            along += image.zip(&raised).map(|(x, u)| x * u).sum::<f64>();
            whole += size * size;
        }
        let bend = along / whole;
        if bend.is_finite() && bend != 0.0 {
            self.factors = vec![slope - bend * level, 0.5 * bend];
            self.constant += 0.5 * bend * level * level;
        }
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

    /// Distances of mass matrices and of accelerations.
    fn mechanics(
        &mut self,
        a: &dyn EulerLagrange<f64>,
        b: &dyn EulerLagrange<f64>,
        sample: &Sample,
    ) -> Result<(f64, f64), SymmetryError> {
        let (n, frames) = (sample.n, Frames::new(sample)?);
        let own = lagrangians(sample);
        let [mut first, mut second] = [Terms::default(), Terms::default()];
        for (model, terms) in [(a, &mut first), (b, &mut second)] {
            // A state whose mass matrix is singular has no acceleration to compare.
            let _ = model.terms(&sample.q, &sample.v, Request::ACCELERATION, terms);
        }
        if self.on_shell {
            self.bend([&first, &second], sample, &frames);
        }
        let (mut left, mut whole, mut apart, mut size) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..sample.len() {
            let (matrix, one) = (k * n * n..(k + 1) * n * n, k * n..(k + 1) * n);
            let [slope, curve] = self.slopes(own[k]);
            let p = &sample.p[one.clone()];
            let (m, mut rest) = (&first.mass_matrix[matrix.clone()], vec![0.0; n * n]);
            for (e, rest) in rest.iter_mut().enumerate() {
                *rest = m[e] - slope * second.mass_matrix[matrix.start + e] - curve * p[e / n] * p[e % n];
            }
            left += frames.square(k, &rest);
            whole += frames.square(k, m);
            let [x, y] = [&first, &second].map(|terms| &terms.acceleration[one.clone()]);
            let difference: Vec<f64> = x.iter().zip(y).map(|(x, y)| x - y).collect();
            let [d, x, y] = [&difference[..], x, y].map(|a| norm(&frames.up(k, a)));
            if d.is_finite() {
                apart += d * d;
                size += x.max(y).powi(2);
            }
        }
        let ratio = |part: f64, whole: f64| if part == 0.0 { 0.0 } else { (part / whole).sqrt() };
        Ok((ratio(left, whole), ratio(apart, size)))
    }

    /// Distance of the energies.
    fn energy(&self, a: &Sample, b: &Sample) -> f64 {
        let largest = b.energy.iter().fold(f64::MIN_POSITIVE, |m: f64, e| m.max(e.abs()));
        let power = |k: usize| b.energy.iter().map(|e| (e / largest).powi(k as i32)).collect::<Vec<f64>>();
        let known = orthonormal(&(0..=self.factors.len()).map(power).collect::<Vec<_>>(), DEPENDENT);
        let mut rest = a.energy.clone();
        known.remove(&mut rest);
        let about = |energy: &[f64]| {
            let mut about = energy.to_vec();
            orthonormal(&[vec![1.0; energy.len()]], DEPENDENT).remove(&mut about);
            norm(&about)
        };
        // On a mass shell the energy is the same everywhere, and only its own size is left to compare with.
        let constant = about(&b.energy) <= 1e-9 * norm(&b.energy);
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

    /// The vector `|M|^-1 p` of a momentum.
    fn raised(&self, k: usize, p: &[f64]) -> Vec<f64> {
        let mut raised = vec![0.0; self.n];
        self.at(k).for_each(|(w, u)| add(&mut raised, u, dot(u, p) / (w * w)));
        raised
    }

    /// Square of a symmetric matrix in the frame.
    fn square(&self, k: usize, matrix: &[f64]) -> f64 {
        let columns = self.at(k).map(|(w, u)| {
            let mut image = vec![0.0; self.n];
            matrix.chunks_exact(self.n).zip(u).for_each(|(row, u)| add(&mut image, row, u / w));
            self.down(k, &image)
        });
        columns.map(|column| dot(&column, &column)).sum()
    }
}

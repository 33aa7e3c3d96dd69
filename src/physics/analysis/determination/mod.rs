//! Ranges in which motion determines the learned mass matrix, friction and energy.
//!
//! Two Lagrangians may give the same motion on all recorded states and still differ in `M`: where a momentum is conserved, any function of
//! it may be added to `L`. What the data do not determine is therefore read off the curvature of the likelihood around the learned model,
//! in all directions in which a Lagrangian can change. The equations of motion are linear in `L` and in the dissipation `D`: a change `dL + dD`
//! changes the acceleration of a state by
//!
//! ```text
//! da = -M^-1 (d/dt d(dL)/dv - d(dL)/dq + d(dD)/dv),
//! ```
//!
//! so that changes `sum_k x_k phi_k`, where the `x_k` have a normal prior of standard deviation 1 (the changes are scaled to the model's
//! own size), follow from a linear regression, `C = (1 + A^T W A)^-1`, `x = C A^T W e`. Here `A` holds the changes of the accelerations,
//! and `e` the residuals of the accelerations. Every quantity that is linear in `L` and `D` follows.
//!
//! Its error has four parts. What the data do not determine keeps its prior size, `C C`. The effect of noise is read off the scatter of `x` when
//! one of twenty groups of consecutive states is left out (the jackknife); this does not assume that samples are independent, and needs no
//! model of the noise. The effect of smoothing bias is the shift of `x` when accelerations come from polynomials two degrees higher.
//! Finally, the share of the accelerations that neither the model nor any change of it explains, beyond their expected error, counts as a
//! relative error of every quantity. `W` is the inverse mean square of `e`, for as many samples as are independent: it only separates the
//! data from the prior.
//!
//! A range reaches two standard deviations to either side of the regression's middle. The regression is of first order: half the
//! way from the learned value to the middle is one more standard deviation.
//!
//! A number whose prior standard deviation the data reduce by less than half is open: its range would only reflect the prior.
//!
//! Without known forces `L` has no unit: quantities are then relative to the mean `M` of the first coordinate.
//!
//! Each group of coordinates that do not act on other groups has a factor of its own. Without a known force on one of its coordinates the
//! factor of a group is open, except for the group of the first coordinate, which is the unit.
//!
//! Where a momentum is conserved, the `M_ii` of its coordinate is open, and so is every other one if that is the unit. Along a trajectory
//! the momentum is a single number, so its dependence on the velocity shows only between trajectories, and few of them pass the same place.
//! A network can represent many functions of the momentum, the changes above only a few.
//!
//! Sources of the method: MacKay, Neural Computation 4 (1992) 448 (Laplace approximation around trained weights), here for
//! functions that are linear in the equations instead of weights; Efron and Stein, Annals of Statistics 9 (1981) 586 (jackknife).

mod changes;
mod constants;
mod decay;
mod observed;
mod posterior;

use crate::analysis::thresholds::{CONSERVED_RATE, ENERGY_STATES, RANGE};
pub use constants::constants;
pub use decay::{Decay, decay};
pub use observed::Observed;

use crate::lagrangian::{EulerLagrange, Request, Terms};
use changes::{Changes, Row};
use posterior::{Data, Posterior};
use serde::{Deserialize, Serialize};

/// A learned number and the range that the data allow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The model's value.
    pub value: f64,
    /// Lower end of the range, not above the value; infinite where the data leave the number open.
    pub low: f64,
    /// Upper end of the range, not below the value; infinite where the data leave the number open.
    pub high: f64,
}

impl Estimate {
    /// The range of a value that a regression shifts by `shift`, with this standard deviation. The regression is of first order: half of
    /// its shift counts as one standard deviation, and the range includes the value itself.
    fn about(value: f64, shift: f64, deviation: f64) -> Self {
        let half = RANGE * deviation.hypot(0.5 * shift);
        Self { value, low: value.min(value + shift - half), high: value.max(value + shift + half) }
    }
    /// A value that the data do not determine.
    fn open(value: f64) -> Self {
        Self { value, low: f64::NEG_INFINITY, high: f64::INFINITY }
    }
    /// `true` if the data leave the number open: no range can be stated.
    pub fn is_open(&self) -> bool {
        self.high.is_infinite()
    }
    /// `true` if a number lies in the range.
    pub fn allows(&self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }
}

/// Ranges that the data allow for a model's inner quantities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Determination {
    /// `true` if known forces fix the unit of `L`; if not, everything is over the mean of `M` of the first coordinate.
    pub absolute: bool,
    /// Groups of coordinates that do not act on each other, and whether the unit of each is known.
    pub groups: Vec<(Vec<usize>, bool)>,
    /// Mean over the states of the upper triangle of `M`, row after row.
    pub mass_matrix: Vec<Estimate>,
    /// Friction coefficient of every coordinate, `sum of v_i dD/dv_i` over `sum of v_i^2`; empty for a model without.
    pub friction: Vec<Estimate>,
    /// Root mean square of the energy about its mean over the states, and of its error.
    pub energy: Estimate,
}

/// Ranges that `observed` allows for `model`; means are taken over its states.
///
/// `None` where no statement is possible: too many coordinates, too few states, or a model that is not finite on them.
pub fn determination(model: &dyn EulerLagrange<f64>, periodic: &[bool], observed: &Observed) -> Option<Determination> {
    let n = model.coordinates();
    let data = Data::new(model, observed)?;
    let changes = Changes::new(periodic, &ranges(n, &data.q), &data.typical()?, !model.conserves_energy())?;
    let posterior = data.posterior(&changes)?;
    let quantities = Quantities::new(model, &changes, (&data.q, &data.v))?;
    let absolute = !observed.force.is_empty();
    let unit = if absolute { None } else { quantities.mass.first().cloned() };
    let over = |linear: &LinearQuantity| linear.over(unit.as_ref());
    let mass: Vec<LinearQuantity> = quantities.mass.iter().map(over).collect();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
    let own: Vec<f64> = pairs.iter().zip(&mass).filter(|((i, j), _)| i == j).map(|(_, mass)| mass.value).collect();
    let floor = &posterior.floor;
    let mass_floor = |&(i, j): &(usize, usize)| (floor[i] * own[i] * floor[j] * own[j]).abs().sqrt();
    let conserved = conserved(model, &data)?;
    let groups = data.groups(model).into_iter().map(|group| {
        let known = if absolute { group.iter().any(|&i| data.is_forced(i)) } else { group.contains(&0) };
        (group, known)
    });
    let groups: Vec<(Vec<usize>, bool)> = groups.collect();
    let known = |i: usize| groups.iter().any(|(group, known)| *known && group.contains(&i));
    let mass_of = |(mass, pair): (&LinearQuantity, &(usize, usize))| {
        let &(i, j) = pair;
        // Without known forces the first element is the unit, and not open itself.
        let moves_on = if absolute { conserved[i] } else { i > 0 && (conserved[0] || conserved[i]) };
        let open = (moves_on && i == j) || !known(i) || !known(j);
        if open { Estimate::open(mass.value) } else { posterior.estimate(mass, mass_floor(pair)) }
    };
    let energy = quantities.energy(&posterior, unit.as_ref());
    let all_known = groups.iter().all(|(_, known)| *known);
    let result = Determination {
        absolute,
        mass_matrix: mass.iter().zip(&pairs).map(mass_of).collect(),
        friction: quantities
            .friction
            .iter()
            .map(over)
            .zip(floor)
            .enumerate()
            .map(|(i, (friction, floor))| match known(i) {
                true => posterior.estimate(&friction, floor * friction.value),
                false => Estimate::open(friction.value),
            })
            .collect(),
        energy: if all_known { energy } else { Estimate::open(energy.value) },
        groups,
    };
    let all = result.mass_matrix.iter().chain(&result.friction).chain([&result.energy]);
    let finite = all.into_iter().all(|e| e.value.is_finite() && !e.low.is_nan() && !e.high.is_nan());
    finite.then_some(result)
}

/// For each coordinate, whether its momentum is conserved, that is, whether `M a` and the change of the momentum with the position cancel.
fn conserved(model: &dyn EulerLagrange<f64>, data: &Data) -> Option<Vec<bool>> {
    let n = model.coordinates();
    let mut terms = Terms::default();
    let request = Request::MASS_MATRIX | Request::CORIOLIS;
    let mut squares = vec![[0.0; 2]; n];
    let states = data.q.chunks_exact(n).zip(data.v.chunks_exact(n)).zip(data.a.chunks_exact(n));
    for ((q, v), a) in states {
        model.terms(q, v, request, &mut terms).ok()?;
        let rows = terms.mass_matrix.chunks_exact(n).zip(&terms.coriolis);
        for ([rate, parts], (row, drift)) in squares.iter_mut().zip(rows) {
            let inertia: f64 = row.iter().zip(a).map(|(m, a)| m * a).sum();
            *rate += (inertia + drift).powi(2);
            *parts += inertia * inertia + drift * drift;
        }
    }
    Some(squares.into_iter().map(|[rate, parts]| rate < CONSERVED_RATE * CONSERVED_RATE * parts).collect())
}

/// Root mean square residual of the accelerations of each coordinate beyond their expected error, over their size: 0 where only noise
/// remains, 1 for a model that explains nothing. `None` where the model is not finite.
///
/// This is also the test of whether the residuals are noise. Their autocorrelation shows nothing, because smoothing correlates the errors
/// within a window even for the true model; the jackknife allows for that.
pub fn misfit(model: &dyn EulerLagrange<f64>, observed: &Observed) -> Option<Vec<f64>> {
    let data = Data::new(model, observed)?;
    // A model that fails on states does not explain them.
    let failed = observed.q.len() > data.q.len() * 10 / 9;
    (!failed).then(|| data.misfit())
}

/// A number of the model and its change by every change.
#[derive(Clone, Debug)]
struct LinearQuantity {
    value: f64,
    slopes: Vec<f64>,
}

impl LinearQuantity {
    fn zero(changes: usize) -> Self {
        Self { value: 0.0, slopes: vec![0.0; changes] }
    }
    fn add(&mut self, value: f64, slopes: &[f64], factor: f64) {
        self.value += factor * value;
        self.slopes.iter_mut().zip(slopes).for_each(|(sum, s)| *sum += factor * s);
    }
    /// The number over another one, to first order.
    fn over(&self, unit: Option<&Self>) -> Self {
        let Some(unit) = unit else { return self.clone() };
        let value = self.value / unit.value;
        let slopes = self.slopes.iter().zip(&unit.slopes).map(|(s, u)| (s - value * u) / unit.value).collect();
        Self { value, slopes }
    }
}

/// Quantities of the model whose ranges are sought.
struct Quantities {
    mass: Vec<LinearQuantity>,
    friction: Vec<LinearQuantity>,
    energy: Vec<LinearQuantity>,
}

impl Quantities {
    fn new(model: &dyn EulerLagrange<f64>, changes: &Changes, (q, v): (&[f64], &[f64])) -> Option<Self> {
        let (n, count) = (model.coordinates(), changes.len());
        let request = Request::MASS_MATRIX | Request::ENERGY | Request::FORCE;
        let mut terms = Terms::default();
        let mut row = Row::default();
        let mut quantities = Self {
            mass: vec![LinearQuantity::zero(count); n * (n + 1) / 2],
            friction: vec![LinearQuantity::zero(count); if model.conserves_energy() { 0 } else { n }],
            energy: Vec::new(),
        };
        let states = q.len() / n;
        let stride = states.div_ceil(ENERGY_STATES).max(1);
        let mut squares = vec![0.0; n];
        let none = vec![0.0; n];
        let mut used = 0.0;
        for (k, (q, v)) in q.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            if model.terms(q, v, request, &mut terms).is_err() || terms.mass_matrix.iter().any(|m| !m.is_finite()) {
                continue;
            }
            used += 1.0;
            changes.evaluate(q, v, &none, &mut row);
            let pairs = (0..n).flat_map(|i| (i..n).map(move |j| i * n + j));
            for (sum, at) in quantities.mass.iter_mut().zip(pairs) {
                sum.add(terms.mass_matrix[at], &row.mass[at * count..(at + 1) * count], 1.0);
            }
            for (i, sum) in quantities.friction.iter_mut().enumerate() {
                let force = terms.force.get(i).map_or(0.0, |force| -force);
                sum.add(force, &row.friction[i * count..(i + 1) * count], v[i]);
            }
            squares.iter_mut().zip(v).for_each(|(sum, v)| *sum += v * v);
            if k % stride == 0 {
                quantities.energy.push(LinearQuantity { value: terms.energy[0], slopes: row.energy.clone() });
            }
        }
        let scale = |linear: &mut LinearQuantity, by: f64| {
            linear.value *= by;
            linear.slopes.iter_mut().for_each(|s| *s *= by);
        };
        quantities.mass.iter_mut().for_each(|mass| scale(mass, 1.0 / used));
        quantities.friction.iter_mut().zip(&squares).for_each(|(friction, square)| scale(friction, 1.0 / square));
        (used > 0.0 && !quantities.energy.is_empty()).then_some(quantities)
    }

    /// Energy about its mean, root mean square, and its error.
    fn energy(&self, posterior: &Posterior, unit: Option<&LinearQuantity>) -> Estimate {
        let mean = self.mean_energy();
        let (mut value, mut square) = (0.0, 0.0);
        for energy in &self.energy {
            let mut about = energy.clone();
            about.add(mean.value, &mean.slopes, -1.0);
            let about = about.over(unit);
            value += about.value * about.value;
            square += posterior.square(&about.slopes);
        }
        let states = self.energy.len() as f64;
        let value = (value / states).sqrt();
        let floor = value * posterior.floor.iter().fold(0.0, |most: f64, x| most.max(*x));
        let half = RANGE * (square / states).sqrt().hypot(floor);
        Estimate { value, low: value - half, high: value + half }
    }

    fn mean_energy(&self) -> LinearQuantity {
        let mut mean = LinearQuantity::zero(self.energy[0].slopes.len());
        self.energy.iter().for_each(|e| mean.add(e.value, &e.slopes, 1.0 / self.energy.len() as f64));
        mean
    }
}

/// Least and largest value of every coordinate.
fn ranges(n: usize, q: &[f64]) -> Vec<[f64; 2]> {
    let range = |i: usize| {
        let values = q.iter().skip(i).step_by(n);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &x| [low.min(x), high.max(x)])
    };
    (0..n).map(range).collect()
}

#[cfg(test)]
mod tests {
    //! Ranges of small systems that are written down, without a training.

    use super::{Observed, determination, misfit};
    use crate::lagrangian::{EulerLagrange, Lagrangian, Mechanics, Request, Terms};
    use crate::random::RngStream;
    use crate::scalar::Real;
    use rand::Rng;
    use rand_distr::StandardNormal;

    /// A pendulum whose bob is `p` times as heavy as in the exact one.
    struct Pendulum;

    impl Lagrangian for Pendulum {
        fn coordinates(&self) -> usize {
            1
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            p[0] * (R::half() * v[0].sqr() + R::of(9.81) * q[0].cos())
        }
    }

    fn pendulum(mass: f64) -> Mechanics<Pendulum, f64> {
        Mechanics::new(Pendulum, vec![mass])
    }

    /// States of the true pendulum under a known force that drifts, with an error of the accelerations of `noise`.
    fn driven(noise: f64, seed: u64) -> Observed {
        let mut rng = RngStream::Test.generator(seed);
        let mut observed = Observed { error: vec![noise], independent: vec![1000.0], ..Observed::default() };
        for _ in 0..1000 {
            let [q, v, force] = [3.0, 4.0, 5.0].map(|size: f64| rng.random_range(-size..size));
            observed.q.push(q);
            observed.v.push(v);
            observed.force.push(force);
            observed.a.push(force - 9.81 * f64::sin(q) + noise * rng.sample::<f64, _>(StandardNormal));
        }
        observed
    }

    #[test]
    fn a_mass_that_is_a_little_off_is_held_by_its_range() {
        let (mut inside, mut widest) = (0, 0.0_f64);
        for seed in 0..40 {
            let found = determination(&pendulum(1.02), &[true], &driven(0.5, seed)).unwrap();
            let mass = found.mass_matrix[0];
            assert!(found.absolute && (mass.value - 1.02).abs() < 1e-12, "{mass:?}");
            inside += usize::from(mass.allows(1.0));
            widest = widest.max(mass.high - mass.low);
        }
        assert!(inside >= 34 && widest < 0.15, "{inside} {widest}");
    }

    /// Motion in a plane about a centre, and a pull `p` along one direction.
    struct Orbit;

    impl Lagrangian for Orbit {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            R::half() * (v[0].sqr() + (q[0] * v[1]).sqr()) + R::one() / q[0] + p[0] * q[0] * q[1].cos()
        }
    }

    #[test]
    fn mass_along_a_conserved_momentum_is_left_open() {
        // Without a pull, and without a known torque, the momentum of the angle is conserved.
        for (pull, torque) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
            let model = Mechanics::new(Orbit, vec![pull]);
            let mut rng = RngStream::Test.generator(3);
            let (error, independent) = (vec![0.01; 2], vec![1000.0; 2]);
            let (mut observed, mut terms) = (Observed { error, independent, ..Observed::default() }, Terms::default());
            for _ in 0..1000 {
                let [r, angle, out, around] =
                    [[0.6, 1.4], [-3.0, 3.0], [-0.3, 0.3], [0.8, 1.2]].map(|[a, b]: [f64; 2]| rng.random_range(a..b));
                model.terms(&[r, angle], &[out, around], Request::ACCELERATION, &mut terms).unwrap();
                let known = torque * rng.random_range(-1.0..1.0);
                let exact = [terms.acceleration[0], terms.acceleration[1] + known / (r * r)];
                observed.q.extend([r, angle]);
                observed.v.extend([out, around]);
                observed.a.extend(exact.map(|a| a + 0.01 * rng.sample::<f64, _>(StandardNormal)));
                if torque > 0.0 {
                    observed.force.extend([0.0, known]);
                }
            }
            let mass = determination(&model, &[false, true], &observed).unwrap().mass_matrix;
            let open = pull == 0.0 && torque == 0.0;
            assert!(mass[2].is_open() == open && !mass[0].is_open() && !mass[1].is_open(), "{pull} {torque}: {mass:?}");
        }
    }

    #[test]
    fn a_range_widens_with_what_is_not_explained() {
        let observed = driven(0.1, 0);
        let width = |observed: &Observed| {
            let mass = determination(&pendulum(1.0), &[true], observed).unwrap().mass_matrix[0];
            mass.high - mass.low
        };
        // A force that was not recorded.
        let mut disturbed = observed.clone();
        disturbed.a.iter_mut().enumerate().for_each(|(k, a)| *a += 3.0 * (0.7 * k as f64).sin());
        let [before, after] = [&observed, &disturbed].map(width);
        assert!(after > 5.0 * before, "{before} {after}");
        let missed = [&observed, &disturbed].map(|observed| misfit(&pendulum(1.0), observed).unwrap()[0]);
        assert!(missed[0] < 0.05 && missed[1] > 0.2, "{missed:?}");
    }
}

//! Cases 29 to 31: energy, gauge and charts.

use super::objective::{architecture, weights};
use super::record::Row;
use crate::common::accuracy::{cast, configure, input_conditions, largest, outputs, random_state, recast};
use crate::common::matrices::dd;
use lnn::forward::HyperDual;
use lnn::lagrangian::systems::{DoublePendulum, HenonHeiles, Kepler, SpringPendulum, TriplePendulum};
use lnn::lagrangian::{self, EulerLagrange, Lagrangian, Mechanics, Request, Terms};
use lnn::linalg::{self, Workspace};
use lnn::network::{ActivationChoice, NetworkLagrangian};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn terms<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Terms<S> {
    let mut terms = Terms::default();
    model.terms(q, v, Request::ALL, &mut terms).unwrap();
    terms
}

fn condition<S: Scalar>(n: usize, m: &[S]) -> f64 {
    linalg::condition_number(n, &cast::<S, Dd>(m), &mut Workspace::new()).unwrap()
}

fn big<S: Scalar>(x: &[S]) -> f64 {
    largest(&cast::<S, Dd>(x))
}

/// Rate of change of an output along `(v, a)`, by differences of fourth order in double-double.
fn rate(model: &dyn EulerLagrange<Dd>, q: &[Dd], v: &[Dd], a: &[Dd], of: fn(&Terms<Dd>) -> Dd) -> f64 {
    let h = 2f64.powi(-24) / (1.0 + largest(v) + largest(a));
    let at = |steps: f64| {
        let moved =
            |x: &[Dd], d: &[Dd]| -> Vec<Dd> { x.iter().zip(d).map(|(&x, &d)| x + Dd::of_f64(steps * h) * d).collect() };
        of(&terms(model, &moved(q, v), &moved(v, a)))
    };
    let difference = Dd::of_f64(8.0) * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0));
    (difference / Dd::of_f64(12.0 * h)).to_f64()
}

/// `|dE/dx . (v, a)|` in units of `eps kappa (|p a| + |g v| + |E|)`, the acceleration that of the precision at hand.
fn energy_error<S: Scalar>(
    (model, judge): (&dyn EulerLagrange<S>, &dyn EulerLagrange<Dd>),
    q: &[S],
    v: &[S],
    of: fn(&Terms<Dd>) -> Dd,
) -> f64 {
    let found = terms(model, q, v);
    let (q, v, a): (Vec<Dd>, Vec<Dd>, Vec<Dd>) = (cast(q), cast(v), cast(&found.acceleration));
    let exact = terms(judge, &q, &v);
    let dot = |x: &[Dd], y: &[Dd]| x.iter().zip(y).map(|(&x, &y)| (x * y).to_f64().abs()).sum::<f64>();
    let scale = dot(&exact.momentum, &a) + dot(&exact.dl_dq, &v) + exact.energy[0].to_f64().abs();
    let kappa = condition(q.len(), &exact.mass_matrix);
    rate(judge, &q, &v, &a, of).abs() / (S::epsilon().to_f64() * kappa * scale)
}

fn energy_is_kept<S: Scalar>() {
    let mut rng = ChaCha8Rng::seed_from_u64(29);
    let mut random = Row::new::<S>(29, "grad E . (v, a) = 0: random networks");
    for n in 1..=6 {
        for activation in ActivationChoice::ALL {
            for (alpha, seed) in [(1.0, 1), (0.0, 2), (-0.3, 3)] {
                let shape = architecture(n, &[12, 12], activation, alpha);
                let network = NetworkLagrangian::new(shape.clone(), weights::<S>(&shape, seed)).unwrap();
                let judge = network.cast::<Dd>();
                for _ in 0..3 {
                    let mut draw =
                        |size: f64| -> Vec<S> { (0..n).map(|_| S::of_f64(rng.random_range(-size..size))).collect() };
                    let (q, v) = (draw(3.0), draw(2.0));
                    let r = energy_error((&network, &judge), &q, &v, |terms| terms.energy[0]);
                    random.see(r, || format!("n = {n}, {activation}, alpha = {alpha}"));
                }
            }
        }
    }
    random.end();
    let mut known = Row::new::<S>(29, "grad E . (v, a) = 0: every system");
    let mut geodesic = Row::new::<S>(31, "grad L . (v, a) = 0: geodesics");
    for system in lagrangian::System::unconstrained() {
        let configured = configure::<S>(&system.name, &[]);
        let (model, judge) = (configured.build().unwrap(), recast::<S, Dd>(&configured).build().unwrap());
        for _ in 0..20 {
            let (q, v) = random_state(&configured, &system.validation(configured.coordinates), &mut rng);
            let r = energy_error((&*model, &*judge), &q, &v, |terms| terms.energy[0]);
            known.see(r, || system.name.to_string());
            if system.name.contains("geodesic") {
                let r = energy_error((&*model, &*judge), &q, &v, |terms| terms.lagrangian[0]);
                geodesic.see(r, || system.name.to_string());
            }
        }
    }
    known.end();
    geodesic.end();
}

#[test]
fn case_29_31_energy_and_geodesics() {
    energy_is_kept::<f32>();
    energy_is_kept::<f64>();
}

/// `s L + d/dt sin(w.q)`.
struct Gauged<L> {
    system: L,
    factor: f64,
    wave: Vec<f64>,
}

impl<L: Lagrangian> Lagrangian for Gauged<L> {
    fn coordinates(&self) -> usize {
        self.system.coordinates()
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let along = |x: &[R]| x.iter().zip(&self.wave).fold(R::zero(), |s, (&x, &w)| s + R::of(w) * x);
        R::of(self.factor) * self.system.lagrangian(parameters, q, v) + along(q).cos() * along(v)
    }
}

fn gauge_changes_nothing<S: Scalar, L: Lagrangian + Copy>(name: &'static str, system: L, row: &mut Row) {
    let mut rng = ChaCha8Rng::seed_from_u64(30);
    let configured = configure::<S>(name, &[]);
    let n = configured.coordinates;
    let plain = Mechanics::new(system, configured.parameters.clone());
    for _ in 0..50 {
        // The same numbers in every precision.
        let mut single = || f64::from(rng.random_range(-1.0_f32..1.0));
        let wave = (0..n).map(|_| single()).collect();
        let factor = 10f64.powf(single()) as f32;
        let gauged = Gauged { system, factor: f64::from(factor), wave };
        let gauged = Mechanics::new(gauged, configured.parameters.clone());
        let (q, v) = random_state(&configured, &configured.system.validation(n), &mut rng);
        let (a, b) = (terms(&plain, &q, &v), terms(&gauged, &q, &v));
        // Terms that nearly cancel in g - c cost their size times |M^-1|.
        let unit = |t: &Terms<S>| {
            let kappa = condition(n, &t.mass_matrix);
            kappa * (big(&t.acceleration) + (big(&t.dl_dq) + big(&t.coriolis)) / big(&t.mass_matrix))
        };
        let unit = S::epsilon().to_f64() * (unit(&a) + unit(&b));
        for (&x, &y) in a.acceleration.iter().zip(&b.acceleration) {
            row.see((dd(x) - dd(y)).to_f64().abs() / unit, || format!("{name}, factor {factor}"));
        }
        assert!((dd(a.momentum[0]) - dd(b.momentum[0])).to_f64() != 0.0, "p does change");
    }
}

fn gauge<S: Scalar>() {
    let mut row = Row::new::<S>(30, "a of s L + dF/dt, unit eps kappa terms");
    gauge_changes_nothing::<S, _>("double-pendulum", DoublePendulum, &mut row);
    gauge_changes_nothing::<S, _>("triple-pendulum", TriplePendulum, &mut row);
    gauge_changes_nothing::<S, _>("spring-pendulum", SpringPendulum, &mut row);
    gauge_changes_nothing::<S, _>("henon-heiles", HenonHeiles, &mut row);
    gauge_changes_nothing::<S, _>("kepler", Kepler, &mut row);
    row.end();
}

#[test]
fn case_30_gauge_and_scale() {
    gauge::<f32>();
    gauge::<f64>();
}

/// Uniform motion on a great circle inclined by `i`: `x = (cos s, cos i sin s, sin i sin s)`, `s = s0 + w t`.
fn great_circle<S: Scalar>() {
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let mut row = Row::new::<S>(31, "great circles on the sphere, unit eps (condition + |a|)");
    let system = configure::<S>("sphere-geodesic", &[]);
    let wide = recast::<S, Dd>(&system);
    let (model, judge) = (system.build().unwrap(), wide.build().unwrap());
    for k in 0..300 {
        // Inclinations up to 2^-9 from the poles.
        let inclination = std::f64::consts::FRAC_PI_2 - 2f64.powi(-(k % 10)) * rng.random_range(0.3..1.0);
        let (start, speed) = (rng.random_range(-3.0..3.0), rng.random_range(-4.0..4.0));
        let zero = <Dd as Real>::zero();
        let s = HyperDual::new(Dd::of_f64(start), Dd::of_f64(speed), Dd::of_f64(speed), zero);
        let (sin, cos) = HyperDual::lift(Dd::of_f64(inclination)).sin_cos();
        let (x, y, z) = (s.cos(), cos * s.sin(), sin * s.sin());
        let angles = [(x.sqr() + y.sqr()).sqrt().atan2(z), y.atan2(x)];
        let [q, v, a] = [0, 1, 2].map(|order| angles.map(|angle| [angle.value, angle.s, angle.st][order]));
        let base = outputs(&*judge, &q, &v);
        let at = base.iter().position(|(name, _)| *name == "acceleration").unwrap();
        let conditions = &input_conditions(&wide, &q, &v, &base)[at];
        // Rounded to the precision at hand, the state is on a neighbouring circle: that is what the condition is for.
        let found = terms(&*model, &cast::<Dd, S>(&q), &cast::<Dd, S>(&v));
        let kappa = condition(2, &found.mass_matrix);
        for i in 0..2 {
            let unit = S::epsilon().to_f64() * (conditions[i] + kappa * a[i].to_f64().abs());
            let error = (dd(found.acceleration[i]) - a[i]).to_f64().abs();
            row.see(error / unit.max(f64::MIN_POSITIVE), || format!("inclination {inclination}, s = {start}"));
            assert!((base[at].1[i] - a[i]).to_f64().abs() <= 1e-28 * (conditions[i] + kappa * largest(&a)));
        }
    }
    row.end();
}

#[test]
fn case_31_great_circles() {
    great_circle::<f32>();
    great_circle::<f64>();
}

//! Ranges of small systems that are written down, without a training.

use super::{Observed, determination, misfit};
use crate::lagrangian::{EulerLagrange, Lagrangian, Mechanics, Request, Terms};
use crate::random::RngStream;
use crate::scalar::Real;
use rand::Rng;
use rand_distr::StandardNormal;

/// A pendulum whose bob is `p` times as heavy as it is.
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

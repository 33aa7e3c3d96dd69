//! Motions under forces from outside, against closed forms and against Lagrangians that hold the same force.

use crate::common::damped;
use lnn::lagrangian::systems::DoublePendulum;
use lnn::lagrangian::systems::HarmonicOscillator;
use lnn::lagrangian::{EulerLagrange, ForceParts, InverseDynamics, Lagrangian, Mechanics, Request, Terms};
use lnn::rollout::{
    Between, Driven, Force, Integrable, Integrator, Rollout, RolloutError, RolloutOptions, SampledForce, Start,
    rollout, rollout_each,
};
use lnn::scalar::{Dd, Real, Scalar};
use std::ops::ControlFlow;

/// A free mass of 1 kg.
struct Mass;
impl Lagrangian for Mass {
    fn coordinates(&self) -> usize {
        1
    }
    fn lagrangian<R: Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
        R::half() * v[0].sqr()
    }
}

fn mass<S: Scalar>() -> Mechanics<Mass, S> {
    Mechanics::new(Mass, Vec::new())
}

/// `q'' = -q`.
fn oscillator<S: Scalar>() -> Mechanics<HarmonicOscillator, S> {
    Mechanics::new(HarmonicOscillator, vec![S::of_f64(1.0); 2])
}

/// Two rods of 1 m and 1 kg.
fn pendulum<S: Scalar>(gravity: f64) -> Mechanics<DoublePendulum, S> {
    Mechanics::new(DoublePendulum, [1.0, 1.0, 1.0, 1.0, gravity].map(S::of_f64).to_vec())
}

/// Their weight as torques.
fn weight<S: Scalar>(_: S, q: &[S], _: &[S], force: &mut [S]) {
    force[0] = S::of_f64(-2.0 * 9.81) * q[0].sin();
    force[1] = S::of_f64(-9.81) * q[1].sin();
}

fn options<S: Scalar>(method: Integrator, t_end: f64, step: f64) -> RolloutOptions<S> {
    let tolerance = S::max(S::of_f64(1e-11), S::epsilon().ldexp(4));
    let base = RolloutOptions::new(S::of_f64(t_end), S::of_f64(0.1));
    base.method(method).tolerances(tolerance, tolerance).step(S::of_f64(step))
}

/// What a step of 1/128 leaves of the error of a smooth motion over a few seconds.
fn bound(method: Integrator) -> f64 {
    match method {
        Integrator::Dopri5 | Integrator::Dop853 => 1e-8,
        Integrator::Midpoint | Integrator::Variational => 2e-3,
        Integrator::Gauss4 => 1e-7,
        Integrator::Gauss6 => 1e-10,
        method => panic!("no bound is known for {method:?}"),
    }
}

const STEP: f64 = 0.0078125;

fn end<S: Scalar>(rolled: &Rollout<S>) -> [f64; 2] {
    assert_eq!(rolled.stop, None);
    let (q, v) = rolled.trajectory.state(rolled.trajectory.len() - 1);
    [q[0].to_f64(), v[0].to_f64()]
}

/// `q'' = -q + cos(w t)` from rest: `(cos w t - cos t) / (1 - w^2)`.
#[test]
fn a_force_in_time_by_every_method_and_in_both_directions() {
    let (w, model) = (2.5_f64, oscillator::<f64>());
    let push = |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = (2.5 * t).cos();
    let exact = |t: f64| {
        let factor = 1.0 / (1.0 - w * w);
        [factor * ((w * t).cos() - t.cos()), factor * (t.sin() - w * (w * t).sin())]
    };
    let driven = Driven::new(&model, &push);
    for method in Integrator::ALL {
        for (t0, t_end) in [(0.0, 6.05), (1.5, -2.0)] {
            let start = exact(t0);
            let options = options(method, t_end, STEP).t0(t0);
            let rolled = driven.rollout(&start[..1], &start[1..], &options);
            assert_eq!((rolled.stop.clone(), *rolled.trajectory.t.last().unwrap()), (None, t_end));
            let errors = (0..rolled.trajectory.len()).map(|k| {
                let ((q, v), [q_exact, v_exact]) = (rolled.trajectory.state(k), exact(rolled.trajectory.t[k]));
                (q[0] - q_exact).abs().max((v[0] - v_exact).abs())
            });
            let worst = errors.fold(0.0, f64::max);
            assert!(worst < bound(method), "{method:?} {t0}: {worst:e}");
        }
    }
    // What a solver of one's own is given.
    let a = driven.acceleration(0.2, &[0.3], &[7.0]).unwrap();
    assert!((a[0] - (0.5_f64.cos() - 0.3)).abs() < 1e-15);
}

/// The weight of a double pendulum as a force on one without, in every precision.
#[test]
fn a_force_of_the_state_is_the_same_as_in_the_lagrangian() {
    fn check<S: Integrable>(bound: impl Fn(Integrator) -> f64) {
        let (heavy, light) = (pendulum::<S>(9.81), pendulum::<S>(0.0));
        let (q, v) = ([0.7, -0.4].map(S::of_f64), [0.5, 1.0].map(S::of_f64));
        for method in Integrator::ALL {
            let by_lagrangian = rollout(&heavy, &q, &v, &options(method, 1.0, STEP));
            let by_force = Driven::new(&light, &weight::<S>).rollout(&q, &v, &options(method, 1.0, STEP));
            let (a, b) = (end(&by_lagrangian), end(&by_force));
            let worst = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
            assert!(worst < bound(method), "{} {method:?}: {worst:e}", S::NAME);
        }
    }
    // The Gauss methods make the same steps, the others those of the same tolerance.
    check::<f64>(
        |method| if method == Integrator::Variational || method == Integrator::Midpoint { 1e-11 } else { 1e-9 },
    );
    check::<f32>(|_| 1e-4);
    let (heavy, light) = (pendulum::<Dd>(9.81), pendulum::<Dd>(0.0));
    let (q, v) = ([0.7, -0.4].map(Dd::of_f64), [0.5, 1.0].map(Dd::of_f64));
    let (options, gravity) = (options::<Dd>(Integrator::Gauss6, 0.2, 0.02), weight::<Dd>);
    let by_force = Driven::new(&light, &gravity).rollout_fixed(&q, &v, &options).complete().unwrap();
    let by_lagrangian = lnn::rollout::rollout_fixed(&heavy, &q, &v, &options).complete().unwrap();
    let differences = by_force.q.iter().zip(&by_lagrangian.q).map(|(&a, &b)| (a - b).abs().to_f64());
    assert!(differences.fold(0.0, f64::max) < 1e-22);
}

/// `q'' = -q - 0.4 q'`: the iteration matrix must know how the force depends on the velocity.
#[test]
fn a_brake_is_a_damped_oscillator() {
    let model = oscillator::<f64>();
    let brake = |_: f64, _: &[f64], v: &[f64], force: &mut [f64]| force[0] = -0.4 * v[0];
    for method in Integrator::ALL {
        let [q, _] = end(&Driven::new(&model, &brake).rollout(&[1.0], &[0.0], &options(method, 5.0, STEP)));
        let w = 0.96_f64.sqrt();
        let exact = (-1.0_f64).exp() * ((5.0 * w).cos() + 0.2 / w * (5.0 * w).sin());
        assert!((q - exact).abs() < bound(method), "{method:?}: {:e}", q - exact);
    }
}

/// A force that is switched, between the samples: with its breaks known it is integrated exactly, forwards and backwards.
#[test]
fn jumps_and_kinks_cost_nothing_where_they_are_known() {
    struct Switched(Vec<f64>);
    impl Force<f64> for Switched {
        fn force(&self, t: f64, _: &[f64], _: &[f64], force: &mut [f64]) {
            force[0] = if t < 0.333 { 2.0 } else { -1.0 };
        }
        fn breaks(&self) -> &[f64] {
            &self.0
        }
    }
    let model = mass::<f64>();
    let (known, unknown) = (Switched(vec![0.333]), Switched(Vec::new()));
    // At 0.333 it is at 0.333^2 with 0.666 m/s; 0.667 s follow.
    let exact = [0.333 * 0.333 + 0.666 * 0.667 - 0.5 * 0.667 * 0.667, 0.666 - 0.667];
    for method in Integrator::ALL {
        let options = options(method, 1.0, 0.25).dt(0.25);
        let there = end(&Driven::new(&model, &known).rollout(&[0.0], &[0.0], &options));
        assert!((there[0] - exact[0]).abs() < 1e-13 && (there[1] - exact[1]).abs() < 1e-13, "{method:?}: {there:?}");
        let back = options.clone().t0(1.0).t_end(0.0);
        let back = end(&Driven::new(&model, &known).rollout(&exact[..1], &exact[1..], &back));
        assert!(back[0].abs() < 1e-13 && back[1].abs() < 1e-13, "{method:?}: {back:?}");
        if method.is_structure_preserving() {
            let missed = end(&Driven::new(&model, &unknown).rollout(&[0.0], &[0.0], &options));
            assert!((missed[1] - exact[1]).abs() > 1e-3, "{method:?}: {missed:?}");
        }
    }
    // Linear between samples: cubic motion, exact by methods of order 4 and more at any step.
    let ramp = SampledForce::new(1, vec![0.0, 0.3, 0.7, 1.0], vec![0.0, 3.0, -1.0, 0.5]).unwrap();
    // Velocities are areas of trapezia.
    let velocity = 0.5 * 0.3 * 3.0 + 0.5 * 0.4 * 2.0 + 0.5 * 0.3 * -0.5;
    for method in Integrator::ALL {
        let options = options(method, 1.0, 0.5).dt(0.5);
        let [_, v] = end(&Driven::new(&model, &ramp).rollout(&[0.0], &[0.0], &options));
        assert!((v - velocity).abs() < 1e-13, "{method:?}: {v} {velocity}");
    }
}

#[test]
fn work_and_friction_make_the_change_of_energy() {
    let chain = damped::chain(2);
    let motor = |t: f64, q: &[f64], v: &[f64], force: &mut [f64]| {
        force[0] = 4.0 * (3.0 * t).sin() - q[0];
        force[1] = 1.0 - 0.2 * v[1];
    };
    let driven = Driven::new(&chain, &motor);
    for (t0, t_end) in [(0.0, 2.0), (2.0, 1.0)] {
        // Dry friction is felt within percentage of a second.
        let options = RolloutOptions::reference(t_end, 0.002).t0(t0);
        let motion = driven.rollout(&[0.4, -0.2], &[1.0, 0.5], &options).complete().unwrap();
        let balance = driven.energy_balance(&motion).unwrap();
        assert!(balance.work.abs() > 0.1 && balance.dissipated.abs() > 0.1, "{balance:?}");
        assert!(balance.defect().abs() < 1e-7 * balance.size, "{balance:?}");
        // Without the force it is not accounted for.
        let forgotten = motion.energy_balance(&chain).unwrap();
        assert!(forgotten.work == 0.0 && (forgotten.defect() - balance.work).abs() < 1e-7 * balance.size);
    }
    // Force times way, over a jump of the force at a sample and one between samples.
    let model = mass::<f64>();
    struct Steps;
    impl Force<f64> for Steps {
        fn force(&self, t: f64, _: &[f64], _: &[f64], force: &mut [f64]) {
            force[0] = if t < 0.5 { 1.0 } else { 3.0 };
        }
        fn breaks(&self) -> &[f64] {
            &[0.5]
        }
    }
    let driven = Driven::new(&model, &Steps);
    let motion = driven.rollout(&[0.0], &[0.0], &options(Integrator::Gauss4, 1.0, 0.1)).complete().unwrap();
    let balance = driven.energy_balance(&motion).unwrap();
    assert!((balance.change - 0.5 * 4.0).abs() < 1e-13 && balance.dissipated == 0.0, "{balance:?}");
    assert!(balance.defect().abs() < 0.02, "{balance:?}");
    let broken = |_: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = f64::NAN;
    assert!(Driven::new(&model, &broken).energy_balance(&motion).is_err());
}

/// Every start has its own force, alone and in groups.
#[test]
fn ensembles_take_a_force_each() {
    let model = pendulum::<f64>(9.81);
    let forces: Vec<SampledForce<f64>> =
        (0..11).map(|k| SampledForce::constant(vec![0.5 * f64::from(k), -1.0]).unwrap()).collect();
    let (q, v) = ([0.2, 0.1], [0.0, 0.3]);
    let start = |k: usize| Start { q: &q, v: &v, force: (k > 0).then(|| &forces[k] as &dyn Force<f64>) };
    let starts: Vec<Start<'_, f64>> = (0..11).map(start).collect();
    let options = RolloutOptions::new(1.0, 0.1);
    struct Wide(Mechanics<DoublePendulum, f64>);
    impl EulerLagrange<f64> for Wide {
        fn coordinates(&self) -> usize {
            2
        }
        fn terms(
            &self,
            q: &[f64],
            v: &[f64],
            request: Request,
            terms: &mut Terms<f64>,
        ) -> Result<(), lnn::lagrangian::MechanicsError> {
            self.0.terms(q, v, request, terms)
        }
        fn prefers_batches(&self) -> bool {
            true
        }
    }
    let alone = rollout_each(&model, &starts, &options, 2);
    let together = rollout_each(&Wide(pendulum(9.81)), &starts, &options, 2);
    for (k, (a, b)) in alone.iter().zip(&together).enumerate() {
        let single = match start(k).force {
            Some(force) => Driven::new(&model, force).rollout(&q, &v, &options),
            None => rollout(&model, &q, &v, &options),
        };
        assert_eq!(*a, single, "{k}");
        let difference = end(a)[0] - end(b)[0];
        assert!(difference.abs() < 1e-12, "{k}: {difference:e}");
    }
    assert!((end(&alone[1])[0] - end(&alone[10])[0]).abs() > 0.1);
}

#[test]
fn a_force_that_fails_is_named() {
    let model = mass::<f64>();
    let late = |t: f64, _: &[f64], _: &[f64], force: &mut [f64]| force[0] = if t < 0.55 { 1.0 } else { f64::NAN };
    for method in Integrator::ALL {
        let rolled = Driven::new(&model, &late).rollout(&[0.0], &[0.0], &options(method, 1.0, 0.05));
        let Some(RolloutError::NotFinite { t, what, .. }) = rolled.stop else { panic!("{method:?} {:?}", rolled.stop) };
        assert!(what == "external force" && (0.45..0.56).contains(&t), "{method:?}: {what} {t}");
        assert!(rolled.trajectory.len() >= 5 && rolled.trajectory.q.iter().all(|q| q.is_finite()));
    }
    let driven = Driven::new(&model, &late);
    let few = options(Integrator::Dopri5, 0.5, 0.05).max_steps(3);
    assert!(matches!(driven.rollout(&[0.0], &[0.0], &few).stop, Some(RolloutError::TooManySteps { steps: 3, .. })));
    assert!(driven.acceleration(0.6, &[0.0], &[0.0]).is_err());
}

fn terms_of(model: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> Terms<f64> {
    let mut terms = Terms::default();
    model.terms(q, v, Request::MASS_MATRIX, &mut terms).unwrap();
    terms
}

/// The inverse question gives back what drove.
#[test]
fn the_forces_of_a_motion_are_found_again() {
    let chain = damped::chain(2);
    let (q, v) = ([0.4, -0.2, 1.0, 2.0], [1.0, 0.5, -2.0, 0.3]);
    let torque = [2.0, -1.0, 0.25, 4.0];
    let steady = |row: usize| SampledForce::constant(torque[2 * row..2 * row + 2].to_vec()).unwrap();
    let a: Vec<f64> = (0..2)
        .flat_map(|row| {
            let (force, at) = (steady(row), 2 * row..2 * row + 2);
            Driven::new(&chain, &force).acceleration(0.0, &q[at.clone()], &v[at]).unwrap()
        })
        .collect();
    let found = InverseDynamics::of(&chain, &q, &v, &a).unwrap();
    for k in 0..4 {
        assert!((found.external[k] - torque[k]).abs() < 1e-12, "{found:?}");
        assert!((found.generalized[k] - found.friction[k] - torque[k]).abs() < 1e-12, "{found:?}");
    }
    assert!(found.friction.iter().all(|f| f.abs() > 1e-3));
    // Without friction all force comes from outside; a state moves freely under none.
    let free = pendulum::<f64>(9.81);
    let mut terms = Terms::default();
    free.terms(&q, &v, Request::ACCELERATION, &mut terms).unwrap();
    let found = InverseDynamics::of(&free, &q, &v, &terms.acceleration).unwrap();
    assert!(found.friction.is_empty() && found.generalized == found.external);
    assert!(found.external.iter().all(|f| f.abs() < 1e-12), "{found:?}");
    // Twice the speed at the same acceleration has four times the Coriolis force, and the same of the others.
    let twice: Vec<f64> = v.iter().map(|v| 2.0 * v).collect();
    let [slow, fast] = [&v[..], &twice].map(|v| ForceParts::of(&free, &q, v, &a).unwrap());
    let close = |x: f64, y: f64| (x - y).abs() < 1e-11;
    let found = InverseDynamics::of(&free, &q, &v, &a).unwrap().external;
    for k in 0..4 {
        assert!(close(fast.coriolis[k], 4.0 * slow.coriolis[k]) && slow.coriolis[k].abs() > 1e-3, "{slow:?} {fast:?}");
        assert!(close(fast.inertial[k], slow.inertial[k]) && close(fast.gravity[k], slow.gravity[k]));
        assert!(close(slow.inertial[k] + slow.coriolis[k] + slow.gravity[k], found[k]), "{slow:?} {found:?}");
        let mass = |j: usize| terms_of(&free, &q, &v).mass_matrix[k / 2 * 4 + k % 2 * 2 + j];
        assert!(close(slow.inertial[k], mass(0) * a[k / 2 * 2] + mass(1) * a[k / 2 * 2 + 1]));
    }
    assert!(slow.friction.is_empty() && ForceParts::of(&free, &q, &v, &a[..2]).is_err());
    assert!(InverseDynamics::of(&free, &q, &v, &a[..2]).is_err());
    assert!(InverseDynamics::of(&free, &q, &v, &[f64::NAN; 4]).is_err());
}

/// What an integrator says of the energy of its own motion does not depend on how often that is sampled.
#[test]
fn the_account_of_the_energy_is_integrated_beside_the_motion() {
    let chain = damped::chain(2);
    let motor = |t: f64, q: &[f64], v: &[f64], force: &mut [f64]| {
        force[0] = 4.0 * (9.0 * t).sin() - q[0];
        force[1] = 1.0 - 0.2 * v[1];
    };
    let driven = Driven::new(&chain, &motor);
    let account = |method: Integrator, t_end: f64, dt: f64| {
        let step = method.is_structure_preserving().then_some(0.005);
        let options = RolloutOptions::reference(t_end, dt).method(method).step(step).energy(true);
        let ending = driven.rollout_in_pieces(&[0.4, -0.2], &[1.0, 0.5], &options, &mut |_| ControlFlow::Continue(()));
        assert_eq!(ending.stop, None);
        ending.balance.unwrap()
    };
    for (method, close) in
        [(Integrator::Dopri5, 1e-7), (Integrator::Dop853, 1e-7), (Integrator::Gauss6, 1e-5), (Integrator::Gauss4, 1e-4)]
    {
        for (t_end, dt) in [(3.0, 0.01), (3.0, 3.0), (-2.0, 1.0)] {
            let balance = account(method, t_end, dt);
            assert!(balance.work.abs() > 0.05 && balance.dissipated.abs() > 0.05, "{method:?} {balance:?}");
            assert!(balance.defect().abs() < close * balance.size, "{method:?} {dt} {balance:?}");
        }
    }
}

/// The same samples of a smooth force, eight a period, joined in each way: only what was sampled decides how near the motion comes.
#[test]
fn forces_between_samples_are_as_they_are_said_to_be() {
    let model = mass::<f64>();
    let omega = std::f64::consts::TAU;
    let times: Vec<f64> = (0..=80).map(|k| 0.125 * f64::from(k)).collect();
    let values: Vec<f64> = times.iter().map(|t| (omega * t).cos()).collect();
    let sampled = SampledForce::new(1, times, values).unwrap();
    let options = RolloutOptions::reference(6.0, 0.05);
    // From 2 s on, away from the ends of the samples.
    let options = options.t0(2.0);
    let exact = |t: f64| (1.0 - (omega * (t - 2.0)).cos()) / omega.powi(2);
    let off = |between: Between| {
        let force = sampled.clone().between(between);
        let motion = Driven::new(&model, &force).rollout(&[0.0], &[0.0], &options).complete().unwrap();
        motion.t.iter().zip(&motion.q).map(|(t, x)| (x - exact(*t)).abs()).fold(0.0, f64::max) * omega.powi(2) / 2.0
    };
    let [held, linear, cubic, band] = Between::ALL.map(off);
    assert!(
        held > 0.2 && (0.02..0.1).contains(&linear) && cubic < 0.5 * linear && band < 0.02 && band < cubic,
        "{held} {linear} {cubic} {band}"
    );
}

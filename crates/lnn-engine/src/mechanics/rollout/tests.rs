//! Compares roll-outs with exact motions, and tests every kind of failure.

use super::models::{BROKEN, EXPLODING, FOUR, KEPLER, OSCILLATOR, PENDULUM, SINGULAR};
use super::*;
use crate::lagrangian::{EulerLagrange, SystemInstance};

const METHODS: [Integrator; 2] = [Integrator::Dopri5, Integrator::Dop853];

fn options(method: Integrator, t_end: f64, dt: f64, tolerance: f64) -> RolloutOptions<f64> {
    RolloutOptions { method, rtol: tolerance, atol: tolerance, ..RolloutOptions::new(t_end, dt) }
}

/// Largest error of the oscillator started at `(1, 0)`.
fn oscillator_error(trajectory: &Trajectory<f64>, t0: f64) -> f64 {
    let mut worst = 0.0_f64;
    for k in 0..trajectory.len() {
        let t = trajectory.t[k] - t0;
        let (q, v) = trajectory.state(k);
        worst = worst.max((q[0] - t.cos()).abs()).max((v[0] + t.sin()).abs());
    }
    worst
}

#[test]
fn exact_motion_at_exact_times_in_both_directions() {
    for method in METHODS {
        for (t0, t_end) in [(0.0, 10.0), (10.0, 0.0), (-1.0, 1.0), (1.0, -1.0), (-5.0, -1.0), (0.0, 0.37)] {
            let options = RolloutOptions { t0, ..options(method, t_end, 0.1, 1e-11) };
            let done = rollout(&OSCILLATOR, &[1.0], &[0.0], &options);
            assert_eq!(done.stop, None);
            let trajectory = &done.trajectory;
            let sign = if t_end < t0 { -1.0 } else { 1.0 };
            for (k, &t) in trajectory.t.iter().enumerate().take(trajectory.len() - 1) {
                assert_eq!(t, t0 + sign * 0.1 * k as f64);
            }
            assert_eq!(*trajectory.t.last().unwrap(), t_end);
            let error = oscillator_error(trajectory, t0);
            assert!(error < 1e-9, "{method:?} {t0} {t_end}: {error:e}");
        }
    }
}

#[test]
fn error_follows_tolerance() {
    for method in METHODS {
        let mut last = f64::INFINITY;
        for exponent in 3..=11 {
            let tolerance = 10.0_f64.powi(-exponent);
            let done = rollout(&OSCILLATOR, &[1.0], &[0.0], &options(method, 20.0, 0.05, tolerance));
            let error = oscillator_error(&done.trajectory, 0.0);
            // This includes interpolated samples.
            assert!(error < 100.0 * tolerance, "{method:?} {tolerance:e}: {error:e}");
            assert!(error < last, "{method:?} {tolerance:e}: {error:e} after {last:e}");
            last = error;
        }
        assert!(last < 1e-9);
    }
}

#[test]
fn sampling_does_not_change_the_steps() {
    for method in METHODS {
        let run = |dt| rollout(&PENDULUM, &[3.0], &[0.1], &options(method, 20.0, dt, 1e-9));
        let (coarse, fine) = (run(20.0), run(0.01));
        assert_eq!(coarse.statistics.accepted, fine.statistics.accepted);
        assert_eq!(coarse.statistics.rejected, fine.statistics.rejected);
        assert_eq!(coarse.trajectory.q.last(), fine.trajectory.q.last());
        let per_step = match method {
            Integrator::Dopri5 => 6,
            _ => 11,
        };
        let least = per_step * (coarse.statistics.accepted + coarse.statistics.rejected);
        assert!(coarse.statistics.evaluations >= least);
        assert!(coarse.statistics.evaluations <= least + coarse.statistics.accepted + 8);
    }
}

#[test]
fn energy_is_kept_and_angles_stay_continuous() {
    let done = rollout(&PENDULUM, &[0.0], &[3.0], &RolloutOptions::<f64>::reference(50.0, 0.1));
    let energy = done.trajectory.energy.as_ref().unwrap();
    let worst = energy.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-10, "{worst:e}");
    assert!(*done.trajectory.q.last().unwrap() > 100.0);
    assert!(done.trajectory.q.windows(2).all(|w| (w[1] - w[0]).abs() < 0.35));
}

#[test]
fn kepler_returns_after_ten_turns() {
    // The eccentricity is 0.5 and the motion starts at the pericentre; the period is 2 pi.
    let (q, v) = ([0.5, 0.0], [0.0, 3.0_f64.sqrt()]);
    let turn = 2.0 * std::f64::consts::PI;
    let done = rollout(&KEPLER, &q, &v, &RolloutOptions::<f64>::reference(10.0 * turn, turn)).complete().unwrap();
    assert_eq!(done.len(), 11);
    for k in 0..done.len() {
        let (qk, vk) = done.state(k);
        let error = (qk[0] - q[0]).abs() + (qk[1] - q[1]).abs() + (vk[0] - v[0]).abs() + (vk[1] - v[1]).abs();
        // An energy error of 5e-12 per turn is amplified by 3 pi / |E| into a delay and by |v| + |a| at the pericentre into an error 100
        // times as large, which grows with the square of the number of turns.
        assert!(error <= 5e-10 * (k * k) as f64, "turn {k}: {error:e}");
    }
}

#[test]
fn many_coordinates_and_single_precision() {
    let start = [1.0, 0.5, -0.5, 0.25];
    let done = rollout(&FOUR, &start, &[0.0; 4], &RolloutOptions::<f64>::reference(10.0, 0.5)).complete().unwrap();
    for k in 0..done.len() {
        for (i, start) in start.iter().enumerate() {
            let exact = start * (done.t[k] * (1.0 + i as f64).sqrt()).cos();
            assert!((done.state(k).0[i] - exact).abs() < 1e-10);
        }
    }
    for method in METHODS {
        let options = RolloutOptions::<f32> { method, ..RolloutOptions::new(10.0, 0.1) };
        let done = rollout(&OSCILLATOR, &[1.0_f32], &[0.0], &options);
        assert_eq!(done.stop, None);
        let error = oscillator_error(&done.trajectory.cast(), 0.0);
        assert!(error < 2e-5, "{method:?} {error:e}");
    }
}

/// Free fall from `q = 0` reaches -1 at `sqrt 2`.
fn check_valid_part(done: &Rollout<f64>, t: f64) {
    let fall = 2.0_f64.sqrt();
    assert!((t - fall).abs() < 1e-6 && t <= fall * (1.0 + 1e-12), "{t}");
    assert_eq!(done.trajectory.len(), 15);
    for k in 0..15 {
        let t = 0.1 * k as f64;
        assert_eq!(done.trajectory.t[k], t);
        assert!((done.trajectory.q[k] + 0.5 * t * t).abs() < 1e-9);
    }
}

#[test]
fn failures_are_typed_and_keep_the_valid_part() {
    for method in METHODS {
        let options = options(method, 5.0, 0.1, 1e-9);
        let done = rollout(&SINGULAR, &[0.0], &[0.0], &options);
        match &done.stop {
            Some(RolloutError::SingularMass { t, condition, state }) => {
                assert_eq!(*condition, 1e17);
                assert!((state[0] + 1.0).abs() < 1e-6);
                check_valid_part(&done, *t);
            }
            other => panic!("{other:?}"),
        }
        let done = rollout(&BROKEN, &[0.0], &[0.0], &options);
        match &done.stop {
            Some(RolloutError::NotFinite { t, what: "acceleration", .. }) => check_valid_part(&done, *t),
            other => panic!("{other:?}"),
        }
        let domain = Some(Domain::new(vec![Some((-1.0, 10.0)), None]));
        let done = rollout(&SINGULAR, &[0.0], &[0.0], &RolloutOptions { domain, ..options.clone() });
        match &done.stop {
            Some(RolloutError::LeftDomain { t, component: 0, value, lower, .. }) => {
                assert!(*value < *lower && *lower == -1.0);
                check_valid_part(&done, *t);
            }
            other => panic!("{other:?}"),
        }
        assert!(done.statistics.evaluations < 3000, "{:?}", done.statistics);
    }
}

#[test]
fn failures_in_single_precision_end_soon() {
    for method in METHODS {
        let options = RolloutOptions::<f32> { method, ..RolloutOptions::new(5.0, 0.1) };
        let done = rollout(&SINGULAR, &[0.0_f32], &[0.0], &options);
        assert!(matches!(done.stop, Some(RolloutError::SingularMass { .. })), "{:?}", done.stop);
        assert_eq!(done.trajectory.len(), 15);
        assert!(done.statistics.evaluations < 3000, "{:?}", done.statistics);
    }
}

#[test]
fn a_bound_that_only_trial_states_cross_is_no_failure() {
    // The oscillator stays within [-1, 1], but trial states of long steps do not.
    let domain = Some(Domain::new(vec![Some((-1.0 - 1e-6, 1.0 + 1e-6)), None]));
    for method in METHODS {
        let done = rollout(
            &OSCILLATOR,
            &[1.0],
            &[0.0],
            &RolloutOptions { domain: domain.clone(), ..options(method, 20.0, 0.1, 1e-9) },
        );
        assert_eq!(done.stop, None, "{method:?}");
        assert!(oscillator_error(&done.trajectory, 0.0) < 1e-6);
    }
}

#[test]
fn blow_up_underflows() {
    for method in METHODS {
        let done = rollout(&EXPLODING, &[1.0], &[1.0], &options(method, 2.0, 0.15, 1e-9));
        match done.stop {
            Some(RolloutError::StepUnderflow { t, .. } | RolloutError::NotFinite { t, .. }) => {
                assert!((t - 1.0).abs() < 1e-6, "{t}");
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(done.trajectory.len(), 7);
        assert!(done.trajectory.q.iter().all(|q| q.is_finite()));
    }
}

#[test]
fn too_many_steps_and_bad_starts() {
    let few = RolloutOptions { max_steps: 5, ..options(Integrator::Dopri5, 100.0, 0.1, 1e-10) };
    let done = rollout(&PENDULUM, &[1.0], &[0.0], &few);
    assert!(matches!(done.stop, Some(RolloutError::TooManySteps { steps: 5, t }) if t > 0.0 && t < 100.0));
    assert!(!done.trajectory.is_empty());

    let good = RolloutOptions::new(1.0, 0.1);
    for (q, v) in [(vec![1.0, 2.0], vec![0.0]), (vec![1.0], vec![]), (vec![f64::NAN], vec![0.0])] {
        let done = rollout(&PENDULUM, &q, &v, &good);
        assert!(matches!(done.stop, Some(RolloutError::Invalid { .. })));
        assert!(done.trajectory.is_empty());
    }
    let outside = RolloutOptions { domain: Some(Domain::new(vec![Some((0.0, 1.0)), None])), ..good.clone() };
    let done = rollout(&PENDULUM, &[2.0], &[0.0], &outside);
    assert!(matches!(done.stop, Some(RolloutError::LeftDomain { t: 0.0, value: 2.0, .. })));
    assert!(done.trajectory.is_empty());

    let still = rollout(&PENDULUM, &[1.0], &[0.5], &RolloutOptions::<f64>::new(0.0, 0.1)).complete().unwrap();
    assert_eq!((still.t, still.q, still.v), (vec![0.0], vec![1.0], vec![0.5]));
    let rest = rollout(&PENDULUM, &[0.0], &[0.0], &RolloutOptions::<f64>::new(10.0, 1.0)).complete().unwrap();
    assert!(rest.q.iter().all(|&q| q == 0.0) && rest.len() == 11);
}

#[test]
fn ensembles_do_not_depend_on_threads() {
    let starts: Vec<_> = (0..7).map(|k| (vec![0.3 * f64::from(k)], vec![0.1])).collect();
    let model: &dyn EulerLagrange<f64> = &PENDULUM;
    let one = rollout_many(model, &starts, &RolloutOptions::<f64>::new(5.0, 0.1), 1);
    let four = rollout_many(model, &starts, &RolloutOptions::<f64>::new(5.0, 0.1), 4);
    assert_eq!(one.len(), 7);
    assert_eq!(one, four);
    assert!(rollout_many(model, &[], &RolloutOptions::<f64>::new(5.0, 0.1), 3).is_empty());
}

const FIXED: [Integrator; 4] = [Integrator::Midpoint, Integrator::Gauss4, Integrator::Gauss6, Integrator::Variational];

/// Tests that a longest step above the sampling interval is reduced to that interval.
fn long_steps_are_cut<S: crate::scalar::Scalar>(model: &dyn EulerLagrange<S>) {
    let number = S::of_f64;
    for method in FIXED {
        for t_end in [0.3, -0.3] {
            let options = |step| RolloutOptions { method, step, ..RolloutOptions::new(number(t_end), number(0.1)) };
            let run = |step| rollout_fixed(model, &[number(1.0)], &[number(0.5)], &options(step)).complete().unwrap();
            let expected = run(None);
            assert!(expected.q.windows(2).all(|pair| pair[0] != pair[1]), "{method:?} does not move");
            for step in [0.11, 1e6, 1e14, 1e30] {
                assert_eq!(run(Some(number(step))), expected, "{method:?} {t_end} {step}");
            }
        }
    }
}

#[test]
fn steps_beyond_the_samples_are_cut_in_every_precision() {
    long_steps_are_cut(&*SystemInstance::<f32>::named("harmonic-oscillator", &[]).unwrap().build().unwrap());
    long_steps_are_cut(&*SystemInstance::<f64>::named("harmonic-oscillator", &[]).unwrap().build().unwrap());
    long_steps_are_cut(
        &*SystemInstance::<crate::scalar::Dd>::named("harmonic-oscillator", &[]).unwrap().build().unwrap(),
    );
}

#[test]
fn tolerances_that_cannot_be_kept_are_refused_with_the_least() {
    let system = SystemInstance::<f64>::named("harmonic-oscillator", &[]).unwrap().build().unwrap();
    let run = |method, rtol, atol| {
        let options = RolloutOptions { method, rtol, atol, ..RolloutOptions::new(1.0, 0.1) };
        rollout(&*system, &[1.0], &[2.0], &options)
    };
    for method in METHODS {
        let refusal = |rtol, atol| run(method, rtol, atol).stop.unwrap().to_string();
        assert_eq!(refusal(1e-30, 1e-30), "rtol: 1e-30 is finer than f64 can keep, the least is 2e-15");
        assert_eq!(refusal(1e-16, 1.0), "rtol: 1e-16 is finer than f64 can keep, the least is 2e-15");
        let alone = "atol: 1e-30 without rtol is finer than f64 can keep of a state of size 2, the least is 4e-15";
        assert_eq!(refusal(0.0, 1e-30), alone);
        // The smallest tolerance works, alone or together with the other.
        let least = RolloutOptions::<f64>::least_tolerance();
        for (rtol, atol) in [(least, least), (least, 0.0), (0.0, 2.0 * least)] {
            let done = run(method, rtol, atol);
            assert!(
                done.is_complete() && done.statistics.accepted < 100_000,
                "{method:?} {rtol} {atol}: {:?}",
                done.stop
            );
        }
        let single = RolloutOptions::<f32> { method, rtol: 1e-7, ..RolloutOptions::new(1.0, 0.1) };
        let refusal = rollout(&PENDULUM, &[1.0_f32], &[2.0], &single).stop.unwrap().to_string();
        assert!(refusal.ends_with("than f32 can keep, the least is 1e-6"), "{refusal}");
        // A coordinate that stays 0 has no error, whatever the absolute tolerance.
        let still = RolloutOptions { method, atol: 0.0, ..RolloutOptions::new(1.0, 0.1) };
        let done = rollout(&PENDULUM, &[0.0], &[0.0], &still);
        assert!(done.is_complete() && done.trajectory.q.iter().all(|q| *q == 0.0), "{:?}", done.stop);
    }
    for method in FIXED {
        assert!(run(method, 1e-30, 1e-30).is_complete(), "they mean nothing to {method:?}");
    }
}

//! Derivatives of a simulated double pendulum's positions, with noise, against its exact velocities and accelerations.

use lnn::lagrangian::{Request, SystemInstance, Terms};
use lnn::recording::{RecordedTrajectory, Recording, SmoothOptions, Smoothed, Smoothing};
use lnn::rollout::{RolloutOptions, rollout};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const SIGMA: f64 = 1e-3;

/// Noisy positions at 400 samples per second, and exact position, velocity and acceleration.
fn pendulum() -> (Recording, [Vec<f64>; 3]) {
    let model = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
    let motion =
        rollout(&*model, &[1.6, 0.4], &[0.0, 0.5], &RolloutOptions::reference(12.0, 0.0025)).complete().unwrap();
    let mut terms = Terms::default();
    model.terms(&motion.q, &motion.v, Request::ACCELERATION, &mut terms).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let noise = |x: &f64| x + SIGMA * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    let track = RecordedTrajectory {
        name: "double pendulum".into(),
        times: motion.t.clone(),
        q: motion.q.iter().map(noise).collect(),
        v: vec![],
        a: vec![],
        force: vec![],
    };
    let coordinates = vec!["theta1".into(), "theta2".into()];
    (Recording { coordinates, periodic: vec![true; 2], tracks: vec![track] }, [motion.q, motion.v, terms.acceleration])
}

/// Root mean square of `(found - exact) / unit` of coordinate `i` inside.
fn size(smoothed: &Smoothed, i: usize, error: impl Fn(usize) -> f64) -> f64 {
    let inside = smoothed.interior();
    (inside.clone().map(|k| error(2 * k + i).powi(2)).sum::<f64>() / inside.len() as f64).sqrt()
}

#[test]
fn derivatives_of_a_chaotic_motion() {
    let (recording, exact) = pendulum();
    let track = &recording.tracks[0];
    let smoothing = Smoothing::choose(&recording, &SmoothOptions::default()).unwrap();
    let smoothed = smoothing.apply(track).unwrap();
    let accelerations = |options: &SmoothOptions| {
        let smoothed = Smoothing::choose(&recording, options).unwrap().apply(track).unwrap();
        [0, 1].map(|i| size(&smoothed, i, |at| smoothed.a[at] - exact[2][at]))
    };
    let mut best = [f64::INFINITY; 2];
    for window in (9..150).step_by(6) {
        let found = accelerations(&SmoothOptions { window: Some(window), ..SmoothOptions::default() });
        best = [best[0].min(found[0]), best[1].min(found[1])];
    }
    for i in 0..2 {
        let chosen = &smoothing.coordinates[i];
        assert!((chosen.noise.sigma / SIGMA - 1.0).abs() < 0.1, "{:?}", chosen.noise);
        let error = size(&smoothed, i, |at| smoothed.a[at] - exact[2][at]);
        println!("{i}: window {}, {:.3} of the best", chosen.quality.window, error / best[i]);
        assert!(error < 1.5 * best[i], "window {}: {error}, best {}", chosen.quality.window, best[i]);
        // In the bursts of a chaotic motion two more degrees miss some of it too: more than said, by less than half.
        let factor = error / chosen.quality.total(2);
        assert!((1.0 / 1.5..1.5).contains(&factor), "{error}, said {}", chosen.quality.total(2));
        let arrays = [
            (&smoothed.q, &smoothed.q_error, &smoothed.q_bias, &exact[0]),
            (&smoothed.v, &smoothed.v_error, &smoothed.v_bias, &exact[1]),
            (&smoothed.a, &smoothed.a_error, &smoothed.a_bias, &exact[2]),
        ];
        for (k, (value, deviation, bias, truth)) in arrays.into_iter().enumerate() {
            let relative = |at: usize| (value[at] - truth[at]) / deviation[at].hypot(bias[at]);
            let inside = smoothed.interior();
            let within = inside.clone().filter(|s| relative(2 * s + i).abs() <= 2.0).count() as f64;
            let share = within / inside.len() as f64;
            println!("  derivative {k}: {share:.3} within twice the error, rms {:.3}", size(&smoothed, i, relative));
            // Neighbours are correlated over half a window; 0.954 of normal errors are within two deviations.
            let independent = 2.0 * inside.len() as f64 / chosen.quality.window as f64;
            assert!(share > 0.954 - 3.0 * (0.954 * 0.046 / independent).sqrt() - 0.01, "{i} {k}: {share}");
        }
    }
}

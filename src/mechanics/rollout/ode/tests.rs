//! Dense output of single steps; samples at equal times.

use super::*;

/// Samples of `y' = -y` from 1.
fn decay(method: Adaptive, tolerance: f64, first_step: f64, samples: &Vec<f64>) -> (Vec<f64>, Statistics) {
    let task = Task {
        method,
        rtol: tolerance,
        atol: tolerance,
        max_steps: 1000,
        first_step,
        timed: false,
        start: &[1.0],
        samples,
    };
    let mut got = Vec::new();
    let ran = f64::integrate::<()>(
        &task,
        &mut |_, y, dy| {
            dy[0] = -y[0];
            Ok(())
        },
        None,
        &mut |k, y| {
            assert_eq!(k, got.len());
            got.push(y[0]);
            true
        },
    );
    assert!(ran.ended.is_none());
    (got, ran.statistics)
}

/// Largest error of the samples of one single step of size `h`.
fn single_step(method: Adaptive, h: f64) -> f64 {
    let samples: Vec<f64> = (0..=20).map(|k| h * f64::from(k) / 20.0).collect();
    let (got, statistics) = decay(method, 1e6, h, &samples);
    assert_eq!((statistics.accepted, statistics.rejected), (1, 0));
    assert_eq!(got.len(), samples.len());
    samples.iter().zip(got).map(|(t, y)| (y - (-t).exp()).abs()).fold(0.0, f64::max)
}

#[test]
fn interpolation_is_right_inside_a_single_step_with_its_order() {
    for (method, order, bound) in [(Adaptive::Dopri5, 4.0, 2e-4), (Adaptive::Dop853, 7.0, 2e-7)] {
        assert!(single_step(method, 0.5) < bound, "{method:?}: {:e}", single_step(method, 0.5));
        // Local error h^(order + 1).
        let slope = (single_step(method, 0.5) / single_step(method, 0.25)).log2();
        assert!((slope - order - 1.0).abs() < 0.35, "{method:?}: {slope}");
    }
}

#[test]
fn a_sample_at_zero_and_two_at_one_time() {
    let (got, _) = decay(Adaptive::Dop853, 1e-10, 0.0, &vec![0.0, 0.0, 1.0, 1.0]);
    assert_eq!(got[..2], [1.0, 1.0]);
    assert_eq!(got[2], got[3]);
    assert!((got[2] - (-1.0_f64).exp()).abs() < 1e-9);
}

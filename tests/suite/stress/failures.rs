//! Cases 5, 22 and 38: numbers that are not finite, singular matrices, subnormal weights.

use super::objective::{all_rows, architecture, states, step, weights};
use super::record::{Row, exact};
use crate::common::accuracy::{cast, configure};
use crate::common::matrices::{dd, norm, times};
use lnn::configuration::Penalty;
use lnn::data::{Dataset, DatasetError};
use lnn::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use lnn::linalg::{self, Failure as MatrixFailure, LinalgError, Workspace};
use lnn::network::{ActivationChoice, NetworkLagrangian};
use lnn::optimizers::{Method, Moments, Update};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::training::Objective;
use std::time::Instant;

const BATCHES: [usize; 8] = [1, 2, 23, 24, 63, 65, 130, 1024];

/// Positions of a batch to try: every one of a small batch, the ends of chunks and some between of a large one.
fn positions(batch: usize) -> impl Iterator<Item = usize> {
    (0..batch).filter(move |p| batch <= 65 || [0, 1, 23, 62, 63, 64, 65, 127, 128, 500, 1022, 1023].contains(p))
}

/// One bad number in the coordinates or velocities of a batch: its row is named, every other row is what it was.
fn bad_states<S: Scalar>() {
    let shape = architecture(2, &[8, 8], ActivationChoice::Gelu, 1.0);
    let network = NetworkLagrangian::new(shape.clone(), weights::<S>(&shape, 1)).unwrap();
    let pendulum = configure::<S>("double-pendulum", &[]).build().unwrap();
    let models: [(&str, &dyn EulerLagrange<S>); 2] = [("network", &network), ("double pendulum", &*pendulum)];
    let mut checks = 0;
    for (name, model) in models {
        for batch in BATCHES {
            let data = states::<S>(2, batch, 2);
            let mut good = Terms::default();
            model.terms(data.q(), data.v(), Request::ALL, &mut good).unwrap();
            for (k, bad) in positions(batch)
                .flat_map(|p| [2 * p, 2 * p + 1])
                .zip([S::nan(), S::infinity(), -S::infinity()].into_iter().cycle())
            {
                for velocity in [false, true] {
                    let (mut q, mut v) = (data.q().to_vec(), data.v().to_vec());
                    if velocity {
                        v[k] = bad
                    } else {
                        q[k] = bad
                    }
                    let mut terms = Terms::default();
                    let error = model.terms(&q, &v, Request::ALL, &mut terms).unwrap_err();
                    let named = matches!(error, MechanicsError::NotFinite { row, .. } if row == k / 2);
                    assert!(named, "{name}, batch {batch}, number {k}: {error}");
                    for row in 0..batch {
                        let (a, b) = (&terms.acceleration[2 * row..][..2], &good.acceleration[2 * row..][..2]);
                        assert!(
                            if row == k / 2 { a.iter().all(|a| a.is_nan()) } else { a == b },
                            "{name} {batch} {row}"
                        );
                    }
                    // A dataset takes no such number at all.
                    let error = Dataset::new(2, q, v, data.a().to_vec()).unwrap_err();
                    assert!(
                        matches!(error, DatasetError::NotFinite { row, column, .. } if (row, column) == (k / 2, k % 2))
                    );
                    checks += 1;
                }
            }
        }
    }
    exact::<S>(5, "one NaN or infinity in a batch of states", checks);
}

/// One state of a batch whose evaluation overflows: the step names its row.
fn overflowing_states<S: Scalar>() {
    let shape = architecture(2, &[6, 6], ActivationChoice::Quadratic, 1.0);
    let theta = weights::<S>(&shape, 1);
    let mut checks = 0;
    for batch in BATCHES {
        let data = states::<S>(2, batch, 3);
        for p in positions(batch) {
            let mut q = data.q().to_vec();
            q[2 * p] = S::max_value().sqrt();
            let data = Dataset::new(2, q, data.v().to_vec(), data.a().to_vec()).unwrap();
            let (report, gradient) = step(&shape, (Penalty::None, 2), &theta, &data, &all_rows(batch));
            assert_eq!(
                (report.failure, report.left_out),
                (Some(MechanicsError::NotFinite { row: p, what: "acceleration" }), 1),
                "batch {batch}"
            );
            let mut moved = theta.clone();
            let update =
                Update { method: Method::Radam, rate: 1e-3, weight_decay: 1e-6, decaying: usize::MAX, clip: 1.0 };
            if !Moments::new(theta.len()).update(&mut moved, &mut gradient.clone(), &update).is_finite() {
                assert_eq!(moved, theta);
            }
            assert!(moved.iter().all(|w| w.is_finite()));
            checks += 1;
        }
    }
    exact::<S>(5, "one overflowing state in a step", checks);
}

/// One bad weight.
///
/// A `NaN` fails every state of the batch, the first is named, and the gradient is never taken: the loss of a batch
/// without any state that counts is not `NaN` but 0, and the failure beside it is what tells. An infinite bias may
/// saturate its unit, which is a finite limit: then the step is a step of finite numbers.
fn bad_weights<S: Scalar>() {
    let mut checks = 0;
    for activation in ActivationChoice::ALL {
        let shape = architecture(2, &[4, 4], activation, 1.0);
        let theta = weights::<S>(&shape, 1);
        for batch in [1, 65] {
            let data = states::<S>(2, batch, 4);
            let mut objective = Objective::new(&shape, Penalty::Eigenvalue { lambda: 1.0 }, 2).unwrap();
            let mut gradient = vec![S::nan(); theta.len()];
            for (k, bad) in (0..theta.len()).flat_map(|k| [(k, S::nan()), (k, S::infinity()), (k, -S::infinity())]) {
                let mut wrong = theta.clone();
                wrong[k] = bad;
                let report = objective.step(&wrong, &data, &all_rows(batch), &mut gradient);
                if bad.is_nan() || report.failure.is_some() {
                    let first = Some(MechanicsError::NotFinite { row: 0, what: "acceleration" });
                    assert!(report.failure == first || !bad.is_nan(), "{activation} weight {k}: {:?}", report.failure);
                    assert!(report.left_out == batch || !bad.is_nan());
                } else {
                    assert!(report.loss.is_finite(), "{activation} weight {k} = {bad}: {}", report.loss);
                }
                checks += 1;
            }
            // Nothing of it stays in the buffers.
            let report = objective.step(&theta, &data, &all_rows(batch), &mut gradient);
            assert!(report.failure.is_none() && gradient.iter().all(|g| g.is_finite()));
        }
    }
    exact::<S>(5, "one NaN or infinity among the weights", checks);
}

#[test]
fn case_05_bad_states() {
    bad_states::<f32>();
    bad_states::<f64>();
}

#[test]
fn case_05_overflowing_states() {
    overflowing_states::<f32>();
    overflowing_states::<f64>();
}

#[test]
fn case_05_bad_weights() {
    bad_weights::<f32>();
    bad_weights::<f64>();
}

/// Hilbert matrices: an error from where their condition says so, a backward stable solution before.
fn hilbert<S: Scalar>() {
    let eps = S::epsilon().to_f64();
    let mut row = Row::new::<S>(22, "Hilbert matrices: solved or refused");
    let (mut solved, mut refused) = (0, 0);
    for n in 1..=20 {
        let m: Vec<S> = (0..n * n).map(|k| S::of_f64(((k / n + k % n + 1) as f64).recip())).collect();
        let wide: Vec<Dd> = cast(&m);
        let kappa = linalg::condition_number(n, &wide, &mut Workspace::new()).unwrap();
        let rhs = vec![S::of_f64(1.0); n];
        let (mut x, mut workspace) = (vec![S::nan(); n], Workspace::new());
        match linalg::solve(n, &m, &rhs, &mut x, &mut workspace) {
            Ok(()) => {
                solved += 1;
                let x: Vec<Dd> = cast(&x);
                let residual = norm(times(n, &m, &x).into_iter().map(|y| y - Dd::one()));
                let scale = norm(wide.iter().copied()) * norm(x.iter().copied()) + (n as f64).sqrt();
                row.see(residual / (n as f64 * eps * scale), || format!("n = {n}, condition {kappa:.1e}"));
            }
            Err(error) => {
                refused += 1;
                assert!(matches!(error, LinalgError::Singular { row: 0, .. }), "{error}");
                assert!(matches!(workspace.failures(), [(0, MatrixFailure::Singular { .. })]));
                assert!(x.iter().all(|x| x.is_nan()));
                assert!(kappa > 0.01 / eps, "n = {n} refused at condition {kappa:e}");
            }
        }
    }
    assert!(solved > 3 && refused > 3, "{solved} {refused}");
    row.end();
}

/// Mass matrices that vanish or have one direction without mass: a failure for every state, no `NaN` in the gradient.
fn massless<S: Scalar>() {
    let mut checks = 0;
    for n in 1..=6 {
        let shape = architecture(n, &[5, 5], ActivationChoice::Softplus, 0.0);
        let nothing = vec![S::of_f64(0.0); weights::<S>(&shape, 1).len()];
        // The second velocity has no weights.
        let mut blind = weights::<S>(&shape, 1);
        let inputs = 2 * n;
        (0..5).for_each(|unit| blind[unit * inputs + inputs - 1] = S::of_f64(0.0));
        for (theta, batch) in [(&nothing, 3), (&nothing, 70), (&blind, 3), (&blind, 70)] {
            let data = states::<S>(n, batch, 6);
            for penalty in [
                Penalty::None,
                Penalty::Eigenvalue { lambda: 1.0 },
                Penalty::Sylvester { lambda: 1.0, time: None },
                Penalty::Signature { lambda: 1.0 },
            ] {
                let (report, gradient) = step(&shape, (penalty, 2), theta, &data, &all_rows(batch));
                assert_eq!(report.left_out, batch, "n = {n}");
                assert!(
                    matches!(report.failure, Some(MechanicsError::Singular { row: 0, .. })),
                    "{:?}",
                    report.failure
                );
                assert!(gradient.iter().all(|g| g.is_finite()), "n = {n}, {penalty:?}");
                checks += 1;
            }
        }
    }
    exact::<S>(22, "states without mass in a step", checks);
}

#[test]
fn case_22_nearly_singular_matrices() {
    hilbert::<f32>();
    hilbert::<f64>();
}

#[test]
fn case_22_singular_mass_matrices() {
    massless::<f32>();
    massless::<f64>();
}

/// Weights far into the subnormal numbers: nothing but finite numbers, and the time they take beside the usual.
///
/// Flushing to zero is not switched on anywhere: the mode of the processor is what the program was started with. The
/// row says how long the steps took beside the usual: in f64 1.2 to 1.3 times in five runs, 9.6 and 15.8 in two others,
/// all on a busy machine. No bound is asserted, and which of these is the processor's own price is not known.
fn subnormal<S: Scalar>() {
    let mut checks = 0;
    let mut slowest = 0.0_f64;
    for activation in ActivationChoice::ALL {
        let shape = architecture(2, &[32, 32], activation, 1.0);
        let usual = weights::<S>(&shape, 1);
        let data = states::<S>(2, 256, 7);
        let seconds = |theta: &[S]| {
            let mut objective = Objective::new(&shape, Penalty::Eigenvalue { lambda: 1.0 }, 1).unwrap();
            let mut gradient = vec![S::nan(); theta.len()];
            let mut best = f64::INFINITY;
            for _ in 0..5 {
                let clock = Instant::now();
                let report = objective.step(theta, &data, &all_rows(256), &mut gradient);
                best = best.min(clock.elapsed().as_secs_f64());
                // `alpha |v|^2` is left.
                assert!(report.failure.is_none() && report.loss.is_finite(), "{activation}: {:?}", report.failure);
                assert!(gradient.iter().all(|g| g.is_finite()), "{activation}");
            }
            best
        };
        let plain = seconds(&usual);
        for shift in [
            S::min_positive().ilogb() / 2,
            S::min_positive().ilogb(),
            S::min_positive().ilogb() + S::epsilon().ilogb() + 2,
        ] {
            let small: Vec<S> = usual.iter().map(|w| w.ldexp(shift)).collect();
            slowest = slowest.max(seconds(&small) / plain);
            checks += 1;
        }
    }
    exact::<S>(38, &format!("subnormal weights, {slowest:.1} times the usual time at most"), checks);
    assert!(dd(S::min_positive().ldexp(-1)).to_f64() > 0.0, "subnormal numbers exist");
}

#[test]
fn case_38_subnormal_weights() {
    subnormal::<f32>();
    subnormal::<f64>();
}

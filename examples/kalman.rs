//! An extended Kalman filter follows a double pendulum of which only the first angle is measured, with noise.
//!
//! Between measurements state and covariance move by [`Flow::jacobian`]: the exact derivatives of the steps.

use lnn::lagrangian::SystemInstance;
use lnn::rollout::Flow;
use nalgebra::{SMatrix, SVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// rad.
const NOISE: f64 = 0.02;
/// s.
const INTERVAL: f64 = 0.02;

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arm = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
    let flow = Flow::new(&*arm, INTERVAL, 1);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let noise = Normal::new(0.0, NOISE)?;
    let mut truth = [0.9, -0.4, 0.0, 0.5];
    // The filter starts at rest, 0.5 rad and 1 rad/s uncertain.
    let mut x = SVector::<f64, 4>::zeros();
    let mut p = SMatrix::<f64, 4, 4>::from_diagonal(&[0.25, 0.25, 1.0, 1.0].into());
    let (mut inside, mut late) = (0, 0.0f64);
    for k in 0..500 {
        truth = flow.end(&truth[..2], &truth[2..], None)?.try_into().map_err(|_| "four numbers")?;
        let moved = flow.jacobian(&x.as_slice()[..2], &x.as_slice()[2..], None)?;
        let by_start = SMatrix::<f64, 4, 4>::from_row_slice(&moved.by_start);
        x = SVector::from_vec(moved.end);
        // A little noise of the motion keeps the filter awake.
        p = by_start * p * by_start.transpose() + SMatrix::<f64, 4, 4>::identity() * 1e-8;
        let measured = truth[0] + noise.sample(&mut random);
        let gain = p.column(0) / (p[(0, 0)] + NOISE * NOISE);
        x += gain * (measured - x[0]);
        p = (SMatrix::identity() - gain * SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0)) * p;
        p = (p + p.transpose()) / 2.0;
        if k >= 250 {
            let miss = x[1] - truth[1];
            inside += usize::from(miss.abs() < 2.0 * p[(1, 1)].sqrt());
            late = late.max(miss.abs());
        }
    }
    println!("second angle, never measured: within {late:.4} rad, {inside} of 250 within two standard errors");
    assert!(late < 0.05 && inside >= 200, "lost");
    Ok(())
}

//! Makes `examples/data/pendulum.csv`: a measurement of a double pendulum, with friction and noise.
//!
//! Four runs of five seconds, friction in both joints, angles 100 times a second with a noise of 0.5 % of their rms.
//! Without arguments it compares the file with what it would write; `-- --write` writes it.

use lnn::lagrangian::{Dissipation, Rayleigh, SystemInstance, WithForces};
use lnn::random::RngStream;
use lnn::rollout::{RolloutOptions, rollout};
use lnn::scalar::Real;
use rand_distr::{Distribution, StandardNormal};
use std::fmt::Write;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/data/pendulum.csv");
const NOISE: f64 = 0.005;

/// Viscous joints: Rayleigh's dissipation `D = (c1 v1^2 + c2 (v2 - v1)^2)/2`, c in N m s.
struct Joints([f64; 2]);

impl Dissipation for Joints {
    fn dissipation<R: Real>(&self, _q: &[R], v: &[R]) -> R {
        let [base, between] = self.0.map(R::of);
        (base * v[0].sqr() + between * (v[1] - v[0]).sqr()) * R::half()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let csv = made()?;
    if std::env::args().any(|argument| argument == "--write") {
        return Ok(std::fs::write(FILE, csv)?);
    }
    compare(&csv)
}

/// The recording as CSV.
pub fn made() -> Result<String, Box<dyn std::error::Error>> {
    // 1 m and 1 kg each, g = 9.81 m/s^2; anything that gives accelerations can be rolled out.
    let ideal = SystemInstance::<f64>::named("double-pendulum", &[("g".to_string(), "9.81".to_string())])?.build()?;
    let model = WithForces::new(ideal, Rayleigh(Joints([0.08, 0.05])));
    let (mut csv, mut rng) = ("run,t,theta1,theta2\n".to_string(), RngStream::Training(0).generator(0));
    for (run, start) in [[1.2, 1.9], [-2.0, -0.6], [2.4, 0.3], [0.4, -2.6]].into_iter().enumerate() {
        let motion = rollout(&model, &start, &[0.0; 2], &RolloutOptions::reference(5.0, 0.01));
        let energy = motion.trajectory.energy.clone().unwrap_or_default();
        let motion = motion.complete()?;
        println!("run {run}: energy {:.2} J to {:.2} J", energy[0], energy[500]);
        assert!(energy.windows(2).all(|e| e[1] <= e[0] + 1e-9), "friction gives no energy");
        let rms = |i: usize| (motion.q.chunks(2).map(|q| q[i].powi(2)).sum::<f64>() / motion.len() as f64).sqrt();
        for (t, q) in motion.t.iter().zip(motion.q.chunks(2)) {
            let mut noisy =
                |i: usize| -> f64 { q[i] + NOISE * rms(i) * Distribution::<f64>::sample(&StandardNormal, &mut rng) };
            writeln!(csv, "{run},{t:.2},{:.5},{:.5}", noisy(0), noisy(1))?;
        }
    }
    Ok(csv)
}

/// Fails unless the file holds this recording.
pub fn compare(csv: &str) -> Result<(), Box<dyn std::error::Error>> {
    // Another machine may round another way; a motion of five seconds does not make 1e-4 of it.
    let numbers = |text: &str| -> Result<Vec<f64>, _> {
        text.lines().skip(1).flat_map(|l| l.split(',')).map(str::parse).collect()
    };
    let (made, found) = (numbers(csv)?, numbers(&std::fs::read_to_string(FILE)?)?);
    assert_eq!((made.len(), csv.len() < 60_000), (found.len(), true));
    assert!(made.iter().zip(&found).all(|(a, b): (&f64, &f64)| (a - b).abs() < 1e-4), "{FILE} is another");
    Ok(())
}

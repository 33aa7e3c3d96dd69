//! A user's Lagrangian, learned from its states: a bead on a turning hoop, its motion beside that of the learned Lagrangian, and the energy
//! of the latter in a Runge-Kutta method of this program.
//!
//! A crate with such a program compiles the code of its own Lagrangian alone, in seconds:
//! `touch examples/own_lagrangian.rs; time cargo build --release --example own_lagrangian`.

use lnn::prelude::*;
use std::f64::consts::TAU;

/// Coordinate: angle from the lowest point in rad. Parameters: mass (kg), radius (m), turning of the hoop (rad/s), g (m/s^2).
struct BeadOnHoop;

impl Lagrangian for BeadOnHoop {
    fn coordinates(&self) -> usize {
        1
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let [mass, radius, w, g] = [p[0], p[1], p[2], p[3]];
        let speed_squared = (radius * v[0]).sqr() + (radius * w * q[0].sin()).sqr();
        mass * speed_squared * R::half() + mass * g * radius * q[0].cos()
    }
}

/// One step of the classical Runge-Kutta method.
fn step(model: &dyn EulerLagrange<f64>, (q, v): (f64, f64), h: f64) -> Result<(f64, f64), MechanicsError> {
    let a = |q: f64, v: f64| model.acceleration(&[q], &[v]).map(|a| a[0]);
    let (k1, l1) = (v, a(q, v)?);
    let (k2, l2) = (v + 0.5 * h * l1, a(q + 0.5 * h * k1, v + 0.5 * h * l1)?);
    let (k3, l3) = (v + 0.5 * h * l2, a(q + 0.5 * h * k2, v + 0.5 * h * l2)?);
    let (k4, l4) = (v + h * l3, a(q + h * k3, v + h * l3)?);
    Ok((q + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), v + h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4)))
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bead = Mechanics::new(BeadOnHoop, [0.1, 0.5, 6.0, 9.81]);
    let q: Vec<f64> = (0..700).map(|k| TAU * (f64::from(k) * 0.618 % 1.0)).collect();
    let v: Vec<f64> = (0..700).map(|k| 6.0 * (f64::from(k) * 0.414 % 1.0) - 3.0).collect();
    let a = bead.acceleration(&q, &v)?;
    let data = Dataset::new(1, q, v, a)?;
    let learned = Trainer::new(&data).angles(&[0]).hidden(&[16, 16]).batch(32).epochs(40).train()?;
    println!("loss {:.5} after {} epochs", learned.validation_loss, learned.history.len());
    assert!(learned.validation_loss < learned.history[0].validation_loss / 20.0);

    let exact = bead.rollout(&[1.2], &[0.5], 5.0, 0.05)?;
    let predicted = learned.model.rollout(&[1.2], &[0.5], 5.0, 0.05)?;
    let worst = exact.q.iter().zip(&predicted.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("largest error of the angle in 5 s: {worst:.4} rad");
    assert!(worst < 0.1);

    let mut state = (1.2, 0.5);
    let energy = |(q, v): (f64, f64)| learned.model.energy(&[q], &[v]).map(|energy| energy[0]);
    let before = energy(state)?;
    for _ in 0..500 {
        state = step(&learned.model, state, 0.01)?;
    }
    let drift = (energy(state)? / before - 1.0).abs();
    println!("after 5 s in steps of 0.01 s: {:.4} rad, drift of the learned energy {drift:.1e}", state.0);
    assert!(drift < 1e-5);
    Ok(())
}

//! What the library offers without the standard library: Euler-Lagrange terms, accelerations, linearizations and derivatives, beside closed forms.

#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::error::Error;
use lnn::lagrangian::{Accelerations, Constrained, Constraints, ExpressionLagrangian, Linearizer, SystemInstance};
use lnn::prelude::*;
use lnn::tape::Function;

/// Two masses on two rods, angles from below.
pub struct DoublePendulum;

/// Masses, lengths, gravity.
pub const PARAMETERS: [f64; 5] = [1.5, 0.7, 0.9, 1.2, 9.81];

impl Lagrangian for DoublePendulum {
    const COORDINATES: Option<usize> = Some(2);

    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let [m1, m2, l1, l2, g] = [p[0], p[1], p[2], p[3], p[4]];
        let kinetic = (m1 + m2) * (l1 * v[0]).sqr() * R::half()
            + m2 * (l2 * v[1]).sqr() * R::half()
            + m2 * l1 * l2 * v[0] * v[1] * (q[0] - q[1]).cos();
        kinetic + (m1 + m2) * g * l1 * q[0].cos() + m2 * g * l2 * q[1].cos()
    }
}

/// States `(q, v)`.
pub const STATES: [([f64; 2], [f64; 2]); 3] =
    [([2.0, 1.0], [0.0, 0.0]), ([0.3, -0.4], [1.5, -2.0]), ([-1.2, 3.0], [0.7, 4.0])];

/// The accelerations of the double pendulum, written out.
pub fn closed_form(q: [f64; 2], v: [f64; 2]) -> [f64; 2] {
    let [m1, m2, l1, l2, g] = PARAMETERS;
    let ((sin, cos), half) = (Real::sin_cos(q[0] - q[1]), 2.0 * m1 + m2);
    let whole = half - m2 * (2.0 * cos * cos - 1.0);
    let first = -g * half * Real::sin(q[0])
        - m2 * g * Real::sin(q[0] - 2.0 * q[1])
        - 2.0 * sin * m2 * (v[1] * v[1] * l2 + v[0] * v[0] * l1 * cos);
    let second =
        2.0 * sin * (v[0] * v[0] * l1 * (m1 + m2) + g * (m1 + m2) * Real::cos(q[0]) + v[1] * v[1] * l2 * m2 * cos);
    [first / (l1 * whole), second / (l2 * whole)]
}

/// The largest difference of two lists of numbers, in units of the larger ones above 1.
fn difference(found: &[f64], exact: &[f64]) -> f64 {
    assert_eq!(found.len(), exact.len());
    found.iter().zip(exact).fold(0.0, |largest, (&x, &y)| Real::max(largest, (x - y).abs() / y.abs().max(1.0)))
}

/// Differences of the accelerations from the closed form: of a batch, and state after state.
///
/// # Errors
/// None.
pub fn accelerations() -> Result<[f64; 2], Box<dyn Error>> {
    let model = Mechanics::new(DoublePendulum, PARAMETERS);
    let (q, v): (Vec<f64>, Vec<f64>) = STATES.into_iter().flat_map(|(q, v)| q.into_iter().zip(v)).unzip();
    let exact = STATES.map(|(q, v)| closed_form(q, v)).concat();
    let batch = difference(&model.acceleration(&q, &v)?, &exact);
    let (mut solver, mut single) = (Accelerations::new(&model), 0.0);
    for ((q, v), exact) in STATES.into_iter().zip(exact.chunks(2)) {
        let mut found = [0.0; 2];
        solver.at(&q, &v, &mut found)?;
        single = Real::max(single, difference(&found, exact));
    }
    Ok([batch, single])
}

/// Difference of the derivatives of accelerations from differences of the closed form, whose own errors are about `1e-9`.
///
/// # Errors
/// None.
pub fn linearization() -> Result<f64, Box<dyn Error>> {
    const STEP: f64 = 1e-5;
    let model = Mechanics::new(DoublePendulum, PARAMETERS);
    let mut linearizer = Linearizer::new(&model as &dyn EulerLagrange<f64>);
    let mut largest = 0.0;
    for (q, v) in STATES {
        let found = linearizer.at(&q, &v)?;
        for k in 0..2 {
            let moved = |step: f64, position: bool| {
                let (mut q, mut v) = (q, v);
                (if position { &mut q } else { &mut v })[k] += step;
                closed_form(q, v)
            };
            for (slopes, position) in [(&found.by_q, true), (&found.by_v, false)] {
                let (above, below) = (moved(STEP, position), moved(-STEP, position));
                for i in 0..2 {
                    let slope = (above[i] - below[i]) / (2.0 * STEP);
                    largest = Real::max(largest, difference(&[slopes[2 * i + k]], &[slope]));
                }
            }
        }
    }
    Ok(largest)
}

/// A rod of length `parameters[0]` from the origin.
struct Rod;

impl Constraints for Rod {
    fn coordinates(&self) -> usize {
        2
    }
    fn names(&self) -> Vec<String> {
        vec!["rod".into()]
    }
    fn is_holonomic(&self, _: usize) -> bool {
        true
    }
    fn values<R: Real>(&self, p: &[R], q: &[R], _: &[R], values: &mut [R]) {
        values[0] = (q[0].sqr() + q[1].sqr() - p[0].sqr()) * R::half();
    }
}

/// Differences of the accelerations of a pendulum, once a mass on a rod that a text describes, once a system of the catalogue.
///
/// # Errors
/// None.
pub fn pendula() -> Result<[f64; 2], Box<dyn Error>> {
    let bob = ExpressionLagrangian::new(&["x", "y"], &["m", "g"], "m*(x_dot^2 + y_dot^2)/2 - m*g*y")?;
    let pendulum = Constrained::new(Mechanics::new(bob, [2.0, 9.81]), Rod, [1.0])?;
    let lowest = pendulum.acceleration(&[0.0, -1.0], &[3.0, 0.0])?;
    let known = SystemInstance::<f64>::named("n-pendulum", &[("n".into(), "1".into())])?.build()?;
    let aside = known.acceleration(&[0.5], &[0.0])?;
    Ok([difference(&lowest, &[0.0, 9.0]), difference(&aside, &[-9.8 * Real::sin(0.5)])])
}

/// Difference of a Hessian from the one worked out by hand.
///
/// # Errors
/// None.
pub fn hessian() -> Result<f64, Box<dyn Error>> {
    let mut f = Function::<f64>::record(2, |x| x[0].exp() * x[1].sin() + x[0].sqr() * x[1])?;
    let (x, mut value, mut gradient, mut found) = ([0.4, 1.1], [0.0], [0.0; 2], [0.0; 4]);
    f.hessians(&x, &mut value, &mut gradient, &mut found)?;
    let (exp, (sin, cos)) = (Real::exp(x[0]), Real::sin_cos(x[1]));
    let mixed = exp * cos + 2.0 * x[0];
    Ok(difference(&found, &[exp * sin + 2.0 * x[1], mixed, mixed, -exp * sin]))
}

/// Everything agrees with its closed form.
pub fn agrees() -> bool {
    let close = |found: Result<[f64; 2], Box<dyn Error>>| found.is_ok_and(|found| found.iter().all(|&x| x < 1e-12));
    close(accelerations())
        && close(pendula())
        && close(hessian().map(|x| [x; 2]))
        && linearization().is_ok_and(|difference| difference < 1e-7)
}

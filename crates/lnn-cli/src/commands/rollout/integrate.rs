//! Integrates a motion and processes its samples as they arrive.

use super::samples::Samples;
use crate::CliError;
use crate::arguments::forces::KnownForce;
use crate::arguments::integration::refused;
use crate::terminal::interrupt;
use lnn::lagrangian::{EulerLagrange, Interruptible};
use lnn::rollout::{Driven, Ending, RolloutError, RolloutOptions, Trajectory, rollout_in_pieces};
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

/// Integrates the motion of a model from a state, under a force if there is one.
///
/// # Errors
/// A usage error for a motion that is rejected, and what the samples fail with; why an accepted motion stopped is in its end.
pub fn integrate(
    model: &dyn EulerLagrange<f64>,
    force: Option<&KnownForce>,
    (q, v): (&[f64], &[f64]),
    options: &RolloutOptions<f64>,
    samples: &mut Samples<'_>,
) -> Result<Ending<f64>, CliError> {
    let (stop, mut failed) = (interrupt::flag()?, None);
    let moving = Interruptible::new(model, &stop);
    let mut take = |piece: &Trajectory<f64>| {
        failed = samples.take(piece).err();
        let is_over = failed.is_some() || stop.load(Ordering::Relaxed);
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let result = match force {
        Some(force) => Driven::new(&moving, force).rollout_in_pieces(q, v, options, &mut take),
        None => rollout_in_pieces(&moving, q, v, options, &mut take),
    };
    match (failed, &result.stop) {
        (Some(error), _) => Err(error),
        (_, Some(error @ (RolloutError::Invalid { .. } | RolloutError::OffConstraints { .. }))) => Err(refused(error)),
        _ => Ok(result),
    }
}

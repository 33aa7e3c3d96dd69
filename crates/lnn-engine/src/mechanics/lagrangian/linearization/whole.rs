//! The linearization of a small model as one program: its accelerations, the inverse of its mass matrix, and the product of the inverse
//! with the derivatives of the equations of motion.

use super::Linearization;
use crate::lagrangian::accelerations::{RecordMotion, are_safe};
use crate::lagrangian::elimination::Eliminated;
use crate::scalar::{Real, Scalar, are_finite};
use crate::tape::{Program, ROWS, Replay, Tracer};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The program of a linearization.
#[derive(Clone, Debug)]
pub(crate) struct Linearized<S> {
    program: Arc<Program<S>>,
    n: usize,
    parameters: Vec<S>,
    /// Number of pairs of a pivot and its original diagonal element.
    pivots: usize,
}

impl<S: Scalar> Linearized<S> {
    /// Records the linearization of `n` coordinates; returns `None` if separate programs are faster, or if it cannot be recorded.
    pub fn record(motion: &dyn RecordMotion<S>, n: usize, parameters: &[S]) -> Option<Self> {
        if n > motion.linearized_up_to() {
            return None;
        }
        let mut pivots = 0;
        let program = Program::record_within(ROWS, (2 * n, parameters.len()), |x, p| {
            let balance = motion.record(x, p)?;
            let eliminated = Eliminated::of(n, balance.lower, usize::MAX)?;
            // The multipliers follow the accelerations with reversed sign.
            let (mut acceleration, inverse) = (eliminated.solve(balance.right), eliminated.inverse());
            acceleration[n..].iter_mut().for_each(|multiplier| *multiplier = -*multiplier);
            let slopes = motion.record_slopes(&[x, &acceleration].concat(), p)?;
            acceleration.truncate(n);
            let mut by_state = vec![vec![Tracer::zero(); 2 * n]; n];
            for (by_state, inverse) in by_state.iter_mut().zip(&inverse) {
                for (slopes, &factor) in slopes.iter().zip(inverse) {
                    slopes.iter().for_each(|(&column, &slope)| by_state[column] += factor * slope);
                }
            }
            let guards = eliminated.guards();
            pivots = guards.len();
            let mut outputs = acceleration;
            outputs.extend(by_state.iter().flat_map(|row| &row[..n]));
            outputs.extend(by_state.iter().flat_map(|row| &row[n..]));
            outputs.extend(inverse.iter().take(n).flat_map(|row| &row[..n]));
            outputs.extend(guards.iter().flatten());
            Some(outputs)
        });
        Some(Self { program: Arc::new(program.ok()?), n, parameters: parameters.to_vec(), pivots })
    }

    /// Returns a replay with buffers for the program.
    pub fn replay(&self) -> Replay<S> {
        Replay::new(Arc::clone(&self.program))
    }

    /// Fills a linearization; returns `false` if a state needs the general solver.
    pub fn evaluate(
        &self,
        replay: &mut Replay<S>,
        (q, v): (&[S], &[S]),
        found: &mut Linearization<S>,
        guards: &mut Vec<S>,
    ) -> bool {
        let (n, batch) = (self.n, q.len() / self.n.max(1));
        let Linearization { acceleration, by_q, by_v, by_force } = found;
        acceleration.resize(batch * n, S::nan());
        [&mut *by_q, by_v, by_force].into_iter().for_each(|field| field.resize(batch * n * n, S::nan()));
        guards.resize(batch * 2 * self.pivots, S::nan());
        let mut outputs = [&mut acceleration[..], by_q, by_v, by_force, guards];
        let done = replay.evaluate(batch, &[q, v], &self.parameters, &mut outputs);
        done.is_ok() && are_safe(guards) && are_finite(acceleration)
    }
}

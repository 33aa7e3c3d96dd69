//! Adapter to `ode_solvers`, the only file that uses it.
//!
//! Its pitfalls and how this file and the observer handle them:
//! - A right-hand side cannot fail, so the first error of an attempt is stored and `NaN` is returned. The solver then rejects the step and
//!   tries a shorter one; the error only ends the integration when steps become too small.
//! - Its dense output extrapolates the last sample, panics or hangs for some intervals, and is lost on failures. Only the sparse output is
//!   used, and the observer interpolates samples from the stages of each accepted step.
//! - Backward integration is unreliable, so the elapsed time always increases from 0 (the caller changes the sign).
//! - Statistics are lost on errors, so the observer counts the calls.
//! - Underflow is not detected in `f32`, so a step that does not advance the time ends the integration.
//! - The node of stage 12 in its table of order 8 is wrong (0 instead of 1), so the time of that stage is derived from the previous one.

use super::dense::Rhs;
use super::integration::{Adaptive, EarlyEnd, Integration, Output, Project, Ran, Receivers, Scan, StepNodes};
use super::observer::{Observer, RunEnd};
use super::run;
use super::{Force, RolloutError, RolloutOptions, StepCounts};
use crate::lagrangian::EulerLagrange;
use crate::scalar::{Real, Scalar};
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, OVector};
use ode_solvers::dop_shared::{FloatNumber, IntegrationError};
use ode_solvers::{DVector, Dop853, Dopri5, OutputType, SVector, System};
use std::cell::RefCell;

/// Number types that support adaptive integration and roll-outs: `f32` and `f64`. Other numbers are integrated with fixed steps
/// ([`rollout_fixed`](super::rollout_fixed)).
pub trait Integrable: Integrates {}

/// Code that this crate compiles once for each of these number types.
pub trait Integrates: Scalar {
    /// Integrates a motion from its start, sample by sample.
    fn roll_out(
        model: &dyn EulerLagrange<Self>,
        force: Option<&dyn Force<Self>>,
        start: (&[Self], &[Self]),
        options: &RolloutOptions<Self>,
        receivers: run::Receivers<'_, '_, Self>,
    ) -> (StepCounts, Option<RolloutError>);

    /// Solves differential equations.
    fn integrate<E>(
        task: &Integration<'_, Self>,
        f: &mut Rhs<'_, Self, E>,
        project: Option<&mut Project<'_, Self, E>>,
        receivers: Receivers<'_, '_, Self>,
    ) -> Ran<Self, E>;
}

macro_rules! integrable {
    ($($float:ty)*) => {
        $(
            impl Integrable for $float {}

            impl Integrates for $float {
                fn roll_out(
                    model: &dyn EulerLagrange<Self>,
                    force: Option<&dyn Force<Self>>,
                    start: (&[Self], &[Self]),
                    options: &RolloutOptions<Self>,
                    receivers: run::Receivers<'_, '_, Self>,
                ) -> (StepCounts, Option<RolloutError>) {
                    run::integrate(model, force, start, options, receivers)
                }

                fn integrate<E>(
                    task: &Integration<'_, Self>,
                    f: &mut Rhs<'_, Self, E>,
                    project: Option<&mut Project<'_, Self, E>>,
                    receivers: Receivers<'_, '_, Self>,
                ) -> Ran<Self, E> {
                    // Small states are stored on the stack.
                    match task.start.len() {
                        2 => integrate(task, |y| SVector::<Self, 2>::from_column_slice(y), f, project, receivers),
                        4 => integrate(task, |y| SVector::<Self, 4>::from_column_slice(y), f, project, receivers),
                        6 => integrate(task, |y| SVector::<Self, 6>::from_column_slice(y), f, project, receivers),
                        _ => integrate(task, DVector::<Self>::from_column_slice, f, project, receivers),
                    }
                }
            }
        )*
    };
}
integrable!(f32 f64);

/// The observer in the form that the solver requires.
struct Watched<'w, 'a, 'f, S, E>(&'w RefCell<Observer<'a, 'f, S, E>>);

impl<S, D, E> System<S, OVector<S, D>> for Watched<'_, '_, '_, S, E>
where
    S: Scalar + FloatNumber,
    D: Dim,
    DefaultAllocator: Allocator<D>,
{
    fn system(&self, x: S, y: &OVector<S, D>, dy: &mut OVector<S, D>) {
        self.0.borrow_mut().evaluate(x, y.as_slice(), dy.as_mut_slice());
    }

    fn solout(&mut self, x: S, y: &OVector<S, D>, dy: &OVector<S, D>) -> bool {
        self.0.borrow_mut().accepted(x, y.as_slice(), dy.as_slice())
    }
}

/// Runs the solver, restarting it from every state that its observer has changed, until the last sample.
fn integrate<S, D, E>(
    task: &Integration<'_, S>,
    vector: impl Fn(&[S]) -> OVector<S, D>,
    f: &mut Rhs<'_, S, E>,
    project: Option<&mut Project<'_, S, E>>,
    (output, nodes, scan): Receivers<'_, '_, S>,
) -> Ran<S, E>
where
    S: Scalar + FloatNumber,
    f64: From<S>,
    D: Dim,
    DefaultAllocator: Allocator<D>,
    OVector<S, D>: std::ops::Mul<S, Output = OVector<S, D>>,
{
    let zero = <S as Real>::zero();
    let mut ran = Ran {
        statistics: StepCounts { evaluations: 1, ..StepCounts::default() },
        elapsed: zero,
        state: task.start.to_vec(),
        step: zero,
        ended: None,
    };
    let end = task.samples.len().checked_sub(1).and_then(|last| task.samples.get(last));
    let (begun, end) = match (begin(task, f, output), end) {
        (Ok(begun), Some(end)) => (begun, end),
        (begun, _) => return Ran { ended: begun.err(), ..ran },
    };
    let project = project.map(|project| project as &mut Project<'_, S, E>);
    let nodes = nodes.map(|nodes| nodes as &mut StepNodes<'_, S>);
    let scan = scan.map(|scan| scan as &mut Scan<'_, S>);
    let observer = RefCell::new(Observer::new(task, f, project, (output, nodes, scan), begun));
    let mut first_step = task.first_step;
    while ran.ended.is_none() && observer.borrow().next < task.samples.len() {
        let (elapsed, y, attempts_left) = {
            let mut observer = observer.borrow_mut();
            let attempts_left = observer.open_run(first_step);
            (observer.elapsed, vector(&observer.state), attempts_left)
        };
        let accepted_before = observer.borrow().statistics.accepted;
        let end_of_run = if attempts_left == 0 {
            RunEnd::TooManySteps
        } else {
            run(task, Watched(&observer), elapsed, end, y, first_step, attempts_left)
        };
        let mut observer = observer.borrow_mut();
        observer.count_rejected(accepted_before);
        match observer.continuation(elapsed, end) {
            Some(step) => first_step = step,
            None => ran.ended = observer.ending(end_of_run),
        }
    }
    let observer = observer.into_inner();
    Ran {
        statistics: observer.statistics,
        elapsed: observer.elapsed,
        state: observer.state,
        step: observer.step,
        ..ran
    }
}

/// Computes the slope at the start, delivers the samples there, and returns the index of the first one after it.
///
/// # Errors
/// The right-hand side fails at the start, or the receiver accepts no more samples.
fn begin<S: Scalar, E>(
    task: &Integration<'_, S>,
    f: &mut Rhs<'_, S, E>,
    output: &mut Output<'_, S>,
) -> Result<(Vec<S>, usize), EarlyEnd<E>> {
    let zero = <S as Real>::zero();
    let mut slope = vec![zero; task.start.len()];
    f(zero, task.start, &mut slope).map_err(EarlyEnd::Failed)?;
    let mut next = 0;
    while task.samples.get(next).is_some_and(|t| t <= zero) {
        if !output(next, task.start) {
            return Err(EarlyEnd::Stopped);
        }
        next += 1;
    }
    Ok((slope, next))
}

/// Runs the solver once from `elapsed` to `end` with its default settings, except that stiffness detection is off, because the number of
/// steps is limited instead.
fn run<S, D, E>(
    task: &Integration<'_, S>,
    watched: Watched<'_, '_, '_, S, E>,
    elapsed: S,
    end: S,
    y: OVector<S, D>,
    first_step: S,
    max_steps: usize,
) -> RunEnd
where
    S: Scalar + FloatNumber,
    f64: From<S>,
    D: Dim,
    DefaultAllocator: Allocator<D>,
    OVector<S, D>: std::ops::Mul<S, Output = OVector<S, D>>,
{
    let number = <S as Scalar>::of_f64;
    // For a component that stays 0, the error would be 0/0.
    let smallest = <S as Scalar>::min_positive();
    let atol = if task.atol > smallest { task.atol } else { smallest };
    let max_steps = u32::try_from(max_steps).unwrap_or(u32::MAX - 1);
    macro_rules! solve {
        ($solver:ident, $beta:expr, $shrink:expr, $grow:expr) => {
            $solver::from_param(
                watched,
                elapsed,
                end,
                end,
                y,
                task.rtol,
                atol,
                number(0.9),
                number($beta),
                number($shrink),
                number($grow),
                end - elapsed,
                first_step,
                max_steps,
                u32::MAX,
                OutputType::Sparse,
            )
            .integrate()
        };
    }
    let result = match task.method {
        Adaptive::Dopri5 => solve!(Dopri5, 0.04, 0.2, 10.0),
        Adaptive::Dop853 => solve!(Dop853, 0.0, 0.333, 6.0),
    };
    match result {
        Ok(_) => RunEnd::Complete,
        Err(IntegrationError::MaxNumStepReached { .. }) => RunEnd::TooManySteps,
        Err(_) => RunEnd::Failed,
    }
}

#[cfg(test)]
mod tests {
    //! Tests the dense output of single steps, and samples at equal times.

    use super::*;

    /// Returns samples of `y' = -y` from 1.
    fn decay(method: Adaptive, tolerance: f64, first_step: f64, samples: &Vec<f64>) -> (Vec<f64>, StepCounts) {
        let task = Integration {
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
            (
                &mut |k, y| {
                    assert_eq!(k, got.len());
                    got.push(y[0]);
                    true
                },
                None,
                None,
            ),
        );
        assert!(ran.ended.is_none());
        (got, ran.statistics)
    }

    /// Returns the largest error of the samples of a single step of size `h`.
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
            // The local error is proportional to h^(order + 1).
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
}

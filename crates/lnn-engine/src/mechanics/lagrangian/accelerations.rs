//! Accelerations at one state after another: a program both computes and solves the sparse system `M a = g - c`.

use super::elimination::{Balance, eliminate};
use super::linearization::{Linearized, Rate, SparseRows};
use super::programs::derivatives;
use super::{EulerLagrange, MechanicsError, Request, Terms};
use crate::lagrangian::thresholds::{MOST_RECORDED_PRODUCTS, MOST_WHOLE_COORDINATES};
use crate::linalg::SMALL_PIVOT;
use crate::platform::OnceLock;
use crate::scalar::{Real, Scalar, are_finite};
use crate::tape::{Program, ROWS, Replay, Tracer};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::sync::atomic::{AtomicBool, Ordering};

/// Records the equations of motion of a model for a traced state and traced parameters.
pub(super) trait RecordMotion<S>: Debug + Send + Sync {
    /// Records the equations; returns `None` if they are too large.
    fn record<'t>(&self, state: &[Tracer<'t, S>], parameters: &[Tracer<'t, S>]) -> Option<Balance<Tracer<'t, S>>>;

    /// Records the derivatives of right side minus left side by the state, at fixed accelerations and multipliers; `x` contains `q`, `v`,
    /// `a`, `lambda`. Returns `None` if they are too large or unknown.
    fn record_slopes<'t>(
        &self,
        _x: &[Tracer<'t, S>],
        _parameters: &[Tracer<'t, S>],
    ) -> Option<SparseRows<Tracer<'t, S>>> {
        None
    }

    /// Largest number of coordinates for which the linearization has a separate program.
    fn linearized_up_to(&self) -> usize {
        0
    }
}

/// A program that computes the accelerations, including the elimination along the pattern of the mass matrix.
///
/// A positive definite matrix needs no pivoting, even when it is bordered by constraints. Whether it is positive definite at a state shows
/// in the pivots, which follow the accelerations among the outputs.
#[derive(Clone, Debug)]
pub struct Solved<'a, S> {
    /// The recorded equations of motion, for models that add terms to them.
    motion: Arc<dyn RecordMotion<S>>,
    program: Arc<Program<S>>,
    parameters: Vec<S>,
    /// Number of pairs of a pivot and its original diagonal element.
    pivots: usize,
    /// The program of the linearization, recorded on first use.
    linearized: Arc<OnceLock<Option<Linearized<S>>>>,
    /// When this flag is raised, every call fails.
    flag: Option<&'a AtomicBool>,
}

impl<'a, S: Scalar> Solved<'a, S> {
    /// Makes these accelerations fail once a flag is raised.
    pub(super) fn until(self, flag: &'a AtomicBool) -> Self {
        Self { flag: Some(flag), ..self }
    }

    /// Makes these accelerations fail once the flag of another one is raised.
    pub(super) fn with_flag_of(self, other: Self) -> Self {
        Self { flag: other.flag, ..self }
    }

    /// Returns the recorded equations of motion and the values of their parameters.
    pub(super) fn motion(&self) -> (&Arc<dyn RecordMotion<S>>, &[S]) {
        (&self.motion, &self.parameters)
    }

    /// Returns `true` once the flag is raised.
    pub(super) fn is_interrupted(&self) -> bool {
        self.flag.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Returns the program of the linearization; `None` if separate programs are faster, or if it cannot be recorded.
    pub(super) fn linearized(&self) -> Option<Linearized<S>> {
        let n = self.program.inputs() / 2;
        self.linearized.get_or_init(|| Linearized::record(self.motion.as_ref(), n, &self.parameters)).clone()
    }
}

impl<S: Scalar> Solved<'static, S> {
    /// Records the accelerations of `n` coordinates with an elimination of at most `most` products; returns `None` if it needs more.
    pub(super) fn record(motion: Arc<dyn RecordMotion<S>>, n: usize, parameters: &[S], most: usize) -> Option<Self> {
        let mut pivots = 0;
        let program = Program::record_within(ROWS, (2 * n, parameters.len()), |x, p| {
            let balance = motion.record(x, p)?;
            let is_diagonal = balance.lower.iter().all(|row| row.len() == 1);
            let (mut outputs, guards) = eliminate(balance, most)?;
            outputs.truncate(n);
            // A diagonal matrix can be solved whatever the signs of its elements.
            if !is_diagonal {
                pivots = guards.len();
                outputs.extend(guards.into_iter().flatten());
            }
            Some(outputs)
        });
        let (program, parameters) = (Arc::new(program.ok()?), parameters.to_vec());
        Some(Self { motion, program, parameters, pivots, linearized: Arc::new(OnceLock::new()), flag: None })
    }

    /// Records the accelerations of a Lagrangian from the program of its value; returns `None` if a dense solver is faster.
    pub(super) fn of_value(value: &Program<S>, parameters: &[S]) -> Option<Self> {
        let (n, most) = (value.inputs() / 2, MOST_RECORDED_PRODUCTS.max(value.lane_operations()));
        Self::record(Arc::new(Value(value.clone())), n, parameters, most)
    }
}

/// The equations of motion of a Lagrangian, from the program of its value.
#[derive(Debug)]
struct Value<S>(Program<S>);

impl<S: Scalar> RecordMotion<S> for Value<S> {
    fn record<'t>(&self, state: &[Tracer<'t, S>], parameters: &[Tracer<'t, S>]) -> Option<Balance<Tracer<'t, S>>> {
        let found = derivatives(&self.0, state, parameters, Request::ACCELERATION)?;
        let right = found.dl_dq.iter().zip(&found.coriolis).map(|(&g, &c)| g - c).collect();
        Some(Balance { coordinates: state.len() / 2, lower: found.mass_matrix, right })
    }

    fn record_slopes<'t>(
        &self,
        x: &[Tracer<'t, S>],
        parameters: &[Tracer<'t, S>],
    ) -> Option<SparseRows<Tracer<'t, S>>> {
        Rate::of_lagrangian(&self.0).ok()?.slopes(x, parameters, &[])
    }

    fn linearized_up_to(&self) -> usize {
        MOST_WHOLE_COORDINATES
    }
}

/// Returns `true` if every pivot of an elimination is positive and not much smaller than the original diagonal element.
pub(super) fn are_safe<S: Scalar>(guards: &[S]) -> bool {
    let (floor, zero) = (S::of_f64(SMALL_PIVOT), <S as Real>::zero());
    let mut safe = true;
    for pair in guards.as_chunks::<2>().0 {
        safe &= pair[1] > floor * pair[0] && pair[1] > zero;
    }
    safe
}

/// Computes the accelerations of a model, state after state or in batches, with preallocated buffers, for use in a solver.
///
/// Only the accelerations are stored, and nothing is allocated after the first call. A sparse mass matrix is eliminated along its pattern,
/// a diagonal one by division, and its constant parts are computed in advance.
///
/// ```
/// use lnn::lagrangian::{Accelerations, Lagrangian, Mechanics, MechanicsError};
/// use lnn::scalar::Real;
///
/// // A thousand unit masses in a line, with springs to their neighbours.
/// struct Line;
/// impl Lagrangian for Line {
///     fn coordinates(&self) -> usize {
///         1000
///     }
///     fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
///         let kinetic = v.iter().fold(R::zero(), |l, v| l + v.sqr() * R::half());
///         q.windows(2).fold(kinetic, |l, q| l - (q[1] - q[0]).sqr() * R::half())
///     }
/// }
/// let line = Mechanics::<_, f64>::new(Line, []);
/// let mut accelerations = Accelerations::new(&line);
/// let (mut q, mut a) = ([0.0; 1000], [0.0; 1000]);
/// q[500] = 1.0;
/// accelerations.at(&q, &[0.0; 1000], &mut a)?;
/// assert_eq!(a[499..502], [1.0, -2.0, 1.0]);
/// # Ok::<(), MechanicsError>(())
/// ```
pub struct Accelerations<'a, S> {
    model: &'a dyn EulerLagrange<S>,
    solved: Option<(Solved<'a, S>, Replay<S>)>,
    pivots: Vec<S>,
    terms: Terms<S>,
}

impl<'a, S: Scalar> Accelerations<'a, S> {
    /// Allocates the buffers for a model.
    pub fn new(model: &'a dyn EulerLagrange<S>) -> Self {
        let solved = model.solved().map(|solved| {
            let replay = Replay::new(Arc::clone(&solved.program));
            (solved, replay)
        });
        Self { model, solved, pivots: Vec::new(), terms: Terms::default() }
    }

    /// Computes the accelerations `a` at states `q`, `v`, all `(batch, n)` in physical units.
    ///
    /// # Errors
    /// Those of [`EulerLagrange::terms`]; a wrong length of `a`.
    pub fn at(&mut self, q: &[S], v: &[S], a: &mut [S]) -> Result<(), MechanicsError> {
        if a.len() != q.len() {
            return Err(MechanicsError::Shape { what: "accelerations", expected: q.len(), found: a.len() });
        }
        if self.solved.as_ref().is_some_and(|(solved, _)| solved.is_interrupted()) {
            return Err(MechanicsError::Interrupted);
        }
        if self.is_solved(q, v, a) {
            return Ok(());
        }
        // The general solver uses pivoting and reports a reason for every row that fails.
        let outcome = self.model.terms(q, v, Request::ACCELERATION, &mut self.terms);
        let found = self.terms.acceleration.len();
        if found == a.len() {
            a.copy_from_slice(&self.terms.acceleration);
        } else if outcome.is_ok() {
            return Err(MechanicsError::Shape { what: "acceleration", expected: a.len(), found });
        }
        outcome
    }

    /// Computes the accelerations with the program; returns `false` if there is no program or a state needs the general solver.
    pub(super) fn is_solved(&mut self, q: &[S], v: &[S], a: &mut [S]) -> bool {
        let Some((solved, replay)) = &mut self.solved else { return false };
        let n = self.model.coordinates();
        let batch = if q.len() == n { 1 } else { q.len() / n.max(1) };
        self.pivots.resize(batch * 2 * solved.pivots, S::nan());
        if replay.evaluate(batch, &[q, v], &solved.parameters, &mut [a, &mut self.pivots]).is_err() {
            return false;
        }
        are_safe(&self.pivots) && are_finite(a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Lagrangian, Mechanics};

    /// Masses in a line whose velocities are coupled to their neighbours': a tridiagonal mass matrix that depends on the position.
    struct Line {
        n: usize,
        sign: f64,
    }

    impl Lagrangian for Line {
        fn coordinates(&self) -> usize {
            self.n
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let own = v.iter().zip(q).fold(R::zero(), |l, (v, q)| l + v.sqr() * (R::one() + q.sqr()));
            let pairs = q.windows(2).zip(v.windows(2));
            let joined =
                pairs.fold(R::zero(), |l, (q, v)| l + v[0] * v[1] * q[0].cos() * R::half() - (q[0] * q[1]).cos());
            R::of(self.sign) * own + joined
        }
    }

    fn states(count: usize) -> (Vec<f64>, Vec<f64>) {
        let number = |k: usize, by: f64| (by * k as f64 + 0.3).sin();
        ((0..count).map(|k| number(k, 0.37)).collect(), (0..count).map(|k| number(k, 0.71)).collect())
    }

    #[test]
    fn accelerations_are_those_of_the_terms() {
        for (n, batch) in [(1, 3), (2, 5), (7, 1), (40, 70), (300, 2)] {
            let model = Mechanics::<_, f64>::new(Line { n, sign: 1.0 }, []);
            let (q, v) = states(n * batch);
            let mut a = vec![0.0; n * batch];
            let mut accelerations = Accelerations::new(&model);
            assert!(accelerations.is_solved(&q, &v, &mut a), "{n}");
            for (a, b) in a.iter().zip(model.acceleration(&q, &v).unwrap()) {
                assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{n}: {a} {b}");
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_gets_a_second_look() {
        let model = Mechanics::<_, f64>::new(Line { n: 8, sign: -1.0 }, []);
        let (q, v) = states(8);
        let mut a = vec![0.0; 8];
        let mut accelerations = Accelerations::new(&model);
        assert!(!accelerations.is_solved(&q, &v, &mut a));
        accelerations.at(&q, &v, &mut a).unwrap();
        assert_eq!(a, model.acceleration(&q, &v).unwrap());
        let singular = Mechanics::<_, f64>::new(Line { n: 8, sign: 0.0 }, []);
        let error = Accelerations::new(&singular).at(&[0.0; 8], &[0.0; 8], &mut a);
        assert_eq!(error.is_err(), singular.acceleration(&[0.0; 8], &[0.0; 8]).is_err());
        assert!(matches!(accelerations.at(&q, &v, &mut a[1..]), Err(MechanicsError::Shape { .. })));
        assert!(accelerations.at(&[f64::NAN; 8], &v, &mut a).is_err());
    }

    #[test]
    fn a_dense_matrix_of_many_coordinates_is_left_to_a_solver() {
        struct Full;
        impl Lagrangian for Full {
            fn coordinates(&self) -> usize {
                30
            }
            fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
                let sum = v.iter().zip(q).fold(R::zero(), |sum, (&v, q)| sum + v * q.cos());
                v.iter().fold(sum.sqr(), |l, v| l + v.sqr())
            }
        }
        let model = Mechanics::<_, f64>::new(Full, []);
        assert!(model.solved().is_none());
        let (q, v) = states(30);
        let mut a = vec![0.0; 30];
        Accelerations::new(&model).at(&q, &v, &mut a).unwrap();
        assert_eq!(a, model.acceleration(&q, &v).unwrap());
    }
}

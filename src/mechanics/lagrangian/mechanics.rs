//! A Lagrangian written by hand, with values for its parameters, as a source of Euler-Lagrange terms.

use super::derivatives::{StateTerms, evaluate};
use super::taylor::Taylor;
use super::{EulerLagrange, Lagrangian, MechanicsError, MetricJet, Request, Terms, metric_jets};
use crate::linalg::Workspace;
use crate::scalar::{AnyFloat, Compiled, Dd, Foreign, Real, Scalar};
use crate::tape::{self, Evaluation, Program, Replay, STATES, TapeError, Tracer};
use std::any::Any;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Batches from this size on are replayed from a recorded program; a chunk of lanes is not worth it below.
const REPLAY_FROM: usize = 24;
/// More coordinates are left to the engine's sweeps, whose cost grows with `n` where second derivatives one by one grow with
/// `n^2`.
const REPLAY_COORDINATES: usize = 4;

/// A Lagrangian and the values of its parameters.
///
/// Of up to four coordinates few states are evaluated one at a time by forward numbers on the stack, and large batches replay a
/// program recorded on first use, its lanes side by side; more coordinates take `n + 3` sweeps of a
/// [`tape::Recorded`] function. All give the same numbers up to rounding. A Lagrangian that branches on its data cannot be
/// recorded and is always evaluated state by state.
#[derive(Debug)]
pub struct Mechanics<L, S> {
    system: L,
    evaluator: Evaluator<S>,
}

/// Code that is compiled for every Lagrangian apart: its terms state by state, and the recording of its value.
trait Form<S>: Send + Sync {
    fn coordinates(&self) -> usize;
    /// Number of parameters, if the Lagrangian says so.
    fn parameter_count(&self) -> Option<usize>;
    /// Fills the needed fields of a batch, which have their sizes.
    fn states(&self, parameters: &[S], q: &[S], v: &[S], need: Request, terms: &mut Terms<S>);
    /// The program whose one output is the value.
    fn value(&self, parameters: usize) -> Result<Program<S>, TapeError>;
}

impl<L: Lagrangian, S: Scalar> Form<S> for L {
    fn coordinates(&self) -> usize {
        Lagrangian::coordinates(self)
    }
    fn parameter_count(&self) -> Option<usize> {
        Lagrangian::parameter_count(self)
    }
    fn states(&self, parameters: &[S], q: &[S], v: &[S], need: Request, terms: &mut Terms<S>) {
        let n = Lagrangian::coordinates(self).max(1);
        for row in 0..q.len() / n {
            let (q, v) = (&q[row * n..][..n], &v[row * n..][..n]);
            let part = |needed: bool, width: usize| if needed { row * width..(row + 1) * width } else { 0..0 };
            let mut state = StateTerms {
                lagrangian: &mut terms.lagrangian[part(need.includes(Request::LAGRANGIAN), 1)],
                momentum: &mut terms.momentum[part(need.includes(Request::MOMENTUM), n)],
                dl_dq: &mut terms.dl_dq[part(need.includes(Request::DL_DQ), n)],
                mass_matrix: &mut terms.mass_matrix[part(need.includes(Request::MASS_MATRIX), n * n)],
                coriolis: &mut terms.coriolis[part(need.includes(Request::CORIOLIS), n)],
            };
            evaluate(self, parameters, q, v, need, &mut state);
        }
    }
    fn value(&self, parameters: usize) -> Result<Program<S>, TapeError> {
        let n = Lagrangian::coordinates(self);
        Program::record(2 * n, parameters, |x, p| vec![self.lagrangian(p, &x[..n], &x[n..])])
    }
}

/// A recorded Lagrangian: its one output is the value.
#[derive(Debug)]
pub(super) struct RecordedValue<S> {
    pub(super) value: Program<S>,
}

impl<S: Scalar> Lagrangian for RecordedValue<S> {
    fn coordinates(&self) -> usize {
        self.value.inputs() / 2
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        let outputs = self.value.interpret(&[q, v].concat(), parameters);
        outputs.map_or_else(|_| R::constant(Scalar::nan()), |outputs| outputs[0])
    }
}

/// Parameters, recorded programs and buffers: everything that does not depend on the type of the Lagrangian.
#[derive(Debug)]
struct Evaluator<S> {
    routines: Routines<S>,
    parameters: Vec<S>,
    /// The program of the value, recorded on first use.
    value: OnceLock<Option<RecordedValue<S>>>,
    /// The value as the engine's sweeps take it.
    engine: OnceLock<Option<Arc<tape::Recorded<S>>>>,
    /// One program per combination of needed terms.
    programs: [OnceLock<Option<Arc<Program<S>>>>; 32],
    /// Buffers not in use; as many as there were callers at a time.
    #[allow(clippy::vec_box)] // They go in and out at every call.
    pool: Mutex<Vec<Box<Scratch<S>>>>,
}

#[derive(Debug, Default)]
struct Scratch<S> {
    workspace: Workspace<S>,
    replays: Vec<(usize, Replay<S>)>,
    evaluation: Option<Evaluation<S>>,
}

impl<L: Lagrangian, S: Scalar> Mechanics<L, S> {
    /// A Lagrangian with parameter values in the order it takes them; another number of them than
    /// [`Lagrangian::parameter_count`] is an error of every call.
    pub fn new(system: L, parameters: impl IntoIterator<Item = S>) -> Self {
        let evaluator = Evaluator {
            routines: Routines::get(),
            parameters: parameters.into_iter().collect(),
            value: OnceLock::new(),
            engine: OnceLock::new(),
            programs: [const { OnceLock::new() }; 32],
            pool: Mutex::new(Vec::new()),
        };
        Self { system, evaluator }
    }
}

impl<S: Scalar> Evaluator<S> {
    /// Refuses parameters of another number than the Lagrangian takes.
    fn require_parameters(&self, form: &dyn Form<S>) -> Result<(), MechanicsError> {
        let found = self.parameters.len();
        match form.parameter_count().filter(|&expected| expected != found) {
            Some(expected) => Err(MechanicsError::Shape { what: "parameters", expected, found }),
            None => Ok(()),
        }
    }

    /// The program of the value, recorded on first use.
    fn value(&self, form: &dyn Form<S>) -> Option<&RecordedValue<S>> {
        let count = self.parameters.len();
        self.value.get_or_init(|| form.value(count).ok().map(|value| RecordedValue { value })).as_ref()
    }

    /// The metric jets of a batch in numbers that are as precise or more so, by the program of the value.
    fn metric_jets<T: Scalar>(
        &self,
        form: &dyn Form<S>,
        q: &[S],
        v: &[S],
    ) -> Result<Vec<MetricJet<T>>, MechanicsError> {
        self.require_parameters(form)?;
        let value = self.value(form).ok_or(MechanicsError::Derivatives { what: "mass matrix" })?;
        let cast = |numbers: &[S]| -> Vec<T> { numbers.iter().map(|x| x.cast()).collect() };
        let parameters: Vec<Taylor<'static, T>> = cast(&self.parameters).into_iter().map(Taylor::constant).collect();
        metric_jets(form.coordinates(), (&cast(q), &cast(v)), |q, v| value.lagrangian(&parameters, q, v))
    }

    /// The program that computes what is needed, recorded on first use.
    fn program(&self, form: &dyn Form<S>, need: Request) -> Option<Arc<Program<S>>> {
        let (value, count) = (self.value(form)?, self.parameters.len());
        let recorded = self.programs[need.index()].get_or_init(|| {
            let n = Lagrangian::coordinates(value);
            let record = Program::record(2 * n, count, |inputs, parameters| {
                record(value, parameters, &inputs[..n], &inputs[n..], need)
            });
            record.ok().map(Arc::new)
        });
        recorded.clone()
    }

    /// Fills the needed fields of a batch by the engine's sweeps; whether that was possible.
    fn sweep(
        &self,
        form: &dyn Form<S>,
        (q, v): (&[S], &[S]),
        need: Request,
        terms: &mut Terms<S>,
        scratch: &mut Scratch<S>,
    ) -> bool {
        let n = form.coordinates();
        let recorded = self.engine.get_or_init(|| {
            let value = self.value(form)?;
            let one = vec![<S as Real>::one(); n];
            let record = tape::Recorded::new(one, self.parameters.len(), |p, q, v| value.lagrangian(p, q, v));
            record.ok().map(Arc::new)
        });
        let Some(recorded) = recorded else { return false };
        let evaluation = scratch.evaluation.get_or_insert_with(|| Evaluation::new(Arc::clone(recorded)));
        for (chunk, (q, v)) in q.chunks(STATES * n).zip(v.chunks(STATES * n)).enumerate() {
            evaluation.evaluate(&self.parameters, q, v, need.depth());
            let fields = [
                (need.includes(Request::LAGRANGIAN), &mut terms.lagrangian, &evaluation.lagrangian, 1),
                (need.includes(Request::MOMENTUM), &mut terms.momentum, &evaluation.momentum, n),
                (need.includes(Request::DL_DQ), &mut terms.dl_dq, &evaluation.dl_dq, n),
                (need.includes(Request::MASS_MATRIX), &mut terms.mass_matrix, &evaluation.mass_matrix, n * n),
                (need.includes(Request::CORIOLIS), &mut terms.coriolis, &evaluation.coriolis, n),
            ];
            for (_, to, from, width) in fields.into_iter().filter(|(needed, ..)| *needed) {
                to[chunk * STATES * width..][..from.len()].copy_from_slice(from);
            }
        }
        true
    }

    /// Fills the needed fields of a batch by replaying a program; whether that was possible.
    fn replay(
        &self,
        form: &dyn Form<S>,
        (q, v): (&[S], &[S]),
        need: Request,
        terms: &mut Terms<S>,
        scratch: &mut Scratch<S>,
    ) -> bool {
        let Some(program) = self.program(form, need) else { return false };
        let (index, replays) = (need.index(), &mut scratch.replays);
        let at = replays.iter().position(|(i, _)| *i == index).unwrap_or_else(|| {
            replays.push((index, Replay::new(program)));
            replays.len() - 1
        });
        // The order of the recording; what is not needed is empty.
        let Terms { lagrangian, momentum, dl_dq, mass_matrix, coriolis, .. } = terms;
        let outputs: &mut [&mut [S]] = &mut [lagrangian, momentum, dl_dq, mass_matrix, coriolis];
        replays[at].1.evaluate(q.len() / form.coordinates(), &[q, v], &self.parameters, outputs).is_ok()
    }

    fn compute(
        &self,
        form: &dyn Form<S>,
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
        scratch: &mut Scratch<S>,
    ) -> Result<(), MechanicsError> {
        self.require_parameters(form)?;
        let n = form.coordinates();
        let batch = q.len() / n.max(1);
        let shape = |what, found| MechanicsError::Shape { what, expected: batch * n, found };
        if q.len() != batch * n {
            return Err(shape("coordinates", q.len()));
        }
        if v.len() != q.len() {
            return Err(shape("velocities", v.len()));
        }
        for field in [&mut terms.force, &mut terms.dissipation, &mut terms.acceleration, &mut terms.energy] {
            field.clear();
        }
        terms.clear_constraints();
        // Whatever is needed is overwritten below.
        let size = |needed: bool, width: usize| if needed { batch * width } else { 0 };
        terms.lagrangian.resize(size(request.includes(Request::LAGRANGIAN), 1), S::nan());
        terms.momentum.resize(size(request.includes(Request::MOMENTUM), n), S::nan());
        terms.dl_dq.resize(size(request.includes(Request::DL_DQ), n), S::nan());
        terms.mass_matrix.resize(size(request.includes(Request::MASS_MATRIX), n * n), S::nan());
        terms.coriolis.resize(size(request.includes(Request::CORIOLIS), n), S::nan());
        let done = match (n > REPLAY_COORDINATES, batch >= REPLAY_FROM) {
            (true, _) => self.sweep(form, (q, v), request, terms, scratch),
            (false, large) => large && self.replay(form, (q, v), request, terms, scratch),
        };
        if !done {
            form.states(&self.parameters, q, v, request, terms);
        }
        terms.complete(n, v, request, &mut scratch.workspace)
    }

    fn terms(
        &self,
        form: &dyn Form<S>,
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        let pooled = || self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = pooled().pop().unwrap_or_default();
        let outcome = self.compute(form, q, v, request, terms, &mut scratch);
        pooled().push(scratch);
        outcome
    }
}

/// The needed terms of one state, one after the other.
fn record<'t, S: Scalar>(
    system: &RecordedValue<S>,
    parameters: &[Tracer<'t, S>],
    q: &[Tracer<'t, S>],
    v: &[Tracer<'t, S>],
    need: Request,
) -> Vec<Tracer<'t, S>> {
    let n = q.len();
    let field = |needed: bool, width: usize| vec![Tracer::zero(); if needed { width } else { 0 }];
    let mut fields = [
        field(need.includes(Request::LAGRANGIAN), 1),
        field(need.includes(Request::MOMENTUM), n),
        field(need.includes(Request::DL_DQ), n),
        field(need.includes(Request::MASS_MATRIX), n * n),
        field(need.includes(Request::CORIOLIS), n),
    ];
    let [lagrangian, momentum, dl_dq, mass_matrix, coriolis] = &mut fields;
    evaluate(system, parameters, q, v, need, &mut StateTerms { lagrangian, momentum, dl_dq, mass_matrix, coriolis });
    fields.concat()
}

/// The code of an [`Evaluator`], which this crate compiles once for each scalar: a crate with a Lagrangian of its own compiles the code of
/// that Lagrangian alone.
#[derive(Clone, Copy, Debug)]
struct Routines<S> {
    terms: TermsOf<S>,
    metric_jets: JetsOf<S, S>,
    wide_metric_jets: JetsOf<S, Dd>,
}

type TermsOf<S> = fn(&Evaluator<S>, &dyn Form<S>, &[S], &[S], Request, &mut Terms<S>) -> Result<(), MechanicsError>;
type JetsOf<S, T> = fn(&Evaluator<S>, &dyn Form<S>, &[S], &[S]) -> Result<Vec<MetricJet<T>>, MechanicsError>;

impl<S: Scalar> Routines<S> {
    const ALL: Self =
        Self { terms: Evaluator::terms, metric_jets: Evaluator::metric_jets, wide_metric_jets: Evaluator::metric_jets };

    fn get() -> Self {
        *S::routines().downcast_ref().expect("every scalar holds its own routines")
    }
}

macro_rules! compiled {
    ($($scalar:ty)*) => {$(
        impl Compiled for $scalar {
            // Inlined elsewhere it would take the routines along.
            #[inline(never)]
            fn routines() -> &'static dyn Any {
                &Routines::<Self>::ALL
            }
        }
    )*};
}
compiled!(f32 f64 Dd);

impl<F: Foreign> Compiled for AnyFloat<F> {
    fn routines() -> &'static dyn Any {
        &Routines::<Self>::ALL
    }
}

impl<L: Lagrangian, S: Scalar> EulerLagrange<S> for Mechanics<L, S> {
    fn coordinates(&self) -> usize {
        Lagrangian::coordinates(&self.system)
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        (self.evaluator.routines.terms)(&self.evaluator, &self.system, q, v, request, terms)
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        (self.evaluator.routines.metric_jets)(&self.evaluator, &self.system, q, v)
    }

    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        let worth = S::epsilon().to_f64() > Dd::epsilon().to_f64()
            && Lagrangian::coordinates(&self.system) <= REPLAY_COORDINATES;
        worth.then(|| (self.evaluator.routines.wide_metric_jets)(&self.evaluator, &self.system, q, v)).transpose()
    }
}

//! A Lagrangian written by hand, with values of its parameters, as a source of Euler-Lagrange terms.

use super::derivatives::{StateTerms, evaluate};
use super::linearization::{ProgramSlopes, Rate, SlopePrograms};
use super::programs::program_of_terms;
use super::taylor::Taylor;
use super::{
    EulerLagrange, Lagrangian, MechanicsError, MetricJet, Pattern, Request, Slopes, Solved, Terms, metric_jets,
};
use crate::lagrangian::thresholds::{LEAST_REPLAYED_STATES, STACK_COORDINATES, WIDE_COORDINATES};
use crate::linalg::Workspace;
use crate::platform::{Mutex, OnceLock, lock};
use crate::scalar::{Dd, Real, Scalar, compiled};
use crate::tape::{self, Evaluation, Program, Replay, STATES, TapeError};
use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// A Lagrangian and the values of its parameters.
///
/// A few states of up to two coordinates are evaluated with forward-mode numbers on the stack. Everything else replays a sparse program of
/// the derivatives, recorded on first use, for single states or several at a time. If that program would be too large, with some hundreds
/// of coupled coordinates, `n + 3` sweeps of a [`tape::Recorded`] function replace it. All methods agree up to rounding. A Lagrangian that
/// branches on its data cannot be recorded and is always evaluated state by state.
#[derive(Debug)]
pub struct Mechanics<L, S> {
    system: L,
    evaluator: Evaluator<S>,
}

/// The code that is compiled for each Lagrangian: its terms state by state, and the recording of its value.
trait Form<S>: Send + Sync {
    fn coordinates(&self) -> usize;
    /// Returns the number of parameters, if the Lagrangian states it.
    fn parameter_count(&self) -> Option<usize>;
    /// Fills the needed fields of a batch, which already have the right sizes.
    fn states(&self, parameters: &[S], q: &[S], v: &[S], need: Request, terms: &mut Terms<S>);
    /// Records a program whose only output is the value.
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

/// A recorded Lagrangian, whose only output is the value.
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
    /// The value as a recorded function, for the sweeps of the engine.
    engine: OnceLock<Option<Arc<tape::Recorded<S>>>>,
    /// One program per combination of needed terms.
    programs: [OnceLock<Option<Arc<Program<S>>>>; 32],
    /// The program of the accelerations alone.
    solved: OnceLock<Option<Solved<'static, S>>>,
    /// The programs of the derivatives of the equations of motion.
    slopes: OnceLock<Option<SlopePrograms<S>>>,
    /// Buffers that are not in use; at most as many as there were simultaneous callers.
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
    /// Combines a Lagrangian with values of its parameters, in its order. If their number differs from [`Lagrangian::parameter_count`],
    /// every call returns an error.
    pub fn new(system: L, parameters: impl IntoIterator<Item = S>) -> Self {
        let evaluator = Evaluator {
            routines: Routines::get(),
            parameters: parameters.into_iter().collect(),
            value: OnceLock::new(),
            engine: OnceLock::new(),
            programs: [const { OnceLock::new() }; 32],
            solved: OnceLock::new(),
            slopes: OnceLock::new(),
            pool: Mutex::new(Vec::new()),
        };
        Self { system, evaluator }
    }
}

impl<S: Scalar> Evaluator<S> {
    /// Rejects a wrong number of parameters.
    fn require_parameters(&self, form: &dyn Form<S>) -> Result<(), MechanicsError> {
        let found = self.parameters.len();
        match form.parameter_count().filter(|&expected| expected != found) {
            Some(expected) => Err(MechanicsError::Shape { what: "parameters", expected, found }),
            None => Ok(()),
        }
    }

    /// Returns the program of the value, recorded on first use.
    fn value(&self, form: &dyn Form<S>) -> Option<&RecordedValue<S>> {
        let count = self.parameters.len();
        self.value.get_or_init(|| form.value(count).ok().map(|value| RecordedValue { value })).as_ref()
    }

    /// Computes the metric jets of a batch in the same or a higher precision, from the program of the value.
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

    /// Returns the program of the needed terms, recorded on first use.
    fn program(&self, form: &dyn Form<S>, need: Request) -> Option<Arc<Program<S>>> {
        let value = self.value(form)?;
        let recorded = self.programs[need.index()].get_or_init(|| program_of_terms(&value.value, need).map(Arc::new));
        recorded.clone()
    }

    /// Returns the program of the accelerations alone, recorded on first use.
    fn solved(&self, form: &dyn Form<S>) -> Option<Solved<'static, S>> {
        self.require_parameters(form).ok()?;
        let record = || Solved::of_value(&self.value(form)?.value, &self.parameters);
        self.solved.get_or_init(record).clone()
    }

    /// Returns the pattern of the second derivatives.
    fn pattern(&self, form: &dyn Form<S>) -> Option<Pattern> {
        self.require_parameters(form).ok()?;
        Pattern::of(&self.value(form)?.value)
    }

    /// Returns the derivatives of the equations of motion, as programs that are recorded on first use.
    fn slopes(&self, form: &dyn Form<S>) -> Option<Box<dyn Slopes<S>>> {
        self.require_parameters(form).ok()?;
        let record = || SlopePrograms::of(&Rate::of_lagrangian(&self.value(form)?.value).ok()?);
        let programs = self.slopes.get_or_init(record).clone()?;
        Some(Box::new(ProgramSlopes::new(programs, &self.parameters)))
    }

    /// Fills the needed fields of a batch with sweeps of the engine; returns `false` if that is not possible.
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

    /// Fills the needed fields of a batch by replaying a program; returns `false` if that is not possible.
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
        // The outputs in the order of the recording; fields that are not needed are empty.
        let mut outputs = terms.derivatives_mut().map(Vec::as_mut_slice);
        replays[at].1.evaluate(q.len() / form.coordinates(), &[q, v], &self.parameters, &mut outputs).is_ok()
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
        terms.make_room(n, batch, request);
        let done = (n > STACK_COORDINATES || batch >= LEAST_REPLAYED_STATES)
            && (self.replay(form, (q, v), request, terms, scratch)
                || self.sweep(form, (q, v), request, terms, scratch));
        if !done {
            form.states(&self.parameters, q, v, request, terms);
        }
        let outcome = terms.complete(n, v, request, &mut scratch.workspace);
        if !done || !matches!(outcome, Err(MechanicsError::NotFinite { .. })) {
            return outcome;
        }
        self.refine(form, (q, v), request, terms);
        terms.complete(n, v, request, &mut scratch.workspace)
    }

    /// Repeats the evaluation of rows that are not finite with forward-mode numbers, which treat an infinite derivative in a direction of
    /// no change as zero.
    #[cold]
    fn refine(&self, form: &dyn Form<S>, (q, v): (&[S], &[S]), request: Request, terms: &mut Terms<S>) {
        let n = form.coordinates();
        let failed = terms.failures.iter().filter(|failure| matches!(failure, MechanicsError::NotFinite { .. }));
        let rows: Vec<usize> = failed.filter_map(MechanicsError::row).collect();
        let mut one = Terms::default();
        one.make_room(n, 1, request);
        for row in rows {
            form.states(&self.parameters, &q[row * n..][..n], &v[row * n..][..n], request, &mut one);
            for (all, one) in terms.derivatives_mut().into_iter().zip(one.derivatives_mut()) {
                all.iter_mut().skip(row * one.len()).zip(one).for_each(|(to, from)| *to = *from);
            }
        }
    }

    fn terms(
        &self,
        form: &dyn Form<S>,
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        let pooled = || lock(&self.pool);
        let mut scratch = pooled().pop().unwrap_or_default();
        let outcome = self.compute(form, q, v, request, terms, &mut scratch);
        pooled().push(scratch);
        outcome
    }
}

impl<S: Scalar> Terms<S> {
    /// Returns the fields for derivatives of `L`, in the order of the programs.
    fn derivatives_mut(&mut self) -> [&mut Vec<S>; 5] {
        let Self { lagrangian, momentum, dl_dq, mass_matrix, coriolis, .. } = self;
        [lagrangian, momentum, dl_dq, mass_matrix, coriolis]
    }

    /// Resizes the requested fields, whose contents will be overwritten.
    fn make_room(&mut self, n: usize, batch: usize, request: Request) {
        let needs = [
            (Request::LAGRANGIAN, 1),
            (Request::MOMENTUM, n),
            (Request::DL_DQ, n),
            (Request::MASS_MATRIX, n * n),
            (Request::CORIOLIS, n),
        ];
        for (field, (need, width)) in self.derivatives_mut().into_iter().zip(needs) {
            field.resize(if request.includes(need) { batch * width } else { 0 }, S::nan());
        }
    }
}

/// The code of an [`Evaluator`], compiled in this crate once for each scalar type, so that a crate that defines a Lagrangian only compiles
/// the code of that Lagrangian.
#[derive(Clone, Copy, Debug)]
struct Routines<S> {
    terms: TermsOf<S>,
    solved: SolvedOf<S>,
    slopes: SlopesOf<S>,
    pattern: PatternOf<S>,
    metric_jets: JetsOf<S, S>,
    wide_metric_jets: JetsOf<S, Dd>,
}

type TermsOf<S> = fn(&Evaluator<S>, &dyn Form<S>, &[S], &[S], Request, &mut Terms<S>) -> Result<(), MechanicsError>;
type SolvedOf<S> = fn(&Evaluator<S>, &dyn Form<S>) -> Option<Solved<'static, S>>;
type PatternOf<S> = fn(&Evaluator<S>, &dyn Form<S>) -> Option<Pattern>;
type SlopesOf<S> = fn(&Evaluator<S>, &dyn Form<S>) -> Option<Box<dyn Slopes<S>>>;
type JetsOf<S, T> = fn(&Evaluator<S>, &dyn Form<S>, &[S], &[S]) -> Result<Vec<MetricJet<T>>, MechanicsError>;

impl<S: Scalar> Routines<S> {
    const ALL: Self = Self {
        terms: Evaluator::terms,
        solved: Evaluator::solved,
        slopes: Evaluator::slopes,
        pattern: Evaluator::pattern,
        metric_jets: Evaluator::metric_jets,
        wide_metric_jets: Evaluator::metric_jets,
    };
}

compiled!(Lagrangians, Routines);

impl<L: Lagrangian, S: Scalar> EulerLagrange<S> for Mechanics<L, S> {
    fn coordinates(&self) -> usize {
        Lagrangian::coordinates(&self.system)
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        (self.evaluator.routines.terms)(&self.evaluator, &self.system, q, v, request, terms)
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        (self.evaluator.routines.solved)(&self.evaluator, &self.system)
    }

    fn pattern(&self) -> Option<Pattern> {
        (self.evaluator.routines.pattern)(&self.evaluator, &self.system)
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        (self.evaluator.routines.slopes)(&self.evaluator, &self.system)
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        (self.evaluator.routines.metric_jets)(&self.evaluator, &self.system, q, v)
    }

    fn wide_metric_jets(&self, q: &[S], v: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        let worth =
            S::epsilon().to_f64() > Dd::epsilon().to_f64() && Lagrangian::coordinates(&self.system) <= WIDE_COORDINATES;
        worth.then(|| (self.evaluator.routines.wide_metric_jets)(&self.evaluator, &self.system, q, v)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of `n` pendula in absolute angles, with a spring whose stiffness depends on a branch, and a product similar to a damper.
    struct Chain(usize);

    impl Lagrangian for Chain {
        fn coordinates(&self) -> usize {
            self.0
        }
        fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
            let (mut x, mut y, mut l) = (R::zero(), R::zero(), R::zero());
            for i in 0..q.len() {
                let (sin, cos) = q[i].sin_cos();
                (x, y) = (x + v[i] * cos, y + v[i] * sin);
                l += (x.sqr() + y * y) * R::half() + p[0] * cos / (R::two() + q[i].sqr()) - (v[i] / R::of(9.0)).powi(4);
                l += q[i].select(q[i].sqr(), q[i].exp()) * v[0].atan2(R::of(3.0)) - (q[i] * v[i]).tanh().abs();
            }
            l
        }
    }

    fn states(n: usize, batch: usize) -> (Vec<f64>, Vec<f64>) {
        let number = |k: usize, by: f64| (by * k as f64 + 0.3).sin();
        ((0..n * batch).map(|k| number(k, 0.37)).collect(), (0..n * batch).map(|k| 2.0 * number(k, 0.71)).collect())
    }

    #[test]
    fn programs_sweeps_and_forward_numbers_agree() {
        let close = |a: &[f64], b: &[f64]| {
            assert_eq!(a.len(), b.len());
            a.iter().zip(b).for_each(|(a, b)| assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "{a} {b}"));
        };
        for n in [1, 2, 3, 5, 9] {
            let model = Mechanics::<_, f64>::new(Chain(n), [9.8]);
            let (q, v) = states(n, 75);
            let request =
                Request::LAGRANGIAN | Request::MOMENTUM | Request::DL_DQ | Request::MASS_MATRIX | Request::CORIOLIS;
            let (mut program, mut sweep, mut forward) = (Terms::default(), Terms::default(), Terms::default());
            model.terms(&q, &v, request, &mut program).unwrap();
            sweep.clone_from(&program);
            forward.clone_from(&program);
            let evaluator = &model.evaluator;
            assert!(evaluator.program(&model.system, request).is_some());
            assert!(evaluator.sweep(&model.system, (&q, &v), request, &mut sweep, &mut Scratch::default()));
            model.system.states(&evaluator.parameters, &q, &v, request, &mut forward);
            for other in [&sweep, &forward] {
                close(&program.lagrangian, &other.lagrangian);
                close(&program.momentum, &other.momentum);
                close(&program.dl_dq, &other.dl_dq);
                close(&program.mass_matrix, &other.mass_matrix);
                close(&program.coriolis, &other.coriolis);
            }
        }
    }

    #[test]
    fn what_is_not_asked_for_is_not_computed() {
        let model = Mechanics::<_, f64>::new(Chain(6), [9.8]);
        let operations = |need: Request| model.evaluator.program(&model.system, need).unwrap().lane_operations();
        let all = operations(Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ);
        assert!(operations(Request::MASS_MATRIX) < all && operations(Request::DL_DQ) < all);
        assert!(operations(Request::LAGRANGIAN) < operations(Request::DL_DQ));
    }

    /// A Lagrangian with an infinite second derivative by a velocity on which nothing depends.
    struct Sliding;

    impl Lagrangian for Sliding {
        fn coordinates(&self) -> usize {
            3
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let kinetic = v.iter().fold(R::zero(), |l, v| l + v.sqr());
            kinetic - (q[0] + v[0]).max(R::zero()).powf(R::of(1.5)) - q[1]
        }
    }

    #[test]
    fn infinite_derivatives_that_nothing_needs_are_none() {
        let model = Mechanics::<_, f64>::new(Sliding, []);
        let a = model.acceleration(&[-1.0, 0.0, 0.0], &[0.5, 0.0, 0.0]);
        assert_eq!(a, Ok(vec![0.0, -0.5, 0.0]));
    }

    /// Pendula in absolute angles computed with running sums, as in `benches/hessians.rs`.
    struct Plain(usize);

    impl Lagrangian for Plain {
        fn coordinates(&self) -> usize {
            self.0
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let (mut x, mut y, mut height, mut l) = (R::zero(), R::zero(), R::zero(), R::zero());
            for (&q, &v) in q.iter().zip(v) {
                let (sin, cos) = q.sin_cos();
                (x, y, height) = (x + v * cos, y + v * sin, height + cos);
                l += (x.sqr() + y.sqr()) * R::half() + height * R::of(9.8);
            }
            l
        }
    }

    #[test]
    fn operations_of_a_chain_grow_with_the_square_of_its_length() {
        let terms = Request::MASS_MATRIX | Request::CORIOLIS | Request::DL_DQ;
        for (n, operations, of_slopes) in [(8, 408, 1685), (16, 1132, 5925), (32, 3540, 22085), (64, 12196, 85125)] {
            let model = Mechanics::<_, f64>::new(Plain(n), []);
            let program = model.evaluator.program(&model.system, terms).unwrap();
            assert!(program.lane_operations() <= operations, "{n}: {}", program.lane_operations());
            let value = model.evaluator.value(&model.system).unwrap();
            let slopes = SlopePrograms::of(&Rate::of_lagrangian(&value.value).unwrap()).unwrap();
            assert!(slopes.operations() <= of_slopes, "{n}: {}", slopes.operations());
        }
    }

    /// Different masses with springs between neighbours.
    struct Lattice;

    impl Lagrangian for Lattice {
        fn coordinates(&self) -> usize {
            100
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let kinetic = v.iter().enumerate().fold(R::zero(), |l, (i, v)| l + v.sqr() * R::of(1.0 + i as f64));
            q.windows(2).fold(kinetic, |l, q| l - (q[1] - q[0]).sqr().sqr())
        }
    }

    #[test]
    fn zeros_and_constants_take_no_operations() {
        let model = Mechanics::<_, f64>::new(Lattice, []);
        let program = model.evaluator.program(&model.system, Request::MASS_MATRIX | Request::CORIOLIS).unwrap();
        // The mass matrix is diagonal and constant, and no term of L couples coordinates and velocities.
        assert_eq!(program.lane_operations(), 0);
        let (q, v) = states(100, 1);
        let mass = model.mass_matrix(&q, &v).unwrap();
        for (k, &m) in mass.iter().enumerate() {
            assert_eq!(m, if k % 101 == 0 { 2.0 * (1.0 + (k / 101) as f64) } else { 0.0 });
        }
    }
}

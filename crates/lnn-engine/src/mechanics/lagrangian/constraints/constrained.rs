//! A model with constraints.

use super::equations::evaluate;
use super::programs::{RecordedRows, RowPrograms, Under, most_products};
use super::projection::project;
use super::rows::independent;
use super::{Constraints, Manifold, ManifoldRows, RowAdjoint};
use crate::forward::{Dual, HyperDual};
use crate::lagrangian::linearization::{ProgramSlopes, Rate, SlopePrograms, Sum};
use crate::lagrangian::thresholds::REDUNDANT_ROW;
use crate::lagrangian::{EulerLagrange, MechanicsError, MetricJet, Request, Slopes, Solved, Terms};
use crate::platform::OnceLock;
use crate::scalar::{Dd, Real, Scalar};
use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The reason why constraints leave no motion.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ConstraintError {
    /// No state satisfies all constraints.
    Contradiction {
        /// The most violated constraint.
        name: String,
        /// Its violation, in units of the coordinates; not finite if the constraint is finite at no state.
        defect: f64,
    },
    /// There are as many independent rows as coordinates.
    TooMany {
        /// Number of independent rows.
        independent: usize,
        /// Number of coordinates.
        coordinates: usize,
    },
    /// The constraints are for another number of coordinates or parameters.
    Shape {
        /// The quantity whose number is wrong.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number found.
        found: usize,
    },
}

impl core::fmt::Display for ConstraintError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Contradiction { name, defect } if defect.is_finite() => {
                write!(f, "constraint `{name}` contradicts the others: the nearest states miss it by {defect:.3e}")
            }
            Self::Contradiction { name, .. } => {
                write!(f, "constraint `{name}` is not finite at any of the states that were tried")
            }
            Self::TooMany { independent, coordinates } => write!(
                f,
                "{independent} independent constraints leave {coordinates} coordinates no motion, expected fewer"
            ),
            Self::Shape { what, expected, found } => write!(f, "{what}: expected {expected}, found {found}"),
        }
    }
}

impl core::error::Error for ConstraintError {}

/// A model with constraints: `M a = g - c + Q + A^T lambda`, `A a = -gamma`, for any Lagrangian, written by hand or learned.
///
/// [`Terms::multipliers`] and [`Terms::constraint_force`] contain the effect of the constraints. `M` may be singular in directions that the
/// constraints exclude. Energy, momenta and mass matrix are those of the inner model.
///
/// ```
/// use lnn::lagrangian::{Constrained, Constraints, EulerLagrange, ExpressionLagrangian, Mechanics, Request, Terms};
/// use lnn::scalar::Real;
///
/// struct Rod; // of length parameters[0]
/// impl Constraints for Rod {
///     fn coordinates(&self) -> usize { 2 }
///     fn names(&self) -> Vec<String> { vec!["rod".into()] }
///     fn is_holonomic(&self, _: usize) -> bool { true }
///     fn values<R: Real>(&self, p: &[R], q: &[R], _: &[R], values: &mut [R]) {
///         values[0] = (q[0].sqr() + q[1].sqr() - p[0].sqr()) * R::half();
///     }
/// }
///
/// let bob = ExpressionLagrangian::new(&["x", "y"], &["m", "g"], "m*(x_dot^2 + y_dot^2)/2 - m*g*y")?;
/// let pendulum = Constrained::new(Mechanics::new(bob, [2.0, 9.81]), Rod, [1.0])?;
/// let mut terms = Terms::default();
/// pendulum.terms(&[0.0, -1.0], &[3.0, 0.0], Request::ACCELERATION, &mut terms)?; // at the lowest point, 3 m/s
/// assert!((terms.acceleration[1] - 9.0).abs() < 1e-12); // v^2/l upwards
/// assert!((terms.constraint_force[1] - 2.0 * (9.81 + 9.0)).abs() < 1e-12); // the rod carries weight and centrifugal force
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Constrained<M, C, S> {
    model: M,
    constraints: C,
    parameters: Vec<S>,
    /// `true` if the constraints use the parameters of the inner model.
    shared: bool,
    /// Number of rows of `constraints`; `kept` lists the active ones.
    rows: usize,
    kept: Vec<usize>,
    names: Vec<String>,
    redundant: Vec<String>,
    /// Programs of the active rows and of the accelerations, recorded on first use.
    programs: OnceLock<Option<Arc<RowPrograms<S>>>>,
    solved: OnceLock<Option<Solved<'static, S>>>,
}

impl<M: EulerLagrange<S>, C: Constraints, S: Scalar> Constrained<M, C, S> {
    /// Applies all constraints to a model. The constraints have separate parameters.
    ///
    /// # Errors
    /// [`ConstraintError::Shape`] for another number of coordinates or parameters; [`ConstraintError::TooMany`] if no motion is left.
    pub fn new(model: M, constraints: C, parameters: impl IntoIterator<Item = S>) -> Result<Self, ConstraintError> {
        let (parameters, names): (Vec<S>, _) = (parameters.into_iter().collect(), constraints.names());
        let n = model.coordinates();
        let expected = constraints.parameter_count().unwrap_or(parameters.len());
        for (what, expected, found) in [
            ("coordinates of the constraints", n, constraints.coordinates()),
            ("parameters of the constraints", expected, parameters.len()),
        ] {
            if expected != found {
                return Err(ConstraintError::Shape { what, expected, found });
            }
        }
        let rows = names.len();
        Ok(Self {
            model,
            constraints,
            parameters,
            shared: false,
            rows,
            kept: (0..rows).collect(),
            names,
            redundant: Vec::new(),
            programs: OnceLock::new(),
            solved: OnceLock::new(),
        })
    }

    /// Lets the constraints use the parameters of the inner model, in the same order.
    pub(crate) fn with_parameters_of_model(self) -> Self {
        Self { shared: true, ..self }
    }

    /// Keeps only these rows.
    pub(crate) fn only(mut self, kept: Vec<usize>) -> Self {
        self.names = kept.iter().map(|&row| self.names[row].clone()).collect();
        self.kept = kept;
        self
    }

    /// Removes the constraints that depend on earlier ones at all given states. The states, `(batch, n)` each, are first projected onto the
    /// constraints.
    ///
    /// # Errors
    /// [`ConstraintError::Contradiction`] if no state can be projected, [`ConstraintError::TooMany`] if no motion is left.
    pub fn independent(mut self, q: &[S], v: &[S]) -> Result<Self, ConstraintError> {
        let n = self.model.coordinates().max(1);
        let (mut needed, mut nearest): (Vec<usize>, Option<super::OffManifold>) = (Vec::new(), None);
        let (mut found, mut rows) = (false, ManifoldRows::default());
        for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
            let (mut q, mut v) = (q.to_vec(), v.to_vec());
            match project(&self, &mut q, &mut v) {
                Ok(_) => {
                    found = true;
                    self.rows(&q, &v, &mut rows);
                    needed.extend(independent(n, &rows.matrix, REDUNDANT_ROW).0);
                }
                Err(off) => {
                    if nearest.is_none_or(|best| best.defect.is_nan() || off.defect < best.defect) {
                        nearest = Some(off);
                    }
                }
            }
        }
        if let (false, Some(off)) = (found, nearest) {
            let name = self.names[off.row].clone();
            return Err(ConstraintError::Contradiction { name, defect: off.defect });
        }
        needed.sort_unstable();
        needed.dedup();
        if needed.len() >= n {
            return Err(ConstraintError::TooMany { independent: needed.len(), coordinates: n });
        }
        if found {
            let all = core::mem::take(&mut self.names);
            for (row, name) in all.into_iter().enumerate() {
                if needed.contains(&row) { &mut self.names } else { &mut self.redundant }.push(name);
            }
            // Programs recorded for other rows cannot be used.
            if self.kept != needed {
                (self.programs, self.solved) = (OnceLock::new(), OnceLock::new());
            }
            self.kept = needed;
        }
        Ok(self)
    }
}

impl<M: EulerLagrange<S>, C: Constraints, S: Scalar> Manifold<S> for Constrained<M, C, S> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }
    fn names(&self) -> &[String] {
        &self.names
    }
    fn redundant(&self) -> &[String] {
        &self.redundant
    }
    fn is_holonomic(&self, row: usize) -> bool {
        self.constraints.is_holonomic(self.kept[row])
    }

    fn rows(&self, q: &[S], v: &[S], rows: &mut ManifoldRows<S>) {
        evaluate(&self.constraints, (self.rows, &self.kept), &self.parameters, (q, v), rows);
    }

    fn programs(&self) -> Option<&RowPrograms<S>> {
        let record = || {
            let rows = RecordedRows::record(&self.constraints, (self.rows, &self.kept), &self.parameters)?;
            let holonomic = self.kept.iter().map(|&row| self.constraints.is_holonomic(row)).collect();
            Some(Arc::new(RowPrograms::new(rows, holonomic)))
        };
        self.programs.get_or_init(record).as_deref()
    }

    fn rate_gradients(&self, q: &[S], v: &[S], gradients: &mut Vec<S>) {
        let (n, zero, one) = (q.len(), <S as Real>::zero(), <S as Real>::one());
        gradients.clear();
        gradients.resize(self.kept.len() * n, zero);
        let lift = |x: &S| HyperDual::lift(*x);
        let parameters: Vec<_> = self.parameters.iter().map(lift).collect();
        let (mut moved, v): (Vec<_>, Vec<_>) =
            (q.iter().zip(v).map(|(&q, &v)| HyperDual::new(q, v, zero, zero)).collect(), v.iter().map(lift).collect());
        let mut values = vec![lift(&zero); self.rows];
        for i in 0..n {
            moved[i].t = one;
            self.constraints.values(&parameters, &moved, &v, &mut values);
            moved[i].t = zero;
            for (k, &row) in self.kept.iter().enumerate() {
                let found = values[row];
                gradients[k * n + i] = if self.constraints.is_holonomic(row) { found.st } else { found.t };
            }
        }
    }

    fn pull_back(&self, (q, v): (&[S], &[S]), along: RowAdjoint<'_, S>, (dq, dv): (&mut [S], &mut [S])) {
        let (n, zero, one) = (q.len(), <S as Real>::zero(), <S as Real>::one());
        let none = Dual::lift(zero);
        let lift = |x: &S| HyperDual::lift(Dual::lift(*x));
        let parameters: Vec<_> = self.parameters.iter().map(lift).collect();
        let mut values = vec![lift(&zero); self.rows];
        // The inner dual number carries the direction of the derivative.
        let number = |x: &[S], i: usize, at: Option<usize>| Dual {
            value: x[i],
            tangent: if at == Some(i) { one } else { zero },
        };
        let still = |x: &[S], i: usize| Dual::lift(x[i]);
        let mut sum = |q: &[HyperDual<Dual<S>>], v: &[HyperDual<Dual<S>>], weights: &[S], rate: bool| {
            self.constraints.values(&parameters, q, v, &mut values);
            self.kept.iter().zip(weights).fold(zero, |sum, (&row, &weight)| {
                let found = values[row];
                let of = match (self.constraints.is_holonomic(row), rate) {
                    (true, true) => found.st,
                    (true, false) | (false, true) => found.s,
                    (false, false) => found.t,
                };
                sum + weight * of.tangent
            })
        };
        for i in 0..2 * n {
            let (by_q, by_v) = if i < n { (Some(i), None) } else { (None, Some(i - n)) };
            // A a + gamma: for a function, its second derivative along the motion; for a velocity row, its first derivative.
            let motion_q: Vec<_> = (0..n)
                .map(|k| {
                    let speed = number(v, k, by_v);
                    HyperDual::new(number(q, k, by_q), speed, speed, still(along.a, k))
                })
                .collect();
            let motion_v: Vec<_> =
                (0..n).map(|k| HyperDual::new(number(v, k, by_v), still(along.a, k), none, none)).collect();
            let by = -sum(&motion_q, &motion_v, along.pull, true);
            if i >= n {
                dv[i - n] += by;
                continue;
            }
            // A x: for a function, its derivative by the coordinates along x; for a velocity row, that by the velocities.
            let moved_q: Vec<_> =
                (0..n).map(|k| HyperDual::new(number(q, k, by_q), still(along.x, k), none, none)).collect();
            let moved_v: Vec<_> = (0..n).map(|k| HyperDual::new(still(v, k), none, still(along.x, k), none)).collect();
            dq[i] += by + sum(&moved_q, &moved_v, along.load, false);
        }
    }
}

impl<M: EulerLagrange<S>, C: Constraints, S: Scalar> EulerLagrange<S> for Constrained<M, C, S> {
    fn coordinates(&self) -> usize {
        self.model.coordinates()
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        self.terms_at(&[], q, v, request, terms)
    }

    fn terms_at(
        &self,
        t: &[S],
        q: &[S],
        v: &[S],
        request: Request,
        terms: &mut Terms<S>,
    ) -> Result<(), MechanicsError> {
        let outcome = self.model.terms_at(t, q, v, request.without_solution(), terms);
        let n = self.model.coordinates();
        let found = terms.drain_failures(outcome)?;
        if terms.constraints > 0 {
            let (what, expected) = ("constraints of the model beneath", 0);
            return Err(MechanicsError::Shape { what, expected, found: terms.constraints });
        }
        if request.includes(Request::CONSTRAINTS) {
            let mut rows = ManifoldRows::default();
            terms.constraints = self.kept.len();
            for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
                self.rows(q, v, &mut rows);
                terms.constraint_matrix.extend_from_slice(&rows.matrix);
                terms.constraint_drift.extend_from_slice(&rows.drift);
            }
        }
        terms.complete_beside(found, n, v, request)
    }

    fn inner(&self) -> Option<&dyn EulerLagrange<S>> {
        Some(&self.model)
    }

    fn manifold(&self) -> Option<&dyn Manifold<S>> {
        Some(self)
    }

    fn solved(&self) -> Option<Solved<'_, S>> {
        let alone = self.model.solved()?;
        let record = || {
            let (n, rows) = (self.model.coordinates(), Arc::clone(self.programs()?.rows()));
            let (beneath, parameters) = alone.motion();
            let under = Under { beneath: Arc::clone(beneath), rows };
            Solved::record(Arc::new(under), n, parameters, most_products(n + self.kept.len()))
        };
        Some(self.solved.get_or_init(record).clone()?.with_flag_of(alone))
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        let rows = (self.rows, &self.kept[..]);
        let rate = Rate::of_constraints(&self.constraints, rows, &self.parameters, self.shared).ok()?;
        let programs = SlopePrograms::of(&rate)?;
        let parameters = if self.shared { &self.parameters[..] } else { &[] };
        Some(Box::new(Sum(self.model.slopes()?, Box::new(ProgramSlopes::new(programs, parameters)))))
    }

    /// Always fails, because the mass matrix is no metric on the constrained space.
    fn metric_jets(&self, _: &[S], _: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        Err(MechanicsError::Derivatives { what: "mass matrix under constraints" })
    }

    fn wide_metric_jets(&self, _: &[S], _: &[S]) -> Result<Option<Vec<MetricJet<Dd>>>, MechanicsError> {
        Ok(None)
    }
}

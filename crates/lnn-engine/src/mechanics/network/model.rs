//! A trained network as a mechanical system in physical units.

use super::slopes::NetworkSlopes;
use crate::lagrangian::{
    EulerLagrange, Lagrangian, MechanicsError, MetricJet, Pattern, Request, Slopes, Taylor, Terms, metric_jets,
};
use crate::linalg;
use crate::network::{Architecture, Dynamics, Form, Layout, Model};
use crate::platform::{Mutex, lock};
use crate::scalar::{Real, Scalar, compiled};
use crate::tape::{Depth, Program, STATES};
use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// A network with its weights: `L(q, v)`, an optional dissipation `D(q, v)`, and the terms computed from them.
///
/// The network works in scaled coordinates `q_i/s_i`, `v_i/s_i`. Terms are returned in physical units, but `L` in the network's own unit,
/// since a factor and a total derivative of `L` do not change the motion. Periodic coordinates are reduced to `[0, 2 pi)` before the
/// network.
#[derive(Debug)]
pub struct NetworkLagrangian<S> {
    architecture: Architecture,
    weights: Vec<S>,
    model: Model<S>,
    /// Workspaces that are currently not in use.
    idle: Mutex<Vec<Workspace<S>>>,
    routines: Routines<S>,
}

/// What is computed of networks, as function pointers: it is compiled once for each scalar, so that no crate that creates, loads or calls a
/// network compiles it again.
#[derive(Clone, Copy, Debug)]
struct Routines<S> {
    model: ModelOf<S>,
    terms: TermsOf<S>,
    metric_jets: JetsOf<S>,
    slopes: SlopesOf<S>,
    pattern: PatternOf<S>,
}

type ModelOf<S> = fn(&Architecture) -> Model<S>;
type TermsOf<S> = fn(&NetworkLagrangian<S>, &[S], &[S], Request, &mut Terms<S>) -> Result<(), MechanicsError>;
type PatternOf<S> = fn(&NetworkLagrangian<S>) -> Option<Pattern>;
type SlopesOf<S> = for<'a> fn(&'a NetworkLagrangian<S>) -> Box<dyn Slopes<S> + 'a>;
type JetsOf<S> = fn(&NetworkLagrangian<S>, &[S], &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError>;

#[derive(Debug)]
struct Workspace<S> {
    dynamics: Dynamics<S>,
    wrapped: Vec<S>,
    linalg: linalg::Workspace<S>,
}

/// The reason why weights do not define a network.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NetworkError {
    /// A list of the architecture has the wrong length, or there is no coordinate or hidden layer.
    Architecture(String),
    /// There are too few or too many weights.
    Weights {
        /// Number of parameters of the architecture.
        expected: usize,
        /// Number of given weights.
        found: usize,
    },
}

impl core::fmt::Display for NetworkError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Architecture(problem) => write!(f, "architecture: {problem}"),
            Self::Weights { expected, found } => write!(f, "weights: expected {expected} numbers, found {found}"),
        }
    }
}

impl core::error::Error for NetworkError {}

impl Architecture {
    /// Checks that the lists have matching lengths, nothing is empty and all numbers are finite.
    ///
    /// # Errors
    /// The first mismatch, in words.
    pub fn validate(&self) -> Result<(), NetworkError> {
        let n = self.coordinates;
        let fault = |text: String| Err(NetworkError::Architecture(text));
        if n == 0 {
            return fault("expected at least one coordinate".to_string());
        }
        if self.hidden.is_empty() || self.hidden.contains(&0) {
            return fault(format!("expected hidden layers of positive width, found {:?}", self.hidden));
        }
        let branches = self.activation.branches().len();
        if let Some(width) = self.hidden.iter().find(|w| !w.is_multiple_of(branches)) {
            let name = self.activation;
            return fault(format!("expected widths that {name} can cut into {branches} equal parts, found {width}"));
        }
        if self.periodic.len() != n || self.scale.len() != n {
            let (scales, flags) = (self.scale.len(), self.periodic.len());
            return fault(format!("expected {n} scales and periodic flags, found {scales} and {flags}"));
        }
        if let Some(scale) = self.scale.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
            return fault(format!("expected positive scales, found {scale}"));
        }
        if self.dissipation == Some(0) {
            return fault("expected a dissipation of at least one unit, found 0".to_string());
        }
        if !self.alpha.is_finite() {
            return fault(format!("expected a finite alpha, found {}", self.alpha));
        }
        if let Some(time) = self.time_like.filter(|&time| time >= n) {
            return fault(format!("expected a time-like coordinate below {n}, found {time}"));
        }
        let Form { cyclic, .. } = &self.form;
        if let Some(i) = cyclic.iter().find(|&&i| i >= n) {
            return fault(format!("expected cyclic coordinates below {n}, found {i}"));
        }
        let mut grouped: Vec<usize> = self.form.radial.iter().flat_map(|group| group.coordinates.clone()).collect();
        grouped.sort_unstable();
        let free = |i: usize| i < n && !self.periodic[i] && !cyclic.contains(&i);
        if grouped.windows(2).any(|pair| pair[0] == pair[1]) || !grouped.iter().all(|&i| free(i)) {
            return fault(format!(
                "expected radial coordinates below {n}, each once, no angles, not cyclic, found {grouped:?}"
            ));
        }
        if let Some(group) = self.form.radial.iter().find(|group| !(group.unit.is_finite() && group.unit > 0.0)) {
            return fault(format!("expected a positive unit of radial coordinates, found {}", group.unit));
        }
        if let Some(known) = &self.form.known {
            let described = crate::network::recorded::system(known, n);
            described.map_err(|problem| NetworkError::Architecture(format!("known: {problem}")))?;
        }
        self.form.check(n, self.time_like).map_err(NetworkError::Architecture)?;
        Ok(())
    }

    /// Returns `true` if there is any friction.
    pub fn has_friction(&self) -> bool {
        let known = self.form.known.as_ref().is_some_and(|known| known.dissipation.is_some());
        known || self.dissipation.is_some() || !self.form.joint_friction.is_none()
    }
    /// Returns the number of outputs of the network.
    pub(crate) fn outputs(&self) -> usize {
        self.form.outputs(self.coordinates, self.time_like.is_some())
    }
    /// Returns the name and initial values of the parameters outside the network.
    pub(crate) fn own_constants(&self) -> Option<(&'static str, Vec<f64>)> {
        self.form.constants(self.coordinates, self.alpha)
    }
    /// Returns the nonzero initial biases of a structure, with their indices.
    pub(crate) fn initial_biases(&self) -> Vec<(usize, f64)> {
        self.form.initial_biases(self.coordinates, self.time_like.is_some())
    }
}

impl<S: Scalar> NetworkLagrangian<S> {
    /// Creates a network of this shape with these flat parameters (see [`Layout`]).
    ///
    /// # Errors
    /// [`NetworkError`] if the architecture is inconsistent or the number of weights is wrong.
    pub fn new(architecture: Architecture, weights: Vec<S>) -> Result<Self, NetworkError> {
        architecture.validate()?;
        let expected = Layout::new(&architecture).parameters;
        if weights.len() != expected {
            return Err(NetworkError::Weights { expected, found: weights.len() });
        }
        Ok(Self::of_valid(architecture, weights))
    }

    fn of_valid(architecture: Architecture, weights: Vec<S>) -> Self {
        let routines = Routines::get();
        let (model, idle) = ((routines.model)(&architecture), Mutex::new(Vec::new()));
        Self { architecture, weights, model, idle, routines }
    }

    /// Returns the shape of the network.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }
    /// Returns the flat parameters.
    pub fn weights(&self) -> &[S] {
        &self.weights
    }
    /// Converts this network to another precision.
    pub fn cast<T: Scalar>(&self) -> NetworkLagrangian<T> {
        let weights = self.weights.iter().map(|&w| w.cast()).collect();
        NetworkLagrangian::of_valid(self.architecture.clone(), weights)
    }

    /// Returns the recorded functions.
    pub(super) fn model(&self) -> &Model<S> {
        &self.model
    }

    /// Finds the pattern with the smallest network of the same form, because widths do not affect which elements are zero.
    fn find_pattern(&self) -> Option<Pattern> {
        let Architecture { hidden, activation, coordinates: n, .. } = &self.architecture;
        let width = 2 * activation.branches().len();
        let small = Architecture { hidden: vec![width; hidden.len().min(2)], ..self.architecture.clone() };
        let parameters = Layout::new(&small).parameters;
        let value = Program::<S>::record(2 * n, parameters, |x, p| vec![small.lagrangian(p, &x[..*n], &x[*n..])]);
        Pattern::of(&value.ok()?)
    }

    fn new_slopes(&self) -> Box<dyn Slopes<S> + '_> {
        Box::new(NetworkSlopes::new(self))
    }

    fn evaluate_terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        let n = self.architecture.coordinates;
        let shape = |what, expected, found| Err(MechanicsError::Shape { what, expected, found });
        if !q.len().is_multiple_of(n) {
            return shape("coordinates", q.len().next_multiple_of(n), q.len());
        }
        if v.len() != q.len() {
            return shape("velocities", q.len(), v.len());
        }
        terms.clear();
        let mut workspace = lock(&self.idle).pop().unwrap_or_else(|| Workspace::new(&self.model));
        let depth = request.depth();
        for states in q.chunks(STATES * n).zip(v.chunks(STATES * n)) {
            workspace.append(self, states, (request, depth), terms);
        }
        let outcome = terms.complete(n, v, request, &mut workspace.linalg);
        lock(&self.idle).push(workspace);
        outcome
    }

    fn evaluate_metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        let weights: Vec<Taylor<'static, S>> = self.weights.iter().map(|&w| Taylor::constant(w)).collect();
        let mut wrapped = q.to_vec();
        self.model.wrap(&mut wrapped);
        let n = self.architecture.coordinates;
        metric_jets(n, (&wrapped, v), |q, v| self.architecture.lagrangian(&weights, q, v))
    }
}

impl<S: Scalar> Routines<S> {
    const ALL: Self = Self {
        model: Architecture::record,
        terms: NetworkLagrangian::evaluate_terms,
        metric_jets: NetworkLagrangian::evaluate_metric_jets,
        slopes: NetworkLagrangian::new_slopes,
        pattern: NetworkLagrangian::find_pattern,
    };
}

compiled!(Networks, Routines, "model-files");

impl Architecture {
    /// Records the functions of a network of this shape.
    ///
    /// # Panics
    /// If the architecture is inconsistent (see [`Architecture::validate`]).
    #[doc(hidden)]
    pub fn model<S: Scalar>(&self) -> Model<S> {
        (Routines::get().model)(self)
    }
}

impl<S: Scalar> Workspace<S> {
    fn new(model: &Model<S>) -> Self {
        Self { dynamics: Dynamics::new(model), wrapped: Vec::new(), linalg: linalg::Workspace::new() }
    }

    /// Evaluates one chunk and appends its terms in physical units.
    fn append(
        &mut self,
        network: &NetworkLagrangian<S>,
        (q, v): (&[S], &[S]),
        (request, depth): (Request, Depth),
        terms: &mut Terms<S>,
    ) {
        let (scale, n) = (network.model.scale(), network.model.coordinates());
        let forces = request.includes(Request::FORCE);
        self.wrapped.clear();
        self.wrapped.extend_from_slice(q);
        network.model.wrap(&mut self.wrapped);
        self.dynamics.evaluate(&network.weights, &self.wrapped, v, depth, forces);
        let evaluation = self.dynamics.lagrangian();
        let unscale =
            |from: &[S], to: &mut Vec<S>| to.extend(from.iter().enumerate().map(|(k, &x)| x * scale[k % n].recip()));
        if request.includes(Request::LAGRANGIAN) {
            terms.lagrangian.extend_from_slice(&evaluation.lagrangian);
        }
        if request.includes(Request::MOMENTUM) {
            unscale(&evaluation.momentum, &mut terms.momentum);
        }
        if request.includes(Request::DL_DQ) {
            unscale(&evaluation.dl_dq, &mut terms.dl_dq);
        }
        if request.includes(Request::CORIOLIS) {
            unscale(&evaluation.coriolis, &mut terms.coriolis);
        }
        if request.includes(Request::MASS_MATRIX) {
            let element = |(k, &m): (usize, &S)| m * (scale[k / n % n].recip() * scale[k % n].recip());
            terms.mass_matrix.extend(evaluation.mass_matrix.iter().enumerate().map(element));
        }
        if let Some(friction) = self.dynamics.friction().filter(|_| forces) {
            let first = terms.force.len();
            unscale(friction, &mut terms.force);
            terms.force[first..].iter_mut().for_each(|force| *force = -*force);
            terms.dissipation.extend_from_slice(self.dynamics.power());
        }
    }
}

impl<S: Scalar> EulerLagrange<S> for NetworkLagrangian<S> {
    fn coordinates(&self) -> usize {
        self.architecture.coordinates
    }

    fn terms(&self, q: &[S], v: &[S], request: Request, terms: &mut Terms<S>) -> Result<(), MechanicsError> {
        (self.routines.terms)(self, q, v, request, terms)
    }

    fn metric_jets(&self, q: &[S], v: &[S]) -> Result<Vec<MetricJet<S>>, MechanicsError> {
        (self.routines.metric_jets)(self, q, v)
    }

    fn pattern(&self) -> Option<Pattern> {
        (self.routines.pattern)(self)
    }

    fn slopes(&self) -> Option<Box<dyn Slopes<S> + '_>> {
        Some((self.routines.slopes)(self))
    }

    fn conserves_energy(&self) -> bool {
        !self.architecture.has_friction()
    }

    /// Returns `true` from about 200,000 weights on, when loading them for a single state takes longer than the synchronization of threads.
    fn prefers_batches(&self) -> bool {
        self.weights.len() >= 200_000
    }
}

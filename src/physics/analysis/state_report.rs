//! The Euler-Lagrange terms of states, or the forces on them, by name and with all digits.

use super::thresholds::{METRIC_ROUNDINGS, MOST_SHOWN_PARAMETERS};
use crate::digits::{number, object, quoted, tensor};
use crate::lagrangian::{
    EulerLagrange, Linearizer, ManifoldRows, MechanicsError, ReducedMass, Request, Terms, force_parts_by_rows,
    inverse_dynamics_by_rows,
};
use crate::linalg::{Workspace, eigenvalues};
use crate::scalar::{Real, Scalar};

/// The named quantities of a state.
pub struct StateReport<S> {
    /// Number of coordinates.
    n: usize,
    quantities: Vec<Quantity<S>>,
    /// The reason why quantities are missing, if any are.
    pub problem: Option<String>,
}

/// A name, and a number, a vector or the rows of a matrix by rank 0, 1 or 2.
struct Quantity<S> {
    name: &'static str,
    numbers: Vec<S>,
    rank: usize,
}

impl<S: Scalar> StateReport<S> {
    fn new(n: usize, problem: Option<String>) -> Self {
        Self { n, quantities: Vec::new(), problem }
    }

    fn add(&mut self, name: &'static str, numbers: Vec<S>, rank: usize) {
        self.quantities.push(Quantity { name, numbers, rank });
    }

    /// Adds the part of state `k` of a batch with `size` numbers for each; nothing if the batch is empty.
    fn add_part(&mut self, name: &'static str, k: usize, batch: &[S], (size, rank): (usize, usize)) {
        self.add(name, batch.get(k * size..(k + 1) * size).unwrap_or(&[]).to_vec(), rank);
    }

    /// Names and values in JSON; a quantity that the problem prevents is `null`.
    fn fields(&self) -> impl Iterator<Item = (&'static str, String)> {
        let fields = self.quantities.iter().map(|Quantity { name, numbers, rank }| {
            let is_lost = self.problem.is_some() && numbers.iter().any(|x| !x.is_finite());
            let is_missing = is_lost || numbers.is_empty();
            (*name, if is_missing { "null".to_string() } else { tensor(numbers, self.n, *rank) })
        });
        fields.chain(self.problem.as_deref().map(|problem| ("error", quoted(problem))))
    }

    /// One object on a line of JSON.
    pub fn json(&self) -> String {
        object(self.fields())
    }

    /// A line for every quantity below a heading.
    pub fn text(&self, heading: &str) -> String {
        let fields: Vec<(&str, String)> = self.fields().collect();
        let width = fields.iter().map(|(name, _)| name.len() + 1).fold(13, usize::max);
        let lines: String = fields.iter().map(|(name, text)| format!("  {name:<width$}{text}\n")).collect();
        format!("{heading}\n{lines}")
    }

    /// The external forces as a line of CSV, after the time if it is given; `nan` for numbers that are not finite.
    pub fn external_forces(&self, time: Option<S>) -> String {
        let forces = self.quantities.iter().filter(|quantity| quantity.name == EXTERNAL);
        let numbers = time.into_iter().chain(forces.flat_map(|quantity| quantity.numbers.iter().copied()));
        let texts = numbers.map(|x| if x.is_finite() { number(x) } else { "nan".to_string() });
        texts.collect::<Vec<_>>().join(",") + "\n"
    }
}

/// Name of the external forces.
const EXTERNAL: &str = "external_force";

/// Computes the reports of states in batches.
pub struct StateReporter<'a, S: Scalar> {
    model: &'a dyn EulerLagrange<S>,
    linearizer: Option<Linearizer<'a, S>>,
    factor: Option<S>,
    terms: Terms<S>,
}

impl<'a, S: Scalar> StateReporter<'a, S> {
    /// Reports all terms of a model, if requested with the derivatives of its accelerations; `factor` is that of its canonical form.
    pub fn new(model: &'a dyn EulerLagrange<S>, linearize: bool, factor: Option<S>) -> Self {
        Self { model, linearizer: linearize.then(|| Linearizer::new(model)), factor, terms: Terms::default() }
    }

    /// The reports of states `(b, n)`, at their times if the model depends on the time.
    ///
    /// # Errors
    /// Those that concern the whole batch; the problem of a single state is in its report.
    pub fn terms(&mut self, q: &[S], v: &[S], times: &[S]) -> Result<Vec<StateReport<S>>, MechanicsError> {
        let (n, mut terms) = (self.model.coordinates(), std::mem::take(&mut self.terms));
        let outcome = match times {
            [] => self.model.terms(q, v, Request::ALL, &mut terms),
            _ => self.model.terms_at(times, q, v, Request::ALL, &mut terms),
        };
        let failures = terms.drain_failures(outcome)?;
        let spectrum = spectrum(n, &terms.mass_matrix);
        let squares = squares((n, v), &terms, &spectrum);
        let states = q.chunks_exact(n).zip(v.chunks_exact(n)).zip(self.problems(&failures, q.len() / n)).enumerate();
        let reports = states.map(|(k, ((q, v), problem))| {
            let mut report = StateReport::new(n, problem);
            report.add_terms(k, &terms, &spectrum);
            report.add_constraints(self.model, k, (q, v), &terms);
            if let Some(factor) = self.factor {
                report.add("canonical_factor", vec![factor], 0);
            }
            if !squares.is_empty() {
                report.add_part("g(v, v)", k, &squares, (1, 0));
            }
            if let Some(linearizer) = &mut self.linearizer {
                report.add_slopes(linearizer, q, v);
            }
            report
        });
        let reports = reports.collect();
        self.terms = terms;
        Ok(reports)
    }

    /// The forces that cause accelerations: `[q, v, a]` are `(b, n)` each, `drives` the coordinates on which external forces act, all if
    /// empty, and `times` those of the states or empty. With `parts`, the forces of inertia, Coriolis and gravity are also reported.
    ///
    /// # Errors
    /// Those that concern the whole batch; the problem of a single state is in its report.
    pub fn forces(
        &self,
        drives: &[usize],
        [q, v, a]: [&[S]; 3],
        times: &[S],
        parts: bool,
    ) -> Result<Vec<StateReport<S>>, MechanicsError> {
        let n = self.model.coordinates();
        let (forces, failures) = inverse_dynamics_by_rows(self.model, drives, [q, v, a], times)?;
        let parts = if parts { Some(force_parts_by_rows(self.model, [q, v, a], times)?.0) } else { None };
        let constraints = forces.multipliers.len() * n / forces.external.len().max(1);
        let reports = self.problems(&failures, q.len() / n).enumerate().map(|(k, problem)| {
            let mut report = StateReport::new(n, problem);
            report.add_part("generalized_force", k, &forces.generalized, (n, 1));
            if !forces.friction.is_empty() {
                report.add_part("friction", k, &forces.friction, (n, 1));
            }
            report.add_part(EXTERNAL, k, &forces.external, (n, 1));
            if constraints > 0 {
                report.add_part("constraint_force", k, &forces.constraint, (n, 1));
                report.add_part("multipliers", k, &forces.multipliers, (constraints, 1));
            }
            if let Some(parts) = &parts {
                report.add_part("inertial_force", k, &parts.inertial, (n, 1));
                report.add_part("coriolis_force", k, &parts.coriolis, (n, 1));
                report.add_part("gravity_force", k, &parts.gravity, (n, 1));
            }
            report
        });
        Ok(reports.collect())
    }

    /// For every state, what is wrong with it.
    fn problems(&self, failures: &[MechanicsError], states: usize) -> impl Iterator<Item = Option<String>> + use<S> {
        let names = self.model.manifold().map_or(&[][..], |manifold| manifold.names());
        let mut problems = vec![None; states];
        for failure in failures {
            if let Some(problem) = failure.row().and_then(|row| problems.get_mut(row)) {
                *problem = Some(failure.problem(names));
            }
        }
        problems.into_iter()
    }
}

impl<S: Scalar> StateReport<S> {
    fn add_terms(&mut self, k: usize, terms: &Terms<S>, spectrum: &[S]) {
        let n = self.n;
        let (number, vector) = ((1, 0), (n, 1));
        self.add_part("lagrangian", k, &terms.lagrangian, number);
        self.add_part("momentum", k, &terms.momentum, vector);
        self.add_part("dl_dq", k, &terms.dl_dq, vector);
        self.add_part("mass_matrix", k, &terms.mass_matrix, (n * n, 2));
        self.add_part("eigenvalues", k, spectrum, vector);
        self.add_part("coriolis", k, &terms.coriolis, vector);
        self.add_part("acceleration", k, &terms.acceleration, vector);
        self.add_part("energy", k, &terms.energy, number);
        if !terms.force.is_empty() {
            self.add_part("force", k, &terms.force, vector);
            self.add_part("dissipation", k, &terms.dissipation, number);
        }
        if terms.constraints > 0 {
            self.add_part("multipliers", k, &terms.multipliers, (terms.constraints, 1));
            self.add_part("constraint_force", k, &terms.constraint_force, vector);
        }
    }

    /// The values of `phi(q)` and `A v - b`, the eigenvalues of the mass matrix within the constraints, and the directions within them along
    /// which it vanishes.
    fn add_constraints(&mut self, model: &dyn EulerLagrange<S>, k: usize, (q, v): (&[S], &[S]), terms: &Terms<S>) {
        let (n, m) = (self.n, terms.constraints);
        let mass = &terms.mass_matrix[k * n * n..(k + 1) * n * n];
        let reduced = ReducedMass::of(n, mass, &terms.constraint_matrix[k * m * n..(k + 1) * m * n]).ok();
        let open = reduced.iter().flat_map(|reduced| reduced.null_directions()).flatten().copied();
        let open: Vec<S> = open.collect();
        if m > 0 {
            let mut rows = ManifoldRows::default();
            if let Some(manifold) = model.manifold() {
                manifold.rows(q, v, &mut rows);
            }
            self.add("constraint_values", rows.values, 1);
            self.add("constraint_rates", rows.rates, 1);
            self.add("reduced_eigenvalues", reduced.map_or(Vec::new(), |reduced| reduced.eigenvalues), 1);
        }
        if !open.is_empty() {
            self.add("null_directions", open, 2);
        }
    }

    /// The derivatives of the accelerations; they are missing where there is no acceleration.
    fn add_slopes(&mut self, linearizer: &mut Linearizer<'_, S>, q: &[S], v: &[S]) {
        let (by_state, by_parameters) = slopes(linearizer, q, v).unwrap_or_default();
        let names = ["acceleration_by_q", "acceleration_by_v", "acceleration_by_force"];
        names.into_iter().zip(by_state).for_each(|(name, numbers)| self.add(name, numbers, 2));
        if !by_parameters.is_empty() {
            self.add("acceleration_by_parameters", by_parameters, 2);
        }
    }
}

/// Derivatives of the accelerations by `q`, `v` and force, `(n, n)` each.
type ByState<S> = [Vec<S>; 3];

/// The derivatives of the accelerations of a state, and those by the parameters, `(parameters, n)`, if they are few.
fn slopes<S: Scalar>(
    linearizer: &mut Linearizer<'_, S>,
    q: &[S],
    v: &[S],
) -> Result<(ByState<S>, Vec<S>), MechanicsError> {
    let n = q.len();
    let found = linearizer.at(q, v)?;
    let by_state = [found.by_q.clone(), found.by_v.clone(), found.by_force.clone()];
    let mut by_parameters = Vec::new();
    for i in 0..n {
        let unit: Vec<S> = (0..n).map(|j| S::of_f64(f64::from(u8::from(i == j)))).collect();
        let of_row = &linearizer.gradient(q, v, &unit)?.by_parameters;
        if of_row.len() > MOST_SHOWN_PARAMETERS {
            break;
        }
        by_parameters.resize(of_row.len() * n, S::nan());
        of_row.iter().enumerate().for_each(|(k, &x)| by_parameters[k * n + i] = x);
    }
    Ok((by_state, by_parameters))
}

/// Eigenvalues of a batch of mass matrices, ascending; `NaN` for a matrix that is not finite.
fn spectrum<S: Scalar>(n: usize, matrices: &[S]) -> Vec<S> {
    let mut values = vec![S::nan(); matrices.len() / n];
    // A matrix that fails already has NaN eigenvalues, and its state is reported with its terms.
    let _ = eigenvalues(n, matrices, &mut values, &mut Workspace::new());
    values
}

/// `g(v, v)` of a batch of states, for geodesics of a metric with a time, whose `L` is the energy, `g(v, v)/2`; empty for other models.
fn squares<S: Scalar>((n, v): (usize, &[S]), terms: &Terms<S>, spectrum: &[S]) -> Vec<S> {
    let zero = <S as Real>::zero();
    let rounding = S::of_f64(METRIC_ROUNDINGS) * S::epsilon();
    let values = terms.lagrangian.iter().zip(&terms.energy);
    let is_energy = |(k, (&l, &energy)): (usize, (&S, &S))| {
        let speed = v[k * n..(k + 1) * n].iter().fold(<S as Real>::one(), |sum, &v| sum + v * v);
        let size = terms.mass_matrix[k * n * n..(k + 1) * n * n].iter().fold(zero, |sum, g| sum + g.abs()) * speed;
        let signs = (spectrum[k * n] < zero, spectrum[(k + 1) * n - 1] > zero);
        // States that are not finite are ignored.
        !size.is_finite() || (signs == (true, true) && (l - energy).abs() <= rounding * size)
    };
    let all = terms.force.is_empty() && values.enumerate().all(is_energy);
    if all { terms.energy.iter().map(|&energy| energy + energy).collect() } else { Vec::new() }
}

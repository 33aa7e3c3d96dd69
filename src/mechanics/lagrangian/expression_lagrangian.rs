//! A Lagrangian by its formula.

use super::Lagrangian;
use super::expression::{Compiler, Expression, ExpressionError, Formula, Meaning};
use crate::scalar::Real;
use std::collections::BTreeMap;
use std::sync::Arc;

/// `L(q, v; parameters)` by a formula such as `m*l^2*theta_dot^2/2 + m*g*l*cos(theta)`.
///
/// ```
/// use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, Request, Terms};
///
/// let formula = "l^2*theta_dot^2/2 + g*l*cos(theta)";
/// let pendulum = ExpressionLagrangian::new(&["theta"], &["l", "g"], formula).unwrap();
/// let pendulum = Mechanics::new(pendulum, vec![2.0, 9.8]);
/// let mut terms = Terms::default();
/// pendulum.terms(&[0.5], &[1.0], Request::ALL, &mut terms).unwrap();
/// assert_eq!(format!("{:.6}", terms.acceleration[0]), "-2.349185");
/// ```
#[derive(Clone, Debug)]
pub struct ExpressionLagrangian {
    coordinates: usize,
    parameters: usize,
    value: Arc<Formula>,
}

impl ExpressionLagrangian {
    /// The Lagrangian of a formula over coordinates, their velocities `NAME_dot`, and parameters in the order in which they
    /// will be given.
    ///
    /// # Errors
    /// A mistake in the formula, with its column.
    pub fn new(coordinates: &[&str], parameters: &[&str], formula: &str) -> Result<Self, ExpressionError> {
        let expression: Expression = formula.parse()?;
        let positions = coordinates.iter().enumerate().map(|(i, name)| (name.to_string(), Meaning::Position(i)));
        let velocities = coordinates.iter().enumerate().map(|(i, name)| (format!("{name}_dot"), Meaning::Velocity(i)));
        let count = parameters.len();
        let parameters = parameters.iter().enumerate().map(|(i, name)| (name.to_string(), Meaning::Parameter(i)));
        let scope: BTreeMap<String, Meaning> = parameters.chain(velocities).chain(positions).collect();
        let mut compiler = Compiler::default();
        let value = compiler.add(&expression, &scope, false)?;
        Ok(Self::compiled((coordinates.len(), count), compiler.formula(value)))
    }

    /// The Lagrangian of so many coordinates and parameters whose value is a compiled formula.
    pub(super) fn compiled((coordinates, parameters): (usize, usize), value: Formula) -> Self {
        Self { coordinates, parameters, value: Arc::new(value) }
    }
}

impl Lagrangian for ExpressionLagrangian {
    fn coordinates(&self) -> usize {
        self.coordinates
    }
    fn parameter_count(&self) -> Option<usize> {
        Some(self.parameters)
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        self.value.evaluate(parameters, q, v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{EulerLagrange, Mechanics, MechanicsError, Request, Terms};

    #[test]
    fn another_number_of_parameters_is_an_error_of_every_call() {
        let pendulum = ExpressionLagrangian::new(&["x"], &["l", "g"], "l^2*x_dot^2/2 + g*l*cos(x)").unwrap();
        for found in [0, 1, 3] {
            let pendulum = Mechanics::<_, f64>::new(pendulum.clone(), vec![1.0; found]);
            let refused = MechanicsError::Shape { what: "parameters", expected: 2, found };
            let outcome = pendulum.terms(&[0.5], &[1.0], Request::ALL, &mut Terms::default());
            assert_eq!(outcome, Err(refused));
            assert_eq!(pendulum.metric_jets(&[0.5], &[1.0]).err(), Some(refused));
        }
        let pendulum = Mechanics::<_, f64>::new(pendulum, vec![2.0, 9.8]);
        pendulum.terms(&[0.5], &[1.0], Request::ALL, &mut Terms::default()).unwrap();
    }
}

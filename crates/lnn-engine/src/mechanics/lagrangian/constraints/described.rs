//! Constraints given as formulas.

use super::Constraints;
use crate::lagrangian::expression::{Compiler, Expression, ExpressionError, Formula, Meaning, Value};
use crate::scalar::Real;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Constraints given as formulas that must vanish: functions of the coordinates, or linear in the velocities, such as `x_dot -
/// R*phi_dot*cos(theta)`.
#[derive(Clone, Debug)]
pub struct ExpressionConstraints {
    coordinates: usize,
    parameters: usize,
    rows: Arc<Vec<Row>>,
}

#[derive(Clone, Debug)]
struct Row {
    name: String,
    holonomic: bool,
    value: Formula,
}

impl ExpressionConstraints {
    /// Compiles named formulas of coordinates, velocities `NAME_dot`, and parameters, which are given later in the same order.
    ///
    /// # Errors
    /// The name of a constraint and the error in its formula.
    pub fn new(
        coordinates: &[&str],
        parameters: &[&str],
        formulas: &[(&str, &str)],
    ) -> Result<Self, (String, ExpressionError)> {
        let (mut scope, mut compiler) = (BTreeMap::new(), Compiler::default());
        for (i, name) in parameters.iter().enumerate() {
            scope.insert(name.to_string(), Meaning::Parameter(i));
        }
        for (i, name) in coordinates.iter().enumerate() {
            scope.insert(name.to_string(), Meaning::Position(i));
            scope.insert(format!("{name}_dot"), Meaning::Velocity(i));
        }
        Self::compiled((coordinates.len(), parameters.len()), formulas.iter().copied(), &mut compiler, &scope)
    }

    /// Evaluates the formula of one row, which should vanish.
    pub fn value<R: Real>(&self, row: usize, parameters: &[R], q: &[R], v: &[R]) -> R {
        self.rows[row].value.evaluate(parameters, q, v)
    }

    /// Sorts the rows by `place`, the position of a constraint in the file. If rows are dependent, the later ones are dropped.
    #[must_use]
    pub(crate) fn in_order(&self, place: impl Fn(&str) -> usize) -> Self {
        let mut rows = self.rows.to_vec();
        rows.sort_by_key(|row| place(&row.name));
        Self { rows: Arc::new(rows), ..self.clone() }
    }

    /// Removes the constraints with these names.
    pub(super) fn without(&self, names: &[String]) -> Self {
        let rows = self.rows.iter().filter(|row| !names.contains(&row.name)).cloned().collect();
        Self { rows: Arc::new(rows), ..self.clone() }
    }

    /// Compiles formulas whose names are defined in `scope`.
    pub(in crate::mechanics::lagrangian) fn compiled<'a>(
        (coordinates, parameters): (usize, usize),
        formulas: impl Iterator<Item = (&'a str, &'a str)>,
        compiler: &mut Compiler,
        scope: &BTreeMap<String, Meaning>,
    ) -> Result<Self, (String, ExpressionError)> {
        let mut rows = Vec::new();
        for (name, text) in formulas {
            let mut add = || -> Result<Value, ExpressionError> {
                let expression: Expression = text.parse()?;
                let value = compiler.add(&expression, scope, false)?;
                match compiler.velocity_degree(value) {
                    Some(_) if compiler.is_constant(value) => {
                        Err(ExpressionError::new(1, "expected a coordinate or a velocity in it"))
                    }
                    Some(_) => Ok(value),
                    None => Err(ExpressionError::new(1, "expected a formula linear in the velocities")),
                }
            };
            let value = add().map_err(|error| (name.to_string(), error))?;
            let holonomic = !compiler.moves(value);
            rows.push(Row { name: name.to_string(), holonomic, value: compiler.formula(value) });
        }
        Ok(Self { coordinates, parameters, rows: Arc::new(rows) })
    }
}

impl Constraints for ExpressionConstraints {
    fn coordinates(&self) -> usize {
        self.coordinates
    }
    fn names(&self) -> Vec<String> {
        self.rows.iter().map(|row| row.name.clone()).collect()
    }
    fn is_holonomic(&self, row: usize) -> bool {
        self.rows[row].holonomic
    }
    fn parameter_count(&self) -> Option<usize> {
        Some(self.parameters)
    }
    fn values<R: Real>(&self, parameters: &[R], q: &[R], v: &[R], values: &mut [R]) {
        for (row, value) in values.iter_mut().enumerate().take(self.rows.len()) {
            *value = self.value(row, parameters, q, v);
        }
    }
}

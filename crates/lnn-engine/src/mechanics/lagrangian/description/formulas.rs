//! Compiles the formulas of a description: Lagrangian, dissipation function, forces and constraints.

use super::scope::{Scope, compiled};
use super::{Description, DescriptionError};
use crate::lagrangian::constraints::ExpressionConstraints;
use crate::lagrangian::expression::{Compiler, Value};
use crate::lagrangian::formula_forces::FormulaForces;
use crate::names::unknown;
use alloc::vec::Vec;

impl Description {
    /// Compiles the Lagrangian of the file.
    pub(super) fn written(
        &self,
        text: &str,
        compiler: &mut Compiler,
        scope: &Scope,
    ) -> Result<Value, DescriptionError> {
        let value = compiled(compiler, scope, ("lagrangian", text), false)?;
        let velocities = compiler.velocities(value);
        // Coordinates that follow from constraints need no inertia.
        for (i, coordinate) in self.coordinates.iter().enumerate().filter(|_| self.constraints.is_empty()) {
            if !velocities.contains(&i) {
                let name = &coordinate.name;
                let problem = format!(
                    "expected {name}_dot in it: without a kinetic energy {name} has no acceleration; motion of first \
                     order, as of tanks and circuits, has no Lagrangian here"
                );
                return Err(DescriptionError::new("lagrangian", problem));
            }
        }
        Ok(value)
    }

    /// Compiles the dissipation function, which must depend on a velocity to have an effect.
    pub(super) fn friction(&self, compiler: &mut Compiler, scope: &Scope) -> Result<Option<Value>, DescriptionError> {
        let Some(text) = &self.dissipation else { return Ok(None) };
        let value = compiled(compiler, scope, ("dissipation", text), false)?;
        if compiler.velocities(value).is_empty() {
            return Err(DescriptionError::new("dissipation", "expected a velocity in it, such as theta_dot"));
        }
        Ok(Some(value))
    }

    /// Compiles the generalized forces as functions of the coordinates and parameters.
    pub(super) fn forces(
        &self,
        compiler: &mut Compiler,
        scope: &Scope,
        size: (usize, usize),
    ) -> Result<Option<FormulaForces>, DescriptionError> {
        let mut formulas = Vec::new();
        let scope = &self.with_inputs(scope)?;
        for (name, text) in &self.forces {
            let key = format!("forces.{name}");
            let names = || self.coordinates.iter().map(|c| c.name.as_str());
            let place = names().position(|known| known == name);
            let place = place
                .ok_or_else(|| DescriptionError::new(&key, unknown("coordinate", name, names().collect::<Vec<_>>())))?;
            let value = compiled(compiler, scope, (&key, text), false)?;
            formulas.push((place, compiler.formula(value)));
        }
        Ok((!formulas.is_empty()).then(|| FormulaForces::compiled(size, formulas)))
    }

    /// Compiles the constraints.
    pub(super) fn constraints(
        &self,
        compiler: &mut Compiler,
        scope: &Scope,
    ) -> Result<Option<ExpressionConstraints>, DescriptionError> {
        if self.constraints.is_empty() {
            return Ok(None);
        }
        for name in self.constraints.keys() {
            if name.is_empty() || name.chars().count() > 100 || name.chars().any(char::is_control) {
                return Err(DescriptionError::new("constraints", "expected names of 1 to 100 characters on one line"));
            }
        }
        if !self.time_is_taken()
            && let Some((name, _)) = self.constraints.iter().find(|(_, text)| self.names_time(text))
        {
            let problem = "expected a formula without the time `t`: put what moves by a known law into the Lagrangian";
            return Err(DescriptionError::new(format!("constraints.{name}"), problem));
        }
        let size = (self.coordinates.len(), self.parameters.len());
        let formulas = self.constraints.iter().map(|(name, text)| (name.as_str(), text.as_str()));
        let line = |name: &str| self.constraint_lines.0.get(name).copied().unwrap_or(usize::MAX);
        let compiled = ExpressionConstraints::compiled(size, formulas, compiler, scope).map(|rows| rows.in_order(line));
        let place = |(name, error)| DescriptionError::new(format!("constraints.{name}"), error);
        compiled.map(Some).map_err(place)
    }
}

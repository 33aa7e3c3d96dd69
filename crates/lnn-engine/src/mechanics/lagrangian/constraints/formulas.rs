//! Constraints by name and formula, as a fit finds or reads them and a model file stores them.

use super::{Constrained, ConstraintError, ExpressionConstraints, Manifold};
use crate::lagrangian::expression::{is_name, is_reserved};
use crate::lagrangian::thresholds::MOST_NAMES;
use crate::lagrangian::{EulerLagrange, ExpressionError, Lagrangian, Mechanics};
use crate::scalar::{Real, Scalar};
use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// Constraints as formulas of the coordinates and velocities of a model, without parameters.
#[derive(Clone, Debug)]
pub struct FormulaConstraints {
    formulas: BTreeMap<String, String>,
    compiled: ExpressionConstraints,
}

/// The reason why formulas cannot constrain a model.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum ConstraintFormulaError {
    /// There is no formula, or there are too many.
    Number(usize),
    /// The name of a constraint cannot be printed in a message.
    Name,
    /// The name of a coordinate cannot be used in a formula.
    Coordinate(String),
    /// A formula contains an error.
    Formula {
        /// Name of the constraint.
        name: String,
        /// The error.
        error: ExpressionError,
    },
    /// The constraints contradict each other or leave no motion.
    Constraints(ConstraintError),
}

impl core::fmt::Display for ConstraintFormulaError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Number(found) => write!(f, "constraints: expected 1 to {MOST_NAMES} formulas, found {found}"),
            Self::Name => f.write_str("constraints: expected names of 1 to 100 characters on one line"),
            Self::Coordinate(name) => write!(
                f,
                "constraints: the coordinate {name:?} cannot be a name in a formula: expected a letter or _, then letters, digits and _"
            ),
            Self::Formula { name, error } => write!(f, "constraints.{name}: {error}"),
            Self::Constraints(error) => write!(f, "constraints: {error}"),
        }
    }
}

impl core::error::Error for ConstraintFormulaError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Constraints(error) => Some(error),
            _ => None,
        }
    }
}

impl From<ConstraintError> for ConstraintFormulaError {
    fn from(error: ConstraintError) -> Self {
        Self::Constraints(error)
    }
}

/// A free point in space, used as the model of constraints before there is a Lagrangian.
pub(super) struct Free(pub usize);

impl Lagrangian for Free {
    fn coordinates(&self) -> usize {
        self.0
    }
    fn lagrangian<R: Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
        v.iter().fold(R::zero(), |sum, v| sum + v.sqr())
    }
}

impl FormulaConstraints {
    /// Compiles the formulas that must vanish, by the name of their constraint, in terms of coordinates `NAME` and velocities `NAME_dot`.
    ///
    /// # Errors
    /// [`ConstraintFormulaError`].
    pub fn new(
        coordinates: &[impl AsRef<str>],
        formulas: BTreeMap<String, String>,
    ) -> Result<Self, ConstraintFormulaError> {
        if formulas.is_empty() || formulas.len() > MOST_NAMES {
            return Err(ConstraintFormulaError::Number(formulas.len()));
        }
        if formulas
            .keys()
            .any(|name| name.is_empty() || name.chars().count() > 100 || name.chars().any(char::is_control))
        {
            return Err(ConstraintFormulaError::Name);
        }
        let names: Vec<&str> = coordinates.iter().map(AsRef::as_ref).collect();
        if let Some(name) = names.iter().find(|name| !is_name(name) || is_reserved(name)) {
            return Err(ConstraintFormulaError::Coordinate(name.to_string()));
        }
        let rows: Vec<(&str, &str)> =
            formulas.iter().map(|(name, formula)| (name.as_str(), formula.as_str())).collect();
        let compiled = ExpressionConstraints::new(&names, &[], &rows)
            .map_err(|(name, error)| ConstraintFormulaError::Formula { name, error })?;
        Ok(Self { formulas, compiled })
    }

    /// Sorts the constraints by `place`, their position in the file.
    #[must_use]
    pub fn in_order(self, place: impl Fn(&str) -> usize) -> Self {
        Self { compiled: self.compiled.in_order(place), ..self }
    }

    /// Returns the formulas by name.
    pub fn formulas(&self) -> &BTreeMap<String, String> {
        &self.formulas
    }

    /// Returns the formulas as functions of the state.
    pub(crate) fn compiled(&self) -> &ExpressionConstraints {
        &self.compiled
    }

    /// Applies these constraints to a model.
    ///
    /// # Errors
    /// [`ConstraintError::Shape`] if the model has other coordinates.
    pub fn constrain<'a, S: Scalar>(
        &self,
        model: Box<dyn EulerLagrange<S> + 'a>,
    ) -> Result<Box<dyn EulerLagrange<S> + 'a>, ConstraintError> {
        Ok(Box::new(Constrained::new(model, self.compiled.clone(), [])?))
    }

    /// Returns the manifold of allowed states.
    ///
    /// # Errors
    /// None, because the coordinates match.
    pub fn manifold<S: Scalar>(&self) -> Result<impl Manifold<S> + use<S>, ConstraintError> {
        self.alone()
    }

    /// Returns the constraints that are independent at some of these states, `(batch, n)` each, and the names of the redundant ones.
    ///
    /// # Errors
    /// [`ConstraintFormulaError::Constraints`] if the constraints contradict each other or leave no motion.
    pub fn independent(mut self, q: &[f64], v: &[f64]) -> Result<(Self, Vec<String>), ConstraintFormulaError> {
        let kept = self.alone()?.independent(q, v)?;
        let redundant = kept.redundant().to_vec();
        if redundant.is_empty() {
            return Ok((self, redundant));
        }
        self.formulas.retain(|name, _| !redundant.contains(name));
        self.compiled = self.compiled.without(&redundant);
        Ok((self, redundant))
    }

    fn alone<S: Scalar>(&self) -> Result<Constrained<Mechanics<Free, S>, ExpressionConstraints, S>, ConstraintError> {
        use super::Constraints;
        let free = Mechanics::new(Free(self.compiled.coordinates()), []);
        Constrained::new(free, self.compiled.clone(), [])
    }
}

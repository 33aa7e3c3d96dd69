//! Events of a description: a roll-out finds the zeros of their formulas.

use super::quantity::Decimal;
use super::scope::{Scope, compiled};
use super::{Description, DescriptionError};
use crate::lagrangian::expression::{Compiler, Formula};
use crate::lagrangian::formula_events::FormulaEvent;
use alloc::string::String;
use alloc::vec::Vec;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// An event: the formula whose zeros a roll-out finds, and what happens there.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct EventDescription {
    /// Formula of coordinates, velocities, the time `t`, parameters and definitions; its zeros are the events.
    when: String,
    /// `true` to accept only zeros where the formula decreases.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "super::is_false"))]
    falling: bool,
    /// `true` to accept only zeros where the formula increases.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "super::is_false"))]
    rising: bool,
    /// Number of occurrences after which the motion ends.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    after: Option<usize>,
    /// What happens at the event.
    #[cfg_attr(feature = "serde", serde(default))]
    then: Consequence,
}

/// The effect of an event on the motion.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize), serde(untagged))]
pub enum Consequence {
    /// A consequence given by a word.
    Named(Word),
    /// An impact on the surface where the formula is zero.
    Impact {
        /// Ratio of the normal speeds after and before the impact: a number or a formula.
        restitution: Decimal,
    },
}

/// A consequence other than an impact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "lowercase"))]
pub enum Word {
    /// The event is recorded.
    Mark,
    /// The motion ends.
    Stop,
}

impl Default for Consequence {
    fn default() -> Self {
        Self::Named(Word::Mark)
    }
}

impl Description {
    /// Compiles the events.
    pub(super) fn compiled_events(
        &self,
        compiler: &mut Compiler,
        scope: &Scope,
    ) -> Result<Vec<FormulaEvent>, DescriptionError> {
        let mut read = |key: &str, text: &str, still: bool| -> Result<Formula, DescriptionError> {
            let value = compiled(compiler, scope, (key, text), still)?;
            Ok(compiler.formula(value))
        };
        let mut events = Vec::with_capacity(self.events.len());
        for (name, event) in &self.events {
            let key = |part: &str| format!("events.{name}.{part}");
            if name.is_empty() || name.chars().count() > 100 || name.chars().any(char::is_control) {
                return Err(DescriptionError::new("events", "expected names of 1 to 100 characters on one line"));
            }
            if event.after == Some(0) {
                return Err(DescriptionError::new(key("after"), "expected a number of times, at least 1"));
            }
            let impact = if let Consequence::Impact { restitution } = &event.then { Some(restitution) } else { None };
            let when = read(&key("when"), &event.when, impact.is_some())?;
            let restitution = match impact {
                Some(Decimal(text)) => {
                    let formula = read(&key("then.restitution"), text, false)?;
                    self.check_restitution(&formula).map_err(|e| DescriptionError::new(key("then.restitution"), e))?;
                    Some(formula)
                }
                None => None,
            };
            let stops = event.then == Consequence::Named(Word::Stop);
            let either = event.falling == event.rising;
            events.push(FormulaEvent {
                name: name.clone(),
                falling: event.falling || either,
                rising: event.rising || either,
                last: event.after.or(stops.then_some(1)),
                when,
                restitution,
            });
        }
        Ok(events)
    }

    /// Rejects a coefficient of restitution that is out of range for the default parameters. One that depends on the state cannot be
    /// checked here.
    fn check_restitution(&self, formula: &Formula) -> Result<(), String> {
        let value = |text: &str| text.trim().parse().unwrap_or(f64::NAN);
        let defaults: Vec<f64> = self.parameters.values().map(|parameter| value(&parameter.default.0)).collect();
        let found: f64 = formula.evaluate(&defaults, &[], &[]);
        match found.is_nan() || (0.0..=1.0).contains(&found) {
            true => Ok(()),
            false => Err(format!("expected a number from 0 to 1, found {found}")),
        }
    }
}

//! The measured quantities of a system along a roll-out, as columns after the others.

use crate::CliError;
use crate::arguments::motion_source::MotionSource;
use lnn::lagrangian::{FormulaReading, Request, SystemInstance, Terms};

/// Columns of the quantities in `[measured]` that are not coordinates themselves.
pub struct ReadingColumns<'a> {
    source: &'a MotionSource,
    instance: &'a SystemInstance<f64>,
    readings: Vec<&'a FormulaReading>,
}

impl<'a> ReadingColumns<'a> {
    /// Selects the measured quantities of a system; `None` for a model, or for a system without them. Accelerations do not include external
    /// forces, so quantities with accelerations are rejected if there are any.
    ///
    /// # Errors
    /// A usage error for a formula with accelerations if the motion is `driven` from outside.
    pub fn of(source: &'a MotionSource, driven: bool) -> Result<Option<Self>, CliError> {
        let Some(instance) = &source.instance else { return Ok(None) };
        let own = |reading: &&FormulaReading| !source.columns.contains(&reading.name);
        let readings: Vec<&FormulaReading> = instance.readings().iter().filter(own).collect();
        if let Some(reading) = readings.iter().find(|reading| driven && reading.accelerated) {
            let problem = "has accelerations: write the force into [forces] of the file, as a formula of [inputs]";
            return Err(CliError::usage(format_args!("--force: measured.{} {problem}", reading.name)));
        }
        Ok((!readings.is_empty()).then_some(Self { source, instance, readings }))
    }

    /// Names of the quantities.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.readings.iter().map(|reading| reading.name.clone())
    }

    /// The quantities at a sample; not finite where the state has no accelerations.
    pub fn at(&self, t: f64, (q, v): (&[f64], &[f64])) -> impl Iterator<Item = f64> {
        let mut terms = Terms::default();
        let solved = self.source.model.terms_at(&[t], q, v, Request::ACCELERATION, &mut terms).is_ok();
        let a = if solved { terms.acceleration } else { vec![f64::NAN; q.len()] };
        let known = self.source.known(t);
        self.readings.iter().map(move |reading| reading.value(&self.instance.parameters, (q, v, &a), &known))
    }
}

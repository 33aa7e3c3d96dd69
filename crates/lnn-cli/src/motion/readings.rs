//! The measured quantities of a system along a roll-out, as columns after the others.

use crate::CliError;
use crate::motion_source::MotionSource;
use lnn::lagrangian::{FormulaReading, Request, SystemInstance, Terms};
use lnn::rollout::{Trajectory, quoted};
use lnn::scalar::Scalar;

/// Columns of the quantities in `[measured]` that are not coordinates themselves.
pub struct ReadingColumns<'a> {
    source: &'a MotionSource,
    instance: &'a SystemInstance<f64>,
    readings: Vec<&'a FormulaReading>,
}

impl<'a> ReadingColumns<'a> {
    /// Readings of a system; none for a model, or for a system without measured quantities. Accelerations do not include external forces,
    /// so quantities with accelerations are then rejected.
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

    /// A line of names with the names of the quantities at its end.
    pub fn header(&self, line: &str) -> String {
        let names: Vec<String> = self.readings.iter().map(|reading| quoted(&reading.name)).collect();
        format!("{},{}\n", line.trim_end(), names.join(","))
    }

    /// Lines of samples with the quantities at their ends; empty where a state has no accelerations.
    pub fn rows(&self, lines: &str, piece: &Trajectory<f64>) -> String {
        let mut text = String::new();
        let mut terms = Terms::default();
        for (k, line) in lines.lines().enumerate() {
            text += line;
            let (q, v) = piece.state(k);
            let t = piece.t[k];
            let solved = self.source.model.terms_at(&[t], q, v, Request::ACCELERATION, &mut terms).is_ok();
            let a = if solved { terms.acceleration.clone() } else { vec![f64::NAN; q.len()] };
            let known = self.source.known(t);
            for reading in &self.readings {
                let value = reading.value(&self.instance.parameters, (q, v, &a), &known);
                text.push(',');
                text += &if value.is_finite() { value.to_text() } else { String::new() };
            }
            text.push('\n');
        }
        text
    }
}

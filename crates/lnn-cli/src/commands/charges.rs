//! Charges of the symmetries of a model along its motion, for `lnn rollout --charges`.

use crate::CliError;
use crate::arguments::probe::Probe;
use crate::thresholds::CHARGES_SEED;
use lnn::findings::text_table;
use lnn::names::rounded;
use lnn::rollout::Trajectory;
use lnn::symmetry::{Charge, unknowns};
use serde::Serialize;

/// A charge and its drift.
#[derive(Debug, Serialize)]
struct Row {
    /// `energy`, or `g(v, v)/2` along geodesics of a metric with a time, or the field whose charge it is.
    symmetry: String,
    start: f64,
    end: f64,
    /// Charge at the end minus charge at the start; the sum of the next two.
    drift: f64,
    /// Drift because the model breaks the symmetry, as an integral.
    by_model: f64,
    /// Remaining drift, caused by the integrator.
    by_integrator: f64,
    /// Largest deviation from the charge at the start.
    largest: f64,
}

/// All charges; only the energy if the number of symmetries is unknown.
#[derive(Debug, Serialize)]
#[serde(transparent)]
pub struct Charges {
    rows: Vec<Row>,
}

impl Charges {
    /// Computes charges along a motion, for the point symmetries in the default basis.
    ///
    /// # Errors
    /// A usage error for a region outside the domain, a data error for terms that are not finite.
    pub fn new(probe: &Probe, motion: &Trajectory<f64>) -> Result<Self, CliError> {
        let (largest, model) = (probe.basis(None)?.0, probe.model.as_ref());
        let (q, v) = probe.states(probe.enough(unknowns(model.coordinates(), largest.len())), CHARGES_SEED)?;
        let (found, _) = probe.symmetries(None, (&q, &v), None)?;
        let basis = &found.basis;
        let all = Charge::of(model, basis, &found.fields, motion).map_err(CliError::data)?;
        let names = std::iter::once(found.invariant.charge().to_string())
            .chain(found.fields.iter().map(|field| field.text(basis)));
        let rows = names.zip(&all).map(|(symmetry, charge)| {
            let ends = [charge.values.first(), charge.values.last()].map(|x| x.copied().unwrap_or(f64::NAN));
            Row {
                symmetry,
                start: ends[0],
                end: ends[1],
                drift: charge.drift,
                by_model: charge.by_model,
                by_integrator: charge.by_integrator,
                largest: charge.values.iter().fold(0.0, |m: f64, x| m.max((x - ends[0]).abs())),
            }
        });
        Ok(Self { rows: rows.collect() })
    }

    /// Text for a terminal.
    pub fn text(&self) -> String {
        let headers = ["charge of", "start", "drift", "by the model", "by the integrator", "largest"];
        let rows = self.rows.iter().map(|row| {
            let numbers = [row.drift, row.by_model, row.by_integrator, row.largest].map(|x| rounded(x, 3));
            [vec![row.symmetry.clone(), rounded(row.start, 10)], numbers.to_vec()].concat()
        });
        text_table(&headers, &rows.collect::<Vec<_>>())
    }
}

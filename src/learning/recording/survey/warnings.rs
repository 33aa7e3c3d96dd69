//! Warnings to read before learning from the data.

use super::suspicious::Kind;
use super::thresholds::{
    LEAST_CORRELATION, LEAST_SAMPLES_PER_PERIOD, MANY_LOST_ROWS, MISTAKE_TOLERANCE, RATIO_PER_SQUARED_ERROR,
    RATIO_TOLERANCE, TURN_TOLERANCE,
};
use super::{CoordinateSurvey, FirstOrder, Stillness, Survey};
use crate::names::{number, percent, pluralize};
use crate::recording::Recording;
use crate::recording::smooth::Smoothing;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// The warnings, one sentence each.
pub fn warnings(survey: &Survey, still: &[(usize, Stillness)]) -> Vec<String> {
    let mut all: Vec<String> = survey.first_order.iter().map(FirstOrder::warning).collect();
    for (i, c) in survey.coordinates.iter().enumerate() {
        match still.iter().find(|(still, _)| *still == i) {
            Some((_, how)) => all.push(format!("{} {how}; nothing can be learned about it", c.name)),
            None => all.extend(coordinate_warnings(c, survey)),
        }
    }
    let dropped: usize = survey.dropped.iter().map(|part| part.samples).sum();
    let (missing, gaps) = (survey.bridged.rows, pluralize(survey.bridged.gaps, "short gap", "short gaps"));
    let share = |rows: usize| rows as f64 / (survey.samples + dropped + missing) as f64;
    if share(missing) > MANY_LOST_ROWS {
        let rows = pluralize(missing, "row is", "rows are");
        all.push(format!("{rows} missing in {gaps} ({}): smoothing interpolates across them", percent(share(missing))));
    }
    if share(dropped) > MANY_LOST_ROWS {
        let rows = pluralize(dropped, "row is", "rows are");
        all.push(format!("{rows} left out ({}): too few lie between two gaps to be used", percent(share(dropped))));
    }
    if survey.suspicious_count > 0 {
        let places = pluralize(survey.suspicious_count, "place does", "places do");
        all.push(format!("{places} not look like smooth motion with noise"));
    }
    if survey.held_out.is_none() {
        all.push("too few samples to hold out a validation part".to_string());
    }
    all
}

/// Warnings about a coordinate that moves.
fn coordinate_warnings(c: &CoordinateSurvey, survey: &Survey) -> Vec<String> {
    let (name, mut all) = (&c.name, Vec::new());
    if let Some((track, row)) = &c.first_ambiguous {
        all.push(format!(
            "{name} turns by more than 2 rad between samples {}, first at row {row} of {track}: the direction of \
             the turn is ambiguous",
            pluralize(c.ambiguous_turns, "time", "times")
        ));
    }
    if !c.noise_resolved {
        all.push(format!(
            "{name}: motion and noise cannot be separated, so that the estimated noise is an upper bound"
        ));
    }
    if c.samples_per_period < LEAST_SAMPLES_PER_PERIOD {
        all.push(format!(
            "{name}: {:.1} samples per period of its fast motion ({} s), expected at least {LEAST_SAMPLES_PER_PERIOD}: sample faster",
            c.samples_per_period,
            number(c.period)
        ));
    }
    let measured = [("velocity", 1, &c.measured_velocity), ("acceleration", 2, &c.measured_acceleration)];
    for (what, derivative, consistency) in measured {
        if let Some(consistency) = consistency.filter(|c| !c.holds()) {
            let order = ["", "", "second "][derivative];
            let hint = consistency.mistake(survey.step).map(|text| format!(": {text}")).unwrap_or_default();
            all.push(format!(
                "the measured {what} of {name} is {} times the {order}derivative of its positions (correlation \
                 {:.3}){hint}",
                number(consistency.factor),
                consistency.correlation
            ));
        }
    }
    let wraps = |turn: f64| {
        let jumps = survey.suspicious.iter().filter(|s| s.kind == Kind::Jump && s.coordinate == *name);
        jumps.filter(|s| (s.size.abs() / turn - 1.0).abs() < TURN_TOLERANCE).count()
    };
    if !c.periodic && wraps(TAU) > 0 {
        all.push(format!("{name} jumps by a full turn {} times: is it an angle (--periodic {name})?", wraps(TAU)));
    }
    if wraps(360.0) > 0 {
        let count = wraps(360.0);
        all.push(format!("{name} jumps by 360 {count} times: is it an angle in degrees (--units {name}=deg)?"));
    }
    all
}

/// Comparison of a measured derivative with the derivative of the positions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Consistency {
    /// Least-squares ratio of the measured derivative to the computed one; 1 if they agree.
    pub factor: f64,
    /// Correlation of the two.
    pub correlation: f64,
    /// Relative error of the computed derivative.
    pub uncertainty: f64,
}

impl Consistency {
    /// `true` if the two agree within their errors.
    pub fn holds(&self) -> bool {
        let doubt = RATIO_TOLERANCE + RATIO_PER_SQUARED_ERROR * self.uncertainty * self.uncertainty;
        (self.factor - 1.0).abs() <= doubt && self.correlation >= LEAST_CORRELATION - self.uncertainty
    }

    /// The likely mistake, if the factor is typical of one.
    pub fn mistake(&self, step: f64) -> Option<&'static str> {
        let known = [
            (180.0 / PI, "degrees where radians are expected?"),
            (PI / 180.0, "positions in degrees, derivatives in radians?"),
            (-1.0, "the other sign?"),
            (1e3, "milli-units or milliseconds?"),
            (1e-3, "milli-units or milliseconds?"),
            (60.0 / (2.0 * PI), "revolutions per minute?"),
            (1.0 / (2.0 * PI), "turns per second?"),
            (2.0 * PI, "positions in turns?"),
            (step, "per sample instead of per second?"),
            (step * step, "per sample squared instead of per second squared?"),
        ];
        known
            .into_iter()
            .find(|(factor, _)| (self.factor / factor - 1.0).abs() < MISTAKE_TOLERANCE)
            .map(|(_, text)| text)
    }
}

/// Compares the measured derivative of order 1 or 2 of coordinate `i` with the computed one.
pub fn compare(recording: &Recording, i: usize, derivative: usize, smoothing: &Smoothing) -> Consistency {
    let n = recording.n();
    let (mut product, mut computed, mut measured) = (0.0, 0.0, 0.0);
    smoothing.visit(recording, i, |values, track, at| {
        let x = if derivative == 1 { track.v[at * n + i] } else { track.a[at * n + i] };
        let y = values[derivative];
        (product, computed, measured) = (product + x * y, computed + y * y, measured + x * x);
    });
    let quality = smoothing.coordinates[i].quality;
    let size = if derivative == 1 { quality.velocity } else { quality.acceleration };
    let error = quality.total(derivative);
    let uncertainty = if error == 0.0 { 0.0 } else { error / size };
    Consistency { factor: product / computed, correlation: product / (computed * measured).sqrt(), uncertainty }
}

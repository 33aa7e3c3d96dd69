//! Identifies the constants from every trajectory alone, and tests whether they differ by more than their errors. A difference is often the first
//! sign of a missing term, or of standard errors that are too small.

use super::found::{Constant, Identified};
use super::quality::tail;
use super::report::with_error;
use super::thresholds::{MOST_SINGLE_TRAJECTORIES, SIGNIFICANCE};
use super::{IdentifyError, IdentifyOptions, identify};
use crate::cancellation::Cancelled;
use crate::findings::Findings;
use crate::lagrangian::SystemInstance;
use crate::names::rounded;
use crate::recording::Recording;
use serde::Serialize;

/// Constants identified from one trajectory alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfTrajectory {
    /// Name of the trajectory.
    pub trajectory: String,
    /// The constants; empty if they cannot be identified from this trajectory.
    pub constants: Vec<Constant>,
    /// The verdict in words, or the reason why there are no constants.
    pub says: String,
    /// `true` if the model fits the trajectory.
    pub explained: bool,
}

/// The scatter of a constant over the trajectories that determine it, of which there are at least two.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scatter {
    /// Its symbol.
    pub symbol: String,
    /// Mean of its values, weighted by their inverse variances.
    pub mean: f64,
    /// Number of these values.
    pub count: usize,
    /// Standard deviation of the values from the mean, in standard errors; 1 is expected if the errors are right.
    pub ratio: f64,
    /// Probability that values of the same constant scatter at least as much.
    pub probability: f64,
    /// `true` if the probability is below 1 %, divided by the number of constants: a right model has such a constant in one of a hundred recordings.
    pub differs: bool,
}

/// The constants of every trajectory alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ByTrajectory {
    /// The constants by trajectory.
    pub trajectories: Vec<OfTrajectory>,
    /// The scatter of every constant.
    pub scatter: Vec<Scatter>,
}

/// Identifies the constants from every trajectory alone, starting at those of all trajectories together.
///
/// # Errors
/// [`IdentifyError`] for more than 64 trajectories, and for a search that is cancelled.
pub(super) fn by_trajectory(
    instance: &SystemInstance<f64>,
    recording: &Recording,
    options: &IdentifyOptions,
    found: &Identified,
) -> Result<ByTrajectory, IdentifyError> {
    let count = recording.tracks.len();
    if count > MOST_SINGLE_TRAJECTORIES {
        let expected = format!("at most {MOST_SINGLE_TRAJECTORIES} trajectories");
        return Err(IdentifyError::Option { what: "by_trajectory", expected, found: count.to_string() });
    }
    let mut instance = instance.clone();
    for (parameter, value) in instance.system.parameters.iter().zip(&mut instance.parameters) {
        let own = found.constants.iter().find(|constant| constant.symbol == parameter.symbol);
        *value = own.map_or(*value, |constant| constant.value);
    }
    let mut trajectories = Vec::new();
    for at in 0..count {
        let one = Recording { tracks: vec![recording.tracks[at].clone()], ..recording.clone() };
        let options = IdentifyOptions {
            errors: entry(&options.errors, at),
            missing: entry(&options.missing, at),
            inputs: entry(&options.inputs, at),
            by_trajectory: false,
            ..options.clone()
        };
        let trajectory = recording.tracks[at].name.clone();
        trajectories.push(match identify(&instance, &one, &options) {
            Ok(Identified { constants, explained, verdict, .. }) => {
                OfTrajectory { trajectory, constants, says: verdict.to_string(), explained }
            }
            Err(IdentifyError::Cancelled(Cancelled)) => return Err(IdentifyError::Cancelled(Cancelled)),
            Err(error) => OfTrajectory { trajectory, constants: Vec::new(), says: error.to_string(), explained: false },
        });
    }
    let symbols: Vec<&String> = found.constants.iter().map(|constant| &constant.symbol).collect();
    let scatter = symbols.iter().filter_map(|symbol| scatter(symbol, &trajectories, (symbols.len(), found.samples)));
    Ok(ByTrajectory { scatter: scatter.collect(), trajectories })
}

/// The entry of one trajectory in a list that is empty or has one entry for each.
fn entry<T: Clone>(all: &[T], at: usize) -> Vec<T> {
    all.get(at).cloned().into_iter().collect()
}

/// The scatter of one constant; `None` if fewer than two trajectories determine it.
fn scatter(symbol: &str, trajectories: &[OfTrajectory], (constants, samples): (usize, usize)) -> Option<Scatter> {
    let own = trajectories.iter().flat_map(|alone| &alone.constants).filter(|constant| constant.symbol == symbol);
    let known: Vec<(f64, f64)> = own
        .filter_map(|constant| Some((constant.value, constant.standard_error.filter(|error| *error > 0.0)?)))
        .collect();
    if known.len() < 2 {
        return None;
    }
    let weights: f64 = known.iter().map(|(_, error)| error.powi(-2)).sum();
    let mean = known.iter().map(|(value, error)| value * error.powi(-2)).sum::<f64>() / weights;
    let freedom = (known.len() - 1) as f64;
    let square = known.iter().map(|(value, error)| ((value - mean) / error).powi(2)).sum::<f64>() / freedom;
    let probability = tail(square, freedom, samples as f64);
    let differs = probability < SIGNIFICANCE / constants as f64;
    Some(Scatter { symbol: symbol.to_string(), mean, count: known.len(), ratio: square.sqrt(), probability, differs })
}

impl ByTrajectory {
    /// Adds tables of the constants by trajectory and of their scatter.
    pub(super) fn report(&self, findings: &mut Findings) {
        let symbols: Vec<&str> = self.scatter.iter().map(|scatter| scatter.symbol.as_str()).collect();
        let cell = |alone: &OfTrajectory, symbol: &str| {
            let own = alone.constants.iter().find(|constant| constant.symbol == symbol);
            let [value, error] = own.map_or(["-".into(), "-".into()], |own| with_error(own.value, own.standard_error));
            format!("{value} ({error})")
        };
        let row = |alone: &OfTrajectory| {
            let cells = symbols.iter().map(|symbol| cell(alone, symbol));
            std::iter::once(alone.trajectory.clone()).chain(cells).chain([alone.says.clone()]).collect::<Vec<_>>()
        };
        let headers: Vec<&str> = [&["trajectory alone"], symbols.as_slice(), &[""]].concat();
        findings.gap().table(&headers, self.trajectories.iter().map(row));
        let numbers = |scatter: &Scatter| {
            let Scatter { symbol, mean, ratio, probability, .. } = scatter;
            let differs = if scatter.differs { "differs" } else { "" };
            [symbol.clone(), rounded(*mean, 5), rounded(*ratio, 3), rounded(*probability, 2), differs.to_string()]
        };
        let headers = ["constant", "mean", "scatter / error", "p-value", ""];
        findings.gap().table(&headers, self.scatter.iter().map(numbers));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::tests::{described, recorded};

    /// An oscillator with a rate.
    fn oscillator(k: f64) -> SystemInstance<f64> {
        let text = r#"{"name": "spring", "lagrangian": "x_dot^2/2 - k*x^2/2", "parameters": {"k": 1},
            "coordinates": [{"name": "x", "bounds": [-3, 3], "velocity_bounds": [-6, 6]}]}"#;
        described(text, &[("k", k)])
    }

    #[test]
    fn constants_that_differ_between_trajectories_are_found() {
        let each = |last: f64| {
            let mut recording =
                recorded(&oscillator(4.0), &[&[1.0, 0.3], &[0.2, 1.9], &[-0.8, 1.0]], (8.0, 0.02), &[2e-3], 1);
            recording.tracks.extend(recorded(&oscillator(last), &[&[0.9, -0.7]], (8.0, 0.02), &[2e-3], 2).tracks);
            let options = IdentifyOptions::new().by_trajectory(true);
            identify(&oscillator(3.5), &recording, &options).unwrap().by_trajectory.unwrap()
        };
        let (equal, different) = (each(4.0), each(4.04));
        assert!(!equal.scatter[0].differs && equal.scatter[0].ratio < 2.0, "{equal:?}");
        assert!(different.scatter[0].differs && different.scatter[0].ratio > 3.0, "{different:?}");
        let constants = different.trajectories.iter().map(|alone| &alone.constants[0]);
        for (constant, k) in constants.zip([4.0, 4.0, 4.0, 4.04]) {
            assert!((constant.value - k).abs() < 4.0 * constant.standard_error.unwrap(), "{different:?}");
        }
    }
}

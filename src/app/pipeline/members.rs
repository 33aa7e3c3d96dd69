//! Networks trained on the same recording from different seeds: their differences show what the recording, or the training, leaves open.

use crate::analysis::{PredictionError, prediction_error};
use crate::configuration::{Config, MOST_SEED};
use crate::findings::Findings;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::names::{number, percent, percentage};
use crate::network::NetworkLagrangian;
use crate::network::file::ModelFile;
use crate::pipeline::equivalence::{Equivalence, gauge_functions};
use crate::pipeline::fit::{FitReport, judge};
use crate::pipeline::fit_config::FitConfig;
use crate::pipeline::hold_out::HoldOut;
use crate::pipeline::prepared_fit::PreparedFit;
use crate::pipeline::thresholds::MAX_RESULT_BYTES;
use crate::pipeline::train::RunOptions;
use crate::pipeline::{Event, InMemory, MODEL, Output, PipelineError, SUMMARY, Watch, fit};
use crate::storage::read_regular;
use crate::symmetry::{Chart, SymmetryError};
use crate::training::StopReason;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// One of the networks.
#[derive(Clone, Debug, Serialize)]
pub struct Member {
    /// File of its model.
    pub file: String,
    /// Seed of its training.
    pub seed: u64,
    /// Errors of its motion, by time ahead.
    pub errors: Vec<PredictionError>,
    /// The factor that turns its Lagrangian into that of the first member, up to a total derivative, and the remaining difference; `None`
    /// for the first, and if Lagrangians are not compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Equivalence>,
}

/// The networks of a fit in a common gauge, and their agreement at held-out states.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Members {
    /// The networks, that of the fit first.
    pub each: Vec<Member>,
    /// Errors of the mean of their predictions, by time ahead; empty if they did not predict the same windows.
    pub mean: Vec<PredictionError>,
    /// Standard deviation of the mass matrix between members: root mean square over entries and states, each entry divided by the square
    /// roots of the two diagonal entries of its row and column; `None` if Lagrangians are not compared.
    pub mass_matrix_spread: Option<f64>,
    /// Standard deviation between members of the energy at rest, less its mean over the states: root mean square over the states, divided
    /// by the spread of the mean energy at rest; `None` if Lagrangians are not compared, or have no potential.
    pub potential_spread: Option<f64>,
    /// Why Lagrangians are not compared; empty if they are.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub not_compared: String,
}

impl Members {
    /// Trains the other members of a fit, whose model is the first, and writes their models next to it. Returns their fits and the
    /// comparison of all, which a fit with one member does not have. Members that the flag of the watch interrupts are left out; members
    /// `kept` from an earlier run are not trained again.
    ///
    /// # Errors
    /// Those of a fit.
    pub(crate) fn train(
        prepared: &PreparedFit<'_>,
        config: &FitConfig,
        (network, hold_out, kept): (&NetworkLagrangian<f64>, &HoldOut, Vec<ModelFile<f64>>),
        (options, output, watch): (&RunOptions, &dyn Output, &Watch),
    ) -> Result<Option<(Self, Vec<FitReport>)>, PipelineError> {
        let mut others = Vec::new();
        for ModelFile { header, weights } in kept.into_iter().take(config.members - 1) {
            let network = NetworkLagrangian::new(header.architecture.clone(), weights)?;
            let hold_out = judge(prepared, config, (&header, &network), options.threads, watch)?;
            others.push(FitReport::restored(header, network, hold_out));
        }
        for k in 1 + others.len()..config.members {
            if watch.is_interrupted() {
                break;
            }
            let seed = seed(config, k);
            watch.say(Event::Note(&format!("member {} of {}, seed {seed}", k + 1, config.members)));
            let training = Config { seed, ..config.training.clone() };
            let own = FitConfig { members: 1, formula: false, training, ..config.clone() };
            let options = RunOptions { checkpoints: None, ..options.clone() };
            let files = InMemory::default();
            let report = match fit(prepared, &own, &options, &files, &watch.without_remarks()) {
                Err(_) if watch.is_interrupted() => break,
                report => report?,
            };
            if let StopReason::Failed(error) = &report.stop {
                watch.say(Event::Note(&format!("member {} and the following ones are left out: {error}", k + 1)));
            }
            if report.stop != StopReason::Finished {
                break;
            }
            output.write(&file(k), &files.get(MODEL).unwrap_or_default())?;
            others.push(report);
        }
        if others.is_empty() {
            return Ok(None);
        }
        let networks: Vec<&NetworkLagrangian<f64>> =
            std::iter::once(network).chain(others.iter().map(|report| &report.network)).collect();
        let predicted: Vec<&HoldOut> =
            std::iter::once(hold_out).chain(others.iter().map(|report| &report.hold_out)).collect();
        let each = predicted.iter().enumerate().map(|(k, hold_out)| Member {
            file: file(k),
            seed: seed(config, k),
            errors: hold_out.model.clone(),
            comparison: None,
        });
        let mut found = Self { each: each.collect(), mean: of_the_mean(&predicted), ..Self::default() };
        match prepared.constraints() {
            Some(_) => {
                found.not_compared = "under constraints, motion leaves more of L undetermined than a gauge".to_string()
            }
            None => {
                if let Err(problem) = found.compare(prepared, &networks) {
                    found.not_compared = problem.to_string();
                }
            }
        }
        Ok(Some((found, others)))
    }

    /// Converts the Lagrangians to the gauge of the first and compares them at held-out states.
    fn compare(
        &mut self,
        prepared: &PreparedFit<'_>,
        networks: &[&NetworkLagrangian<f64>],
    ) -> Result<(), SymmetryError> {
        let recording = &prepared.measured.test.recording;
        let n = recording.n();
        let charts: Vec<Chart> =
            recording.periodic.iter().map(|angle| if *angle { Chart::Circle } else { Chart::Line }).collect();
        let (basis, states) = gauge_functions(&recording.coordinates, &charts);
        let (mut q, mut v) = (Vec::new(), Vec::new());
        for states in &prepared.measured.test.states {
            let rows = states.interior();
            q.extend_from_slice(&states.q[rows.start * n..rows.end * n]);
            v.extend_from_slice(&states.v[rows.start * n..rows.end * n]);
        }
        // If there are more states than needed, they are thinned evenly.
        let stride = (q.len() / n / states).max(1);
        let [q, v] = [q, v].map(|all| all.chunks_exact(n).step_by(stride).flatten().copied().collect::<Vec<f64>>());
        let first: &dyn EulerLagrange<f64> = networks[0];
        let mut factors = vec![1.0];
        let mut comparisons = Vec::new();
        for network in &networks[1..] {
            let found = Equivalence::new(*network, first, &basis, (&q, &v))?;
            factors.push(found.factor.unwrap_or(1.0));
            comparisons.push(found);
        }
        self.each.iter_mut().skip(1).zip(comparisons).for_each(|(member, found)| member.comparison = Some(found));
        let (masses, energies) = in_one_gauge(networks, &factors, (&q, &v));
        self.mass_matrix_spread = mass_matrix_spread(n, &masses);
        self.potential_spread = potential_spread(&energies);
        Ok(())
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let medians = |errors: &[PredictionError]| errors.iter().map(|e| number(e.median)).collect::<Vec<_>>();
        let row = |member: &Member| {
            let compared = match &member.comparison {
                Some(found) => [
                    found.factor.map_or("-".to_string(), number),
                    percentage(found.mass_matrix),
                    percentage(found.motion),
                ],
                None => ["-", "-", "-"].map(str::to_string),
            };
            [vec![member.file.clone(), member.seed.to_string()], medians(&member.errors), compared.to_vec()].concat()
        };
        let mean = [vec!["mean prediction".to_string(), "-".to_string()], medians(&self.mean), vec!["-".into(); 3]];
        let mean = (!self.mean.is_empty()).then(|| mean.concat());
        self.each.iter().map(row).chain(mean).collect()
    }

    fn headers(&self) -> Vec<String> {
        let times = self.each[0].errors.iter().map(|e| format!("error {} s ahead", number(e.seconds)));
        let ends = ["factor", "M off [%]", "a off [%]"].map(String::from);
        ["model", "seed"].map(String::from).into_iter().chain(times).chain(ends).collect()
    }

    /// Remarks below the table.
    fn remarks(&self) -> Vec<String> {
        if !self.not_compared.is_empty() {
            return vec![format!("the Lagrangians of the members were not compared: {}", self.not_compared)];
        }
        let one = |name: &str, spread: Option<f64>| spread.map(|spread| format!("{name} {}", percent(spread)));
        let known = [one("mass matrix", self.mass_matrix_spread), one("potential", self.potential_spread)];
        let known: Vec<String> = known.into_iter().flatten().collect();
        let known = if known.is_empty() { "not finite".to_string() } else { known.join(", ") };
        let meaning = "factor: multiplies a member's L to match the first, up to a gauge; off: the remaining difference at \
                       held-out states";
        vec![meaning.to_string(), format!("spread between the members there: {known}")]
    }

    /// Reports the members side by side.
    pub(crate) fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        findings.heading("Members, trained from different seeds");
        findings.table(&self.headers(), self.rows()).lines(self.remarks());
        findings
    }
}

/// Reads the members, from the second on, that an interrupted fit of the same configuration trained in a directory.
pub(crate) fn kept_members(directory: &Path, config: &FitConfig) -> Vec<ModelFile<f64>> {
    #[derive(Deserialize)]
    struct Summary {
        ended: String,
        #[serde(default)]
        members: Trained,
    }
    #[derive(Default, Deserialize)]
    struct Trained {
        each: Vec<serde::de::IgnoredAny>,
    }
    let text = |name: &str| String::from_utf8(read_regular(&directory.join(name), MAX_RESULT_BYTES).ok()?).ok();
    let same = || toml::from_str::<FitConfig>(&text("config.toml")?).ok().map(|old| old.without_files());
    let found = text(SUMMARY).and_then(|text| serde_json::from_str::<Summary>(&text).ok());
    match found {
        Some(Summary { ended, members }) if ended == "interrupted" && same() == Some(config.without_files()) => {
            (1..members.each.len()).map_while(|k| ModelFile::load(&directory.join(file(k))).ok()).collect()
        }
        _ => Vec::new(),
    }
}

/// File name of a member's model.
fn file(member: usize) -> String {
    if member == 0 { MODEL.to_string() } else { format!("member-{member}.safetensors") }
}

/// The seed of a member: the seed of the fit and the following ones, with 0 after the largest.
fn seed(config: &FitConfig, member: usize) -> u64 {
    (config.training.seed + member as u64) & MOST_SEED
}

/// Errors of the mean of predictions of the same windows.
fn of_the_mean(members: &[&HoldOut]) -> Vec<PredictionError> {
    let first = &members[0].predicted;
    if members.iter().any(|member| member.predicted.windows.len() != first.windows.len()) {
        return Vec::new();
    }
    let count = members.len() as f64;
    let mean = |window: usize| -> Vec<f64> {
        let all = || members.iter().map(|member| &member.predicted.predictions[window]);
        (0..first.predictions[window].len()).map(|k| all().map(|one| one[k]).sum::<f64>() / count).collect()
    };
    let means = (0..first.windows.len()).map(mean).collect();
    let (periodic, scales) = &members[0].error_scales;
    let scales = (&periodic[..], &scales[..]);
    members[0].model.iter().map(|error| prediction_error(&first.windows, &means, scales, error.seconds)).collect()
}

/// Returns mass matrices `(states, n, n)` and energies at rest `(states)` of every member, multiplied by the factors of their Lagrangians.
fn in_one_gauge(
    networks: &[&NetworkLagrangian<f64>],
    factors: &[f64],
    (q, v): (&[f64], &[f64]),
) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let rest = vec![0.0; v.len()];
    let of = |(network, factor): (&&NetworkLagrangian<f64>, &f64)| {
        let mut terms = Terms::default();
        // If terms are not finite at a state, neither is the spread.
        let _ = network.terms(q, v, Request::MASS_MATRIX, &mut terms);
        let masses: Vec<f64> = terms.mass_matrix.iter().map(|m| m * factor).collect();
        let _ = network.terms(q, &rest, Request::ENERGY, &mut terms);
        (masses, terms.energy.iter().map(|e| e * factor).collect())
    };
    networks.iter().zip(factors).map(of).unzip()
}

/// Mean and variance over members.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let (count, sum) = values.clone().fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x));
    let mean = sum / count;
    (mean, values.map(|x| (x - mean).powi(2)).sum::<f64>() / f64::max(count - 1.0, 1.0))
}

/// Spread of mass matrices `(states, n, n)` between members, see [`Members::mass_matrix_spread`].
fn mass_matrix_spread(n: usize, members: &[Vec<f64>]) -> Option<f64> {
    let all: Vec<(f64, f64)> = (0..members[0].len()).map(|e| moments(members.iter().map(|m| m[e]))).collect();
    let size = |state: usize, i: usize| all[state * n * n + i * n + i].0.abs();
    let squares = all.iter().enumerate().map(|(e, (_, variance))| {
        let (state, i, j) = (e / (n * n), e / n % n, e % n);
        variance / (size(state, i) * size(state, j))
    });
    let spread = (squares.sum::<f64>() / all.len() as f64).sqrt();
    spread.is_finite().then_some(spread)
}

/// Spread of potentials `(states)` between members, see [`Members::potential_spread`].
fn potential_spread(members: &[Vec<f64>]) -> Option<f64> {
    let about = |values: &Vec<f64>| {
        let mean = moments(values.iter().copied()).0;
        values.iter().map(|x| x - mean).collect::<Vec<f64>>()
    };
    let members: Vec<Vec<f64>> = members.iter().map(about).collect();
    let all: Vec<(f64, f64)> = (0..members[0].len()).map(|k| moments(members.iter().map(|m| m[k]))).collect();
    let size: f64 = all.iter().map(|(mean, _)| mean * mean).sum();
    let spread = (all.iter().map(|(_, variance)| variance).sum::<f64>() / size).sqrt();
    spread.is_finite().then_some(spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_standard_deviations_over_sizes() {
        // Masses 4 and 1 of two members that differ by 10 % of each entry; potentials that differ by a constant alone do not differ.
        let spread = mass_matrix_spread(2, &[vec![3.8, 0.0, 0.0, 0.95], vec![4.2, 0.0, 0.0, 1.05]]).unwrap();
        // Both entries of the diagonal vary by 0.1/sqrt(2), the two others do not.
        assert!((spread - (0.005_f64 / 2.0).sqrt()).abs() < 1e-12, "{spread}");
        assert!(potential_spread(&[vec![1.0, 2.0, 4.0], vec![11.0, 12.0, 14.0]]).unwrap() < 1e-12);
        let spread = potential_spread(&[vec![-1.1, 1.1], vec![-0.9, 0.9]]).unwrap();
        assert!((spread - 0.02_f64.sqrt()).abs() < 1e-12, "{spread}");
        assert_eq!(potential_spread(&[vec![0.0, 0.0], vec![0.0, 0.0]]), None);
    }
}

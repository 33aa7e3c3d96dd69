//! The table of the runs of an experiment, one line each, with settings and results.

use crate::experiments::{Outcome, Record, Run};
use crate::pipeline::experiment_directory::ExperimentDirectory;
use crate::pipeline::{PipelineError, SUMMARY};
use crate::report::DataTable;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Numbers taken from the `summary.json` of a run: names of columns, and their paths.
const FROM_SUMMARY: [(&str, &str); 6] = [
    ("epochs", "/epochs"),
    ("weights", "/weights"),
    ("test_loss", "/test_loss"),
    ("mass_matrix_error", "/mass_matrix/median"),
    ("valid_time", "/valid_time/median"),
    ("valid_lyapunov_times", "/valid_time/lyapunov_times"),
];

/// One line per run, finished or not: name, row, seed, the keys of the configuration in which the runs differ, outcome, numbers. It does
/// not depend on the clock.
///
/// # Errors
/// A configuration that TOML cannot hold.
pub(crate) fn run_table(
    results: &[(Run, Option<Record>)],
    store: &ExperimentDirectory,
) -> Result<DataTable, PipelineError> {
    let choices = results.iter().map(|(run, _)| choices(run)).collect::<Result<Vec<_>, PipelineError>>()?;
    let mut keys: Vec<&String> = choices.iter().flat_map(BTreeMap::keys).collect();
    keys.sort();
    keys.dedup();
    keys.retain(|key| choices.iter().any(|one| one.get(*key) != choices[0].get(*key)));
    let mut header = ["run", "row", "seed"].map(String::from).to_vec();
    header.extend(keys.iter().map(|key| (*key).clone()));
    let numbers = ["outcome", "loss", "instability", "wrong_signature", "energy_error", "integrated", "starts"];
    header.extend(numbers.map(String::from));
    header.extend(FROM_SUMMARY.map(|(name, _)| name.to_string()));
    let row = |((run, record), choices): (&(Run, Option<Record>), &BTreeMap<String, Value>)| {
        let mut cells = vec![json!(run.name), json!(run.label), json!(run.config.seed)];
        cells.extend(keys.iter().map(|key| choices.get(*key).cloned().unwrap_or_default()));
        cells.extend(outcome(record.as_ref()));
        let summary = store.read(&run.name, SUMMARY).filter(|_| record.is_some());
        let summary: Value = summary.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        cells.extend(FROM_SUMMARY.map(|(_, place)| summary.pointer(place).cloned().unwrap_or_default()));
        cells
    };
    Ok(DataTable { header, rows: results.iter().zip(&choices).map(row).collect() })
}

/// Outcome and numbers of a record.
fn outcome(record: Option<&Record>) -> [Value; 7] {
    let name = match record.map(|record| &record.outcome) {
        None => "open",
        Some(Outcome::Nothing { .. }) => "nothing",
        Some(Outcome::Learned(learned)) => {
            let errors: Vec<f64> = learned.energy_errors.iter().copied().flatten().collect();
            let mean = (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64);
            return [
                json!("learned"),
                json!(learned.validation_loss),
                json!(learned.instability),
                json!(learned.wrong_signature),
                json!(mean),
                json!(learned.integrated),
                json!(learned.energy_errors.len()),
            ];
        }
    };
    [json!(name), Value::Null, Value::Null, Value::Null, Value::Null, Value::Null, Value::Null]
}

/// Values of the keys of a configuration by path, without the seed; lists as text.
fn choices(run: &Run) -> Result<BTreeMap<String, Value>, PipelineError> {
    fn visit(path: &str, value: &toml::Value, found: &mut BTreeMap<String, Value>) {
        let inside = |name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
        match value {
            toml::Value::Table(table) => table.iter().for_each(|(name, value)| visit(&inside(name), value, found)),
            toml::Value::Array(items) if items.iter().any(toml::Value::is_table) => {
                items.iter().enumerate().for_each(|(k, value)| visit(&format!("{path}[{k}]"), value, found));
            }
            toml::Value::Integer(x) => _ = found.insert(path.to_string(), json!(x)),
            toml::Value::Float(x) => _ = found.insert(path.to_string(), json!(x)),
            toml::Value::Boolean(x) => _ = found.insert(path.to_string(), json!(x)),
            toml::Value::String(text) => _ = found.insert(path.to_string(), json!(text)),
            other => _ = found.insert(path.to_string(), json!(other.to_string())),
        }
    }
    let mut found = BTreeMap::new();
    visit("", &toml::Value::try_from(&run.config).map_err(PipelineError::format)?, &mut found);
    found.remove("seed");
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::Reported;
    use crate::network::Initialization;
    use crate::presets::Preset;

    #[test]
    fn every_run_has_a_line_with_the_choices_in_which_it_differs() {
        let directory = tempfile::tempdir().unwrap();
        let store = ExperimentDirectory::new(directory.path());
        let system = crate::lagrangian::SystemInstance::named("harmonic-oscillator", &[]).unwrap();
        let run = |(name, initialization, seed): (&str, Initialization, u64)| {
            let mut config = Preset::Quick.config(&system).unwrap();
            (config.network.initialization, config.seed) = (initialization, seed);
            let (name, label, reported) = (name.to_string(), String::new(), Reported::NOTHING);
            Run { name, label, abscissa: None, group: String::new(), config, reported }
        };
        let runs = [("a", Initialization::Default, 0), ("b", Initialization::VariancePreserving, 1)].map(run);
        let nothing = Outcome::Nothing { reason: String::new() };
        let record =
            Record { run: String::new(), outcome: nothing, losses: Vec::new(), times: Vec::new(), seconds: 0.0 };
        let count = runs.len();
        let mut results: Vec<(Run, Option<Record>)> = runs.into_iter().map(|run| (run, None)).collect();
        results[1].1 = Some(record);
        let folder = directory.path().join(&results[1].0.name);
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join(SUMMARY), r#"{"epochs": 4, "valid_time": {"median": 1.5}}"#).unwrap();
        let table = run_table(&results, &store).unwrap();
        let objects = table.objects();
        assert_eq!((objects.len(), &objects[0]["outcome"]), (count, &json!("open")));
        let second = &objects[1];
        assert_eq!(
            (&second["outcome"], &second["epochs"], &second["valid_time"]),
            (&json!("nothing"), &json!(4), &json!(1.5))
        );
        assert!(second["weights"].is_null() && second["loss"].is_null());
        assert!(table.header.iter().any(|key| key == "network.initialization"), "{:?}", table.header);
        assert!(!table.header.iter().any(|key| key == "precision" || key == "system"), "{:?}", table.header);
    }
}

//! Files of a report: the page, its pictures and their captions, the history of a training.

use crate::lagrangian::SystemInstance;
use crate::lagrangian::system::Size;
use crate::network::NetworkLagrangian;
use crate::network::file::Header;
use crate::pipeline::model::all_parameters;
use crate::pipeline::{CAPTIONS, Output, PLAY, PipelineError};
use crate::report::{Figure, HistoryRow, Report, page, training_figures};
use crate::training::{Epoch, StopReason};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The texts of a picture, as stored in [`CAPTIONS`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Caption {
    pub heading: String,
    pub caption: String,
}

/// Writes [`CAPTIONS`], which name and describe the pictures, then the report and the pictures.
///
/// # Errors
/// [`PipelineError::Output`].
pub(crate) fn write_report_and_figures<'a>(
    output: &dyn Output,
    report: &Report,
    figures: impl Iterator<Item = &'a Figure> + Clone,
) -> Result<(), PipelineError> {
    let caption = |f: &Figure| Caption { heading: f.heading.clone(), caption: f.caption.clone() };
    let captions: BTreeMap<&str, Caption> = figures.clone().map(|f| (f.file.as_str(), caption(f))).collect();
    output.write(CAPTIONS, serde_json::to_string_pretty(&captions).map_err(PipelineError::format)?.as_bytes())?;
    output.write("report.html", report.to_html().as_bytes())?;
    figures.into_iter().try_for_each(|figure| output.write(&figure.file, figure.to_svg().as_bytes()))
}

/// Writes the interactive page of a model, and adds a link to it; if there is none, the report says why.
///
/// # Errors
/// [`PipelineError::Output`].
pub(crate) fn write_page(
    output: &dyn Output,
    report: Report,
    (header, network): (&Header, &NetworkLagrangian<f64>),
    system: Option<&SystemInstance<f64>>,
) -> Result<Report, PipelineError> {
    match page(header, network, system) {
        Ok(text) => {
            output.write(PLAY, text.as_bytes())?;
            let beside = if system.is_some() { ", beside the exact system" } else { "" };
            Ok(report.link(PLAY, &format!("Play with the model: drag it and let it go{beside}")))
        }
        Err(problem) => Ok(report.paragraph(&format!("This model has no interactive page: {problem}."))),
    }
}

/// Adds the system's parameters to a report.
pub(crate) fn parameter_table(report: Report, system: &SystemInstance<f64>) -> Report {
    let values = all_parameters(system);
    let named = system.system.parameters.iter().map(|p| (p.symbol.as_ref(), p.unit.as_ref()));
    let size = match system.system.size {
        Size::Fixed(_) => None,
        Size::Chosen { symbol, .. } => Some((symbol, "1")),
    };
    let row = |(symbol, unit): (&str, &str)| {
        let value = values.get(symbol).map(f64::to_string).unwrap_or_default();
        vec![symbol.to_string(), value, if unit == "1" { "-" } else { unit }.to_string()]
    };
    let rows: Vec<Vec<String>> = named.chain(size).map(row).collect();
    if rows.is_empty() {
        return report;
    }
    report.heading("Parameters of the system").table(&["parameter", "value", "unit"], &rows)
}

/// The text of `history.csv`: one row per epoch.
pub(crate) fn history(epochs: &[Epoch]) -> String {
    let mut csv =
        "epoch,phase,rate,training_loss,penalty,penalised,validation_loss,gradient_norm,left_out,skipped,seconds\n"
            .to_string();
    for e in epochs {
        // Writing to a string cannot fail.
        let _ = writeln!(
            csv,
            "{},{},{},{},{},{},{},{},{},{},{:.3}",
            e.epoch,
            e.phase,
            e.rate,
            e.training_loss,
            e.penalty,
            e.penalised,
            e.validation_loss,
            e.gradient_norm,
            e.left_out,
            e.skipped,
            e.seconds
        );
    }
    csv
}

/// Pictures of a history.
pub(crate) fn training_pictures(epochs: &[Epoch]) -> Vec<Figure> {
    let row = |e: &Epoch| HistoryRow {
        epoch: e.epoch as f64,
        training_loss: e.training_loss,
        validation_loss: e.validation_loss,
        learning_rate: e.rate,
        gradient_norm: e.gradient_norm,
        penalty: e.penalty,
    };
    training_figures(&epochs.iter().map(row).collect::<Vec<_>>())
}

/// Describes the end of a training, as `summary.json` states it.
pub(crate) fn ended(stop: &StopReason) -> String {
    match stop {
        StopReason::Finished => "finished".to_string(),
        StopReason::Interrupted => "interrupted".to_string(),
        StopReason::Failed(error) => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Layout;
    use crate::network::file::ModelFile;
    use crate::pipeline::InMemory;

    #[test]
    fn a_report_links_to_the_page_of_a_model_or_says_why_there_is_none() {
        let bytes = include_bytes!("../../../examples/data/double_pendulum.safetensors");
        let shipped = ModelFile::<f64>::from_bytes(bytes).unwrap().header;
        for (hidden, linked) in [(shipped.architecture.hidden.clone(), true), (vec![400, 400], false)] {
            let mut header = shipped.clone();
            header.architecture.hidden = hidden;
            let weights = vec![0.01; Layout::new(&header.architecture).parameters];
            let network = NetworkLagrangian::new(header.architecture.clone(), weights).unwrap();
            let files = InMemory::default();
            let report = write_page(&files, Report::new("a"), (&header, &network), None).unwrap().to_html();
            assert_eq!((report.contains("href=\"play.html\""), files.get(PLAY).is_some()), (linked, linked));
            assert_eq!(report.contains("500000"), !linked);
        }
    }
}

//! `lnn check`: whether a fit can learn from recorded motion, and how.

use crate::cli::recording_args::RecordingArgs;
use crate::cli::{CliError, output};
use crate::configuration::Precision;
use crate::findings::text_table;
use crate::names::{WIDTH, percent, percentage, pluralize, rounded, wrap_text};
use crate::pipeline::{FitOptions, PreparedFit};
use crate::recording::survey::{FEW_SAMPLES, Kind, Survey, SurveyOptions, Warning, survey};
use crate::recording::{LARGE_ERROR, Targets};
use serde::Serialize;
use std::fmt::Write;

/// Largest jitter that counts as rounding of the times.
const ROUNDING: f64 = 1e-9;
/// Lines of a table that can be long.
const LINES: usize = 20;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    recording: RecordingArgs,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// Reads the data, examines them and prints a report.
///
/// # Errors
/// A usage error for contradicting arguments, a data error for files that cannot be used.
pub fn run(args: &Args) -> Result<(), CliError> {
    let reading = args.recording.read()?;
    let survey = survey(&reading, &SurveyOptions::default()).map_err(CliError::data)?;
    // A fit is possible if its preparation succeeds.
    let prepared = PreparedFit::new(&reading, &FitOptions::default());
    let obstacle = prepared.and_then(|prepared| prepared.suggest("", Precision::F64)).err();
    let found = Found { survey, obstacle: obstacle.map(|error| error.to_string()) };
    if args.json {
        let text = serde_json::to_string_pretty(&found).map_err(CliError::data)?;
        return output::print(&format!("{text}\n"));
    }
    output::print(&describe(&found))
}

/// A survey, and why no fit can learn from the data, if none can.
#[derive(Serialize)]
struct Found {
    #[serde(flatten)]
    survey: Survey,
    obstacle: Option<String>,
}

/// A number with four digits.
fn short(x: f64) -> String {
    rounded(x, 4)
}

/// Unit of a coordinate; velocities and accelerations are in it per s and s^2.
fn unit(periodic: bool) -> &'static str {
    if periodic { "rad" } else { "SI" }
}

/// The survey for people.
fn describe(Found { survey: found, obstacle }: &Found) -> String {
    let mut text = match obstacle {
        Some(obstacle) => format!("A fit cannot learn from these data: {obstacle}.\n\n"),
        None => headline(found),
    } + &header(found);
    let rows: Vec<Vec<String>> = found
        .coordinates
        .iter()
        .map(|c| {
            let bound = if c.noise_resolved { "" } else { "at most " };
            let noise = format!("{bound}{}", short(c.noise));
            let range = [short(c.min), short(c.max), noise, percentage(c.noise_relative)];
            let motion = [c.velocity, c.acceleration, c.period, c.samples_per_period].map(short);
            [vec![c.name.clone(), unit(c.periodic).to_string()], range.to_vec(), motion.to_vec()].concat()
        })
        .collect();
    let titles = [
        "coordinate",
        "unit",
        "least [unit]",
        "most [unit]",
        "noise [unit]",
        "noise over range [%]",
        "rms v [unit/s]",
        "rms a [unit/s^2]",
        "fast period [s]",
        "samples in it",
    ];
    text += &section(&text_table(&titles, &rows));

    let rows: Vec<Vec<String>> = found
        .coordinates
        .iter()
        .map(|c| {
            let numbers = [c.window_seconds, c.velocity_error, c.acceleration_error].map(short);
            let ends = [percentage(c.acceleration_error_relative)];
            let names = [c.name.clone(), unit(c.periodic).to_string(), c.window.to_string()];
            [names.to_vec(), numbers.to_vec(), ends.to_vec()].concat()
        })
        .collect();
    let titles = [
        "smoothing",
        "unit",
        "window [samples]",
        "window [s]",
        "error of v [unit/s]",
        "error of a [unit/s^2]",
        "over rms a [%]",
    ];
    text += &section(&text_table(&titles, &rows));

    let rows: Vec<Vec<String>> = found.suspicious.iter().take(LINES).map(warning).collect();
    if !rows.is_empty() {
        text += &section(&text_table(&["suspicious", "row", "coordinate", "value [its unit]", "what"], &rows));
        let _ = more(&mut text, found.suspicious_count, ("place", "places"));
    }
    match obstacle {
        Some(_) => text += "\n",
        None => advice(&mut text, found).unwrap_or_default(),
    }
    for warning in &found.warnings {
        let _ = writeln!(text, "warning: {warning}");
    }
    wrap_text(&text, WIDTH)
}

/// A blank line before a table.
fn section(table: &str) -> String {
    format!("\n{table}")
}

/// A sentence about how well a fit can learn.
fn headline(found: &Survey) -> String {
    let worst = found.coordinates.iter().map(|c| c.acceleration_error_relative).fold(0.0, f64::max);
    let looked = match (found.warnings.len(), found.suspicious_count) {
        (0, 0) => "no problem was found".to_string(),
        (0, places) => format!("look at {} first", pluralize(places, "suspicious place", "suspicious places")),
        (warnings, _) => format!("read {} at the end first", pluralize(warnings, "warning", "warnings")),
    };
    let good = match found.targets {
        Targets::Measured => "the accelerations are measured".to_string(),
        Targets::Smoothed | Targets::Forces | Targets::Motion if worst.is_finite() => {
            format!("smoothing gives the accelerations to {}", percent(worst))
        }
        Targets::Smoothed | Targets::Forces | Targets::Motion => "smoothing gives no accelerations".to_string(),
    };
    format!("A fit can learn from these data: {good}, {looked}.\n\n")
}

/// Files, trajectories and samples that were read.
fn header(found: &Survey) -> String {
    let seconds: f64 = found.tracks.iter().map(|t| t.end - t.start).sum();
    let times = match &found.time {
        Some(column) => format!("times from column {column}"),
        None => "times from the rate".to_string(),
    };
    let mut text = format!(
        "{}, {}, {}, {} s; {times}\n",
        pluralize(found.files, "file", "files"),
        pluralize(found.tracks.len(), "trajectory", "trajectories"),
        pluralize(found.samples, "sample", "samples"),
        short(seconds)
    );
    let rows: Vec<Vec<String>> = found
        .tracks
        .iter()
        .take(LINES)
        .map(|t| {
            let rows = format!("{}-{}", t.first_row, t.last_row);
            let times = [t.start, t.end, t.rate].map(short);
            [
                vec![t.name.clone(), rows, t.samples.to_string()],
                times.to_vec(),
                vec![percentage(if t.jitter < ROUNDING { 0.0 } else { t.jitter })],
            ]
            .concat()
        })
        .collect();
    let titles = ["trajectory", "rows", "samples", "from [s]", "to [s]", "rate [Hz]", "jitter of a step [%]"];
    text += &section(&text_table(&titles, &rows));
    let _ = more(&mut text, found.tracks.len(), ("trajectory", "trajectories"));
    let _ = left_out(&mut text, found);
    text
}

/// Gaps and what was left out.
fn left_out(text: &mut String, found: &Survey) -> std::fmt::Result {
    if found.duplicates > 0 {
        let rows = pluralize(found.duplicates, "row that repeats", "rows that repeat");
        writeln!(text, "left out: {rows} the row before")?;
    }
    if found.bridged.gaps > 0 {
        let gaps = pluralize(found.bridged.gaps, "short gap", "short gaps");
        let rows = pluralize(found.bridged.rows, "row is", "rows are");
        let most = found.bridged.longest;
        writeln!(text, "{gaps}: {rows} missing, at most {most} in one; trajectories continue across them")?;
    }
    for cut in found.cuts.iter().take(LINES) {
        let (seconds, steps) = (short(cut.seconds), short(cut.steps));
        writeln!(
            text,
            "gap: {} s ({steps} steps) between rows {} and {} of {}",
            seconds, cut.before, cut.after, cut.file
        )?;
    }
    more(text, found.cuts.len(), ("gap", "gaps"))?;
    for part in found.dropped.iter().take(LINES) {
        let (first, last) = (part.first, part.last);
        let samples = pluralize(part.samples, "sample", "samples");
        writeln!(text, "left out: {samples} between gaps, rows {first}-{last} of {}", part.file)?;
    }
    more(text, found.dropped.len(), ("stretch between gaps", "stretches between gaps"))
}

/// Number of entries beyond those that were shown.
fn more(text: &mut String, all: usize, (one, many): (&str, &str)) -> std::fmt::Result {
    match all.checked_sub(LINES) {
        Some(rest) if rest > 0 => {
            writeln!(text, "and {}", pluralize(rest, &format!("more {one}"), &format!("more {many}")))
        }
        _ => Ok(()),
    }
}

/// One suspicious place.
fn warning(s: &Warning) -> Vec<String> {
    let size = short(s.size);
    let what = match s.kind {
        Kind::Outlier => format!("outlier, off by {size}"),
        Kind::Jump => format!("all later positions are shifted by {size}"),
        Kind::Kink => format!("the velocity jumps by {size}: an impact?"),
        Kind::Frozen => format!("{} equal values: a frozen sensor?", s.size),
    };
    vec![s.track.clone(), s.row.to_string(), s.coordinate.clone(), short(s.value), what]
}

/// Advice: the way a fit would take.
fn advice(text: &mut String, found: &Survey) -> std::fmt::Result {
    let worst = found.coordinates.iter().map(|c| c.acceleration_error_relative).fold(0.0, f64::max);
    let limit = percent(LARGE_ERROR);
    writeln!(text)?;
    match found.targets {
        Targets::Measured => writeln!(
            text,
            "advice: learn from the measured accelerations; those by smoothing are good to {}",
            percent(worst)
        )?,
        Targets::Smoothed => writeln!(
            text,
            "advice: learn from smoothed derivatives (polynomials of degree {}): their accelerations are good to {}, \
             better than {limit}",
            found.degree,
            percent(worst)
        )?,
        Targets::Forces => writeln!(
            text,
            "advice: learn from the known forces, which are noisier than the accelerations by smoothing, good to {}",
            percent(worst)
        )?,
        Targets::Motion => writeln!(
            text,
            "advice: learn through the motion (multiple shooting): accelerations by smoothing are good to {}, no better \
             than {limit}",
            percent(worst)
        )?,
    }
    let enough = found.coordinates.iter().all(|c| c.samples_per_period >= FEW_SAMPLES);
    if enough && found.warnings.is_empty() {
        writeln!(text, "sampling is fine: at least {FEW_SAMPLES} samples per period of the fast motion")?;
    }
    match found.held_out_text.as_str() {
        "" => Ok(()),
        held => writeln!(text, "held out for validation: {held}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suspicions_are_told_in_words() {
        let frozen = Warning {
            track: "run 1".into(),
            row: 7,
            place: (0, 6),
            coordinate: "x".into(),
            kind: Kind::Frozen,
            value: 0.25,
            size: 40.0,
        };
        assert_eq!(warning(&frozen), ["run 1", "7", "x", "0.2500", "40 equal values: a frozen sensor?"]);
        let shifted = Warning { kind: Kind::Jump, size: 0.012_345, ..frozen };
        assert_eq!(warning(&shifted)[4], "all later positions are shifted by 0.01235");
    }
}

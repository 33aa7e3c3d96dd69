//! Text of a survey.

use super::suspicious::{Kind, Warning};
use super::thresholds::{LEAST_SAMPLES_PER_PERIOD, ROUNDING_JITTER, SHOWN_ROWS};
use super::{CoordinateSurvey, Survey, TrajectorySurvey};
use crate::findings::Findings;
use crate::names::{percent, percentage, pluralize, rounded};
use crate::recording::read::{Encoding, FileFacts, FileKind, Separator};
use crate::recording::{LARGE_ACCELERATION_ERROR, Targets};

/// Formats a number with four digits.
fn short(x: f64) -> String {
    rounded(x, 4)
}

impl Survey {
    /// Describes what was read: trajectories, coordinates, smoothing, suspicious places.
    pub fn findings(&self) -> Findings {
        let mut findings = Findings::default();
        self.say_what_was_read(&mut findings);
        let headers = [
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
        findings.gap().table(&headers, self.coordinates.iter().map(CoordinateSurvey::row));
        let headers = [
            "smoothing",
            "unit",
            "window [samples]",
            "window [s]",
            "error of v [unit/s]",
            "error of a [unit/s^2]",
            "over rms a [%]",
        ];
        findings.gap().table(&headers, self.coordinates.iter().map(CoordinateSurvey::smoothing_row));
        if !self.suspicious.is_empty() {
            let headers = ["suspicious", "row", "coordinate", "value [its unit]", "what"];
            findings.gap().table(&headers, self.suspicious.iter().take(SHOWN_ROWS).map(Warning::row));
            findings.lines(more(self.suspicious_count, ("place", "places")));
        }
        findings
    }

    /// States in a sentence how well a fit can learn.
    pub fn headline(&self) -> String {
        let worst = self.worst();
        let lost = self.coordinates.iter().filter(|c| c.acceleration_error_relative >= 1.0);
        let lost: Vec<&str> = lost.map(|c| c.name.as_str()).collect();
        let looked = match (self.warnings.len(), self.suspicious_count) {
            (0, 0) => "no problem was found".to_string(),
            (0, places) => format!("look at {} first", pluralize(places, "suspicious place", "suspicious places")),
            (warnings, _) => format!("read the {} at the end first", pluralize(warnings, "warning", "warnings")),
        };
        let good = match self.targets {
            Targets::Measured => "the accelerations are measured".to_string(),
            _ if !lost.is_empty() && lost.len() < self.coordinates.len() => {
                format!("but noise hides the accelerations of {}", lost.join(", "))
            }
            _ if worst.is_finite() => format!("smoothing gives the accelerations to {}", percent(worst)),
            _ => "smoothing gives no accelerations".to_string(),
        };
        format!("A fit can learn from these data: {good}, {looked}.")
    }

    /// Advice on the targets of a fit, the sampling and the held-out part.
    pub fn advice(&self) -> Findings {
        let (worst, limit) = (percent(self.worst()), percent(LARGE_ACCELERATION_ERROR));
        let mut findings = Findings::default();
        findings.line(match self.targets {
            Targets::Measured => {
                format!("targets: the measured accelerations; those by smoothing are good to {worst}")
            }
            Targets::Smoothed => format!(
                "targets: smoothed derivatives (polynomials of degree {}), whose accelerations are good to {worst}, better \
                 than {limit}",
                self.degree
            ),
            Targets::Forces => format!(
                "targets: the known forces, which are noisier than the accelerations by smoothing, good to {worst}"
            ),
            Targets::Motion => format!(
                "targets: the motion itself (multiple shooting), because accelerations by smoothing are good to {worst}, no \
                 better than {limit}"
            ),
        });
        let enough = self.coordinates.iter().all(|c| c.samples_per_period >= LEAST_SAMPLES_PER_PERIOD);
        if enough && self.warnings.is_empty() {
            findings.line(format!(
                "sampling is fine: at least {LEAST_SAMPLES_PER_PERIOD} samples per period of the fast motion"
            ));
        }
        if !self.held_out_text.is_empty() {
            findings.line(format!("held out for validation: {}", self.held_out_text));
        }
        findings
    }

    /// Largest relative error of the smoothed accelerations.
    fn worst(&self) -> f64 {
        self.coordinates.iter().map(|c| c.acceleration_error_relative).fold(0.0, f64::max)
    }

    fn say_what_was_read(&self, findings: &mut Findings) {
        let seconds: f64 = self.tracks.iter().map(|t| t.end - t.start).sum();
        let times = match &self.time {
            Some(column) => format!("times from column {column}"),
            None => "times from the rate".to_string(),
        };
        let [files, tracks, samples] = [
            pluralize(self.files, "file", "files"),
            pluralize(self.tracks.len(), "trajectory", "trajectories"),
            pluralize(self.samples, "sample", "samples"),
        ];
        findings.line(format!("{files}, {tracks}, {samples}, {} s; {times}", short(seconds)));
        findings.lines(self.formats.iter().filter_map(FileFacts::sentence).take(SHOWN_ROWS));
        let headers = ["trajectory", "rows", "samples", "from [s]", "to [s]", "rate [Hz]", "jitter of a step [%]"];
        findings.gap().table(&headers, self.tracks.iter().take(SHOWN_ROWS).map(TrajectorySurvey::row));
        findings.lines(more(self.tracks.len(), ("trajectory", "trajectories")));
        self.say_what_is_missing(findings);
    }

    /// Describes gaps and left-out rows.
    fn say_what_is_missing(&self, findings: &mut Findings) {
        if self.duplicates > 0 {
            let rows = pluralize(self.duplicates, "row that repeats", "rows that repeat");
            findings.line(format!("left out: {rows} the row before"));
        }
        if self.incomplete > 0 {
            let rows = pluralize(self.incomplete, "row", "rows");
            findings.line(format!("left out: {rows} with an empty field"));
        }
        if self.bridged.gaps > 0 {
            let gaps = pluralize(self.bridged.gaps, "short gap", "short gaps");
            let rows = pluralize(self.bridged.rows, "row is", "rows are");
            let most = self.bridged.longest;
            findings.line(format!("{gaps}: {rows} missing, at most {most} in one; trajectories continue across them"));
        }
        findings.lines(self.cuts.iter().take(SHOWN_ROWS).map(|cut| {
            let (seconds, steps) = (short(cut.seconds), short(cut.steps));
            format!("gap: {seconds} s ({steps} steps) between rows {} and {} of {}", cut.before, cut.after, cut.file)
        }));
        findings.lines(more(self.cuts.len(), ("gap", "gaps")));
        findings.lines(self.dropped.iter().take(SHOWN_ROWS).map(|part| {
            let samples = pluralize(part.samples, "sample", "samples");
            format!("left out: {samples} between gaps, rows {}-{} of {}", part.first, part.last, part.file)
        }));
        findings.lines(more(self.dropped.len(), ("stretch between gaps", "stretches between gaps")));
    }
}

impl FileFacts {
    /// Describes the format of a file if it differs from UTF-8 text separated by commas.
    fn sentence(&self) -> Option<String> {
        let mut facts: Vec<String> = Vec::new();
        facts.extend((self.kind == FileKind::Xlsx).then(|| "the first sheet of a workbook".to_string()));
        facts.extend(self.gzip.then(|| "packed by gzip".to_string()));
        facts.extend(match self.encoding {
            Some(Encoding::Utf16) => Some("text in UTF-16".to_string()),
            Some(Encoding::Windows1252) => Some("text in Windows-1252".to_string()),
            Some(Encoding::Utf8) | None => None,
        });
        let separated = self.separator.map(Separator::named).filter(|text| !text.is_empty());
        facts.extend(separated.map(|text| format!("fields{text}")));
        facts.extend(self.decimal_comma.then(|| "decimal commas".to_string()));
        let units: Vec<String> = self.units.iter().map(|(name, unit)| format!("{name} in {unit}")).collect();
        facts.extend((!units.is_empty()).then(|| format!("units by its header: {}", units.join(", "))));
        (!facts.is_empty()).then(|| format!("{}: {}", self.file, facts.join("; ")))
    }
}

/// States how many entries are not shown.
fn more(all: usize, (one, many): (&str, &str)) -> Option<String> {
    let rest = all.checked_sub(SHOWN_ROWS).filter(|rest| *rest > 0)?;
    Some(format!("and {}", pluralize(rest, &format!("more {one}"), &format!("more {many}"))))
}

impl CoordinateSurvey {
    /// Unit of the coordinate; velocities have this unit per s, accelerations per s^2.
    fn unit(&self) -> String {
        if self.periodic { "rad" } else { "SI" }.to_string()
    }

    fn row(&self) -> Vec<String> {
        let bound = if self.noise_resolved { "" } else { "at most " };
        let noise = format!("{bound}{}", short(self.noise));
        let range = [short(self.min), short(self.max), noise, percentage(self.noise_relative)];
        let motion = [self.velocity, self.acceleration, self.period, self.samples_per_period].map(short);
        [vec![self.name.clone(), self.unit()], range.to_vec(), motion.to_vec()].concat()
    }

    fn smoothing_row(&self) -> Vec<String> {
        let numbers = [self.window_seconds, self.velocity_error, self.acceleration_error].map(short);
        let names = vec![self.name.clone(), self.unit(), self.window.to_string()];
        [names, numbers.to_vec(), vec![percentage(self.acceleration_error_relative)]].concat()
    }
}

impl TrajectorySurvey {
    fn row(&self) -> Vec<String> {
        let rows = format!("{}-{}", self.first_row, self.last_row);
        let jitter = percentage(if self.jitter < ROUNDING_JITTER { 0.0 } else { self.jitter });
        let times = [self.start, self.end, self.rate].map(short);
        [vec![self.name.clone(), rows, self.samples.to_string()], times.to_vec(), vec![jitter]].concat()
    }
}

impl Warning {
    fn row(&self) -> [String; 5] {
        let size = short(self.size);
        let what = match self.kind {
            Kind::Outlier => format!("outlier, off by {size}"),
            Kind::Jump => format!("all later positions are shifted by {size}"),
            Kind::Kink => format!("the velocity jumps by {size}: an impact?"),
            Kind::Frozen => format!("{} equal values: a frozen sensor?", self.size),
        };
        [self.track.clone(), self.row.to_string(), self.coordinate.clone(), short(self.value), what]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suspicions_are_stated_in_words() {
        let frozen = Warning {
            track: "run 1".into(),
            row: 7,
            place: (0, 6),
            coordinate: "x".into(),
            kind: Kind::Frozen,
            value: 0.25,
            size: 40.0,
        };
        assert_eq!(frozen.row(), ["run 1", "7", "x", "0.2500", "40 equal values: a frozen sensor?"]);
        let shifted = Warning { kind: Kind::Jump, size: 0.012_345, ..frozen };
        assert_eq!(shifted.row()[4], "all later positions are shifted by 0.01235");
    }
}

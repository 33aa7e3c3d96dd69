//! Pictures that the report of an experiment takes over from its runs.

use super::experiments::{Experiment, Picture};
use lnn::experiments::{Record, Run};
use lnn::names::pluralize;
use lnn::pipeline::ExperimentDirectory;
use lnn::report::Report;
use serde_json::Value;

/// Name of the file in which a run says what its pictures show.
const CAPTIONS: &str = "captions.json";

/// Beginnings of the names of pictures in the order of a report; training and whatever else come last.
const ORDER: [&str; 9] = [
    "trajectory_",
    "velocity_",
    "trace_",
    "phase_",
    "prediction_error",
    "coordinate_error",
    "energy_",
    "lagrangian",
    "det_mass_matrix",
];

/// Index of a picture in [`ORDER`].
fn place_in_report(file: &str) -> usize {
    ORDER.iter().position(|beginning| file.starts_with(beginning)).unwrap_or(ORDER.len())
}

/// Bytes of pictures that a report takes over from runs at most: a page that opens at once.
const TAKEN: usize = 1 << 20;

/// A picture that a run drew.
pub struct RunPicture {
    svg: Vec<u8>,
    heading: String,
    caption: String,
}

/// The report with as many pictures of runs as [`TAKEN`] allows, and where the others are.
pub fn within(taken: Vec<RunPicture>, report: Report) -> Report {
    let (mut room, mut left) = (TAKEN, 0);
    let mut report = report;
    for RunPicture { svg, heading, caption } in taken {
        if svg.len() <= room {
            room -= svg.len();
            report = report.image(&svg, [&heading, &caption]);
        } else {
            left += 1;
        }
    }
    match left {
        0 => report,
        _ => report
            .paragraph(&format!("{} more in the directories of the runs.", pluralize(left, "picture", "pictures"))),
    }
}

/// Names of the pictures of a run that begin so, in the order of a report.
fn pictures_of(store: &ExperimentDirectory, run: &str, prefix: &str) -> Vec<String> {
    let mut files = store.names(run);
    files.retain(|name| name.starts_with(prefix) && name.ends_with(".svg"));
    files.sort_by_cached_key(|file| (place_in_report(file), file.clone()));
    files
}

/// Pictures that the experiment takes over from the evaluations of its runs, as far as they are there.
pub fn pictures_of_runs(
    experiment: &Experiment,
    results: &[(Run, Option<Record>)],
    store: &ExperimentDirectory,
) -> Vec<RunPicture> {
    let mut figures = Vec::new();
    for prefix in experiment.pictures.iter().flat_map(|picture| match picture {
        Picture::Evaluation(prefixes) => *prefixes,
        _ => &[],
    }) {
        for (run, _) in results.iter().filter(|(_, record)| record.is_some()) {
            let read = |file: &str| store.read(&run.name, file);
            let captions: Value =
                read(CAPTIONS).and_then(|json| serde_json::from_slice(&json).ok()).unwrap_or_default();
            for file in pictures_of(store, &run.name, prefix) {
                let Some(svg) = read(&file) else { continue };
                let text = |key: &str| captions[&file][key].as_str().unwrap_or_default().to_string();
                let (heading, caption) = (text("heading"), text("caption"));
                let heading = if heading.is_empty() { run.label.clone() } else { format!("{}: {heading}", run.label) };
                figures.push(RunPicture { svg, heading, caption });
            }
        }
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::super::experiments::{Scale, find};
    use super::*;
    use lnn::experiments::Outcome;

    #[test]
    fn pictures_come_in_the_order_of_a_report() {
        let directory = tempfile::tempdir().unwrap();
        let experiment = find("double-pendulum").unwrap();
        let run = experiment.runs(Scale::Smoke, 1).remove(0);
        let ordered = [
            "trajectory_theta1.svg",
            "trajectory_theta2.svg",
            "velocity_t.svg",
            "trace_start1.svg",
            "phase_theta1.svg",
            "prediction_error.svg",
            "coordinate_error.svg",
            "energy_drift.svg",
            "energy_error.svg",
            "lagrangian.svg",
            "det_mass_matrix.svg",
            "det_mass_matrix_fast.svg",
            "learning_rate.svg",
            "training_loss.svg",
        ];
        let folder = directory.path().join(&run.name);
        std::fs::create_dir(&folder).unwrap();
        for file in ordered {
            std::fs::write(folder.join(file), b"x").unwrap();
        }
        std::fs::write(
            folder.join(CAPTIONS),
            r#"{"det_mass_matrix.svg": {"heading": "at rest", "caption": "or not"}}"#,
        )
        .unwrap();
        let record = Record {
            run: String::new(),
            outcome: Outcome::Nothing { reason: String::new() },
            losses: Vec::new(),
            times: Vec::new(),
            seconds: 0.0,
        };
        let (name, results) = (run.name.clone(), [(run, Some(record))]);
        let store = ExperimentDirectory::new(directory.path());
        let found = |experiment: &str| -> Vec<String> {
            let captions = pictures_of_runs(find(experiment).unwrap(), &results, &store).len();
            let [Picture::Evaluation(prefixes)] = find(experiment).unwrap().pictures else {
                panic!("no pictures of runs")
            };
            let files: Vec<String> = prefixes.iter().flat_map(|prefix| pictures_of(&store, &name, prefix)).collect();
            assert_eq!(captions, files.len());
            files
        };
        assert_eq!(found("double-pendulum"), ordered);
        let figures = pictures_of_runs(find("training-range").unwrap(), &results, &store);
        assert_eq!((figures[0].heading.as_str(), figures[0].caption.as_str()), ("Double pendulum: at rest", "or not"));
        assert_eq!((figures[1].heading.as_str(), figures[1].caption.as_str()), ("Double pendulum", ""));
        assert_eq!(found("training-range"), ["det_mass_matrix.svg", "det_mass_matrix_fast.svg"]);
        // A report stays small and names the pictures left out.
        let taken = |count| {
            (0..count).map(|_| RunPicture { svg: vec![b'x'; 300_000], heading: String::new(), caption: "a".into() })
        };
        let page = |count| within(taken(count).collect(), Report::new("b")).to_html();
        assert!(page(3).matches("<img").count() == 3 && !page(3).contains("more in"));
        assert!(page(9).matches("<img").count() == 3 && page(9).contains("6 pictures more in the directories"));
        assert!(page(9).len() < 2_000_000);
    }
}

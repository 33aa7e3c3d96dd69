//! Predictions of a real, filmed double pendulum: learned Lagrangians with and without friction, from smoothed
//! accelerations and through the motion, beside what a user would try first: going on at constant velocity, a plain network of
//! the same size that learns the accelerations, and the textbook's double pendulum with six constants fitted to the same film
//! or to another one.
//!
//! And made motion of a double pendulum with 1 % of noise, where the truth is known.
//!
//! And made motion of small systems, where the masses are known that a fit can or cannot tell.
//!
//! And made orbits around a black hole with noise, of which the hole is read.
//!
//! And a made log of a seven-joint arm, learned by its torques.
//!
//! And the same log with the rows of the arm's links known.
//!
//! And made motion of three small systems, with tubes around its predictions.
//!
//! And a made recording with lost rows and a clock that jitters.
//!
//! `lnn-studies measured --part films FILM.csv...` takes films as `examples/pendulum_video.rs` does, 400 frames a second;
//! without files those of Asseman, Kornuta and Ozcan ("Learning beyond simulated physics", 2018) if they stand in
//! `../shared/data/ibm-double-pendulum`; gravity pulls along the x axis of these pictures. Every film is a recording of its own: the first four fifths are learned from, the
//! rest is predicted, 0.5 s at a time. `--part noise` is the made motion, `--part rows` reads and surveys ten million
//! rows and says what that took, `--part textbook` the films without what has to be trained, `--part determination` the
//! small systems, some minutes, `--part orbits` orbits around a hole, a quarter of an hour, `--part arm7` the arm, some minutes, `--part links` the arm by its rows, `--part tubes` the tubes, some minutes, `--part lost` the lost rows, some minutes;
//! without `--part` all. Writes `films.csv`, `noise.csv`, `determination.csv`, `orbits.csv`, `arm7.csv`, `links.csv`, `tubes.csv` and `lost.csv` into `target/measured`.

#[allow(dead_code)]
#[path = "../../../tests/suite/common/arm.rs"]
pub mod arm;
mod arm7;
mod determination;
mod lost;
mod noise;
mod orbits;
mod plain;
mod recorded_orbits;
mod rows;
mod textbook;
mod tubes;
#[allow(dead_code)]
#[path = "../../../examples/pendulum_video.rs"]
mod video;

use crate::{ROOT, results};
use lnn::analysis::{
    PredictionError, Predictions, Window, predict_by_constant_velocity, predict_by_motion, prediction_error,
};
use lnn::configuration::{Config, Penalty};
use lnn::data::{Datasets, PrepareOptions, RecordingSplit};
use lnn::lagrangian::EulerLagrange;
use lnn::network::NetworkLagrangian;
use lnn::recording::{RecordedTrajectory, Recording, Targets};
use lnn::shooting::{Shooting, Task, fit};
use lnn::training::{Hooks, train};
use plain::Plain;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;
use textbook::Textbook;

/// Frames per second.
const RATE: f64 = 400.0;
/// How far ahead the rest of a film is predicted, in s.
const HORIZON: f64 = 0.5;
/// Times ahead at which predictions are judged, in s.
const AHEAD: [f64; 4] = [0.125, 0.25, 0.375, HORIZON];
/// Threads.
const THREADS: usize = 2;

/// What can be measured.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Part {
    Rows,
    Noise,
    Films,
    Textbook,
    Determination,
    Orbits,
    Arm7,
    Links,
    Tubes,
    Lost,
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    /// What is measured; all parts if not given
    #[arg(long)]
    part: Option<Part>,
    /// Films of `films` and `textbook`: `x_red,y_red,x_green,y_green,x_blue,y_blue`
    films: Vec<PathBuf>,
}

/// Seeds of the small systems: those before them served to choose.
const SEEDS: std::ops::Range<u64> = 20..40;

/// How much work is done.
#[derive(Clone, Copy)]
pub struct Scale {
    epochs: Option<usize>,
    hidden: [usize; 3],
    shooting_epochs: usize,
}

/// A film as angles.
fn recording(path: &Path, text: &str) -> Result<Recording, String> {
    let frames = video::read(text)?;
    let film = video::fit(&frames, video::Down::Right).ok_or("no frames".to_string())?;
    match video::pull(&film.angles, video::Down::Right, RATE) {
        Some([x, y]) if x > y.abs() => println!("gravity: {x:.1} per s^2 along x, {y:.1} along y"),
        found => return Err(format!("gravity does not pull along x: {found:?}")),
    }
    let times = (0..film.angles.len()).map(|k| k as f64 / RATE).collect();
    let (q, name) = (film.angles.concat(), path.display().to_string());
    let track = RecordedTrajectory { name, times, q, v: vec![], a: vec![], force: vec![] };
    let coordinates = ["theta1", "theta2"].map(String::from).to_vec();
    Ok(Recording { coordinates, periodic: vec![true; 2], tracks: vec![track] })
}

/// A recording smoothed and divided as `lnn fit` does.
fn measured(recording: &Recording) -> RecordingSplit {
    RecordingSplit::new(recording, &PrepareOptions::default()).expect("a recording long enough")
}

/// A predictor's errors at a few times, and how long it learned.
struct Line {
    name: &'static str,
    errors: Vec<PredictionError>,
    seconds: f64,
}

/// Learns a Lagrangian as `lnn fit` does.
fn learned(measured: &RecordingSplit, friction: bool, targets: Targets, scale: Scale) -> NetworkLagrangian<f64> {
    let data: Datasets<f32> = measured.datasets(targets).expect("states with full windows");
    let mut config: Config = lnn::presets::suggested("double pendulum", &data);
    config.network.hidden = scale.hidden.to_vec();
    config.network.dissipation = friction.then_some(16);
    let suggested = config.phases[0].epochs;
    let suggested = if targets == Targets::Motion { suggested.div_ceil(3) } else { suggested };
    config.phases[0].epochs = scale.epochs.unwrap_or(suggested);
    config.phases[0].t_max = config.phases[0].epochs as f64;
    let architecture =
        config.architecture_with(["theta1", "theta2"].into_iter(), vec![true; 2], data.training[0].physical_scale());
    let architecture = architecture.expect("no names in the configuration");
    let penalty = Penalty::Eigenvalue { lambda: config.penalty.lambda() };
    let hooks = Hooks::default();
    let mut weights = train(&config, &architecture, penalty, data, THREADS, &hooks).expect("a training").weights;
    if targets == Targets::Motion {
        let (training, validation) = (measured.training.estimated(), measured.validation.estimated());
        let noise = measured.noise();
        let settings = Shooting { epochs: scale.shooting_epochs, ..Shooting::default() };
        let architecture = &architecture;
        let task = Task {
            architecture,
            penalty,
            weights,
            training: &training,
            validation: &validation,
            noise: &noise,
            constraints: None,
            seed: 0,
        };
        weights = fit(&settings, task, THREADS, &hooks).expect("a fit").weights;
    }
    NetworkLagrangian::new(architecture, weights).expect("weights of this architecture").cast::<f64>()
}

/// Predictions of the rest of a film by all that can be learned from its first part, and by the textbook's pendulum learned
/// from another; without `scale` nothing is trained.
fn lines(
    recording: &Recording,
    measured: &RecordingSplit,
    other: Option<&RecordingSplit>,
    scale: Option<Scale>,
) -> Vec<Line> {
    for (name, c) in recording.coordinates.iter().zip(&measured.smoothing.coordinates) {
        let (noise, relative) = (c.noise.sigma, 100.0 * c.quality.relative());
        println!("{name}: noise {noise:.2e} rad, windows of {:.3} s, accelerations good to {relative:.1} %", c.seconds);
    }
    let test = measured.test.estimated();
    let pairs = test.iter().zip(&measured.test.states);
    let windows: Vec<Window> = pairs.flat_map(|(e, s)| Window::cut(*e, s.interior(), 2, HORIZON)).collect();
    let mut lines = Vec::new();
    let mut add = |name: &'static str, predict: &mut dyn FnMut() -> Predictions| {
        let start = Instant::now();
        let predictions = predict();
        let seconds = start.elapsed().as_secs_f64();
        let at = |t: f64| prediction_error(&windows, &predictions, (&recording.periodic, &[1.0; 2]), t);
        let errors: Vec<_> = AHEAD.map(at).to_vec();
        let medians: Vec<String> = errors.iter().map(|e| format!("{:.4}", e.median)).collect();
        let (medians, missing) = (medians.join("  "), errors[AHEAD.len() - 1].missing);
        println!("  {name:48} {medians} rad after 0.125, 0.25, 0.375, 0.5 s; {missing} given up; {seconds:.0} s");
        lines.push(Line { name, errors, seconds });
    };
    println!("  {} windows of {HORIZON} s, median errors:", windows.len());
    add("constant velocity", &mut || predict_by_constant_velocity(&windows));
    for (name, taught) in
        [("textbook, six constants", Some(measured)), ("textbook, six constants of another film", other)]
    {
        let Some(taught) = taught else { continue };
        add(name, &mut || {
            let model = Textbook::fit(taught);
            let [a, b, g1, g2, f1, f2] = model.0.into();
            println!("  a {a:.4}, b {b:.4}, g1 {g1:.2}, g2 {g2:.2} per s^2, f1 {f1:.4}, f2 {f2:.4} per s");
            predict_by_motion(&model as &dyn EulerLagrange<f64>, &windows, THREADS)
        });
    }
    let Some(scale) = scale else { return lines };
    add("plain network on smoothed accelerations", &mut || {
        let data: Datasets<f32> = measured.datasets(Targets::Smoothed).expect("states with full windows");
        let config = lnn::presets::suggested("plain", &data);
        let epochs = scale.epochs.unwrap_or(config.phases[0].epochs);
        let model = Plain::learn(&data.training[0], &scale.hidden, epochs, config.phases[0].rate, 0);
        predict_by_motion(&model as &dyn EulerLagrange<f64>, &windows, THREADS)
    });
    for (name, friction, targets) in [
        ("Lagrangian, smoothed accelerations", false, Targets::Smoothed),
        ("Lagrangian and friction, smoothed accelerations", true, Targets::Smoothed),
        ("Lagrangian, through the motion", false, Targets::Motion),
        ("Lagrangian and friction, through the motion", true, Targets::Motion),
    ] {
        let mut predict = || predict_by_motion(&learned(measured, friction, targets, scale), &windows, THREADS);
        add(name, &mut predict);
    }
    lines
}

/// Measures what is asked for, and writes it.
pub fn run(Args { part, films }: Args) {
    let asked = |name: Part| part.is_none_or(|part| part == name);
    let folder = results("measured");
    let scale = Scale { epochs: None, hidden: [128; 3], shooting_epochs: Shooting::default().epochs };
    // First, while the process is small.
    if asked(Part::Rows) {
        rows::time(&folder.join("rows.csv"), 10_000_000);
    }
    if asked(Part::Noise) {
        let rows = noise::compare(50, 0..3, scale);
        let csv = format!("seed,learned_from,error,seconds\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("noise.csv"), csv).expect("room for the results");
    }
    if asked(Part::Determination) {
        let small = Scale { epochs: Some(60), hidden: [48; 3], shooting_epochs: 0 };
        let rows = determination::compare(SEEDS, (12, 8.0), small);
        let csv = format!("case,seed,quantity,learned,low,high,truth\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("determination.csv"), csv).expect("room for the results");
    }
    if asked(Part::Orbits) {
        println!("errors: {}", orbits::TOLD.join("; "));
        let counts = [10, 30, 100, 300];
        let cases: Vec<(usize, f64)> = [0.01, 0.001].iter().flat_map(|&noise| counts.map(|n| (n, noise))).collect();
        let rows = orbits::compare(&cases, true, (None, THREADS));
        let csv = format!("learned_by,orbits,noise,quantity,error,seconds\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("orbits.csv"), csv).expect("room for the results");
    }
    if asked(Part::Arm7) {
        let rows = arm7::compare(0..3, 20.0, &folder, (None, THREADS));
        let csv = format!("seed,learned_from,joint,nmse,inertia\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("arm7.csv"), csv).expect("room for the results");
    }
    if asked(Part::Links) {
        let rows = arm7::links(0..3, 20.0, &folder, 20_000);
        let csv = format!("seed,joint,nmse,inertia\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("links.csv"), csv).expect("room for the results");
    }
    if asked(Part::Tubes) {
        let small = Scale { epochs: Some(60), hidden: [48; 3], shooting_epochs: 0 };
        let rows = tubes::compare(tubes::Motions { counts: [24, 1000, 1000], seconds: 3.0, ahead: 2.0 }, small);
        let csv = format!("system,share,calibrated,fresh,inside,half_width\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("tubes.csv"), csv).expect("room for the results");
    }
    if asked(Part::Lost) {
        let rows = lost::compare(0..3, (12, 8.0), None);
        let csv = format!("seed,entry,error,seconds\n{}\n", rows.join("\n"));
        std::fs::write(folder.join("lost.csv"), csv).expect("room for the results");
    }
    if asked(Part::Films) {
        std::fs::write(folder.join("films.csv"), filmed(films, Some(scale))).expect("room for the results");
    } else if asked(Part::Textbook) {
        std::fs::write(folder.join("textbook.csv"), filmed(films, None)).expect("room for the results");
    }
}

/// Compares the predictors on every film; the table as CSV.
fn filmed(mut films: Vec<PathBuf>, scale: Option<Scale>) -> String {
    if films.is_empty() {
        let folder = Path::new(ROOT).join("../shared/data/ibm-double-pendulum");
        films = (0..3).map(|k| folder.join(format!("{k}.csv"))).filter(|path| path.exists()).collect();
    }
    if films.is_empty() {
        println!("no films: expected files of `x_red,y_red,x_green,y_green,x_blue,y_blue` as arguments");
    }
    let mut csv = "film,predictor,seconds,median,rms,nine_of_ten,windows,given_up,learning_seconds\n".to_string();
    let read = |film: &PathBuf| {
        let text = std::fs::read_to_string(film).unwrap_or_else(|e| panic!("{}: {e}", film.display()));
        let recording = recording(film, &text).unwrap_or_else(|e| panic!("{}: {e}", film.display()));
        let measured = measured(&recording);
        (recording, measured)
    };
    let recordings: Vec<(Recording, RecordingSplit)> = films.iter().map(read).collect();
    for (k, film) in films.iter().enumerate() {
        let name = film.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        println!("{name}");
        let (recording, measured) = &recordings[k];
        let other = Some(&recordings[(k + 1) % recordings.len()].1).filter(|_| recordings.len() > 1);
        for Line { name: predictor, errors, seconds } in lines(recording, measured, other, scale) {
            for e in errors {
                let PredictionError { seconds: ahead, rms, median, p90, windows, missing } = e;
                writeln!(csv, "{name},{predictor},{ahead},{median},{rms},{p90},{windows},{missing},{seconds:.1}")
                    .expect("writing to a string");
            }
        }
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A swing of two uncoupled, damped oscillators, for the trial run.
    fn made() -> Recording {
        let times: Vec<f64> = (0..1200).map(|k| k as f64 / RATE).collect();
        let q = times.iter().flat_map(|t| [(3.0 * t).cos() * (-0.1 * t).exp(), 0.5 * (5.0 * t).sin()]).collect();
        let track = RecordedTrajectory { name: "made".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let coordinates = ["theta1", "theta2"].map(String::from).to_vec();
        Recording { coordinates, periodic: vec![true; 2], tracks: vec![track] }
    }

    /// Everything once, on little motion.
    #[test]
    fn everything_runs() {
        let scale = Scale { epochs: Some(2), hidden: [8; 3], shooting_epochs: 1 };
        let measured = measured(&made());
        assert_eq!(lines(&made(), &measured, Some(&measured), Some(scale)).len(), 8);
        assert_eq!(noise::compare(5, 0..1, scale).len(), 3);
        assert_eq!(determination::compare(0..1, (4, 3.0), scale).len(), 5 + 6 + 3 + 3 + 5 + 3);
        assert_eq!(orbits::compare(&[(6, 0.001)], true, (Some(1), 1)).len(), 15);
        let place = tempfile::tempdir().expect("a folder");
        assert_eq!(arm7::compare(0..1, 8.0, place.path(), (Some(1), 1)).len(), 2 * 7);
        assert_eq!(arm7::links(0..1, 4.0, place.path(), 64).len(), 7);
        let few = tubes::Motions { counts: [4, 20, 3], seconds: 2.0, ahead: 0.1 };
        assert_eq!(tubes::compare(few, scale).len(), 3 * 2);
        assert_eq!(lost::compare(0..1, (6, 4.0), Some(scale)).len(), 3);
        let found = rows::time(&place.path().join("rows.csv"), 2000);
        assert_eq!((found.samples, found.cuts.len(), found.warnings.len()), (2000, 0, 0));
    }
}

//! Recorded arms: a network that knows nothing of arms beside the textbook's arms, by what either predicts of runs that both have not seen.
//!
//! `cargo run --release --example arms -- double.csv` takes columns `run,t,theta1,theta2,theta1_dot,theta2_dot`, absolute angles in rad with pi
//! hanging, or those of three arms, such as the recordings of the DynamicsLab's pendula (University of Washington). The last four runs are held
//! back. From the others a Lagrangian is learned as by `lnn fit --structure mechanical --friction`, and the constants of
//! `examples/systems/double_arm.toml` or `triple_arm.toml` are identified. A seed of the network may follow the file. Without a file it makes
//! runs of its own and learns little.

use lnn::identification::{Identified, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::pipeline::parse_system;
use lnn::prelude::*;
use lnn::random::RngStream;
use lnn::recording::{Columns, LoadedRecording, RecordedTrajectory, Recording};
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;
use std::path::Path;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Runs that nothing is learned from.
const HELD_BACK: usize = 4;
/// Share of the others that judges the network while it learns.
const HELD_OUT: f64 = 0.1;
/// Length of the segments of the arms in s: what friction does to them takes longer than the segments that are chosen by default.
const SEGMENT: f64 = 0.25;
/// Times ahead at which predictions are judged, in s.
pub const AHEAD: [f64; 4] = [0.1, 0.25, 0.5, 1.0];

pub fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match &words[..] {
        [] => made().map(|_| ()),
        [file, seed @ ..] if seed.len() < 2 => {
            let seed = seed.first().map_or(Ok(0), |seed| seed.parse())?;
            let (recording, held) = read(Path::new(file))?;
            let found = identified(&recording)?;
            let fit = Fit::recording(recording.clone()).structure(Structure::Mechanical);
            let fit = fit.options(|options| options.held_out = HELD_OUT).seed(seed);
            show(&recording, &held, &found, fit.friction(true).threads(2)).map(|_| ())
        }
        _ => Err("expected a file, and a seed if any".into()),
    }
}

/// The runs of a file: those that are learned from, and those that are held back.
pub fn read(path: &Path) -> Outcome<(Recording, Vec<RecordedTrajectory>)> {
    let header = std::fs::read_to_string(path)?.lines().next().unwrap_or_default().to_string();
    let arms = if header.contains("theta3") { 3 } else { 2 };
    let angles: Vec<String> = (1..=arms).map(|i| format!("theta{i}")).collect();
    let velocity = angles.iter().map(|name| format!("{name}_dot")).collect();
    let columns = Columns {
        periodic: angles.clone(),
        coords: angles,
        velocity,
        trajectory: Some("run".into()),
        ..Columns::default()
    };
    let mut recording = LoadedRecording::read(&[path], &columns)?.recording;
    let runs = recording.tracks.len();
    if runs <= HELD_BACK {
        return Err(format!("expected more than {HELD_BACK} runs, found {runs}").into());
    }
    let held = recording.tracks.split_off(runs - HELD_BACK);
    Ok((recording, held))
}

/// The textbook's arms with values of their constants.
pub fn textbook(arms: usize, given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
    let text = match arms {
        2 => include_str!("systems/double_arm.toml"),
        _ => include_str!("systems/triple_arm.toml"),
    };
    let system = parse_system(text).map_err(|(line, problem)| format!("{line}: {problem}"))?;
    let given: Vec<(String, String)> = given.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    Ok(SystemInstance::new(Cow::Owned(system), &given)?)
}

/// The constants of the textbook's arms, and the offsets of the encoders.
pub fn identified(recording: &Recording) -> Outcome<Identified> {
    let options = IdentifyOptions::new().offsets(&recording.coordinates).segment(SEGMENT).threads(2);
    Ok(identify(&textbook(recording.n(), &[])?, recording, &options)?)
}

/// Median over starts in runs of the rms error of the angles at the times of [`AHEAD`]; sensors have offsets, `(n)`.
pub fn ahead(model: &dyn EulerLagrange<f64>, held: &[RecordedTrajectory], offsets: &[f64]) -> Outcome<[f64; 4]> {
    let n = offsets.len();
    let mut medians = [f64::NAN; 4];
    for (median, seconds) in medians.iter_mut().zip(AHEAD) {
        let mut errors = Vec::new();
        for track in held {
            let step = track.times[1] - track.times[0];
            let samples = (seconds / step).round() as usize;
            for first in (0..track.len().saturating_sub(samples)).step_by(100) {
                let [q, v] = [&track.q, &track.v].map(|values| &values[first * n..(first + 1) * n]);
                let q: Vec<f64> = q.iter().zip(offsets).map(|(q, offset)| q - offset).collect();
                let motion = model.rollout(&q, v, seconds, seconds)?;
                let end = track.q[(first + samples) * n..(first + samples + 1) * n].iter().zip(offsets);
                let pairs = motion.q[motion.q.len() - n..].iter().zip(end);
                let square: f64 = pairs.map(|(a, (b, offset))| (a - (b - offset)).powi(2)).sum();
                errors.push((square / n as f64).sqrt());
            }
        }
        errors.sort_by(f64::total_cmp);
        *median = *errors.get(errors.len() / 2).ok_or("the runs that are held back are too short")?;
    }
    Ok(medians)
}

/// A line of errors.
pub fn line(errors: [f64; 4]) -> String {
    errors.map(|error| format!("{error:.4}")).join(", ") + " rad"
}

/// Fits the network and prints the errors of both on the runs that are held back: of the network, and of the textbook.
fn show(recording: &Recording, held: &[RecordedTrajectory], found: &Identified, fit: Fit) -> Outcome<[[f64; 4]; 2]> {
    let values: Vec<(&str, f64)> = found.constants.iter().map(|c| (c.symbol.as_str(), c.value)).collect();
    let offsets: Vec<f64> = found.sensors.iter().map(|sensor| sensor.value).collect();
    let book = textbook(recording.n(), &values)?.build()?;
    let learned = fit.run()?;
    let none = vec![0.0; recording.n()];
    let errors = [ahead(&learned.network, held, &none)?, ahead(book.as_ref(), held, &offsets)?];
    println!("{} runs learned from, {} held back; errors {AHEAD:?} s ahead", recording.tracks.len(), held.len());
    println!("network that knows nothing of arms: {}", line(errors[0]));
    println!("textbook, {} constants identified: {}", values.len(), line(errors[1]));
    Ok(errors)
}

/// Seven runs of 2 s at 200 Hz of two arms with friction, noise of 0.3 mrad, and a small network.
pub fn made() -> Outcome<[[f64; 4]; 2]> {
    let truth = textbook(2, &[("A1", 0.025), ("A2", 0.008), ("D2", 0.04), ("l1", 0.25), ("c1", 0.002)])?.build()?;
    let mut rng = RngStream::Trajectories.generator(0);
    let mut tracks = Vec::new();
    for k in 0..7 {
        let start = [1.5 + 0.4 * f64::from(k), 2.5 - 0.5 * f64::from(k)];
        let motion = truth.rollout(&start, &[0.0, 0.0], 2.0, 0.005)?;
        let q = motion.q.iter().map(|q| q + 3e-4 * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
        let name = format!("run {k}");
        tracks.push(RecordedTrajectory { name, times: motion.t, q, v: motion.v, a: vec![], force: vec![] });
    }
    let held = tracks.split_off(tracks.len() - HELD_BACK);
    let coordinates = vec!["theta1".into(), "theta2".into()];
    let recording = Recording { coordinates, periodic: vec![true; 2], tracks };
    let found = identified(&recording)?;
    let fit = Fit::recording(recording.clone()).friction(true).structure(Structure::Mechanical).configure(|config| {
        config.training.network.hidden = vec![16, 16];
        (config.training.phases[0].epochs, config.training.phases[0].t_max) = (20, 20.0);
    });
    let errors = show(&recording, &held, &found, fit)?;
    assert!(errors[1][3] < 0.01 && errors[0].iter().all(|error| error.is_finite()), "{errors:?}");
    Ok(errors)
}

//! Formulas found in made motion, of which the truth is known, and in real motion.
//!
//! `lnn-studies formula --part positions` records 100 runs of 5 s at 100 Hz of four systems, positions alone with independent
//! noise, and looks for their formulas, for ten seeds each; a formula is right if it has these terms and no other. `--part half` is the same
//! at half the noise, `--part tenth` with 10 runs at a third of the noise, `--part friction` with friction in the joints at half the noise,
//! `--part forces` under known forces at 0.06, `--part clean` other systems without noise and with 1e-3, `--part cart-poles` a damped
//! double cart-pole, `--part outside` systems that the library does not hold, `--part arms` recorded pendula of one, two and three arms (DynamicsLab, University
//! of Washington), if `--arms DIRECTORY` or `../shared/data/multi-arm-pendulum` has their files, `--part metrics` metrics
//! of networks that it trains by the preset `quick` as metrics, `L = v^T g(q) v/2`, or with `--black-box` as any function. Formulas
//! of made motion are written to `target/formula/PART.csv` as well. Times are processor times.

mod cases;

use crate::{ARMS, results};
use cases::{CART_POLES, CLEAN, Case, FRICTION, METRICS, Metric, OUTSIDE, POSITIONS, Recorded};
use clap::ValueEnum;
use lnn::formula::{FormulaOptions, FoundFormula, Verdict};
use lnn::lagrangian::SystemInstance;
use lnn::network::Structure;
use lnn::presets::Preset;
use lnn::recording::{Columns, LoadedRecording};
use lnn::training::{Hooks, run as train};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};

/// Outcome of one search.
struct Outcome {
    right: bool,
    verdict: Verdict,
    /// Largest relative error of a constant, if the terms are right.
    error: f64,
    residual: f64,
    seconds: f64,
}

/// What a found formula is beside the truth, up to a common factor unless known forces give it.
fn judge(truth: &[(&str, f64)], found: &FoundFormula, scaled: bool) -> (bool, f64) {
    let name = |t: &lnn::formula::FoundTerm| if t.dissipation { format!("D:{}", t.term) } else { t.term.clone() };
    let pairs: Vec<Option<(f64, f64)>> = truth
        .iter()
        .map(|(term, truth)| found.terms.iter().find(|t| name(t) == *term).map(|t| (t.coefficient, *truth)))
        .collect();
    let right = found.terms.len() == truth.len() && pairs.iter().all(Option::is_some);
    if !right {
        return (false, f64::NAN);
    }
    let pairs: Vec<(f64, f64)> = pairs.into_iter().flatten().collect();
    let factor = if scaled { 1.0 } else { pairs[0].1 / pairs[0].0 };
    (true, pairs.iter().map(|(c, truth)| (c * factor / truth - 1.0).abs()).fold(0.0, f64::max))
}

/// Processor time of this program so far, in s: user and system time of `/proc/self/stat`, in hundredths. 0 where there is none.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name, in parentheses, may hold blanks.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn search(case: &Case, how: Recorded, show: bool) -> Outcome {
    let recording = case.record(how);
    let started = processor_time();
    let mut options = case.options(how.seed);
    options.scale = None;
    match FoundFormula::of_motion(&recording, &options) {
        Ok(found) => {
            let seconds = processor_time() - started;
            let (right, error) = judge(case.truth, &found, how.force > 0.0);
            if show || (!right && !case.truth.is_empty()) {
                println!("    L = {}", found.text(false));
                if options.friction {
                    println!("    D = {}", found.text(true));
                }
                for t in &found.terms {
                    println!("      {} {:.6} +- {:.1e}, {:.2}", t.term, t.coefficient, t.standard_error, t.probability);
                }
            }
            Outcome { right, verdict: found.verdict, error, residual: found.residual, seconds }
        }
        Err(error) => {
            println!("    {error}");
            let seconds = processor_time() - started;
            Outcome { right: false, verdict: Verdict::NotInLibrary, error: f64::NAN, residual: f64::NAN, seconds }
        }
    }
}

/// One line for a system at a noise, over all seeds.
fn line(case: &Case, how: Recorded, seeds: u64, show: bool, csv: &mut String) -> bool {
    let mut outcomes = Vec::new();
    for seed in 0..seeds {
        let outcome = search(case, Recorded { seed, ..how }, show);
        let Outcome { right, verdict, error, residual, seconds } = &outcome;
        println!(
            "  seed {seed}: right {right}, {verdict:?}, constants within {:.3} %, residual {residual:.3}, {seconds:.1} s",
            100.0 * error
        );
        let found = *verdict == Verdict::Found;
        csv.push_str(&format!(
            "{},{},{},{},{seed},{right},{found},{error},{residual},{seconds:.1}\n",
            case.name, how.sigma, how.runs, how.force
        ));
        outcomes.push(outcome);
    }
    let right = outcomes.iter().filter(|o| o.right).count();
    let found = outcomes.iter().filter(|o| o.verdict == Verdict::Found).count();
    let worst = outcomes.iter().map(|o| o.error).filter(|e| e.is_finite()).fold(0.0, f64::max);
    let seconds = outcomes.iter().map(|o| o.seconds).sum::<f64>() / outcomes.len().max(1) as f64;
    println!(
        "{:32} sigma {:<7} {:>3} runs: right {right} of {seeds}, found {found}, constants within {:.2} %, {seconds:.1} s each",
        case.name,
        how.sigma,
        how.runs,
        100.0 * worst
    );
    right == outcomes.len()
}

const USUAL: Recorded = Recorded { runs: 100, seconds: 5.0, rate: 100.0, sigma: 0.0, seed: 0, force: 0.0 };

/// What is measured.
#[derive(Clone, Copy, ValueEnum)]
enum Part {
    Positions,
    Half,
    Tenth,
    Friction,
    Forces,
    Clean,
    CartPoles,
    Outside,
    Arms,
    Metrics,
}

/// The systems of a part and how each is recorded; none of the parts that are not about made motion.
fn recorded(part: Part) -> Vec<(&'static Case, Recorded)> {
    let noisy = |cases: &'static [(Case, f64)], share: f64| {
        cases.iter().map(move |(case, sigma)| (case, Recorded { sigma: sigma * share, ..USUAL }))
    };
    match part {
        Part::Positions => noisy(&POSITIONS, 1.0).collect(),
        Part::Half => noisy(&POSITIONS, 0.5).collect(),
        Part::Tenth => noisy(&POSITIONS, 1.0 / 3.0).map(|(case, how)| (case, Recorded { runs: 10, ..how })).collect(),
        Part::Friction => noisy(&FRICTION, 1.0).collect(),
        Part::Forces => {
            POSITIONS[..3].iter().map(|(case, _)| (case, Recorded { sigma: 0.06, force: 5.0, ..USUAL })).collect()
        }
        Part::Clean => {
            CLEAN.iter().flat_map(|case| [0.0, 1e-3].map(|sigma| (case, Recorded { sigma, ..USUAL }))).collect()
        }
        Part::CartPoles => vec![(&CART_POLES, Recorded { sigma: 0.01, ..USUAL })],
        Part::Outside => OUTSIDE.iter().map(|case| (case, Recorded { sigma: 1e-3, ..USUAL })).collect(),
        Part::Arms | Part::Metrics => vec![],
    }
}

/// Accuracy that is asked for of the arms' angles, in rad: what the textbook's equations reach.
const ARMS_NOISE: f64 = 5e-4;
/// One sample of so many of the recordings at 1 kHz.
const ARMS_EVERY: usize = 5;
/// Terms of the triple arm with its authors' constants, the coefficient of the first square of a velocity being 1/2.
const TRIPLE: [(&str, f64); 9] = [
    ("theta1_dot^2", 0.5),
    ("theta2_dot^2", 0.4846),
    ("theta3_dot^2", 0.1122),
    ("theta1_dot*theta2_dot*cos(theta1 - theta2)", 0.7789),
    ("theta1_dot*theta3_dot*cos(theta1 - theta3)", 0.2025),
    ("theta2_dot*theta3_dot*cos(theta2 - theta3)", 0.2680),
    ("cos(theta1)", -58.07),
    ("cos(theta2)", -44.21),
    ("cos(theta3)", -11.49),
];

/// Eccentricity `e` and offset `d` of the encoders of the double arm, in rad, as the formula without them shows them: an arm stands at
/// `theta - e cos(theta) + d` where they read `theta`. Then `theta1_dot^2/2` makes `e sin(theta1) theta1_dot^2`, and `c cos(theta1)` makes
/// `c e/2 sin(2 theta1) - c d sin(theta1)`.
const ENCODERS: [[f64; 2]; 2] = [[3.05e-3, -2.3e-3], [-1.0e-3, 0.0]];

/// Formulas of recorded pendula, where their files are.
fn arms(folder: &Path, only: &str) {
    let all: [(&str, usize, &[[f64; 2]]); 4] =
        [("single", 1, &[]), ("double", 2, &[]), ("double", 2, &ENCODERS), ("triple", 3, &[])];
    for (name, n, encoders) in all.into_iter().filter(|(name, ..)| name.contains(only)) {
        let path = folder.join(format!("{name}.csv"));
        if !path.exists() {
            println!("{}: not there", path.display());
            continue;
        }
        let coords: Vec<String> = (1..=n).map(|i| format!("theta{i}")).collect();
        let columns =
            Columns { periodic: coords.clone(), coords, trajectory: Some("run".into()), ..Columns::default() };
        let mut recording = LoadedRecording::read(&[&path], &columns).expect("the columns of the authors").recording;
        for track in &mut recording.tracks {
            let rows = track.q.chunks_exact(n).step_by(ARMS_EVERY);
            track.q = rows.flatten().copied().collect();
            for row in track.q.chunks_exact_mut(n) {
                row.iter_mut().zip(encoders).for_each(|(angle, [e, d])| *angle += d - e * angle.cos());
            }
            track.times = track.times.iter().step_by(ARMS_EVERY).copied().collect();
        }
        recording.tracks.retain(|track| track.times.len() > 30);
        let started = processor_time();
        let noise = Some(vec![ARMS_NOISE; n]);
        let options =
            FormulaOptions { friction: true, gyroscopic: false, noise, threads: 2, ..FormulaOptions::default() };
        let found = FoundFormula::of_motion(&recording, &options).expect("motion long enough");
        let seconds = processor_time() - started;
        println!(
            "{name} arm{}, {} runs: {:?}, residual {:.3}, {seconds:.1} s",
            if encoders.is_empty() { "" } else { ", encoders corrected" },
            recording.tracks.len(),
            found.verdict,
            found.residual
        );
        for t in &found.terms {
            let kind = if t.dissipation { "D" } else { "L" };
            let published = TRIPLE.iter().find(|(term, _)| n == 3 && !t.dissipation && *term == t.term);
            let beside = published.map_or(String::new(), |(_, c)| {
                format!(", published {c}, {:+.1} %", 100.0 * (t.coefficient / c - 1.0))
            });
            println!(
                "  {kind} {} {:.5} +- {:.1e}, probability {:.2}{beside}",
                t.term, t.coefficient, t.standard_error, t.probability
            );
        }
    }
}

/// States at which a model is asked.
const STATES: usize = 1500;

/// The metric of a network of this structure, trained by the preset `quick`, as a formula, for one seed.
fn metric(case: &Metric, structure: Structure, seed: u64, show: bool) {
    let system = SystemInstance::<f64>::named(case.name, &[]).expect("a system of the catalogue");
    let mut config = Preset::Quick.config_of(&system, structure).expect("every system has a quick preset");
    config.seed = seed;
    let model = train::<f32>(&config, 2, &Hooks::default()).expect("a training").model.cast::<f64>();
    let n = system.coordinates;
    let (bounds, mut rng) = (system.system.validation(n), ChaCha8Rng::seed_from_u64(seed));
    let mut draw = |sides: &[(f64, f64)]| -> Vec<f64> {
        sides.iter().map(|&(low, high)| low + (high - low) * rng.random::<f64>()).collect()
    };
    let (mut q, mut v) = (Vec::new(), Vec::new());
    while q.len() < STATES * n {
        let (at, mut speed) = (draw(&bounds.positions), draw(&bounds.velocities));
        if system.check_domain(&at).is_ok() && system.impose_constraint(&at, &mut speed).is_ok() {
            q.extend(at);
            v.extend(speed);
        }
    }
    let coordinates = system.system.coordinates(n);
    let names: Vec<String> = coordinates.iter().map(|c| c.name.to_string()).collect();
    let periodic: Vec<bool> = coordinates.iter().map(|c| c.periodic).collect();
    let options = FormulaOptions {
        families: Some(case.basis.parse().expect("families")),
        functions: case.functions.iter().map(ToString::to_string).collect(),
        gyroscopic: false,
        seed,
        ..FormulaOptions::default()
    };
    let started = processor_time();
    let found = FoundFormula::of_model(&model, (&names, &periodic), (&q, &v), &options).expect("a library");
    let (right, error) = judge(case.truth, &found, false);
    println!(
        "{:24} {} seed {seed}: right {right}, {:?}, constants within {:.3} %, residual {:.4}, {:.1} s",
        case.name,
        structure.name(),
        found.verdict,
        100.0 * error,
        found.residual,
        processor_time() - started
    );
    if show || !right {
        println!("    L = {}", found.text(false));
    }
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    /// What is measured; all parts if not given
    #[arg(long)]
    part: Option<Part>,
    /// Seeds from 0 on
    #[arg(long, default_value_t = 10)]
    seeds: u64,
    /// Only systems of which the name contains this text
    #[arg(long, default_value = "")]
    only: String,
    /// Print the formulas
    #[arg(long)]
    show: bool,
    /// Learn `metrics` as any function of positions and velocities
    #[arg(long)]
    black_box: bool,
    /// Folder of the recorded pendula
    #[arg(long, default_value = ARMS)]
    arms: PathBuf,
}

/// Measures the parts that are asked for.
pub fn run(Args { part, seeds, only, show, black_box, arms: folder_of_arms }: Args) {
    let structure = if black_box { Structure::BlackBox } else { Structure::Metric };
    let folder = results("formula");
    for part in part.map_or(Part::value_variants().to_vec(), |part| vec![part]) {
        let name = part.to_possible_value().expect("no part is hidden").get_name().to_string();
        println!("{name}");
        match part {
            Part::Arms => arms(&folder_of_arms, &only),
            Part::Metrics => {
                for case in METRICS.iter().filter(|case| case.name.contains(&only)) {
                    (0..seeds).for_each(|seed| metric(case, structure, seed, show));
                }
            }
            _ => {
                let mut csv = "system,sigma,runs,force,seed,right,found,error,residual,seconds\n".to_string();
                for (case, how) in recorded(part).into_iter().filter(|(case, _)| case.name.contains(&only)) {
                    line(case, how, seeds, show, &mut csv);
                }
                std::fs::write(folder.join(format!("{name}.csv")), csv).expect("room for the results");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything once, at its smallest.
    #[test]
    fn everything_runs() {
        let (case, _) = &POSITIONS[0];
        let how = Recorded { runs: 6, seconds: 3.0, rate: 25.0, sigma: 1e-3, seed: 0, force: 0.0 };
        assert!(line(case, how, 1, false, &mut String::new()));
        assert_eq!(case.record(Recorded { force: 1.0, ..how }).tracks[0].force.len(), 76);
        let options = FormulaOptions { threads: 1, ..case.options(0) };
        assert!(FoundFormula::of_motion(&OUTSIDE[0].record(how), &options).is_ok());
        assert_eq!(CLEAN.len() + FRICTION.len() + CART_POLES.coordinates.len(), 13);
    }
}

//! Formulas found in made motion, of which the truth is known, and in real motion.
//!
//! `cargo bench --bench formula -- --part positions` records 100 runs of 5 s at 100 Hz of four systems, positions alone with independent
//! noise, and looks for their formulas, for ten seeds each; a formula is right if it has these terms and no other. `--part half` is the same
//! at half the noise, `--part tenth` with 10 runs at a third of the noise, `--part friction` with friction in the joints at half the noise,
//! `--part forces` under known forces at 0.06, `--part clean` other systems without noise and with 1e-3, `--part cart-poles` a damped
//! double cart-pole, `--part outside` systems that the library does not hold, `--part arms` recorded pendula of one, two and three arms (DynamicsLab, University
//! of Washington), if `--arms DIRECTORY` or `../shared/data/multi-arm-pendulum` has their files. `--seeds 3` takes fewer seeds, `--only NAME`
//! one system, `--show` prints the formulas. Everything is written to `target/formula/PART.csv` as well.

#[path = "formula/cases.rs"]
mod cases;

use cases::{CART_POLES, CLEAN, Case, FRICTION, OUTSIDE, POSITIONS, Recorded};
use lnn::formula::{FormulaOptions, FoundFormula, Verdict, formula_of_motion};
use lnn::recording::Columns;
use lnn::recording::read::read_recording;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
fn judge(case: &Case, found: &FoundFormula, scaled: bool) -> (bool, f64) {
    let name = |t: &lnn::formula::FoundTerm| if t.dissipation { format!("D:{}", t.term) } else { t.term.clone() };
    let pairs: Vec<Option<(f64, f64)>> = case
        .truth
        .iter()
        .map(|(term, truth)| found.terms.iter().find(|t| name(t) == *term).map(|t| (t.coefficient, *truth)))
        .collect();
    let right = found.terms.len() == case.truth.len() && pairs.iter().all(Option::is_some);
    if !right {
        return (false, f64::NAN);
    }
    let pairs: Vec<(f64, f64)> = pairs.into_iter().flatten().collect();
    let factor = if scaled { 1.0 } else { pairs[0].1 / pairs[0].0 };
    (true, pairs.iter().map(|(c, truth)| (c * factor / truth - 1.0).abs()).fold(0.0, f64::max))
}

fn search(case: &Case, how: Recorded, show: bool) -> Outcome {
    let recording = case.record(how);
    let started = Instant::now();
    let mut options = case.options(how.seed);
    options.scale = None;
    match formula_of_motion(&recording, &options) {
        Ok(found) => {
            let seconds = started.elapsed().as_secs_f64();
            let (right, error) = judge(case, &found, how.force > 0.0);
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
            let seconds = started.elapsed().as_secs_f64();
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

fn run(part: &str, seeds: u64, only: &str, show: bool) -> String {
    let mut csv = "system,sigma,runs,force,seed,right,found,error,residual,seconds\n".to_string();
    let mut one = |case: &Case, how: Recorded| {
        if case.name.contains(only) {
            line(case, how, seeds, show, &mut csv);
        }
    };
    match part {
        "positions" => POSITIONS.iter().for_each(|(case, sigma)| one(case, Recorded { sigma: *sigma, ..USUAL })),
        "half" => POSITIONS.iter().for_each(|(case, sigma)| one(case, Recorded { sigma: sigma / 2.0, ..USUAL })),
        "tenth" => {
            POSITIONS.iter().for_each(|(case, sigma)| one(case, Recorded { sigma: sigma / 3.0, runs: 10, ..USUAL }));
        }
        "friction" => FRICTION.iter().for_each(|(case, sigma)| one(case, Recorded { sigma: *sigma, ..USUAL })),
        "forces" => {
            POSITIONS[..3].iter().for_each(|(case, _)| one(case, Recorded { sigma: 0.06, force: 5.0, ..USUAL }));
        }
        "clean" => {
            for case in &CLEAN {
                for sigma in [0.0, 1e-3] {
                    one(case, Recorded { sigma, ..USUAL });
                }
            }
        }
        "cart-poles" => one(&CART_POLES, Recorded { sigma: 0.01, ..USUAL }),
        "outside" => OUTSIDE.iter().for_each(|case| one(case, Recorded { sigma: 1e-3, ..USUAL })),
        _ => unreachable!("parts are checked"),
    }
    csv
}

/// What can be measured on made motion.
const PARTS: [&str; 8] = ["positions", "half", "tenth", "friction", "forces", "clean", "cart-poles", "outside"];

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

/// Formulas of recorded pendula, where their files are.
fn arms(folder: &Path) {
    for (name, n) in [("single", 1), ("double", 2), ("triple", 3)] {
        let path = folder.join(format!("{name}.csv"));
        if !path.exists() {
            println!("{}: not there", path.display());
            continue;
        }
        let coords: Vec<String> = (1..=n).map(|i| format!("theta{i}")).collect();
        let columns =
            Columns { periodic: coords.clone(), coords, trajectory: Some("run".into()), ..Columns::default() };
        let mut recording = read_recording(&[&path], &columns).expect("the columns of the authors").recording;
        for track in &mut recording.tracks {
            let rows = track.q.chunks_exact(n).step_by(ARMS_EVERY);
            track.q = rows.flatten().copied().collect();
            track.times = track.times.iter().step_by(ARMS_EVERY).copied().collect();
        }
        recording.tracks.retain(|track| track.times.len() > 30);
        let started = Instant::now();
        let noise = Some(vec![ARMS_NOISE; n]);
        let options =
            FormulaOptions { friction: true, gyroscopic: false, noise, threads: 2, ..FormulaOptions::default() };
        let found = formula_of_motion(&recording, &options).expect("motion long enough");
        let seconds = started.elapsed().as_secs_f64();
        println!(
            "{name} arm, {} runs: {:?}, residual {:.3}, {seconds:.1} s",
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

/// Everything once, at its smallest.
pub fn trial() {
    let (case, _) = &POSITIONS[0];
    let how = Recorded { runs: 6, seconds: 3.0, rate: 25.0, sigma: 1e-3, seed: 0, force: 0.0 };
    assert!(line(case, how, 1, false, &mut String::new()));
    assert_eq!(case.record(Recorded { force: 1.0, ..how }).tracks[0].force.len(), 76);
    let options = FormulaOptions { threads: 1, ..case.options(0) };
    assert!(formula_of_motion(&OUTSIDE[0].record(how), &options).is_ok());
    assert_eq!(CLEAN.len() + FRICTION.len() + CART_POLES.coordinates.len(), 13);
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (mut parts, mut seeds, mut only, mut show) = (PARTS.map(String::from).to_vec(), 10, String::new(), false);
    let mut folder_of_arms = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data/multi-arm-pendulum");
    parts.push("arms".into());
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--bench" => {}
            "--show" => show = true,
            "--part" => {
                let part = arguments.next().filter(|part| PARTS.contains(&part.as_str()) || part == "arms");
                parts = vec![part.unwrap_or_else(|| panic!("--part: expected one of {}, arms", PARTS.join(", ")))];
            }
            "--seeds" => seeds = arguments.next().and_then(|n| n.parse().ok()).expect("--seeds: expected a number"),
            "--only" => only = arguments.next().expect("--only: expected a name"),
            "--arms" => folder_of_arms = arguments.next().map(PathBuf::from).expect("--arms: expected a folder"),
            other => panic!("{other}: unknown argument"),
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/formula");
    std::fs::create_dir_all(&folder).expect("a folder for the results");
    for part in parts {
        println!("{part}");
        if part == "arms" {
            arms(&folder_of_arms);
            continue;
        }
        let csv = run(&part, seeds, &only, show);
        std::fs::write(folder.join(format!("{part}.csv")), csv).expect("room for the results");
    }
}

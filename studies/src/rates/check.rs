//! How often a check says that a formula explains the motion, that the motion stays on a surface, that nothing accelerates, or that motion is of
//! first order, where that is wrong, and how often it misses what is there.

use super::formula::{Draw, EVEN, NULLS, constrained, inside, null, outside, track};
use super::{Outcome, Rate};
use lnn::cancellation::Cancellation;
use lnn::pipeline::{FirstLook, NextStep};
use lnn::recording::{Columns, LoadedRecording, Recording};

/// What a check says of a recording; nothing where it refuses it.
#[derive(Clone, Copy, Default)]
struct Said {
    formula: bool,
    constraint: bool,
    nothing_accelerates: bool,
    first_order: bool,
}

/// A verdict, and whether it was said.
type Verdict = (&'static str, fn(&Said) -> bool);

fn look(reading: &LoadedRecording) -> Said {
    let look = FirstLook::new(reading, Vec::new(), &Cancellation::default());
    look.map_or_else(
        |_| Said::default(),
        |look| Said {
            formula: look.formula.is_some(),
            constraint: look.constraints.as_ref().is_some_and(|found| found.count > 0),
            nothing_accelerates: look.next == NextStep::Record,
            first_order: look.survey.first_order.is_some(),
        },
    )
}

/// Two coordinates that move uniformly, each with noise of its own.
fn uniform(draw: &mut Draw) -> Recording {
    let tracks = (0..4).map(|run| {
        let line: Vec<f64> = (0..4).map(|_| draw.normal()).collect();
        let times: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
        let row = |t: &f64| [line[0] + line[1] * t, line[2] + line[3] * t].map(|x| x + 1e-3 * draw.normal());
        let q = times.iter().flat_map(row).collect();
        track(run, times, q)
    });
    let coordinates = ["x", "y"].map(String::from).to_vec();
    Recording { tracks: tracks.collect(), coordinates, periodic: vec![false; 2] }
}

/// Two cascaded tanks of Schoukens and Noel (2017), or two masses between springs, under a quantity of four tones beside their positions.
fn driven(tanks: bool, draw: &mut Draw) -> LoadedRecording {
    let tones: Vec<[f64; 3]> =
        (0..4).map(|_| [0.1 + 0.3 * draw.normal().abs(), draw.normal(), 0.3 + 0.05 * draw.normal()]).collect();
    let drive = |t: f64| 2.5 + tones.iter().map(|[rate, phase, size]| size * (rate * t + phase).sin()).sum::<f64>();
    let k: Vec<f64> = (0..4).map(|_| 0.2 * (0.3 * draw.normal()).exp()).collect();
    let rate = |t: f64, x: &[f64; 4]| {
        let root = [x[0].max(0.0).sqrt(), x[1].max(0.0).sqrt()];
        let springs = [drive(t) - x[0] - k[0] * (x[0] - x[1]) - k[2] * x[2], k[1] * (x[0] - x[1]) - x[1] - k[3] * x[3]];
        match tanks {
            true => [k[0] * (drive(t) - root[0]), k[1] * root[0] - k[2] * root[1], 0.0, 0.0],
            false => [x[2], x[3], springs[0], springs[1]],
        }
    };
    let (step, count, parts) = (0.2, 1200, 20);
    let (mut x, mut q) = (if tanks { [4.0, 3.0, 0.0, 0.0] } else { [0.0; 4] }, Vec::new());
    for sample in 0..count {
        q.extend([x[0] + 5e-3 * draw.normal(), x[1] + 5e-3 * draw.normal()]);
        for part in 0..parts {
            let h = step / f64::from(parts);
            let t = step * f64::from(sample) + h * f64::from(part);
            let slope = rate(t, &x);
            let half: [f64; 4] = std::array::from_fn(|i| x[i] + h / 2.0 * slope[i]);
            let slope = rate(t + h / 2.0, &half);
            x = std::array::from_fn(|i| x[i] + h * slope[i]);
        }
    }
    let times: Vec<f64> = (0..count).map(|sample| step * f64::from(sample)).collect();
    let inputs = times.iter().map(|t| drive(*t)).collect();
    let coordinates = ["x", "y"].map(String::from).to_vec();
    beside(Recording { tracks: vec![track(0, times, q)], coordinates, periodic: vec![false; 2] }, vec![inputs])
}

/// A recording with one more quantity.
fn beside(recording: Recording, inputs: Vec<Vec<f64>>) -> LoadedRecording {
    let columns = Columns { input: vec!["u".to_string()], ..Columns::default() };
    let mut reading = LoadedRecording::from(recording);
    (reading.inputs, reading.columns) = (inputs, columns);
    reading
}

/// A recording with a tone that has nothing to do with it.
fn with_tone(recording: Recording, draw: &mut Draw) -> LoadedRecording {
    let (rate, phase) = (1.0 + draw.normal().abs(), draw.normal());
    let tone = |times: &Vec<f64>| times.iter().map(|t| (rate * t + phase).sin()).collect();
    let inputs = recording.tracks.iter().map(|track| tone(&track.times)).collect();
    beside(recording, inputs)
}

/// Rates of `seeds` systems a case.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let mut rates = Vec::new();
    let mut add = |case, of: &dyn Fn(u64, &mut Draw) -> LoadedRecording, limits: [Option<[f64; 2]>; 4]| {
        let said: Vec<Said> = (0..seeds).map(|seed| look(&of(seed, &mut Draw::of(seed, 40)))).collect();
        let verdicts: [Verdict; 4] = [
            ("a formula explains", |said| said.formula),
            ("the motion stays on", |said| said.constraint),
            ("nothing accelerates", |said| said.nothing_accelerates),
            ("the motion is of first order", |said| said.first_order),
        ];
        for ((verdict, is_said), limits) in verdicts.into_iter().zip(limits) {
            let Some([low, high]) = limits else { continue };
            let said = said.iter().filter(|said| is_said(said)).count();
            rates.push(Rate { verdict, case, said, of: seeds as usize, limits: low..=high });
        }
    };
    let never = Some([0.0, 0.05]);
    for kind in NULLS {
        add(kind, &|_, draw| with_tone(null(kind, draw), draw), [never, never, None, never]);
    }
    // The fourth has friction, which a check looks for.
    let wrong =
        |seed: u64, draw: &mut Draw| with_tone(outside([0, 1, 2, 4][seed as usize % 4], draw).record(EVEN, draw), draw);
    add("laws outside the library", &wrong, [never, never, never, never]);
    let right = |seed: u64, draw: &mut Draw| with_tone(inside(seed, draw).record(EVEN, draw), draw);
    // The search ends after two seconds, and says so.
    add("laws of the library", &right, [Some([0.4, 1.0]), never, never, never]);
    let held = |seed: u64, draw: &mut Draw| with_tone(constrained(seed, draw).record(EVEN, draw), draw);
    add("motion under a constraint", &held, [never, Some([0.9, 1.0]), never, never]);
    add("uniform motion", &|_, draw| with_tone(uniform(draw), draw), [never, never, Some([0.95, 1.0]), never]);
    add("two tanks under a pump", &|_, draw| driven(true, draw), [never, never, never, Some([0.9, 1.0])]);
    add("two masses under a force", &|_, draw| driven(false, draw), [None, never, never, never]);
    Ok(rates)
}

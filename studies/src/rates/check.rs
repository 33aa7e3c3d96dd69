//! How often a check says that a formula explains the motion, that the motion stays on a surface, or that nothing accelerates, where that is
//! wrong, and how often it misses what is there.

use super::formula::{Draw, EVEN, NULLS, constrained, inside, null, outside, track};
use super::{Outcome, Rate};
use lnn::cancellation::Cancellation;
use lnn::pipeline::{FirstLook, NextStep};
use lnn::recording::{LoadedRecording, Recording};

/// What a check says of a recording; nothing where it refuses it.
#[derive(Clone, Copy, Default)]
struct Said {
    formula: bool,
    constraint: bool,
    nothing_accelerates: bool,
}

/// A verdict, and whether it was said.
type Verdict = (&'static str, fn(&Said) -> bool);

fn look(recording: Recording) -> Said {
    let look = FirstLook::new(&LoadedRecording::from(recording), Vec::new(), &Cancellation::default());
    look.map_or_else(
        |_| Said::default(),
        |look| Said {
            formula: look.formula.is_some(),
            constraint: look.constraints.as_ref().is_some_and(|found| found.count > 0),
            nothing_accelerates: look.next == NextStep::Record,
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

/// Rates of `seeds` systems a case.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let mut rates = Vec::new();
    let mut add = |case, of: &dyn Fn(u64, &mut Draw) -> Recording, limits: [Option<[f64; 2]>; 3]| {
        let said: Vec<Said> = (0..seeds).map(|seed| look(of(seed, &mut Draw::of(seed, 40)))).collect();
        let verdicts: [Verdict; 3] = [
            ("a formula explains", |said| said.formula),
            ("the motion stays on", |said| said.constraint),
            ("nothing accelerates", |said| said.nothing_accelerates),
        ];
        for ((verdict, is_said), limits) in verdicts.into_iter().zip(limits) {
            let Some([low, high]) = limits else { continue };
            let said = said.iter().filter(|said| is_said(said)).count();
            rates.push(Rate { verdict, case, said, of: seeds as usize, limits: low..=high });
        }
    };
    let never = Some([0.0, 0.05]);
    for kind in NULLS {
        add(kind, &|_, draw| null(kind, draw), [never, never, None]);
    }
    // The fourth has friction, which a check looks for.
    let wrong = |seed: u64, draw: &mut Draw| outside([0, 1, 2, 4][seed as usize % 4], draw).record(EVEN, draw);
    add("laws outside the library", &wrong, [never, never, never]);
    let right = |seed: u64, draw: &mut Draw| inside(seed, draw).record(EVEN, draw);
    // The search ends after two seconds, and says so.
    add("laws of the library", &right, [Some([0.4, 1.0]), never, never]);
    let held = |seed: u64, draw: &mut Draw| constrained(seed, draw).record(EVEN, draw);
    add("motion under a constraint", &held, [never, Some([0.9, 1.0]), never]);
    add("uniform motion", &|_, draw| uniform(draw), [never, never, Some([0.95, 1.0])]);
    Ok(rates)
}

//! How often the guess of what columns mean is right, for the motions of the catalogue.

use super::formula::Draw;
use super::{Outcome, Rate};
use lnn::lagrangian::{System, SystemInstance};
use lnn::recording::{Columns, Guess};
use lnn::rollout::Motion;
use std::fmt::Write as _;

/// Largest number of coordinates of a system that is tried.
const COORDINATES: usize = 4;
/// Length of a motion and its step, in units of time; a motion that ends earlier is passed over.
const UNTIL: f64 = 6.0;
const STEP: f64 = 0.01;
/// Noise over the spread of a column.
const NOISE: f64 = 1e-3;

/// What is written of a motion.
#[derive(Clone, Copy, PartialEq)]
enum Written {
    Positions,
    Velocities,
    Unnamed,
}

/// Rows `(t, q)` or `(t, q, v)` of a motion from a random state, with noise; none where it ends early.
fn rows(system: &SystemInstance<f64>, velocities: bool, draw: &mut Draw) -> Option<Vec<Vec<f64>>> {
    let bounds = system.system.training(system.coordinates);
    let mut state =
        |bounds: &[(f64, f64)]| bounds.iter().map(|&(low, high)| draw.between(low, high)).collect::<Vec<_>>();
    let (q, v) = (state(&bounds.positions), state(&bounds.velocities));
    let motion = system.build().ok()?.rollout(&q, &v, UNTIL, STEP).ok()?;
    let n = system.coordinates;
    let mut rows: Vec<Vec<f64>> = (0..motion.t.len())
        .map(|k| {
            let v = if velocities { &motion.v[k * n..(k + 1) * n] } else { &[] };
            [&[motion.t[k]], &motion.q[k * n..(k + 1) * n], v].concat()
        })
        .collect();
    for column in 1..rows[0].len() {
        let (low, high) = rows
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), row| (l.min(row[column]), h.max(row[column])));
        rows.iter_mut().for_each(|row| row[column] += NOISE * (high - low) * draw.normal());
    }
    Some(rows)
}

/// `true` if every column is taken as what it is; none where there is no motion.
fn is_right(name: &str, written: Written, draw: &mut Draw) -> Outcome<Option<bool>> {
    let system = SystemInstance::<f64>::named(name, &[])?;
    let n = system.coordinates;
    let Some(rows) = rows(&system, written != Written::Positions, draw) else { return Ok(None) };
    let columns = system.system.columns(n);
    let (mut text, width) = (String::new(), rows[0].len());
    if written != Written::Unnamed {
        let names: Vec<&str> = columns.iter().map(String::as_str).take(width - 1).collect();
        writeln!(text, "time,{}", names.join(","))?;
    }
    for row in &rows {
        let fields: Vec<String> = row.iter().map(|x| format!("{x:.9}")).collect();
        writeln!(text, "{}", fields.join(","))?;
    }
    let file = std::env::temp_dir().join(format!("lnn-columns-{}.csv", std::process::id()));
    std::fs::write(&file, text)?;
    let guessed = Guess::of(&[&file], &Columns::default());
    std::fs::remove_file(&file)?;
    let numbers = |range: std::ops::Range<usize>| range.map(|k| format!("c{}", k + 2)).collect::<Vec<String>>();
    let (coordinates, velocities) = match written {
        Written::Positions => (columns[..n].to_vec(), Vec::new()),
        Written::Velocities => (columns[..n].to_vec(), columns[n..].to_vec()),
        Written::Unnamed => (numbers(0..n), numbers(n..2 * n)),
    };
    let same = |Guess { columns, .. }: &Guess| {
        columns.coords == coordinates && columns.velocity == velocities && columns.force.is_empty()
    };
    let right = guessed.as_ref().is_ok_and(same);
    if !right {
        let taken = guessed.map(|guess| guess.table).unwrap_or_default();
        let taken: Vec<String> = taken.iter().map(|g| format!("{} as {}", g.column, g.meaning)).collect();
        eprintln!("{name}: {}", taken.join(", "));
    }
    Ok(Some(right))
}

/// Rates over the systems of the catalogue, `seeds` states of each.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let mut rates = Vec::new();
    for (case, written, least) in [
        ("positions with names", Written::Positions, 0.95),
        ("positions and velocities with names", Written::Velocities, 0.9),
        ("positions and velocities without names", Written::Unnamed, 0.9),
    ] {
        let (mut said, mut of) = (0, 0);
        for (case, system) in (0..).zip(System::unconstrained()) {
            let name = system.name.as_ref();
            // A spacetime has its time among its coordinates, and another parameter beside it.
            if system.time_like.is_some() {
                continue;
            }
            let small = SystemInstance::<f64>::named(name, &[])?.coordinates <= COORDINATES;
            for seed in (0..seeds).filter(|_| small) {
                let Some(right) = is_right(name, written, &mut Draw::of(seed, 60 + case))? else { continue };
                (said, of) = (said + usize::from(right), of + 1);
            }
        }
        rates.push(Rate { verdict: "columns as they are", case, said, of, limits: least..=1.0 });
    }
    Ok(rates)
}

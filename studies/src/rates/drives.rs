//! How often a periodic drive is found where there is none, and missed where there is one.

use super::formula::{Draw, Law, is_found, report, step, track};
use super::{Outcome, Rate};
use lnn::formula::{FormulaError, FormulaOptions, FoundFormula, FoundTerm};
use lnn::recording::Recording;
use std::f64::consts::TAU;

/// Step between the samples in s, and the standard deviation of the noise.
const STEP: f64 = 0.05;
const NOISE: f64 = 1e-3;

/// A system and how it is recorded.
struct Driven {
    periodic: bool,
    law: Law,
    /// Largest start of position and velocity.
    start: f64,
    /// Number of coordinates, of which the first are seen.
    coordinates: usize,
    seen: usize,
    runs: usize,
    seconds: f64,
    friction: bool,
    /// Frequency of the drive, and the terms of the formula.
    frequency: f64,
    terms: &'static [&'static str],
}

impl Driven {
    fn new(law: Law, coordinates: usize, (runs, seconds): (usize, f64)) -> Self {
        Self {
            periodic: false,
            law,
            start: 1.2,
            coordinates,
            seen: coordinates,
            runs,
            seconds,
            friction: false,
            frequency: 0.0,
            terms: &[],
        }
    }

    fn record(&self, draw: &mut Draw) -> Recording {
        let samples = (self.seconds / STEP) as usize;
        let run = |run: usize| {
            let state = |draw: &mut Draw| {
                (0..self.coordinates).map(|_| draw.between(-self.start, self.start)).collect::<Vec<f64>>()
            };
            let (mut q, mut v) = (state(draw), state(draw));
            let (mut times, mut rows) = (Vec::new(), Vec::new());
            for k in 0..samples {
                times.push(STEP * k as f64);
                rows.extend(q[..self.seen].iter().map(|x| x + NOISE * draw.normal()));
                const PARTS: usize = 5;
                let h = STEP / PARTS as f64;
                (0..PARTS).for_each(|p| step(&self.law, (&mut q, &mut v), (STEP * k as f64 + p as f64 * h, h)));
            }
            track(run, times, rows)
        };
        let tracks = (0..self.runs).map(run).collect();
        let names = ["x", "y"][..self.seen].iter().map(ToString::to_string).collect();
        Recording { coordinates: names, periodic: vec![self.periodic; self.seen], tracks }
    }

    fn search(&self, seed: u64, draw: &mut Draw) -> Result<FoundFormula, FormulaError> {
        let options =
            FormulaOptions { bootstraps: 4, seed, threads: 2, friction: self.friction, ..FormulaOptions::default() };
        FoundFormula::of_motion(&self.record(draw), &options)
    }

    /// `true` for its terms, no other, and its frequency within so many standard errors.
    fn is_right(&self, found: &FoundFormula, errors: f64) -> bool {
        let friction = found.terms.iter().filter(|own| own.dissipation).count();
        let known = |own: &FoundTerm| own.dissipation || self.terms.contains(&own.term.as_str());
        let all = |term: &&str| found.terms.iter().any(|own| !own.dissipation && own.term == **term);
        friction == usize::from(self.friction)
            && found.terms.iter().all(known)
            && self.terms.iter().all(all)
            && found
                .drive
                .as_ref()
                .is_some_and(|drive| (drive.frequency - self.frequency).abs() < errors * drive.standard_error)
    }
}

/// A driven system.
fn driven(kind: &str, draw: &mut Draw) -> Driven {
    let [a, om, phi] = [draw.between(0.7, 1.3), draw.between(1.1, 1.7), draw.between(0.3, 1.2)];
    let long = (1, 60.0);
    match kind {
        "Duffing's oscillator, one run of 60 s" => Driven {
            friction: true,
            frequency: om,
            terms: &["x_dot^2", "x^2", "x^4", "x*cos(om*t)", "x*sin(om*t)"],
            ..Driven::new(
                Box::new(move |t, q, v| vec![-0.2 * v[0] + a * q[0] - q[0].powi(3) + 0.4 * (om * t + phi).cos()]),
                1,
                long,
            )
        },
        "a pendulum with a motor, six runs of 20 s" | "a pendulum with a motor, one run of 60 s" => Driven {
            periodic: true,
            frequency: om,
            terms: &["x_dot^2", "cos(x)", "x*cos(om*t)", "x*sin(om*t)"],
            ..Driven::new(
                Box::new(move |t, q, _| vec![-4.0 * a * q[0].sin() + 0.6 * (om * t + phi).cos()]),
                1,
                if kind == "a pendulum with a motor, one run of 60 s" { long } else { (6, 20.0) },
            )
        },
        "two coupled oscillators, one of them driven" => Driven {
            frequency: om,
            start: 0.6,
            terms: &["x_dot^2", "y_dot^2", "x^2", "y^2", "x^2*y", "x*cos(om*t)", "x*sin(om*t)"],
            ..Driven::new(
                Box::new(move |t, q, _| {
                    let drive = 0.2 * (om * t + phi).cos();
                    vec![-3.0 * a * q[0] - 2.0 * q[0] * q[1] + drive, -5.0 * q[1] - q[0] * q[0]]
                }),
                2,
                (6, 20.0),
            )
        },
        _ => Driven {
            periodic: true,
            frequency: 2.0 * om,
            terms: &["x_dot^2", "cos(x)", "cos(x)*cos(om*t)", "cos(x)*sin(om*t)"],
            ..Driven::new(
                Box::new(move |t, q, _| vec![-(4.0 * a + 1.2 * (2.0 * om * t + phi).cos()) * q[0].sin()]),
                1,
                (6, 20.0),
            )
        },
    }
}

const DRIVEN: [&str; 5] = [
    "Duffing's oscillator, one run of 60 s",
    "a pendulum with a motor, one run of 60 s",
    "a pendulum with a motor, six runs of 20 s",
    "two coupled oscillators, one of them driven",
    "a pendulum whose support shakes",
];

/// A system without a periodic drive, or one of which too little is recorded.
fn undriven(kind: &str, draw: &mut Draw) -> Driven {
    let [a, om] = [draw.between(0.7, 1.3), draw.between(1.1, 1.7)];
    let long = (1, 60.0);
    match kind {
        "a force that saturates" => Driven::new(Box::new(move |_, q, _| vec![-6.0 * a * (3.0 * q[0]).tanh()]), 1, long),
        "a limit cycle, without --friction" => {
            Driven::new(Box::new(move |_, q, v| vec![-4.0 * q[0] + a * (1.0 - q[0] * q[0]) * v[0]]), 1, long)
        }
        "friction, without --friction" => {
            Driven::new(Box::new(move |_, q, v| vec![-4.0 * q[0].sin() - 0.1 * a * v[0]]), 1, (6, 20.0))
        }
        "two coordinates, one of them not recorded, one run" | "the same, six runs" => Driven {
            seen: 1,
            ..Driven::new(
                Box::new(move |_, q, _| vec![-4.0 * a * q[0] - (q[0] - q[1]), -7.0 * q[1] - (q[1] - q[0])]),
                2,
                if kind == "the same, six runs" { (6, 20.0) } else { long },
            )
        },
        "two coordinates outside the libraries" => Driven::new(
            Box::new(move |_, q, _| {
                let pull = (2.0 * (q[0] - q[1])).tanh();
                vec![-4.0 * a * q[0] - pull, -7.0 * q[1] + pull]
            }),
            2,
            long,
        ),
        "a force that jumps at random" => {
            let jumps: Vec<f64> = (0..100)
                .scan(0.0, |t, _| {
                    *t += -1.5 * draw.between(1e-9, 1.0).ln();
                    Some(*t)
                })
                .collect();
            let sign = move |t: f64| if jumps.partition_point(|jump| *jump <= t) % 2 == 0 { 1.0 } else { -1.0 };
            Driven {
                friction: true,
                ..Driven::new(Box::new(move |t, q, v| vec![-4.0 * q[0] - 0.2 * v[0] + 0.8 * sign(t)]), 1, long)
            }
        }
        "two periods of a drive" => Driven {
            ..Driven::new(
                Box::new(move |t, q, _| vec![-4.0 * a * q[0] - q[0].powi(3) + 0.8 * (om * t).cos()]),
                1,
                (6, 2.0 * TAU / om),
            )
        },
        _ => {
            Driven { periodic: true, ..Driven::new(Box::new(move |_, q, _| vec![-4.0 * a * q[0].sin()]), 1, (6, 20.0)) }
        }
    }
}

const UNDRIVEN: [&str; 9] = [
    "a pendulum",
    "a force that saturates",
    "a limit cycle, without --friction",
    "friction, without --friction",
    "two coordinates, one of them not recorded, one run",
    "the same, six runs",
    "two coordinates outside the libraries",
    "a force that jumps at random",
    "two periods of a drive",
];

/// White noise, which is refused before any search.
fn noise(seed: u64) -> Result<FoundFormula, FormulaError> {
    let mut draw = Draw::of(seed, 60);
    let times: Vec<f64> = (0..600).map(|k| STEP * f64::from(k)).collect();
    let q = times.iter().map(|_| draw.normal()).collect();
    let recording =
        Recording { coordinates: vec!["x".into()], periodic: vec![false], tracks: vec![track(0, times, q)] };
    FoundFormula::of_motion(
        &recording,
        &FormulaOptions { bootstraps: 4, seed, threads: 2, ..FormulaOptions::default() },
    )
}

/// Rates of `seeds` systems a case.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let mut rates = Vec::new();
    let mut add = |verdict, case, limits: [f64; 2], said: usize, of: usize| {
        rates.push(Rate { verdict, case, said, of, limits: limits[0]..=limits[1] });
    };
    let all = seeds as usize;
    let has_drive =
        |found: &Result<FoundFormula, _>| is_found(found) && found.as_ref().is_ok_and(|f| f.drive.is_some());
    let found = (0..seeds).filter(|&seed| has_drive(&noise(seed))).count();
    add("a drive", "white noise", [0.0, 0.02], found, all);
    // The whole ladder takes long: a trial climbs it once.
    let some = if seeds < 2 { 1 } else { UNDRIVEN.len() };
    for (case, kind) in (40..).zip(UNDRIVEN).take(some) {
        let said = |seed: &u64| {
            let mut draw = Draw::of(*seed, case);
            let found = undriven(kind, &mut draw).search(*seed, &mut draw);
            report(!has_drive(&found), kind, *seed, &found);
            has_drive(&found)
        };
        add("a drive", kind, [0.0, 0.05], (0..seeds).filter(said).count(), all);
    }
    for (case, kind) in (50..).zip(DRIVEN).take(some) {
        let [mut right, mut within] = [0; 2];
        for seed in 0..seeds {
            let mut draw = Draw::of(seed, case);
            let system = driven(kind, &mut draw);
            let found = system.search(seed, &mut draw);
            let terms = has_drive(&found) && found.as_ref().is_ok_and(|found| system.is_right(found, f64::INFINITY));
            report(terms, kind, seed, &found);
            right += usize::from(terms);
            within += usize::from(terms && found.is_ok_and(|found| system.is_right(&found, 2.0)));
        }
        add("right terms, no other", kind, [0.8, 1.0], right, all);
        add("frequency within two standard errors", kind, [0.8, 1.0], within, right);
    }
    Ok(rates)
}

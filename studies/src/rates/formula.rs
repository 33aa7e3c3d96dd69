//! How often a formula is found where there is none, and missed where there is one.

use super::{Outcome, Rate};
use lnn::formula::{FormulaError, FormulaOptions, FoundFormula, Verdict};
use lnn::recording::{RecordedTrajectory, Recording};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

type Found = Result<FoundFormula, FormulaError>;
/// Accelerations at a time, positions and velocities.
pub(super) type Law = Box<dyn Fn(f64, &[f64], &[f64]) -> Vec<f64>>;

/// Random numbers of a system.
pub(super) struct Draw(ChaCha8Rng);

impl Draw {
    pub(super) fn of(seed: u64, case: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(1000 * case + seed))
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..=high)
    }

    pub(super) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// How motion is recorded: share of the rows that are lost, and scatter of the times in steps.
#[derive(Clone, Copy)]
pub(super) struct Clock {
    lost: f64,
    jitter: f64,
}

pub(super) const EVEN: Clock = Clock { lost: 0.0, jitter: 0.0 };
const LOST: Clock = Clock { lost: 0.04, jitter: 0.1 };
/// Runs, samples of each, and the step between them in s.
const RUNS: usize = 10;
const SAMPLES: usize = 160;
const STEP: f64 = 0.025;
const NOISE: f64 = 1e-3;

/// What is recorded of the coordinates of a law.
type Seen = fn(&[f64]) -> Vec<f64>;

/// A system with what is true of it.
pub(super) struct System {
    coordinates: &'static [&'static str],
    periodic: &'static [bool],
    law: Law,
    /// Lowest and highest start of positions, then of velocities.
    starts: Vec<[f64; 2]>,
    /// Terms of its Lagrangian.
    terms: &'static [&'static str],
    /// What is seen of its coordinates; themselves if none.
    seen: Option<Seen>,
}

impl System {
    fn new(coordinates: &'static [&'static str], starts: Vec<[f64; 2]>, law: Law) -> Self {
        const LINES: &[bool] = &[false; 2];
        Self { coordinates, periodic: &LINES[..coordinates.len()], law, starts, terms: &[], seen: None }
    }

    /// Positions with independent noise.
    pub(super) fn record(&self, clock: Clock, draw: &mut Draw) -> Recording {
        let tracks = (0..RUNS).map(|run| self.run(run, clock, draw)).collect();
        let coordinates: Vec<String> = self.coordinates.iter().map(ToString::to_string).collect();
        Recording { periodic: self.periodic.to_vec(), coordinates, tracks }
    }

    fn run(&self, run: usize, clock: Clock, draw: &mut Draw) -> RecordedTrajectory {
        let state: Vec<f64> = self.starts.iter().map(|[low, high]| draw.between(*low, *high)).collect();
        let n = self.starts.len() / 2;
        let (mut q, mut v, mut now) = (state[..n].to_vec(), state[n..].to_vec(), 0.0);
        let (mut times, mut rows) = (Vec::new(), Vec::new());
        for k in 0..SAMPLES {
            let t = STEP * (k as f64 + clock.jitter * if k > 0 { draw.normal().clamp(-3.0, 3.0) } else { 0.0 });
            const PARTS: usize = 4;
            let h = (t - now) / PARTS as f64;
            (0..PARTS).for_each(|part| step(&self.law, (&mut q, &mut v), (now + part as f64 * h, h)));
            now = t;
            if draw.between(0.0, 1.0) >= clock.lost {
                times.push(t);
                let row = self.seen.map_or_else(|| q.clone(), |seen| seen(&q));
                rows.extend(row.into_iter().map(|x| x + NOISE * draw.normal()));
            }
        }
        track(run, times, rows)
    }
}

pub(super) fn track(run: usize, times: Vec<f64>, q: Vec<f64>) -> RecordedTrajectory {
    RecordedTrajectory { name: run.to_string(), times, q, v: vec![], a: vec![], force: vec![] }
}

/// A step of the classical method of Runge and Kutta.
pub(super) fn step(law: &Law, (q, v): (&mut Vec<f64>, &mut Vec<f64>), (t, h): (f64, f64)) {
    let moved = |x: &[f64], by: &[f64], h: f64| x.iter().zip(by).map(|(x, d)| x + h * d).collect::<Vec<f64>>();
    let mut rates = vec![(v.clone(), law(t, q, v))];
    for h in [h / 2.0, h / 2.0, h] {
        let (dq, dv) = &rates[rates.len() - 1];
        let (at, speed) = (moved(q, dq, h), moved(v, dv, h));
        let a = law(t + h, &at, &speed);
        rates.push((speed, a));
    }
    for (rate, part) in rates.iter().zip([1.0, 2.0, 2.0, 1.0]) {
        *q = moved(q, &rate.0, h * part / 6.0);
        *v = moved(v, &rate.1, h * part / 6.0);
    }
}

/// A system whose Lagrangian some library of the ladder holds.
pub(super) fn inside(seed: u64, draw: &mut Draw) -> System {
    let [a, b] = [(); 2].map(|()| draw.between(0.5, 2.0));
    match seed % 5 {
        0 => System {
            periodic: &[true],
            terms: &["a_dot^2", "cos(a)"],
            ..System::new(&["a"], vec![[-2.5, 2.5], [-1.0, 1.0]], Box::new(move |_, q, _| vec![-4.0 * a * q[0].sin()]))
        },
        1 => System {
            terms: &["x_dot^2", "x^2", "x^4"],
            ..System::new(
                &["x"],
                vec![[-1.5, 1.5], [-1.0, 1.0]],
                Box::new(move |_, q, _| vec![-2.0 * a * q[0] - 2.0 * b * q[0].powi(3)]),
            )
        },
        2 => System {
            terms: &["x_dot^2", "y_dot^2", "x^2", "y^2", "x^2*y"],
            ..System::new(
                &["x", "y"],
                vec![[-0.6, 0.6]; 4],
                Box::new(move |_, q, _| vec![-3.0 * a * q[0] - 2.0 * q[0] * q[1], -3.0 * b * q[1] - q[0] * q[0]]),
            )
        },
        3 => System {
            terms: &["x_dot^2", "y_dot^2", "sqrt(x^2 + y^2)^(-1)"],
            ..System::new(
                &["x", "y"],
                vec![[0.8, 1.2], [-0.3, 0.3], [-0.3, 0.3], [0.8, 1.2]],
                Box::new(move |_, q, _| {
                    let cube = q[0].hypot(q[1]).powi(3);
                    vec![-(0.8 + 0.2 * a) * q[0] / cube, -(0.8 + 0.2 * a) * q[1] / cube]
                }),
            )
        },
        _ => System {
            periodic: &[true, true],
            terms: &["a_dot^2", "b_dot^2", "a_dot*b_dot*cos(a - b)", "cos(a)", "cos(b)"],
            ..System::new(
                &["a", "b"],
                vec![[-1.5, 1.5], [-1.5, 1.5], [-0.5, 0.5], [-0.5, 0.5]],
                Box::new(move |_, q, v| {
                    // Masses 1 and b / 2 on rods of length 1.
                    let (m, (s, c)) = (0.5 * b, (q[0] - q[1]).sin_cos());
                    let first = -m * s * v[1] * v[1] - 9.81 * (1.0 + m) * q[0].sin();
                    let second = m * s * v[0] * v[0] - 9.81 * m * q[1].sin();
                    let whole = (1.0 + m) * m - m * m * c * c;
                    vec![(first * m - m * c * second) / whole, ((1.0 + m) * second - m * c * first) / whole]
                }),
            )
        },
    }
}

/// A planet around a body whose attraction has a small term beside that of Newton.
fn precessing(draw: &mut Draw) -> System {
    let (a, b) = (draw.between(0.9, 1.2), draw.between(0.01, 0.03));
    System {
        terms: &["x_dot^2", "y_dot^2", "sqrt(x^2 + y^2)^(-1)", "sqrt(x^2 + y^2)^(-3)"],
        ..System::new(
            &["x", "y"],
            vec![[0.8, 1.2], [-0.3, 0.3], [-0.3, 0.3], [0.7, 1.0]],
            Box::new(move |_, q, _| {
                let r = q[0].hypot(q[1]);
                let pull = a / r.powi(3) + 3.0 * b / r.powi(5);
                vec![-pull * q[0], -pull * q[1]]
            }),
        )
    }
}

/// A system that no library holds.
pub(super) fn outside(seed: u64, draw: &mut Draw) -> System {
    let a = draw.between(0.8, 1.6);
    let law: Law = match seed % 5 {
        0 => Box::new(move |_, q, _| vec![-3.0 * a * q[0].signum()]),
        1 => Box::new(move |_, q, v| vec![-4.0 * q[0] + a * (1.0 - q[0] * q[0]) * v[0]]),
        2 => Box::new(move |t, q, _| vec![-4.0 * q[0] - q[0].powi(3) + 2.0 * a * (3.1 * t).cos()]),
        3 => Box::new(move |_, q, v| vec![-4.0 * q[0] - 0.2 * a * v[0]]),
        _ => Box::new(move |_, q, _| vec![-6.0 * a * (3.0 * q[0]).tanh()]),
    };
    System::new(&["x"], vec![[-2.0, 2.0], [-1.0, 1.0]], law)
}

/// A pendulum and an oscillator beside it that do not act on each other.
fn beside(draw: &mut Draw) -> System {
    let [a, b] = [(); 2].map(|()| draw.between(0.5, 2.0));
    System {
        periodic: &[true, false],
        terms: &["a_dot^2", "y_dot^2", "cos(a)", "y", "y^2"],
        ..System::new(
            &["a", "y"],
            vec![[-2.0, 2.0], [-0.8, 0.8], [-1.0, 1.0], [-0.5, 0.5]],
            Box::new(move |_, q, _| vec![-4.0 * a * q[0].sin(), 1.0 - 2.0 * b * q[1]]),
        )
    }
}

/// A pendulum in Cartesian coordinates, or a bead on a parabola.
pub(super) fn constrained(seed: u64, draw: &mut Draw) -> System {
    let a = draw.between(0.5, 2.0);
    let names: &'static [&'static str] = &["x", "y"];
    let (law, seen): (Law, Seen) = match seed % 2 {
        0 => (Box::new(move |_, q, _| vec![-4.0 * a * q[0].sin()]), |q| vec![q[0].sin(), -q[0].cos()]),
        _ => (
            Box::new(move |_, q, v| vec![-(4.0 * q[0] * v[0] * v[0] + 8.0 * a * q[0]) / (1.0 + 4.0 * q[0] * q[0])]),
            |q| vec![q[0], q[0] * q[0]],
        ),
    };
    System { seen: Some(seen), periodic: &[false; 2], ..System::new(names, vec![[-1.5, 1.5], [-1.0, 1.0]], law) }
}

/// Columns that hold no motion, by name.
pub(super) const NULLS: [&str; 5] = ["white noise", "a random walk", "constants", "steps", "copies of a coordinate"];

pub(super) fn null(kind: &str, draw: &mut Draw) -> Recording {
    let n = if kind == "copies of a coordinate" { 2 } else { 1 };
    let tracks = (0..4).map(|run| {
        let [mut level, speed] = [draw.normal(), draw.between(1.0, 3.0)];
        let times: Vec<f64> = (0..400).map(|k| 0.02 * f64::from(k)).collect();
        let row = |(k, t): (usize, &f64)| match kind {
            "white noise" => vec![draw.normal()],
            "a random walk" => {
                level += draw.normal();
                vec![level]
            }
            "constants" => vec![level],
            "steps" => {
                if k.is_multiple_of(50) {
                    level = draw.normal();
                }
                vec![level]
            }
            _ => {
                let wave = (speed * t).sin() + 0.3 * (1.7 * speed * t).cos();
                vec![wave + NOISE * draw.normal(), 2.0 * wave + 1.0 + NOISE * draw.normal()]
            }
        };
        let q = times.iter().enumerate().flat_map(row).collect();
        track(run, times.clone(), q)
    });
    let tracks = tracks.collect();
    Recording {
        coordinates: ["x", "y"][..n].iter().map(ToString::to_string).collect(),
        periodic: vec![false; n],
        tracks,
    }
}

fn search(recording: &Recording, seed: u64) -> Found {
    FoundFormula::of_motion(recording, &FormulaOptions { bootstraps: 4, seed, threads: 2, ..FormulaOptions::default() })
}

pub(super) fn is_found(found: &Found) -> bool {
    found.as_ref().is_ok_and(|found| found.verdict == Verdict::Found)
}

/// `true` for the terms of a system, and no other.
fn is_right(found: &Found, terms: &[&str]) -> bool {
    let same = |found: &FoundFormula| {
        found.terms.len() == terms.len() && found.terms.iter().all(|term| terms.contains(&term.term.as_str()))
    };
    is_found(found) && found.as_ref().is_ok_and(same)
}

/// Rates of `seeds` systems a case.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let mut rates = Vec::new();
    let mut add = |verdict, case, limits: [f64; 2], said: &dyn Fn(u64) -> bool| {
        let said = (0..seeds).filter(|&seed| said(seed)).count();
        rates.push(Rate { verdict, case, said, of: seeds as usize, limits: limits[0]..=limits[1] });
    };
    for (case, kind) in (0..).zip(NULLS) {
        let found: Vec<Found> = (0..seeds).map(|seed| search(&null(kind, &mut Draw::of(seed, case)), seed)).collect();
        add("found", kind, [0.0, 0.02], &|seed| is_found(&found[seed as usize]));
        if kind != "a random walk" {
            let named = |found: &Found| matches!(found, Err(FormulaError::Still { .. } | FormulaError::Steps { .. }));
            add("named", kind, [0.95, 1.0], &|seed| named(&found[seed as usize]));
        }
    }
    add("named", "one row off by 1e6", [0.95, 1.0], &|seed| {
        let mut draw = Draw::of(seed, 10);
        let mut recording = inside(seed, &mut draw).record(EVEN, &mut draw);
        recording.tracks[3].q[77] += 1e6;
        matches!(search(&recording, seed), Err(FormulaError::Wild { track: 3, .. }))
    });
    for (case, clock, name) in
        [(11, EVEN, "laws in the libraries"), (11, LOST, "the same, 4 % of the rows lost, 10 % jitter")]
    {
        add("right terms, no other", name, [0.9, 1.0], &|seed| {
            let mut draw = Draw::of(seed, case);
            let system = inside(seed, &mut draw);
            let found = search(&system.record(clock, &mut draw), seed);
            let right = is_right(&found, system.terms);
            report(right, name, seed, &found);
            right
        });
    }
    let small = |seed: u64| {
        let mut draw = Draw::of(seed, 15);
        let system = precessing(&mut draw);
        let found = search(&system.record(EVEN, &mut draw), seed);
        let right = is_right(&found, system.terms);
        report(right, "1/r + 1/r^3", seed, &found);
        (right, found.is_ok_and(|found| found.verdict == Verdict::Found && !found.several) && !right)
    };
    add("found", "laws in none of them", [0.0, 0.05], &|seed| {
        let mut draw = Draw::of(seed, 12);
        let found = search(&outside(seed, &mut draw).record(EVEN, &mut draw), seed);
        report(!is_found(&found), "outside", seed, &found);
        is_found(&found)
    });
    add("two blocks, right terms", "a pendulum and an oscillator", [0.9, 1.0], &|seed| {
        let mut draw = Draw::of(seed, 13);
        let system = beside(&mut draw);
        let found = search(&system.record(EVEN, &mut draw), seed);
        let right = is_right(&found, system.terms) && found.as_ref().is_ok_and(|found| found.blocks.len() == 2);
        report(right, "blocks", seed, &found);
        right
    });
    add("constraint named", "a rod and a wire, Cartesian", [0.9, 1.0], &|seed| {
        let mut draw = Draw::of(seed, 14);
        let found = search(&constrained(seed, &mut draw).record(EVEN, &mut draw), seed);
        let right = matches!(found, Err(FormulaError::Constrained { .. }));
        report(right, "constrained", seed, &found);
        right
    });
    // Each climbs the whole ladder, which takes a minute: too long for a trial.
    if seeds < 2 {
        return Ok(rates);
    }
    let small: Vec<(bool, bool)> = (0..seeds.div_ceil(4)).map(small).collect();
    let case = "1/r with 1 to 3 % of 1/r^3";
    let count = |counted: &dyn Fn(&(bool, bool)) -> bool| small.iter().filter(|small| counted(small)).count();
    for (verdict, said, limits) in [
        ("right terms, no other", count(&|(right, _)| *right), 0.0..=1.0),
        ("found, other terms", count(&|(_, other)| *other), 0.0..=0.1),
    ] {
        rates.push(Rate { verdict, case, said, of: small.len(), limits });
    }
    Ok(rates)
}

/// Says what was wrong.
pub(super) fn report(right: bool, case: &str, seed: u64, found: &Found) {
    match found {
        _ if right => {}
        Ok(found) => eprintln!("{case} {seed}: {:?} {:.3}: {}", found.verdict, found.residual, found.text(false)),
        Err(error) => eprintln!("{case} {seed}: {error}"),
    }
}

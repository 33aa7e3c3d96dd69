//! Constraints found in recorded motion: free systems, what is nearly a constraint, and what is one, under white and coloured noise.

use super::{Outcome, Rate};
use lnn::constraints::{ConstraintKind, ConstraintSearch, FoundConstraints, MotionSamples};
use lnn::recording::{RecordedTrajectory, Recording, SmoothOptions};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// Draws a motion of a system.
type Draw = Box<dyn Fn(&mut ChaCha8Rng) -> Motion>;

/// Coordinates of one motion at a time in s.
type Motion = Box<dyn Fn(f64) -> Vec<f64>>;
/// A kind of system: the names of its coordinates, which are angles, and motions of a system that is drawn once.
struct Kind {
    names: &'static [&'static str],
    angles: bool,
    /// A system drawn at random, as a maker of motions.
    system: fn(&mut ChaCha8Rng) -> Draw,
    /// How many constraints it has.
    constraints: usize,
}

/// Autocorrelation of coloured noise.
const COLOURED: f64 = 0.9;
/// Motions of a recording, samples of each, and seconds between them.
const MOTIONS: usize = 12;
const SAMPLES: usize = 200;
const STEP: f64 = 0.02;

fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    rng.random_range(low..high)
}

/// A sum of three waves about 0, of amplitude about 1, at most about 2 rad/s.
fn wave(rng: &mut ChaCha8Rng) -> impl Fn(f64) -> f64 + use<> {
    let parts: Vec<[f64; 3]> =
        (0..3).map(|_| [uniform(rng, 0.2, 0.6), uniform(rng, 0.4, 2.0), uniform(rng, 0.0, TAU)]).collect();
    move |t| parts.iter().map(|[a, omega, phase]| a * (omega * t + phase).sin()).sum()
}

/// Waves that have nothing to do with each other.
fn free(rng: &mut ChaCha8Rng, n: usize) -> Motion {
    let waves: Vec<_> = (0..n).map(|_| wave(rng)).collect();
    Box::new(move |t| waves.iter().map(|wave| wave(t)).collect())
}

fn kepler(rng: &mut ChaCha8Rng) -> Motion {
    let (e, a, turn, start) =
        (uniform(rng, 0.1, 0.6), uniform(rng, 0.7, 1.5), uniform(rng, 0.0, TAU), uniform(rng, 0.0, TAU));
    Box::new(move |t| {
        let mean = start + t / a.powf(1.5);
        let mut anomaly = mean;
        (0..20).for_each(|_| anomaly = mean + e * f64::sin(anomaly));
        let (x, y) = (a * (anomaly.cos() - e), a * (1.0 - e * e).sqrt() * anomaly.sin());
        vec![x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos()]
    })
}

const FREE: [Kind; 3] = [
    Kind { names: &["x", "y"], angles: false, system: |_| Box::new(|rng| free(rng, 2)), constraints: 0 },
    Kind { names: &["a", "b"], angles: true, system: |_| Box::new(|rng| free(rng, 2)), constraints: 0 },
    Kind { names: &["x", "y"], angles: false, system: |_| Box::new(kepler), constraints: 0 },
];

const HELD: [Kind; 4] = [
    // A rod.
    Kind {
        names: &["x", "y"],
        angles: false,
        system: |rng| {
            let l = uniform(rng, 0.5, 2.0);
            Box::new(move |rng| {
                let (angle, start) = (wave(rng), uniform(rng, 0.0, TAU));
                Box::new(move |t| {
                    let (sin, cos) = (start + angle(t)).sin_cos();
                    vec![l * sin, -l * cos]
                })
            })
        },
        constraints: 1,
    },
    // A sphere.
    Kind {
        names: &["x", "y", "z"],
        angles: false,
        system: |rng| {
            let r = uniform(rng, 0.5, 2.0);
            Box::new(move |rng| {
                let (polar, around) = (wave(rng), wave(rng));
                Box::new(move |t| {
                    let ((s, c), (u, w)) = ((1.5 * polar(t)).sin_cos(), (2.0 * around(t)).sin_cos());
                    vec![r * s * w, r * s * u, r * c]
                })
            })
        },
        constraints: 1,
    },
    // A plane that is inclined.
    Kind {
        names: &["x", "y", "z"],
        angles: false,
        system: |rng| {
            let (a, b, c) = (uniform(rng, 0.3, 1.5), uniform(rng, -1.5, -0.3), uniform(rng, -1.0, 1.0));
            Box::new(move |rng| {
                let (x, y) = (wave(rng), wave(rng));
                Box::new(move |t| vec![x(t), y(t), a * x(t) + b * y(t) + c])
            })
        },
        constraints: 1,
    },
    // Two wheels that are geared.
    Kind {
        names: &["a", "b"],
        angles: true,
        system: |rng| {
            let (ratio, phase) = (f64::from(rng.random_range(1..4u32)), uniform(rng, 0.2, 1.0));
            Box::new(move |rng| {
                let (angle, start) = (wave(rng), uniform(rng, 0.0, TAU));
                Box::new(move |t| vec![start + 2.0 * angle(t), ratio * (start + 2.0 * angle(t)) + phase])
            })
        },
        constraints: 1,
    },
];

/// A point on a spring whose length changes by `stretch` of the noise, and one on an arc of so many radians.
fn on_a_spring(rng: &mut ChaCha8Rng, stretch: f64) -> Motion {
    let (angle, length) = (wave(rng), wave(rng));
    Box::new(move |t| {
        let (sin, cos) = (2.0 * angle(t)).sin_cos();
        let r = 1.0 + stretch * length(t);
        vec![r * sin, -r * cos]
    })
}

fn on_an_arc(rng: &mut ChaCha8Rng, radians: f64) -> Motion {
    let angle = wave(rng);
    Box::new(move |t| {
        let (sin, cos) = (0.5 + radians * angle(t)).sin_cos();
        vec![sin, -cos]
    })
}

/// A recording of motions with noise of an autocorrelation.
fn recorded(
    (names, angles): (&[&str], bool),
    rng: &mut ChaCha8Rng,
    (sigma, rho): (f64, f64),
    mut motion: impl FnMut(&mut ChaCha8Rng) -> Motion,
) -> Recording {
    let n = names.len();
    let tracks = (0..MOTIONS).map(|k| {
        let motion = motion(rng);
        let times: Vec<f64> = (0..SAMPLES).map(|i| STEP * i as f64).collect();
        let mut noise: Vec<f64> = (0..n).map(|_| StandardNormal.sample(rng)).collect();
        let mut q = Vec::with_capacity(SAMPLES * n);
        for t in &times {
            q.extend(motion(*t).iter().zip(&noise).map(|(x, e)| x + sigma * e));
            for e in &mut noise {
                let fresh: f64 = StandardNormal.sample(rng);
                *e = rho * *e + (1.0 - rho * rho).sqrt() * fresh;
            }
        }
        RecordedTrajectory { name: format!("run {k}"), times, q, v: vec![], a: vec![], force: vec![] }
    });
    let tracks = tracks.collect();
    Recording { coordinates: names.iter().map(|x| x.to_string()).collect(), periodic: vec![angles; n], tracks }
}

fn found(recording: &Recording) -> Outcome<FoundConstraints> {
    let samples = MotionSamples::of(recording, &SmoothOptions::default())?;
    Ok(FoundConstraints::of(&samples, ConstraintSearch::default())?)
}

/// Whether something is said of `seeds` systems each.
fn rate(
    (verdict, case): (&'static str, &'static str),
    limits: std::ops::RangeInclusive<f64>,
    seeds: u64,
    mut said: impl FnMut(&mut ChaCha8Rng, u64) -> Outcome<bool>,
) -> Outcome<Rate> {
    let mut count = 0;
    for seed in 0..seeds {
        count += usize::from(said(&mut ChaCha8Rng::seed_from_u64(seed), seed)?);
    }
    Ok(Rate { verdict, case, said: count, of: seeds as usize, limits })
}

/// A recording of one of several kinds, and how many constraints it has.
fn of_kinds(kinds: &[Kind], rng: &mut ChaCha8Rng, seed: u64, noise: (f64, f64)) -> (Recording, usize) {
    let kind = &kinds[seed as usize % kinds.len()];
    let motions = (kind.system)(rng);
    (recorded((kind.names, kind.angles), rng, noise, motions), kind.constraints)
}

/// `true` if as many constraints as there are were found, and what was found holds motions of the same system that were not recorded.
fn is_right(found: &FoundConstraints, wanted: usize) -> bool {
    let holds = found.constraints.iter().filter(|c| c.kind.is_imposed()).all(|c| c.kind == ConstraintKind::Holonomic);
    found.count == wanted && holds && found.refuted == 0
}

/// Rates of `seeds` systems a case.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    let (plane, walk) = ((&["x", "y"][..], false), |rng: &mut ChaCha8Rng| -> Motion {
        let steps: Vec<[f64; 2]> = (0..SAMPLES)
            .scan([0.0; 2], |at, _| {
                at.iter_mut()
                    .for_each(|x| *x += 0.05 * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, rng));
                Some(*at)
            })
            .collect();
        Box::new(move |t| steps[((t / STEP).round() as usize).min(SAMPLES - 1)].to_vec())
    });
    let still = |_: &mut ChaCha8Rng| -> Motion { Box::new(|_| vec![0.3, -0.2]) };
    let any = |found: FoundConstraints| found.count > 0;
    let within = |found: &FoundConstraints| found.count > 0;
    let noise = |seed: u64| [1e-3, 1e-2][seed as usize / 4 % 2];
    Ok(vec![
        rate(("a constraint", "free motion, white noise"), 0.0..=0.02, seeds, |rng, seed| {
            Ok(any(found(&of_kinds(&FREE, rng, seed, (noise(seed), 0.0)).0)?))
        })?,
        rate(("a constraint", "free motion, noise with autocorrelation 0.9"), 0.0..=0.02, seeds, |rng, seed| {
            Ok(any(found(&of_kinds(&FREE, rng, seed, (noise(seed), COLOURED)).0)?))
        })?,
        rate(("a constraint", "white noise alone"), 0.0..=0.02, seeds, |rng, _| {
            Ok(any(found(&recorded(plane, rng, (0.1, 0.0), still))?))
        })?,
        rate(("a constraint", "noise with autocorrelation 0.9 alone"), 0.0..=0.02, seeds, |rng, _| {
            Ok(any(found(&recorded(plane, rng, (0.1, COLOURED), still))?))
        })?,
        rate(("a constraint", "random walks"), 0.0..=0.02, seeds, |rng, _| {
            Ok(any(found(&recorded(plane, rng, (1e-3, 0.0), walk))?))
        })?,
        rate(
            ("within the noise", "a spring that stretches by 1.6 of the noise, white"),
            0.0..=0.05,
            seeds,
            |rng, _| {
                // The root mean square of a wave is about 0.5.
                Ok(within(&found(&recorded(plane, rng, (1e-2, 0.0), |rng| on_a_spring(rng, 3.2e-2)))?))
            },
        )?,
        rate(("a line within the noise", "an arc of 0.1 rad beyond white noise"), 0.0..=0.05, seeds, |rng, _| {
            let found = found(&recorded(plane, rng, (2e-4, 0.0), |rng| on_an_arc(rng, 0.1)))?;
            let line = |c: &&lnn::constraints::FoundConstraint| c.kind.is_imposed() && !c.formula.contains('^');
            Ok(found.constraints.iter().find(line).is_some())
        })?,
        rate(
            ("all constraints, and no other", "rods, spheres, planes, gears, white noise"),
            0.95..=1.0,
            seeds,
            |rng, seed| {
                let (recording, wanted) = of_kinds(&HELD, rng, seed, (noise(seed), 0.0));
                Ok(is_right(&found(&recording)?, wanted))
            },
        )?,
        rate(("all constraints, and no other", "the same, autocorrelation 0.9"), 0.95..=1.0, seeds, |rng, seed| {
            let (recording, wanted) = of_kinds(&HELD, rng, seed, (noise(seed), COLOURED));
            Ok(is_right(&found(&recording)?, wanted))
        })?,
    ])
}

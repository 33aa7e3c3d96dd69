//! Fits of networks, conserved quantities and Lyapunov times.

use super::{Outcome, Rate};
use lnn::analysis::Lyapunov;
use lnn::lagrangian::{EulerLagrange, Mechanics, SystemInstance, WithForces};
use lnn::prelude::*;
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{RolloutOptions, rollout};
use lnn::symmetry::{Basis, Chart, Degrees, Invariant, Quadratic, Region, Symmetries};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::ops::RangeInclusive;

/// Said in none, and in all, of the systems of a case but for one of twenty.
const NEVER: RangeInclusive<f64> = 0.0..=0.05;
const ALWAYS: RangeInclusive<f64> = 0.95..=1.0;

/// Rates of `seeds` systems a case; of fits, which take longest, a quarter of them.
pub fn rates(seeds: u64) -> Outcome<Vec<Rate>> {
    Ok([fits(seeds.div_ceil(4))?, conserved(seeds)?, chaotic(seeds)?].concat())
}

/// In how many of the systems with these seeds something was said.
fn rate(
    (verdict, case): (&'static str, &'static str),
    limits: RangeInclusive<f64>,
    seeds: u64,
    mut said: impl FnMut(&mut ChaCha8Rng) -> Outcome<bool>,
) -> Outcome<Rate> {
    let mut count = 0;
    for seed in 0..seeds {
        count += usize::from(said(&mut ChaCha8Rng::seed_from_u64(seed))?);
    }
    Ok(Rate { verdict, case, said: count, of: seeds as usize, limits })
}

// ---- Fits

/// Motion of the coordinates `x` and `y` at 50 Hz in several trajectories of a length in s, with white noise.
struct Motion<'a> {
    model: Option<&'a dyn EulerLagrange<f64>>,
    seconds: f64,
    noise: f64,
}

/// Motion of a model with little noise.
fn quiet(model: &dyn EulerLagrange<f64>, seconds: f64) -> Motion<'_> {
    Motion { model: Some(model), seconds, noise: 1e-4 }
}

impl Motion<'_> {
    const RUNS: usize = 6;

    fn recording(&self, rng: &mut ChaCha8Rng, periodic: [bool; 2]) -> Outcome<Recording> {
        let mut tracks = Vec::new();
        for run in 0..Self::RUNS {
            let mut draw = |low: f64, high: f64| -> [f64; 2] { std::array::from_fn(|_| rng.random_range(low..high)) };
            let (q, v) = (draw(0.4, 1.2), draw(-1.0, 1.0));
            let samples = (50.0 * self.seconds) as usize;
            let times: Vec<f64> = (0..=samples).map(|k| 0.02 * k as f64).collect();
            let mut q = match self.model {
                Some(model) => rollout(model, &q, &v, &RolloutOptions::new(self.seconds, 0.02)).complete()?.q,
                None => vec![0.0; 2 * times.len()],
            };
            q.truncate(2 * times.len());
            q.iter_mut().for_each(|q| *q += self.noise * rng.sample::<f64, _>(StandardNormal));
            let empty = Vec::new;
            tracks.push(RecordedTrajectory { name: run.to_string(), times, q, v: empty(), a: empty(), force: empty() });
        }
        Ok(Recording { coordinates: ["x", "y"].map(String::from).to_vec(), periodic: periodic.to_vec(), tracks })
    }
}

/// Whether a small network of a motion is called good; a recording that is refused is not.
fn is_good(motion: &Motion<'_>, rng: &mut ChaCha8Rng, (periodic, epochs): ([bool; 2], usize)) -> Outcome<bool> {
    let recording = motion.recording(rng, periodic)?;
    let fit = Fit::recording(recording).seed(rng.random_range(0..1000)).threads(2).configure(move |config| {
        config.training.network.hidden = vec![24, 24];
        config.training.phases.iter_mut().for_each(|phase| phase.epochs = epochs);
    });
    Ok(fit.run().is_ok_and(|found| found.findings().to_string().starts_with("measured: good: ")))
}

fn fits(seeds: u64) -> Outcome<Vec<Rate>> {
    let springs = |coupling: f64| Mechanics::<_, f64>::new(Springs, vec![1.0, 2.5, coupling]);
    let (apart, joined, orbit) = (springs(0.0), springs(0.6), Mechanics::<_, f64>::new(Orbit, vec![]));
    let silent = |noise: f64| Motion { model: None, seconds: 2.0, noise };
    let plain = [false; 2];
    let all: [(&'static str, Motion<'_>, [bool; 2]); 5] = [
        ("white noise", silent(1.0), plain),
        ("motionless data", silent(0.0), plain),
        ("recordings of a quarter of a period", quiet(&joined, 1.0), plain),
        ("coordinates that do not act on each other", quiet(&apart, 16.0), plain),
        ("an orbit whose momentum is conserved", quiet(&orbit, 16.0), [false, true]),
    ];
    // A trial takes no time.
    let epochs = if seeds > 1 { 300 } else { 3 };
    let mut rates = Vec::new();
    for (case, motion, periodic) in all {
        rates.push(rate(("good", case), NEVER, seeds, |rng| is_good(&motion, rng, (periodic, epochs)))?);
    }
    let coupled = quiet(&joined, 16.0);
    let limits = if seeds > 1 { 0.3..=1.0 } else { 0.0..=1.0 };
    rates.push(rate(("good", "coupled springs"), limits, seeds, |rng| is_good(&coupled, rng, (plain, epochs)))?);
    Ok(rates)
}

/// `m_x v_x^2/2 + m_y v_y^2/2` and hardening springs, one between them.
struct Springs;

impl Lagrangian for Springs {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let kinetic = p[0] * v[0].sqr() + p[1] * v[1].sqr();
        let spring = |x: R| x.sqr() + R::half() * x.sqr().sqr();
        R::half() * kinetic - spring(q[0]) - R::of(3.0) * spring(q[1]) - p[2] * (q[0] - q[1]).sqr()
    }
}

/// A planet by its distance and its angle, in a potential of its own.
struct Orbit;

impl Lagrangian for Orbit {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        R::half() * (v[0].sqr() + (q[0] * v[1]).sqr()) - q[0].sqr() - R::of(0.1) * q[0].sqr().recip()
    }
}

// ---- Conserved quantities

/// A mass matrix and a potential with ten random coefficients: a mass `1 + c_0 x^2`, a potential of degree four, round if the last is 0.
struct Potential;

impl Lagrangian for Potential {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, c: &[R], q: &[R], v: &[R]) -> R {
        let [x, y, round] = [q[0], q[1], q[0].sqr() + q[1].sqr()];
        let rough = c[3] * x
            + c[4] * x * y
            + c[5] * x.sqr() * y
            + c[6] * x * y.sqr()
            + c[7] * x.sqr().sqr()
            + c[8] * y * x.sqr() * x;
        R::half() * (v[0].sqr() + v[1].sqr()) - c[0] * round - c[1] * round.sqr() - c[2] * round.cos() - rough
    }
}

/// `a(t)^2 dx^2 - dt^2`: a space that grows, or with `a = 1` does not.
struct Growing;

impl Lagrangian for Growing {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, c: &[R], q: &[R], v: &[R]) -> R {
        let scale = R::one() + c[0] * q[0] + c[1] * q[0].sqr();
        R::half() * ((scale * v[1]).sqr() - v[0].sqr())
    }
}

/// Charges of point symmetries and quantities of second degree that are said to be conserved, and the number that stands for the energy.
fn said(model: &dyn EulerLagrange<f64>) -> Outcome<(usize, Invariant)> {
    let names = ["x", "y"].map(String::from);
    let charts = [Chart::Line; 2];
    let basis = Basis::new(&names, &charts, Degrees::usual(&charts));
    let region = Region { position: vec![[-1.5, 1.5]; 2], velocity: vec![[-1.0, 1.0]; 2] };
    let (q, v) = region.states(1000, 0, |_, _| true);
    let found = Symmetries::find(model, &basis, (&q, &v), Some(Symmetries::EXACT))?;
    let second = Quadratic::find(model, &found.basis, &found.fields, (&q, &v), Some(Symmetries::EXACT))?;
    let charges = found.conserved.iter().filter(|conserved| **conserved).count();
    Ok((charges + second.conserved.len(), found.invariant))
}

fn conserved(seeds: u64) -> Outcome<Vec<Rate>> {
    let potential = |rng: &mut ChaCha8Rng, rough: f64| {
        let mut c: Vec<f64> = (0..3).map(|_| rng.random_range(0.2..1.0)).collect();
        c.extend((0..6).map(|_| rough * rng.random_range(-1.0..1.0)));
        Mechanics::<_, f64>::new(Potential, c)
    };
    let drag = |rng: &mut ChaCha8Rng| {
        let c: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.05..0.5));
        move |_: &[f64], v: &[f64], force: &mut [f64]| (force[0], force[1]) = (-c[0] * v[0], -c[1] * v[1])
    };
    let growing = |rng: &mut ChaCha8Rng| {
        Mechanics::<_, f64>::new(Growing, vec![rng.random_range(0.1..0.3), rng.random_range(0.05..0.1)])
    };
    let any = |(count, _): (usize, Invariant)| count > 0;
    let energy = |(_, invariant): (usize, Invariant)| invariant == Invariant::Energy;
    Ok(vec![
        rate(("conserved", "potentials without a symmetry"), NEVER, seeds, |rng| Ok(any(said(&potential(rng, 1.0))?)))?,
        rate(("conserved", "round potentials with friction"), NEVER, seeds, |rng| {
            Ok(any(said(&WithForces::new(potential(rng, 0.0), drag(rng)))?))
        })?,
        rate(("energy conserved", "friction"), NEVER, seeds, |rng| {
            Ok(energy(said(&WithForces::new(potential(rng, 1.0), drag(rng)))?))
        })?,
        rate(("energy conserved", "metrics that depend on their time"), NEVER, seeds, |rng| {
            Ok(energy(said(&growing(rng))?))
        })?,
        rate(("conserved", "round potentials"), ALWAYS, seeds, |rng| Ok(any(said(&potential(rng, 0.0))?)))?,
        rate(("energy conserved", "potentials"), ALWAYS, seeds, |rng| Ok(energy(said(&potential(rng, 1.0))?)))?,
    ])
}

// ---- Lyapunov times

/// Whether the motion from a random state within these bounds is said to be chaotic; `None` is a motion that ends early.
fn is_chaotic(
    model: &dyn EulerLagrange<f64>,
    rng: &mut ChaCha8Rng,
    bounds: &[[f64; 2]],
    seconds: f64,
) -> Outcome<bool> {
    let state: Vec<f64> = bounds.iter().map(|[low, high]| rng.random_range(*low..*high)).collect();
    let (q, v) = state.split_at(state.len() / 2);
    Ok(Lyapunov::of(model, q, v, &RolloutOptions::reference(seconds, seconds / 200.0))?.is_chaotic())
}

fn chaotic(seeds: u64) -> Outcome<Vec<Rate>> {
    let [sphere, pendulum] = ["sphere-geodesic", "double-pendulum"]
        .map(|name| SystemInstance::<f64>::named(name, &[]).and_then(|system| system.build()));
    let (sphere, pendulum) = (sphere?, pendulum?);
    let springs = Mechanics::<_, f64>::new(Linear, vec![]);
    let circles = [[0.2, 2.9], [0.0, 6.0], [-1.5, 1.5], [-1.5, 1.5]];
    let small = [[-1.0, 1.0]; 4];
    let far = [[2.0, 3.0], [2.0, 3.0], [-0.5, 0.5], [-0.5, 0.5]];
    let calm = [[-0.05, 0.05]; 4];
    Ok(vec![
        rate(("chaotic", "great circles"), NEVER, seeds, |rng| is_chaotic(&*sphere, rng, &circles, 100.0))?,
        rate(("chaotic", "great circles near the poles"), NEVER, seeds, |rng| {
            is_chaotic(&*sphere, rng, &[[0.5, 2.5], [0.0, 6.0], [0.5, 1.5], [0.005, 0.02]], 100.0)
        })?,
        rate(("chaotic", "linear oscillators"), NEVER, seeds, |rng| is_chaotic(&springs, rng, &small, 100.0))?,
        rate(("chaotic", "orbits in round potentials"), NEVER, seeds, |rng| {
            is_chaotic(
                &Mechanics::<_, f64>::new(Orbit, vec![]),
                rng,
                &[[0.5, 1.5], [0.0, 6.0], [-0.5, 0.5], [0.5, 1.5]],
                100.0,
            )
        })?,
        rate(("chaotic", "double pendula that hardly swing"), NEVER, seeds, |rng| {
            is_chaotic(&*pendulum, rng, &calm, 50.0)
        })?,
        rate(("chaotic", "double pendula that turn over"), ALWAYS, seeds, |rng| {
            is_chaotic(&*pendulum, rng, &far, 50.0)
        })?,
    ])
}

/// Two linear oscillators, joined.
struct Linear;

impl Lagrangian for Linear {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        R::half() * (v[0].sqr() + v[1].sqr() - q[0].sqr() - R::of(2.3) * q[1].sqr() - R::of(0.7) * (q[0] - q[1]).sqr())
    }
}

//! Greydanus, Dzamba and Yosinski, "Hamiltonian neural networks" (2019), by the protocols of their code.
//!
//! Rows are positions and momenta with their exact rates; a Lagrangian is learned in the place of their Hamiltonian. Momenta are
//! proportional to velocities in all four systems, by a factor that a regression on the rows gives.

use lnn::data::Dataset;
use lnn::lagrangian::{EulerLagrange, Lagrangian, Mechanics};
use lnn::network::Structure;
use lnn::presets::Trainer;
use lnn::recording::RecordedTrajectory;
use lnn::rollout::{RolloutOptions, rollout_many};
use lnn::scalar::Real;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Motions of which the energy is compared.
const MOTIONS: usize = 15;
/// Noise of positions and momenta of the spring and of the pendulum.
const NOISE: f64 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Exact {
    /// `H = q^2 + p^2`.
    Spring,
    /// `H = 3 (1 - cos q) + p^2`.
    Pendulum,
    /// Bodies of mass 1 in a plane, with the constant of gravitation 1.
    Bodies(usize),
}

impl Lagrangian for Exact {
    fn coordinates(&self) -> usize {
        match self {
            Self::Spring | Self::Pendulum => 1,
            Self::Bodies(bodies) => 2 * bodies,
        }
    }

    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        match self {
            Self::Spring => v[0].sqr() * R::of(0.25) - q[0].sqr(),
            Self::Pendulum => v[0].sqr() * R::of(0.25) + q[0].cos() * R::of(3.0),
            Self::Bodies(bodies) => {
                let mut sum = v.iter().fold(R::zero(), |sum, v| sum + v.sqr() * R::half());
                for i in 0..*bodies {
                    for j in 0..i {
                        let (x, y) = (q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]);
                        sum += (x.sqr() + y.sqr()).sqrt().recip();
                    }
                }
                sum
            }
        }
    }
}

/// A row of the table with the mean squared errors of the energy of a network of rates and of a Hamiltonian network.
struct Row {
    name: &'static str,
    exact: Exact,
    /// Motions of the data, samples of each, and their time span.
    data: (usize, usize, f64),
    /// Samples and time span of a motion whose energy is compared.
    judged: (usize, f64),
    theirs: [(&'static str, f64); 2],
}

const ROWS: [Row; 4] = [
    Row {
        name: "spring",
        exact: Exact::Spring,
        data: (50, 30, 3.0),
        judged: (100, 20.0),
        theirs: [("rates", 0.171), ("HNN", 3.84e-4)],
    },
    Row {
        name: "pendulum",
        exact: Exact::Pendulum,
        data: (50, 45, 3.0),
        judged: (100, 20.0),
        theirs: [("rates", 4.15e-2), ("HNN", 2.49e-2)],
    },
    Row {
        name: "2-body",
        exact: Exact::Bodies(2),
        data: (1000, 50, 20.0),
        judged: (500, 25.0),
        theirs: [("rates", 6.33e-2), ("HNN", 3.88e-5)],
    },
    Row {
        name: "3-body",
        exact: Exact::Bodies(3),
        data: (5000, 20, 5.0),
        judged: (500, 3.0),
        theirs: [("rates", 109.0), ("HNN", 4.19e-2)],
    },
];

type State = (Vec<f64>, Vec<f64>);

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

impl Exact {
    /// Velocity over momentum.
    fn per_momentum(self) -> f64 {
        if matches!(self, Self::Bodies(_)) { 1.0 } else { 2.0 }
    }

    /// A start of the data, position and momentum.
    fn start(self, rng: &mut ChaCha8Rng) -> State {
        match self {
            Self::Spring | Self::Pendulum => {
                let radius = if self == Self::Spring { rng.random_range(0.1..1.0) } else { rng.random_range(1.3..2.3) };
                let (q, p) = (2.0 * rng.random::<f64>() - 1.0, 2.0 * rng.random::<f64>() - 1.0);
                (vec![q / q.hypot(p) * radius], vec![p / q.hypot(p) * radius])
            }
            Self::Bodies(2) => {
                let x = [rng.random_range(0.5..1.5), rng.random_range(0.5..1.5)];
                let r = f64::hypot(x[0], x[1]);
                let speed = 0.5 / r.sqrt() * (1.0 + 0.05 * gauss(rng));
                let u = [x[1] / r * speed, -x[0] / r * speed];
                (vec![x[0], x[1], -x[0], -x[1]], vec![u[0], u[1], -u[0], -u[1]])
            }
            Self::Bodies(_) => {
                let (r, turn) = (rng.random_range(0.9..1.2), std::f64::consts::TAU * rng.random::<f64>());
                let speed = 0.759836 / f64::sqrt(r);
                let at = |k: usize| turn + std::f64::consts::TAU / 3.0 * k as f64;
                let q = (0..3).flat_map(|k| [r * at(k).cos(), r * at(k).sin()]).collect();
                let v = (0..3).flat_map(|k| [speed * at(k).sin(), -speed * at(k).cos()]);
                (q, v.collect::<Vec<f64>>().into_iter().map(|v| v * rng.random_range(0.8..1.2)).collect())
            }
        }
    }

    /// A start of a motion whose energy is compared.
    fn judged(self, rng: &mut ChaCha8Rng) -> State {
        if matches!(self, Self::Bodies(_)) {
            return self.start(rng);
        }
        let mut component = || rng.random_range(0.2..1.0) * if rng.random::<bool>() { 1.0 } else { -1.0 };
        (vec![component()], vec![component()])
    }

    /// What is called the energy of a position and a momentum there: of spring and pendulum `q^2 + p^2`.
    fn energy(self, q: &[f64], p: &[f64]) -> f64 {
        match self {
            Self::Spring | Self::Pendulum => q[0] * q[0] + p[0] * p[0],
            Self::Bodies(_) => Mechanics::new(self, []).energy(q, p).map_or(f64::NAN, |energy| energy[0]),
        }
    }
}

/// Exact motions: times, positions, velocities and accelerations.
fn motions(exact: Exact, starts: &[State], samples: usize, time: f64) -> Vec<RecordedTrajectory> {
    let model = Mechanics::new(exact, []);
    let starts: Vec<State> =
        starts.iter().map(|(q, p)| (q.clone(), p.iter().map(|p| p * exact.per_momentum()).collect())).collect();
    let options = RolloutOptions::reference(time, time / (samples - 1) as f64).energy(false);
    let motions = rollout_many(&model, &starts, &options, 2).into_iter();
    motions
        .map(|motion| {
            let motion = motion.complete().expect("smooth forces");
            let n = exact.coordinates();
            let states = motion.q.chunks_exact(n).zip(motion.v.chunks_exact(n));
            let a = states.flat_map(|(q, v)| model.acceleration(q, v).expect("smooth forces")).collect();
            let name = String::new();
            RecordedTrajectory { name, times: motion.t, q: motion.q, v: motion.v, a, force: vec![] }
        })
        .collect()
}

/// Derivatives in time by parabolas through three samples.
fn slopes(of: &[f64], times: &[f64]) -> Vec<f64> {
    let slope = |k: usize| (of[k] - of[k - 1]) / (times[k] - times[k - 1]);
    let last = of.len() - 1;
    (0..=last)
        .map(|k| match k {
            0 => 1.5 * slope(1) - 0.5 * slope(2),
            k if k == last => 1.5 * slope(k) - 0.5 * slope(k - 1),
            k => 0.5 * (slope(k) + slope(k + 1)),
        })
        .collect()
}

/// Noisy samples moved onto the integral of their exact rates, by Hermite polynomials, whose constant is their mean.
fn along(noisy: &[f64], rates: &[f64], slopes: &[f64], times: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0];
    for k in 1..noisy.len() {
        let h = times[k] - times[k - 1];
        sum.push(sum[k - 1] + 0.5 * h * (rates[k] + rates[k - 1]) - h * h / 12.0 * (slopes[k] - slopes[k - 1]));
    }
    let offset = noisy.iter().zip(&sum).map(|(noisy, sum)| noisy - sum).sum::<f64>() / noisy.len() as f64;
    sum.iter().map(|sum| sum + offset).collect()
}

/// Learns from the rows and returns the mean squared error of the energy.
fn run(row: &Row, seed: u64, share: f64, steps: usize) -> (f64, f64) {
    let started = Instant::now();
    let (exact, mut rng) = (row.exact, ChaCha8Rng::seed_from_u64(seed));
    let (count, samples, time) = row.data;
    let count = ((count as f64 * share) as usize).max(4);
    let starts: Vec<State> = (0..count).map(|_| exact.start(&mut rng)).collect();
    let mut tracks = motions(exact, &starts, samples, time);
    let n = exact.coordinates();
    // Half of the motions of spring and pendulum is for the test, a fifth of the bodies'.
    let noisy = !matches!(exact, Exact::Bodies(_));
    let mut per_momentum = exact.per_momentum();
    tracks.truncate(if noisy { count / 2 } else { count * 4 / 5 });
    if noisy {
        // The order of the samples in time is used: rates are exact, and give a motion up to where it begins.
        let mut pairs = (0.0, 0.0);
        for track in &mut tracks {
            let [p, rates] =
                [&track.v, &track.a].map(|of| of.iter().map(|x| x / exact.per_momentum()).collect::<Vec<_>>());
            let noisy: Vec<f64> = p.iter().map(|p| p + NOISE * gauss(&mut rng)).collect();
            let p = along(&noisy, &rates, &slopes(&rates, &track.times), &track.times);
            pairs.0 += track.v.iter().map(|v| v * v).sum::<f64>();
            pairs.1 += track.v.iter().zip(p).map(|(v, p)| v * p).sum::<f64>();
            track.a = rates;
        }
        // Momenta have noise, rates of positions have none: the regression is of momenta on them.
        per_momentum = pairs.0 / pairs.1;
        for track in &mut tracks {
            track.a.iter_mut().for_each(|rate| *rate *= per_momentum);
            track.q.iter_mut().for_each(|q| *q += NOISE * gauss(&mut rng));
            track.q = along(&track.q, &track.v, &track.a, &track.times);
        }
    }
    let threads = 2;
    let part = |of: fn(&RecordedTrajectory) -> &[f64]| tracks.iter().flat_map(|t| of(t).iter().copied()).collect();
    let (q, v, a): (Vec<f64>, Vec<f64>, Vec<f64>) = (part(|t| &t.q), part(|t| &t.v), part(|t| &t.a));
    let data = Dataset::new(n, q, v, a).expect("finite states");
    let epochs = (steps * 128).div_ceil(data.len() * 8 / 10);
    let trained = |structure| {
        let trainer = Trainer::new(&data).structure(structure).epochs(epochs).seed(seed).threads(threads);
        trainer.train().expect("a training")
    };
    let both = [Structure::ConstantMass, Structure::Mechanical].map(trained).into_iter();
    let model = both.min_by(|a, b| a.validation_loss.total_cmp(&b.validation_loss)).expect("two").model;
    let starts: Vec<State> = (0..MOTIONS).map(|_| exact.judged(&mut rng)).collect();
    let (samples, time) = row.judged;
    let true_motions = motions(exact, &starts, samples, time);
    let starts: Vec<State> =
        starts.into_iter().map(|(q, p)| (q, p.iter().map(|p| p * per_momentum).collect())).collect();
    let options = RolloutOptions::new(time, time / (samples - 1) as f64).energy(false).tolerances(1e-8, 1e-8);
    let predicted = rollout_many(&model, &starts, &options, threads);
    let errors = true_motions.iter().zip(predicted).map(|(exact_motion, predicted)| {
        let predicted = predicted.trajectory;
        let energy = |q: &[f64], v: &[f64], per: f64| exact.energy(q, &v.iter().map(|v| v / per).collect::<Vec<_>>());
        let errors = (0..samples).map(|k| {
            let at = k * n..(k + 1) * n;
            let exact_energy = energy(&exact_motion.q[at.clone()], &exact_motion.v[at.clone()], exact.per_momentum());
            match predicted.q.get(at.clone()).zip(predicted.v.get(at)) {
                Some((q, v)) => (exact_energy - energy(q, v, per_momentum)).powi(2),
                None => f64::INFINITY,
            }
        });
        errors.sum::<f64>() / samples as f64
    });
    (errors.sum::<f64>() / MOTIONS as f64, started.elapsed().as_secs_f64())
}

fn table(rows: &[&Row], seeds: u64, share: f64, steps: usize) {
    println!("system       energy      seed       MSE   seconds");
    for row in rows {
        for seed in 0..seeds {
            let (error, seconds) = run(row, seed, share, steps);
            println!("{:<12} {:<10} {seed:>5} {error:>9.1e} {seconds:>9.1}", row.name, "");
        }
        for (name, error) in row.theirs {
            println!("{:<12} {name:<10}       {error:>9.1e}", row.name);
        }
    }
}

/// Names of the rows.
pub fn names() -> impl Iterator<Item = &'static str> {
    ROWS.iter().map(|row| row.name)
}

/// Rows by name, all without one.
pub fn all(name: Option<&str>, seeds: u64, steps: usize) {
    let rows: Vec<&Row> = ROWS.iter().filter(|row| name.is_none_or(|name| name == row.name)).collect();
    table(&rows, seeds, 1.0, steps);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of either kind at its smallest.
    #[test]
    fn rows_of_either_kind_run() {
        table(&[&ROWS[0], &ROWS[2]], 1, 0.2, 4);
    }
}

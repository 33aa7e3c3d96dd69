//! Lutter, Ritter and Peters, "Deep Lagrangian networks" (2019), by the protocols of their code at 18a943d.
//!
//! An arm of two joints draws letters, and torques `M a + c + g` are learned from positions, velocities, accelerations and torques. Their
//! file of letters is not here: `benches/peers/letters.py` makes the CSV that `--letters FILE.csv` reads, columns `letter,t,q1,q2`.
//! Velocities and accelerations are central differences of it and torques those of the arm, as in their file. Three letters are for the test.
//!
//! Errors are means over the samples of the test of sums of squares over the joints, in N^2 m^2. The valid time is that until
//! `sum_j (q_j - q'_j)^2 / s_j` reaches 0.01, a mean of the first two motions. Theirs are not told that both coordinates are angles.

use lnn::configuration::{Lbfgs, Precision};
use lnn::data::Dataset;
use lnn::lagrangian::{EulerLagrange, ForceParts, InverseDynamics, Lagrangian, Mechanics};
use lnn::network::{Factor, Structure};
use lnn::presets::Trainer;
use lnn::rollout::{Driven, Force, RolloutOptions, Trajectory, rollout};
use lnn::scalar::Real;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;
use std::time::Instant;

/// The arm: `M11 = 1.37 + cos q2`, `M12 = 0.518 + cos(q2)/2`, `M22 = 0.518`, and its weight; a fit to the matrices, Coriolis forces and
/// weights of their file that leaves 3e-15.
#[derive(Clone, Copy, Debug)]
struct Arm;

const FIRST: f64 = 1.372729166667;
const SECOND: f64 = 0.517614583333;

impl Lagrangian for Arm {
    fn coordinates(&self) -> usize {
        2
    }

    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let bend = q[1].cos();
        let kinetic = (R::of(FIRST) + bend) * v[0].sqr() * R::half()
            + (R::of(SECOND) + bend * R::half()) * v[0] * v[1]
            + R::of(SECOND) * v[1].sqr() * R::half();
        kinetic - q[0].sin() * R::of(2.625) - (q[0] + q[1]).sin() * R::of(1.5)
    }
}

/// Letters of the test; the first two are followed.
const TEST: [&str; 3] = ["e", "v", "q"];
/// Time between two samples of a letter, of the motion without torques, and between two torques of a controller, in s.
const LETTER_STEP: f64 = 0.04;
const FREE_STEP: f64 = 0.02;
const CONTROL_STEP: f64 = 0.002;
/// `s_j` of the valid time, for letters and for the motion without torques.
const LETTER_SPREAD: [f64; 2] = [0.0945, 0.1455];
const FREE_SPREAD: [f64; 2] = [1.072, 9.933];
/// Samples of the motion without torques, and states learned from for it.
const FREE_SAMPLES: usize = 400;
const FREE_STATES: usize = 2459;
/// Starts at rest of the motion without torques; the first two are followed.
const FREE_STARTS: [[f64; 2]; 2] = [[PI / 4.0, PI / 4.0], [-PI, -PI / 2.0]];

/// Their numbers: errors of the torque and of its inertial, Coriolis and gravity part, valid times of letters and without torques.
const THEIRS: [(&str, [f64; 6]); 5] = [
    ("DeLaN", [2.2e-5, 3.2e-5, 1.4e-5, 2.0e-5, 2.32, 5.64]),
    ("black-box L", [2.8e-5, 1.9e-5, 2.0e-5, 1.2e-5, 2.76, 3.59]),
    ("HNN", [5.4e-6, 2.8e-6, 6.3e-6, 2.8e-6, 2.90, 5.09]),
    ("black-box H", [1.6e-5, 8.6e-3, 8.5e-3, 1.0e-5, 2.19, 3.80]),
    ("plain network", [6.2e-4, 7.8e-4, 6.4e-4, 1.1e-4, 1.81, 2.52]),
];

/// States of the arm under the torques that its motion asks for, `(samples, 2)` each.
#[derive(Clone, Debug, Default)]
struct Motion {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    torque: Vec<f64>,
}

impl Motion {
    /// The same states under the torques that the arm says.
    fn under_its_torques(self) -> Self {
        let arm = Mechanics::new(Arm, []);
        let torque = InverseDynamics::of(&arm, &self.q, &self.v, &self.a).expect("smooth forces").generalized;
        Self { torque, ..self }
    }

    /// A letter by its positions: central differences inside, one-sided ones at the ends.
    fn letter(q: Vec<f64>) -> Self {
        let (v, last) = (differences(&q), q.len() / 2 - 1);
        assert!(last > 0, "a letter has two samples at least");
        let a = differences(&v);
        Self { q, v, a, torque: vec![] }.under_its_torques()
    }

    fn extend(&mut self, other: &Self) {
        self.q.extend(&other.q);
        self.v.extend(&other.v);
        self.a.extend(&other.a);
        self.torque.extend(&other.torque);
    }
}

fn differences(x: &[f64]) -> Vec<f64> {
    let last = x.len() / 2 - 1;
    let at = |k: usize| {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
        let time = LETTER_STEP * (after - before).max(1) as f64;
        [0, 1].map(|j| (x[2 * after + j] - x[2 * before + j]) / time)
    };
    (0..=last).flat_map(at).collect()
}

/// Torques that are held from sample to sample.
struct HeldTorques {
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Force<f64> for HeldTorques {
    fn force(&self, t: f64, _: &[f64], _: &[f64], force: &mut [f64]) {
        let k = self.times.partition_point(|&known| known <= t).max(1) - 1;
        force.copy_from_slice(&self.values[2 * k..2 * k + 2]);
    }

    fn breaks(&self) -> &[f64] {
        &self.times
    }
}

/// A network of the arm, `L = v^T M(q) v/2 - V(q)`, learned from the torques of states.
fn learned(states: &Motion, seed: u64, (epochs, iterations): (usize, usize)) -> Box<dyn EulerLagrange<f64>> {
    let count = states.q.len() / 2;
    let size = |j: usize| states.torque.iter().skip(j).step_by(2).map(|x| x * x).sum::<f64>() / count as f64;
    let scale = vec![size(0).sqrt(), size(1).sqrt()];
    let data = Dataset::new(2, states.q.clone(), states.v.clone(), states.a.clone()).expect("finite states");
    let data = data.with_forces(states.torque.clone()).expect("finite torques");
    let data = data.with_force_residuals(scale).expect("torques that are not all zero");
    let trainer = Trainer::new(&data).angles(&[0, 1]).structure(Structure::Mechanical).hidden(&[64, 64]);
    let trainer = trainer.epochs(epochs).precision(Precision::F64).seed(seed).threads(2);
    let trainer = trainer.configure(|config| {
        config.network.factor = Factor::Rectangle;
        config.optimizer.weight_decay = 0.0;
        config.optimizer.clip = 10.0;
        config.phases[0].rate = 3e-3;
        config.lbfgs = Some(Lbfgs { iterations, ..Default::default() });
    });
    Box::new(trainer.train().expect("a training").model)
}

/// Mean squares of the errors of the torque and of its three parts.
fn torque_errors(model: &dyn EulerLagrange<f64>, test: &Motion) -> [f64; 4] {
    let parts = |model: &dyn EulerLagrange<f64>| {
        let ForceParts { inertial, coriolis, gravity, .. } =
            ForceParts::of(model, &test.q, &test.v, &test.a).expect("finite forces");
        let whole = inertial.iter().zip(&coriolis).zip(&gravity).map(|((i, c), g)| i + c + g).collect();
        [whole, inertial, coriolis, gravity]
    };
    let (exact, found) = (parts(&Mechanics::new(Arm, [])), parts(model));
    let samples = (test.q.len() / 2) as f64;
    std::array::from_fn(|k| exact[k].iter().zip(&found[k]).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / samples)
}

/// Time until the sum of squares over the spreads reaches 0.01: the first sample of a motion that is that far off.
fn valid(exact: &[f64], found: &Trajectory<f64>, spread: [f64; 2], step: f64) -> f64 {
    let near = |(a, b): (&[f64], &[f64])| (0..2).map(|j| (a[j] - b[j]).powi(2) / spread[j]).sum::<f64>() < 0.01;
    let near = exact.chunks_exact(2).zip(found.q.chunks_exact(2)).take_while(|pair| near(*pair));
    near.count() as f64 * step
}

/// Valid time of a letter under its torques, held from sample to sample.
fn valid_letter(model: &dyn EulerLagrange<f64>, letter: &Motion) -> f64 {
    let samples = letter.q.len() / 2;
    let times: Vec<f64> = (0..samples).map(|k| k as f64 * LETTER_STEP).collect();
    let torques = HeldTorques { times, values: letter.torque.clone() };
    let options = tight((samples - 1) as f64 * LETTER_STEP, LETTER_STEP);
    let found = Driven::new(model, &torques).rollout(&letter.q[..2], &letter.v[..2], &options);
    valid(&letter.q, &found.trajectory, LETTER_SPREAD, LETTER_STEP)
}

fn tight(time: f64, step: f64) -> RolloutOptions<f64> {
    RolloutOptions::new(time, step).energy(false).tolerances(1e-9, 1e-9)
}

/// Motion without torques from rest by their integrator: Euler's method at 2 ms, velocities first.
fn free_motion(start: [f64; 2]) -> Motion {
    let arm = Mechanics::new(Arm, []);
    let (mut q, mut v) = (start.to_vec(), vec![0.0; 2]);
    let mut found = Motion::default();
    for k in 0..FREE_SAMPLES * 10 {
        let a = arm.acceleration(&q, &v).expect("smooth forces");
        if k % 10 == 0 {
            found.q.extend(&q);
            found.v.extend(&v);
            found.a.extend(&a);
        }
        for j in 0..2 {
            v[j] += 0.002 * a[j];
            q[j] += 0.002 * v[j];
        }
    }
    found.under_its_torques()
}

fn valid_free(model: &dyn EulerLagrange<f64>, exact: &Motion) -> f64 {
    let options = tight((FREE_SAMPLES - 1) as f64 * FREE_STEP, FREE_STEP);
    let found = rollout(model, &exact.q[..2], &exact.v[..2], &options);
    valid(&exact.q, &found.trajectory, FREE_SPREAD, FREE_STEP)
}

/// States to learn from for the motion without torques: positions anywhere on the circle, velocities in the range of the motions that are
/// followed, and torques up to the arm's own weight, which say the accelerations. Their training file is missing.
fn free_states(followed: &[Motion], seed: u64) -> Motion {
    let (arm, mut rng) = (Mechanics::new(Arm, []), ChaCha8Rng::seed_from_u64(seed));
    let fastest = |j: usize| {
        let all = followed.iter().flat_map(|motion| motion.v.iter().skip(j).step_by(2));
        all.fold(0.0, |most: f64, x| most.max(x.abs()))
    };
    let bounds = [PI, PI, fastest(0), fastest(1), 4.125, 1.5];
    let mut found = Motion::default();
    for _ in 0..FREE_STATES {
        let [q1, q2, v1, v2, t1, t2] = bounds.map(|most| most * (2.0 * rng.random::<f64>() - 1.0));
        let torque = move |_: f64, _: &[f64], _: &[f64], force: &mut [f64]| force.copy_from_slice(&[t1, t2]);
        found.a.extend(Driven::new(&arm, &torque).acceleration(0.0, &[q1, q2], &[v1, v2]).expect("smooth forces"));
        found.q.extend([q1, q2]);
        found.v.extend([v1, v2]);
        found.torque.extend([t1, t2]);
    }
    found
}

/// Largest distance of a joint in rad from a letter that the arm is to draw, under the torques that a model asks for: those of the wanted
/// acceleration and of a pull to the wanted state at a rate of 20/s, held for 2 ms. Without a model that pull alone is the torque.
fn tracking_error(model: Option<&dyn EulerLagrange<f64>>, letter: &Motion) -> f64 {
    let arm = Mechanics::new(Arm, []);
    let pull = 20.0_f64;
    let (mut q, mut v, mut worst) = (letter.q[..2].to_vec(), letter.v[..2].to_vec(), 0.0_f64);
    let steps = ((letter.q.len() / 2 - 1) as f64 * LETTER_STEP / CONTROL_STEP).round() as usize;
    for k in 0..steps {
        let [wanted, speed, acceleration] = between(letter, k as f64 * CONTROL_STEP);
        let a: Vec<f64> = (0..2)
            .map(|j| acceleration[j] + 2.0 * pull * (speed[j] - v[j]) + pull * pull * (wanted[j] - q[j]))
            .collect();
        let torque = match model {
            Some(model) => InverseDynamics::of(model, &q, &v, &a).expect("finite forces").generalized,
            None => a,
        };
        let options = RolloutOptions::new(CONTROL_STEP, CONTROL_STEP).energy(false);
        let held = move |_: f64, _: &[f64], _: &[f64], force: &mut [f64]| force.copy_from_slice(&torque);
        let moved = Driven::new(&arm, &held).rollout(&q, &v, &options).complete().expect("smooth forces");
        let (next, speed) = moved.state(moved.len() - 1);
        (q, v) = (next.to_vec(), speed.to_vec());
        let [wanted, ..] = between(letter, (k + 1) as f64 * CONTROL_STEP);
        worst = (0..2).fold(worst, |worst, j| worst.max((wanted[j] - q[j]).abs()));
    }
    worst
}

/// Position, velocity and acceleration of a letter at a time: Hermite's cubic between its samples.
fn between(letter: &Motion, time: f64) -> [[f64; 2]; 3] {
    let last = letter.q.len() / 2 - 2;
    let k = ((time / LETTER_STEP) as usize).min(last);
    let (h, s) = (LETTER_STEP, time / LETTER_STEP - k as f64);
    let at = |j: usize| {
        let (q, v) = (&letter.q[2 * k + j..], &letter.v[2 * k + j..]);
        let (d, from, to) = (q[2] - q[0], h * v[0], h * v[2]);
        // q0 + from s + (3 d - 2 from - to) s^2 + (from + to - 2 d) s^3.
        let (b, c) = (3.0 * d - 2.0 * from - to, from + to - 2.0 * d);
        [
            q[0] + s * (from + s * (b + s * c)),
            (from + s * (2.0 * b + s * 3.0 * c)) / h,
            (2.0 * b + 6.0 * c * s) / (h * h),
        ]
    };
    let (first, second) = (at(0), at(1));
    std::array::from_fn(|order| [first[order], second[order]])
}

/// Positions of the letters of a file by name.
fn read(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut letters: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (row, line) in text.lines().enumerate().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |k: usize| {
            let found = fields.get(k).and_then(|text| text.trim().parse::<f64>().ok()).filter(|x| x.is_finite());
            found.unwrap_or_else(|| panic!("{} row {}: expected letter,t,q1,q2", path.display(), row + 1))
        };
        letters.entry(fields[0].to_string()).or_default().extend([number(2), number(3)]);
    }
    letters
}

/// The row of a seed.
fn row(letters: &BTreeMap<String, Vec<f64>>, seed: u64, budget: (usize, usize)) -> ([f64; 6], [f64; 2], f64) {
    let (mut training, mut test) = (Motion::default(), Motion::default());
    let motions: BTreeMap<&str, Motion> =
        letters.iter().map(|(name, q)| (name.as_str(), Motion::letter(q.clone()))).collect();
    for (name, motion) in &motions {
        if TEST.contains(name) { test.extend(motion) } else { training.extend(motion) }
    }
    let started = Instant::now();
    let model = learned(&training, seed, budget);
    let seconds = started.elapsed().as_secs_f64();
    let [whole, inertial, coriolis, gravity] = torque_errors(&*model, &test);
    let followed = TEST[..2].iter().filter_map(|name| motions.get(name));
    let times: Vec<f64> = followed.map(|letter| valid_letter(&*model, letter)).collect();
    let free = FREE_STARTS.map(free_motion);
    let free_model = learned(&free_states(&free, seed), seed, budget);
    let free_time = free.iter().map(|motion| valid_free(&*free_model, motion)).sum::<f64>() / free.len() as f64;
    let letter_time = times.iter().sum::<f64>() / times.len() as f64;
    let tracked = [Some(&*model), None].map(|model| tracking_error(model, &motions[TEST[0]]));
    ([whole, inertial, coriolis, gravity, letter_time, free_time], tracked, seconds)
}

/// Inverse dynamics a second, on one thread.
fn rate(model: &dyn EulerLagrange<f64>) -> f64 {
    let states = free_states(&FREE_STARTS.map(free_motion), 0);
    let (started, mut rounds) = (Instant::now(), 0);
    while started.elapsed().as_secs_f64() < 0.5 {
        InverseDynamics::of(model, &states.q, &states.v, &states.a).expect("finite forces");
        rounds += 1;
    }
    (rounds * FREE_STATES) as f64 / started.elapsed().as_secs_f64()
}

fn print(name: &str, numbers: &[f64; 6], rest: &str) {
    let [torque, inertial, coriolis, gravity, letters, free] = numbers;
    println!(
        "{name:<14} {torque:>8.1e} {inertial:>8.1e} {coriolis:>8.1e} {gravity:>8.1e} {letters:>7.2} {free:>7.2} {rest}"
    );
}

/// All seeds, beside their numbers and the exact arm's valid times.
pub fn all(file: Option<&Path>, seeds: u64) {
    let Some(file) = file else {
        println!("letters: left out, --letters FILE.csv names the file that benches/peers/letters.py makes");
        return;
    };
    let letters = read(file);
    println!("               torque   inertial coriolis gravity  valid, letters and without torques, s");
    for seed in 0..seeds {
        let (numbers, [tracked, pulled], seconds) = row(&letters, seed, (500, 300));
        let rest = format!("{seconds:.1} s; drawn within {tracked:.1e} rad, by the pull alone {pulled:.2}");
        print(&format!("here, seed {seed}"), &numbers, &rest);
    }
    let arm = Mechanics::new(Arm, []);
    let letter = |name: &&str| letters.get(*name).map(|q| valid_letter(&arm, &Motion::letter(q.clone())));
    let times: Vec<f64> = TEST[..2].iter().filter_map(letter).collect();
    let free = FREE_STARTS.map(|start| valid_free(&arm, &free_motion(start)));
    let mean = |times: &[f64]| times.iter().sum::<f64>() / times.len() as f64;
    print("exact", &[0.0, 0.0, 0.0, 0.0, mean(&times), mean(&free)], "");
    THEIRS.iter().for_each(|(name, numbers)| print(name, numbers, ""));
    let states = free_states(&FREE_STARTS.map(free_motion), 0);
    println!("{:.0} inverse dynamics a second on one thread", rate(&*learned(&states, 0, (2, 1))));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A made letter at its smallest; the arm itself is no error, and its controller draws what it is told.
    #[test]
    fn letters_are_learned_and_drawn() {
        let wave =
            |phase: f64| (0..40).flat_map(|k| [(0.1 * k as f64 + phase).sin(), 0.3 * (0.2 * k as f64).cos()]).collect();
        let letters =
            ["a", "e", "v", "q"].iter().enumerate().map(|(k, name)| (name.to_string(), wave(k as f64))).collect();
        let (numbers, ..) = row(&letters, 0, (2, 1));
        assert!(numbers.iter().all(|x| x.is_finite()), "{numbers:?}");
        let (arm, letter) = (Mechanics::new(Arm, []), Motion::letter(letters["e"].clone()));
        assert!(torque_errors(&arm, &letter).iter().all(|error| *error < 1e-24));
        assert!(tracking_error(Some(&arm), &letter) < 1e-3 && tracking_error(None, &letter) > 1e-2);
    }
}

//! How well motion determines what is learned: cart-pendulums of known masses and frictions, twenty made recordings of
//! them, and how often the ranges that a fit states hold the truth.
//!
//! A cart of 1 kg on a rail carries a pendulum of 0.3 kg at 0.5 m: `M = [[1.3, 0.15 cos q], [0.15 cos q, 0.075]]`, friction
//! of 0.3 N s/m on the cart and 0.01 N m s in the joint, positions with noise; with a known force on the cart or without.

use super::Scale;
use lnn::analysis::{Determination, Estimate, Observed, determination, places};
use lnn::configuration::Penalty;
use lnn::data::{PrepareOptions, RecordingSplit};
use lnn::lagrangian::{EulerLagrange, HandWritten, Lagrangian, MechanicsError, Request, Terms};
use lnn::linalg::Workspace;
use lnn::network::NetworkLagrangian;
use lnn::random::RngStream;
use lnn::recording::{RecordedTrajectory, Recording, Targets};
use lnn::rollout::{Options, rollout};
use lnn::scalar::Real;
use lnn::training::{Hooks, train};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Cart and pendulum; coordinates in m and, from the downward vertical, rad.
struct CartPendulum;

impl CartPendulum {
    const CART: f64 = 1.0;
    const BOB: f64 = 0.3;
    const LENGTH: f64 = 0.5;
    const FRICTION: [f64; 2] = [0.3, 0.01];

    /// Mean of the mass matrix over angles, upper triangle.
    fn mass(angles: impl Iterator<Item = f64>) -> [f64; 3] {
        let (sum, count) = angles.fold((0.0, 0.0), |(sum, count), q| (sum + q.cos(), count + 1.0));
        [Self::CART + Self::BOB, Self::BOB * Self::LENGTH * sum / count, Self::BOB * Self::LENGTH * Self::LENGTH]
    }
}

impl Lagrangian for CartPendulum {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let [cart, bob, length, gravity] = [p[0], p[1], p[2], p[3]];
        let along = v[0] + length * v[1] * q[1].cos();
        let up = length * v[1] * q[1].sin();
        R::half() * (cart * v[0].sqr() + bob * (along.sqr() + up.sqr())) + bob * gravity * length * q[1].cos()
    }
}

/// A cart-pendulum with friction, and a force on the cart that depends on the cart's place: what a recording with a
/// force in it is made by.
struct Driven {
    exact: HandWritten<CartPendulum, f64>,
    /// Stiffness of the force in N/m and offset in m.
    force: Option<(f64, f64)>,
}

impl Driven {
    fn new(force: Option<(f64, f64)>) -> Self {
        let p = vec![CartPendulum::CART, CartPendulum::BOB, CartPendulum::LENGTH, 9.81];
        Self { exact: HandWritten::new(CartPendulum, p), force }
    }
    fn drive(&self, x: f64) -> f64 {
        self.force.map_or(0.0, |(stiffness, offset)| -stiffness * (x - offset))
    }
}

impl EulerLagrange<f64> for Driven {
    fn coordinates(&self) -> usize {
        2
    }
    fn conserves_energy(&self) -> bool {
        false
    }
    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        self.exact.terms(q, v, request, terms)?;
        if request.includes(Request::FORCE) {
            for (q, v) in q.chunks_exact(2).zip(v.chunks_exact(2)) {
                let [cart, joint] = CartPendulum::FRICTION;
                terms.dissipation.push(cart * v[0] * v[0] + joint * v[1] * v[1]);
                terms.force.extend([self.drive(q[0]) - cart * v[0], -joint * v[1]]);
            }
        }
        terms.complete(2, v, request, &mut Workspace::new())
    }
}

/// Runs of a cart-pendulum at 100 Hz with noise of 0.2 mm and 1 mrad.
fn recording(forced: bool, runs: usize, seconds: f64, seed: u64) -> Recording {
    let rng = &mut RngStream::Training(0).generator(seed);
    let tracks = (0..runs).map(|run| {
        let force = forced.then(|| (rng.random_range(2.0..8.0), rng.random_range(-0.5..0.5)));
        let model = Driven::new(force);
        let q = [rng.random_range(-0.3..0.3), rng.random_range(-2.0..2.0)];
        let v = [rng.random_range(-0.8..0.8), rng.random_range(-3.0..3.0)];
        let motion = rollout(&model, &q, &v, &Options { energy: false, ..Options::reference(seconds, 0.01) });
        let motion = motion.complete().expect("a cart-pendulum moves on");
        let force = motion.q.chunks_exact(2).flat_map(|q| [model.drive(q[0]), 0.0]);
        let force = if forced { force.collect() } else { vec![] };
        let sigma = [2e-4, 1e-3];
        let noisy = motion.q.iter().enumerate();
        let q = noisy.map(|(k, q)| q + sigma[k % 2] * Distribution::<f64>::sample(&StandardNormal, rng));
        RecordedTrajectory { name: format!("run {run}"), times: motion.t, q: q.collect(), v: vec![], a: vec![], force }
    });
    let tracks = tracks.collect();
    Recording { coordinates: ["x", "angle"].map(String::from).to_vec(), periodic: vec![false, true], tracks }
}

/// Root mean square distance of two energies, each about its mean.
fn energy_error(model: &[f64], exact: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (a, b) = (mean(model), mean(exact));
    let squares = model.iter().zip(exact).map(|(x, y)| (x - a - (y - b)).powi(2));
    (squares.sum::<f64>() / model.len() as f64).sqrt()
}

/// One recording: what was stated, and the truth in its unit.
fn one(forced: bool, runs: usize, seconds: f64, seed: u64, scale: Scale) -> Vec<(&'static str, Estimate, f64)> {
    let recording = recording(forced, runs, seconds, seed);
    let preparation = PrepareOptions { seed, ..PrepareOptions::default() };
    let measured = RecordingSplit::new(&recording, &preparation).expect("long trajectories");
    let data = measured.datasets::<f32>(Targets::Smoothed).expect("states with full windows");
    let mut config = lnn::presets::suggested("cart-pendulum", &data);
    config.seed = seed;
    config.network.hidden = scale.hidden.to_vec();
    config.network.dissipation = Some(16);
    let epochs = scale.epochs.unwrap_or(config.phases[0].epochs);
    (config.phases[0].epochs, config.phases[0].t_max) = (epochs, epochs as f64);
    let names = recording.coordinates.iter().map(String::as_str);
    let scale = data.training[0].physical_scale();
    let architecture = config.architecture_with(names, recording.periodic.clone(), scale).expect("names of its own");
    let penalty = Penalty::Eigenvalue { lambda: config.penalty.lambda() };
    let trained = train(&config, &architecture, penalty, data, 2, &Hooks::default()).expect("a training");
    let model = NetworkLagrangian::new(architecture, trained.weights).expect("its weights").cast::<f64>();

    let observed = Observed::new(&measured, Targets::Smoothed).expect("states with full windows");
    let (q, v) = places(&measured);
    let started = Instant::now();
    let found: Determination =
        determination(&model, &recording.periodic, &observed, (&q, &v)).expect("a model of these states");
    let took = started.elapsed().as_secs_f64();

    let mass = CartPendulum::mass(q.iter().skip(1).step_by(2).copied());
    let unit = if found.absolute { 1.0 } else { mass[0] };
    let energy = |model: &dyn EulerLagrange<f64>, unit: f64| -> Vec<f64> {
        let mut terms = Terms::default();
        model.terms(&q, &v, Request::ENERGY, &mut terms).expect("regular states");
        terms.energy.iter().map(|e| e / unit).collect()
    };
    let mut terms = Terms::default();
    model.terms(&q, &v, Request::MASS_MATRIX, &mut terms).expect("regular states");
    let learned = terms.mass_matrix.iter().step_by(4).sum::<f64>() / (q.len() / 2) as f64;
    let learned = if found.absolute { 1.0 } else { learned };
    let error = energy_error(&energy(&model, learned), &energy(&Driven::new(None).exact, unit));
    let names = ["M11", "M12", "M22"];
    let mut rows: Vec<_> =
        names.into_iter().zip(&found.mass_matrix).zip(mass).map(|((name, e), m)| (name, *e, m / unit)).collect();
    let frictions = ["friction of x", "friction of angle"].into_iter().zip(&found.friction).zip(CartPendulum::FRICTION);
    rows.extend(frictions.map(|((name, e), truth)| (name, *e, truth / unit)));
    rows.push(("energy", found.energy, found.energy.value + error));
    let loss = trained.validation_loss;
    println!("  seed {seed}: loss {loss:.4}, {:.0} s of training, {took:.2} s to tell", trained.seconds);
    rows
}

/// Prints and returns rows `forces,seed,quantity,learned,low,high,truth`, and prints how often the truth lies within.
pub fn compare(seeds: std::ops::Range<u64>, (runs, seconds): (usize, f64), scale: Scale) -> Vec<String> {
    let mut all = Vec::new();
    for forced in [false, true] {
        println!(
            "cart-pendulum, {}:",
            if forced { "known forces on the cart" } else { "no forces: over the mean of M11" }
        );
        let mut counts: Vec<(&str, usize, f64)> = Vec::new();
        for seed in seeds.clone() {
            for (k, (name, estimate, truth)) in one(forced, runs, seconds, seed, scale).into_iter().enumerate() {
                let [low, high] = estimate.range();
                let inside = estimate.allows(truth);
                println!(
                    "    {name:18} {:9.4} from {low:9.4} to {high:9.4}, true {truth:9.4}{}",
                    estimate.value,
                    if inside { "" } else { "  OUTSIDE" }
                );
                if counts.len() <= k {
                    counts.push((name, 0, 0.0));
                }
                counts[k].1 += usize::from(inside);
                counts[k].2 += estimate.deviation / estimate.value.abs();
                all.push(format!("{},{seed},{name},{},{low},{high},{truth}", u8::from(forced), estimate.value));
            }
        }
        for (name, inside, relative) in counts {
            let count = seeds.end - seeds.start;
            println!(
                "  {name:18} within its range in {inside} of {count}; mean deviation {:.1} %",
                100.0 * relative / count as f64
            );
        }
    }
    all
}

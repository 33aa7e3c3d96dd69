//! How well motion determines what is learned from it: made recordings of small systems whose masses and frictions are known,
//! and how often the ranges that a fit states hold the truth.
//!
//! A cart of 1 kg on a rail carries a pendulum of 0.3 kg at 0.5 m, with friction on the cart and in the joint, with a known force
//! on the cart or without; a driven pendulum; a planet; two pendula with friction in their joints. Positions have noise. As in a fit, no
//! range is stated for a model that does not explain the held-out motion.

use super::Scale;
use lnn::analysis::{Determination, Estimate, MOST_MISFIT, Observed, constants, determination, misfit};
use lnn::configuration::{Config, Known, Penalty};
use lnn::data::{PrepareOptions, RecordingSplit};
use lnn::lagrangian::{EulerLagrange, Lagrangian, Mechanics, MechanicsError, Request, Terms};
use lnn::linalg::Workspace;
use lnn::network::{Initialization, NetworkLagrangian};
use lnn::random::{RandomGenerator, RngStream};
use lnn::recording::{RecordedTrajectory, Recording, Targets};
use lnn::rollout::{RolloutOptions, rollout};
use lnn::scalar::Real;
use lnn::training::{Hooks, train};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Cart and pendulum; coordinates in m and, from the downward vertical, rad.
struct CartPendulum;

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

/// A pendulum of 1 kg at 0.5 m.
struct Pendulum;

impl Lagrangian for Pendulum {
    fn coordinates(&self) -> usize {
        1
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        R::half() * (p[0] * v[0]).sqr() + p[0] * p[1] * q[0].cos()
    }
}

/// A planet around a star of attraction 1, in polar coordinates.
struct Planet;

impl Lagrangian for Planet {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        R::half() * (v[0].sqr() + (q[0] * v[1]).sqr()) + R::one() / q[0]
    }
}

/// Two pendula of 1 kg at 1 m below each other.
struct TwoPendula;

impl Lagrangian for TwoPendula {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let kinetic = v[0].sqr() + R::half() * v[1].sqr() + v[0] * v[1] * (q[0] - q[1]).cos();
        kinetic + p[0] * (q[0].cos() + q[0].cos() + q[1].cos())
    }
}

/// A kind of recordings.
pub struct Case {
    pub name: &'static str,
    exact: fn() -> Box<dyn EulerLagrange<f64>>,
    pub periodic: &'static [bool],
    /// Friction coefficients of the coordinates, nothing for none.
    pub friction: &'static [f64],
    /// `true` if a known force pulls the first coordinate to a place.
    forced: bool,
    /// Noise of the positions.
    sigma: &'static [f64],
    /// Time between two samples in s.
    step: f64,
    /// How many times as many runs and epochs it takes as others until a model explains the motion.
    effort: usize,
    /// Positions and velocities at the start.
    start: fn(&mut RandomGenerator) -> [Vec<f64>; 2],
}

fn cart_pendulum() -> Box<dyn EulerLagrange<f64>> {
    Box::new(Mechanics::new(CartPendulum, vec![1.0, 0.3, 0.5, 9.81]))
}

fn cart_start(rng: &mut RandomGenerator) -> [Vec<f64>; 2] {
    let q = vec![rng.random_range(-0.3..0.3), rng.random_range(-2.0..2.0)];
    [q, vec![rng.random_range(-0.8..0.8), rng.random_range(-3.0..3.0)]]
}

/// All of them.
pub const CASES: [Case; 5] = [
    Case {
        name: "cart-pendulum",
        exact: cart_pendulum,
        periodic: &[false, true],
        friction: &[0.3, 0.01],
        forced: false,
        sigma: &[2e-4, 1e-3],
        step: 0.01,
        effort: 1,
        start: cart_start,
    },
    Case {
        name: "cart-pendulum with a known force",
        exact: cart_pendulum,
        periodic: &[false, true],
        friction: &[0.3, 0.01],
        forced: true,
        sigma: &[2e-4, 1e-3],
        step: 0.01,
        effort: 1,
        start: cart_start,
    },
    Case {
        name: "pendulum with a known force",
        exact: || Box::new(Mechanics::new(Pendulum, vec![0.5, 9.81])),
        periodic: &[true],
        friction: &[0.05],
        forced: true,
        sigma: &[2e-3],
        step: 0.01,
        effort: 1,
        start: |rng| [vec![rng.random_range(-2.0..2.0)], vec![rng.random_range(-3.0..3.0)]],
    },
    Case {
        name: "planet",
        exact: || Box::new(Mechanics::new(Planet, vec![])),
        periodic: &[false, true],
        friction: &[],
        forced: false,
        sigma: &[1e-3, 1e-3],
        step: 0.02,
        effort: 3,
        start: |rng| {
            let q = vec![rng.random_range(0.8..1.2), rng.random_range(-3.0..3.0)];
            [q, vec![rng.random_range(-0.3..0.3), rng.random_range(0.8..1.2)]]
        },
    },
    Case {
        name: "two pendula",
        exact: || Box::new(Mechanics::new(TwoPendula, vec![9.81])),
        periodic: &[true, true],
        friction: &[0.2, 0.1],
        forced: false,
        sigma: &[1e-3, 1e-3],
        step: 0.01,
        effort: 1,
        start: |rng| {
            let q = vec![rng.random_range(-1.5..1.5), rng.random_range(-1.5..1.5)];
            [q, vec![rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)]]
        },
    },
];

/// A system with friction, and a force on its first coordinate that depends on the place: what a recording with a force in it is
/// made by.
struct Driven {
    exact: Box<dyn EulerLagrange<f64>>,
    friction: &'static [f64],
    /// Stiffness of the force in N/m and offset in m.
    force: Option<(f64, f64)>,
}

impl Driven {
    fn drive(&self, x: f64) -> f64 {
        self.force.map_or(0.0, |(stiffness, offset)| -stiffness * (x - offset))
    }
}

impl EulerLagrange<f64> for Driven {
    fn coordinates(&self) -> usize {
        self.exact.coordinates()
    }
    fn conserves_energy(&self) -> bool {
        self.friction.is_empty() && self.force.is_none()
    }
    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        let n = self.coordinates();
        self.exact.terms(q, v, request, terms)?;
        if request.includes(Request::FORCE) && !self.conserves_energy() {
            for (q, v) in q.chunks_exact(n).zip(v.chunks_exact(n)) {
                let friction: Vec<f64> = (0..n).map(|i| self.friction.get(i).map_or(0.0, |f| f * v[i])).collect();
                terms.dissipation.push(friction.iter().zip(v).map(|(f, v)| f * v).sum());
                terms.force.extend((0..n).map(|i| if i == 0 { self.drive(q[0]) } else { 0.0 } - friction[i]));
            }
        }
        terms.complete(n, v, request, &mut Workspace::new())
    }
}

impl Case {
    /// The exact system.
    pub fn exact(&self) -> Box<dyn EulerLagrange<f64>> {
        (self.exact)()
    }

    /// The same without noise, every so many seconds.
    pub fn without_noise(&self, step: f64) -> Self {
        Self { step, sigma: &[0.0, 0.0], ..*self }
    }

    /// Runs with noise.
    pub fn recording(&self, runs: usize, seconds: f64, seed: u64) -> Recording {
        let rng = &mut RngStream::Training(0).generator(seed);
        let n = self.periodic.len();
        let tracks = (0..runs).map(|run| {
            let force = self.forced.then(|| (rng.random_range(2.0..8.0), rng.random_range(-0.5..0.5)));
            let model = Driven { exact: (self.exact)(), friction: self.friction, force };
            let [q, v] = (self.start)(rng);
            let options = RolloutOptions::reference(seconds, self.step).energy(false);
            let motion = rollout(&model, &q, &v, &options).complete().expect("a system that moves on");
            let force = motion.q.chunks_exact(n).flat_map(|q| {
                let drive = model.drive(q[0]);
                (0..n).map(move |i| if i == 0 { drive } else { 0.0 })
            });
            let force = if self.forced { force.collect() } else { vec![] };
            let noisy = motion.q.iter().enumerate();
            let q = noisy.map(|(k, q)| q + self.sigma[k % n] * Distribution::<f64>::sample(&StandardNormal, rng));
            RecordedTrajectory {
                name: format!("run {run}"),
                times: motion.t,
                q: q.collect(),
                v: vec![],
                a: vec![],
                force,
            }
        });
        let tracks = tracks.collect();
        let coordinates = ["q1", "q2"][..n].iter().map(ToString::to_string).collect();
        Recording { coordinates, periodic: self.periodic.to_vec(), tracks }
    }
}

/// Root mean square distance of two energies, each about its mean.
fn energy_error(model: &[f64], exact: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (a, b) = (mean(model), mean(exact));
    let squares = model.iter().zip(exact).map(|(x, y)| (x - a - (y - b)).powi(2));
    (squares.sum::<f64>() / model.len() as f64).sqrt()
}

/// A recording smoothed, and a model of it of the shape that `shape` gives; and the loss and the time of its training.
pub fn learn(
    recording: &Recording,
    (seed, epochs): (u64, Option<usize>),
    shape: impl FnOnce(&mut Config),
) -> (RecordingSplit, NetworkLagrangian<f64>, String) {
    let preparation = PrepareOptions { seed, ..PrepareOptions::default() };
    let measured = RecordingSplit::new(recording, &preparation).expect("long trajectories");
    let data = measured.datasets::<f32>(Targets::Smoothed).expect("states with full windows");
    let mut config = lnn::presets::suggested("made", &data);
    config.seed = seed;
    let epochs = epochs.unwrap_or(config.phases[0].epochs);
    (config.phases[0].epochs, config.phases[0].t_max) = (epochs, epochs as f64);
    shape(&mut config);
    let names = recording.coordinates.iter().map(String::as_str);
    let scale = data.training[0].physical_scale();
    let architecture = config.architecture_with(names, recording.periodic.clone(), scale).expect("names of its own");
    let penalty = Penalty::Eigenvalue { lambda: config.penalty.lambda() };
    let trained = train(&config, &architecture, penalty, data, 2, &Hooks::default()).expect("a training");
    let model = NetworkLagrangian::new(architecture, trained.weights).expect("its weights").cast::<f64>();
    let remark = format!("seed {seed}: loss {:.4}, {:.0} s of training", trained.validation_loss, trained.seconds);
    (measured, model, remark)
}

/// The learned constants of two pendula beside a small network, with the truth.
fn grey_box(runs: usize, seconds: f64, seed: u64, epochs: Option<usize>) -> Told {
    let case = CASES.iter().find(|case| case.name == "two pendula").expect("a case of this name");
    let known = include_str!("../../../examples/systems/grey_pendula.toml");
    let (measured, model, remark) = learn(&case.recording(runs, seconds, seed), (seed, epochs), |config| {
        config.network.known = Some(Known::Description(Box::new(toml::from_str(known).expect("a system file"))));
        config.network.alpha = 0.0;
        config.network.initialization = Initialization::NearZero;
        config.network.hidden = vec![8];
        config.network.dissipation = Some(8);
        config.optimizer.weight_decay = 0.01;
    });
    let started = Instant::now();
    let found = constants(&model, &measured, 2).expect("enough stretches");
    println!("  {remark}, {:.2} s to tell", started.elapsed().as_secs_f64());
    let truths = [("g", 9.81), ("l2", 1.0), ("m2", 1.0)];
    (truths.into_iter().map(|(name, truth)| (name, found[name], truth)).collect(), false)
}

/// Numbers with their ranges and the truth in their unit; and `true` if the model does not explain the motion, and no range is stated.
type Told = (Vec<(&'static str, Estimate, f64)>, bool);

/// One recording.
fn one(case: &Case, runs: usize, seconds: f64, seed: u64, scale: Scale) -> Told {
    let recording = case.recording(case.effort * runs, seconds, seed);
    let (measured, model, remark) =
        learn(&recording, (seed, scale.epochs.map(|epochs| case.effort * epochs)), |config| {
            config.network.hidden = scale.hidden.to_vec();
            config.network.dissipation = (!case.friction.is_empty()).then_some(16);
        });

    let observed = Observed::new(&measured, Targets::Smoothed).expect("states with full windows");
    let started = Instant::now();
    let found: Determination = determination(&model, &recording.periodic, &observed).expect("a model of these states");
    let took = started.elapsed().as_secs_f64();

    let n = case.periodic.len();
    let states = (observed.q.len() / n) as f64;
    let of = |model: &dyn EulerLagrange<f64>| {
        let mut terms = Terms::default();
        let wanted = Request::ENERGY | Request::MASS_MATRIX;
        model.terms(&observed.q, &observed.v, wanted, &mut terms).expect("regular states");
        let mean = |at: usize| terms.mass_matrix.iter().skip(at).step_by(n * n).sum::<f64>() / states;
        let mass: Vec<f64> = (0..n).flat_map(|i| (i..n).map(move |j| i * n + j)).map(mean).collect();
        let unit = if found.absolute { 1.0 } else { mass[0] };
        let energy: Vec<f64> = terms.energy.iter().map(|e| e / unit).collect();
        (mass, unit, energy)
    };
    let (mass, unit, energy) = of(&*(case.exact)());
    let error = energy_error(&of(&model).2, &energy);
    let names: &[&str] = if n == 1 { &["M11"] } else { &["M11", "M12", "M22"] };
    let mut rows: Vec<_> =
        names.iter().copied().zip(&found.mass_matrix).zip(mass).map(|((name, e), m)| (name, *e, m / unit)).collect();
    let frictions = ["friction of q1", "friction of q2"].into_iter().zip(&found.friction).zip(case.friction);
    rows.extend(frictions.map(|((name, e), truth)| (name, *e, truth / unit)));
    rows.push(("energy", found.energy, found.energy.value + error));
    if !found.absolute {
        // The unit itself.
        rows.remove(0);
    }
    let held_out = Observed::held_out(&measured, Targets::Smoothed).expect("states with full windows");
    let missed = misfit(&model, held_out.as_ref().unwrap_or(&observed)).unwrap_or(vec![f64::INFINITY]);
    println!("  {remark}, {took:.2} s to tell, misfit {missed:.2?}");
    let withheld = !missed.iter().all(|missed| *missed <= MOST_MISFIT);
    (rows, withheld)
}

/// Prints and returns rows `case,seed,quantity,learned,low,high,truth`, and prints how often the truth lies within.
pub fn compare(seeds: std::ops::Range<u64>, (runs, seconds): (usize, f64), scale: Scale) -> Vec<String> {
    let mut all = Vec::new();
    let (mut total, mut open, mut without) = ([0; 2], 0, 0);
    let mut count = |name: &str, of: &dyn Fn(u64) -> Told| {
        println!("{name}:");
        // Times inside and times stated, squares of half of the range and of the error of the learned value, over the truth.
        let mut counts: Vec<(&str, [usize; 2], [f64; 2])> = Vec::new();
        for seed in seeds.clone() {
            let (rows, withheld) = of(seed);
            without += usize::from(withheld);
            for (quantity, estimate, truth) in rows {
                let Estimate { value, low, high } = estimate;
                if withheld || estimate.is_open() {
                    let why = if withheld { "has no range: the model does not fit" } else { "is left open" };
                    println!("    {quantity:18} {value:9.4} {why}, true {truth:9.4}");
                    open += usize::from(!withheld);
                    all.push(format!("{name},{seed},{quantity},{value},,,{truth}"));
                    continue;
                }
                let inside = estimate.allows(truth);
                println!(
                    "    {quantity:18} {value:9.4} from {low:9.4} to {high:9.4}, true {truth:9.4}{}",
                    if inside { "" } else { "  OUTSIDE" }
                );
                let k = counts.iter().position(|(name, ..)| *name == quantity).unwrap_or_else(|| {
                    counts.push((quantity, [0; 2], [0.0; 2]));
                    counts.len() - 1
                });
                let (_, [held, stated], squares) = &mut counts[k];
                *held += usize::from(inside);
                *stated += 1;
                // What is 0 is compared with the unit.
                let size = if truth == 0.0 { 1.0 } else { truth };
                let relative = [0.5 * (high - low), value - truth].map(|x| (x / size).powi(2));
                squares.iter_mut().zip(relative).for_each(|(sum, x)| *sum += x);
                all.push(format!("{name},{seed},{quantity},{value},{low},{high},{truth}"));
            }
        }
        for (quantity, [held, stated], squares) in counts {
            let [half, error] = squares.map(|square| 100.0 * (square / stated as f64).sqrt());
            println!(
                "  {quantity:18} in its range in {held} of {stated}; half of it {half:.1} %, error {error:.1} % (rms)"
            );
            total = [total[0] + held, total[1] + stated];
        }
    };
    for case in &CASES {
        count(case.name, &|seed| one(case, runs, seconds, seed, scale));
    }
    count("constants of two pendula", &|seed| grey_box(runs, seconds, seed, scale.epochs));
    let [held, stated] = total;
    let share = 100.0 * held as f64 / stated as f64;
    println!(
        "the truth lies within {held} of {stated} ranges, {share:.1} %; {open} numbers are left open, and {without} models do not explain \
         the motion"
    );
    all
}

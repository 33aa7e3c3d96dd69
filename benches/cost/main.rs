//! What a request costs, and what is skipped when it is not made: evaluations and training steps of network Lagrangians
//! in turns, beside their bare matrix products and the time to read the weights.
//!
//! `cargo bench --bench cost` takes some minutes and prints Markdown tables; `-- --smoke` seconds. `-- --count SYSTEM N` evaluates one state of
//! a system of the catalogue N times, its acceleration and all its terms, for a tool that counts instructions (`valgrind --tool=callgrind`): two
//! counts give that of a state.

#[path = "../shared/networks.rs"]
mod networks;
#[path = "../peers/products.rs"]
mod products;
#[path = "../shared/turns.rs"]
mod turns;

use clap::Parser;
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::network::{Architecture, Initialization, NetworkLagrangian};
use lnn::optimizers::{Method, Moments, Update};
use lnn::rollout::{rollout_many, rollout_together};
use lnn::scalar::Scalar;
use lnn::tape::{Depth, Evaluation, STATES};
use lnn::training::Objective;
use networks::architecture;
use products::Products;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::time::Duration;
use turns::{Work, in_turns};

/// Time of one turn.
const TURN: Duration = Duration::from_millis(60);

const BATCH: usize = 128;

struct Options {
    smoke: bool,
}

impl Options {
    fn width(&self) -> usize {
        if self.smoke { 32 } else { 500 }
    }
    fn rounds(&self) -> usize {
        if self.smoke { 1 } else { 15 }
    }
}

struct Setup<S> {
    architecture: Architecture,
    weights: Vec<S>,
    data: Dataset<S>,
    rows: Vec<u32>,
}

impl<S: Scalar> Setup<S> {
    fn new(n: usize, width: usize, alpha: f64) -> Self {
        let architecture = architecture(n, width, alpha);
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let weights = architecture.initial_weights(Initialization::Default, &mut rng);
        let mut draw = || (0..BATCH * n).map(|_| S::of_f64(rng.random_range(-10.0..10.0))).collect();
        let data = Dataset::new(n, draw(), draw(), draw()).expect("finite numbers");
        Self { architecture, weights, data, rows: (0..BATCH as u32).collect() }
    }

    fn step(&self, name: &str, penalty: Penalty, threads: usize) -> Work<'_> {
        let mut objective = Objective::new(&self.architecture, penalty, threads).expect("threads");
        let mut gradient = self.weights.clone();
        Work::new(name, move || {
            black_box(objective.step(&self.weights, &self.data, &self.rows, &mut gradient));
        })
    }

    /// The update of all weights by their gradient.
    fn update(&self, method: Method) -> Work<'_> {
        let matrices = self.architecture.model::<S>().matrices();
        let mut moments = Moments::for_method(method, self.weights.len(), matrices);
        let (mut weights, mut gradient) = (self.weights.clone(), self.weights.clone());
        let mut objective = Objective::new(&self.architecture, Penalty::None, 1).expect("threads");
        objective.step(&self.weights, &self.data, &self.rows, &mut gradient);
        let mut used = gradient.clone();
        let update = Update { method, rate: 1e-9, weight_decay: 0.0, decaying: usize::MAX, clip: 1.0 };
        Work::new(method.name(), move || {
            used.copy_from_slice(&gradient);
            black_box(moments.update(&mut weights, &mut used, &update));
        })
    }

    fn loss(&self, name: &str, threads: usize) -> Work<'_> {
        let mut objective = Objective::new(&self.architecture, Penalty::None, threads).expect("threads");
        Work::new(name, move || {
            black_box(objective.loss(&self.weights, &self.data));
        })
    }

    fn evaluation(&self, name: &str, depth: Depth) -> Work<'_> {
        let mut chunk = Evaluation::new(self.architecture.model().lagrangian().clone());
        let width = STATES * self.architecture.coordinates;
        Work::new(name, move || {
            let states = self.data.q().chunks(width).zip(self.data.v().chunks(width));
            states.for_each(|(q, v)| chunk.evaluate(&self.weights, black_box(q), v, depth));
        })
    }

    fn products(&self, name: &str, threads: usize) -> Work<'_> {
        let mut products = Products::<S>::new(self.data.coordinates(), &self.architecture.hidden, BATCH, threads);
        Work::new(name, move || products.take())
    }

    /// Accelerations of the first `count` states as an integrator asks for them.
    fn accelerations(&self, name: &str, count: usize) -> Work<'_> {
        let network = NetworkLagrangian::new(self.architecture.clone(), self.weights.clone()).expect("weights fit");
        let (end, mut terms) = (count * self.data.coordinates(), Terms::default());
        Work::new(name, move || {
            let (q, v) = (black_box(&self.data.q()[..end]), &self.data.v()[..end]);
            network.terms(q, v, Request::ACCELERATION, &mut terms).expect("regular mass matrices");
        })
    }

    /// Reads all weights once.
    fn stream(&self, name: &str) -> Work<'_> {
        Work::new(name, || {
            let sum = lnn::scalar::vectorized(
                #[inline(always)]
                || {
                    let mut lanes = [<S as lnn::scalar::Real>::zero(); 64];
                    for block in black_box(self.weights.as_slice()).chunks_exact(64) {
                        for (sum, &w) in lanes.iter_mut().zip(block) {
                            *sum += w;
                        }
                    }
                    lanes
                },
            );
            black_box(sum);
        })
    }
}

fn requests(options: &Options) {
    let (n, width) = (2, options.width());
    let plain = Setup::<f32>::new(n, width, 1.0);
    let wide = Setup::<f64>::new(n, width, 1.0);
    let penalised = Setup::<f32>::new(n, width, -1.0);
    let lambda = 10.0;
    let eigenvalue = Penalty::Eigenvalue { lambda };
    let sylvester = Penalty::Sylvester { lambda, time: None };
    let mut work = vec![
        plain.step("step, no penalty", Penalty::None, 1),
        plain.evaluation("L", Depth::Value),
        plain.evaluation("L, p, g", Depth::Gradient),
        plain.evaluation("L, p, g, M", Depth::MassMatrix),
        plain.evaluation("L, p, g, M, c", Depth::Motion),
        plain.loss("losses of a validation set", 1),
        plain.step("step, eigenvalue penalty, inactive", eigenvalue, 1),
        plain.step("step, Sylvester penalty, inactive", sylvester, 1),
        penalised.step("step, Sylvester penalty, active in every state", sylvester, 1),
        penalised.step("step, eigenvalue penalty, active in every state", eigenvalue, 1),
        plain.products("bare products", 1),
        plain.step("step, no penalty, two threads", Penalty::None, 2),
        plain.products("bare products, two threads", 2),
        wide.step("step, no penalty, f64", Penalty::None, 1),
    ];
    in_turns(&mut work, options.rounds(), TURN);
    println!("\n### Requests: n = {n}, 3 x {width}, batch {BATCH}, f32, one thread unless said\n");
    println!("| request | us per state | of a step |\n|---|---|---|");
    for w in &work {
        println!("| {} | {:.2} | {:.3} |", w.name, w.median() * 1e6 / BATCH as f64, w.times_of(&work[0]));
    }
    println!("\nTwo threads: {:.2} times one.", work[0].times_of(&work[11]));
    println!(
        "Step over its bare products: {:.2}, two threads {:.2}.",
        work[0].times_of(&work[10]),
        work[11].times_of(&work[12])
    );
}

fn updates(options: &Options) {
    println!("\n### Updates: n = 2, batch {BATCH}, f32, one thread\n");
    println!("| width | rule | us | of gradient and update |\n|---|---|---|---|");
    for width in if options.smoke { vec![32] } else { vec![128, 192, 500] } {
        let setup = Setup::<f32>::new(2, width, 1.0);
        let mut work = vec![setup.step("gradient", Penalty::None, 1)];
        work.extend([Method::Radam, Method::Soap].map(|method| setup.update(method)));
        in_turns(&mut work, options.rounds(), TURN);
        for w in &work[1..] {
            let share = w.times_of(&work[0]);
            println!("| {width} | {} | {:.0} | {:.3} |", w.name, w.median() * 1e6, share / (1.0 + share));
        }
    }
}

fn coordinates(options: &Options) {
    let width = options.width();
    let counts = [1, 2, 4, 8, 12, 20];
    let setups = counts.map(|n| Setup::<f32>::new(n, width, 1.0));
    let mut work: Vec<Work<'_>> = setups.iter().map(|s| s.step("step", Penalty::None, 1)).collect();
    work.extend(setups.iter().map(|s| s.products("products", 1)));
    in_turns(&mut work, options.rounds(), TURN);
    println!("\n### Coordinates: step without penalty, 3 x {width}, batch {BATCH}, f32, one thread\n");
    println!("| n | ms | over its n + 11 bare products | over n = 2 | (n + 11)/13 |\n|---|---|---|---|---|");
    for (k, n) in counts.into_iter().enumerate() {
        let (step, products) = (&work[k], &work[counts.len() + k]);
        let (ratio, growth) = (step.times_of(products), step.times_of(&work[1]));
        println!("| {n} | {:.2} | {ratio:.2} | {growth:.2} | {:.2} |", step.median() * 1e3, (n + 11) as f64 / 13.0);
    }
}

fn latency<S: Scalar>(options: &Options) {
    let (n, width) = (2, options.width());
    let setup = Setup::<S>::new(n, width, 1.0);
    let mut work = vec![setup.stream("weights read once")];
    let counts = [1, 2, 4, 8, 16, 64];
    work.extend(counts.map(|count| setup.accelerations(&format!("{count}"), count)));
    in_turns(&mut work, options.rounds(), TURN);
    println!("\n### Latency: accelerations inside an integrator, n = {n}, 3 x {width}, {}, one thread\n", S::NAME);
    println!("Weights read once: {:.1} us; n + 3 = {} passes.\n", work[0].median() * 1e6, n + 3);
    println!("| states | us | us per state | over n + 3 readings of the weights |\n|---|---|---|---|");
    for (w, count) in work[1..].iter().zip(counts) {
        let (us, ratio) = (w.median() * 1e6, w.times_of(&work[0]) / (n + 3) as f64);
        println!("| {count} | {us:.1} | {:.1} | {ratio:.2} |", us / count as f64);
    }
}

/// An ensemble of motions one by one and together, per motion.
fn ensembles(options: &Options) {
    let motion = |threads, width| {
        let setup = Setup::<f64>::new(2, width, 1.0);
        let network = NetworkLagrangian::new(setup.architecture, setup.weights).expect("weights fit");
        let start = |k: usize| setup.data.q()[2 * k..][..2].iter().map(|x| x / 10.0).collect::<Vec<f64>>();
        let starts: Vec<_> = (0..16).map(|k| (start(k), start(k + 16))).collect();
        let rollout = lnn::rollout::RolloutOptions::new(0.5, 0.1);
        let mut work = [
            Work::new("alone", || {
                for start in starts.chunks(8) {
                    black_box(rollout_many(&network, start, &rollout, threads));
                }
            }),
            Work::new("together", || {
                black_box(rollout_together(&network, &starts, &rollout, threads));
            }),
        ];
        in_turns(&mut work, options.rounds(), TURN);
        let [alone, together] = [&work[0], &work[1]].map(|w| w.median() * 1e3 / starts.len() as f64);
        println!("| {width} | {threads} | {alone:.2} | {together:.2} | {:.2} |", work[0].times_of(&work[1]));
    };
    println!("\n### Ensembles: 16 motions by Dopri5, n = 2, f64\n");
    println!("| width | threads | ms per motion alone | together | gain |\n|---|---|---|---|---|");
    for width in if options.smoke { vec![32] } else { vec![64, 128, 256, 500] } {
        for threads in [1, 2] {
            motion(threads, width);
        }
    }
}

#[derive(clap::Parser)]
struct Arguments {
    /// Seconds; shows that everything runs, its numbers mean nothing
    #[arg(long)]
    smoke: bool,
    /// Only evaluate a state of this system of the catalogue, so many times
    #[arg(long, num_args = 2, value_names = ["SYSTEM", "N"])]
    count: Option<Vec<String>>,
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let arguments = Arguments::parse();
    match arguments.count.as_deref() {
        Some([name, count]) => repeat(name, count.parse().expect("--count: expected a number after the system")),
        _ => run(arguments.smoke),
    }
}

/// Evaluates one state within the bounds of a system, its acceleration and all its terms.
fn repeat(name: &str, count: usize) {
    let configured = SystemInstance::<f64>::named(name, &[]).expect("a system of the catalogue");
    let bounds = configured.system.validation(configured.coordinates);
    let within =
        |bounds: &[(f64, f64)]| -> Vec<f64> { bounds.iter().map(|(low, high)| low + 0.37 * (high - low)).collect() };
    let (q, mut v) = (within(&bounds.positions), within(&bounds.velocities));
    configured.impose_constraint(&q, &mut v).expect("a state of the system");
    let (model, mut terms) = (configured.build().expect("the defaults are valid"), Terms::default());
    for request in [Request::ACCELERATION, Request::ALL] {
        (0..count).for_each(|_| model.terms(black_box(&q), &v, request, &mut terms).expect("a regular state"));
    }
}

/// Prints all tables; in seconds and without meaning for `smoke`.
pub fn run(smoke: bool) {
    let options = Options { smoke };
    requests(&options);
    updates(&options);
    coordinates(&options);
    latency::<f32>(&options);
    latency::<f64>(&options);
    ensembles(&options);
}

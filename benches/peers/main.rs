//! One side of the comparison with other programs: `lnn` timed on request, by lines of standard input.
//!
//! `compare.py` starts this program and one for each peer and lets them work in turns. `setup DIR N WIDTH BATCH PRECISION
//! ALPHA` writes weights, states, targets, loss and gradient as raw little-endian `f64`; `step S`, `products S` and
//! `accelerations S` answer with nanoseconds, one number per run, of at least three runs and about `S` seconds.
//! That is with the argument `serve`; `recipe DIR` writes what `recipe.py` trains on; without arguments everything is tried once.

#[path = "../shared/networks.rs"]
mod networks;
mod products;
mod recipe;

use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::network::{Architecture, Initialization};
use lnn::scalar::Scalar;
use lnn::training::Objective;
use networks::{SCALE, architecture};
use products::Products;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::{BufRead, Write};
use std::path::Path;
use std::time::{Duration, Instant};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const THREADS: usize = 2;
/// Sylvester's penalty, in the paper's form; `engines.py` has the same weight.
const PENALTY: Penalty = Penalty::Sylvester { lambda: 10.0, time: None };

/// What is timed.
trait Timed {
    fn step(&mut self);
    fn products(&mut self);
    fn accelerations(&mut self);
}

struct Case<S> {
    weights: Vec<S>,
    data: Dataset<S>,
    rows: Vec<u32>,
    gradient: Vec<S>,
    objective: Objective<S>,
    products: Products<S>,
}

impl<S: Scalar> Case<S> {
    fn new(architecture: &Architecture, weights: &[f64], states: &[Vec<f64>; 3]) -> Outcome<Self> {
        let cast = |x: &[f64]| x.iter().map(|&x| S::of_f64(x)).collect::<Vec<S>>();
        let (n, weights) = (architecture.coordinates, cast(weights));
        let data = Dataset::new(n, cast(&states[0]), cast(&states[1]), cast(&states[2]))?;
        Ok(Self {
            gradient: weights.clone(),
            rows: (0..data.len() as u32).collect(),
            objective: Objective::new(architecture, PENALTY, THREADS)?,
            products: Products::new(n, &architecture.hidden, data.len(), THREADS),
            weights,
            data,
        })
    }

    /// Loss with penalty.
    fn evaluate(&mut self) -> f64 {
        let report = self.objective.step(&self.weights, &self.data, &self.rows, &mut self.gradient);
        (report.loss + report.penalty).to_f64()
    }
}

impl<S: Scalar> Timed for Case<S> {
    fn step(&mut self) {
        self.evaluate();
    }
    fn products(&mut self) {
        self.products.take();
    }
    fn accelerations(&mut self) {
        self.objective.loss(&self.weights, &self.data);
    }
}

fn setup(words: &[&str]) -> Outcome<Box<dyn Timed>> {
    let &[directory, n, width, batch, precision, alpha] = words else {
        return Err("expected: setup DIR N WIDTH BATCH PRECISION ALPHA".into());
    };
    let (n, width, batch): (usize, usize, usize) = (n.parse()?, width.parse()?, batch.parse()?);
    let architecture = architecture(n, width, alpha.parse()?);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut draw = || (0..batch * n).map(|_| rng.random_range(-SCALE..SCALE)).collect::<Vec<f64>>();
    let states = [draw(), draw(), draw()];
    let mut judge = Case::<f64>::new(&architecture, &weights, &states)?;
    let loss = judge.evaluate();
    let write = |name: &str, numbers: &[f64]| write(Path::new(directory), name, numbers);
    // The peers work in scaled coordinates.
    let scaled = |x: &[f64]| x.iter().map(|x| x / SCALE).collect::<Vec<f64>>();
    write("weights", &weights)?;
    for (name, numbers) in ["x", "w", "a"].iter().zip(&states) {
        write(name, &scaled(numbers))?;
    }
    write("loss", &[loss])?;
    write("gradient", &judge.gradient)?;
    Ok(match precision {
        "f32" => Box::new(Case::<f32>::new(&architecture, &weights, &states)?),
        "f64" => Box::new(judge),
        _ => return Err("precision is f32 or f64".into()),
    })
}

/// Writes numbers as raw little-endian `f64`.
fn write(directory: &Path, name: &str, numbers: &[f64]) -> std::io::Result<()> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(directory.join(name), bytes)
}

/// Nanoseconds of every run, for about so long.
fn time(seconds: f64, mut run: impl FnMut()) -> Vec<u128> {
    run();
    let (start, mut times) = (Instant::now(), Vec::new());
    while times.len() < 3 || start.elapsed() < Duration::from_secs_f64(seconds) {
        let start = Instant::now();
        run();
        times.push(start.elapsed().as_nanos());
    }
    times
}

fn answer(line: &str, case: &mut Option<Box<dyn Timed>>) -> Outcome<String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match (words.as_slice(), case) {
        (["setup", words @ ..], case) => {
            *case = Some(setup(words)?);
            Ok("0".to_string())
        }
        ([what, seconds], Some(case)) => {
            let seconds = seconds.parse()?;
            let times = match *what {
                "step" => time(seconds, || case.step()),
                "products" => time(seconds, || case.products()),
                "accelerations" => time(seconds, || case.accelerations()),
                _ => return Err("expected: setup, step, products or accelerations".into()),
            };
            Ok(times.iter().map(u128::to_string).collect::<Vec<_>>().join(" "))
        }
        _ => Err("expected a setup first".into()),
    }
}

/// Every request once, on a small network.
pub fn smoke() -> Outcome<()> {
    let directory = tempfile::tempdir()?;
    for precision in ["f32", "f64"] {
        let mut case = None;
        answer(&format!("setup {} 2 16 70 {precision} 1.0", directory.path().display()), &mut case)?;
        for what in ["step", "products", "accelerations"] {
            let times = answer(&format!("{what} 0"), &mut case)?;
            assert_eq!(times.split(' ').count(), 3, "{precision}, {what}: {times}");
        }
    }
    assert_eq!(std::fs::read(directory.path().join("gradient"))?.len(), 8 * (4 * 16 + 16 + 2 * (16 * 16 + 16) + 16));
    recipe::write_all(directory.path(), 100)?;
    assert_eq!(std::fs::read(directory.path().join("training2.a"))?.len(), 8 * 2 * 100);
    Ok(())
}

fn serve() -> Outcome<()> {
    let (mut case, mut out) = (None, std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        match answer(&line?, &mut case) {
            Ok(text) => writeln!(out, "{text}")?,
            Err(error) => writeln!(out, "error: {error}")?,
        }
        out.flush()?;
    }
    Ok(())
}

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["recipe", directory] => recipe::write_all(Path::new(directory), usize::MAX),
        words if words.contains(&"serve") => serve(),
        _ => smoke(),
    }
}

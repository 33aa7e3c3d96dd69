//! A network trained by a user's solver, by argmin's, and by batches with this crate's optimisers, all on the same problem.

use argmin::core::{CostFunction, Error, Executor, Gradient, IterState, KV, Problem, Solver, State};
use argmin::solver::conjugategradient::{NonlinearConjugateGradient, beta::PolakRibierePlus};
use argmin::solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS};
use lnn::configuration::Penalty;
use lnn::data::Dataset;
use lnn::lagrangian::SystemInstance;
use lnn::network::Initialization;
use lnn::optimizers::{Method, Update};
use lnn::presets::Preset;
use lnn::random::RngStream;
use lnn::training::{Objective, TrainingError, TrainingProblem};
use rand::seq::SliceRandom;
use std::f64::consts::TAU;

type Iteration = IterState<Vec<f64>, Vec<f64>, (), (), (), f64>;

/// Every weight has a step of its own, longer while its slope keeps the sign and shorter where that turns (Rprop, Riedmiller
/// and Braun 1993).
struct Rprop {
    steps: Vec<f64>,
    slopes: Vec<f64>,
}

impl<P> Solver<P, Iteration> for Rprop
where
    P: CostFunction<Param = Vec<f64>, Output = f64> + Gradient<Param = Vec<f64>, Gradient = Vec<f64>>,
{
    fn name(&self) -> &str {
        "Rprop"
    }

    fn next_iter(&mut self, problem: &mut Problem<P>, state: Iteration) -> Result<(Iteration, Option<KV>), Error> {
        let mut weights = state.get_param().cloned().ok_or_else(|| Error::msg("no weights to start from"))?;
        let gradient = problem.gradient(&weights)?;
        for (k, w) in weights.iter_mut().enumerate() {
            let kept = gradient[k] * self.slopes[k];
            self.steps[k] *= if kept < 0.0 { 0.5 } else { 1.2 };
            self.steps[k] = self.steps[k].min(0.05);
            self.slopes[k] = gradient[k];
            *w -= self.steps[k] * gradient[k].signum();
        }
        let cost = problem.cost(&weights)?;
        Ok((state.param(weights).cost(cost), None))
    }
}

pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A pendulum of 1 m: a = -9.81 sin q, at states spread by multiples of irrational numbers.
    let states = |count: usize, shift: f64| {
        let spread = |step: f64| (0..count).map(move |k| (k as f64 * step + shift) % 1.0 - 0.5);
        let q: Vec<f64> = spread(0.618).map(|x| TAU * x).collect();
        let a = q.iter().map(|q| -9.81 * q.sin()).collect();
        Dataset::new(1, q, spread(0.414).map(|x| 6.0 * x).collect(), a)
    };
    let (training, validation) = (states(256, 0.0)?, states(100, 0.3)?);
    let mut config = Preset::Quick.config(&SystemInstance::named("harmonic-oscillator", &[])?).ok_or("no preset")?;
    config.network.hidden = vec![16];
    let architecture = config.architecture_with(["q"].into_iter(), vec![true], training.physical_scale())?;
    let start: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut RngStream::Weights.generator(1));
    let problem = || -> Result<_, TrainingError> {
        let objective = Objective::new(&architecture, Penalty::None, 2)?;
        Ok(TrainingProblem::new(objective, &training, &validation, 0.0))
    };
    let before = problem()?.validation_loss(&start).loss;
    let judge = |name: &str, weights: Option<&Vec<f64>>| -> Result<(), Box<dyn std::error::Error>> {
        let loss = problem()?.validation_loss(weights.ok_or("no weights")?).loss;
        println!("{name}: validation loss {before:.3} -> {loss:.3}");
        if loss < 0.5 * before { Ok(()) } else { Err(format!("{name} learned nothing").into()) }
    };

    let rprop = Rprop { steps: vec![1e-3; start.len()], slopes: vec![0.0; start.len()] };
    let run = Executor::new(problem()?, rprop).configure(|s: Iteration| s.param(start.clone()).max_iters(200)).run()?;
    judge("Rprop", run.state.get_best_param())?;

    let lbfgs = LBFGS::new(MoreThuenteLineSearch::new(), 10);
    let run = Executor::new(problem()?, lbfgs).configure(|s: Iteration| s.param(start.clone()).max_iters(60)).run()?;
    judge("L-BFGS", run.state.get_best_param())?;

    // An exact line search keeps directions conjugate.
    let search = MoreThuenteLineSearch::new().with_c(1e-4, 0.1)?;
    let gradients = NonlinearConjugateGradient::new(search, PolakRibierePlus::new()).restart_iters(20);
    let run =
        Executor::new(problem()?, gradients).configure(|s: Iteration| s.param(start.clone()).max_iters(60)).run()?;
    judge("conjugate gradients", run.state.get_best_param())?;

    for method in [Method::Radam, Method::Soap] {
        let (mut problem, mut weights, mut gradient) = (problem()?, start.clone(), vec![0.0; start.len()]);
        let mut moments = problem.moments(method);
        let (mut order, mut rng) = ((0..training.len() as u32).collect::<Vec<_>>(), RngStream::Order(0).generator(1));
        let update = Update { method, rate: 0.01, weight_decay: 0.0, decaying: 0, clip: 10.0 };
        for _ in 0..100 {
            order.shuffle(&mut rng);
            for rows in order.chunks(32) {
                problem.step(&weights, rows, &mut gradient);
                moments.update(&mut weights, &mut gradient, &update);
            }
        }
        judge(method.name(), Some(&weights))?;
    }
    Ok(())
}

//! Learns the parameters of a double pendulum from accelerations: argmin's L-BFGS on the gradient of a replayed program.
//!
//! Motion does not change with the unit of mass or length: only the ratios m2/m1, l2/l1 and g/l1 can be learned.

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS};
use lnn::forward::Jet2;
use lnn::lagrangian::{Lagrangian, system::Closed, systems::double_pendulum::DoublePendulum};
use lnn::tape::{Program, Replay, TapeError, Tracer};
use lnn::{scalar::Real, training::Stream};
use rand_distr::{Distribution, StandardNormal, Uniform};
use std::{cell::RefCell, sync::Arc};

/// Mean over the states of |a - target|^2, of the lanes `(q, v, target)` and the parameters.
struct Misfit {
    replay: RefCell<Replay<f64>>,
    lanes: Vec<[f64; 6]>,
}

fn record() -> Result<Program<f64>, TapeError> {
    Program::record(6, 3, |lane, p| {
        // Unit m1 and l1; derivatives by all of (q, v).
        let x: [Jet2<Tracer<f64>, 4>; 4] = std::array::from_fn(|i| Jet2::variable(lane[i], i));
        let [one, mass, length, gravity] = [Tracer::<f64>::one(), p[0], p[1], p[2]].map(Jet2::lift);
        let l = DoublePendulum.lagrangian(&[one, mass, one, length, gravity], &x[..2], &x[2..]);
        // M a = dL/dq - (d2L/dv dq) v
        let matrix: Vec<Tracer<f64>> = (0..4).map(|k| l.second(2 + k / 2, 2 + k % 2)).collect();
        let right = [0, 1].map(|i| l.gradient[i] - l.second(2 + i, 0) * lane[2] - l.second(2 + i, 1) * lane[3]);
        let determinant = matrix[0] * matrix[3] - matrix[1] * matrix[2];
        let a = [matrix[3] * right[0] - matrix[1] * right[1], matrix[0] * right[1] - matrix[2] * right[0]];
        let a = a.map(|a| a / determinant);
        vec![(a[0] - lane[4]).sqr() + (a[1] - lane[5]).sqr()]
    })
}

impl CostFunction for Misfit {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, p: &Vec<f64>) -> Result<f64, Error> {
        let mut errors = vec![0.0; self.lanes.len()];
        self.replay.borrow_mut().forward(errors.len(), self.lanes.as_flattened(), p, &mut errors)?;
        Ok(errors.iter().sum::<f64>() / errors.len() as f64)
    }
}

impl Gradient for Misfit {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, p: &Vec<f64>) -> Result<Vec<f64>, Error> {
        let (_, count, mut gradient) = (self.cost(p)?, self.lanes.len(), vec![0.0; 3]);
        self.replay.borrow_mut().reverse_parameters(&vec![1.0 / count as f64; count], &mut gradient)?;
        Ok(gradient)
    }
}

/// Largest relative error of the parameters learned from states with this noise, in parts of the rms acceleration.
fn identify(count: usize, noise: f64) -> Result<f64, Error> {
    let (mut rng, uniform) = (Stream::Training(0).generator(1), Uniform::new(-3.0, 3.0)?);
    let mut lanes = vec![[0.0; 6]; count];
    for lane in &mut lanes {
        let (x, target) = lane.split_at_mut(4);
        x.fill_with(|| uniform.sample(&mut rng));
        target.copy_from_slice(&DoublePendulum.acceleration(&[2.0, 1.4, 0.8, 1.04, 9.8], &x[..2], &x[2..]));
    }
    let square = lanes.iter().map(|lane| lane[4].powi(2) + lane[5].powi(2)).sum::<f64>() / (2 * count) as f64;
    for a in lanes.iter_mut().flat_map(|lane| &mut lane[4..]) {
        *a += noise * square.sqrt() * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    }
    let problem = Misfit { replay: RefCell::new(Replay::new(Arc::new(record()?))), lanes };
    let solver = LBFGS::new(MoreThuenteLineSearch::new(), 6).with_tolerance_cost(0.0)?.with_tolerance_grad(1e-9)?;
    let result = Executor::new(problem, solver).configure(|s| s.param(vec![1.0, 1.0, 10.0]).max_iters(100)).run()?;
    let (state, learned) = (result.state(), result.state().get_best_param().cloned().unwrap_or_default());
    let worst = learned.iter().zip([0.7, 1.3, 12.25]).map(|(p, truth)| (p / truth - 1.0).abs()).fold(0.0, f64::max);
    println!("noise {noise}, {} iterations: m2/m1, l2/l1, g/l1 = {learned:.10?}, within {worst:.1e}", state.get_iter());
    Ok(worst)
}

pub fn main() -> Result<(), Error> {
    assert!(identify(2000, 0.0)? < 1e-8 && identify(2000, 0.01)? < 0.01, "not recovered");
    Ok(())
}

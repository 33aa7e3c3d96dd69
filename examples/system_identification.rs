//! Learns the parameters of a double pendulum from accelerations by L-BFGS on the gradient of a replayed program.
//!
//! Motion does not change if L is multiplied by a number, nor if masses and lengths change units: only the ratios
//! m2/m1, l2/l1 and g/l1 can be learned.

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use lnn::forward::Jet2;
use lnn::lagrangian::{Lagrangian, exact_acceleration, systems::double_pendulum::DoublePendulum};
use lnn::scalar::Real;
use lnn::tape::{Program, Replay, Tracer};
use std::cell::RefCell;
use std::sync::Arc;
type Number<'t> = Tracer<'t, f64>;

/// Sum over the states of |a - target|^2, of the lanes `(q, v, target)` and the parameters.
struct Misfit {
    replay: RefCell<Replay<f64>>,
    lanes: Vec<f64>,
    count: usize,
}

fn record() -> Result<Program<f64>, lnn::tape::TapeError> {
    Program::record(6, 3, |recorder, lane, p| {
        // Unit m1 and l1; derivatives of L by all four of (q, v).
        let x: [Jet2<Number, 4>; 4] = std::array::from_fn(|i| Jet2::variable(lane[i], i));
        let [one, mass, length, gravity] = [Number::one(), p[0], p[1], p[2]].map(Jet2::lift);
        let l = DoublePendulum.lagrangian(&[one, mass, one, length, gravity], &x[..2], &x[2..]);
        // M a = dL/dq - (d2L/dv dq) v
        let matrix: Vec<Number> = (0..4).map(|k| l.second(2 + k / 2, 2 + k % 2)).collect();
        let right = [0, 1].map(|i| l.gradient[i] - l.second(2 + i, 0) * lane[2] - l.second(2 + i, 1) * lane[3]);
        let a = recorder.solve(&matrix, &right);
        vec![(a[0] - lane[4]).sqr() + (a[1] - lane[5]).sqr()]
    })
}

impl CostFunction for Misfit {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, p: &Vec<f64>) -> Result<f64, Error> {
        let mut errors = vec![0.0; self.count];
        self.replay.borrow_mut().forward(self.count, &self.lanes, p, &mut errors)?;
        Ok(errors.iter().sum())
    }
}

impl Gradient for Misfit {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, p: &Vec<f64>) -> Result<Vec<f64>, Error> {
        self.cost(p)?;
        let mut gradient = vec![0.0; 3];
        self.replay.borrow_mut().reverse_parameters(&vec![1.0; self.count], &mut gradient)?;
        Ok(gradient)
    }
}

fn main() -> Result<(), Error> {
    let truth = [("m1", "2"), ("m2", "1.4"), ("l1", "0.8"), ("l2", "1.04"), ("g", "9.8")];
    let given = truth.map(|(symbol, value)| (symbol.to_string(), value.to_string()));
    let (count, mut lanes) = (256, Vec::new());
    for k in 0..count {
        let x: [f64; 4] = std::array::from_fn(|i| 3.0 * (1.7 * f64::from(4 * k + i as i32)).sin());
        lanes.extend(x);
        lanes.extend(exact_acceleration("double-pendulum", &given, &x[..2], &x[2..])?);
    }
    let problem = Misfit { replay: RefCell::new(Replay::new(Arc::new(record()?))), lanes, count: count as usize };
    let solver = LBFGS::new(MoreThuenteLineSearch::new(), 6).with_tolerance_cost(0.0)?.with_tolerance_grad(1e-8)?;
    let start = vec![1.0, 1.0, 10.0];
    let result = Executor::new(problem, solver).configure(|state| state.param(start).max_iters(100)).run()?;
    let (learned, ratios) = (result.state().get_best_param().cloned().unwrap_or_default(), [0.7, 1.3, 12.25]);
    println!("{} iterations, {}", result.state().get_iter(), result.state().get_termination_status());
    for ((name, p), truth) in ["m2/m1", "l2/l1", "g/l1 "].iter().zip(&learned).zip(ratios) {
        println!("{name} = {p:.12}, relative error {:.1e}", p / truth - 1.0);
        assert!((p / truth - 1.0).abs() < 1e-8, "not recovered");
    }
    Ok(())
}

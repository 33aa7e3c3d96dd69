//! Learns the parameters of a double pendulum from accelerations: argmin's L-BFGS on the gradient of a recorded Lagrangian.
//!
//! Motion does not change with the unit of mass or length: only the ratios m2/m1, l2/l1 and g/l1 can be learned.

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::{linesearch::MoreThuenteLineSearch, quasinewton::LBFGS};
use lnn::lagrangian::{EulerLagrange, Lagrangian, Mechanics};
use lnn::linalg::{Workspace, solve};
use lnn::random::RngStream;
use lnn::scalar::Real;
use lnn::tape::{Depth, Evaluation, MixedDirections, Recorded, STATES};
use rand_distr::{Distribution, StandardNormal, Uniform};
use std::sync::Arc;

/// Two rods with bobs; `m1`, `m2`, `l1`, `l2`, `g`.
struct DoublePendulum;

impl Lagrangian for DoublePendulum {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let (both, [first, second]) = (p[0] + p[1], [p[2] * v[0], p[3] * v[1]]);
        let kinetic =
            (both * first.sqr() + p[1] * second.sqr()) * R::half() + p[1] * first * second * (q[0] - q[1]).cos();
        kinetic + (both * p[2] * q[0].cos() + p[1] * p[3] * q[1].cos()) * p[4]
    }
}

/// Mean over the states of |a - target|^2, of the lanes `(q, v, target)` and the parameters.
struct Misfit {
    recorded: Arc<Recorded<f64>>,
    lanes: Vec<[f64; 6]>,
}

impl Misfit {
    /// The mean and its gradient: with `lam = M^-1 dl/da` the mixed coefficients of `s = -lam`, `t = a`.
    fn evaluate(&self, p: &[f64]) -> Result<(f64, Vec<f64>), Error> {
        let parameters = [1.0, p[0], 1.0, p[1], p[2]];
        let (mut evaluation, mut workspace) = (Evaluation::new(self.recorded.clone()), Workspace::new());
        let (mut sum, mut gradient) = (0.0, vec![0.0; 5]);
        for lanes in self.lanes.chunks(STATES) {
            let part = |k: usize| -> Vec<f64> { lanes.iter().flat_map(|lane| lane[k..k + 2].to_vec()).collect() };
            evaluation.evaluate(&parameters, &part(0), &part(2), Depth::Training);
            let forces = evaluation.dl_dq.iter().zip(&evaluation.coriolis).map(|(g, c)| g - c);
            let mut a = vec![0.0; 2 * lanes.len()];
            solve(2, &evaluation.mass_matrix, &forces.collect::<Vec<_>>(), &mut a, &mut workspace)?;
            let errors: Vec<f64> = a.iter().zip(part(4)).map(|(a, target)| a - target).collect();
            sum += errors.iter().map(|e| e * e).sum::<f64>();
            let by_a: Vec<f64> = errors.iter().map(|e| -2.0 * e / self.lanes.len() as f64).collect();
            let mut s = vec![0.0; by_a.len()];
            solve(2, &evaluation.mass_matrix, &by_a, &mut s, &mut workspace)?;
            let directions = MixedDirections { s, t: a, moving: true };
            evaluation.add_gradient(&parameters, &directions, &mut gradient, None);
        }
        Ok((sum / self.lanes.len() as f64, vec![gradient[1], gradient[3], gradient[4]]))
    }
}

impl CostFunction for Misfit {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, p: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.evaluate(p)?.0)
    }
}

impl Gradient for Misfit {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, p: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.evaluate(p)?.1)
    }
}

/// Largest relative error of the parameters learned from states with this noise, in parts of the rms acceleration.
fn identify(count: usize, noise: f64) -> Result<f64, Error> {
    let (mut rng, uniform) = (RngStream::Training(0).generator(1), Uniform::new(-3.0, 3.0)?);
    let truth = Mechanics::new(DoublePendulum, vec![2.0, 1.4, 0.8, 1.04, 9.8]);
    let mut lanes = vec![[0.0_f64; 6]; count];
    for lane in &mut lanes {
        let (x, target) = lane.split_at_mut(4);
        x.fill_with(|| uniform.sample(&mut rng));
        target.copy_from_slice(&truth.acceleration(&x[..2], &x[2..])?);
    }
    let square = lanes.iter().map(|lane| lane[4].powi(2) + lane[5].powi(2)).sum::<f64>() / (2 * count) as f64;
    for a in lanes.iter_mut().flat_map(|lane| &mut lane[4..]) {
        *a += noise * square.sqrt() * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    }
    let recorded = Recorded::new(vec![1.0; 2], 5, |p, q, v| DoublePendulum.lagrangian(p, q, v))?;
    let problem = Misfit { recorded: Arc::new(recorded), lanes };
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

//! Motions in double-double by Gauss collocation of order 6 at `h`, `h/2`, .., extrapolated to `h = 0`.
//!
//! The method is symmetric: its error is a series in even powers of `h`, from the sixth on. The last two columns of the
//! extrapolation differ by about the error of the lesser one, which bounds that of the better.

use super::problems::Problem;
use lnn::lagrangian::{Request, Terms};
use lnn::rollout::{Integrator, Rollout, RolloutOptions, Trajectory, rollout, rollout_fixed};
use lnn::scalar::{Dd, Scalar};

/// The motion of a problem, good to all digits of `f64`.
pub struct Reference {
    pub states: Trajectory<Dd>,
    /// Largest component of any state.
    pub size: f64,
    /// Difference of the last two columns of the extrapolation, relative to `size`: bounds the error.
    pub bound: f64,
    /// Smallest step.
    pub step: f64,
    /// Largest `|p.v|`, twice the kinetic energy where that is a square of velocities; no constant in `L` changes it.
    pub energy_scale: f64,
    /// What a relative error of the start has grown to at worst, relative to `size`: chaos, not method.
    pub amplification: f64,
}

/// A bound above this is no reference.
const USELESS: f64 = 1e-13;

/// Halves the step until the last two columns agree to `target`, or `levels` steps have been tried.
///
/// # Errors
/// Why a run in double-double stopped, or that the columns still differ visibly.
pub fn reference(problem: &Problem, target: f64, levels: usize) -> Result<Reference, String> {
    let mut step = problem.dt / 8.0;
    let mut row = vec![run(problem, step)?];
    let size = largest(&row[0]);
    let mut bound = f64::INFINITY;
    for level in 1..levels {
        step /= 2.0;
        let mut next = vec![run(problem, step)?];
        for (k, coarse) in row.iter().enumerate() {
            next.push(extrapolate(coarse, &next[k], 6 + 2 * k as i32));
        }
        row = next;
        bound = distance(&row[level], &row[level - 1]).0 / size;
        if bound <= target {
            break;
        }
    }
    match row.pop() {
        Some(states) if bound <= USELESS => {
            let energy_scale = energy_scale(problem, &states);
            let amplification = amplification(problem, size);
            Ok(Reference { states, size, bound, step, energy_scale, amplification })
        }
        _ => Err(format!("reference: double-double still leaves {bound:.1e} at the step {step:.1e}")),
    }
}

/// Removes the error in `h^order` from runs at `2 h` and `h`.
fn extrapolate(coarse: &Trajectory<Dd>, fine: &Trajectory<Dd>, order: i32) -> Trajectory<Dd> {
    let weight = Dd::of_f64(2f64.powi(order) - 1.0);
    let combine = |coarse: &[Dd], fine: &[Dd]| fine.iter().zip(coarse).map(|(&f, &c)| f + (f - c) / weight).collect();
    Trajectory { q: combine(&coarse.q, &fine.q), v: combine(&coarse.v, &fine.v), ..fine.clone() }
}

fn run(problem: &Problem, step: f64) -> Result<Trajectory<Dd>, String> {
    let wide = |x: &[f64]| x.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<Dd>>();
    let options = RolloutOptions::new(Dd::of_f64(problem.t_end), Dd::of_f64(problem.dt))
        .method(Integrator::Gauss6)
        .step(Dd::of_f64(step))
        .energy(false);
    let rolled: Rollout<Dd> = rollout_fixed(&*problem.wide, &wide(&problem.q), &wide(&problem.v), &options);
    rolled.complete().map_err(|e| format!("reference: {e}"))
}

/// Largest component of any state.
fn largest(trajectory: &Trajectory<Dd>) -> f64 {
    trajectory.q.iter().chain(&trajectory.v).fold(0.0, |m, x| m.max(x.to_f64().abs()))
}

/// Largest difference of two trajectories over all times, and at the last.
pub fn distance(a: &Trajectory<Dd>, b: &Trajectory<Dd>) -> (f64, f64) {
    let between = |k: usize| {
        let ((q, v), (r, w)) = (a.state(k), b.state(k));
        let pairs = q.iter().zip(r).chain(v.iter().zip(w));
        pairs.fold(0.0, |m: f64, (&x, &y)| m.max((x - y).to_f64().abs()))
    };
    let last = a.len().min(b.len()) - 1;
    ((0..=last).map(between).fold(0.0, f64::max), between(last))
}

fn energy_scale(problem: &Problem, states: &Trajectory<Dd>) -> f64 {
    let mut terms = Terms::default();
    if problem.wide.terms(&states.q, &states.v, Request::MOMENTUM, &mut terms).is_err() {
        return f64::NAN;
    }
    let n = states.coordinates;
    let products = terms.momentum.chunks_exact(n).zip(states.v.chunks_exact(n));
    let powers = products.map(|(p, v)| p.iter().zip(v).map(|(&p, &v)| (p * v).to_f64()).sum::<f64>().abs());
    powers.fold(0.0, f64::max)
}

/// Growth of small displacements of the start along every component, added up; to a few digits.
fn amplification(problem: &Problem, size: f64) -> f64 {
    let n = problem.q.len();
    let start: Vec<f64> = problem.q.iter().chain(&problem.v).copied().collect();
    let magnitude = start.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let displacement = 1e-6 * magnitude;
    let options = RolloutOptions::reference(problem.t_end, problem.dt).energy(false);
    let run = |start: &[f64]| rollout(&*problem.model, &start[..n], &start[n..], &options).complete().ok();
    let Some(base) = run(&start) else { return f64::NAN };
    let mut growth = vec![vec![0.0; 2 * n]; base.len()];
    for i in 0..2 * n {
        let mut moved = start.clone();
        moved[i] += displacement;
        let Some(moved) = run(&moved) else { return f64::NAN };
        for (k, growth) in growth.iter_mut().enumerate() {
            let ((q, v), (r, w)) = (base.state(k), moved.state(k));
            let pairs = q.iter().zip(r).chain(v.iter().zip(w));
            growth.iter_mut().zip(pairs).for_each(|(sum, (x, y))| *sum += ((y - x) / displacement).abs());
        }
    }
    growth.iter().flatten().fold(0.0, |m: f64, &g| m.max(g)) * magnitude / size
}

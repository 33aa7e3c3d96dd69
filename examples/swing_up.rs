//! A controller swings a learned double pendulum up: iterative LQR on the exact derivatives of its motion.
//!
//! Each of 60 intervals has a constant torque on either joint. A sweep backwards over the linearized motion improves them, with a feedback
//! that holds the motion near its plan (Li and Todorov 2004). The plan is made with the learned model and tried on the exact system.

use lnn::lagrangian::{EulerLagrange, SystemInstance};
use lnn::network::{ModelFile, NetworkLagrangian};
use lnn::rollout::Flow;
use nalgebra::{SMatrix, SVector};
use std::path::Path;

type State = SVector<f64, 4>;
type Torque = SVector<f64, 2>;
type Failure = Box<dyn std::error::Error>;

const INTERVALS: usize = 60;
/// s.
const INTERVAL: f64 = 0.05;
/// Weights of the squares of torques in an interval, and of the distance from the goal at the end.
const EFFORT: f64 = 1e-3;
const GOAL: f64 = 50.0;

fn goal() -> State {
    let up = std::f64::consts::PI;
    State::new(up, up, 0.0, 0.0)
}

/// One torque and its feedback for every interval.
struct Plan {
    torques: Vec<Torque>,
    gains: Vec<SMatrix<f64, 2, 4>>,
    states: Vec<State>,
}

/// The states of a motion that is held near a plan, whose corrections count by a factor, and its cost.
fn follow(
    flow: &Flow<'_, f64>,
    plan: &Plan,
    steps: &[Torque],
    factor: f64,
) -> Result<(Vec<State>, Vec<Torque>, f64), Failure> {
    let (mut states, mut torques, mut cost) = (vec![plan.states[0]], Vec::new(), 0.0);
    for k in 0..INTERVALS {
        let x = states[k];
        let u = plan.torques[k] + steps[k] * factor + plan.gains[k] * (x - plan.states[k]);
        states.push(State::from_vec(flow.end(&x.as_slice()[..2], &x.as_slice()[2..], Some(u.as_slice()))?));
        cost += EFFORT * u.norm_squared() / 2.0;
        torques.push(u);
    }
    cost += GOAL * (states[INTERVALS] - goal()).norm_squared() / 2.0;
    Ok((states, torques, cost))
}

/// Improves a plan from rest until its cost no longer falls.
fn planned(flow: &Flow<'_, f64>) -> Result<Plan, Failure> {
    let nothing = vec![Torque::zeros(); INTERVALS];
    // A small push leaves the equilibrium.
    let mut plan = Plan {
        torques: vec![Torque::new(0.3, 0.1); INTERVALS],
        gains: vec![SMatrix::zeros(); INTERVALS],
        states: vec![State::zeros(); INTERVALS + 1],
    };
    let (mut states, mut torques, mut cost) = follow(flow, &plan, &nothing, 0.0)?;
    let mut damping = 1e-3;
    for _ in 0..200 {
        (plan.states, plan.torques) = (states.clone(), torques.clone());
        let (mut slope, mut curvature) = (GOAL * (states[INTERVALS] - goal()), GOAL * SMatrix::<f64, 4, 4>::identity());
        let mut steps = nothing.clone();
        for k in (0..INTERVALS).rev() {
            let (x, u) = (plan.states[k], plan.torques[k]);
            let found = flow.jacobian(&x.as_slice()[..2], &x.as_slice()[2..], Some(u.as_slice()))?;
            let by_x = SMatrix::<f64, 4, 4>::from_row_slice(&found.by_start);
            let by_u = SMatrix::<f64, 4, 2>::from_row_slice(&found.by_force);
            let of_u = EFFORT * u + by_u.transpose() * slope;
            let uu = by_u.transpose() * curvature * by_u + SMatrix::<f64, 2, 2>::identity() * (EFFORT + damping);
            let ux = by_u.transpose() * curvature * by_x;
            let inverse = uu.try_inverse().ok_or("no step")?;
            (steps[k], plan.gains[k]) = (-inverse * of_u, -inverse * ux);
            slope = by_x.transpose() * slope + plan.gains[k].transpose() * of_u;
            curvature = by_x.transpose() * curvature * by_x + ux.transpose() * plan.gains[k];
            curvature = (curvature + curvature.transpose()) / 2.0;
        }
        let tried = [1.0, 0.5, 0.25, 0.1, 0.02].into_iter().find_map(|factor| {
            let found = follow(flow, &plan, &steps, factor).ok()?;
            (found.2 < cost).then_some(found)
        });
        let Some(better) = tried else {
            damping *= 10.0;
            if damping > 1e6 {
                break;
            }
            continue;
        };
        damping = (damping / 3.0).max(1e-6);
        let gain = cost - better.2;
        (states, torques, cost) = better;
        if gain < 1e-7 * cost {
            break;
        }
    }
    (plan.states, plan.torques) = (states, torques);
    Ok(plan)
}

pub fn main() -> Result<(), Failure> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data/double_pendulum.safetensors");
    let ModelFile { header, weights } = ModelFile::<f64>::load(&path)?;
    let learned = NetworkLagrangian::new(header.architecture, weights)?;
    let plan = planned(&Flow::new(&learned, INTERVAL, 2))?;
    let miss = (plan.states[INTERVALS] - goal()).norm();
    let effort = plan.torques.iter().map(|u| u.amax()).fold(0.0, f64::max);

    // Motion tells L up to a factor, and torques in its unit: one known mass gives the factor.
    let exact = SystemInstance::<f64>::named("double-pendulum", &[])?.build()?;
    let at = [[1.0, 0.5], [0.0, 0.0]];
    let [own, true_one] = [&learned as &dyn EulerLagrange<f64>, &*exact].map(|m| m.mass_matrix(&at[0], &at[1]));
    let factor = own?[0] / true_one?[0];
    let flow = Flow::new(&*exact, INTERVAL, 2);
    let mut x = State::zeros();
    for k in 0..INTERVALS {
        let u = (plan.torques[k] + plan.gains[k] * (x - plan.states[k])) / factor;
        x = State::from_vec(flow.end(&x.as_slice()[..2], &x.as_slice()[2..], Some(u.as_slice()))?);
    }
    let real = (x - goal()).norm();
    println!("largest torque {:.1} N m; from upright: planned {miss:.3}, exact system {real:.3}", effort / factor);
    assert!(miss < 0.1 && real < 0.3, "not upright");
    Ok(())
}

//! Pictures of a motion under constraints: the motion on its surface, the forces of constraint, and its distance from the constraints.

use crate::lagrangian::{EulerLagrange, ManifoldRows, Request, Terms};
use crate::pipeline::thresholds::{CONSTRAINT_SAMPLES, MOST_PLANES_AND_CONSTRAINTS};
use crate::report::{Figure, LinePlot, Series, Trace, figure, file_part, line_plot, trace_plot, with_unit};
use crate::rollout::{RolloutOptions, Trajectory, rollout};

/// Pictures of a model's motion from a state on its constraints over some time; empty for a model without constraints, or if the motion
/// cannot start.
pub(crate) fn constraint_figures(
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    seconds: f64,
    (coordinates, time): (&[String], &str),
) -> Vec<Figure> {
    let Some(manifold) = model.manifold() else { return Vec::new() };
    let options = RolloutOptions::new(seconds, seconds / CONSTRAINT_SAMPLES).energy(false);
    let motion = rollout(model, q, v, &options).trajectory;
    if motion.len() < 2 {
        return Vec::new();
    }
    let mut figures = paths(&motion, coordinates, time);
    let names = &manifold.names()[..manifold.names().len().min(MOST_PLANES_AND_CONSTRAINTS.1)];
    let (mut loads, mut strays) = (vec![Vec::new(); names.len()], vec![Vec::new(); names.len()]);
    let (mut rows, mut terms) = (ManifoldRows::default(), Terms::default());
    for k in 0..motion.len() {
        let (q, v) = motion.state(k);
        manifold.rows(q, v, &mut rows);
        let moved = model.terms(q, v, Request::ACCELERATION, &mut terms).is_ok();
        for c in 0..names.len() {
            let (distance, length) = rows.distance(manifold, c);
            // A logarithmic axis cannot show zero, so errors are at least the machine epsilon.
            strays[c].push(distance.abs().max(f64::EPSILON));
            loads[c].push(if moved { terms.multipliers[c] * length } else { f64::NAN });
        }
    }
    let lines = |values: &[Vec<f64>]| -> Vec<Series> {
        names.iter().zip(values).map(|(name, values)| Series::new(name, &motion.t, values)).collect()
    };
    let plot = |y_label: &str, log_y: bool, values: &[Vec<f64>]| {
        let (x_label, y_label) = (with_unit("t", time), y_label.to_string());
        line_plot(&LinePlot { x_label, y_label, log_y, series: lines(values), ..LinePlot::default() })
    };
    let caption = "The force by which each constraint acts along its gradient, in the unit of the learned L over length; of a rod its tension \
                   (negative) or thrust, of a surface its contact force. The motion is the predicted one.";
    let heading = "What holds the motion on its constraints";
    let drawn = plot("force", false, &loads);
    figures.extend(figure("constraint_forces.svg", heading, drawn, caption));
    let caption = "Distance of the predicted motion from every constraint: |phi| over the length of its gradient, of a row that is linear in the \
                   velocities |A v - b| over its length.";
    let drawn = plot("distance", true, &strays);
    figures.extend(figure("constraint_drift.svg", "Whether the motion stays on its constraints", drawn, caption));
    figures
}

/// Draws the motion in planes of two coordinates.
fn paths(motion: &Trajectory<f64>, names: &[String], time: &str) -> Vec<Figure> {
    let n = names.len();
    let pairs: Vec<(usize, usize)> = match n % 2 {
        0 => (0..n / 2).map(|k| (2 * k, 2 * k + 1)).collect(),
        _ => (1..n).map(|k| (0, k)).collect(),
    };
    let one = |&(i, j): &(usize, usize)| {
        let (x, y): (Vec<f64>, Vec<f64>) = motion.q.chunks_exact(n).map(|q| (q[i], q[j])).unzip();
        let (a, b) = (&names[i], &names[j]);
        let trace = Trace {
            x_label: a.clone(),
            y_label: b.clone(),
            paths: vec![Series::new("predicted", &x, &y)],
            equal: true,
            turn: None,
        };
        let file = format!("constrained_motion_{}_{}.svg", file_part(a), file_part(b));
        let end = motion.t.last().copied().unwrap_or(0.0);
        let caption = format!("The predicted motion from dark (0 {time}, dot) to bright ({end:.3} {time}).");
        figure(&file, format!("The motion on its constraints: {a} and {b}"), trace_plot(&trace), caption)
    };
    pairs.iter().take(MOST_PLANES_AND_CONSTRAINTS.0).filter_map(one).collect()
}

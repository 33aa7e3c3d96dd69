//! A picture of constraints that were found: how far recorded motion is from them.

use super::{Figure, LinePlot, Series, figure, line_plot};
use crate::constraints::{FoundConstraints, MotionSamples};
use crate::lagrangian::{FormulaConstraints, Manifold, ManifoldRows};
use crate::report::thresholds::{SHOWN_CONSTRAINTS, SHOWN_SAMPLES};

/// Distance of the motion from every constraint: `|phi|` over the length of its gradient; for a row that is linear in the velocities, `|A v
/// - b|` over its length. Empty if no constraint was found.
pub fn found_constraint_figures(found: &FoundConstraints, samples: &MotionSamples) -> Vec<Figure> {
    let Ok(constraints) = FormulaConstraints::new(samples.names(), found.formulas()) else { return Vec::new() };
    let Ok(manifold) = constraints.manifold::<f64>() else { return Vec::new() };
    let names = &manifold.names()[..manifold.names().len().min(SHOWN_CONSTRAINTS)];
    let n = samples.n();
    let (mut distances, mut rows) = (vec![Vec::new(); names.len()], ManifoldRows::default());
    let places = samples.places(SHOWN_SAMPLES);
    for &at in &places {
        let (q, v) = samples.state(at).split_at(n);
        manifold.rows(q, v, &mut rows);
        for (c, distances) in distances.iter_mut().enumerate() {
            distances.push(rows.distance(&manifold, c).0);
        }
    }
    let places: Vec<f64> = places.into_iter().map(|at| at as f64).collect();
    let series = names.iter().zip(&distances).map(|(name, values)| Series::new(name, &places, values)).collect();
    let plot = LinePlot { x_label: "sample".into(), y_label: "distance".into(), series, ..LinePlot::default() };
    let caption = "phi over the length of its gradient at the recorded states, of a row that is linear in the velocities A v - b over its \
                   length: noise about 0, if the constraint holds.";
    figure("found_constraints.svg", "Distance of the motion from the constraints", line_plot(&plot), caption)
        .into_iter()
        .collect()
}

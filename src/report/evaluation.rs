//! Pictures of an evaluation.

use super::{Figure, HeatMap, LinePlot, PlotError, Series, Trace, heat_maps_png, line_png, trace_png};
use crate::analysis::{AffineFit, Grid, TrajectoryRun, affine_fit};
use crate::scalar::Scalar;

/// Times and values of one quantity of a run.
type Part<S> = fn(&TrajectoryRun<S>) -> (&[f64], &[f64]);

/// Pictures of trajectory tests: coordinate error, energy error, energy drift over time, one line per start, and for the
/// first start the coordinates over time and its trace in the plane of coordinate and velocity.
///
/// `columns` names the `2n` components of a state; `periodic` marks angles, drawn modulo `2 pi`; `time_unit` is the unit
/// of the time axis.
///
/// # Errors
/// [`PlotError::Renderer`] if the renderer fails; pictures without data are left out.
pub fn evaluation_figures<S: Scalar, T: AsRef<str>>(
    runs: &[TrajectoryRun<S>],
    columns: &[T],
    periodic: &[bool],
    time_unit: &str,
) -> Result<Vec<Figure>, PlotError> {
    let mut figures = Vec::new();
    let over_time = |title: &str, y_label: &str, log_y: bool, series: Vec<Series>| {
        let x_label = format!("t [{time_unit}]");
        line_png(&LinePlot { title: title.into(), x_label, y_label: y_label.into(), log_y, series })
    };
    let per_start = |part: Part<S>| -> Vec<Series> {
        runs.iter()
            .enumerate()
            .map(|(k, run)| {
                let (t, y) = part(run);
                Series::new(&format!("start {}", k + 1), t, y)
            })
            .collect()
    };
    let coordinate = per_start(|run| (&run.coordinates.t, &run.coordinates.max));
    let energy = per_start(|run| (&run.energy.t, &run.energy.error));
    let drift = per_start(|run| (&run.drift.t, &run.drift.error));
    keep(
        &mut figures,
        "coordinate_error.png",
        over_time("Coordinate error", "largest |q learned \u{2212} q exact|", true, coordinate),
        "Largest coordinate error of the learned motion over time, angles modulo 2\u{3c0}.".into(),
    )?;
    keep(
        &mut figures,
        "energy_error.png",
        over_time("Energy error", "|E(t) \u{2212} E(0)| / |E(0)|", true, energy),
        "Normalised error of the exact energy along the learned motion.".into(),
    )?;
    keep(
        &mut figures,
        "energy_drift.png",
        over_time("Drift of the learned energy", "|E(t) \u{2212} E(0)| / |E(0)|", true, drift),
        "Normalised drift of the learned energy along the learned motion: what the integrator loses.".into(),
    )?;

    let Some(run) = runs.first() else { return Ok(figures) };
    let (exact, learned) = (&run.exact.trajectory, &run.learned.trajectory);
    let n = exact.coordinates;
    for (i, name) in columns.iter().take(n).enumerate() {
        let name = name.as_ref();
        let angle = periodic.get(i).copied().unwrap_or(false);
        let line = |label: &str, trajectory: &crate::rollout::Trajectory<S>| {
            let t: Vec<f64> = trajectory.t.iter().map(|t| t.to_f64()).collect();
            let q: Vec<f64> = (0..trajectory.len()).map(|k| trajectory.state(k).0[i].to_f64()).collect();
            Series { points: folded(&t, &q, angle, false), ..Series::new(label, &[], &[]) }
        };
        keep(
            &mut figures,
            &format!("trajectory_{}.png", file_part(name)),
            over_time(
                &format!("{name} of start 1"),
                name,
                false,
                vec![line("exact", exact), line("learned", learned).over()],
            ),
            format!("{name} of start 1 over time, exact and learned."),
        )?;
    }
    for i in 0..n.min(columns.len() / 2) {
        let (q_name, v_name) = (columns[i].as_ref(), columns[n + i].as_ref());
        let angle = periodic.get(i).copied().unwrap_or(false);
        let path = |label: &str, trajectory: &crate::rollout::Trajectory<S>| {
            let part = |values: &[S]| values.iter().skip(i).step_by(n).map(|x| x.to_f64()).collect::<Vec<_>>();
            Series {
                points: folded(&part(&trajectory.q), &part(&trajectory.v), angle, true),
                ..Series::new(label, &[], &[])
            }
        };
        let trace = Trace {
            title: "Phase space".into(),
            x_label: q_name.into(),
            y_label: v_name.into(),
            paths: vec![path("exact", exact), path("learned", learned)],
        };
        keep(
            &mut figures,
            &format!("phase_{}.png", file_part(q_name)),
            trace_png(&trace),
            format!(
                "Start 1 in the plane of {q_name} and {v_name}, exact and learned, from dark (early) to bright (late)."
            ),
        )?;
    }
    Ok(figures)
}

/// A quantity of the exact and of the learned model on the same grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridComparison {
    /// Name of the quantity, such as `L` or `det M`.
    pub quantity: String,
    /// Beginning of the file name.
    pub file: String,
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Exact values.
    pub exact: Grid,
    /// Learned values.
    pub learned: Grid,
    /// Whether to compare up to the best affine fit (`a learned + b`), as a Lagrangian must be.
    pub fit: bool,
}

/// Exact, learned and difference side by side, the first two with one range of colours, and the fit if one was made.
///
/// # Errors
/// [`PlotError`] if a grid has no finite value, the grids differ in size, or the renderer fails.
pub fn grid_figures(comparison: &GridComparison) -> Result<(Figure, Option<AffineFit>), PlotError> {
    let quantity = &comparison.quantity;
    let empty = || PlotError::Empty(quantity.clone());
    let fit = if comparison.fit { affine_fit(&comparison.learned.values, &comparison.exact.values) } else { None };
    let learned = fit.map_or_else(|| comparison.learned.clone(), |fit| comparison.learned.fitted(&fit));
    let difference = learned.minus(&comparison.exact).ok_or_else(empty)?;
    let finite = comparison.exact.values.iter().filter(|z| z.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &z| (low.min(z), high.max(z)));
    let map = |title: String, grid: Grid, range, diverging| HeatMap {
        title,
        x_label: comparison.x_label.clone(),
        y_label: comparison.y_label.clone(),
        grid,
        range,
        diverging,
    };
    let png = heat_maps_png(&[
        map(format!("{quantity} exact"), comparison.exact.clone(), Some((low, high)), false),
        map(format!("{quantity} learned"), learned, Some((low, high)), false),
        map("learned \u{2212} exact".into(), difference, None, true),
    ])?;
    let caption = match fit {
        Some(fit) => format!(
            "{quantity}: exact, learned after the best affine fit (a = {:.6}, b = {:.6}, R\u{b2} = {:.6}), and the difference.",
            fit.a, fit.b, fit.r2
        ),
        None => format!("{quantity}: exact, learned with the same colours, and the difference."),
    };
    Ok((Figure { file: format!("{}.png", comparison.file), png, caption }, fit))
}

/// Keeps a picture, drops one without data.
fn keep(
    figures: &mut Vec<Figure>,
    file: &str,
    drawn: Result<Vec<u8>, PlotError>,
    caption: String,
) -> Result<(), PlotError> {
    match drawn {
        Ok(png) => figures.push(Figure { file: file.into(), png, caption }),
        Err(PlotError::Empty(_)) => {}
        Err(error) => return Err(error),
    }
    Ok(())
}

/// Points with one part, an angle, taken modulo `2 pi` and a gap wherever it wraps.
fn folded(x: &[f64], y: &[f64], angle: bool, fold_x: bool) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::with_capacity(x.len());
    let mut turn = None;
    for (&x, &y) in x.iter().zip(y) {
        let (mut x, mut y) = (x, y);
        if angle {
            let part = if fold_x { &mut x } else { &mut y };
            let now = (*part / std::f64::consts::TAU).floor();
            *part = part.wrap_angle();
            if turn.is_some_and(|before| before != now) {
                points.push((f64::NAN, f64::NAN));
            }
            turn = Some(now);
        }
        points.push((x, y));
    }
    points
}

/// A name as part of a file name.
fn file_part(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Axis, StartBox, TrajectoryTest, determinant_grid, lagrangian_grid};
    use crate::rollout::models::{OSCILLATOR, PENDULUM, SINGULAR};

    fn save(figures: &[Figure]) {
        // Pictures to look at: set the directory to keep them.
        if let Ok(directory) = std::env::var("LNN_TEST_PICTURES") {
            for figure in figures {
                std::fs::write(std::path::Path::new(&directory).join(&figure.file), &figure.png).unwrap();
            }
        }
    }

    #[test]
    fn every_picture_of_a_test_is_drawn() {
        let bounds = StartBox { q: vec![(2.0, 3.0)], v: vec![(1.0, 1.5)] };
        let test = TrajectoryTest { t_end: 30.0, ..TrajectoryTest::<f64>::new(bounds, vec![true]) };
        let mut runs = test.run(&PENDULUM, &PENDULUM);
        runs.extend(TrajectoryTest { starts: 1, seed: 5, ..test }.run(&PENDULUM, &SINGULAR));
        let figures = evaluation_figures(&runs, &["theta", "theta_dot"], &[true], "s").unwrap();
        let names: Vec<_> = figures.iter().map(|f| f.file.as_str()).collect();
        let expected =
            ["coordinate_error.png", "energy_error.png", "energy_drift.png", "trajectory_theta.png", "phase_theta.png"];
        assert_eq!(names, expected);
        save(&figures);
        assert!(evaluation_figures::<f64, &str>(&[], &[], &[], "s").unwrap().is_empty());
    }

    #[test]
    fn grids_are_compared_up_to_the_fit() {
        let axes = [
            Axis { component: 0, from: -3.0, to: 3.0, points: 61 },
            Axis { component: 1, from: -2.0, to: 2.0, points: 41 },
        ];
        let grid = |model| lagrangian_grid::<f64>(model, &[0.0, 0.0], axes).unwrap();
        let exact = grid(&PENDULUM);
        let mut comparison = GridComparison {
            quantity: "L".into(),
            file: "lagrangian".into(),
            x_label: "theta [rad]".into(),
            y_label: "theta_dot [rad/s]".into(),
            learned: exact.map(|z| 3.0 * z - 7.0),
            exact,
            fit: true,
        };
        let (_, fit) = grid_figures(&comparison).unwrap();
        let fit = fit.unwrap();
        assert!((fit.a - 1.0 / 3.0).abs() < 1e-12 && (fit.b - 7.0 / 3.0).abs() < 1e-12 && fit.r2 > 1.0 - 1e-12);
        comparison.learned = grid(&OSCILLATOR);
        let (figure, _) = grid_figures(&comparison).unwrap();
        save(&[figure]);
        let det = determinant_grid::<f64>(&PENDULUM, &[0.0, 0.0], axes).unwrap();
        comparison = GridComparison {
            quantity: "det M".into(),
            file: "det_m".into(),
            exact: det.clone(),
            learned: det,
            fit: false,
            ..comparison
        };
        let (figure, fit) = grid_figures(&comparison).unwrap();
        assert!(fit.is_none());
        save(&[figure]);
    }
}

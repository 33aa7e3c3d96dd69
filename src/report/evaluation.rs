//! Pictures of the motions of an evaluation.

use super::{Figure, LinePlot, PlotError, Series, Trace, line_png, trace_png};
use crate::analysis::TrajectoryRun;
use crate::lagrangian::Configured;
use crate::recording::hermite;
use crate::rollout::Trajectory;
use crate::scalar::Scalar;

/// Times and values of one quantity of a run.
type Part<S> = fn(&TrajectoryRun<S>) -> (&[f64], &[f64]);

/// Pictures of trajectory tests, in the order of a report: coordinate error, energy error, drift of the learned energy,
/// one line per start; coordinates of the first start over time, and velocities if the system has a time-like coordinate;
/// every start in the plane of the system; the first start in the planes of coordinate and velocity.
///
/// `system` describes what moved: names, units, angles (drawn modulo `2 pi`), the plane.
///
/// # Errors
/// [`PlotError::Renderer`] if the renderer fails; pictures without data are left out.
pub fn evaluation_figures<S: Scalar>(
    runs: &[TrajectoryRun<S>],
    system: &Configured<S>,
) -> Result<Vec<Figure>, PlotError> {
    let mut figures = errors_over_time(runs, system)?;
    if let Some(run) = runs.first() {
        let pair = [("exact", &run.exact.trajectory), ("learned", &run.learned.trajectory)];
        first_over_time(&mut figures, pair, system)?;
        traces(&mut figures, runs, system)?;
        phases(&mut figures, pair, system)?;
    }
    Ok(figures)
}

/// Exact and learned motion with their names.
type Pair<'a, S> = [(&'static str, &'a Trajectory<S>); 2];

/// Lines over the evolution parameter.
fn over_time<S>(
    system: &Configured<S>,
    title: &str,
    y_label: &str,
    log_y: bool,
    series: Vec<Series>,
) -> Result<Vec<u8>, PlotError> {
    let parameter = if system.system.time_like.is_some() { "proper time" } else { "t" };
    let x_label = format!("{parameter} [{}]", system.system.time_unit);
    line_png(&LinePlot { title: title.into(), x_label, y_label: y_label.into(), log_y, series })
}

fn errors_over_time<S: Scalar>(runs: &[TrajectoryRun<S>], system: &Configured<S>) -> Result<Vec<Figure>, PlotError> {
    let mut units = system.system.units(system.coordinates);
    units.truncate(system.coordinates);
    units.sort();
    units.dedup();
    let coordinate_label = format!("largest |q learned \u{2212} q exact| [{}]", units.join(", "));
    let energy_label = "|E(t) \u{2212} E(0)| / |E(0)|";
    let pictures: [(&str, &str, &str, Part<S>, &str); 3] = [
        (
            "coordinate_error.png",
            "Coordinate error",
            &coordinate_label,
            |run| (&run.coordinates.t, &run.coordinates.max),
            "Largest coordinate error of the learned motion over time, angles modulo 2\u{3c0}.",
        ),
        (
            "energy_error.png",
            "Energy error",
            energy_label,
            |run| (&run.energy.t, &run.energy.error),
            "Normalised error of the exact energy along the learned motion.",
        ),
        (
            "energy_drift.png",
            "Drift of the learned energy",
            energy_label,
            |run| (&run.drift.t, &run.drift.error),
            "Normalised drift of the learned energy along the learned motion: what the integrator loses.",
        ),
    ];
    let mut figures = Vec::new();
    for (file, title, label, part, caption) in pictures {
        let line = |(k, run): (usize, &TrajectoryRun<S>)| {
            let (t, y) = part(run);
            Series::new(&format!("start {}", k + 1), t, y)
        };
        let lines = runs.iter().enumerate().map(line).collect();
        keep(&mut figures, file, over_time(system, title, label, true, lines), caption.into())?;
    }
    Ok(figures)
}

/// Coordinates of the first start, and velocities if there is a time-like coordinate: rates of clocks.
fn first_over_time<S: Scalar>(
    figures: &mut Vec<Figure>,
    pair: Pair<'_, S>,
    system: &Configured<S>,
) -> Result<(), PlotError> {
    let n = system.coordinates;
    let (coordinates, columns) = (system.system.coordinates(n), system.system.columns(n));
    let labels = system.system.labels(n);
    let shown = if system.system.time_like.is_some() { 2 * n } else { n };
    for k in 0..shown {
        let (coordinate, column) = (&coordinates[k % n], &columns[k]);
        let line = |(label, trajectory): (&str, &Trajectory<S>)| {
            let t: Vec<f64> = trajectory.t.iter().map(|t| t.to_f64()).collect();
            let points = folded(&t, &component(trajectory, k), coordinate.periodic && k < n, false);
            Series { points, ..Series::new(label, &[], &[]) }
        };
        let lines = vec![line(pair[0]), line(pair[1]).over()];
        let kind = if k < n { "trajectory" } else { "velocity" };
        keep(
            figures,
            &format!("{kind}_{}.png", file_part(&coordinate.name)),
            over_time(system, &format!("{column} of start 1"), &labels[k], false, lines),
            format!("{column} of start 1 over time, exact and learned."),
        )?;
    }
    Ok(())
}

/// Every start in the plane of the system.
fn traces<S: Scalar>(
    figures: &mut Vec<Figure>,
    runs: &[TrajectoryRun<S>],
    system: &Configured<S>,
) -> Result<(), PlotError> {
    let Some(plane) = system.system.plane else { return Ok(()) };
    let path = |label: &str, trajectory: &Trajectory<S>| {
        let places = smooth(trajectory).into_iter().filter_map(|q| system.place(&q));
        Series { points: places.collect(), ..Series::new(label, &[], &[]) }
    };
    for (k, run) in runs.iter().enumerate() {
        let start = k + 1;
        let [x_label, y_label] = plane.labels.map(String::from);
        let caption =
            format!("Trace of start {start} in the plane, exact and learned, from dark (early) to bright (late).");
        let trace = Trace {
            title: format!("Start {start}"),
            x_label,
            y_label,
            paths: vec![path("exact", &run.exact.trajectory), path("learned", &run.learned.trajectory)],
            equal: true,
        };
        keep(figures, &format!("trace_start{start}.png"), trace_png(&trace), caption)?;
    }
    Ok(())
}

/// Coordinates along a motion, by cubic Hermite interpolation five times as dense as its samples: what is drawn between
/// them curves as the motion did.
fn smooth<S: Scalar>(trajectory: &Trajectory<S>) -> Vec<Vec<S>> {
    const PIECES: usize = 5;
    let n = trajectory.coordinates;
    let mut places = Vec::with_capacity(PIECES * trajectory.len());
    for k in 0..trajectory.len() {
        let (q, v) = trajectory.state(k);
        places.push(q.to_vec());
        if k + 1 == trajectory.len() {
            break;
        }
        let (next, w) = trajectory.state(k + 1);
        let h = trajectory.t[k + 1] - trajectory.t[k];
        for piece in 1..PIECES {
            let [factors, _] = hermite(piece as f64 / PIECES as f64, h.to_f64()).map(|f| f.map(S::of_f64));
            let [a, b, c, d] = factors;
            places.push((0..n).map(|i| a * q[i] + b * v[i] + c * next[i] + d * w[i]).collect());
        }
    }
    places
}

/// The first start in the planes of coordinate and velocity.
fn phases<S: Scalar>(figures: &mut Vec<Figure>, pair: Pair<'_, S>, system: &Configured<S>) -> Result<(), PlotError> {
    let n = system.coordinates;
    let (columns, labels) = (system.system.columns(n), system.system.labels(n));
    for (i, coordinate) in system.system.coordinates(n).iter().enumerate() {
        let path = |(label, trajectory): (&str, &Trajectory<S>)| {
            let (q, v) = (component(trajectory, i), component(trajectory, n + i));
            Series { points: folded(&q, &v, coordinate.periodic, true), ..Series::new(label, &[], &[]) }
        };
        let trace = Trace {
            title: "Phase space of start 1".into(),
            x_label: labels[i].clone(),
            y_label: labels[n + i].clone(),
            paths: pair.map(path).to_vec(),
            equal: false,
        };
        let (q, v) = (&columns[i], &columns[n + i]);
        let caption =
            format!("Start 1 in the plane of {q} and {v}, exact and learned, from dark (early) to bright (late).");
        keep(figures, &format!("phase_{}.png", file_part(q)), trace_png(&trace), caption)?;
    }
    Ok(())
}

/// Component `k` of the states `(q, v)` over time; nothing if the trajectory has not so many.
fn component<S: Scalar>(trajectory: &Trajectory<S>, k: usize) -> Vec<f64> {
    let n = trajectory.coordinates;
    let (values, offset) = if k < n { (&trajectory.q, k) } else { (&trajectory.v, k - n) };
    values.chunks_exact(n.max(1)).filter_map(|row| row.get(offset)).map(|x| x.to_f64()).collect()
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
    use crate::analysis::{StartBox, TrajectoryTest};
    use crate::lagrangian::configure;
    use crate::report::test_pictures::save;
    use crate::rollout::models::{OSCILLATOR, PENDULUM, SINGULAR};

    fn files(figures: &[Figure]) -> Vec<&str> {
        figures.iter().map(|f| f.file.as_str()).collect()
    }

    #[test]
    fn drawn_paths_curve_with_the_motion() {
        // Samples of a unit circle 0.2 apart: a cubic through places and velocities stays on it to 0.2^4/384.
        let bounds = StartBox { q: vec![(1.0, 1.0)], v: vec![(0.0, 0.0)] };
        let test = TrajectoryTest { starts: 1, t_end: 2.0, dt: 0.2, ..TrajectoryTest::<f64>::new(bounds, vec![false]) };
        let run = test.run(&OSCILLATOR, &OSCILLATOR).remove(0);
        let path = smooth(&run.exact.trajectory);
        assert_eq!(path.len(), 51);
        for (k, q) in path.iter().enumerate() {
            assert!((q[0] - (0.04 * k as f64).cos()).abs() < 1.1 * 0.2f64.powi(4) / 384.0, "{k}: {}", q[0]);
        }
    }

    #[test]
    fn every_picture_of_a_test_is_drawn() {
        let bounds = StartBox { q: vec![(2.0, 3.0)], v: vec![(1.0, 1.5)] };
        let test = TrajectoryTest { t_end: 30.0, ..TrajectoryTest::<f64>::new(bounds, vec![true]) };
        let mut runs = test.run(&PENDULUM, &PENDULUM);
        runs.truncate(1);
        runs.extend(TrajectoryTest { starts: 1, seed: 5, ..test }.run(&PENDULUM, &SINGULAR));
        let system = configure::<f64>("n-pendulum", &[("n".to_string(), "1".to_string())]).unwrap();
        let figures = evaluation_figures(&runs, &system).unwrap();
        let expected = [
            "coordinate_error.png",
            "energy_error.png",
            "energy_drift.png",
            "trajectory_theta.png",
            "trace_start1.png",
            "trace_start2.png",
            "phase_theta.png",
        ];
        assert_eq!(files(&figures), expected);
        save(&figures);
        assert!(evaluation_figures(&[], &system).unwrap().is_empty());
    }

    #[test]
    fn rates_of_clocks_are_shown_where_there_is_a_time() {
        let system = configure::<f64>("ads2-geodesic", &[]).unwrap();
        let exact = system.build().unwrap();
        let start = system.system.trajectory(2).start;
        let bounds = StartBox { q: start.positions, v: start.velocities };
        let test = TrajectoryTest { starts: 1, t_end: 0.5, dt: 0.01, ..TrajectoryTest::new(bounds, vec![false; 2]) };
        let runs = test.run_constrained(&system, exact.as_ref(), exact.as_ref()).unwrap();
        let figures = evaluation_figures(&runs, &system).unwrap();
        let motions = ["trajectory_t.png", "trajectory_z.png", "velocity_t.png", "velocity_z.png", "trace_start1.png"];
        assert_eq!(files(&figures)[3..8], motions);
        assert!(figures[5].caption.starts_with("t_dot of start 1"));
        let states = &runs[0].exact.trajectory;
        assert_eq!((component(states, 1)[3], component(states, 2)[3]), (states.state(3).0[1], states.state(3).1[0]));
    }
}

//! Pictures of a training, and of the motions of an evaluation.

use super::{
    Figure, Level, LinePlot, Polar, Series, Trace, Turn, by_unit, figure, file_part, line_plot, median_of, trace_plot,
    with_unit,
};
use crate::analysis::{Portrait, TrajectoryRun, VALID, ValidTimes};
use crate::lagrangian::SystemInstance;
use crate::names::{number, rounded};
use crate::report::thresholds::{BEYOND_VALID, DRAWN_COORDINATES, DRAWN_STARTS};
use crate::rollout::Trajectory;
use crate::scalar::Scalar;

/// One epoch. Quantities that a training does not have are `NaN`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HistoryRow {
    /// Number of the epoch.
    pub epoch: f64,
    /// Mean loss of the training states.
    pub training_loss: f64,
    /// Loss of the validation states.
    pub validation_loss: f64,
    /// Learning rate.
    pub learning_rate: f64,
    /// Mean norm of the gradient.
    pub gradient_norm: f64,
    /// Mean penalty.
    pub penalty: f64,
}

/// Pictures of a history: loss, learning rate, gradient norm and penalty; quantities without a finite positive value are left
/// out.
pub fn training_figures(rows: &[HistoryRow]) -> Vec<Figure> {
    let epochs: Vec<f64> = rows.iter().map(|row| row.epoch).collect();
    let series = |name: &str, part: fn(&HistoryRow) -> f64| {
        Series::new(name, &epochs, &rows.iter().map(part).collect::<Vec<_>>())
    };
    let best = rows
        .iter()
        .filter(|row| row.validation_loss.is_finite())
        .min_by(|a, b| a.validation_loss.total_cmp(&b.validation_loss));
    let loss = match best {
        Some(best) => {
            format!("Lowest validation loss {} in epoch {}.", rounded(best.validation_loss, 6), best.epoch)
        }
        None => String::new(),
    };
    let pictures = [
        (
            "training_loss.svg",
            "How the loss falls from epoch to epoch",
            "loss",
            vec![series("training", |r| r.training_loss), series("validation", |r| r.validation_loss)],
            loss,
        ),
        (
            "learning_rate.svg",
            "The learning rate",
            "learning rate",
            vec![series("", |r| r.learning_rate)],
            String::new(),
        ),
        (
            "gradient_norm.svg",
            "The size of the gradient",
            "gradient norm",
            vec![series("", |r| r.gradient_norm)],
            "Norm before clipping, mean per epoch.".into(),
        ),
        (
            "penalty.svg",
            "How much the mass matrix violates its signature",
            "penalty",
            vec![series("", |r| r.penalty)],
            "Penalty on the mass matrix, mean per epoch; epochs without a violation leave gaps.".into(),
        ),
    ];
    let drawn = |(file, heading, y_label, series, caption): (&str, &str, &str, Vec<Series>, String)| {
        let y_label = y_label.to_string();
        let plot = LinePlot { x_label: "epoch".into(), y_label, log_y: true, series, ..LinePlot::default() };
        figure(file, heading, line_plot(&plot), caption)
    };
    pictures.into_iter().filter_map(drawn).collect()
}

/// Times and values of one quantity of a run.
type Part<'a, S> = &'a dyn Fn(&TrajectoryRun<S>) -> (&[f64], Vec<f64>);

/// Pictures of trajectory tests, in the order of a report: coordinates over time of the start that is the median by the time of valid
/// prediction, and velocities if the system has a time-like coordinate; every portrayed start in the plane of the system; the median one in
/// the planes of coordinate and velocity; relative prediction error up to beyond the time of valid prediction; coordinate error, energy
/// error, drift of the learned energy over the whole test, one line per start.
///
/// `portraits` are the first starts in dense samples, `system` describes what moved: names, units, angles (folded into one
/// turn where they leave it), the plane. Pictures without data are left out, and those of coordinates beyond the eighth.
pub fn evaluation_figures<S: Scalar>(
    runs: &[TrajectoryRun<S>],
    portraits: &[Portrait<S>],
    system: &SystemInstance<S>,
) -> Vec<Figure> {
    let mut figures = Vec::new();
    let valid: Vec<f64> = runs.iter().take(portraits.len()).map(|run| run.valid.time).collect();
    if let Some(start) = median_of(&valid) {
        let Portrait { exact, learned } = &portraits[start];
        let pair = [("exact", exact), ("learned", learned)];
        let name = match portraits.len() {
            1 => "start 1".to_string(),
            count => format!("start {}, the median of {count} by the time of valid prediction", start + 1),
        };
        over_time_of(&mut figures, pair, &name, system);
        traces(&mut figures, portraits, system);
        phases(&mut figures, pair, &name, system);
    }
    errors_over_time(&mut figures, runs, system);
    figures
}

/// Exact and learned motion with their names.
type Pair<'a, S> = [(&'static str, &'a Trajectory<S>); 2];

/// Label of the evolution parameter.
fn time_label<S>(system: &SystemInstance<S>) -> String {
    let parameter = if system.system.time_like.is_some() { "proper time" } else { "t" };
    with_unit(parameter, &system.system.time_unit)
}

/// Lines over the evolution parameter.
fn over_time<S>(system: &SystemInstance<S>, y_label: &str, log_y: bool, series: Vec<Series>) -> LinePlot {
    LinePlot { x_label: time_label(system), y_label: y_label.into(), log_y, series, ..LinePlot::default() }
}

fn errors_over_time<S: Scalar>(figures: &mut Vec<Figure>, runs: &[TrajectoryRun<S>], system: &SystemInstance<S>) {
    let some = match runs.len() {
        count if count > DRAWN_STARTS => format!(" The first {DRAWN_STARTS} of {count} starts."),
        _ => String::new(),
    };
    let valid = ValidTimes::of(&runs.iter().map(|run| (run.valid, None)).collect::<Vec<_>>());
    let valid = valid.map_or(0.0, |valid| valid.median);
    let mut add = |file: &str, [label, heading, caption]: [&str; 3], until: Option<f64>, part: Part<'_, S>| {
        let line = |(k, run): (usize, &TrajectoryRun<S>)| {
            let (t, y) = part(run);
            let shown = until.map_or(t.len(), |until| t.partition_point(|t| *t <= until));
            Series::new(&format!("start {}", k + 1), &t[..shown], &y[..shown.min(y.len())])
        };
        let lines = runs.iter().take(DRAWN_STARTS).enumerate().map(line).collect();
        let level = until.map(|_| Level { value: VALID, name: format!("valid up to {VALID}") });
        let plot = LinePlot { level, ..over_time(system, label, true, lines) };
        figures.extend(figure(file, heading, line_plot(&plot), format!("{caption}{some}")));
    };
    let texts = [
        "error / spread of the motion",
        "How long the prediction holds",
        "Error of the learned coordinates relative to the spread of the exact motion, one line per start. The prediction is \
         valid until it exceeds the level.",
    ];
    let until = BEYOND_VALID * valid;
    add("prediction_error.svg", texts, Some(until), &|run| (&run.coordinates.t, run.relative.clone()));
    let groups = units(system);
    for (unit, coordinates) in &groups {
        let file = match groups.len() {
            1 => "coordinate_error.svg".to_string(),
            _ => format!("coordinate_error_{}.svg", file_part(unit)),
        };
        let label = format!("largest error [{unit}]");
        let heading = format!("Error of the predicted coordinates in {unit}");
        let caption =
            "Largest |q learned \u{2212} q exact| of these coordinates over the whole test, angles modulo 2\u{3c0}.";
        let texts = [&*label, &heading, caption];
        add(&file, texts, None, &|run| (&run.coordinates.t, run.coordinates.largest(coordinates)));
    }
    let label = "|E(t) \u{2212} E(0)| / |E(0)|";
    let caption = "Relative error of the exact energy along the learned motion.";
    let texts = [label, "Whether the predicted motion keeps the true energy", caption];
    add("energy_error.svg", texts, None, &|run| (&run.energy.t, run.energy.error.clone()));
    let caption = "Relative drift of the learned energy along the learned motion: what the integrator loses.";
    let texts = [label, "Whether the integrator keeps the learned energy", caption];
    add("energy_drift.svg", texts, None, &|run| (&run.drift.t, run.drift.error.clone()));
}

/// Units of the coordinates, each with the coordinates that have it, in their order.
pub(crate) fn units<S>(system: &SystemInstance<S>) -> Vec<(String, Vec<usize>)> {
    by_unit(&system.system.units(system.coordinates)[..system.coordinates])
}

/// Draws the coordinates of a start over time; with a time-like coordinate, also the velocities, which are the rates of clocks.
fn over_time_of<S: Scalar>(figures: &mut Vec<Figure>, pair: Pair<'_, S>, start: &str, system: &SystemInstance<S>) {
    let n = system.coordinates;
    let (coordinates, columns) = (system.system.coordinates(n), system.system.columns(n));
    let labels = system.system.labels(n);
    let shown = if system.system.time_like.is_some() { 2 * n } else { n };
    for k in (0..shown).filter(|k| k % n < DRAWN_COORDINATES) {
        let (coordinate, column) = (&coordinates[k % n], &columns[k]);
        let values = pair.map(|(_, trajectory)| component(trajectory, k));
        let angle = coordinate.periodic && k < n;
        let turn = if angle { Turn::of(values.iter().flatten().copied()) } else { None };
        let line = |((label, trajectory), values): ((&str, &Trajectory<S>), &Vec<f64>)| {
            Series::folded(label, values.iter().copied().zip(times(trajectory)).collect(), turn)
        };
        let [exact, learned] = [line((pair[0], &values[0])), line((pair[1], &values[1])).over()];
        let plot = over_time(system, &labels[k], false, vec![exact, learned]);
        let kind = if k < n { "trajectory" } else { "velocity" };
        let file = format!("{kind}_{}.svg", file_part(&coordinate.name));
        let folded = if turn.is_some() { ", folded into one turn" } else { "" };
        let heading = format!("{column} over time: predicted over exact");
        let caption = format!("{column} of {start}, exact (wide) and learned{folded}.");
        figures.extend(figure(&file, heading, line_plot(&LinePlot { turn, ..plot }), caption));
    }
}

/// Describes the ends of a path.
fn from_the_dot<S: Scalar>(trajectory: &Trajectory<S>, unit: &str) -> String {
    let end = trajectory.t.last().map_or(0.0, |t| t.to_f64());
    format!("from the dot (0 {unit}) to {} {unit}", number(end))
}

/// Draws the portrayed starts in the plane of the system.
fn traces<S: Scalar>(figures: &mut Vec<Figure>, portraits: &[Portrait<S>], system: &SystemInstance<S>) {
    let n = system.coordinates;
    let polar = Polar::of(&system.system.columns(n)[..n], &system.system.units(n));
    let drawn = |pair: Pair<'_, S>| match (system.system.plane, &polar) {
        (Some(plane), _) => {
            let [x_label, y_label] = plane.labels.map(String::from);
            let path = |(label, trajectory): (&str, &Trajectory<S>)| {
                let places = (0..trajectory.len()).filter_map(|k| system.position_in_plane(trajectory.state(k).0));
                Series { points: places.collect(), ..Series::new(label, &[], &[]) }
            };
            Some(Trace { x_label, y_label, paths: pair.map(path).to_vec(), equal: true, turn: None })
        }
        (None, Some(polar)) => {
            let [exact, learned]: [Vec<f64>; 2] =
                pair.map(|(_, trajectory)| trajectory.q.iter().map(|x| x.to_f64()).collect());
            Some(polar.trace(n, &[("exact", &exact), ("learned", &learned)]))
        }
        (None, None) => None,
    };
    for (k, Portrait { exact, learned }) in portraits.iter().enumerate() {
        let start = k + 1;
        let Some(trace) = drawn([("exact", exact), ("learned", learned)]) else { return };
        let time = from_the_dot(exact, &system.system.time_unit);
        let heading = format!("The path of start {start}: predicted over exact");
        let caption = format!("Path in the plane, exact (wide) and learned, {time}.");
        figures.extend(figure(&format!("trace_start{start}.svg"), heading, trace_plot(&trace), caption));
    }
}

/// Draws a start in the planes of coordinate and velocity.
fn phases<S: Scalar>(figures: &mut Vec<Figure>, pair: Pair<'_, S>, start: &str, system: &SystemInstance<S>) {
    let n = system.coordinates;
    let (columns, labels) = (system.system.columns(n), system.system.labels(n));
    for (i, coordinate) in system.system.coordinates(n).iter().enumerate().take(DRAWN_COORDINATES) {
        let points = pair.map(|(_, trajectory)| {
            let states = component(trajectory, i).into_iter().zip(component(trajectory, n + i));
            states.collect::<Vec<(f64, f64)>>()
        });
        let turn = if coordinate.periodic { Turn::of(points.iter().flatten().map(|p| p.0)) } else { None };
        let folded = |points: &Vec<(f64, f64)>| turn.map_or_else(|| points.clone(), |turn| turn.fold(points));
        let path = |k: usize| Series { points: folded(&points[k]), ..Series::new(pair[k].0, &[], &[]) };
        let trace = Trace {
            x_label: labels[i].clone(),
            y_label: labels[n + i].clone(),
            paths: vec![path(0), path(1)],
            equal: false,
            turn,
        };
        let (q, v) = (&columns[i], &columns[n + i]);
        let time = from_the_dot(pair[0].1, &system.system.time_unit);
        let heading = format!("Phase space of {q}: predicted over exact");
        let caption = format!("The plane of {q} and {v} of {start}, exact (wide) and learned, {time}.");
        figures.extend(figure(&format!("phase_{}.svg", file_part(q)), heading, trace_plot(&trace), caption));
    }
}

fn times<S: Scalar>(trajectory: &Trajectory<S>) -> impl Iterator<Item = f64> {
    trajectory.t.iter().map(|t| t.to_f64())
}

/// Component `k` of the states `(q, v)` over time; empty if it does not exist.
fn component<S: Scalar>(trajectory: &Trajectory<S>, k: usize) -> Vec<f64> {
    let n = trajectory.coordinates;
    let (values, offset) = if k < n { (&trajectory.q, k) } else { (&trajectory.v, k - n) };
    values.chunks_exact(n.max(1)).filter_map(|row| row.get(offset)).map(|x| x.to_f64()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{StartBox, TrajectoryTest};
    use crate::models::{PENDULUM, SINGULAR};
    use crate::report::save_pictures;

    #[test]
    fn what_is_missing_is_left_out() {
        let rows: Vec<_> = (0..20)
            .map(|k| HistoryRow {
                epoch: f64::from(k),
                training_loss: (-0.3 * f64::from(k)).exp(),
                validation_loss: 1.1 * (-0.3 * f64::from(k)).exp(),
                learning_rate: 1e-3,
                gradient_norm: f64::NAN,
                penalty: 0.0,
            })
            .collect();
        let figures = training_figures(&rows);
        let names: Vec<_> = figures.iter().map(|f| f.file.as_str()).collect();
        assert_eq!(names, ["training_loss.svg", "learning_rate.svg"]);
        assert!(figures[0].caption.contains("epoch 19"));
        assert!(training_figures(&[]).is_empty());
    }

    fn files(figures: &[Figure]) -> Vec<&str> {
        figures.iter().map(|f| f.file.as_str()).collect()
    }

    #[test]
    fn every_picture_of_a_test_is_drawn() {
        let bounds = StartBox { q: vec![(2.0, 3.0)], v: vec![(1.0, 1.5)] };
        let test = TrajectoryTest { t_end: 30.0, ..TrajectoryTest::<f64>::new(bounds, vec![true]) };
        let mut runs = test.run(&PENDULUM, &PENDULUM);
        runs.truncate(1);
        runs.extend(TrajectoryTest { starts: 1, seed: 5, ..test.clone() }.run(&PENDULUM, &SINGULAR));
        let system = SystemInstance::<f64>::named("n-pendulum", &[("n".to_string(), "1".to_string())]).unwrap();
        let portraits = test.portraits(&PENDULUM, &PENDULUM, &runs);
        let figures = evaluation_figures(&runs, &portraits, &system);
        let expected = [
            "trajectory_theta.svg",
            "trace_start1.svg",
            "trace_start2.svg",
            "phase_theta.svg",
            "prediction_error.svg",
            "coordinate_error.svg",
            "energy_error.svg",
            "energy_drift.svg",
        ];
        assert_eq!(files(&figures), expected);
        save_pictures(&figures);
        assert!(evaluation_figures(&[], &[], &system).is_empty());
    }

    #[test]
    fn errors_of_unlike_units_have_pictures_of_their_own() {
        let system = SystemInstance::<f64>::named("spring-pendulum", &[]).unwrap();
        let exact = system.build().unwrap();
        let groups = units(&system);
        assert_eq!(
            groups.iter().map(|(unit, members)| (unit.as_str(), members.len())).collect::<Vec<_>>(),
            [("m", 1), ("rad", 1)]
        );
        let start = system.system.trajectory(2).start;
        let bounds = StartBox { q: start.positions, v: start.velocities };
        let test = TrajectoryTest { starts: 1, t_end: 1.0, dt: 0.05, ..TrajectoryTest::new(bounds, vec![false, true]) };
        let runs = test.run(exact.as_ref(), exact.as_ref());
        let figures = evaluation_figures(&runs, &[], &system);
        let expected = ["coordinate_error_m.svg", "coordinate_error_rad.svg"];
        assert!(expected.iter().all(|file| files(&figures).contains(file)), "{:?}", files(&figures));
    }

    #[test]
    fn rates_of_clocks_are_shown_where_there_is_a_time() {
        let system = SystemInstance::<f64>::named("ads2-geodesic", &[]).unwrap();
        let exact = system.build().unwrap();
        let start = system.system.trajectory(2).start;
        let bounds = StartBox { q: start.positions, v: start.velocities };
        let test = TrajectoryTest { starts: 1, t_end: 0.5, dt: 0.01, ..TrajectoryTest::new(bounds, vec![false; 2]) };
        let runs = test.run_constrained(&system, exact.as_ref(), exact.as_ref()).unwrap();
        let portraits = test.portraits(exact.as_ref(), exact.as_ref(), &runs);
        let figures = evaluation_figures(&runs, &portraits, &system);
        let motions = ["trajectory_t.svg", "trajectory_z.svg", "velocity_t.svg", "velocity_z.svg", "trace_start1.svg"];
        assert_eq!(files(&figures)[..5], motions);
        assert!(figures[2].caption.starts_with("t_dot of start 1"));
        // Exact and learned paths share a plot.
        assert!(figures.iter().all(|figure| figure.picture.panels() == 1));
        assert!(figures[4].to_svg().contains(">exact</text>") && figures[4].to_svg().contains(">learned</text>"));
        assert!(figures.iter().all(|figure| !figure.heading.is_empty()));
        let states = &runs[0].exact.trajectory;
        assert_eq!((component(states, 1)[3], component(states, 2)[3]), (states.state(3).0[1], states.state(3).1[0]));
    }
}

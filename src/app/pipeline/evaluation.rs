//! Evaluation of a model: compares accelerations, trajectories and pictures with the analytical system.

use crate::analysis::{
    Axis, ErrorDistribution, Grid, MassMatrixError, Portrait, StartBox, Statistics, TrajectoryRun, TrajectorySummary,
    TrajectoryTest, ValidTimes, acceleration_errors, conserved_error, determinant_grid, lagrangian_grid,
    mass_matrix_error_within, nearest_factor, statistics, wrong_signatures,
};
use crate::data::Dataset;
use crate::lagrangian::system::TrajectoryTest as Span;
use crate::lagrangian::{EulerLagrange, FormulaConstraints, SystemInstance};
use crate::names::{number, pluralize};
use crate::network::NetworkLagrangian;
use crate::pipeline::constraint_figures::constraint_figures;
use crate::pipeline::judging::Judging;
use crate::pipeline::physics::{Physics, Subject};
use crate::pipeline::thresholds::{
    DRAWN_STARTS, EVALUATION_PIECES, FAST_VELOCITY, FRESH_STATES, GRID_POINTS, RTOL, STARTS,
};
use crate::pipeline::{PipelineError, Watch, memory};
use crate::random::RngStream;
use crate::report::{Figure, Fit, GridComparison, evaluation_figures, grid_figures, units};
use crate::rollout::{Domain, Trajectory};
use serde::Serialize;
use std::collections::BTreeMap;

/// Numbers of an evaluation, all in physical units.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Error of the accelerations of fresh states, one entry per coordinate.
    pub accelerations: Vec<ErrorDistribution>,
    /// Fraction of the fresh states whose mass matrix has a wrong signature.
    pub wrong_signature: f64,
    /// Error of the mass matrix. For geodesics, error of the metric at rest at the positions of the fresh states; under constraints, error
    /// at the fresh states within the directions that the constraints allow.
    pub mass_matrix: MassMatrixError,
    /// Time for which the learned motion predicts the exact one, median over the starts.
    pub(crate) valid_time: Option<ValidTimes>,
    /// One entry per random start.
    pub(crate) trajectories: Vec<Motion>,
    /// Curvature, symmetries, charges and signature.
    pub(crate) physics: Physics,
    /// If the evaluation was interrupted: in words, how many motions were completed out of all; pictures and physics may be missing then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interrupted: Option<String>,
    /// Names and units of the accelerations.
    #[serde(skip)]
    pub(crate) coordinates: Vec<String>,
    /// Units of the coordinates, each with the coordinates that have it.
    #[serde(skip)]
    pub(crate) units: Vec<(String, Vec<usize>)>,
    /// Time for which predictions were tested.
    #[serde(skip)]
    pub(crate) tested: f64,
    /// Unit of times.
    #[serde(skip)]
    pub(crate) time_unit: String,
    /// Name of the quantity that the exact motion conserves besides its energy.
    #[serde(skip)]
    pub(crate) conserved: Option<&'static str>,
    /// Pictures.
    #[serde(skip)]
    pub(crate) figures: Vec<Figure>,
}

/// One start of the trajectory test.
#[derive(Clone, Debug, Serialize)]
pub struct Motion {
    /// Errors against exact motion.
    #[serde(flatten)]
    pub summary: TrajectorySummary,
    /// Relative error of the quantity that the exact motion conserves besides its energy, if there is one.
    pub conserved_error: Option<Statistics>,
    /// The first sample at which the learned motion was outside the training states, in words.
    pub left_training_range: Option<String>,
}

impl Motion {
    fn of(run: &TrajectoryRun<f64>, system: &SystemInstance<f64>, trained: &Domain<f64>) -> Self {
        Self {
            summary: run.summary(),
            conserved_error: conserved_error(system, &run.learned.trajectory).map(statistics),
            left_training_range: leaving(&run.learned.trajectory, trained, &system.system.columns(system.coordinates)),
        }
    }
}

/// States and starts of an evaluation, and how the learned motion is integrated.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct EvaluationOptions {
    /// Fresh states `(states, n)`, `q` and `v`, on which accelerations are compared.
    pub states: (Vec<f64>, Vec<f64>),
    /// Random starts of the trajectory test.
    pub starts: usize,
    /// The bounds of the starts and the duration of the motions.
    pub span: Span,
    /// Relative tolerance of the learned motion; the absolute tolerance is a hundredth of it.
    pub rtol: f64,
    /// The states the model was trained on.
    pub trained: Domain<f64>,
    /// Constraints on the learned motion, as formulas by name; `None` for the constraints of the system, if it has any.
    pub constraints: Option<BTreeMap<String, String>>,
    /// Seed of the starts.
    pub seed: u64,
    /// Number of threads.
    pub threads: usize,
}

impl EvaluationOptions {
    /// The paper's trajectory test from four starts, and 12,000 fresh states of the validation bounds; one thread.
    ///
    /// # Errors
    /// [`PipelineError::Sampling`] for bounds that cannot be sampled.
    pub fn new(system: &SystemInstance<f64>, trained: Domain<f64>, seed: u64) -> Result<Self, PipelineError> {
        let bounds = system.system.validation(system.coordinates);
        let pairs = |bounds: &[(f64, f64)]| bounds.iter().map(|&(low, high)| [low, high]).collect::<Vec<_>>();
        let bounds = (pairs(&bounds.positions), pairs(&bounds.velocities));
        let mut random = RngStream::Test.generator(seed);
        let states = Dataset::sample(system, "validation bounds", (&bounds.0, &bounds.1), FRESH_STATES, &mut random)?;
        let states = (states.q().to_vec(), states.v().to_vec());
        let span = system.system.trajectory(system.coordinates);
        Ok(Self { states, starts: STARTS, span, rtol: RTOL, trained, constraints: None, seed, threads: 1 })
    }
}

impl Evaluation {
    /// Compares a model with the system it learned. Comparisons made before an interruption are kept: see [`Evaluation::interrupted`].
    ///
    /// # Errors
    /// A system that cannot be built, motions that do not fit into memory, [`PipelineError::Interrupted`] before anything was compared.
    pub fn of(
        system: &SystemInstance<f64>,
        network: &NetworkLagrangian<f64>,
        options: EvaluationOptions,
        watch: &Watch,
    ) -> Result<Self, PipelineError> {
        let judging = &Judging::new(watch, EVALUATION_PIECES);
        let (n, span) = (system.coordinates, &options.span);
        system.require_states()?;
        let exact = system.build()?;
        let learned = constrained(system, network, options.constraints.as_ref())?;
        let (exact, learned) = (judging.watched(exact.as_ref()), judging.watched(learned.as_ref()));
        let (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>) = (&exact, &learned);
        let motions = memory::motions((options.starts as u64).saturating_mul(2), span.t_end / span.dt, n, 0);
        memory::require("the evaluation", motions)?;
        let (q, v) = (options.states.0.as_slice(), options.states.1.as_slice());
        let accelerations = acceleration_errors(exact, learned, q, v);
        let wrong_signature = wrong_signatures(exact, learned, q, v);
        let mass_matrix = match exact.manifold() {
            None => MassMatrixError::of(exact, learned, q),
            Some(manifold) => mass_matrix_error_within(manifold, (exact, learned), (q, v)),
        };
        judging.check()?;
        judging.advance(1);
        let test = trajectory_test(system, &options);
        let mut runs = test.run_constrained(system, exact, learned)?;
        runs.retain(|run| !run.is_interrupted());
        judging.advance(1);
        let (portraits, figures) = pictures(system, (exact, learned), &test, &runs, &mass_matrix, judging)?;
        judging.advance(1);
        let subject = subject(system, network, &options, portraits.first());
        let is_free = exact.manifold().or(learned.manifold()).is_none();
        let (physics, is_interrupted) = physics(&subject, is_free, judging)?;
        judging.advance(1);
        let starts = || format!("{} of {}", runs.len(), pluralize(options.starts, "start", "starts"));
        let time_unit = system.system.time_unit.to_string();
        let coordinates = system.system.coordinates(n);
        Ok(Evaluation {
            accelerations,
            wrong_signature,
            mass_matrix,
            valid_time: ValidTimes::of(&runs.iter().map(|run| (run.valid, run.chaos())).collect::<Vec<_>>()),
            trajectories: runs.iter().map(|run| Motion::of(run, system, &options.trained)).collect(),
            physics,
            interrupted: is_interrupted.then(starts),
            coordinates: coordinates.iter().map(|c| format!("{} [{}/{time_unit}^2]", c.name, c.unit)).collect(),
            units: units(system),
            tested: span.t_end,
            time_unit,
            conserved: system.system.conserved.map(|conserved| conserved.name),
            figures,
        })
    }
}

/// Runs the trajectory test with these options.
fn trajectory_test(system: &SystemInstance<f64>, options: &EvaluationOptions) -> TrajectoryTest<f64> {
    let n = system.coordinates;
    let periodic = system.system.coordinates(n).iter().map(|c| c.periodic).collect();
    let Span { start, t_end, dt } = options.span.clone();
    let defaults = TrajectoryTest::new(StartBox { q: start.positions, v: start.velocities }, periodic);
    // The number of steps grows with the time and with the fifth root of the accuracy.
    let longer =
        (t_end / system.system.trajectory(n).t_end).max(1.0) * (defaults.rtol / options.rtol).max(1.0).powf(0.2);
    TrajectoryTest {
        starts: options.starts,
        seed: options.seed,
        t_end,
        dt,
        rtol: options.rtol,
        atol: 1e-2 * options.rtol,
        max_steps: (longer * defaults.max_steps as f64) as usize,
        lyapunov: true,
        threads: options.threads,
        ..defaults
    }
}

/// Returns the motions to draw, and pictures of motions and of learned functions; nothing after an interruption, which would leave them
/// incomplete.
fn pictures(
    system: &SystemInstance<f64>,
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    test: &TrajectoryTest<f64>,
    runs: &[TrajectoryRun<f64>],
    mass_matrix: &MassMatrixError,
    judging: &Judging<'_>,
) -> Result<(Vec<Portrait<f64>>, Vec<Figure>), PipelineError> {
    if judging.is_interrupted() {
        return Ok(Default::default());
    }
    let portraits = test.portraits(exact, learned, &runs[..runs.len().min(DRAWN_STARTS)]);
    let mut figures = evaluation_figures(runs, &portraits, system);
    if learned.manifold().is_some() {
        // There is no grid under constraints, because its points would violate them, where L has no meaning.
        let start = runs.iter().find(|run| !run.exact.trajectory.is_empty());
        let columns = system.system.columns(system.coordinates);
        let names = (&columns[..system.coordinates], system.system.time_unit.as_ref());
        let motion = start.map(|run| run.exact.trajectory.state(0));
        figures.extend(motion.into_iter().flat_map(|at| constraint_figures(learned, at, test.t_end, names)));
    } else {
        match grids(system, exact, learned, &mass_matrix.factors) {
            Err(_) if judging.is_interrupted() => {}
            drawn => figures.extend(drawn?),
        }
    }
    Ok(if judging.is_interrupted() { Default::default() } else { (portraits, figures) })
}

/// Collects the model and the data whose physics is analysed.
fn subject<'a>(
    system: &'a SystemInstance<f64>,
    network: &'a NetworkLagrangian<f64>,
    options: &'a EvaluationOptions,
    portrait: Option<&'a Portrait<f64>>,
) -> Subject<'a> {
    Subject {
        network,
        trained: &options.trained,
        system: Some(system),
        columns: system.system.columns(system.coordinates),
        labels: system.system.labels(system.coordinates),
        motion: portrait.map(|portrait| &portrait.learned),
        recorded: None,
        determined: None,
        threads: options.threads,
    }
}

/// Computes curvature, symmetries and signature; `true` if an interruption left some out.
fn physics(subject: &Subject<'_>, is_free: bool, judging: &Judging<'_>) -> Result<(Physics, bool), PipelineError> {
    let mut physics = if is_free { Physics::nothing(subject) } else { Physics::under_constraints(subject) };
    let found = if is_free { physics.find(subject, &|| judging.check()) } else { judging.check() };
    match found {
        Ok(()) => Ok((physics, false)),
        Err(PipelineError::Interrupted) => {
            physics.left_out.push("everything that is missing here: interrupted".to_string());
            Ok((physics, true))
        }
        Err(error) => Err(error),
    }
}

/// The learned motion under constraints: those given as formulas, or those of the system.
fn constrained<'a>(
    system: &SystemInstance<f64>,
    network: &'a NetworkLagrangian<f64>,
    constraints: Option<&BTreeMap<String, String>>,
) -> Result<Box<dyn EulerLagrange<f64> + 'a>, PipelineError> {
    let motion: Box<dyn EulerLagrange<f64> + 'a> = Box::new(network as &dyn EulerLagrange<f64>);
    match constraints {
        None => Ok(system.constrain(motion)?),
        Some(formulas) if formulas.is_empty() => Ok(motion),
        Some(formulas) => {
            let columns = system.system.columns(system.coordinates);
            let held = FormulaConstraints::new(&columns[..system.coordinates], formulas.clone());
            held.map_err(PipelineError::constraints)?.constrain(motion).map_err(PipelineError::constraints)
        }
    }
}

/// Describes the first sample outside the states that the model was trained on.
fn leaving(trajectory: &Trajectory<f64>, trained: &Domain<f64>, columns: &[String]) -> Option<String> {
    (0..trajectory.len()).find_map(|k| {
        let (q, v) = trajectory.state(k);
        let (component, ..) = trained.violation(&[q, v].concat())?;
        let name = columns.get(component).map_or("a component", String::as_str);
        Some(format!("{name} outside the training range at {:.1}", trajectory.t[k]))
    })
}

/// `L` and `det M`, the latter with the `factors` of the coordinates, at rest over the first two coordinates, or over coordinate and
/// velocity if there is only one; with more than one, `det M` also at velocities close to the upper end of the validation bounds, where
/// wrong signs appear first.
fn grids(
    system: &SystemInstance<f64>,
    exact: &dyn EulerLagrange<f64>,
    learned: &dyn EulerLagrange<f64>,
    factors: &[f64],
) -> Result<Vec<Figure>, PipelineError> {
    let n = system.coordinates;
    let ([rest, fast], axes) = grid_states(system)?;
    // L is -1/2 everywhere on a mass shell and would show nothing there. M is compared on the shell, where it was trained.
    let impose = |q: &[f64], v: &mut [f64]| system.impose_constraint(q, v).unwrap_or_else(|_| v.fill(f64::NAN));
    let lagrangian = |model: &dyn EulerLagrange<f64>| lagrangian_grid(model, &rest, axes);
    let determinant = |model: &dyn EulerLagrange<f64>, state: &[f64]| determinant_grid(model, state, axes, impose);
    // On a mass shell f(L) gives det M another factor.
    let determinant_fit = |[exact, learned]: [&Grid; 2]| match system.constrained_coordinate() {
        Some(_) => {
            let factor = nearest_factor(1, &exact.values, &learned.values);
            Fit::Factor(factor, format!("times its best factor {}", number(factor)))
        }
        None => determinant_factor(factors),
    };
    let labels = system.system.labels(n);
    let comparison = |[quantity, file, heading]: [&str; 3], fixed, [exact, learned]: [Grid; 2]| GridComparison {
        quantity: quantity.to_string(),
        heading: heading.to_string(),
        file: file.to_string(),
        x_label: labels[axes[0].component].clone(),
        y_label: labels[axes[1].component].clone(),
        fit: if quantity == "L" { Fit::Affine } else { determinant_fit([&exact, &learned]) },
        signs: quantity != "L",
        exact,
        learned,
        fixed,
    };
    let at_rest = if n > 1 { " at rest, \u{2212}V" } else { "" };
    let heading = format!("The Lagrangian{at_rest}: learned beside exact");
    let of_l = ["L", "lagrangian", &heading];
    let of_m = ["det M", "det_mass_matrix", "The determinant of the mass matrix: learned beside exact"];
    let of_fast = ["Fast det M", "det_mass_matrix_fast", "The determinant of the mass matrix at high velocities"];
    let mut all = vec![
        comparison(of_l, fixed(system, &rest, axes, false), [lagrangian(exact)?, lagrangian(learned)?]),
        comparison(of_m, fixed(system, &rest, axes, true), [determinant(exact, &rest)?, determinant(learned, &rest)?]),
    ];
    if n > 1 {
        let grids = [determinant(exact, &fast)?, determinant(learned, &fast)?];
        all.push(comparison(of_fast, fixed(system, &fast, axes, true), grids));
    }
    let units = match &*system.system.time_unit {
        "s" => " SI units.",
        "m" => " Geometric units.",
        _ => "",
    };
    // A model that is nowhere finite on the grid has no picture; the tables report this.
    let mut figures: Vec<Figure> = all.iter().flat_map(grid_figures).collect();
    figures.iter_mut().for_each(|figure| figure.caption += units);
    Ok(figures)
}

/// Where grids lie: the middle of the validation bounds at rest, and at high velocities, `q` before `v`; and the axes of the grids.
fn grid_states(system: &SystemInstance<f64>) -> Result<([Vec<f64>; 2], [Axis; 2]), PipelineError> {
    let n = system.coordinates;
    let bounds = system.system.validation(n);
    let middle: Vec<f64> = bounds.positions.iter().map(|(low, high)| 0.5 * (low + high)).collect();
    // At rest a total time derivative in the learned L vanishes: only a factor and a constant remain.
    let mut rest: Vec<f64> = bounds.velocities.iter().map(|(low, high)| 0.0f64.clamp(*low, *high)).collect();
    // On a mass shell the velocity of the time cannot vanish.
    system.impose_constraint(&middle, &mut rest)?;
    let fast = bounds.velocities.iter().map(|(_, high)| FAST_VELOCITY * high).collect();
    let ranges: Vec<(f64, f64)> = bounds.positions.into_iter().chain(bounds.velocities).collect();
    // A spacetime is shown over its spatial coordinates, if it has two.
    let shown = if system.system.time_like == Some(0) && n > 2 { [1, n - 1] } else { [0, 1] };
    let axes = shown.map(|component| Axis {
        component,
        from: ranges[component].0,
        to: ranges[component].1,
        points: GRID_POINTS,
    });
    Ok(([[middle.clone(), rest].concat(), [middle, fast].concat()], axes))
}

/// Computes the factor of `det M` from those of the coordinates.
fn determinant_factor(factors: &[f64]) -> Fit {
    let (product, first) = (factors.iter().product(), factors.first().copied().unwrap_or(1.0));
    let words = match factors.len() {
        1 => format!("times {}, the best factor of M", number(first)),
        n if factors.iter().all(|s| *s == first) => {
            format!("times {}, the best factor {} of M to the power {n}", number(product), number(first))
        }
        _ => {
            let all: Vec<String> = factors.iter().map(|s| number(*s)).collect();
            format!("times {}, the product of the best factors of M, {}", number(product), all.join(", "))
        }
    };
    Fit::Factor(product, words)
}

/// The components of `(q, v)` that a grid leaves fixed, in words, neighbours of equal value together; `imposed` if the
/// velocity of a time-like coordinate follows from the mass shell at every point.
fn fixed(system: &SystemInstance<f64>, state: &[f64], axes: [Axis; 2], imposed: bool) -> String {
    let n = system.coordinates;
    let (columns, units) = (system.system.columns(n), system.system.units(n));
    let shell = system.constrained_coordinate().filter(|_| imposed).map(|i| n + i);
    let mut groups: Vec<(Vec<&str>, String)> = Vec::new();
    for (k, &x) in state.iter().enumerate() {
        if axes.iter().any(|axis| axis.component == k) {
            continue;
        }
        let value = match shell {
            Some(shell) if shell == k => "by the mass shell".to_string(),
            // Rounds to four decimals; adding 0 turns -0 into 0.
            _ => format!("= {} {}", (1e4 * x).round() / 1e4 + 0.0, units[k]),
        };
        match groups.last_mut() {
            Some((names, of)) if *of == value => names.push(columns[k].as_str()),
            _ => groups.push((vec![columns[k].as_str()], value)),
        }
    }
    groups.iter().map(|(names, value)| format!("{} {value}", names.join(", "))).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Layout;
    use crate::pipeline::Event;
    use crate::presets::Preset;
    use crate::report::Report;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// An evaluation that a flag ends after this many of its pieces.
    fn ended_behind(pieces: usize) -> Result<Evaluation, PipelineError> {
        let system = SystemInstance::<f64>::named("harmonic-oscillator", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        config.network.hidden = vec![4];
        let architecture = config.architecture(&system, vec![1.0]).unwrap();
        // Only the term alpha |v|^2: its motion is that of a free particle.
        let weights = vec![0.0; Layout::new(&architecture).parameters];
        let network = NetworkLagrangian::new(architecture, weights).unwrap();
        let options = EvaluationOptions::new(&system, Domain::new(vec![None; 2]), 0).unwrap();
        let span = Span { t_end: 1.0, ..options.span };
        let states = (options.states.0[..50].to_vec(), options.states.1[..50].to_vec());
        let flag = Arc::new(AtomicBool::new(false));
        let raised = Arc::clone(&flag);
        let events = move |event: Event<'_>| {
            if matches!(event, Event::Judged { done, .. } if done == pieces && done > 0) {
                raised.store(true, Ordering::SeqCst);
            }
        };
        let watch = Watch { interrupt: flag, ..Watch::new(events) };
        Evaluation::of(&system, &network, EvaluationOptions { states, starts: 3, span, ..options }, &watch)
    }

    #[test]
    fn what_was_compared_before_an_interruption_is_kept() {
        let whole = ended_behind(0).unwrap();
        assert!(whole.interrupted.is_none() && whole.trajectories.len() == 3 && !whole.figures.is_empty());
        for (pieces, starts) in [(1, 0), (2, 3), (3, 3)] {
            let part = ended_behind(pieces).unwrap();
            let said = part.interrupted.as_deref().unwrap();
            assert!(said.starts_with(&format!("{starts} of 3")), "{said}");
            assert_eq!((part.trajectories.len(), part.figures.is_empty()), (starts, pieces < 3));
            assert_eq!(part.accelerations[0].median, whole.accelerations[0].median);
            assert_eq!(part.mass_matrix.factor, whole.mass_matrix.factor);
            assert!(part.trajectories.iter().all(|motion| motion.summary.stopped.is_none()));
            // The finished parts have their tables.
            let report = part.report(Report::new("part").findings(&part.headline("oscillator"))).to_html();
            assert!(report.contains("interrupted") && !part.findings("oscillator").parts().is_empty());
        }
    }

    #[test]
    fn a_determinant_has_the_factor_of_the_matrix_to_its_power() {
        let of = |factors: &[f64]| match determinant_factor(factors) {
            Fit::Factor(factor, words) => (factor, words),
            Fit::Affine => panic!("no factor"),
        };
        assert_eq!(of(&[-3.0; 3]), (-27.0, "times -27.0, the best factor -3.00 of M to the power 3".to_string()));
        assert_eq!(of(&[2.0]).0, 2.0);
        let apart = of(&[2.0, 0.5, 0.5]);
        assert!(apart.0 == 0.5 && apart.1.contains("2.00, 0.500, 0.500"), "{}", apart.1);
    }

    #[test]
    fn grids_say_where_they_are() {
        let captions = |name: &str| -> Vec<(String, String)> {
            let system = SystemInstance::<f64>::named(name, &[]).unwrap();
            let exact = system.build().unwrap();
            let figures = grids(&system, exact.as_ref(), exact.as_ref(), &vec![1.0; system.coordinates]).unwrap();
            figures.into_iter().map(|figure| (figure.file, figure.caption)).collect()
        };
        let begins = |captions: &[(String, String)], expected: &[(&str, &str)]| {
            assert_eq!(captions.len(), expected.len());
            for ((file, caption), (name, text)) in captions.iter().zip(expected) {
                assert!(file == name && caption.starts_with(text), "{file}: {caption}");
            }
        };
        let rest = "theta3 = 3.1416 rad; theta1_dot, theta2_dot, theta3_dot = 0 rad/s: exact";
        begins(
            &captions("triple-pendulum"),
            &[
                ("lagrangian.svg", &format!("L at {rest}")),
                ("det_mass_matrix.svg", &format!("det M at {rest}")),
                (
                    "det_mass_matrix_fast.svg",
                    "Fast det M at theta3 = 3.1416 rad; theta1_dot, theta2_dot, theta3_dot = 9.9 rad/s: exact",
                ),
            ],
        );
        begins(
            &captions("ads2-geodesic"),
            &[
                ("lagrangian.svg", "L at t_dot = 3.25 m/m; z_dot = 0 m/m: exact"),
                ("det_mass_matrix.svg", "det M at t_dot by the mass shell; z_dot = 0 m/m: exact"),
                ("det_mass_matrix_fast.svg", "Fast det M at t_dot by the mass shell; z_dot = 0.594 m/m: exact"),
            ],
        );
        // The velocity is an axis, so there is no map at high velocity.
        let one = captions("harmonic-oscillator");
        begins(&one, &[("lagrangian.svg", "L: exact"), ("det_mass_matrix.svg", "det M: exact")]);
        assert!(one[1].1.contains("right sign at every point") && !one[0].1.contains("sign"));
    }
}

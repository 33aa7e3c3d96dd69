//! What a model is worth: accelerations, trajectories and pictures against the hand-written system.

use crate::analysis::{
    AccelerationError, Axis, StartBox, TrajectoryRun, TrajectorySummary, TrajectoryTest, acceleration_errors,
    determinant_grid, lagrangian_grid, wrong_signatures,
};
use crate::cli::CliError;
use crate::lagrangian::{Configured, EulerLagrange};
use crate::report::{Figure, GridComparison, PlotError, Report, evaluation_figures, grid_figures, text_table};
use serde::Serialize;

/// Points of a grid along each axis.
const GRID: usize = 81;

/// Numbers of an evaluation, all in physical units.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Error of the accelerations of fresh states, one entry per coordinate.
    pub accelerations: Vec<AccelerationError>,
    /// Fraction of the fresh states whose mass matrix has not the signature of the exact one.
    pub wrong_signature: f64,
    /// One entry per random start.
    pub trajectories: Vec<TrajectorySummary>,
    /// Names of the accelerations' coordinates.
    #[serde(skip)]
    pub coordinates: Vec<String>,
    /// Unit of times.
    #[serde(skip)]
    pub time_unit: &'static str,
    /// Pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// How to evaluate.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// Fresh states `(states, n)` on which accelerations are compared.
    pub states: (&'a [f64], &'a [f64]),
    /// Random starts.
    pub starts: usize,
    /// Fraction of the trajectory test's time span.
    pub horizon: f64,
    /// Seed of the starts.
    pub seed: u64,
    /// Threads.
    pub threads: usize,
}

/// Compares a model with the system it learned.
///
/// # Errors
/// A data error if a picture cannot be drawn or the system cannot be built.
pub fn evaluate(
    system: &Configured<f64>,
    learned: &dyn EulerLagrange<f64>,
    plan: Plan<'_>,
) -> Result<Evaluation, CliError> {
    let n = system.coordinates;
    let exact = system.build().map_err(CliError::data)?;
    let coordinates = (system.system.coordinates)(n);
    let periodic: Vec<bool> = coordinates.iter().map(|c| c.periodic).collect();
    let accelerations = acceleration_errors(exact.as_ref(), learned, plan.states.0, plan.states.1);

    let test = (system.system.trajectory)(n);
    let bounds = StartBox { q: test.start.positions, v: test.start.velocities };
    let test = TrajectoryTest {
        starts: plan.starts,
        seed: plan.seed,
        t_end: test.t_end * plan.horizon,
        dt: test.dt,
        threads: plan.threads,
        ..TrajectoryTest::new(bounds, periodic.clone())
    };
    let runs = test.run_constrained(system, exact.as_ref(), learned).map_err(CliError::data)?;

    let columns = system.system.columns(n);
    let mut figures =
        evaluation_figures(&runs, &columns, &periodic, system.system.time_unit).map_err(CliError::data)?;
    figures.extend(grids(system, exact.as_ref(), learned)?);
    Ok(Evaluation {
        accelerations,
        wrong_signature: wrong_signatures(exact.as_ref(), learned, plan.states.0, plan.states.1),
        trajectories: runs.iter().map(TrajectoryRun::summary).collect(),
        coordinates: coordinates.iter().map(|c| c.name.to_string()).collect(),
        time_unit: system.system.time_unit,
        figures,
    })
}

/// `L` and `det M` at rest over the first two coordinates, or over coordinate and velocity if there is only one.
fn grids(
    system: &Configured<f64>,
    exact: &dyn EulerLagrange<f64>,
    learned: &dyn EulerLagrange<f64>,
) -> Result<Vec<Figure>, CliError> {
    let n = system.coordinates;
    let bounds = (system.system.validation)(n);
    let middle = bounds.positions.iter().map(|(low, high)| 0.5 * (low + high));
    // At rest a total time derivative in the learned L vanishes: what is left is a factor and a constant.
    let rest = bounds.velocities.iter().map(|(low, high)| 0.0f64.clamp(*low, *high));
    let (middle, mut rest): (Vec<f64>, Vec<f64>) = (middle.collect(), rest.collect());
    // A mass shell lets nothing rest in time.
    system.impose_constraint(&middle, &mut rest).map_err(CliError::data)?;
    let state = [middle, rest].concat();
    let ranges: Vec<(f64, f64)> = bounds.positions.into_iter().chain(bounds.velocities).collect();
    let columns = system.system.columns(n);
    let axes =
        [0, 1].map(|component| Axis { component, from: ranges[component].0, to: ranges[component].1, points: GRID });

    let mut figures = Vec::new();
    let pairs = [
        ("L", "lagrangian", lagrangian_grid(exact, &state, axes), lagrangian_grid(learned, &state, axes)),
        ("det M", "det_mass_matrix", determinant_grid(exact, &state, axes), determinant_grid(learned, &state, axes)),
    ];
    for (quantity, file, exact, learned) in pairs {
        let comparison = GridComparison {
            quantity: quantity.to_string(),
            file: file.to_string(),
            x_label: columns[0].clone(),
            y_label: columns[1].clone(),
            exact: exact.map_err(CliError::data)?,
            learned: learned.map_err(CliError::data)?,
            fit: true,
        };
        match grid_figures(&comparison) {
            Ok((figure, _)) => figures.push(figure),
            // A model that is finite nowhere on the grid has no picture; the tables say so.
            Err(PlotError::Empty(_)) => {}
            Err(error) => return Err(CliError::data(error)),
        }
    }
    Ok(figures)
}

/// A table of a report.
struct Table {
    title: &'static str,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Evaluation {
    fn tables(&self) -> [Table; 2] {
        let accelerations = self.coordinates.iter().zip(&self.accelerations).map(|(name, e)| {
            let numbers = [e.mean, e.rms, e.median, e.p99, e.max].map(|x| format!("{x:.4e}"));
            [vec![name.clone()], numbers.to_vec(), vec![e.failed.to_string()]].concat()
        });
        let trajectories = self.trajectories.iter().enumerate().map(|(k, t)| {
            let numbers = [t.coordinate_error.mean, t.coordinate_error.max, t.energy_error.mean, t.energy_error.max];
            let mut row = vec![(k + 1).to_string(), format!("{:.1}", t.compared_until)];
            row.extend(numbers.map(|x| format!("{x:.3e}")));
            row.push(t.stopped.clone().or(t.reference_stopped.clone()).unwrap_or_default());
            row
        });
        let header = |names: &[&str]| names.iter().map(ToString::to_string).collect();
        let until = format!("until [{}]", self.time_unit);
        [
            Table {
                title: "Error of accelerations on fresh states, physical units",
                header: header(&["coordinate", "mean", "rms", "median", "99 %", "max", "failed"]),
                rows: accelerations.collect(),
            },
            Table {
                title: "Trajectories from random starts against exact motion",
                header: header(&["start", &until, "coordinates mean", "max", "energy mean", "max", "ended by"]),
                rows: trajectories.collect(),
            },
        ]
    }

    /// Tables for a terminal.
    pub fn text(&self) -> String {
        let tables = self.tables();
        tables.iter().map(|t| format!("{}\n{}", t.title, text_table(&t.header, &t.rows))).collect::<Vec<_>>().join("\n")
    }

    /// Tables and pictures for a report.
    pub fn report(&self, mut report: Report) -> Report {
        for Table { title, header, rows } in self.tables() {
            report = report.heading(title).table(&header, &rows);
        }
        report = report.heading("Learned against exact");
        self.figures.iter().fold(report, |report, figure| report.figure(&figure.png, &figure.caption))
    }
}

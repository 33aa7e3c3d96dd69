//! The results for constants and sensors: values, standard errors, undetermined directions, and combinations that are determined nevertheless.

use super::advice::{Examiner, LinearDirections};
use super::bodies;
use super::determined::{Determined, echelon};
use super::fitted::Fitted;
use super::found::{Combination, Constant, Correlations, Identified, SensorConstant, Undetermined};
use super::invariants::{Invariant, Kind, unit_of, written};
use super::moves::{Group, Moves, nearest};
use super::smoothed::Quantity;
use super::solve::{Normal, Problem, Sensor, SensorKind};
use super::thresholds::{NO_DEPENDENCE, SUM_ROUNDING};
use crate::lagrangian::SystemInstance;
use crate::names::rounded;

/// Names and units of the unknowns.
struct Names<'a> {
    all: Vec<&'a str>,
    units: Vec<&'a str>,
}

/// Normal equations at other unknowns; `None` where they cannot be formed.
pub(super) type NormalAt<'a> = &'a dyn Fn(&[f64]) -> Option<Normal>;

/// The results for the constants and sensors of a fit; the caller adds the residuals. `normal_at` gives the normal equations at other unknowns.
pub(super) fn unknowns(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    fitted: &Fitted,
    (start, variance): (&[f64], f64),
    (quantity, normal_at): (Quantity, NormalAt<'_>),
) -> Identified {
    let m = fitted.x.len();
    let recording = problem.driven.recording;
    let before: Vec<f64> = start.iter().copied().chain(problem.sensors.iter().map(|sensor| sensor.perfect())).collect();
    // The list of determined sums then shows what is not determined.
    let is_linear = quantity == Quantity::Forces && problem.is_linear(&fitted.segments);
    let from = if is_linear { NO_DEPENDENCE } else { 1.0 };
    let determined = Determined::new(problem, (&fitted.x, &before), &fitted.normal, (variance, from));
    let parameter = |k: usize| &instance.system.parameters[problem.chosen[k]];
    let sensor_name = |sensor: &Sensor| {
        let coordinate = &recording.coordinates[sensor.coordinate];
        format!("{} of {coordinate}", kind(sensor.kind))
    };
    let sensors: Vec<String> = problem.sensors.iter().map(sensor_name).collect();
    let chosen = 0..problem.chosen.len();
    let names = Names {
        all: chosen.clone().map(|k| &*parameter(k).symbol).chain(sensors.iter().map(String::as_str)).collect(),
        units: chosen.map(|k| &*parameter(k).unit).chain(sensors.iter().map(|_| "")).collect(),
    };
    let bounds = instance.system.validation(instance.coordinates);
    let examiner = Examiner { problem, segments: &fitted.segments, coordinates: &recording.coordinates, bounds };
    let mut x = fitted.x.clone();
    let (undetermined, combinations) = match is_linear {
        true => {
            let changes = determined.changes();
            let columns: Vec<&[f64]> = changes.iter().map(Vec::as_slice).collect();
            nearest(&mut x, &before, &columns, &determined.size);
            let open = examiner.linear_directions(&x, (&changes, &determined.size));
            (linear_directions(&names, &open, &examiner.still()), base_parameters(&determined, &names, &x))
        }
        false => {
            let square = fitted.normal.square / fitted.normal.count.max(1.0);
            let moves = Moves { problem, determined: &determined, variance: square.max(f64::MIN_POSITIVE), normal_at };
            let groups = moves.groups(&x);
            x = moves.least_change(&x, &before, &groups);
            let mut open = without_effect(&determined, &names, |group| examiner.advise(&fitted.x, group));
            open.extend(groups.iter().map(|group| described(&determined, &names, (&fitted.x, group), &examiner)));
            (open, Vec::new())
        }
    };
    let bodies = bodies::physical(instance, problem, &determined, &mut x);
    let errors = determined.errors();
    let constants = start.iter().enumerate().map(|(k, &start)| Constant {
        symbol: names.all[k].to_string(),
        value: x[k],
        standard_error: errors[k].filter(|_| !fitted.normal.held[k]),
        unit: names.units[k].to_string(),
        start,
        at_bound: fitted.normal.held[k],
    });
    let sensors = problem.sensors.iter().zip(start.len()..).map(|(sensor, k)| SensorConstant {
        kind: kind(sensor.kind),
        coordinate: recording.coordinates[sensor.coordinate].clone(),
        value: x[k],
        standard_error: errors[k],
    });
    let correlation = |i: usize, j: usize| match (errors[i], errors[j]) {
        _ if i == j => 1.0,
        (Some(a), Some(b)) if a * b > 0.0 => determined.covariance[i * m + j] / (a * b),
        _ => 0.0,
    };
    let (constants, sensors): (Vec<_>, Vec<_>) = (constants.collect(), sensors.collect());
    let named = constants.iter().map(|constant| constant.symbol.clone());
    let correlations = Correlations {
        names: named.chain(sensors.iter().map(SensorConstant::name)).collect(),
        matrix: (0..m).map(|i| (0..m).map(|j| correlation(i, j)).collect()).collect(),
    };
    Identified { constants, sensors, correlations, undetermined, combinations, bodies, ..Identified::default() }
}

/// The name of a sensor constant.
fn kind(kind: SensorKind) -> &'static str {
    match kind {
        SensorKind::Offset => "offset",
        SensorKind::Gain => "gain",
        SensorKind::Delay => "delay",
    }
}

/// Names joined for a sentence.
fn listed(names: &[String]) -> String {
    match names.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}

impl Names<'_> {
    /// The names of some unknowns.
    fn of(&self, places: &[usize]) -> Vec<String> {
        places.iter().map(|&k| self.all[k].to_string()).collect()
    }

    /// An invariant with its value and standard error at `x`.
    fn combination(&self, determined: &Determined, invariant: &Invariant, x: &[f64]) -> Combination {
        let terms = invariant.terms(&self.all);
        let occurs = |k: &usize| invariant.factors[*k] != 0.0;
        let parts = (0..self.all.len()).filter(occurs).map(|k| (self.units[k], invariant.factors[k]));
        let parts: Vec<(&str, f64)> = parts.collect();
        let unit = match invariant.kind {
            Kind::Sum => parts.first().map_or("", |(unit, _)| unit).to_string(),
            Kind::Product => unit_of(&parts),
        };
        Combination {
            name: written(invariant.kind, &terms),
            product: invariant.kind == Kind::Product,
            value: invariant.value(x),
            standard_error: determined.error_of(&invariant.gradient(x)),
            unit,
            terms,
        }
    }
}

/// Describes the constants without a visible effect.
fn without_effect(
    determined: &Determined,
    names: &Names<'_>,
    advice: impl Fn(&Group<'_>) -> String,
) -> Vec<Undetermined> {
    let m = determined.size.len();
    let of = |&k: &usize| {
        let alone = (0..m).map(|j| if j == k { determined.size[k] } else { 0.0 }).collect();
        let columns = echelon(vec![alone], &determined.size);
        let group = Group::without_invariants(columns.iter().collect());
        let relative_error = determined.relative_error(&columns[0].change);
        let text = format!("{} is not determined{}", names.all[k], error_in_words(relative_error));
        let (constants, directions) = (names.of(&[k]), vec![vec![1.0]]);
        Undetermined { constants, directions, known: Vec::new(), relative_error, text, advice: advice(&group) }
    };
    determined.without_effect.iter().map(of).collect()
}

/// The relative error as the end of a sentence.
fn error_in_words(relative_error: Option<f64>) -> String {
    relative_error.map(|error| format!(", relative error {error:.1}")).unwrap_or_default()
}

/// Describes a group of open directions.
fn described(
    determined: &Determined,
    names: &Names<'_>,
    (x, group): (&[f64], &Group<'_>),
    examiner: &Examiner<'_>,
) -> Undetermined {
    let constants = names.of(&group.inside);
    let known: Vec<Combination> =
        group.invariants.iter().map(|invariant| names.combination(determined, invariant, x)).collect();
    let relative = |change: &[f64]| group.inside.iter().map(|&k| change[k] / determined.size[k]).collect::<Vec<f64>>();
    let directions: Vec<Vec<f64>> = group.columns.iter().map(|column| relative(&column.change)).collect();
    let errors: Option<Vec<f64>> =
        group.columns.iter().map(|column| determined.relative_error(&column.change)).collect();
    let relative_error = errors.map(|errors| errors.into_iter().fold(0.0, f64::max));
    let error = error_in_words(relative_error);
    let all = listed(&constants);
    let known_names: Vec<&str> = known.iter().map(|known| known.name.as_str()).collect();
    let numbers = || {
        let of = |direction: &Vec<f64>| {
            let parts = constants.iter().zip(direction).filter(|(_, part)| **part != 0.0);
            parts.map(|(name, part)| format!("{name} by {}", rounded(*part, 3))).collect::<Vec<_>>().join(", ")
        };
        directions.iter().map(of).collect::<Vec<_>>().join("; or ")
    };
    let text = match (group.inside.len(), known.is_empty(), group.is_complete()) {
        (1, ..) => format!("{all} is not determined{error}"),
        (_, false, true) => format!("{all} cannot be separated{error}; determined: {}", known_names.join(", ")),
        (_, true, _) => format!(
            "{all} cannot be separated{error}; they can change together, relative to their sizes: {}",
            numbers()
        ),
        (_, false, false) => format!(
            "{all} cannot be separated{error}; determined: {}; they can change together, relative to their sizes: {}",
            known_names.join(", "),
            numbers()
        ),
    };
    Undetermined { constants, directions, known, relative_error, text, advice: examiner.advise(x, group) }
}

/// Describes the open directions of equations that are linear in the constants.
fn linear_directions(names: &Names<'_>, open: &LinearDirections, still: &[String]) -> Vec<Undetermined> {
    let record = match still {
        [] => "record larger or faster motion, or move other joints".to_string(),
        [single] => format!("record motion of {single}, which stands still, or larger or faster motion"),
        many => format!("record motion of {}, which stand still, or larger or faster motion", listed(many)),
    };
    let none = "no motion can separate them, because the forces depend only on their sums".to_string();
    let describe = |(changes, text, advice): (&Vec<Vec<f64>>, &str, String)| {
        let inside = |k: &usize| changes.iter().any(|change| change[*k] != 0.0);
        let constants = names.of(&(0..names.all.len()).filter(inside).collect::<Vec<_>>());
        let text = format!("{} {text}", listed(&constants));
        Undetermined { constants, directions: Vec::new(), known: Vec::new(), relative_error: None, text, advice }
    };
    let all = [
        (&open.without_effect, "do not affect the forces of any motion", "fix them at known values".to_string()),
        (&open.inseparable, "occur in the equations only in sums", none),
        (&open.undetermined, "cannot be separated by this motion", record),
    ];
    all.into_iter().filter(|(changes, ..)| !changes.is_empty()).map(describe).collect()
}

/// Sums of constants that determine the forces: the base parameters of a robot (Khalil and Dombre, "Modeling, Identification and Control of
/// Robots", 2002). Every open change of the constants removes one of them from the list and adds it to the sums of others. Constants with short
/// names are removed first, so that masses are added to moments.
fn base_parameters(determined: &Determined, names: &Names<'_>, x: &[f64]) -> Vec<Combination> {
    let m = x.len();
    let effect: Vec<f64> = determined.effect.iter().map(|effect| if *effect > 0.0 { *effect } else { 1.0 }).collect();
    let size = |row: &[f64], k: usize| row[k].abs() * effect[k];
    let mut open = determined.changes();
    let mut done: Vec<(usize, Vec<f64>)> = Vec::new();
    let mut order: Vec<usize> = (0..m).rev().collect();
    order.sort_by_key(|&k| names.all[k].len());
    for k in order {
        let most = (0..open.len()).max_by(|&a, &b| size(&open[a], k).total_cmp(&size(&open[b], k)));
        let Some(at) = most else { break };
        let largest = (0..m).map(|j| size(&open[at], j)).fold(0.0, f64::max);
        if size(&open[at], k) < SUM_ROUNDING * largest {
            continue;
        }
        let mut row = open.swap_remove(at);
        let pivot = row[k];
        row.iter_mut().for_each(|x| *x /= pivot);
        for other in open.iter_mut().chain(done.iter_mut().map(|(_, other)| other)) {
            let factor = other[k];
            other.iter_mut().zip(&row).for_each(|(x, own)| *x -= factor * own);
        }
        done.push((k, row));
    }
    let kept = (0..m).filter(|k| done.iter().all(|(removed, _)| removed != k));
    let sum = |k: usize| {
        let mut factors = vec![0.0; m];
        factors[k] = 1.0;
        for (removed, row) in done.iter().filter(|(removed, row)| size(row, k) > SUM_ROUNDING * size(row, *removed)) {
            factors[*removed] = -row[k];
        }
        let mut found = names.combination(determined, &Invariant { kind: Kind::Sum, factors }, x);
        // Its unknown comes first.
        found.terms.sort_by_key(|(name, _)| *name != names.all[k]);
        Combination { name: written(Kind::Sum, &found.terms), unit: names.units[k].to_string(), ..found }
    };
    kept.map(sum).collect()
}

//! Chooses the interpolation of known forces between the samples, and widens the standard errors if several interpolations fit equally well.

use super::fitted::{Fitted, refit};
use super::found::Identified;
use super::solve::Problem;
use super::thresholds::{EQUAL_FIT_INCREASE, FEW_START_ROUNDS, ITERATIONS, RIVAL_DIFFERENCE};
use super::{Between, IdentifyOptions};

/// Interpolations that the motion does not exclude, the best first.
#[derive(Default)]
pub(super) struct Rivals {
    interpolations: Vec<Between>,
    /// Largest change of every unknown if another of them is used.
    largest_change: Vec<f64>,
}

impl Rivals {
    /// All interpolations, if the options do not choose one.
    pub fn all(options: &IdentifyOptions, forced: bool) -> Self {
        let open = forced && options.between.is_none();
        Self { interpolations: if open { Between::ALL.to_vec() } else { Vec::new() }, largest_change: Vec::new() }
    }
}

/// Fits the motion with every interpolation; returns the best fit, and the interpolations that it does not exclude.
pub(super) fn best_interpolation(problem: &mut Problem<'_>, fitted: Fitted, rivals: &Rivals) -> (Fitted, Rivals) {
    if rivals.interpolations.is_empty() {
        return (fitted, Rivals::default());
    }
    let mut best = 0;
    let first = problem.driven.between;
    let mut tried = vec![(first, fitted)];
    for between in rivals.interpolations.iter().copied().filter(|other| *other != first) {
        problem.driven.between = between;
        let mut own = tried[best].1.clone();
        problem.fit_starts(&own.x, &mut own.segments, FEW_START_ROUNDS);
        refit(problem, &mut own, ITERATIONS);
        tracing::debug!(?between, square = own.normal.square, "forces");
        if own.normal.square < tried[best].1.normal.square {
            best = tried.len();
        }
        tried.push((between, own));
    }
    let (between, fitted) = tried.swap_remove(best);
    problem.driven.between = between;
    let limit =
        fitted.normal.square + EQUAL_FIT_INCREASE * (fitted.normal.square / fitted.normal.count.max(1.0)).max(1.0);
    let mut rivals = Rivals { interpolations: vec![between], largest_change: vec![0.0; fitted.x.len()] };
    for (between, own) in tried.iter().filter(|(_, own)| own.normal.failed == 0 && own.normal.square < limit) {
        rivals.interpolations.push(*between);
        let changes = own.x.iter().zip(&fitted.x).map(|(own, best)| (own - best).abs());
        rivals.largest_change.iter_mut().zip(changes).for_each(|(most, change)| *most = most.max(change));
    }
    (fitted, rivals)
}

impl Rivals {
    /// Adds the differences between interpolations to the standard errors, and reports the unknowns whose errors at least double.
    pub fn widen(&self, found: &mut Identified) {
        let names = found.constants.iter().map(|c| c.symbol.clone());
        let names: Vec<String> =
            names.chain(found.sensors.iter().map(|s| format!("{} of {}", s.kind, s.coordinate))).collect();
        let errors = found.constants.iter_mut().map(|c| &mut c.standard_error);
        let errors = errors.chain(found.sensors.iter_mut().map(|s| &mut s.standard_error));
        let mut doubled = Vec::new();
        for ((error, change), name) in errors.zip(&self.largest_change).zip(names) {
            if let Some(error) = error {
                if *change > RIVAL_DIFFERENCE * *error {
                    doubled.push(name);
                }
                *error = error.hypot(*change);
            }
        }
        if !doubled.is_empty() {
            let all: Vec<&str> = self.interpolations.iter().map(|between| between.name()).collect();
            let (all, names) = (all.join(", "), doubled.join(", "));
            found.obstacles.push(format!(
                "these interpolations of the forces fit equally well: {all}; the standard errors of {names} include the difference"
            ));
        }
    }
}

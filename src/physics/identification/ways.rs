//! Interpolation of known forces between the samples: the one that fits the motion best, and how the unknowns differ for others that fit as
//! well.

use super::found::Identified;
use super::solve::Problem;
use super::stages::{Fitted, refit};
use super::thresholds::{FEW_START_ROUNDS, ITERATIONS, RIVAL_DIFFERENCE, RIVAL_INCREASE};
use super::{Between, IdentifyOptions};

/// Interpolations that the motion does not exclude, the best first, and the largest difference of the unknowns for one of the others.
#[derive(Default)]
pub(super) struct Rivals {
    ways: Vec<Between>,
    farthest: Vec<f64>,
}

impl Rivals {
    /// All interpolations of forces, if the options leave the choice open.
    pub fn all(options: &IdentifyOptions, forced: bool) -> Self {
        let open = forced && options.between.is_none();
        Self { ways: if open { Between::ALL.to_vec() } else { Vec::new() }, farthest: Vec::new() }
    }
}

/// The fit with that one of the interpolations that fits the motion best, and those that it does not exclude.
pub(super) fn best_between(problem: &mut Problem<'_>, fitted: Fitted, rivals: &Rivals) -> (Fitted, Rivals) {
    if rivals.ways.is_empty() {
        return (fitted, Rivals::default());
    }
    let mut best = 0;
    let first = problem.course.between;
    let mut tried = vec![(first, fitted)];
    for between in rivals.ways.iter().copied().filter(|way| *way != first) {
        problem.course.between = between;
        let mut own = tried[best].1.clone();
        problem.settle(&own.x, &mut own.segments, FEW_START_ROUNDS);
        refit(problem, &mut own, ITERATIONS);
        tracing::debug!(?between, square = own.normal.square, "forces");
        if own.normal.square < tried[best].1.normal.square {
            best = tried.len();
        }
        tried.push((between, own));
    }
    let (between, fitted) = tried.swap_remove(best);
    problem.course.between = between;
    let limit = fitted.normal.square + RIVAL_INCREASE * (fitted.normal.square / fitted.normal.count.max(1.0)).max(1.0);
    let mut rivals = Rivals { ways: vec![between], farthest: vec![0.0; fitted.x.len()] };
    for (between, own) in tried.iter().filter(|(_, own)| own.normal.failed == 0 && own.normal.square < limit) {
        rivals.ways.push(*between);
        let off = own.x.iter().zip(&fitted.x).map(|(own, best)| (own - best).abs());
        rivals.farthest.iter_mut().zip(off).for_each(|(most, off)| *most = most.max(off));
    }
    (fitted, rivals)
}

impl Rivals {
    /// Widens the standard errors of unknowns that differ between interpolations, and reports those that at least double.
    pub fn widen(&self, found: &mut Identified) {
        let names = found.constants.iter().map(|c| c.symbol.clone());
        let names: Vec<String> =
            names.chain(found.sensors.iter().map(|s| format!("{} of {}", s.kind, s.coordinate))).collect();
        let errors = found.constants.iter_mut().map(|c| &mut c.standard_error);
        let errors = errors.chain(found.sensors.iter_mut().map(|s| &mut s.standard_error));
        let mut doubled = Vec::new();
        for ((error, off), name) in errors.zip(&self.farthest).zip(names) {
            if let Some(error) = error {
                if *off > RIVAL_DIFFERENCE * *error {
                    doubled.push(name);
                }
                *error = error.hypot(*off);
            }
        }
        if !doubled.is_empty() {
            let ways: Vec<&str> = self.ways.iter().map(|way| way.name()).collect();
            let (ways, names) = (ways.join(", "), doubled.join(", "));
            found.obstacles.push(format!(
                "forces between the samples may be {ways}: the standard errors of {names} include the difference"
            ));
        }
    }
}

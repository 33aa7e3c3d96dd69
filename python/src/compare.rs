//! Two Lagrangians beside each other, and the surfaces of a metric.

use crate::attend::left;
use crate::errors::{runtime, value};
use crate::readings::shown;
use crate::subject::{Subject, degrees_of};
use lnn::geometry::{Change, Surface};
use lnn::lagrangian::Interruptible;
use lnn::symmetry::{Basis, Comparison, ComparisonSummary, enough, most_states, unknowns};
use pyo3::prelude::*;

/// What two Lagrangians of the same coordinates have in common beyond factor and gauge, as JSON.
#[pyfunction]
pub fn compare_lagrangians(
    py: Python<'_>,
    first: &Bound<'_, Subject>,
    second: &Bound<'_, Subject>,
    region: Vec<(String, f64, f64)>,
    degrees: Option<&str>,
    points: Option<usize>,
    seed: u64,
) -> PyResult<String> {
    let (a, b) = (first.get(), second.get());
    a.require_free()?;
    b.require_free()?;
    let n = a.columns.len() / 2;
    let [own, others] = [a, b].map(|subject| subject.columns[..subject.columns.len() / 2].join(","));
    if a.columns.len() != b.columns.len() {
        return Err(value(format_args!("expected Lagrangians with the same coordinates, found {own} and {others}")));
    }
    let both = a.interest().meet(&b.interest()).map_err(|column| {
        value(format_args!("region: the ranges of {} do not overlap; choose one", a.columns[column]))
    })?;
    let region = a.region(both, region)?;
    let charts = a.charts(&region);
    let names = &a.columns[..n];
    let degrees = degrees.map(degrees_of).transpose()?;
    let basis = Basis::within(names, &charts, degrees);
    let (basis, _) = basis.map_err(|problem| value(format_args!("basis: {problem}")))?;
    let most = most_states(n, unknowns(n, basis.len()));
    let points = points.unwrap_or(enough(basis.len(), a.is_exact())).min(most);
    let names = [a, b].map(|subject| subject.name().to_string());
    let (first, second) = (first.clone().unbind(), second.clone().unbind());
    let comparison = left(py, move |watch| {
        let (a, b) = (first.get(), second.get());
        let (q, v) = a.sampled_beside(b, &region, points, seed)?;
        let [a, b] = [a, b].map(|subject| Interruptible::new(subject.moving(), &watch.interrupt));
        Comparison::of(&a, &b, &basis, (&q, &v)).map_err(runtime)
    })??;
    let [first, second] = names;
    let summary = ComparisonSummary { first, second, comparison, points, seed };
    shown(&summary, &summary.findings())
}

/// Where the determinant of a block of the metric changes its sign on a line: points, and whether it is a zero there or a pole.
#[pyfunction(name = "surfaces")]
pub fn surfaces_of_metric(
    subject: &Subject,
    block: Vec<usize>,
    ends: (Vec<f64>, Vec<f64>),
    velocity: Vec<f64>,
    steps: usize,
) -> PyResult<Vec<(Vec<f64>, &'static str)>> {
    subject.require_free()?;
    let found = Surface::find(subject.moving(), &block, (&ends.0, &ends.1), &velocity, steps).map_err(value)?;
    let word = |change| match change {
        Change::Zero => "zero",
        Change::Pole => "pole",
    };
    Ok(found.into_iter().map(|surface| (surface.point, word(surface.change))).collect())
}

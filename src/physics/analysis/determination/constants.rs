//! Ranges of the learned constants of a known part, from the residuals of recorded positions.
//!
//! One Gauss-Newton step from the fit: the positions of the training trajectories, cut into stretches, are predicted from the best start of
//! each. The residuals depend on the constants, on the starts, which are eliminated, and on the weights of the network and the friction. An
//! effect that network and constants share is not determined: a weight may differ from the learned one by the typical size of its kind.
//! The error of the step is found as for all ranges, see the [module](super).

use super::Estimate;
use super::posterior::{Sums, groups, jackknife};
use crate::analysis::thresholds::{
    CONSTANT_SAMPLES, CONSTANT_STRETCH, EXAMINED_WEIGHTS, INDEPENDENT_COLUMN, LEAST_CONSTANT_STRETCH, PARAMETER_STEP,
    START_CORRECTIONS,
};
use crate::configuration::Penalty;
use crate::data::{RecordingSplit, StateEstimate};
use crate::linalg::dot;
use crate::network::{Architecture, Layout, NetworkLagrangian};
use crate::recording::RecordedTrajectory;
use crate::shooting::{Curvature, Segments, ShootingObjective};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;

/// Values and ranges of the learned constants of the known part of a network, by name; `None` where no range can be given, and empty if no
/// constants are learned.
pub fn constants(
    network: &NetworkLagrangian<f64>,
    measured: &RecordingSplit,
    threads: usize,
) -> Option<BTreeMap<String, Estimate>> {
    let architecture = network.architecture();
    let layout = Layout::new(architecture);
    if layout.known.is_empty() {
        return Some(BTreeMap::new());
    }
    let weights = network.weights();
    let columns = columns(&layout, weights);
    let stretches = Stretches::new(architecture, weights, measured, threads)?;
    let (parts, rows) = stretches.parts(weights, &columns)?;
    let sums = Sums::of(&parts);
    let trust = sums.trust(rows);
    let (mean, covariance, without) = (sums.solve(trust)?, sums.covariance(trust)?, sums.without(&parts, trust)?);
    let count = columns.len();
    let at = |theta: &[f64]| {
        let mut shifted = weights.to_vec();
        shifted[layout.known.clone()].copy_from_slice(theta);
        architecture.known_constants(&shifted)
    };
    let theta = &weights[layout.known.clone()];
    let [mut low, mut high] = [theta.to_vec(), theta.to_vec()];
    for (k, (low, high)) in low.iter_mut().zip(&mut high).enumerate() {
        let believed: f64 = covariance[k * count..(k + 1) * count].iter().map(|c| c * c).sum();
        let deviation = (believed + jackknife(mean[k], without.iter().map(|x| x[k]))).sqrt();
        let scale = columns[k].1;
        let range = Estimate::about(*low, scale * mean[k], scale * deviation);
        (*low, *high) = (range.low, range.high);
    }
    let (value, low, high) = (at(theta), at(&low), at(&high));
    let learned = architecture.form.known.iter().flat_map(|known| &known.parameters).filter(|(_, p)| p.learn);
    let ranges =
        learned.map(|(name, _)| (name.clone(), Estimate { value: value[name], low: low[name], high: high[name] }));
    let ranges: BTreeMap<_, _> = ranges.collect();
    ranges.values().all(|e| e.low.is_finite() && e.high.is_finite()).then_some(ranges)
}

/// Parameters that the residuals are differentiated by, each with its usual size: the constants first, then the weights of the
/// outputs of the network and of the friction.
fn columns(layout: &Layout, weights: &[f64]) -> Vec<(usize, f64)> {
    let mut columns: Vec<(usize, f64)> = layout.known.clone().map(|k| (k, weights[k].abs().max(1.0))).collect();
    let outputs = layout.branches.iter().filter_map(|branch| branch.layers.last());
    let outputs = outputs.map(|layer| layer.weight_range().chain(layer.bias_range()).collect::<Vec<_>>());
    let friction = layout.dissipation.iter().map(|dissipation| dissipation.gamma_range().collect());
    let joints = (!layout.joint_friction.is_empty()).then(|| layout.joint_friction.clone().collect());
    for kind in outputs.chain(friction).chain(joints) {
        let size = (kind.iter().map(|&k| weights[k] * weights[k]).sum::<f64>() / kind.len() as f64).sqrt();
        let stride = kind.len().div_ceil(EXAMINED_WEIGHTS).max(1);
        columns.extend(kind.into_iter().step_by(stride).filter(|_| size > 0.0).map(|k| (k, size)));
    }
    columns
}

/// Stretches of the training trajectories with their best starts.
struct Stretches {
    segments: Segments<f64>,
    starts: Vec<f64>,
    rows: Vec<u32>,
    n: usize,
    objective: RefCell<ShootingObjective<f64>>,
}

impl Stretches {
    fn new(architecture: &Architecture, weights: &[f64], measured: &RecordingSplit, threads: usize) -> Option<Self> {
        let n = architecture.coordinates;
        let pairs = measured.training.recording.tracks.iter().zip(&measured.training.states);
        let pieces: Vec<_> = pairs
            .flat_map(|(track, states)| {
                let ends = (0..track.len())
                    .step_by(CONSTANT_STRETCH)
                    .map(|first| first..(first + CONSTANT_STRETCH).min(track.len()));
                ends.filter(|rows| rows.len() >= LEAST_CONSTANT_STRETCH).map(move |rows| (track, states, rows))
            })
            .collect();
        let stride = (pieces.len() * CONSTANT_STRETCH).div_ceil(CONSTANT_SAMPLES).max(1);
        let pieces: Vec<_> = pieces.into_iter().step_by(stride).collect();
        let cut = |(track, _, rows): &(&RecordedTrajectory, _, Range<usize>)| {
            let of = |values: &[f64]| values.get(rows.start * n..rows.end * n).unwrap_or_default().to_vec();
            let (times, name) = (track.times[rows.clone()].to_vec(), track.name.clone());
            RecordedTrajectory { name, times, q: of(&track.q), v: of(&track.v), a: Vec::new(), force: of(&track.force) }
        };
        let tracks: Vec<RecordedTrajectory> = pieces.iter().map(cut).collect();
        let estimated = tracks.iter().zip(&pieces).map(|(track, (_, states, rows))| {
            let rows = rows.start * n..rows.end * n;
            StateEstimate { track, q: &states.q[rows.clone()], v: &states.v[rows], between: measured.training.between }
        });
        let estimated: Vec<StateEstimate<'_>> = estimated.collect();
        let segments = Segments::new(architecture, &estimated, &measured.noise(), CONSTANT_STRETCH, CONSTANT_STRETCH);
        let mut objective = ShootingObjective::new(architecture, Penalty::None, (0.0, f64::INFINITY), threads).ok()?;
        let mut starts = segments.starts().to_vec();
        let mut curvature = Curvature::default();
        for _ in 0..START_CORRECTIONS {
            objective.refine(weights, &segments, &mut starts, &mut curvature, 1.0);
        }
        let rows = (0..segments.len() as u32).collect();
        Some(Self { segments, starts, rows, n, objective: objective.into() })
    }

    fn residuals(&self, weights: &[f64], starts: &[f64]) -> Vec<f64> {
        self.objective.borrow_mut().residuals(weights, &self.segments, starts, &self.rows)
    }

    /// Normal equations of groups of stretches with the starts eliminated, and the number of residuals that remain.
    fn parts(&self, weights: &[f64], columns: &[(usize, f64)]) -> Option<(Vec<Sums>, usize)> {
        let base = self.residuals(weights, &self.starts);
        let width = 2 * self.n;
        let by_start: Vec<Vec<f64>> = (0..width)
            .map(|k| {
                let by = PARAMETER_STEP.sqrt() * self.segments.tolerance(k);
                let shifted = self.starts.iter().enumerate().map(|(at, x)| if at % width == k { x + by } else { *x });
                self.residuals(weights, &shifted.collect::<Vec<_>>())
            })
            .map(|shifted| shifted.iter().zip(&base).map(|(a, b)| a - b).collect())
            .collect();
        let by_parameter: Vec<Vec<f64>> = columns
            .iter()
            .map(|&(k, size)| {
                let shifted = |by: f64| {
                    let mut shifted = weights.to_vec();
                    shifted[k] += by;
                    self.residuals(&shifted, &self.starts)
                };
                let by = PARAMETER_STEP * size;
                // The column has the sign of the residuals, measured minus predicted, which a change of the parameters has to explain.
                shifted(by).iter().zip(shifted(-by)).map(|(up, down)| (down - up) * (0.5 / PARAMETER_STEP)).collect()
            })
            .collect();
        let mut ends = Vec::with_capacity(self.rows.len());
        for &row in &self.rows {
            ends.push(ends.last().copied().unwrap_or(0) + self.segments.residuals(row as usize));
        }
        let one = |k: usize| {
            let rows = if k == 0 { 0 } else { ends[k - 1] }..ends[k];
            let starts: Vec<Vec<f64>> = by_start.iter().map(|column| column[rows.clone()].to_vec()).collect();
            let starts = orthonormal(starts);
            let all = by_parameter.iter().chain([&base]);
            let mut left: Vec<Vec<f64>> = all.map(|column| column[rows.clone()].to_vec()).collect();
            left.iter_mut().for_each(|column| eliminate(&starts, column));
            left
        };
        let usable: Vec<Vec<Vec<f64>>> =
            (0..ends.len()).map(one).filter(|part| part.iter().flatten().all(|x| x.is_finite())).collect();
        let groups = groups(usable.len(), 1)?;
        let residuals = usable.iter().map(|part| part[0].len() - width.min(part[0].len())).sum();
        let part = |group: Range<usize>| {
            let (mut rows, mut missed) = (Vec::new(), Vec::new());
            for columns in &usable[group] {
                let (base, columns) = columns.split_last().expect("the residuals themselves");
                missed.extend_from_slice(base);
                (0..base.len()).for_each(|row| rows.extend(columns.iter().map(|column| column[row])));
            }
            Sums::new(&rows, &missed)
        };
        Some((groups.into_iter().map(part).collect(), residuals))
    }
}

/// Orthonormal columns with the same span; columns that add nothing to it are left out.
fn orthonormal(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = Vec::new();
    for mut column in columns {
        let before = dot(&column, &column).sqrt();
        (0..2).for_each(|_| eliminate(&all, &mut column));
        let norm = dot(&column, &column).sqrt();
        if norm > INDEPENDENT_COLUMN * before {
            column.iter_mut().for_each(|x| *x /= norm);
            all.push(column);
        }
    }
    all
}

/// Takes the part along orthonormal columns out of a column.
fn eliminate(along: &[Vec<f64>], column: &mut [f64]) {
    for direction in along {
        let part = dot(direction, column);
        column.iter_mut().zip(direction).for_each(|(x, d)| *x -= part * d);
    }
}

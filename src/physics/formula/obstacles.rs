//! Recordings that do not determine a law: coordinates that stand still, copies, steps, outliers, constraints.

use super::error::FormulaError;
use super::thresholds::{RANGE_SAMPLES, WILD_DEVIATION};
use crate::cancellation::Cancellation;
use crate::constraints::{ConstraintKind, ConstraintSearch, FoundConstraints, MotionSamples};
use crate::names::pluralize;
use crate::recording::Recording;
use crate::recording::smooth::{SmoothOptions, Smoothing};
use crate::recording::survey::{Kind, find_suspicious, stillness};

/// Rejects a recording without motion, or with rows that do not belong to it; returns a note for each coordinate with less severe faults.
pub(super) fn refuse(recording: &Recording, smoothing: &Smoothing) -> Result<Vec<String>, FormulaError> {
    if let Some((i, how)) = stillness(recording, smoothing).into_iter().next() {
        let coordinate = recording.coordinates[i].clone();
        return Err(FormulaError::Still { coordinate, how: how.to_string() });
    }
    let all = (0..recording.n()).map(|i| wild(recording, i, smoothing.coordinates[i].noise.sigma));
    Ok(all.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

/// Rejects rows far from the motion around them, and motion in steps; returns a note about rows that stand out less.
fn wild(recording: &Recording, i: usize, sigma: f64) -> Result<Option<String>, FormulaError> {
    let n = recording.n();
    let stride = (recording.samples() / RANGE_SAMPLES).max(1);
    let of = |track: usize| recording.tracks[track].q.iter().skip(i).step_by(n);
    let values = || (0..recording.tracks.len()).flat_map(of);
    let mut sorted: Vec<f64> = values().step_by(stride).copied().collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    let range = at(0.99) - at(0.01);
    let coordinate = || recording.coordinates[i].clone();
    let steps = || {
        let pairs = |track: usize| of(track).zip(of(track).skip(1)).map(|(a, b)| (b - a).abs());
        (0..recording.tracks.len()).flat_map(pairs)
    };
    let (still, all) = steps().fold((0, 0), |(still, all), step| (still + usize::from(step == 0.0), all + 1));
    if 2 * still > all && steps().fold(0.0, f64::max) > WILD_DEVIATION * range {
        return Err(FormulaError::Steps { coordinate: coordinate(), still, steps: all });
    }
    let mut found = Vec::new();
    find_suspicious(recording, &|_, sample| sample as u64 + 1, (i, sigma), &mut found);
    found.retain(|place| matches!(place.kind, Kind::Outlier | Kind::Jump));
    let mild = found.first().map(|first| {
        let (places, number) = (pluralize(found.len(), "row does", "rows do"), first.place.0 + 1);
        format!(
            "{places} not look like motion in {}, first sample {} of trajectory {number}, off by {:.3e}",
            coordinate(),
            first.row,
            first.size
        )
    });
    found.retain(|place| place.size.abs() > WILD_DEVIATION * range);
    let Some(first) = found.iter().max_by(|a, b| a.size.abs().total_cmp(&b.size.abs())) else { return Ok(mild) };
    let (track, sample) = first.place;
    Err(FormulaError::Wild {
        coordinate: coordinate(),
        track,
        sample,
        trajectory: first.track.clone(),
        time: recording.tracks[track].times[sample],
        value: first.value,
        jumps: first.kind == Kind::Jump,
        size: first.size,
        range,
        places: found.len(),
    })
}

/// A function that vanishes along a single trajectory: a constraint, or the orbit itself.
///
/// # Errors
/// [`FormulaError::Constrained`] if several trajectories satisfy it: they do not determine a Lagrangian of these coordinates.
pub(super) fn constrained(
    recording: &Recording,
    noise: Option<&Vec<f64>>,
    cancellation: &Cancellation,
) -> Result<Option<String>, FormulaError> {
    if recording.n() < 2 {
        return Ok(None);
    }
    let options = SmoothOptions { noise: noise.cloned(), ..SmoothOptions::default() };
    let samples = MotionSamples::of(recording, &options)?.watched(cancellation);
    // A search for constraints that is not possible does not prevent one for a formula.
    let Ok(found) = FoundConstraints::of(&samples, ConstraintSearch::default()) else { return Ok(None) };
    let held = found.constraints.into_iter().filter(|c| c.kind == ConstraintKind::Holonomic).map(|c| c.formula);
    let formulas: Vec<String> = held.collect();
    if recording.tracks.len() == 1 {
        return Ok(formulas.into_iter().next());
    }
    if formulas.is_empty() { Ok(None) } else { Err(FormulaError::Constrained { formulas }) }
}

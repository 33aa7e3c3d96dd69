//! Tubes around predicted motion that contain whole motions: split conformal prediction.
//!
//! Whole motions that were not used for training are predicted and divided into two halves. The errors of one half give every coordinate a
//! scale `s_i(t)` by the time ahead. A motion of the other half has the score `max_(t, i) |measured - predicted|/s_i(t)`, and with `m` of
//! them the tube is `predicted +- f s_i(t)`, where `f` is the `ceil((m + 1) share)`-th score in order. A fresh motion of the same kind
//! stays inside, all coordinates at all times, with a probability of at least `share`, whatever the model (Vovk, Gammerman and Shafer 2005;
//! Lei, G'Sell, Rinaldo, Tibshirani and Wasserman 2018). Measured positions count with their noise.

use super::prediction::{Predictions, Window};
use super::statistics::quantile;
use super::thresholds::{TIME_ROUNDING, TUBE_KNOTS};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Why there is no tube.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TubeError {
    /// An invalid share of the motions.
    #[error("expected a share above 0 and below 1, found {0}")]
    Share(f64),
    /// Too few motions for the share.
    #[error("expected at least {needed} whole motions that the model has not learned from, found {found}")]
    TooFewWindows {
        /// Motions there are.
        found: usize,
        /// Motions that are needed.
        needed: usize,
    },
    /// A model whose motion ends too early.
    #[error("the model predicts {predicted} of {all} motions to their end, too few for a tube")]
    Lost {
        /// Motions with a prediction.
        predicted: usize,
        /// All motions.
        all: usize,
    },
}

/// A tube around the coordinates of a predicted motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Tube {
    /// Share of the motions that stay inside.
    pub share: f64,
    /// Times ahead in s at which the tube is known, ascending from 0.
    pub times: Vec<f64>,
    /// Half of its width at these times, `(times, n)`.
    pub half_widths: Vec<f64>,
    /// Motions that gave the scale, and motions that gave the factor.
    pub motions: [usize; 2],
}

/// Fewest motions that calibrate a tube: with fewer, no score is large enough.
fn calibrating(share: f64) -> usize {
    (share / (1.0 - share) - TIME_ROUNDING).ceil().max(1.0) as usize
}

/// Linear in time between the rows `(times, n)` of `values`; the last one beyond.
fn between(times: &[f64], values: &[f64], n: usize, t: f64) -> Vec<f64> {
    let after = times.partition_point(|knot| *knot < t).clamp(1, times.len() - 1);
    let (from, to) = (times[after - 1], times[after]);
    let x = ((t - from) / (to - from)).clamp(0.0, 1.0);
    let row = |at: usize| &values[at * n..(at + 1) * n];
    row(after - 1).iter().zip(row(after)).map(|(a, b)| a + x * (b - a)).collect()
}

/// Sizes of the errors of every coordinate at the samples of a motion; infinite where a prediction is missing.
fn errors(window: &Window, predicted: &[f64]) -> Vec<f64> {
    let error = |(m, p): (&f64, &f64)| Some((m - p).abs()).filter(|e| e.is_finite()).unwrap_or(f64::INFINITY);
    window.measured.iter().zip(predicted).map(error).collect()
}

/// Largest error over the size of the tube.
fn score(window: &Window, predicted: &[f64], n: usize, size: impl Fn(f64) -> Vec<f64>) -> f64 {
    let errors = errors(window, predicted);
    let rows = window.times.iter().zip(errors.chunks_exact(n));
    let of = |(t, errors): (&f64, &[f64])| {
        errors.iter().zip(size(*t)).map(|(e, s)| e / s.max(f64::MIN_POSITIVE)).fold(0.0, f64::max)
    };
    rows.map(of).fold(0.0, f64::max)
}

impl Tube {
    /// Whole motions that a tube of this share takes at least.
    pub(crate) fn needed(share: f64) -> usize {
        2 * calibrating(share)
    }

    /// The tube that contains a share of motions of `n` coordinates like these, which start at the beginning of the windows.
    ///
    /// # Errors
    /// [`TubeError`].
    pub fn new(windows: &[Window], predictions: &Predictions, n: usize, share: f64) -> Result<Self, TubeError> {
        if !(share > 0.0 && share < 1.0) {
            return Err(TubeError::Share(share));
        }
        if windows.len() < Self::needed(share) {
            return Err(TubeError::TooFewWindows { found: windows.len(), needed: Self::needed(share) });
        }
        let half = |rest: usize| windows.iter().zip(predictions).skip(rest).step_by(2).collect::<Vec<_>>();
        let (scaling, scored) = (half(0), half(1));
        let lost = || {
            let whole = |p: &&Vec<f64>| p.iter().all(|x| x.is_finite());
            TubeError::Lost { predicted: predictions.iter().filter(whole).count(), all: windows.len() }
        };
        let end = windows.iter().filter_map(|window| window.times.last()).fold(0.0, |end: f64, t| end.max(*t));
        let fewest = windows.iter().map(|window| window.times.len()).min().unwrap_or(1);
        let knots = fewest.clamp(1, TUBE_KNOTS);
        let times: Vec<f64> = (0..=knots).map(|k| end * k as f64 / knots as f64).collect();
        let largest = largest_errors(&scaling, n, end / knots as f64, &times);
        let mut scale = Vec::with_capacity(times.len() * n);
        for k in 0..times.len() {
            for i in 0..n {
                let mut own: Vec<f64> = largest.iter().map(|errors| errors[k * n + i]).collect();
                own.sort_by(f64::total_cmp);
                scale.push(quantile(&own, share));
            }
        }
        if scale.iter().any(|s| !s.is_finite()) {
            return Err(lost());
        }
        let size = |t: f64| between(&times, &scale, n, t);
        let mut scores: Vec<f64> = scored.iter().map(|(window, predicted)| score(window, predicted, n, size)).collect();
        scores.sort_by(f64::total_cmp);
        let rank = ((scores.len() + 1) as f64 * share - TIME_ROUNDING).ceil() as usize;
        let factor = scores[rank.clamp(1, scores.len()) - 1];
        if !factor.is_finite() {
            return Err(lost());
        }
        let half_widths = scale.iter().map(|s| factor * s).collect();
        Ok(Self { share, times, half_widths, motions: [scaling.len(), scored.len()] })
    }

    /// Half-width for every coordinate at a time ahead; after the last time, the half-width at the last time.
    pub fn half_widths(&self, t: f64) -> Vec<f64> {
        between(&self.times, &self.half_widths, self.half_widths.len() / self.times.len(), t)
    }

    /// `true` if a motion stays inside of the tube around its prediction, all coordinates at all times.
    pub fn holds(&self, window: &Window, predicted: &[f64]) -> bool {
        let n = self.half_widths.len() / self.times.len();
        score(window, predicted, n, |t| self.half_widths(t)) <= 1.0
    }
}

/// Largest error of every motion near every knot, `(motions)(knots, n)`; where there is no sample, the error at the previous knot.
fn largest_errors(motions: &[(&Window, &Vec<f64>)], n: usize, step: f64, times: &[f64]) -> Vec<Vec<f64>> {
    let of = |(window, predicted): &(&Window, &Vec<f64>)| {
        let errors = errors(window, predicted);
        let mut largest: Vec<f64> = Vec::with_capacity(times.len() * n);
        for (k, knot) in times.iter().enumerate() {
            let reach = step * (1.0 + TIME_ROUNDING);
            let first = window.times.partition_point(|t| *t < knot - reach);
            let end = window.times.partition_point(|t| *t <= knot + reach);
            for i in 0..n {
                let near = (first..end).map(|at| errors[at * n + i]).fold(0.0, f64::max);
                let before = if k > 0 { largest[(k - 1) * n + i] } else { 0.0 };
                largest.push(if first < end { near } else { before });
            }
        }
        largest
    };
    motions.iter().map(of).collect()
}

/// A tube around a motion of named coordinates.
#[derive(Clone, Debug)]
pub struct MotionTube {
    tube: Tube,
    start: f64,
    coordinates: Vec<String>,
}

impl MotionTube {
    /// The tube around a motion that starts at a time.
    pub fn new(tube: Tube, start: f64, coordinates: Vec<String>) -> Self {
        Self { tube, start, coordinates }
    }

    /// Lower and upper limits at a sample.
    pub fn ends<'a>(&self, t: f64, q: &'a [f64]) -> impl Iterator<Item = [f64; 2]> + use<'a> {
        let half = self.tube.half_widths(t - self.start);
        q.iter().zip(half).map(|(q, h)| [q - h, q + h])
    }

    /// Names of the columns, low and high for every coordinate.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.coordinates.iter().flat_map(|name| ["low", "high"].map(|end| format!("{name}_{end}")))
    }

    /// Describes the tube in words.
    pub fn text(&self) -> String {
        let [scaling, scored] = self.tube.motions;
        format!("tube for {} of whole motions, from {} motions", self.tube.share, scaling + scored)
    }
}

/// Share, motions for shape and for width, times ahead in s, and half of the width at these times by coordinate.
impl Serialize for MotionTube {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (tube, n) = (&self.tube, self.coordinates.len());
        let widths = |i: usize| tube.half_widths.iter().skip(i).step_by(n).copied().collect::<Vec<f64>>();
        let half_widths = self.coordinates.iter().enumerate().map(|(i, name)| (name.as_str(), widths(i)));
        let mut facts = serializer.serialize_struct("MotionTube", 4)?;
        facts.serialize_field("share", &tube.share)?;
        facts.serialize_field("motions", &tube.motions)?;
        facts.serialize_field("times", &tube.times)?;
        facts.serialize_field("half_widths", &half_widths.collect::<BTreeMap<&str, Vec<f64>>>())?;
        facts.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use rand_distr::{Distribution, StandardNormal};

    /// Motions whose errors grow with time, ten times as large along the second coordinate.
    fn motions(count: usize, seed: u64) -> (Vec<Window>, Predictions) {
        let mut rng = RngStream::Test.generator(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut one = || {
            let times: Vec<f64> = (1..=80).map(|k| 0.05 * f64::from(k)).collect();
            let rate = [normal(), 10.0 * normal()];
            let measured: Vec<f64> = times.iter().flat_map(|t| rate.map(|r| r * t * t)).collect();
            let predicted = vec![0.0; measured.len()];
            (Window { q: vec![0.0; 2], v: vec![0.0; 2], lead: 0.0, times, measured, force: None }, predicted)
        };
        (0..count).map(|_| one()).unzip()
    }

    #[test]
    fn the_share_of_fresh_motions_is_inside_and_the_tube_follows_the_errors() {
        let (fresh, of_fresh) = motions(500, 9);
        for share in [0.5, 0.9] {
            // The coverage of one tube varies with the motions that scaled it.
            let mut held = 0.0;
            for seed in 0..8 {
                let (windows, predictions) = motions(800, seed);
                let tube = Tube::new(&windows, &predictions, 2, share).unwrap();
                held += fresh.iter().zip(&of_fresh).filter(|(w, p)| tube.holds(w, p)).count() as f64 / 4000.0;
                let [early, late] = [1.0, 4.0].map(|t| tube.half_widths(t));
                assert!((late[1] / late[0] / 10.0 - 1.0).abs() < 0.2, "{late:?}");
                assert!((late[0] / early[0] / 16.0 - 1.0).abs() < 0.2, "{early:?} {late:?}");
                assert_eq!(tube.motions, [400, 400]);
            }
            assert!((held - share).abs() < 0.05, "{share}: {held}");
        }
    }

    #[test]
    fn few_motions_and_lost_ones_are_named() {
        let (windows, mut predictions) = motions(40, 3);
        let tube = |count: usize, share| Tube::new(&windows[..count], &predictions[..count].to_vec(), 2, share);
        assert_eq!(tube(17, 0.9), Err(TubeError::TooFewWindows { found: 17, needed: 18 }));
        assert!(tube(18, 0.9).is_ok());
        assert_eq!(tube(37, 0.95), Err(TubeError::TooFewWindows { found: 37, needed: 38 }));
        assert_eq!(tube(40, 1.0), Err(TubeError::Share(1.0)));
        predictions.iter_mut().take(12).for_each(|p| p[150..].fill(f64::NAN));
        let lost = Tube::new(&windows, &predictions, 2, 0.9);
        assert_eq!(lost, Err(TubeError::Lost { predicted: 28, all: 40 }));
        // A few motions without a prediction widen the tube.
        let (mut windows, mut predictions) = motions(100, 4);
        predictions[1].fill(f64::NAN);
        assert!(Tube::new(&windows, &predictions, 2, 0.9).is_ok());
        windows.iter_mut().for_each(|window| window.measured.fill(0.0));
        predictions.iter_mut().for_each(|p| p.fill(0.0));
        let exact = Tube::new(&windows, &predictions, 2, 0.9).unwrap();
        assert!(exact.holds(&windows[0], &predictions[0]) && exact.half_widths(1.0)[0] < 1e-300);
    }
}

//! Where the search starts if coordinates were not measured themselves: initial states spread over the bounds of the system are fitted to the
//! beginning of a trajectory with the constants as given, and the best of them are followed along the recording, over a part that doubles.

use super::cure::{POSITION, VELOCITY, spread};
use super::follow::{LANES, Segment};
use super::pieces::Pieces;
use super::solve::{Normal, Problem};
use super::stages::{Fitted, ITERATIONS, choose_steps, refit};
use super::{IdentifyError, measured::Measured};
use crate::lagrangian::system::Bounds;

/// Rounds in which the initial states are fitted to the beginning of a trajectory, and to twice as much of it.
const SETTLING: usize = 15;
/// Initial states that are fitted to twice as much, and those that are followed along the recording.
const PROMISING: usize = 16;
const FOLLOWED: usize = 5;
/// Relative difference of the sums of squares up to which two initial states are one.
const SAME: f64 = 1e-4;
/// Segments that are followed before constants are fitted too.
const BEFORE: usize = 4;

/// What is said where such a search does not lead to a model that fits.
pub(super) const SEARCHED: &str = "coordinates that no sensor reads were searched from 64 initial states within their bounds: if the form is right, narrow \
     bounds and velocity_bounds, or begin nearer to the constants";

/// Searches initial states for the segments of a recording.
pub(super) struct Search<'a, 'b> {
    pub problem: &'a mut Problem<'b>,
    pub pieces: &'a Pieces<'b>,
    pub bounds: &'a Bounds,
    /// Segments in order, without initial states.
    pub layout: Vec<Segment>,
}

impl Measured {
    /// The initial state that readings give with their rates, `(2, m)`, of the coordinates that they are; what no sensor reads is `otherwise`.
    pub fn state(&self, readings: &[f64], otherwise: &[f64]) -> Vec<f64> {
        let (n, m) = (self.sources.len(), self.count());
        let number = |k: usize| match self.sources[k % n] {
            Some(i) => readings[k / n * m + i],
            None => otherwise[k],
        };
        (0..2 * n).map(number).collect()
    }
}

impl Search<'_, '_> {
    /// The best fit of all segments from given constants.
    pub fn first(&mut self, given: &[f64]) -> Result<Fitted, IdentifyError> {
        self.problem.course.substeps = 1;
        let candidates = self.candidates(given, 0);
        let mut best: Option<Fitted> = None;
        // At first constants follow the growing part, then they stay as given until all of it is followed.
        let ways = [true, false].into_iter().flat_map(|refits| candidates.iter().map(move |start| (start, refits)));
        for (start, refits) in ways {
            self.problem.cancellation.check()?;
            let tried = self.along(given, start.clone(), refits);
            let square = |fitted: &Fitted| (fitted.normal.failed, fitted.normal.square);
            tracing::debug!(?start, refits, tried = ?tried.as_ref().map(|t| (&t.x, square(t), t.normal.count)), "unseen");
            let Some(tried) = tried else { continue };
            if best.as_ref().is_none_or(|best| square(&tried) < square(best)) {
                best = Some(tried);
            }
            if best.as_ref().is_some_and(Fitted::is_plain) {
                break;
            }
        }
        let best = best.ok_or(IdentifyError::Lost)?;
        self.problem.course.substeps = best.substeps;
        Ok(best)
    }

    /// Initial states of a segment that fit it best, the best first.
    fn candidates(&mut self, x: &[f64], at: usize) -> Vec<Segment> {
        let Some(measured) = self.problem.measured else { return Vec::new() };
        let (n, segment) = (self.problem.n(), &self.layout[at]);
        let [mut q, mut v] = [(); 2].map(|()| vec![0.0; LANES * n]);
        for i in 0..n {
            let [(q_low, q_high), (v_low, v_high)] = [self.bounds.positions[i], self.bounds.velocities[i]];
            spread((&mut q, n), (i, POSITION), [q_low, q_high]);
            spread((&mut v, n), (i, VELOCITY), [v_low, v_high]);
        }
        let readings = self.pieces.start(segment.track, segment.first);
        let starts = q.chunks_exact(n).zip(v.chunks_exact(n)).map(|(q, v)| measured.state(&readings, &[q, v].concat()));
        let mut tried: Vec<Segment> = starts.map(|start| Segment { start, ..segment.clone() }).collect();
        self.problem.settle(x, &mut tried, SETTLING);
        tried = self.ranked(x, tried, PROMISING);
        let rest = self.problem.course.recording.tracks[segment.track].len() - segment.first;
        tried.iter_mut().for_each(|tried| tried.samples = (2 * segment.samples).min(rest));
        self.problem.settle(x, &mut tried, SETTLING);
        tried = self.ranked(x, tried, FOLLOWED);
        tried.iter_mut().for_each(|tried| tried.samples = self.layout[at].samples);
        choose_steps(self.problem, x, &tried);
        tried
    }

    /// Those of the segments with different sums of squares that fit best, the best first.
    fn ranked(&self, x: &[f64], segments: Vec<Segment>, most: usize) -> Vec<Segment> {
        let squares = self.problem.all(x, &segments).into_iter().map(|linear| linear.map(|linear| linear.square));
        let mut ranked: Vec<(f64, Segment)> = squares.zip(segments).filter_map(|(a, b)| Some((a?, b))).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.dedup_by(|next, before| next.0 - before.0 <= SAME * before.0);
        ranked.into_iter().take(most).map(|(_, segment)| segment).collect()
    }

    /// The fit of all segments by a motion that begins as the first one; constants are fitted to the part that is followed if this `refits` them,
    /// and in the end.
    fn along(&mut self, given: &[f64], start: Segment, refits: bool) -> Option<Fitted> {
        let (x, substeps) = (given.to_vec(), self.problem.course.substeps);
        let mut fitted = Fitted { x, segments: vec![start], normal: Normal::default(), substeps };
        while fitted.segments.len() < self.layout.len() && !self.problem.cancellation.is_cancelled() {
            let end = (2 * fitted.segments.len()).min(self.layout.len());
            while fitted.segments.len() < end {
                let next = self.next(&fitted)?;
                fitted.segments.push(next);
            }
            if refits && end >= BEFORE && end < self.layout.len() {
                refit(self.problem, &mut fitted, ITERATIONS);
            }
        }
        choose_steps(self.problem, &fitted.x, &fitted.segments);
        refit(self.problem, &mut fitted, ITERATIONS);
        Some(fitted)
    }

    /// The segment after those that are followed: its motion continues theirs where it can.
    fn next(&mut self, fitted: &Fitted) -> Option<Segment> {
        let at = fitted.segments.len();
        let last = &fitted.segments[at - 1];
        let own = &self.layout[at];
        if last.track == own.track && last.first < own.first {
            let longer = Segment { samples: own.first - last.first + 1, ..last.clone() };
            let start = self.problem.ends(&fitted.x, &[&longer]).pop()?;
            let mut next = [Segment { start, ..own.clone() }];
            self.problem.settle(&fitted.x, &mut next, SETTLING);
            if self.problem.all(&fitted.x, &next)[0].is_some() {
                let [next] = next;
                return Some(next);
            }
        }
        self.candidates(&fitted.x, at).into_iter().next()
    }
}

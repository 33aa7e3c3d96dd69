//! Searches initial states if some coordinates were not measured. Initial states are spread over the bounds of the system and fitted to the
//! beginning of a trajectory, with the constants at their starting values. From the best of them, the constants are fitted too, to a part of the
//! recording that doubles as long as the model fits. The rest of the recording is divided into segments that continue this motion.

use super::advice::{POSITION, VELOCITY, spread};
use super::driven::Segment;
use super::fitted::{Fitted, refit};
use super::pieces::Pieces;
use super::solve::{Normal, Problem};
use super::steps::choose_steps;
use super::thresholds::{
    CONTINUED_STARTS, ENOUGH_SEGMENTS, EQUAL_STARTS, ITERATIONS, LANES, MOST_CONTINUED_SQUARE, PROMISING_STARTS,
    SEARCH_ROUNDS, SEGMENTS_BEFORE_CONSTANTS,
};
use super::{IdentifyError, measured::Measured};
use crate::lagrangian::system::Bounds;

/// The message for a search that does not lead to a model that fits.
pub(super) const SEARCHED: &str = "some coordinates were not measured, so that 64 initial states within the bounds were tried: if the model is right, \
     narrow bounds and velocity_bounds, or start closer to the true constants";

/// Searches initial states for the segments of a recording.
pub(super) struct Search<'a, 'b> {
    pub problem: &'a mut Problem<'b>,
    pub pieces: &'a Pieces<'b>,
    pub bounds: &'a Bounds,
    /// The segments in order, without initial states. Their number is the unit of length below.
    pub layout: Vec<Segment>,
}

impl Measured {
    /// The initial state with measured coordinates from the readings and their rates, `(2, m)`, and the others from `otherwise`.
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
        self.problem.driven.substeps = 1;
        let samples = |track: usize| self.problem.driven.recording.tracks[track].len();
        let longest = self.layout.iter().map(|segment| segment.track).max_by_key(|track| samples(*track));
        if self.layout.is_empty() {
            return Err(IdentifyError::Lost);
        }
        // The longest trajectory determines the constants best.
        self.layout.sort_by_key(|segment| (Some(segment.track) != longest, segment.track, segment.first));
        let candidates = self.candidates(given, 0);
        let (mut best, mut farthest): (Option<Fitted>, usize) = (None, 0);
        let attempts = [SEGMENTS_BEFORE_CONSTANTS, 1]
            .into_iter()
            .flat_map(|units| candidates.iter().map(move |start| (start, units)));
        for (start, units) in attempts {
            self.problem.cancellation.check()?;
            let Some((tried, reach)) = self.fit_beginning(given, start.clone(), units) else { continue };
            let (x, square) = (&tried.x, tried.mean_square());
            tracing::debug!(?x, ?start, units, reach, square, "initial state");
            let better = |best: &Fitted| reach > farthest || reach == farthest && square < best.mean_square();
            if best.as_ref().is_none_or(better) {
                (best, farthest) = (Some(tried), reach);
            }
            if farthest >= ENOUGH_SEGMENTS.min(self.adjacent(0)) {
                break;
            }
        }
        let best = best.ok_or(IdentifyError::Lost)?;
        self.fit_rest(best, farthest.max(1)).ok_or(IdentifyError::Lost)
    }

    /// Number of segments without a gap between them, from a given one on.
    fn adjacent(&self, at: usize) -> usize {
        let adjacent = |a: &Segment, b: &Segment| a.track == b.track && a.first + a.samples == b.first;
        self.layout[at..].chunk_by(adjacent).next().map_or(0, <[Segment]>::len)
    }

    /// Number of samples in `units` segments from a given one on, up to the next gap.
    fn samples(&self, at: usize, units: usize) -> usize {
        self.layout[at..at + units.min(self.adjacent(at))].iter().map(|segment| segment.samples).sum()
    }

    /// The initial states that fit a segment best, the best first.
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
        for (units, most) in [(1, PROMISING_STARTS), (2, CONTINUED_STARTS)] {
            let samples = self.samples(at, units);
            tried.iter_mut().for_each(|tried| tried.samples = samples);
            self.problem.fit_starts(x, &mut tried, SEARCH_ROUNDS);
            tried = self.ranked(x, tried, most);
        }
        choose_steps(self.problem, x, &tried);
        tried
    }

    /// Ranks segments by their sums of squares and removes duplicates; the best first, at most `most`.
    fn ranked(&self, x: &[f64], segments: Vec<Segment>, most: usize) -> Vec<Segment> {
        let squares = self.problem.all(x, &segments).into_iter().map(|linear| linear.map(|linear| linear.square));
        let mut ranked: Vec<(f64, Segment)> = squares.zip(segments).filter_map(|(a, b)| Some((a?, b))).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        ranked.dedup_by(|next, before| next.0 - before.0 <= EQUAL_STARTS * before.0);
        ranked.into_iter().take(most).map(|(_, segment)| segment).collect()
    }

    /// Fits constants and an initial state to the first `units` segments, and doubles their number as long as the model fits. Returns the fit, and
    /// the number of segments that it covers.
    fn fit_beginning(&mut self, given: &[f64], start: Segment, units: usize) -> Option<(Fitted, usize)> {
        let (mut fitted, mut reach) = (None, 0);
        let (mut x, mut segments, mut units) = (given.to_vec(), vec![start], units);
        loop {
            units = units.min(self.adjacent(0));
            segments[0].samples = self.samples(0, units);
            self.problem.fit_starts(&x, &mut segments, SEARCH_ROUNDS);
            choose_steps(self.problem, &x, &segments);
            let mut tried = Fitted { x, segments, normal: Normal::default(), substeps: 1 };
            refit(self.problem, &mut tried, ITERATIONS);
            let fits = tried.normal.failed == 0 && tried.mean_square() < MOST_CONTINUED_SQUARE;
            let fails = tried.normal.failed > 0 || !tried.mean_square().is_finite();
            (x, segments) = (tried.x.clone(), tried.segments.clone());
            if fits || fitted.is_none() && !fails {
                (fitted, reach) = (Some(tried), if fits { units } else { 0 });
            }
            if !fits || units == self.adjacent(0) || self.problem.cancellation.is_cancelled() {
                break;
            }
            units *= 2;
        }
        Some((fitted?, reach))
    }

    /// Fits all segments, of up to `reach` units each, starting with the motion of the first one.
    fn fit_rest(&mut self, mut fitted: Fitted, reach: usize) -> Option<Fitted> {
        let first = fitted.segments.first()?.samples;
        let mut at = (1..=self.layout.len()).find(|units| self.samples(0, *units) >= first).unwrap_or(1);
        let mut due = 2;
        while at < self.layout.len() && !self.problem.cancellation.is_cancelled() {
            let (next, units) = self.next_segment(&fitted, at, reach)?;
            fitted.segments.push(next);
            at += units;
            if fitted.segments.len() >= due && at < self.layout.len() {
                refit(self.problem, &mut fitted, ITERATIONS);
                due *= 2;
            }
        }
        choose_steps(self.problem, &fitted.x, &fitted.segments);
        refit(self.problem, &mut fitted, ITERATIONS);
        Some(fitted)
    }

    /// The segment from a place of the layout on, of as many units as the model fits, at most `reach`. Its motion continues the previous segment if
    /// possible.
    fn next_segment(&mut self, fitted: &Fitted, at: usize, reach: usize) -> Option<(Segment, usize)> {
        let (last, own) = (fitted.segments.last()?, &self.layout[at]);
        let mut next = None;
        if last.track == own.track && last.first < own.first {
            let longer = Segment { samples: own.first - last.first + 1, ..last.clone() };
            let start = self.problem.ends(&fitted.x, &[&longer]).pop()?;
            next = self.with_fitted_start(&fitted.x, Segment { start, ..own.clone() });
        }
        let (mut segment, mut square) = match next {
            Some(next) => next,
            None => {
                let best = self.candidates(&fitted.x, at).into_iter().next()?;
                self.with_fitted_start(&fitted.x, Segment { start: best.start, ..self.layout[at].clone() })?
            }
        };
        let (mut units, most) = (1, reach.min(self.adjacent(at)));
        while units < most {
            let samples = self.samples(at, (2 * units).min(most));
            let Some(longer) = self.with_fitted_start(&fitted.x, Segment { samples, ..segment.clone() }) else { break };
            if longer.1 > MOST_CONTINUED_SQUARE.max(square) {
                break;
            }
            ((segment, square), units) = (longer, (2 * units).min(most));
        }
        Some((segment, units))
    }

    /// A segment with its initial state fitted, and its mean square; `None` if it cannot be integrated.
    fn with_fitted_start(&self, x: &[f64], segment: Segment) -> Option<(Segment, f64)> {
        let mut segments = [segment];
        self.problem.fit_starts(x, &mut segments, SEARCH_ROUNDS);
        let linear = self.problem.all(x, &segments).pop()??;
        let [segment] = segments;
        Some((segment, linear.square / linear.count.max(1.0)))
    }
}

//! Constants by known forces: least squares on the residuals of force of smoothed motion.
//!
//! The residual is `r = M a + c - dL/dq + dD/dv - Q`. It needs no accelerations to be solved for, so the mass matrix may be singular during
//! the search. The weight of a coordinate is one over the size of its residuals. If the equations are linear in the constants, a single
//! step suffices for given weights.

use super::IdentifyError;
use super::follow::{Follower, LANES, Segment};
use super::found::{Identified, Outlier, Residual};
use super::quality::{outliers, usual, whiteness};
use super::smoothed::{Met, States};
use super::solve::{Normal, Problem};
use super::stages::{EXPLAINED, Fitted, unknowns};
use crate::lagrangian::SystemInstance;
use crate::recording::smooth::noise;
use crate::recording::{deviation, rms};

/// How often coordinates are weighed anew at most, and relative change of all weights that ends it.
const ROUNDS: usize = 6;
const SETTLED: f64 = 0.01;
/// Residual over the spread of a force that is taken at least.
const LEAST: f64 = 1e-9;
/// Change of slopes, relative to them, that is rounding.
const ROUNDING: f64 = 1e-9;

/// Identifies the constants of `problem` that meet the known forces, from their starting values on.
pub(super) fn identify(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    states: &mut States,
    (mut x, segments): (Vec<f64>, Vec<Segment>),
) -> Result<Identified, IdentifyError> {
    let n = problem.course.equations.n;
    let recording = problem.course.recording;
    let start = x.clone();
    let count = states.places.len();
    if count == 0 {
        return Err(IdentifyError::Lost);
    }
    let spread: Vec<f64> = (0..n).map(|i| deviation(states.force.iter().skip(i).step_by(n))).collect();
    // A coordinate that nothing drives is weighed as the others are.
    let most = spread.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let mut sigma: Vec<f64> = spread.iter().map(|s| if *s > 0.0 { *s } else { most }).collect();
    let least: Vec<f64> = sigma.iter().map(|sigma| LEAST * sigma).collect();
    let mut search = Normal::default();
    for _ in 0..ROUNDS {
        states.weight = (0..count * n).map(|at| sigma[at % n].recip()).collect();
        search = states.fit(problem, &mut x, Met::Forces).ok_or(IdentifyError::Singular)?;
        let residuals = [states.force_residuals(problem, &x)];
        let left: Vec<f64> = (0..n).map(|i| usual(&residuals, n, i).max(least[i])).collect();
        let settled = left.iter().zip(&sigma).all(|(left, sigma)| (left / sigma - 1.0).abs() < SETTLED);
        sigma = left;
        tracing::debug!(?sigma, "residuals of force");
        search.converged &= settled;
        if settled {
            break;
        }
    }
    states.weight = (0..count * n).map(|at| sigma[at % n].recip()).collect();
    let mut normal = states.normal(problem, &x, Met::Forces).ok_or(IdentifyError::Singular)?;
    (normal.converged, normal.decrement, normal.held) = (search.converged, search.decrement, search.held);
    let fitted = Fitted { x, segments, normal, substeps: 0 };
    let (inflation, widened) = fitted.inflation();
    let residuals = states.force_residuals(problem, &fitted.x);
    let blocks: Vec<Vec<f64>> = residuals.chunks(LANES * n).map(<[f64]>::to_vec).collect();
    let expected = noises(problem, states, &fitted.x);
    let left = |i: usize| {
        let rms = rms(residuals.iter().skip(i).step_by(n).copied());
        let (autocorrelation, white) = whiteness(&blocks, n, i);
        let coordinate = recording.coordinates[i].clone();
        Residual { coordinate, rms, noise: expected[i].max(least[i]), spread: spread[i], autocorrelation, white }
    };
    let by_coordinate: Vec<Residual> = (0..n).map(left).collect();
    let square = by_coordinate.iter().map(|r| (r.rms / r.noise).powi(2)).sum::<f64>() / n as f64;
    let explained = fitted.normal.converged && (0..n).all(|i| sigma[i] < EXPLAINED * by_coordinate[i].noise);
    // States of all trajectories in a row.
    let whole = Segment { track: 0, first: 0, samples: count, start: Vec::new() };
    let far = |_, state: usize, i: usize, size: f64| {
        let (track, sample) = states.places[state];
        let (time, coordinate) = (recording.tracks[track].times[sample], recording.coordinates[i].clone());
        Outlier { track, sample, time, coordinate, size }
    };
    let (outliers, outlier_count) = outliers((&[whole], &[residuals]), n, far);
    Ok(Identified {
        converged: fitted.normal.converged,
        decrement: fitted.normal.decrement,
        explained,
        residuals: by_coordinate,
        over_noise: square.sqrt(),
        outliers,
        outlier_count,
        inflation: widened,
        samples: count,
        ..unknowns(instance, problem, &fitted, (&start, inflation), Met::Forces)
    })
}

/// Standard deviation of the residual of every force that noise alone leaves: that of the force itself, and what the errors of the
/// accelerations come to.
fn noises(problem: &Problem<'_>, states: &States, x: &[f64]) -> Vec<f64> {
    let n = problem.course.equations.n;
    let tracks =
        || problem.course.recording.tracks.iter().map(|track| (track.times.as_slice(), track.force.as_slice()));
    let mut squares = vec![0.0; n];
    states.batches(problem, x, |follower, range, _| {
        let errors = states.a_error[range].chunks_exact(n);
        for (mass, errors) in follower.mass().chunks_exact(n * n).zip(errors) {
            for (square, row) in squares.iter_mut().zip(mass.chunks_exact(n)) {
                *square += row.iter().zip(errors).map(|(m, e)| (m * e).powi(2)).sum::<f64>();
            }
        }
    });
    let of =
        |(i, square): (usize, f64)| noise(tracks(), n, i).sigma.hypot((square / states.places.len() as f64).sqrt());
    squares.into_iter().enumerate().map(of).collect()
}

impl Problem<'_> {
    /// `true` if the equations are linear in all unknown constants together, tried at the starts of segments.
    pub(super) fn is_linear(&self, segments: &[Segment]) -> bool {
        let (n, m) = (self.course.equations.n, self.chosen.len());
        let stride = segments.len().div_ceil(LANES).max(1);
        let starts = || segments.iter().step_by(stride).map(|segment| segment.start.split_at(n));
        let q: Vec<f64> = starts().flat_map(|(q, _)| q.to_vec()).collect();
        let v: Vec<f64> = starts().flat_map(|(_, v)| v.to_vec()).collect();
        let slopes = |factor: f64| {
            let x: Vec<f64> = (0..m).map(|k| factor * (1.0 + k as f64 / m as f64)).collect();
            // What a state has for an acceleration does not matter here.
            Follower::new(&self.course).force_slopes(&self.parameters(&x), (&q, &v, &q)).to_vec()
        };
        let (one, other) = (slopes(1.0), slopes(1.7));
        let rows = one.chunks_exact(2 * n + m).zip(other.chunks_exact(2 * n + m));
        rows.into_iter().all(|(one, other)| {
            one[2 * n..].iter().zip(&other[2 * n..]).all(|(a, b)| (a - b).abs() <= ROUNDING * a.abs().max(1.0))
        })
    }
}

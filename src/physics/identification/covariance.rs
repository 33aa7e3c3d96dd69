//! Covariance of the unknowns if residuals are correlated or weighted by their size.
//!
//! Let the score `u_t` be the contribution of a sample to the gradient of the sum of squares, with initial states eliminated. The covariance is
//! `S^-1 B S^-1` with the normal matrix `S` and the long-run covariance `B` of the scores. `B` is the mean of the outer products of their sums over
//! all windows of one length, which is Bartlett's kernel (Newey and West, Econometrica 55 (1987) 703).

use super::driven::Segment;
use super::fitted::Fitted;
use super::linear::times;
use super::quality::tail;
use super::segments::joined;
use super::solve::{Normal, Problem, batches};
use super::steps::choose_steps;
use super::thresholds::{ELIMINATED_ROUNDING, HUBER, LEAST_SEGMENT_EIGENVALUE, MOST_START_DECREMENT, MOST_WINDOW};
use crate::linalg::{Workspace, dot, eigh};

/// Effect of weighting residuals by size. All numbers are means over residuals in units of the noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weighting {
    /// Variance of the scores over the normal matrix; the mean square residual if no residual is cut off.
    pub square: f64,
    /// Mean weight over mean slope of the scores; 1 if no residual is cut off.
    pub weight_over_slope: f64,
}

impl Weighting {
    /// Computes the effect from `E psi^2`, `E psi'` and the mean weight, if residuals beyond three standard deviations count linearly
    /// (Huber, Robust Statistics, 1981, section 7.6); `freedom` is the share of degrees of freedom that initial states and constants leave.
    pub fn of(residuals: &[Vec<f64>], robust: bool, freedom: f64) -> Self {
        let all = || residuals.iter().flatten().copied().filter(|r| r.is_finite());
        let cut = |r: f64| if robust && r.abs() > HUBER { HUBER } else { r.abs() };
        let (mut square, mut slope, mut weight) = (0.0, 0.0, 0.0);
        for r in all() {
            square += cut(r).powi(2);
            slope += f64::from(u8::from(cut(r) == r.abs()));
            weight += if r == 0.0 { 1.0 } else { cut(r) / r.abs() };
        }
        Self { square: square / (weight * freedom).max(f64::MIN_POSITIVE), weight_over_slope: weight / slope.max(1.0) }
    }
}

/// Scores of every segment, `(samples, m)`.
pub(super) fn scores(problem: &Problem<'_>, x: &[f64], segments: &[Segment]) -> Vec<Vec<f64>> {
    let (starts, m) = (problem.driven.starts(), problem.unknowns());
    let width = starts + m;
    // Response of the initial states to the unknowns, `(m, starts)`.
    let responses = problem.all(x, segments).into_iter().map(|linear| {
        let linear = linear?;
        let inverse = problem.start_inverse(&linear, 0.0);
        let column = |k: usize| (0..starts).map(|i| linear.matrix[i * width + starts + k]).collect::<Vec<f64>>();
        Some((0..m).map(|k| times(starts, &inverse, &column(k))).collect::<Vec<_>>())
    });
    let responses: Vec<Option<Vec<Vec<f64>>>> = responses.collect();
    let mut found: Vec<Vec<f64>> = segments.iter().map(|segment| vec![0.0; segment.samples * m]).collect();
    for (batch, lanes) in batches(segments) {
        problem.residuals(x, &lanes, true, |lane, sample, _, residual, row| {
            let Some(responses) = &responses[batch[lane]] else { return };
            let cut = if problem.robust { residual.clamp(-HUBER, HUBER) } else { residual };
            let own = &mut found[batch[lane]][sample * m..(sample + 1) * m];
            for ((score, response), slope) in own.iter_mut().zip(responses).zip(&row[starts..]) {
                *score += cut * (slope - dot(response, &row[..starts]));
            }
        });
    }
    found
}

/// Long-run covariance of scores that are correlated over `lags` samples, `(m, m)`; adjacent segments of a trajectory are concatenated.
pub(super) fn long_run(scores: &[Vec<f64>], segments: &[Segment], m: usize, lags: usize) -> Vec<f64> {
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by_key(|&k| (segments[k].track, segments[k].first));
    let samples: usize = segments.iter().map(|segment| segment.samples).sum();
    let window = (lags + 1).min((MOST_WINDOW * samples as f64) as usize).max(1);
    let mut covariance = vec![0.0; m * m];
    for track in order.chunk_by(|&a, &b| segments[a].track == segments[b].track) {
        let rows: Vec<&[f64]> = track.iter().flat_map(|&k| scores[k].chunks_exact(m)).collect();
        let mut sum = vec![0.0; m];
        for end in 0..rows.len() + window - 1 {
            if let Some(row) = rows.get(end) {
                sum.iter_mut().zip(*row).for_each(|(s, x)| *s += x);
            }
            if let Some(row) = end.checked_sub(window).and_then(|before| rows.get(before)) {
                sum.iter_mut().zip(*row).for_each(|(s, x)| *s -= x);
            }
            for (line, a) in covariance.chunks_exact_mut(m).zip(&sum) {
                line.iter_mut().zip(&sum).for_each(|(c, b)| *c += a * b);
            }
        }
    }
    // All scores sum to 0, so that sums over large windows vary less than those of independent numbers.
    let share = window as f64 / samples as f64;
    let factor = window as f64 * (1.0 - share + share * share / 3.0);
    covariance.iter_mut().for_each(|c| *c /= factor);
    covariance
}

/// Square root `R` of a normal matrix with `S = R' R`, and its inverse, along the directions that the motion determines: rows `(directions, m)`.
pub(super) struct Root {
    pub forward: Vec<Vec<f64>>,
    pub back: Vec<Vec<f64>>,
}

impl Root {
    pub fn of(m: usize, matrix: &[f64]) -> Self {
        let scale: Vec<f64> = (0..m).map(|k| matrix[k * m + k].max(0.0).sqrt()).collect();
        let over = |x: f64, by: f64| if by > 0.0 { x / by } else { 0.0 };
        let scaled: Vec<f64> =
            matrix.iter().enumerate().map(|(at, x)| over(*x, scale[at / m] * scale[at % m])).collect();
        let (mut values, mut vectors) = (vec![0.0; m], vec![0.0; m * m]);
        // This cannot fail, because the matrix is finite by construction.
        let _ = eigh(m, &scaled, &mut values, &mut vectors, &mut Workspace::new());
        let determined =
            || values.iter().zip(vectors.chunks_exact(m.max(1))).filter(|(value, _)| **value > ELIMINATED_ROUNDING);
        let each = |vector: &[f64], of: &dyn Fn(usize, f64) -> f64| {
            vector.iter().enumerate().map(|(k, x)| of(k, *x)).collect::<Vec<f64>>()
        };
        Self {
            forward: determined().map(|(value, vector)| each(vector, &|k, x| x * value.sqrt() * scale[k])).collect(),
            back: determined().map(|(value, vector)| each(vector, &|k, x| over(x / value.sqrt(), scale[k]))).collect(),
        }
    }

    /// Normal equations of independent residuals of unit size that give the unknowns the given covariance, which is in the directions of the root.
    /// Eigenvalues below `least` are raised to it.
    pub fn with_covariance(&self, normal: &Normal, covariance: &[f64], least: f64) -> Normal {
        let (m, count) = (normal.right.len(), self.forward.len());
        let (mut values, mut vectors) = (vec![0.0; count], vec![0.0; count * count]);
        let _ = eigh(count, covariance, &mut values, &mut vectors, &mut Workspace::new());
        let mut scaled = Normal { matrix: vec![0.0; m * m], ..normal.clone() };
        for (value, vector) in values.iter().zip(vectors.chunks_exact(count.max(1))) {
            let row: Vec<f64> =
                (0..m).map(|k| vector.iter().zip(&self.forward).map(|(x, row)| x * row[k]).sum()).collect();
            let weight = value.max(least).recip();
            for (line, a) in scaled.matrix.chunks_exact_mut(m).zip(&row) {
                line.iter_mut().zip(&row).for_each(|(sum, b)| *sum += weight * a * b);
            }
        }
        for k in 0..m {
            let ratio = scaled.matrix[k * m + k] / normal.matrix[k * m + k];
            scaled.diagonal[k] *= if ratio.is_finite() { ratio } else { 1.0 };
        }
        scaled
    }

    /// A long-run covariance `B` of scores in the directions of the root.
    pub fn projected(&self, m: usize, covariance: &[f64]) -> Vec<f64> {
        let images: Vec<Vec<f64>> = self.back.iter().map(|row| times(m, covariance, row)).collect();
        self.back.iter().flat_map(|row| images.iter().map(|image| dot(row, image))).collect()
    }
}

/// p-value of the test that segments continue each other. For a right model, the sum of squares that separate initial states of every second
/// segment gain, over that of the residuals, has the F distribution.
///
/// Initial states absorb much of the effect of a missing term, over a short segment almost all of it. The segments then do not continue each other.
pub(super) fn continuation(problem: &Problem<'_>, fitted: &Fitted, weighting: Weighting) -> f64 {
    let longer = joined(&fitted.segments);
    if longer.len() == fitted.segments.len() {
        return 1.0;
    }
    let mut problem = problem.clone();
    choose_steps(&mut problem, &fitted.x, &longer);
    let [separate, joint] = [&fitted.segments, &longer].map(|segments| problem.normal_at(&fitted.x, segments));
    let freedom = joint.count - separate.count;
    // The test has no power if the motion is too chaotic for the initial states to converge.
    if joint.failed + separate.failed > 0 || joint.start_decrement > MOST_START_DECREMENT || freedom < 1.0 {
        return 1.0;
    }
    // The sum of squares at the best constants, to second order.
    let least = |normal: &Normal| {
        let root = Root::of(fitted.x.len(), &normal.matrix);
        let decrease: f64 = root.back.iter().map(|row| dot(row, &normal.right).powi(2)).sum();
        normal.square - decrease
    };
    let ratio = (least(&joint) - least(&separate)) / freedom / weighting.square;
    tail(ratio, freedom, (separate.count - fitted.x.len() as f64).max(1.0))
}

/// p-value of the test that segments share their constants: the score test of separate constants for each segment, whose sum of squares over that
/// of the residuals has the F distribution for a right model.
pub(super) fn agreement(problem: &Problem<'_>, x: &[f64], segments: &[Segment], weighting: Weighting) -> f64 {
    let m = x.len();
    let (mut sum, mut freedom, mut rest) = (0.0, 0.0, 0.0);
    for (linear, segment) in problem.all(x, segments).iter().zip(segments) {
        let normal = problem.normal(std::slice::from_ref(linear), std::slice::from_ref(segment));
        rest += normal.count;
        let scale = |k: usize| normal.matrix[k * m + k].max(f64::MIN_POSITIVE).sqrt();
        let correlated: Vec<f64> =
            normal.matrix.iter().enumerate().map(|(at, x)| x / (scale(at / m) * scale(at % m))).collect();
        let (mut values, mut vectors) = (vec![0.0; m], vec![0.0; m * m]);
        if linear.is_none() || eigh(m, &correlated, &mut values, &mut vectors, &mut Workspace::new()).is_err() {
            continue;
        }
        let right: Vec<f64> = normal.right.iter().enumerate().map(|(k, u)| u / scale(k)).collect();
        for (value, vector) in
            values.iter().zip(vectors.chunks_exact(m)).filter(|(value, _)| **value > LEAST_SEGMENT_EIGENVALUE)
        {
            sum += dot(vector, &right).powi(2) / value;
            freedom += 1.0;
        }
    }
    let freedom = freedom - m as f64;
    if freedom < 1.0 { 1.0 } else { tail(sum / freedom / weighting.square, freedom, (rest - m as f64).max(1.0)) }
}

//! Held-out motion as a test of a formula.

use super::found::Verdict;
use super::motion::Model;
use super::regular::is_regular;
use super::search::Search;
use super::thresholds::{LEAST_HELD_OUT_RESIDUAL, LEAST_MOTION_RATIO, MOST_HELD_OUT_RESIDUAL, RESIDUAL_DEVIATIONS};
use crate::identification::{ResidualPath, Segment};
use crate::names::rounded;

/// Held-out motion as a test of a model.
pub(super) struct HeldOutTest<'a> {
    pub search: &'a Search<'a>,
    pub model: &'a Model,
    pub segments: &'a [Segment],
    /// Residuals of the segments in units of the noise, `(samples, n)` each.
    pub residuals: &'a [Vec<f64>],
    pub square: f64,
    pub count: f64,
}

impl HeldOutTest<'_> {
    pub fn residual(&self) -> f64 {
        (self.square / self.count.max(1.0)).sqrt()
    }

    /// Three standard deviations of the residual, which matter if its count is small.
    fn scatter(&self) -> f64 {
        RESIDUAL_DEVIATIONS / (2.0 * self.count.max(1.0)).sqrt()
    }

    pub fn verdict(&self, doubts: &[String]) -> Verdict {
        match self.residual() <= MOST_HELD_OUT_RESIDUAL + self.scatter() {
            true if doubts.is_empty() => Verdict::Found,
            true => Verdict::Undecided,
            false => Verdict::NotInLibrary,
        }
    }

    /// Reasons why small residuals do not confirm the formula.
    pub fn doubts(&self) -> Vec<String> {
        let data = self.search.motion.data;
        let mut doubts = Vec::new();
        let residual = self.residual();
        if data.estimated.iter().all(|estimated| *estimated) && residual < LEAST_HELD_OUT_RESIDUAL - self.scatter() {
            doubts.push(format!("the residual is {residual:.2} times the noise: the initial states overfit the noise"));
        }
        let masses = self.search.masses(&self.model.terms, &self.model.coefficients);
        if !is_regular(data.n, &masses) {
            doubts.push("its mass matrix is nearly singular".to_string());
        }
        for (i, [motion, residual]) in self.motion_and_residual().into_iter().enumerate() {
            if motion < LEAST_MOTION_RATIO * residual {
                let name = &data.recording.coordinates[i];
                doubts.push(format!(
                    "{name} moves by only {} times its residual in the held-out motion: too little to confirm a law",
                    rounded(motion / residual, 2)
                ));
            }
        }
        doubts
    }

    /// Positions and residuals of the segments in SI units.
    pub fn paths(&self) -> Vec<ResidualPath> {
        let data = self.search.motion.data;
        let of = |(segment, residuals): (&Segment, &Vec<f64>)| {
            ResidualPath::of(data.recording, segment, residuals, |_, i| data.sigma_of[segment.track][i])
        };
        self.segments.iter().zip(self.residuals).map(of).collect()
    }

    /// Standard deviation of each coordinate within segments, and of its residual, in units of noise.
    fn motion_and_residual(&self) -> Vec<[f64; 2]> {
        let data = self.search.motion.data;
        let n = data.n;
        let mut sums = vec![[0.0; 4]; n];
        for (segment, residuals) in self.segments.iter().zip(self.residuals) {
            let q = &data.recording.tracks[segment.track].q[segment.first * n..][..segment.samples * n];
            for (i, [moved, free, left, rest]) in sums.iter_mut().map(|[a, b, c, d]| [a, b, c, d]).enumerate() {
                let sigma = data.sigma_of[segment.track][i];
                let values = || q.iter().skip(i).step_by(n);
                let mean = values().sum::<f64>() / segment.samples as f64;
                *moved += values().map(|x| ((x - mean) / sigma).powi(2)).sum::<f64>();
                *free += segment.samples as f64 - 1.0;
                *left += residuals.iter().skip(i).step_by(n).filter(|r| r.is_finite()).map(|r| r * r).sum::<f64>();
                *rest += segment.samples as f64 - 2.0;
            }
        }
        sums.into_iter().map(|[moved, free, left, rest]| [(moved / free).sqrt(), (left / rest).sqrt()]).collect()
    }
}

//! Recorded trajectories in memory.

use thiserror::Error;

/// One recorded trajectory of `n` coordinates: positions at increasing times, and other measured quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedTrajectory {
    /// Origin of the trajectory, such as a file name.
    pub name: String,
    /// Times of the samples in s, strictly increasing, `(samples)`.
    pub times: Vec<f64>,
    /// Coordinates, `(samples, n)` row-major; angles are unwrapped: they continue past a full turn.
    pub q: Vec<f64>,
    /// Velocities, `(samples, n)`; empty if they were not measured.
    pub v: Vec<f64>,
    /// Accelerations, `(samples, n)`; empty if they were not measured.
    pub a: Vec<f64>,
    /// Known external generalized forces, `(samples, n)`; empty if there are none.
    pub force: Vec<f64>,
}

/// Trajectories of one system.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// Which coordinates are angles, in rad.
    pub periodic: Vec<bool>,
    /// The trajectories.
    pub tracks: Vec<RecordedTrajectory>,
}

/// Why numbers do not form a trajectory.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// An array has a wrong length.
    #[error("{track}: {what}: expected {}, found {found}", crate::names::pluralize(*expected, "number", "numbers"))]
    Shape {
        /// Name of the trajectory.
        track: String,
        /// Name of the array.
        what: &'static str,
        /// Expected number of values.
        expected: usize,
        /// Actual number of values.
        found: usize,
    },
    /// A number is infinite or `NaN`.
    #[error("{track}: {what} of sample {sample} is not finite")]
    NotFinite {
        /// Name of the trajectory.
        track: String,
        /// Name of the array.
        what: &'static str,
        /// Sample, from 0.
        sample: usize,
    },
    /// Time does not increase.
    #[error("{track}: time of sample {sample} is not later than that of the sample before")]
    Order {
        /// Name of the trajectory.
        track: String,
        /// Sample, from 0.
        sample: usize,
    },
}

impl RecordedTrajectory {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Time from the first to the last sample, in s.
    pub(crate) fn span(&self) -> f64 {
        self.times.last().zip(self.times.first()).map_or(0.0, |(last, first)| last - first)
    }

    /// `true` if there is no sample.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// Fills in missing readings of positions, `NaN`, by linear interpolation; returns which were missing, `(samples, n)`, or an empty
    /// list.
    ///
    /// # Errors
    /// A coordinate without any reading.
    pub(crate) fn fill_missing(&mut self, n: usize) -> Result<Vec<bool>, usize> {
        let missing: Vec<bool> = self.q.iter().map(|q| q.is_nan()).collect();
        if !missing.contains(&true) {
            return Ok(Vec::new());
        }
        for i in 0..n {
            let known: Vec<usize> = (0..self.len()).filter(|k| !missing[k * n + i]).collect();
            let (Some(first), Some(last)) = (known.first(), known.last()) else { return Err(i) };
            for k in (0..self.len()).filter(|k| missing[k * n + i]) {
                let after = known.partition_point(|known| *known < k);
                let [a, b] = [known.get(after.wrapping_sub(1)).unwrap_or(first), known.get(after).unwrap_or(last)];
                let (qa, qb, width) = (self.q[a * n + i], self.q[b * n + i], self.times[*b] - self.times[*a]);
                let share = if width > 0.0 { (self.times[k] - self.times[*a]) / width } else { 0.0 };
                self.q[k * n + i] = qa + share * (qb - qa);
            }
        }
        Ok(missing)
    }

    /// Checks shapes for `n` coordinates, finiteness and the order of times.
    ///
    /// # Errors
    /// The first [`TrajectoryError`].
    pub fn validate(&self, n: usize) -> Result<(), TrajectoryError> {
        self.validate_repeated(n)?;
        match self.times.windows(2).position(|pair| pair[1] <= pair[0]) {
            Some(at) => Err(TrajectoryError::Order { track: self.name.clone(), sample: at + 1 }),
            None => Ok(()),
        }
    }

    /// Like [`validate`](Self::validate), but allows equal times: rows at the same time are repeated measurements.
    ///
    /// # Errors
    /// The first [`TrajectoryError`].
    pub fn validate_repeated(&self, n: usize) -> Result<(), TrajectoryError> {
        let track = || self.name.clone();
        let expected = self.len() * n;
        for (what, values, optional) in [
            ("positions", &self.q, false),
            ("velocities", &self.v, true),
            ("accelerations", &self.a, true),
            ("forces", &self.force, true),
        ] {
            if values.len() != expected && !(optional && values.is_empty()) {
                return Err(TrajectoryError::Shape { track: track(), what, expected, found: values.len() });
            }
            if let Some(at) = values.iter().position(|x| !x.is_finite()) {
                return Err(TrajectoryError::NotFinite { track: track(), what, sample: at / n.max(1) });
            }
        }
        if let Some(sample) = self.times.iter().position(|t| !t.is_finite()) {
            return Err(TrajectoryError::NotFinite { track: track(), what: "time", sample });
        }
        match self.times.windows(2).position(|pair| pair[1] < pair[0]) {
            Some(at) => Err(TrajectoryError::Order { track: track(), sample: at + 1 }),
            None => Ok(()),
        }
    }
}

impl Recording {
    /// Number of coordinates `n`.
    pub fn n(&self) -> usize {
        self.coordinates.len()
    }

    /// `true` if every trajectory has measured velocities.
    pub(crate) fn has_velocities(&self) -> bool {
        !self.tracks.is_empty() && self.tracks.iter().all(|track| !track.v.is_empty())
    }

    /// `true` if every trajectory has measured accelerations.
    pub(crate) fn has_accelerations(&self) -> bool {
        !self.tracks.is_empty() && self.tracks.iter().all(|track| !track.a.is_empty())
    }

    /// `true` if every trajectory has known forces on every coordinate, each of which varies.
    pub(crate) fn is_driven(&self) -> bool {
        let n = self.n();
        let moves = |i: usize| {
            let mut column = self.tracks.iter().flat_map(|track| track.force.iter().skip(i).step_by(n));
            let first = column.next();
            column.any(|force| Some(force) != first)
        };
        self.tracks.iter().all(|track| !track.force.is_empty()) && (0..n).all(moves)
    }

    /// Samples of all trajectories.
    pub fn samples(&self) -> usize {
        self.tracks.iter().map(RecordedTrajectory::len).sum()
    }
}

#[cfg(feature = "rollout")]
impl RecordedTrajectory {
    /// The known external forces, interpolated linearly between the samples; `None` if there are none.
    pub(crate) fn sampled_force(&self) -> Option<crate::rollout::SampledForce<f64>> {
        let n = self.force.len().checked_div(self.len()).filter(|n| *n > 0)?;
        crate::rollout::SampledForce::new(n, self.times.clone(), self.force.clone()).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named() {
        let good = RecordedTrajectory {
            name: "swing".into(),
            times: vec![0.0, 0.1, 0.2],
            q: vec![1.0, 2.0, 1.1, 2.1, 1.2, 2.2],
            v: vec![],
            a: vec![],
            force: vec![],
        };
        assert_eq!(good.validate(2), Ok(()));
        let short = RecordedTrajectory { v: vec![0.0; 4], ..good.clone() };
        assert_eq!(short.validate(2).unwrap_err().to_string(), "swing: velocities: expected 6 numbers, found 4");
        let late = RecordedTrajectory { times: vec![0.0, 0.1, 0.1], ..good.clone() };
        assert_eq!(late.validate(2), Err(TrajectoryError::Order { track: "swing".into(), sample: 2 }));
        let broken = RecordedTrajectory { q: vec![1.0, 2.0, f64::NAN, 2.1, 1.2, 2.2], ..good };
        assert!(broken.validate(2).unwrap_err().to_string().contains("positions of sample 1"));
    }
}

//! Learning from recorded motion: what is trained on, what chooses the best epoch, what judges.
//!
//! Whole trajectories are held out, never rows: neighbouring samples are nearly the same state. Derivatives come from
//! local polynomials ([`Smoothing`]) unless they were measured; accelerations so obtained start a network that may then
//! be fitted through its motion ([`shooting`](crate::shooting)).

use crate::data::dataset::{Dataset, DatasetError};
use crate::data::datasets::Datasets;
use crate::data::estimated::{Noise, StateEstimate};
use crate::recording::smooth::{SmoothError, SmoothOptions, Smoothed, Smoothing};
use crate::recording::survey::{Stillness, plan, stillness};
use crate::recording::{HeldOut, HoldOutError, Recording, Targets};
use crate::scalar::Scalar;
use thiserror::Error;

/// Preparation of recorded motion.
#[derive(Clone, Debug, PartialEq)]
pub struct PrepareOptions {
    /// Local polynomials.
    pub smoothing: SmoothOptions,
    /// Share of the samples held out to judge; half as much of the rest chooses the best epoch. With 0 everything is learned
    /// from and chooses the best epoch too, and nothing judges.
    pub held_out: f64,
    /// Most states of a supervised training; of more, evenly spaced ones are taken.
    pub most_states: usize,
    /// Seed of the choice of trajectories.
    pub seed: u64,
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self { smoothing: SmoothOptions::default(), held_out: 0.2, most_states: 60_000, seed: 0 }
    }
}

/// Why recorded motion cannot be learned from.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecordingSplitError {
    /// Too little to hold anything out.
    #[error(transparent)]
    HoldOut(#[from] HoldOutError),
    /// No derivatives.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// A coordinate that stands still.
    #[error("{coordinate} {how}; leave it out of the coordinates, or record it moving")]
    Motionless {
        /// Its name.
        coordinate: String,
        /// The way it does.
        how: Stillness,
    },
    /// Numbers that make no dataset.
    #[error("{which}: {source}")]
    Dataset {
        /// Training, validation or test.
        which: &'static str,
        /// The problem.
        source: DatasetError,
    },
}

/// Trajectories with the states estimated from them.
#[derive(Clone, Debug)]
pub struct Split {
    /// The recorded motion.
    pub recording: Recording,
    /// States of every trajectory.
    pub states: Vec<Smoothed>,
}

impl Split {
    fn new(recording: Recording, smoothing: &Smoothing) -> Result<Self, SmoothError> {
        let states = recording.tracks.iter().map(|track| smoothing.apply(track)).collect::<Result<_, _>>()?;
        Ok(Self { recording, states })
    }

    /// Trajectories for [`shooting::fit`](crate::shooting::fit).
    pub fn estimated(&self) -> Vec<StateEstimate<'_>> {
        let pairs = self.recording.tracks.iter().zip(&self.states);
        pairs.map(|(track, states)| StateEstimate { track, q: &states.q, v: &states.v }).collect()
    }

    /// States away from the ends of trajectories, or all of them if nothing had to be derived; at most about `most`.
    fn dataset<S: Scalar>(&self, targets: Targets, most: usize) -> Result<Dataset<S>, DatasetError> {
        let n = self.recording.n();
        let stride = self.recording.samples().div_ceil(most.max(1)).max(1);
        let (mut q, mut v, mut a, mut force) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (track, states) in self.recording.tracks.iter().zip(&self.states) {
            let measured = targets == Targets::Measured && !track.a.is_empty();
            // Positions and velocities as measured belong to accelerations as measured.
            let complete = measured && !track.v.is_empty();
            let rows = if complete { 0..track.len() } else { states.interior() };
            for row in rows.step_by(stride) {
                let row = row * n..(row + 1) * n;
                let of = |values: &[f64]| values[row.clone()].iter().map(|&x| S::of_f64(x)).collect::<Vec<S>>();
                let position = of(if complete { &track.q } else { &states.q });
                q.extend(
                    position.iter().zip(&self.recording.periodic).map(|(q, &p)| if p { q.wrap_angle() } else { *q }),
                );
                v.extend(of(if complete { &track.v } else { &states.v }));
                a.extend(of(if measured { &track.a } else { &states.a }));
                if !track.force.is_empty() {
                    force.extend(of(&track.force));
                }
            }
        }
        let data = Dataset::new(n, q, v, a)?;
        if force.is_empty() { Ok(data) } else { data.with_forces(force) }
    }
}

/// Recorded motion, ready to learn from.
#[derive(Clone, Debug)]
pub struct RecordingSplit {
    /// Noise and windows.
    pub smoothing: Smoothing,
    /// The part to train on.
    pub training: Split,
    /// The part that chooses the best epoch.
    pub validation: Split,
    /// The part that judges.
    pub test: Split,
    /// Which part of the recording judges.
    pub(crate) held_out: HeldOut,
    /// Most states of a supervised training.
    most_states: usize,
}

impl RecordingSplit {
    /// Chooses windows, takes derivatives and divides the trajectories. Where nothing is left to choose the best epoch,
    /// what judges does that too.
    ///
    /// # Errors
    /// [`RecordingSplitError`].
    pub fn new(recording: &Recording, preparation: &PrepareOptions) -> Result<Self, RecordingSplitError> {
        let PrepareOptions { smoothing: options, held_out: share, most_states, seed } = preparation;
        let (alone, smoothing) = plan(recording, options)?;
        if let Some((i, how)) = (0..recording.n()).find_map(|i| Some((i, stillness(recording, i, &alone)?))) {
            return Err(RecordingSplitError::Motionless { coordinate: recording.coordinates[i].clone(), how });
        }
        let divide = |recording: &Recording, share: f64| {
            let held_out = HeldOut::choose(recording, share, smoothing.window(), *seed)?;
            let (rest, held) = held_out.divide(recording);
            Ok::<_, HoldOutError>((held_out, rest, held))
        };
        let (held_out, rest, test) = divide(recording, *share)?;
        let (training, validation) = match divide(&rest, share / 2.0) {
            Ok((HeldOut::Nothing, ..)) => (rest.clone(), rest),
            Ok((_, training, validation)) => (training, validation),
            Err(_) => (rest, test.clone()),
        };
        let part = |recording| Split::new(recording, &smoothing);
        let (training, validation, test) = (part(training)?, part(validation)?, part(test)?);
        Ok(Self { training, validation, test, held_out, most_states: *most_states, smoothing })
    }

    /// The way that suits the data.
    pub(crate) fn advice(&self) -> Targets {
        Targets::advised(self.training.recording.has_accelerations(), self.smoothing.acceleration_error())
    }

    /// States and accelerations for a supervised training, validation and test; where nothing is held out, the test is the
    /// validation.
    ///
    /// # Errors
    /// [`RecordingSplitError::Dataset`], if no sample has a full window around it for instance.
    pub fn datasets<S: Scalar>(&self, targets: Targets) -> Result<Datasets<S>, RecordingSplitError> {
        let most = self.most_states;
        let dataset = |which, part: &Split, most| {
            part.dataset::<S>(targets, most).map_err(|source| RecordingSplitError::Dataset { which, source })
        };
        let validation = dataset("validation states", &self.validation, most / 5)?;
        let test = match self.held_out {
            HeldOut::Nothing => validation.clone(),
            _ => dataset("test states", &self.test, most / 5)?,
        };
        Ok(Datasets { training: vec![dataset("training states", &self.training, most)?], validation, test })
    }

    /// Standard deviations of the noise; where data have none, a millionth of their spread.
    pub fn noise(&self) -> Noise {
        let n = self.training.recording.n();
        let spread = |values: fn(&Smoothed) -> &Vec<f64>, i: usize| {
            let all = self.training.states.iter().flat_map(|states| values(states).iter().skip(i).step_by(n));
            all.fold(0.0_f64, |most, x| most.max(x.abs())).max(f64::MIN_POSITIVE.sqrt())
        };
        let coordinates = self.smoothing.coordinates.iter().enumerate();
        let q = coordinates.clone().map(|(i, c)| c.noise.sigma.max(LEAST_NOISE * spread(|s| &s.q, i))).collect();
        let v = coordinates
            .filter_map(|(i, c)| c.velocity_noise.map(|noise| noise.sigma.max(LEAST_NOISE * spread(|s| &s.v, i))))
            .collect();
        Noise { q, v }
    }
}

/// Least noise that is believed, beside the size of the data.
const LEAST_NOISE: f64 = 1e-6;

//! Learning from recorded motion: the training, validation and test parts.
//!
//! Whole trajectories are held out, never rows: neighbouring samples are nearly the same state. Derivatives come from local polynomials
//! ([`Smoothing`]) unless they were measured; a network trained on such accelerations may then be fitted through its motion
//! ([`shooting`](crate::shooting)).

use super::thresholds::LEAST_NOISE;
use crate::data::dataset::{Dataset, DatasetError, Datasets, Noise, StateEstimate, Weighting};
use crate::data::force_sizes::by_forces;
use crate::recording::smooth::{SmoothError, SmoothOptions, Smoothed, Smoothing, noise};
use crate::recording::survey::{Stillness, plan, stillness};
use crate::recording::{HeldOut, HoldOutError, RecordedTrajectory, Recording, Targets};
use crate::rollout::Between;
use crate::scalar::Scalar;
use thiserror::Error;

/// Preparation of recorded motion.
#[derive(Clone, Debug, PartialEq)]
pub struct PrepareOptions {
    /// Settings of the local polynomials.
    pub smoothing: SmoothOptions,
    /// Share of the samples in the test set; half as much of the rest becomes the validation set. With 0, all samples are used for training
    /// and for choosing the best epoch, and there is no test set.
    pub held_out: f64,
    /// Largest number of states for supervised training; longer recordings are thinned evenly.
    pub most_states: usize,
    /// Seed for choosing the trajectories.
    pub seed: u64,
    /// Known forces between the samples.
    pub between: Between,
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self {
            smoothing: SmoothOptions::default(),
            held_out: 0.2,
            most_states: 60_000,
            seed: 0,
            between: Between::default(),
        }
    }
}

/// Why a network cannot learn from the recorded motion.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecordingSplitError {
    /// There is too little data to hold anything out.
    #[error(transparent)]
    HoldOut(#[from] HoldOutError),
    /// The derivatives cannot be estimated.
    #[error(transparent)]
    Smooth(#[from] SmoothError),
    /// A coordinate does not move or is a function of others.
    #[error("{coordinate} {how}; leave it out of the coordinates, or record motion in which it moves independently")]
    Motionless {
        /// Its name.
        coordinate: String,
        /// The reason.
        how: Stillness,
    },
    /// The samples do not form a valid dataset.
    #[error("{which}: {source}")]
    Dataset {
        /// The set: training, validation or test.
        which: &'static str,
        /// The problem.
        source: DatasetError,
    },
}

/// A sample that is used for learning.
struct Row<'a> {
    track: &'a RecordedTrajectory,
    states: &'a Smoothed,
    row: usize,
    /// `true` if its acceleration was measured.
    measured: bool,
}

/// Trajectories with the states estimated from them.
#[derive(Clone, Debug)]
pub struct Split {
    /// The recorded motion.
    pub recording: Recording,
    /// States of every trajectory.
    pub states: Vec<Smoothed>,
    /// Known forces between the samples.
    pub between: Between,
}

impl Split {
    fn new(recording: Recording, smoothing: &Smoothing, between: Between) -> Result<Self, SmoothError> {
        let states = recording.tracks.iter().map(|track| smoothing.apply(track)).collect::<Result<_, _>>()?;
        Ok(Self { recording, states, between })
    }

    /// Trajectories for [`shooting::fit`](crate::shooting::fit).
    pub fn estimated(&self) -> Vec<StateEstimate<'_>> {
        let pairs = self.recording.tracks.iter().zip(&self.states);
        let between = self.between;
        pairs.map(|(track, states)| StateEstimate { track, q: &states.q, v: &states.v, between }).collect()
    }

    /// Training samples: those away from the ends of trajectories, or all of them if no derivative had to be estimated; at most about
    /// `most`. Each has `true` if its acceleration was measured.
    fn rows(&self, targets: Targets, most: usize) -> impl Iterator<Item = Row<'_>> {
        let stride = self.recording.samples().div_ceil(most.max(1)).max(1);
        self.recording.tracks.iter().zip(&self.states).flat_map(move |(track, states)| {
            let measured = targets.takes_measured() && !track.a.is_empty();
            let complete = is_complete(track, targets);
            let rows = if complete { 0..track.len() } else { states.interior() };
            let rows = rows.step_by(stride).filter(move |row| complete || states.is_full(*row));
            rows.map(move |row| Row { track, states, row, measured })
        })
    }

    /// Number of samples excluded from learning because their windows are incomplete: at the ends of trajectories, and near gaps.
    pub(crate) fn left_out(&self, targets: Targets) -> [usize; 2] {
        let derived = self.recording.tracks.iter().zip(&self.states).filter(|(track, _)| !is_complete(track, targets));
        derived.fold([0; 2], |[ends, gaps], (track, states)| {
            [ends + track.len() - states.interior().len(), gaps + states.lacking.len()]
        })
    }

    /// Expected errors of the accelerations of [`dataset`](Self::dataset), `(states, n)`; 0 for measured ones.
    fn errors(&self, targets: Targets, most: usize) -> Vec<f64> {
        let n = self.recording.n();
        let mut errors = Vec::new();
        for Row { states, row, measured, .. } in self.rows(targets, most) {
            let of = |k: usize| if measured { 0.0 } else { states.a_error[k].hypot(states.a_bias[k]) };
            errors.extend((row * n..(row + 1) * n).map(of));
        }
        errors
    }

    /// The states of [`rows`](Self::rows).
    fn dataset<S: Scalar>(&self, targets: Targets, most: usize) -> Result<Dataset<S>, DatasetError> {
        let n = self.recording.n();
        let (mut q, mut v, mut a, mut force) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for Row { track, states, row, measured } in self.rows(targets, most) {
            let complete = is_complete(track, targets);
            let row = row * n..(row + 1) * n;
            let of = |values: &[f64]| values[row.clone()].iter().map(|&x| S::of_f64(x)).collect::<Vec<S>>();
            let position = of(if complete { &track.q } else { &states.q });
            q.extend(position.iter().zip(&self.recording.periodic).map(|(q, &p)| if p { q.wrap_angle() } else { *q }));
            v.extend(of(if complete { &track.v } else { &states.v }));
            a.extend(of(if measured { &track.a } else { &states.a }));
            if !track.force.is_empty() {
                force.extend(of(&track.force));
            }
        }
        let data = Dataset::new(n, q, v, a)?;
        if force.is_empty() { Ok(data) } else { data.with_forces(force) }
    }
}

/// `true` if no derivative has to be estimated, because velocities and accelerations were measured.
fn is_complete(track: &RecordedTrajectory, targets: Targets) -> bool {
    targets.takes_measured() && !track.a.is_empty() && !track.v.is_empty()
}

/// Recorded motion, split for training, validation and test.
#[derive(Clone, Debug)]
pub struct RecordingSplit {
    /// Noise and windows.
    pub smoothing: Smoothing,
    /// The part to train on.
    pub training: Split,
    /// The part that chooses the best epoch.
    pub validation: Split,
    /// The test part.
    pub test: Split,
    /// Which part of the recording is the test part.
    pub(crate) held_out: HeldOut,
    /// Largest number of states for supervised training.
    most_states: usize,
}

impl RecordingSplit {
    /// Chooses windows, estimates derivatives and splits the trajectories. Without a validation set, the test set also chooses the best
    /// epoch.
    ///
    /// # Errors
    /// [`RecordingSplitError`].
    pub fn new(recording: &Recording, preparation: &PrepareOptions) -> Result<Self, RecordingSplitError> {
        let takes: Vec<usize> = (0..recording.tracks.len()).collect();
        Self::of_takes(recording, &takes, preparation)
    }

    /// As [`Self::new`], for trajectories some of which belong together: `takes` has the number of the take of each, see
    /// [`LoadedRecording::takes`](crate::recording::LoadedRecording::takes).
    ///
    /// # Errors
    /// [`RecordingSplitError`].
    pub(crate) fn of_takes(
        recording: &Recording,
        takes: &[usize],
        preparation: &PrepareOptions,
    ) -> Result<Self, RecordingSplitError> {
        let PrepareOptions { smoothing: options, held_out: share, most_states, seed, between } = preparation;
        let (alone, smoothing) = plan(recording, options)?;
        if let Some((i, how)) = stillness(recording, &alone).into_iter().next() {
            return Err(RecordingSplitError::Motionless { coordinate: recording.coordinates[i].clone(), how });
        }
        let divide = |recording: &Recording, takes: &[usize], share: f64| {
            let held_out = HeldOut::choose(recording, takes, share, smoothing.apart(recording), *seed)?;
            let (rest, held) = held_out.divide(recording);
            Ok::<_, HoldOutError>((held_out, rest, held))
        };
        let (held_out, rest, test) = divide(recording, takes, *share)?;
        let kept = takes.iter().enumerate().filter(|(k, _)| !held_out.has_track(*k));
        let kept: Vec<usize> = kept.map(|(_, take)| *take).collect();
        let (training, validation) = match divide(&rest, &kept, share / 2.0) {
            Ok((HeldOut::Nothing, ..)) => (rest.clone(), rest),
            Ok((_, training, validation)) => (training, validation),
            Err(_) => (rest, test.clone()),
        };
        let part = |recording| Split::new(recording, &smoothing, *between);
        let (training, validation, test) = (part(training)?, part(validation)?, part(test)?);
        Ok(Self { training, validation, test, held_out, most_states: *most_states, smoothing })
    }

    /// Chooses the quantity that a network should learn from, based on the quality of the data.
    pub(crate) fn advice(&self) -> Targets {
        Targets::advised(&self.training.recording, &self.smoothing)
    }

    /// Returns states and accelerations for supervised training, validation and test; if nothing is held out, the validation set also
    /// serves as the test set.
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
        let all = Datasets { training: vec![dataset("training states", &self.training, most)?], validation, test };
        if targets == Targets::Forces { self.by_forces(all) } else { Ok(all) }
    }

    /// Converts the datasets to residuals of force.
    fn by_forces<S: Scalar>(&self, data: Datasets<S>) -> Result<Datasets<S>, RecordingSplitError> {
        let (recording, like) = (&self.training.recording, data.training[0].clone());
        let n = recording.n();
        let tracks = || recording.tracks.iter().map(|track| (track.times.as_slice(), track.force.as_slice()));
        let forced = recording.tracks.iter().all(|track| !track.force.is_empty());
        let force: Vec<f64> = (0..n).map(|i| if forced { noise(tracks(), n, i).sigma } else { 0.0 }).collect();
        let measured = recording.has_accelerations();
        let qualities = self.smoothing.coordinates.iter().map(|chosen| chosen.quality.total(2));
        let acceleration: Vec<f64> = qualities.map(|error| if measured { 0.0 } else { error }).collect();
        let errors = [force.as_slice(), acceleration.as_slice()];
        let of =
            |which, set| by_forces(set, &like, errors).map_err(|source| RecordingSplitError::Dataset { which, source });
        let Datasets { training, validation, test } = data;
        let training = training.into_iter().map(|set| of("training states", set)).collect::<Result<_, _>>()?;
        Ok(Datasets { training, validation: of("validation states", validation)?, test: of("test states", test)? })
    }

    /// Estimates the accelerations of the training states with polynomials two degrees higher, which have less bias and more noise. `None`
    /// if the windows are too short for them.
    pub(crate) fn finer_accelerations(&self) -> Option<Vec<f64>> {
        let mut finer = self.smoothing.clone();
        finer.degree += 2;
        let mut part = self.training.clone();
        for (track, states) in part.recording.tracks.iter().zip(&mut part.states) {
            states.a = finer.apply(track).ok()?.a;
        }
        Some(part.dataset::<f64>(Targets::Smoothed, self.most_states).ok()?.a().to_vec())
    }

    /// Weights the training and validation states by `1/(|a| + f m + e)`, where `e` is the expected error of the acceleration and `f` is
    /// positive; `m` is the mean of `|a|` or, if the coordinates `around` define a centre, the median at a similar distance from it.
    ///
    /// # Errors
    /// As [`datasets`](Self::datasets).
    pub(crate) fn weigh<S: Scalar>(
        &self,
        data: Datasets<S>,
        targets: Targets,
        (floor, scale, around): (f64, &[f64], &[usize]),
    ) -> Result<Datasets<S>, RecordingSplitError> {
        let weigh = |which, set, part: &Split, most| {
            let errors = part.errors(targets, most);
            let weighting = Weighting { floor, scale, errors: &errors };
            let set = if around.is_empty() { weighting.relative(set) } else { weighting.by_distance(set, around) };
            set.map_err(|source| RecordingSplitError::Dataset { which, source })
        };
        let Datasets { training, validation, test } = data;
        let training = training.into_iter().map(|set| weigh("training states", set, &self.training, self.most_states));
        let training = training.collect::<Result<_, _>>()?;
        let validation = weigh("validation states", validation, &self.validation, self.most_states / 5)?;
        Ok(Datasets { training, validation, test })
    }

    /// Standard deviations of the noise; for noise-free data, a millionth of their spread.
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn weights_of_recorded_states_count_size_and_error_of_their_accelerations() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut track = |k: usize| {
            let times: Vec<f64> = (0..200).map(|j| 0.05 * f64::from(j)).collect();
            let wave = |t: f64| (1.0 + k as f64) * (2.0 * t + k as f64).sin();
            let q = times.iter().flat_map(|t| [wave(*t), wave(t + 1.0)]).map(|q| q + 0.01 * normal()).collect();
            RecordedTrajectory { name: k.to_string(), times, q, v: vec![], a: vec![], force: vec![] }
        };
        let tracks = (0..10).map(&mut track).collect();
        let recording = Recording { coordinates: vec!["x".into(), "y".into()], periodic: vec![false; 2], tracks };
        let measured = RecordingSplit::new(&recording, &PrepareOptions::default()).unwrap();
        let plain = measured.datasets::<f64>(Targets::Smoothed).unwrap();
        for around in [&[][..], &[0, 1]] {
            let choice = (1.0, &[1.0, 1.0][..], around);
            let weighted = measured.weigh(plain.clone(), Targets::Smoothed, choice).unwrap();
            let without = |set: &Dataset<f64>| {
                let weighting = Weighting { floor: 1.0, scale: &[1.0; 2], errors: &[] };
                let set = set.clone();
                if around.is_empty() { weighting.relative(set) } else { weighting.by_distance(set, around) }.unwrap()
            };
            for (set, plain) in [(&weighted.training[0], &plain.training[0]), (&weighted.validation, &plain.validation)]
            {
                let exact = without(plain);
                assert_eq!((set.q(), set.a()), (plain.q(), plain.a()));
                // Errors are some percentage of the accelerations.
                let ratio = |k: usize| set.weight(k) / exact.weight(k);
                assert!((0..set.len()).all(|k| ratio(k) < 1.0 && ratio(k) > 0.5), "{around:?}");
            }
            assert_eq!(weighted.test, plain.test);
        }
    }
}

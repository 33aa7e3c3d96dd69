//! The bytes of a checkpoint.

use super::fingerprint::{Fingerprint, Saved};
use super::{Ended, OptimizerState, PhaseState, Shot, Snapshot, precision};
use crate::lagrangian::MechanicsError;
use crate::linalg::Failure;
use crate::network::file::{ModelFileError, StoredPrecision};
use crate::optimizers::{Block, Moments, Stored};
use crate::random::RandomGenerator;
use crate::scalar::Scalar;
use crate::storage::container::{Kind, Tensor, Tensors, pack, unpack};
use crate::training::epoch::{Epoch, Means};
use serde::{Deserialize, Serialize};

const CHECKPOINT: Kind = Kind { name: "checkpoint", key: "lnn-checkpoint", format: 1 };

/// Everything but the tensors; numbers that may be infinite are the bits of `f64`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Header {
    format: u32,
    crate_version: String,
    precision: StoredPrecision,
    pub identity: Fingerprint,
    parameters: usize,
    seconds: f64,
    phases: usize,
    polished: bool,
    validation_loss: u64,
    epochs: usize,
    steps: usize,
    states: usize,
    underway: Option<UnderwayHeader>,
}

/// Counts above this are refused: no training reaches it, and adding to what passes cannot overflow.
const MOST: u64 = 1 << 52;

impl Header {
    pub(crate) fn into_saved(self) -> Saved {
        let (epochs, steps) = self.underway.map_or((0, self.steps), |underway| (underway.epochs, underway.step));
        Saved { config: self.identity.config, epochs: self.epochs.saturating_add(epochs), steps }
    }

    fn check_counts(&self) -> Result<(), ModelFileError> {
        let mut counts = vec![self.phases as u64, self.steps as u64, self.states as u64];
        if let Some(u) = &self.underway {
            let whole = [u.averaged_steps, u.epoch, u.step, u.batch].into_iter().chain(u.means.counts);
            counts.extend(whole.map(|count| count as u64));
            // The moments count in 32 bits.
            counts.extend([u.iteration, u64::from(u.moments).saturating_mul(MOST >> 31)]);
        }
        match counts.into_iter().find(|&count| count > MOST) {
            Some(_) => Err(ModelFileError::Header("a count is beyond any training".to_string())),
            None => Ok(()),
        }
    }
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct UnderwayHeader {
    rng: RandomGenerator,
    order: usize,
    moments: u32,
    /// Weight matrices whose moments are taken in eigenbases.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    matrices: Vec<Block>,
    averaged_steps: usize,
    iteration: u64,
    epoch: usize,
    step: usize,
    batch: usize,
    means: StoredMeans,
    epochs: usize,
    best_loss: u64,
    best_epoch: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shooting: Option<ShotHeader>,
}

/// [`Shot`] without its tensors, but with their lengths.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShotHeader {
    seconds: f64,
    start_loss: u64,
    gap: u64,
    /// Starts, validation starts, matrices, Jacobian.
    lengths: [usize; 4],
}

/// Names of the tensors of a [`Shot`].
const SHOT: [&str; 4] = ["shooting.starts", "shooting.validation_starts", "shooting.matrices", "shooting.jacobian"];

impl<S> Shot<S> {
    /// Its tensors in the order of [`SHOT`].
    fn tensors(&self) -> [&[S]; 4] {
        [&self.starts, &self.validation_starts, &self.matrices, &self.jacobian]
    }
}

impl<S> From<&Shot<S>> for ShotHeader {
    fn from(shot: &Shot<S>) -> Self {
        let bits = |x: f64| x.to_bits();
        let lengths = shot.tensors().map(<[S]>::len);
        Self { seconds: shot.seconds, start_loss: bits(shot.start_loss), gap: bits(shot.gap), lengths }
    }
}

/// [`Means`] with bits.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredMeans {
    /// Loss, penalty, norm.
    sums: [u64; 3],
    /// Penalised, left out, skipped, taken.
    counts: [usize; 4],
    /// Row, and the condition number's bits if the mass matrix was singular.
    last_failure: Option<(usize, Option<u64>)>,
}

impl From<&Means> for StoredMeans {
    fn from(means: &Means) -> Self {
        Self {
            sums: [means.loss, means.penalty, means.norm].map(f64::to_bits),
            counts: [means.penalised, means.left_out, means.skipped, means.taken],
            last_failure: means.last_failure.and_then(|failure| match failure {
                MechanicsError::Singular { row, condition } => Some((row, Some(condition.to_bits()))),
                other => other.row().map(|row| (row, None)),
            }),
        }
    }
}

impl From<&StoredMeans> for Means {
    fn from(stored: &StoredMeans) -> Self {
        let ([loss, penalty, norm], [penalised, left_out, skipped, taken]) =
            (stored.sums.map(f64::from_bits), stored.counts);
        let last_failure = stored.last_failure.map(|(row, condition)| {
            let condition = condition.map(f64::from_bits);
            MechanicsError::unsolved(
                row,
                condition.map_or(Failure::NotFinite, |condition| Failure::Singular { condition }),
            )
        });
        Self { loss, penalty, norm, penalised, left_out, skipped, taken, last_failure }
    }
}

/// Numbers in a row of the history.
const COLUMNS: usize = 11;

fn rows(history: &[Epoch]) -> Vec<f64> {
    let row = |e: &Epoch| -> [f64; COLUMNS] {
        [
            e.epoch as f64,
            e.phase as f64,
            e.rate,
            e.training_loss,
            e.penalty,
            e.penalised,
            e.validation_loss,
            e.gradient_norm,
            e.left_out as f64,
            e.skipped as f64,
            e.seconds,
        ]
    };
    history.iter().flat_map(row).collect()
}

fn history(rows: &[f64]) -> Vec<Epoch> {
    let epoch = |&[
        epoch,
        phase,
        rate,
        training_loss,
        penalty,
        penalised,
        validation_loss,
        gradient_norm,
        left_out,
        skipped,
        seconds,
    ]: &[f64; COLUMNS]| Epoch {
        epoch: epoch as usize,
        phase: phase as usize,
        rate,
        training_loss,
        penalty,
        penalised,
        validation_loss,
        gradient_norm,
        left_out: left_out as usize,
        skipped: skipped as usize,
        seconds,
    };
    rows.as_chunks().0.iter().map(epoch).collect()
}

/// The bytes of a checkpoint.
///
/// # Errors
/// A number type that files do not know.
pub(crate) fn encode<S: Scalar>(
    identity: &Fingerprint,
    seconds: f64,
    ended: &Ended<S>,
    underway: Option<&PhaseState<S>>,
) -> Result<Vec<u8>, ModelFileError> {
    let precision = precision::<S>()
        .ok_or_else(|| ModelFileError::Header(format!("no checkpoint can hold {} numbers", S::NAME)))?;
    let vector = |name: &str, numbers: &[S]| Tensor::new(name.to_string(), vec![numbers.len()], numbers, precision);
    let table = |name: &str, history: &[Epoch]| {
        Tensor::new(name.to_string(), vec![history.len(), COLUMNS], &rows(history), StoredPrecision::F64)
    };
    let mut tensors = vec![vector("best", &ended.weights), table("history", &ended.history)];
    if let Some(PhaseState { course, history, best, shooting, .. }) = underway {
        let Stored { first, second, bases, .. } = course.moments.stored();
        tensors.push(vector("weights", &course.weights));
        tensors.push(vector("moments.first", first));
        tensors.push(vector("moments.second", second));
        if !bases.is_empty() {
            tensors.push(vector("moments.bases", &bases));
        }
        tensors.push(vector("average", &course.average));
        tensors.push(Tensor::indices("order".to_string(), &course.order));
        tensors.push(vector("phase.best", best));
        tensors.push(table("phase.history", history));
        let shots = shooting.iter().flat_map(|shot| SHOT.into_iter().zip(shot.tensors()));
        tensors.extend(shots.map(|(name, numbers)| vector(name, numbers)));
    }
    let header = Header {
        format: CHECKPOINT.format,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        precision,
        identity: identity.clone(),
        parameters: ended.weights.len(),
        seconds,
        phases: ended.phases,
        polished: ended.polished,
        validation_loss: ended.validation_loss.to_bits(),
        epochs: ended.history.len(),
        steps: ended.steps,
        states: ended.states,
        underway: underway.map(|PhaseState { course, history, best_loss, best_epoch, shooting, .. }| UnderwayHeader {
            rng: course.rng.clone(),
            order: course.order.len(),
            moments: course.moments.stored().step,
            matrices: course.moments.stored().blocks,
            averaged_steps: course.averaged_steps,
            iteration: course.iteration,
            epoch: course.epoch,
            step: course.step,
            batch: course.batch,
            means: (&course.means).into(),
            epochs: history.len(),
            best_loss: best_loss.to_bits(),
            best_epoch: *best_epoch,
            shooting: shooting.as_ref().map(ShotHeader::from),
        }),
    };
    pack(&CHECKPOINT, &header, tensors)
}

/// The description alone, of a file that is whole.
pub(crate) fn decode_header(bytes: &[u8]) -> Result<Header, ModelFileError> {
    unpack(&CHECKPOINT, bytes).map(|(header, _)| header)
}

/// Description and content of a whole checkpoint; never panics.
pub(crate) fn decode<S: Scalar>(bytes: &[u8]) -> Result<(Header, Snapshot<S>), ModelFileError> {
    let (header, file) = unpack::<Header>(&CHECKPOINT, bytes)?;
    header.check_counts()?;
    let vector = |name: &str| file.numbers::<S>(name, &[header.parameters], header.precision);
    let ended = Ended {
        phases: header.phases,
        polished: header.polished,
        weights: vector("best")?,
        validation_loss: f64::from_bits(header.validation_loss),
        history: table(&file, "history", header.epochs)?,
        steps: header.steps,
        states: header.states,
    };
    let underway = match &header.underway {
        None => None,
        Some(stored) => Some(PhaseState {
            course: OptimizerState {
                rng: stored.rng.clone(),
                order: permutation(file.indices("order", stored.order)?)?,
                weights: vector("weights")?,
                moments: moments(&file, &header, stored)?,
                average: if stored.shooting.is_some() { Vec::new() } else { vector("average")? },
                averaged_steps: stored.averaged_steps,
                iteration: stored.iteration,
                epoch: stored.epoch,
                step: stored.step,
                batch: stored.batch,
                means: (&stored.means).into(),
            },
            history: table(&file, "phase.history", stored.epochs)?,
            best: vector("phase.best")?,
            best_loss: f64::from_bits(stored.best_loss),
            best_epoch: stored.best_epoch,
            shooting: stored.shooting.as_ref().map(|stored| shot(&file, header.precision, stored)).transpose()?,
        }),
    };
    let seconds = header.seconds.max(0.0);
    Ok((header, Snapshot { seconds, ended, underway }))
}

/// The moments and their eigenbases.
fn moments<S: Scalar>(
    file: &Tensors<'_>,
    header: &Header,
    stored: &UnderwayHeader,
) -> Result<Moments<S>, ModelFileError> {
    let unfit = || ModelFileError::Header("matrices: not side by side within the parameters".to_string());
    let numbers = |name: &str, count: usize| file.numbers::<S>(name, &[count], header.precision);
    let first = numbers("moments.first", header.parameters)?;
    let second = numbers("moments.second", header.parameters)?;
    let bases = match Block::numbers(&stored.matrices).ok_or_else(unfit)? {
        0 => Vec::new(),
        count => numbers("moments.bases", count)?,
    };
    Moments::restore(first, second, stored.moments, &stored.matrices, &bases).ok_or_else(unfit)
}

/// The starts of multiple shooting.
fn shot<S: Scalar>(
    file: &Tensors<'_>,
    precision: StoredPrecision,
    stored: &ShotHeader,
) -> Result<Shot<S>, ModelFileError> {
    let numbers = |k: usize| file.numbers::<S>(SHOT[k], &[stored.lengths[k]], precision);
    Ok(Shot {
        seconds: stored.seconds.max(0.0),
        start_loss: f64::from_bits(stored.start_loss),
        gap: f64::from_bits(stored.gap),
        starts: numbers(0)?,
        validation_starts: numbers(1)?,
        matrices: numbers(2)?,
        jacobian: numbers(3)?,
    })
}

fn table(file: &Tensors<'_>, name: &str, epochs: usize) -> Result<Vec<Epoch>, ModelFileError> {
    Ok(history(&file.numbers::<f64>(name, &[epochs, COLUMNS], StoredPrecision::F64)?))
}

/// Every state once, in some order.
fn permutation(order: Vec<u32>) -> Result<Vec<u32>, ModelFileError> {
    let mut seen = vec![false; order.len()];
    for &row in &order {
        match seen.get_mut(row as usize) {
            Some(seen) if !*seen => *seen = true,
            _ => return Err(ModelFileError::Header(format!("order: state {row} is twice there or not at all"))),
        }
    }
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RngStream;
    use rand::Rng;

    fn snapshot() -> (Fingerprint, Snapshot<f32>) {
        let row = |epoch: usize, loss: f64| Epoch {
            epoch,
            phase: 1,
            rate: 0.1,
            training_loss: loss,
            penalty: f64::INFINITY,
            penalised: 0.3,
            validation_loss: 1.0 / 3.0,
            gradient_norm: 5e-324,
            left_out: 7,
            skipped: 8,
            seconds: 9.5,
        };
        let mut rng = RngStream::Order(3).generator(9);
        let mut draw = |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random_range(-1.0..1.0)).collect() };
        let (weights, average, best) = (draw(5), draw(5), draw(5));
        let matrices = [Block { start: 1, rows: 2, cols: 2 }];
        let moments = Moments::restore(draw(5), draw(5), 77, &matrices, &draw(16)).unwrap();
        let mut ended = Ended::none(draw(5));
        ended.history = vec![row(1, 0.25)];
        let means = Means {
            loss: 0.1,
            penalty: f64::INFINITY,
            norm: 0.3,
            penalised: 1,
            left_out: 2,
            skipped: 3,
            taken: 4,
            last_failure: Some(MechanicsError::Singular { row: 3, condition: f64::INFINITY }),
        };
        let course = OptimizerState {
            rng,
            order: vec![2, 0, 1, 3],
            weights,
            moments,
            average,
            averaged_steps: 6,
            iteration: 1,
            epoch: 2,
            step: 11,
            batch: 3,
            means,
        };
        let underway = PhaseState {
            course,
            history: vec![row(2, 0.5)],
            best,
            best_loss: f64::INFINITY,
            best_epoch: 0,
            shooting: None,
        };
        let identity = Fingerprint { config: "a = \"b\"\n".to_string(), data: vec![("test".to_string(), 5)] };
        (identity, Snapshot { seconds: 0.1 + 0.2, ended, underway: Some(underway) })
    }

    #[test]
    fn everything_comes_back() {
        let (identity, snapshot) = snapshot();
        let bytes = |s: &Snapshot<f32>| encode(&identity, s.seconds, &s.ended, s.underway.as_ref()).unwrap();
        let (header, mut back) = decode::<f32>(&bytes(&snapshot)).unwrap();
        assert_eq!((&header.identity, &back), (&identity, &snapshot));
        let draws = |s: &mut Snapshot<f32>| s.underway.as_mut().unwrap().course.rng.random::<u64>();
        assert_eq!(draws(&mut back), draws(&mut snapshot.clone()));
        assert_eq!((snapshot.epochs(), snapshot.steps()), (2, 11));
        let between = Snapshot { underway: None, ..snapshot };
        assert_eq!(decode::<f32>(&bytes(&between)).unwrap().1, between);
    }

    #[test]
    fn multiple_shooting_comes_back() {
        let (identity, mut snapshot) = snapshot();
        let underway = snapshot.underway.as_mut().unwrap();
        underway.course.average.clear();
        underway.shooting = Some(Shot {
            seconds: 0.7,
            start_loss: f64::INFINITY,
            gap: 1.0 / 3.0,
            starts: vec![1.5, -2.25],
            validation_starts: vec![0.1],
            matrices: vec![5.0; 4],
            jacobian: vec![],
        });
        let bytes = encode(&identity, snapshot.seconds, &snapshot.ended, snapshot.underway.as_ref()).unwrap();
        let back = decode::<f32>(&bytes).unwrap().1;
        assert!(back == snapshot && back.is_shooting());
    }

    #[test]
    fn damage_is_refused() {
        let (identity, snapshot) = snapshot();
        let bytes = encode(&identity, 0.0, &snapshot.ended, snapshot.underway.as_ref()).unwrap();
        for length in 0..bytes.len() {
            assert!(decode::<f32>(&bytes[..length]).is_err(), "cut at {length}");
        }
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << (at % 8);
            assert!(decode::<f32>(&flipped).is_err(), "bit flipped at {at}");
        }
        for order in [vec![0, 0, 1, 2], vec![0, 1, 2, 4]] {
            let mut wrong = snapshot.underway.clone();
            wrong.as_mut().unwrap().course.order = order;
            let bytes = encode(&identity, 0.0, &snapshot.ended, wrong.as_ref()).unwrap();
            assert!(decode::<f32>(&bytes).unwrap_err().to_string().contains("order"));
        }
        let model = decode::<f32>(b"\x02\0\0\0\0\0\0\0{}").unwrap_err();
        assert!(model.to_string().contains("checkpoint"), "{model}");
    }
}

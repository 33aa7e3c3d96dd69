//! Serialization of checkpoints.

use super::fingerprint::{Fingerprint, Saved};
use super::{OptimizerState, Outcome, PhaseState, Snapshot};
use crate::learning::state;
use crate::network::file::{ModelFileError, StoredPrecision};
use crate::scalar::Scalar;
use crate::storage::container::{FileKind, Tensor, pack, unpack};
use crate::training::thresholds::LARGEST_COUNT;
use serde::{Deserialize, Serialize};

const CHECKPOINT: FileKind = FileKind { name: "checkpoint", key: "lnn-checkpoint", format: 1 };
/// Name of the only tensor: the serialized state.
const STATE: &str = "state";

/// Summary of a checkpoint, read without its state.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Header {
    format: u32,
    crate_version: String,
    precision: StoredPrecision,
    pub identity: Fingerprint,
    epochs: usize,
    steps: usize,
}

impl Header {
    pub(crate) fn into_saved(self) -> Saved {
        Saved { config: self.identity.config, epochs: self.epochs, steps: self.steps }
    }
}

/// Serializes a checkpoint.
///
/// # Errors
/// A number type that files do not know.
pub(crate) fn encode<S: Scalar>(
    identity: &Fingerprint,
    seconds: f64,
    outcome: &Outcome<S>,
    in_progress: Option<&PhaseState<S>>,
) -> Result<Vec<u8>, ModelFileError> {
    let precision = StoredPrecision::of::<S>()
        .ok_or_else(|| ModelFileError::Header(format!("no checkpoint can hold {} numbers", S::NAME)))?;
    let header = Header {
        format: CHECKPOINT.format,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        precision,
        identity: identity.clone(),
        epochs: outcome.history.len() + in_progress.map_or(0, |in_progress| in_progress.history.len()),
        steps: in_progress.map_or(outcome.steps, |in_progress| in_progress.optimizer_state.step),
    };
    let state = state::to_bytes(&(seconds, outcome, in_progress))?;
    pack(&CHECKPOINT, &header, vec![Tensor::bytes(STATE.to_string(), state)])
}

/// Reads only the header of an intact file.
pub(crate) fn decode_header(bytes: &[u8]) -> Result<Header, ModelFileError> {
    unpack(&CHECKPOINT, bytes).map(|(header, _)| header)
}

/// Reads header and content of a checkpoint; never panics.
pub(crate) fn decode<S: Scalar>(bytes: &[u8]) -> Result<(Header, Snapshot<S>), ModelFileError> {
    let (header, file) = unpack::<Header>(&CHECKPOINT, bytes)?;
    file.check_names(|name| name == STATE)?;
    let (seconds, outcome, in_progress): (f64, Outcome<S>, Option<PhaseState<S>>) =
        state::from_bytes(file.bytes(STATE)?)?;
    let refused = |problem: &str| ModelFileError::Header(problem.to_string());
    outcome.check().map_err(refused)?;
    in_progress.as_ref().map_or(Ok(()), |in_progress| in_progress.check(outcome.weights.len())).map_err(refused)?;
    Ok((header, Snapshot { seconds: seconds.max(0.0), outcome, in_progress }))
}

/// Checks that no count is implausibly large.
fn check_counts(counts: impl IntoIterator<Item = u64>) -> Result<(), &'static str> {
    if counts.into_iter().any(|count| count > LARGEST_COUNT) { Err("a count is beyond any training") } else { Ok(()) }
}

impl<S> Outcome<S> {
    fn check(&self) -> Result<(), &'static str> {
        check_counts([self.phases, self.steps, self.states].map(|count| count as u64))
    }
}

impl<S: Scalar> PhaseState<S> {
    /// Checks that the parts are consistent with each other and with a network of `parameters` weights.
    fn check(&self, parameters: usize) -> Result<(), &'static str> {
        let OptimizerState { order, weights, moments, average, iteration, means, .. } = &self.optimizer_state;
        let counts = [
            self.optimizer_state.averaged_steps,
            self.optimizer_state.epoch,
            self.optimizer_state.step,
            self.optimizer_state.batch,
        ];
        check_counts(counts.into_iter().chain(means.counts()).map(|count| count as u64).chain([*iteration]))?;
        // A learner with its own state may lack an average.
        let averaged = average.len() == parameters || (self.learner.is_some() && average.is_empty());
        if [weights, &self.best].iter().any(|numbers| numbers.len() != parameters) || !averaged {
            return Err("the weights of a step are not those of the network");
        }
        if !moments.fit(parameters) {
            return Err("the moments do not fit the weights");
        }
        let mut seen = vec![false; order.len()];
        let fresh = |&row: &u32| seen.get_mut(row as usize).is_some_and(|seen| !std::mem::replace(seen, true));
        if order.iter().all(fresh) { Ok(()) } else { Err("a state is twice in the order or not at all") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::MechanicsError;
    use crate::optimizers::{Method, Moments, Update};
    use crate::random::RngStream;
    use crate::training::epoch::{Epoch, Means};
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
        let mut moments = Moments::for_method(Method::Soap, 5, [(1, 2, 2)]);
        let update = Update { method: Method::Soap, rate: 0.1, weight_decay: 0.0, decaying: 5, clip: 1.0 };
        for _ in 0..11 {
            moments.update(&mut draw(5), &mut draw(5), &update);
        }
        let mut outcome = Outcome::none(draw(5));
        outcome.history = vec![row(1, 0.25)];
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
        let optimizer_state = OptimizerState {
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
        let in_progress = PhaseState {
            optimizer_state,
            history: vec![row(2, 0.5)],
            best,
            best_loss: f64::INFINITY,
            best_epoch: 0,
            learner: None,
        };
        let identity = Fingerprint { config: "a = \"b\"\n".to_string(), data: vec![("test".to_string(), 5)] };
        (identity, Snapshot { seconds: 0.1 + 0.2, outcome, in_progress: Some(in_progress) })
    }

    #[test]
    fn everything_comes_back() {
        let (identity, snapshot) = snapshot();
        let bytes = |s: &Snapshot<f32>| encode(&identity, s.seconds, &s.outcome, s.in_progress.as_ref()).unwrap();
        let (header, mut back) = decode::<f32>(&bytes(&snapshot)).unwrap();
        assert_eq!((&header.identity, &back), (&identity, &snapshot));
        let draws = |s: &mut Snapshot<f32>| s.in_progress.as_mut().unwrap().optimizer_state.rng.random::<u64>();
        assert_eq!(draws(&mut back), draws(&mut snapshot.clone()));
        assert_eq!((snapshot.epochs(), snapshot.steps()), (2, 11));
        let between = Snapshot { in_progress: None, ..snapshot };
        assert_eq!(decode::<f32>(&bytes(&between)).unwrap().1, between);
    }

    #[test]
    fn the_state_of_a_learner_comes_back() {
        let (identity, mut snapshot) = snapshot();
        let in_progress = snapshot.in_progress.as_mut().unwrap();
        in_progress.optimizer_state.average.clear();
        in_progress.learner = Some(vec![1, 2, 255]);
        let bytes = encode(&identity, snapshot.seconds, &snapshot.outcome, snapshot.in_progress.as_ref()).unwrap();
        let back = decode::<f32>(&bytes).unwrap().1;
        assert!(back == snapshot && back.is_shooting());
    }

    /// Errors that a checksum does not detect: numbers that no training produces.
    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let refused = |change: fn(&mut Snapshot<f32>)| {
            let (identity, mut snapshot) = snapshot();
            change(&mut snapshot);
            let bytes = encode(&identity, 0.0, &snapshot.outcome, snapshot.in_progress.as_ref()).unwrap();
            assert!(matches!(decode::<f32>(&bytes), Err(ModelFileError::Header(_))));
        };
        fn optimizer_state(snapshot: &mut Snapshot<f32>) -> &mut OptimizerState<f32> {
            &mut snapshot.in_progress.as_mut().unwrap().optimizer_state
        }
        refused(|s| optimizer_state(s).order = vec![0, 0, 1, 2]);
        refused(|s| optimizer_state(s).order = vec![0, 1, 2, 4]);
        refused(|s| optimizer_state(s).weights.truncate(4));
        refused(|s| optimizer_state(s).average.truncate(4));
        refused(|s| optimizer_state(s).moments = Moments::new(4));
        refused(|s| optimizer_state(s).step = usize::MAX);
        refused(|s| optimizer_state(s).means.taken = usize::MAX);
        refused(|s| s.outcome.weights.truncate(4));
        refused(|s| s.outcome.states = usize::MAX);
    }

    #[test]
    fn damage_is_refused() {
        let (identity, snapshot) = snapshot();
        let bytes = encode(&identity, 0.0, &snapshot.outcome, snapshot.in_progress.as_ref()).unwrap();
        for length in 0..bytes.len() {
            assert!(decode::<f32>(&bytes[..length]).is_err(), "cut at {length}");
        }
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << (at % 8);
            assert!(decode::<f32>(&flipped).is_err(), "bit flipped at {at}");
        }
        let model = decode::<f32>(b"\x02\0\0\0\0\0\0\0{}").unwrap_err();
        assert!(model.to_string().contains("checkpoint"), "{model}");
    }
}

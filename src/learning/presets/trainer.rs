//! Learning from arrays of states: the quick preset's choices, changed by a builder.

use crate::configuration::{Config, ConfigError, Precision};
use crate::data::{Dataset, DatasetError, Datasets, Weighting};
use crate::findings::Findings;
use crate::lagrangian::{ConstraintFormulaError, EulerLagrange, FormulaConstraints};
use crate::names::{number, pluralize};
use crate::network::file::{Header, ModelFile, ModelFileError};
use crate::network::{NetworkError, NetworkLagrangian, Structure};
use crate::presets::preset::{of_states, take_structure};
use crate::random::RngStream;
use crate::scalar::Scalar;
use crate::training::{Epoch, Hooks, StopReason, TrainingError, train};
use rand::seq::SliceRandom;
use std::collections::BTreeMap;
use std::path::Path;
use thiserror::Error;

/// Share of the states for validation, and share for the test.
const HELD_OUT: f64 = 0.1;

/// A training on states with accelerations.
///
/// A tenth of the states, drawn by the seed, chooses the best epoch, and another tenth judges the result. The choices are those of the
/// preset `quick`: keep them if unsure.
///
/// | choice | default |
/// |---|---|
/// | [`hidden`](Self::hidden) | three layers of 128 |
/// | [`structure`](Self::structure) | a black box under a penalty on negative eigenvalues |
/// | [`epochs`](Self::epochs) | 40 |
/// | [`precision`](Self::precision) | `f32` |
/// | [`seed`](Self::seed), [`threads`](Self::threads) | 0, 1; results do not depend on threads |
/// | [`constraints`](Self::constraints) | none |
///
/// ```
/// use lnn::prelude::*;
///
/// // A pendulum of 1 m: a = -9.81 sin q.
/// let q: Vec<f64> = (0..600).map(|k| 6.28 * (0.618 * k as f64 % 1.0)).collect();
/// let v: Vec<f64> = (0..600).map(|k| 6.0 * (0.414 * k as f64 % 1.0) - 3.0).collect();
/// let a = q.iter().map(|q| -9.81 * q.sin()).collect();
/// let data = Dataset::new(1, q, v, a)?;
///
/// let trainer = Trainer::new(&data).angles(&[0]).structure(Structure::Mechanical);
/// let learned = trainer.hidden(&[16]).batch(32).epochs(40).train()?; // small: this runs in a moment
/// let a = learned.model.acceleration(&[0.5], &[1.0])?;
/// assert!((a[0] + 9.81 * 0.5_f64.sin()).abs() < 1.0);
/// # let directory = tempfile::tempdir()?;
/// # let path = directory.path().join("model.safetensors");
/// learned.save(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Trainer<'a> {
    data: &'a Dataset<f64>,
    names: Vec<String>,
    angles: Vec<usize>,
    constraints: BTreeMap<String, String>,
    config: Config,
    threads: usize,
}

/// A network learned from states.
#[derive(Debug)]
pub struct Learned {
    /// The network with its best weights.
    pub model: NetworkLagrangian<f64>,
    /// One row per epoch.
    pub history: Vec<Epoch>,
    /// Best validation loss: half the mean absolute error of the scaled accelerations.
    pub validation_loss: f64,
    /// The same loss on the test states.
    pub test_loss: f64,
    /// Why the training ended.
    pub stop: StopReason,
    /// Contents of the model file except the weights.
    pub header: Header,
}

impl Learned {
    /// The losses and the length of the training, in a sentence.
    pub fn findings(&self) -> Findings {
        let [validation, fresh] = [self.validation_loss, self.test_loss].map(number);
        let epochs = pluralize(self.history.len(), "epoch", "epochs");
        let mut findings = Findings::default();
        findings.line(format!("loss (paper): validation {validation}, held-out states {fresh}; {epochs}"));
        findings
    }
}

/// Failure of a [`Trainer`].
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainerError {
    /// Fewer states than the three parts need.
    #[error("{found} states: at least 3 are needed (training, validation, test)")]
    TooFew {
        /// States given.
        found: usize,
    },
    /// Coordinate names are too many, too few or not distinct, or an angle is not a coordinate.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The shape of the network is inconsistent.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Training failed.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The constraints have a mistake, contradict each other or leave no motion.
    #[error(transparent)]
    Constraints(#[from] ConstraintFormulaError),
    /// A constraint is not finite at a state, or the states already have constraint rows.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

impl<'a> Trainer<'a> {
    /// Creates a trainer for these states, whose coordinates are called `q1`, `q2`, ...
    pub fn new(data: &'a Dataset<f64>) -> Self {
        let names = (1..=data.coordinates()).map(|i| format!("q{i}")).collect();
        Self { data, names, angles: Vec::new(), constraints: BTreeMap::new(), config: of_states(), threads: 1 }
    }

    /// Names the coordinates for messages and for the model file.
    pub fn coordinates(self, names: &[&str]) -> Self {
        Self { names: names.iter().map(|name| name.to_string()).collect(), ..self }
    }

    /// Marks coordinates, by index from 0, as angles in rad; the Lagrangian becomes periodic in them.
    pub fn angles(self, indices: &[usize]) -> Self {
        Self { angles: indices.to_vec(), ..self }
    }

    /// Constraints on the states, by name: formulas over the names of the coordinates and `NAME_dot` that vanish, such as `("rod", "x^2 +
    /// y^2 - 1")`. They are kept in the model's file; those that follow from others are left out.
    pub fn constraints(self, formulas: &[(&str, &str)]) -> Self {
        let constraints = formulas.iter().map(|(name, formula)| (name.to_string(), formula.to_string())).collect();
        Self { constraints, ..self }
    }

    /// Sets the structure of the network; a structure fixes the signature of the mass matrix and replaces the penalty of a black box.
    pub fn structure(mut self, structure: Structure) -> Self {
        take_structure(&mut self.config, structure, None);
        self
    }

    /// Widths of the hidden layers.
    pub fn hidden(mut self, widths: &[usize]) -> Self {
        self.config.network.hidden = widths.to_vec();
        self
    }

    /// Number of passes through the states; the learning rate falls to 0 over them.
    pub fn epochs(mut self, epochs: usize) -> Self {
        for phase in &mut self.config.phases {
            (phase.epochs, phase.t_max) = (epochs, epochs as f64);
        }
        self
    }

    /// States per step.
    pub fn batch(mut self, states: usize) -> Self {
        self.config.optimizer.batch = states;
        self
    }

    /// Precision of weights and arithmetic in training.
    pub fn precision(mut self, precision: Precision) -> Self {
        self.config.precision = precision;
        self
    }

    /// Seed of the weights, of the split and of the order of the states.
    pub fn seed(mut self, seed: u64) -> Self {
        self.config.seed = seed;
        self
    }

    /// Number of threads; results do not depend on it.
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Changes any other setting of the [`Config`].
    pub fn configure(mut self, change: impl FnOnce(&mut Config)) -> Self {
        change(&mut self.config);
        self
    }

    /// Trains.
    ///
    /// # Errors
    /// [`TrainerError`].
    pub fn train(self) -> Result<Learned, TrainerError> {
        self.train_watched(&Hooks::default())
    }

    /// Trains like [`Self::train`], with hooks: if the interrupt flag is raised, training ends with the best weights so far.
    ///
    /// # Errors
    /// [`TrainerError`].
    pub fn train_watched(self, hooks: &Hooks) -> Result<Learned, TrainerError> {
        match self.config.precision {
            Precision::F32 => self.train_in::<f32>(hooks),
            Precision::F64 => self.train_in::<f64>(hooks),
        }
    }

    fn train_in<S: Scalar>(self, hooks: &Hooks) -> Result<Learned, TrainerError> {
        let Self { data, names, angles, constraints, mut config, threads } = self;
        let (n, found) = (data.coordinates(), data.len());
        let fault = |field: &str, expected: &'static str, found| ConfigError {
            field: field.to_string(),
            expected: expected.into(),
            found,
        };
        if names.len() != n {
            let found = format!("{} for {n}", names.len());
            return Err(fault("coordinates", "a name for each coordinate", found).into());
        }
        if let Some(angle) = angles.iter().find(|angle| **angle >= n) {
            return Err(fault("angles", "indices of coordinates, from 0", angle.to_string()).into());
        }
        if found < 3 {
            return Err(TrainerError::TooFew { found });
        }
        let constraints = match constraints.is_empty() {
            true => None,
            false => Some(FormulaConstraints::new(&names, constraints)?.independent(data.q(), data.v())?.0),
        };
        let held;
        let data = match &constraints {
            None => data,
            Some(constraints) => {
                held = data.clone().on(&constraints.manifold().map_err(ConstraintFormulaError::from)?)?;
                &held
            }
        };
        let mut order: Vec<usize> = (0..found).collect();
        order.shuffle(&mut RngStream::HeldOut.generator(config.seed));
        let part = ((HELD_OUT * found as f64) as usize).max(1);
        let (validation, rest) = order.split_at(part);
        let (test, training) = rest.split_at(part);
        let [training, validation, test] = [training, validation, test].map(|rows| data.rows(rows).cast::<S>());
        (config.data.training, config.data.validation, config.data.test) =
            (training.len(), validation.len(), test.len());
        let scale = training.physical_scale();
        let weighting = Weighting { floor: config.data.acceleration_weighting, scale: &scale, errors: &[] };
        let training = weighting.relative(training)?;
        let periodic = (0..n).map(|i| angles.contains(&i)).collect();
        let architecture = config.architecture_with(names.iter().map(String::as_str), periodic, scale)?;
        architecture.validate()?;
        let penalty = config.penalty.resolve(names.iter().map(String::as_str))?;
        let ranges = training.ranges();
        let data = Datasets { training: vec![training; config.phases.len()], validation, test };
        let trained = train(&config, &architecture, penalty, data, threads, hooks)?;
        let columns = names.iter().cloned().chain(names.iter().map(|name| format!("{name}_dot"))).collect();
        let mut header = config.header(architecture.clone(), columns, ranges, trained.validation_loss);
        header.constraints = constraints.map(|constraints| constraints.formulas().clone()).unwrap_or_default();
        let model = NetworkLagrangian::new(architecture, trained.weights)?.cast::<f64>();
        let (history, validation_loss) = (trained.history, trained.validation_loss);
        let test_loss = trained.test.loss.to_f64();
        Ok(Learned { model, history, validation_loss, test_loss, stop: trained.stop, header })
    }
}

impl Learned {
    /// The learned motion: that of the model, under its constraints if it has any.
    ///
    /// # Errors
    /// None of a model that was just learned.
    pub fn motion(&self) -> Result<Box<dyn EulerLagrange<f64> + '_>, ModelFileError> {
        self.header.constrain(Box::new(&self.model as &dyn EulerLagrange<f64>))
    }

    /// Writes the model file atomically.
    ///
    /// # Errors
    /// [`ModelFileError`] of names that a file cannot hold, or of the file system.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), ModelFileError> {
        let (header, weights) = (self.header.clone(), self.model.weights().to_vec());
        ModelFile { header, weights }.save(path.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Regularizer;
    use crate::lagrangian::EulerLagrange;

    /// Two uncoupled oscillators, `a_i = -(i + 1) q_i`.
    fn states(count: usize) -> Dataset<f64> {
        let number = |k: usize, step: f64| 2.0 * (step * k as f64 % 1.0) - 1.0;
        let q: Vec<f64> = (0..count).flat_map(|k| [number(k, 0.618), number(k, 0.414)]).collect();
        let v: Vec<f64> = (0..count).flat_map(|k| [number(k, 0.732), number(k, 0.236)]).collect();
        let a = q.iter().enumerate().map(|(k, q)| -((k % 2 + 1) as f64) * q).collect();
        Dataset::new(2, q, v, a).unwrap()
    }

    #[test]
    fn a_model_comes_back_from_its_file() {
        let data = states(300);
        let trainer = Trainer::new(&data).coordinates(&["x", "y"]).structure(Structure::Mechanical);
        let trainer = trainer.hidden(&[8]).batch(16).epochs(10).precision(Precision::F64);
        let learned = trainer.clone().train().unwrap();
        assert!(learned.validation_loss < learned.history[0].validation_loss && learned.test_loss < 1.0);
        assert_eq!(learned.history.len(), 10);
        let again = trainer.clone().threads(2).train().unwrap();
        assert_eq!(again.model.weights(), learned.model.weights());
        assert_ne!(trainer.clone().seed(1).train().unwrap().model.weights(), learned.model.weights());
        let weighted = trainer.configure(|config| config.data.acceleration_weighting = 0.1).train().unwrap();
        assert_ne!(weighted.model.weights(), learned.model.weights());
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("model.safetensors");
        learned.save(&path).unwrap();
        let file = ModelFile::<f64>::load(&path).unwrap();
        assert_eq!(file.header.columns, ["x", "y", "x_dot", "y_dot"]);
        let loaded = NetworkLagrangian::new(file.header.architecture, file.weights).unwrap();
        let (q, v) = ([0.3, -0.2], [0.1, 0.4]);
        assert_eq!(loaded.acceleration(&q, &v), learned.model.acceleration(&q, &v));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let data = states(30);
        let refusal = |trainer: Trainer<'_>| trainer.train().unwrap_err();
        let new = || Trainer::new(&data);
        assert!(matches!(refusal(new().coordinates(&["x"])), TrainerError::Config(e) if e.field == "coordinates"));
        assert!(matches!(refusal(new().angles(&[2])), TrainerError::Config(e) if e.field == "angles"));
        let penalty = Regularizer::LorentzianSylvester { lambda: 1.0, time: "t".to_string() };
        assert!(
            matches!(refusal(new().configure(|config| config.penalty = penalty)), TrainerError::Config(e) if e.field == "penalty.time")
        );
        assert!(matches!(refusal(new().epochs(0)), TrainerError::Training(TrainingError::Config(_))));
        let few = states(2);
        assert!(matches!(refusal(Trainer::new(&few)), TrainerError::TooFew { found: 2 }));
    }
}

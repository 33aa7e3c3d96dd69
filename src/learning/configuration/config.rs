//! Everything that determines a training run; written beside every model as `config.toml`.

use crate::configuration::error::{ConfigError, Faults, place};
use crate::configuration::penalty::Regularizer;
use crate::lagrangian::{Description, SystemInstance, pair};
use crate::network::file::MAX_WIDTH;
use crate::network::{ActivationChoice, Factor, Form, Initialization, InputLayer, Radial, Structure};
use crate::optimizers::Method;
use crate::optimizers::Schedule;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Precision of weights and arithmetic in training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// Reaction to a state without a finite acceleration or a gradient that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum OnFailure {
    /// States with a singular mass matrix are left out; a step that is not finite is skipped, weights unchanged.
    Skip,
    /// Training stops before the weights change and says step and row.
    Stop,
}

/// Scaling of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Scaling {
    /// `s_i` is the largest of `|q_i|` and `|v_i|` over the training set of the first phase.
    Physical,
    /// All `s_i` are 1.
    None,
}

/// Epochs of a phase or of multiple shooting at most, and iterations of L-BFGS: years.
pub(crate) const MOST_EPOCHS: usize = 1 << 24;
/// States of a set, or of a step, at most; their memory is looked at beside.
const MOST_STATES: usize = 1 << 30;
/// Largest weight of a penalty: beside it single precision has no digit of the loss left.
pub(crate) const MOST_LAMBDA: f64 = 1e12;
/// Highest learning rate.
pub(crate) const MOST_RATE: f64 = 1000.0;

/// A complete training run. Keys that are not listed are refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Name of the system.
    pub system: String,
    /// Seed of everything random: states, weights, order of the data.
    pub seed: u64,
    /// Precision of weights and arithmetic.
    pub precision: Precision,
    /// Model whose weights the training starts from, instead of random ones: a file, or the directory of a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Parameters of the system; those that are not given have its defaults.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
    /// The system itself, if it is none of the catalogue's; its name is `system`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<Description>,
    /// Sampled states.
    pub data: Data,
    /// Shape of the network.
    pub network: Network,
    /// Penalty on the mass matrix.
    #[serde(default)]
    pub penalty: Regularizer,
    /// Update rule.
    pub optimizer: Optimizer,
    /// Phases in order, each from the best weights of the one before.
    #[serde(rename = "phase")]
    pub phases: Vec<Phase>,
    /// Full-batch L-BFGS after the last phase.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lbfgs: Option<Lbfgs>,
}

/// Full-batch L-BFGS in double precision on the states of the last phase, from the best weights so far.
///
/// Keys that are not given have their defaults: 100 iterations, 20 pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Lbfgs {
    /// Iterations at most.
    pub iterations: usize,
    /// Pairs of steps and gradient differences that are kept.
    pub memory: usize,
}

impl Default for Lbfgs {
    fn default() -> Self {
        Self { iterations: 100, memory: 20 }
    }
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// States that are sampled uniformly within bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Number of training states.
    pub training: usize,
    /// Number of validation states; the best epoch is chosen on them.
    pub validation: usize,
    /// Fraction of the training states of a system with a mass shell that are drawn off it: their velocity is `u` times one on
    /// the shell, `|u|` from 0.03 to 1 and uniform in its logarithm, of either sign, their acceleration `u^2` times as
    /// large, as for every geodesic, and their residuals weigh `1/u^2` in the training loss. On the shell alone the metric
    /// is not identifiable.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub rescaled_fraction: f64,
    /// Fraction of the training states that lie on exact motions from the starts of the system's trajectory test, at any
    /// time with equal chance, as long as these stay within the bounds of the phase. A [`Phase::log_uniform`] coordinate is so
    /// in half of the starts as well; `rescaled_fraction` and `acceleration_weighting` treat these states like all others.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub trajectory_fraction: f64,
    /// With a number `f` above 0 a training state weighs `f m / (f m + |a|)`, `|a|` the mean size of its scaled accelerations
    /// and `m` the mean over all states: errors count relative to accelerations above `f m`, and a few large ones do not
    /// outweigh the others.
    ///
    /// A fit adds the error to expect of a smoothed acceleration to `|a|`; with [radial coordinates](Network::radial) a state weighs
    /// `1/(|a| + f m)`, `m` the median about as far from the centre. The same weights choose its best epoch.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub acceleration_weighting: f64,
    /// Names of Cartesian coordinates around a centre: all states are drawn in a [`Shell`] around it, training, validation and test,
    /// instead of the boxes of these coordinates and of the velocities; empty for none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shell: Vec<String>,
    /// Lowest and highest distance of the shell from its centre, in the unit of the coordinates.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "pair::optional")]
    pub shell_radius: Option<[f64; 2]>,
    /// Largest rapidity of states in a shell; 1 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rapidity: Option<f64>,
    /// Number of fresh states on which the final model is judged.
    pub test: usize,
    /// Validation and test bounds of each coordinate; states of one's own, recorded ones, need none.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
    pub validation_position: Vec<[f64; 2]>,
    /// Validation and test bounds of each velocity; those of a velocity that a mass shell fixes mean nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
    pub validation_velocity: Vec<[f64; 2]>,
}

/// States in a shell around a centre: directions uniform over the sphere, distances uniform in their logarithm.
///
/// Velocities are those of free fall: rapidities uniform from 0 to `rapidity`, in any direction of the local frame of an observer whom the
/// surface of equal time sees at rest. With [`Data::acceleration_weighting`] `f` a training state weighs `1/(|a| + f m)`, `m` the
/// median of `|a|` among the states about as far from the centre: near and far count alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell<'a> {
    /// Names of the Cartesian coordinates around the centre.
    pub coordinates: &'a [String],
    /// Lowest and highest distance from it, in the unit of the coordinates.
    pub radius: [f64; 2],
    /// Largest rapidity.
    pub rapidity: f64,
}

impl Data {
    /// The shell in which states are drawn, if there is one.
    ///
    /// # Errors
    /// A shell without radius.
    pub(crate) fn shell(&self) -> Result<Option<Shell<'_>>, ConfigError> {
        if self.shell.is_empty() {
            return Ok(None);
        }
        let radius = self.shell_radius.ok_or_else(|| ConfigError {
            field: "data.shell_radius".to_string(),
            expected: "[low, high] beside data.shell".into(),
            found: "none".to_string(),
        })?;
        Ok(Some(Shell { coordinates: &self.shell, radius, rapidity: self.rapidity.unwrap_or(1.0) }))
    }
}

/// Shape of the network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Network {
    /// Widths of the hidden layers; the branches of a hybrid share them equally.
    pub hidden: Vec<usize>,
    /// Activation of the hidden layers.
    pub activation: ActivationChoice,
    /// Factor of the added `|v|^2` of scaled velocities.
    pub alpha: f64,
    /// Name of the coordinate whose square counts negative in the added term, `alpha (-t'^2 + x'^2 + ..)`; without it all
    /// squares are added.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_like: Option<String>,
    /// Scaling of the coordinates.
    pub scaling: Scaling,
    /// Feed sine and cosine of periodic coordinates.
    pub embed_periodic: bool,
    /// Layer before the first dense one.
    #[serde(default)]
    pub input_layer: InputLayer,
    /// Units of a learned Rayleigh dissipation; without it the motion keeps its energy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dissipation: Option<usize>,
    /// Structure of the Lagrangian: how it is made of the network's outputs.
    #[serde(default)]
    pub structure: Structure,
    /// Factor of the kinetic energy or the metric of a structure.
    #[serde(default)]
    pub factor: Factor,
    /// Names of the coordinates that the Lagrangian does not depend on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cyclic: Vec<String>,
    /// Names of groups of Cartesian coordinates around a centre that enter by direction and distance, see [`Radial`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub radial: Vec<Vec<String>>,
    /// Distance that counts as 1 for them, in the unit of the coordinates; 1 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radial_unit: Option<f64>,
    /// `true` if the Lagrangian is even in the velocities.
    #[serde(default)]
    pub even_in_v: bool,
    /// `true` if `alpha` is learned.
    #[serde(default)]
    pub learn_alpha: bool,
    /// A Lagrangian that is known and added: a grey box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known: Option<Known>,
    /// Distribution of the initial weights.
    pub initialization: Initialization,
}

/// The known part of a grey box: a file, as a user writes it, or what it says, as a run keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Known {
    /// Path of a system file.
    File(String),
    /// Its content.
    Description(Box<Description>),
}

/// Update rule.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optimizer {
    /// Update rule.
    pub method: Method,
    /// States per step.
    pub batch: usize,
    /// L2 weight decay, added to the gradient.
    pub weight_decay: f64,
    /// The gradient's norm is cut to this.
    pub clip: f64,
    /// Weights are averaged over about `1/(1 - averaging)` steps for validation and the final model; 0: not averaged.
    pub averaging: f64,
    /// Reaction to a step that fails.
    pub on_failure: OnFailure,
}

/// A stretch of training with its own states and learning rates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// Passes through the training states.
    pub epochs: usize,
    /// Initial learning rate.
    pub rate: f64,
    /// Lowest learning rate.
    pub eta_min: f64,
    /// Course of the rate.
    pub schedule: Schedule,
    /// Epochs from highest to lowest rate of `cosine-annealing`.
    pub t_max: f64,
    /// Training bounds of each coordinate; states of one's own, recorded ones, need none.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
    pub position: Vec<[f64; 2]>,
    /// Training bounds of each velocity; those of a velocity that a mass shell fixes mean nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
    pub velocity: Vec<[f64; 2]>,
    /// For which coordinates half of the training states are uniform in the logarithm, where the low end of the bounds needs more
    /// of them than its length; none if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub log_uniform: Vec<bool>,
}

impl Network {
    /// Index of the coordinate [`time_like`](Self::time_like) among these names, if there is one.
    ///
    /// # Errors
    /// A name that is none of them.
    pub(crate) fn time_like_index<'a>(
        &self,
        coordinates: impl Iterator<Item = &'a str>,
    ) -> Result<Option<usize>, ConfigError> {
        self.time_like.as_ref().map(|name| place("network.time_like", name, coordinates)).transpose()
    }
}

impl Network {
    /// Knowledge of the Lagrangian beforehand, for coordinates with these names.
    ///
    /// # Errors
    /// A cyclic or radial coordinate that is none of them.
    pub(crate) fn form<'a>(&self, coordinates: impl Iterator<Item = &'a str> + Clone) -> Result<Form, ConfigError> {
        let index = |name: &String| place("network.cyclic", name, coordinates.clone());
        let radial = |group: &Vec<String>| -> Result<Radial, ConfigError> {
            let place = |name: &String| place("network.radial", name, coordinates.clone());
            let coordinates = group.iter().map(place).collect::<Result<_, _>>()?;
            Ok(Radial { coordinates, unit: self.radial_unit.unwrap_or(1.0) })
        };
        Ok(Form {
            radial: self.radial.iter().map(radial).collect::<Result<_, _>>()?,
            structure: self.structure,
            factor: self.factor,
            cyclic: self.cyclic.iter().map(index).collect::<Result<_, _>>()?,
            even_in_v: self.even_in_v,
            learn_alpha: self.learn_alpha,
            known: match &self.known {
                Some(Known::Description(description)) => Some(description.clone()),
                // Whoever reads a configuration reads the file too.
                Some(Known::File(_)) | None => None,
            },
        })
    }
}

impl Config {
    /// Checks every range, for `n` coordinates; bounds of states may be left out, for who has states needs none.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn validate(&self, n: usize) -> Result<(), ConfigError> {
        self.faults(n).into_iter().next().map_or(Ok(()), Err)
    }

    /// Every value out of range, for a training on states of `n` coordinates, in the order of the keys.
    pub(crate) fn faults(&self, n: usize) -> Vec<ConfigError> {
        self.faults_with(n, false)
    }

    /// Every value out of range, bounds that are missing among them, for a training on states drawn of a system.
    pub(crate) fn sampling_faults(&self, system: &SystemInstance<f64>) -> Vec<ConfigError> {
        let mut faults = Faults(self.faults_with(system.coordinates, true));
        let coordinates = system.system.coordinates(system.coordinates);
        let time = system.system.time_like.and_then(|index| coordinates.get(index)).map(|time| time.name.as_ref());
        self.penalty.time_faults(time, &mut faults);
        faults.0
    }

    fn faults_with(&self, n: usize, drawn: bool) -> Vec<ConfigError> {
        let mut faults = Faults::default();
        let data = &self.data;
        faults.count(data.training, "data.training", MOST_STATES);
        faults.count(data.validation, "data.validation", MOST_STATES);
        faults.count(data.test, "data.test", MOST_STATES);
        for (value, field) in
            [(data.rescaled_fraction, "data.rescaled_fraction"), (data.trajectory_fraction, "data.trajectory_fraction")]
        {
            faults.number(value, field, (0.0..=1.0).contains(&value), "a number from 0 to 1");
        }
        faults.at_least_zero(data.acceleration_weighting, "data.acceleration_weighting");
        match data.shell() {
            Ok(Some(Shell { radius: [low, high], rapidity, .. })) => {
                let ok = low > 0.0 && low < high && high.is_finite();
                faults.check(ok, "data.shell_radius", "[low, high], 0 < low < high", format!("[{low}, {high}]"));
                faults.at_least_zero(rapidity, "data.rapidity");
            }
            Ok(None) => {}
            Err(fault) => faults.0.push(fault),
        }
        faults.bounds("data.validation_position", &data.validation_position, drawn, n);
        faults.bounds("data.validation_velocity", &data.validation_velocity, drawn, n);
        self.network_faults(&mut faults);
        let lambda = self.penalty.lambda();
        let expected = format!("a number from 0 to {MOST_LAMBDA:e}");
        faults.number(lambda, "penalty.lambda", (0.0..=MOST_LAMBDA).contains(&lambda), expected);
        // That of a system that is known is looked at beside the system.
        if !drawn {
            self.penalty.time_faults(self.network.time_like.as_deref(), &mut faults);
        }
        let optimizer = &self.optimizer;
        faults.count(optimizer.batch, "optimizer.batch", MOST_STATES);
        faults.at_least_zero(optimizer.weight_decay, "optimizer.weight_decay");
        faults.number(optimizer.clip, "optimizer.clip", optimizer.clip > 0.0, "a positive number");
        let averaging = optimizer.averaging;
        let ok = (0.0..1.0).contains(&averaging);
        faults.number(averaging, "optimizer.averaging", ok, "a number from 0 to below 1");
        faults.check(!self.phases.is_empty(), "phase", "at least one phase", "none".to_string());
        for (k, phase) in self.phases.iter().enumerate() {
            phase.faults(k, n, drawn, &mut faults);
        }
        if let Some(lbfgs) = &self.lbfgs {
            faults.count(lbfgs.iterations, "lbfgs.iterations", MOST_EPOCHS);
            faults.count(lbfgs.memory, "lbfgs.memory", 1000);
        }
        faults.0
    }

    fn network_faults(&self, faults: &mut Faults) {
        let network = &self.network;
        let hidden = &network.hidden;
        let ok = !hidden.is_empty() && hidden.len() <= 64;
        faults.check(ok, "network.hidden", "1 to 64 widths", hidden.len().to_string());
        for (k, &width) in hidden.iter().enumerate() {
            let field = format!("network.hidden[{k}]");
            let even = "an even width, for quadratic-softplus is two networks of half the width";
            let ok = width.is_multiple_of(network.activation.branches().len());
            if faults.count(width, &field, MAX_WIDTH) {
                faults.check(ok, &field, even, width.to_string());
            }
        }
        faults.number(network.alpha, "network.alpha", network.alpha.is_finite(), "a finite number");
        let unit = network.radial_unit.unwrap_or(1.0);
        faults.number(unit, "network.radial_unit", unit.is_finite() && unit > 0.0, "a positive number");
        if let Some(units) = network.dissipation {
            faults.count(units, "network.dissipation", MAX_WIDTH);
        }
    }
}

impl Phase {
    /// Every value of phase `k` that is out of range, for `n` coordinates.
    fn faults(&self, k: usize, n: usize, drawn: bool, faults: &mut Faults) {
        let field = |name: &str| format!("phase[{k}].{name}");
        faults.count(self.epochs, &field("epochs"), MOST_EPOCHS);
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let expected = format!("a number above 0, at most {MOST_RATE}");
        if faults.number(self.rate, &field("rate"), self.rate > 0.0 && self.rate <= MOST_RATE, expected) {
            let ok = (0.0..=self.rate).contains(&self.eta_min);
            faults.number(self.eta_min, &field("eta_min"), ok, "a number from 0 to the rate");
        }
        faults.number(self.t_max, &field("t_max"), positive(self.t_max), "a positive number of epochs");
        faults.bounds(&field("position"), &self.position, drawn, n);
        faults.bounds(&field("velocity"), &self.velocity, drawn, n);
        let log_uniform = &self.log_uniform;
        let found = format!("{} for {n}", log_uniform.len());
        let expected = "nothing or true or false for each coordinate";
        faults.check(log_uniform.is_empty() || log_uniform.len() == n, &field("log_uniform"), expected, found);
        for (i, &[low, _]) in self.position.iter().enumerate() {
            let ok = low > 0.0 || !log_uniform.get(i).copied().unwrap_or(false);
            let expected = "a lowest coordinate above 0 to take its logarithm";
            faults.check(ok, &field(&format!("position[{i}]")), expected, format!("{low}"));
        }
    }
}

//! Everything that determines a training run; written beside every model as `config.toml`.

use crate::configuration::error::{ConfigError, Faults, place};
use crate::configuration::penalty::Regularizer;
use crate::configuration::table::{Below, Key, Ranges as _, count, from_zero, table};
use crate::lagrangian::{Description, SystemInstance, pair};
use crate::network::file::{MAX_COORDINATES, MAX_WIDTH};
use crate::network::{ActivationChoice, Factor, Form, Initialization, InputLayer, JointFriction, Radial, Structure};
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

/// Reaction to a state without a finite acceleration, or to a gradient that is not finite.
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

impl Scaling {
    /// The scales of coordinates whose physical ones are these.
    pub(crate) fn of(self, physical: Vec<f64>) -> Vec<f64> {
        match self {
            Self::Physical => physical,
            Self::None => vec![1.0; physical.len()],
        }
    }
}

/// Epochs of a phase or of multiple shooting at most, and iterations of L-BFGS: years.
pub const MOST_EPOCHS: usize = 1 << 24;
/// Largest number of states of a set or of a step; their memory is checked separately.
const MOST_STATES: usize = 1 << 30;
/// Largest weight of a penalty: a larger one leaves single precision no digit of the loss.
const MOST_LAMBDA: f64 = 1e12;
/// Weight of a penalty, if no other one is chosen.
pub const PENALTY: f64 = 100.0;
/// Highest learning rate.
pub const MOST_RATE: f64 = 1000.0;
/// Largest seed: TOML has no larger whole number.
pub const MOST_SEED: u64 = i64::MAX as u64;

table! {
    /// A complete training run. Missing keys take the values of a black box in the preset `quick`; unknown keys are rejected.
    pub struct Config {
        /// Name of the system.
        #[key("a name, see `lnn systems`", example = "\"double-pendulum\"", flag = "name")]
        pub system: String = String::new(),
        /// Seed of all random numbers: states, weights, order of the data.
        #[key("0 to 2^63 - 1", flag = "seed", check = |x| *x <= MOST_SEED)]
        pub seed: u64 = 0,
        /// Precision of weights and arithmetic.
        #[key("f32, f64", flag = "precision")]
        pub precision: Precision = Precision::F32,
        /// Model whose weights the training starts from; the network must be that of the model.
        #[key("a model file or the directory of a run", example = "\"runs/other\"", flag = "from")]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub from: Option<String> = None,
        /// Parameters of the system, in its units (`lnn systems` lists them).
        ///
        /// Those that are not given have its defaults.
        #[table("parameters", Below::Open)]
        pub parameters: BTreeMap<String, f64> = BTreeMap::new(),
        /// A system that is not in the catalogue: the content of its file, see the page on system files.
        ///
        /// Its name is `system`.
        #[table("description", Below::Whole)]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub description: Option<Description> = None,
        /// The states, drawn uniformly within bounds unless a key chooses otherwise.
        #[table("data", Below::Keys(Data::KEYS))]
        pub data: Data = Data::default(),
        /// Shape of the network.
        #[table("network", Below::Keys(Network::KEYS))]
        pub network: Network = Network::default(),
        /// Penalty on a wrong signature of the mass matrix.
        #[table("penalty", Below::Keys(PENALTY_KEYS))]
        pub penalty: Regularizer = Regularizer::Eigenvalue { lambda: PENALTY },
        /// The update of the weights.
        #[table("optimizer", Below::Keys(Optimizer::KEYS))]
        pub optimizer: Optimizer = Optimizer::default(),
        /// A stretch of training. The table may be repeated; each phase starts from the best weights of the previous one.
        #[table("phase", Below::Keys(Phase::KEYS))]
        #[serde(rename = "phase")]
        pub phases: Vec<Phase> = vec![Phase::default()],
        /// Full-batch L-BFGS in double precision after the last phase; left out without this table.
        #[table("lbfgs", Below::Keys(Lbfgs::KEYS))]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub lbfgs: Option<Lbfgs> = None,
    }
}

/// The keys of [`Regularizer`].
const PENALTY_KEYS: &[Key] = &[
    Key::new(
        "kind",
        "What is penalised. Beside a time-like coordinate signature, which wants one negative eigenvalue and names no time, or \
         lorentzian-sylvester, which wants a negative element of the time: not for metrics inside of a horizon or of an \
         ergosphere, where it is positive.",
    )
    .values(Regularizer::NAMES)
    .flag("penalty"),
    Key::new("lambda", "Weight beside the loss; not with kind none.")
        .values("0 to 10^12")
        .example("100.0")
        .flag("lambda"),
    Key::new("time", "The time-like coordinate; with lorentzian-sylvester only.").values("a coordinate").example("\"t\""),
];

table! {
    /// Full-batch L-BFGS in double precision on the states of the last phase, from the best weights so far.
    pub struct Lbfgs {
        /// Largest number of iterations.
        #[key("1 to 2^24", example = "100", check = count(MOST_EPOCHS))]
        pub iterations: usize = 100,
        /// Pairs of steps and gradient differences that are kept.
        #[key("1 to 1000", example = "20", check = count(1000))]
        pub memory: usize = 20,
    }
}

fn is_frictionless(friction: &JointFriction) -> bool {
    *friction == JointFriction::None
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

table! {
    /// States that are sampled uniformly within bounds.
    pub struct Data {
        /// Number of training states of every phase.
        #[key("1 to 2^30", check = count(MOST_STATES))]
        pub training: usize = 60_000,
        /// Number of validation states, which choose the best epoch.
        #[key("1 to 2^30", check = count(MOST_STATES))]
        pub validation: usize = 12_000,
        /// Fraction of the training states of a geodesic that are slowed down or reversed, off the mass shell; on the shell alone
        /// the metric is not identifiable.
        ///
        /// Their velocity is `u` times one on the shell, `|u|` from 0.03 to 1 and uniform in its logarithm, of either sign, their
        /// acceleration `u^2` times as large, as for every geodesic, and their residuals weigh `1/u^2` in the training loss.
        #[key("0 to 1; 0 unless set", example = "0.75", check = |x| (0.0..=1.0).contains(x))]
        #[serde(skip_serializing_if = "is_zero")]
        pub rescaled_fraction: f64 = 0.0,
        /// Fraction of the training states that lie on exact trajectories with the initial conditions of the trajectory test.
        ///
        /// They lie at any time with equal chance, as long as the motions stay within the bounds of the phase. A
        /// [`Phase::log_uniform`] coordinate is so in half of the starts as well; `rescaled_fraction` and `acceleration_weighting`
        /// treat these states like all others.
        #[key("0 to 1; 0 unless set", example = "0.3", check = |x| (0.0..=1.0).contains(x))]
        #[serde(skip_serializing_if = "is_zero")]
        pub trajectory_fraction: f64 = 0.0,
        /// If f is above 0, a state has the weight f m / (f m + |a|), with its scaled acceleration |a| and the mean m of all, so
        /// that a few huge accelerations do not outweigh the others. A fit adds the expected error to |a|.
        ///
        /// With [radial coordinates](Network::radial) a state of a fit weighs `1/(|a| + f m)`, `m` the median about as far from the
        /// centre. The same weights choose the best epoch of a fit.
        #[key("from 0; 0 unless set", example = "0.1", check = from_zero)]
        #[serde(skip_serializing_if = "is_zero")]
        pub acceleration_weighting: f64 = 0.0,
        /// Draw all states in a shell around the centre instead of their bounds, with uniform directions, distances uniform in
        /// their logarithm, and time-like velocities. acceleration_weighting then compares with states at about the same
        /// distance.
        ///
        /// See [`Shell`]; empty for none.
        #[key("names of Cartesian coordinates around a centre", example = "[\"x\", \"y\", \"z\"]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub shell: Vec<String> = Vec::new(),
        /// Lowest and highest distance of the shell from its centre.
        #[key("[low, high] above 0, in the unit of the coordinates", example = "[1.2, 40]")]
        #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "pair::optional")]
        pub shell_radius: Option<[f64; 2]> = None,
        /// Largest rapidity of states in a shell, in the frame of an observer at rest in the surface of equal time.
        #[key("from 0; 1 unless set", example = "1.2", check = from_zero)]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub rapidity: Option<f64> = None,
        /// Number of fresh states that test the final model.
        #[key("1 to 2^30", check = count(MOST_STATES))]
        pub test: usize = 12_000,
        /// Bounds of the coordinates of validation and test states; recorded states need none of the four bounds.
        #[key("[low, high] for each coordinate, in its unit")]
        #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
        pub validation_position: Vec<[f64; 2]> = Vec::new(),
        /// Bounds of their velocities; not used for a velocity that a mass shell determines.
        #[key("[low, high] for each coordinate, in its unit per unit of time")]
        #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
        pub validation_velocity: Vec<[f64; 2]> = Vec::new(),
    }
}

/// States in a shell around a centre: directions uniform over the sphere, distances uniform in their logarithm.
///
/// Velocities have rapidities uniform from 0 to `rapidity`, in any direction of the local frame of an observer at rest in the surface of
/// equal time. With [`Data::acceleration_weighting`] `f` a training state has the weight `1/(|a| + f m)`, with `m` the median of `|a|`
/// among the states at about the same distance: near and far states count equally.
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

table! {
    /// Shape of the network.
    pub struct Network {
        /// Widths of the hidden layers; a hybrid's branches share them.
        #[key("1 to 64 widths of 1 to 65536", example = "[128, 128, 128]", flag = "hidden", check = count(MAX_WIDTH))]
        pub hidden: Vec<usize> = vec![128; 3],
        /// Activation of the hidden layers; quadratic-softplus is the sum of two networks of half the widths.
        #[key(ActivationChoice::NAMES, flag = "activation")]
        pub activation: ActivationChoice = ActivationChoice::Gelu,
        /// How the Lagrangian is composed from the outputs of the network; see the page on structures.
        #[key(Structure::NAMES, flag = "structure")]
        pub structure: Structure = Structure::BlackBox,
        /// How the kinetic energy or metric of a structure is factored: by a triangle, or by a rectangle of three squares per
        /// coordinate, which is smooth where a triangle has a root.
        #[key("triangle, rectangle")]
        pub factor: Factor = Factor::Triangle,
        /// Coordinates that the Lagrangian does not depend on.
        #[key("names of coordinates", example = "[\"t\"]", flag = "cyclic")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub cyclic: Vec<String> = Vec::new(),
        /// Coordinates that enter by direction and distance R from a centre, as (x_i/R) ln(R/u) and (x_i/R) (u/R), for fields
        /// over a wide range of distances.
        ///
        /// See [`Radial`].
        #[key("lists of names of Cartesian coordinates", example = "[[\"x\", \"y\", \"z\"]]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub radial: Vec<Vec<String>> = Vec::new(),
        /// The distance u of radial coordinates.
        #[key("a positive number; 1 unless set", example = "1.2", check = |x| x.is_finite() && *x > 0.0)]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub radial_unit: Option<f64> = None,
        /// Make the Lagrangian even in the velocities.
        #[key("true, false", flag = "even-in-v")]
        pub even_in_v: bool = false,
        /// Factor of the added |v|^2 of scaled velocities; for a black box.
        #[key("a finite number", check = |x| x.is_finite())]
        pub alpha: f64 = 1.0,
        /// Learn alpha as well; for a black box only.
        #[key("true, false", flag = "learn-alpha")]
        pub learn_alpha: bool = false,
        /// A known Lagrangian that is added; its parameters marked learn are learned beside the weights.
        #[key("a system file, or its tables", example = "\"pendulum.toml\"", flag = "known")]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub known: Option<Known> = None,
        /// The coordinate that is a time. Its square counts negative in the added term, alpha (-t'^2 + x'^2 + ..).
        #[key("a coordinate", example = "\"t\"", flag = "timelike")]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub time_like: Option<String> = None,
        /// physical divides q, v and a of a coordinate by the largest of |q| and |v| over the training states.
        #[key("physical, none")]
        pub scaling: Scaling = Scaling::Physical,
        /// Give the network the sine and cosine of angles instead of the angles.
        #[key("true, false")]
        pub embed_periodic: bool = true,
        /// Layer before the first dense layer: none, or a dynamic tanh.
        #[key("none, dyt")]
        pub input_layer: InputLayer = InputLayer::None,
        /// Number of units of a learned friction, a Rayleigh dissipation; without it the motion conserves its energy.
        #[key("1 to 65536 units", example = "16", flag = "friction?", check = count(MAX_WIDTH))]
        #[serde(skip_serializing_if = "Option::is_none")]
        pub dissipation: Option<usize> = None,
        /// Friction that every coordinate has by itself, as the joints of a machine: dry is viscous and dry friction, stribeck also a
        /// larger one at low speeds.
        ///
        /// See [`JointFriction`]; beside `dissipation` or alone.
        #[key("none, dry, stribeck", example = "\"dry\"", flag = "joint-friction?")]
        #[serde(skip_serializing_if = "is_frictionless")]
        pub joint_friction: JointFriction = JointFriction::None,
        /// Distribution of the initial weights.
        #[key("default, variance-preserving, cranmer, cranmer-paper, near-zero")]
        pub initialization: Initialization = Initialization::Default,
    }
}

/// Units of a learned friction, if no other number is chosen: the example of its key.
pub const FRICTION_UNITS: usize = 16;

/// The known part of a grey box: a file, as a user writes it, or what it says, as a run keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Known {
    /// Path of a system file.
    File(String),
    /// Its content.
    Description(Box<Description>),
}

table! {
    /// Update rule.
    pub struct Optimizer {
        /// Update rule.
        #[key(Method::NAMES)]
        pub method: Method = Method::Soap,
        /// States per step.
        #[key("1 to 2^30 states", check = count(MOST_STATES))]
        pub batch: usize = 128,
        /// Weight decay: added to the gradient (L2); with adamw, weights shrink by the rate times it.
        #[key("from 0", check = from_zero)]
        pub weight_decay: f64 = 1e-6,
        /// Largest norm of the gradient; longer gradients are cut to it.
        #[key("above 0, inf for none", check = |x| *x > 0.0)]
        pub clip: f64 = 1.0,
        /// For validation and the final model, weights are averaged over about 1/(1 - averaging) steps.
        #[key("0 to below 1", check = |x| (0.0..1.0).contains(x))]
        pub averaging: f64 = 0.0,
        /// What to do about a state or a step that is not finite: leave it out, or stop the training.
        #[key("skip, stop")]
        pub on_failure: OnFailure = OnFailure::Skip,
    }
}

table! {
    /// A stretch of training with its own states and learning rates.
    pub struct Phase {
        /// Passes through the training states.
        #[key("1 to 2^24", check = count(MOST_EPOCHS))]
        pub epochs: usize = 40,
        /// Learning rate at the start.
        #[key("above 0 to 1000", check = |x| *x > 0.0 && *x <= MOST_RATE)]
        pub rate: f64 = 5e-3,
        /// Lowest learning rate.
        #[key("0 to the rate")]
        pub eta_min: f64 = 0.0,
        /// How the rate changes: not at all, by half a cosine over the phase, or falling and rising every 2 t_max.
        #[key("constant, cosine, cosine-annealing")]
        pub schedule: Schedule = Schedule::Cosine,
        /// Epochs from highest to lowest rate of cosine-annealing.
        #[key("above 0, in epochs", check = |x| x.is_finite() && *x > 0.0)]
        pub t_max: f64 = 40.0,
        /// Bounds of the training states' coordinates.
        #[key("[low, high] for each coordinate, in its unit")]
        #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
        pub position: Vec<[f64; 2]> = Vec::new(),
        /// Bounds of their velocities; not used for a velocity that a mass shell determines.
        #[key("[low, high] for each coordinate, in its unit per unit of time")]
        #[serde(skip_serializing_if = "Vec::is_empty", deserialize_with = "pair::list")]
        pub velocity: Vec<[f64; 2]> = Vec::new(),
        /// Coordinates for which half of the states are uniform in the logarithm.
        #[key("true or false for each coordinate", example = "[true, false]")]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub log_uniform: Vec<bool> = Vec::new(),
    }
}

impl Network {
    /// Index of the coordinate [`time_like`](Self::time_like) among these names, if there is one.
    ///
    /// # Errors
    /// A name that is not among them.
    pub(crate) fn time_like_index<'a>(
        &self,
        coordinates: impl Iterator<Item = &'a str>,
    ) -> Result<Option<usize>, ConfigError> {
        self.time_like.as_ref().map(|name| place("network.time_like", name, coordinates)).transpose()
    }

    /// Prior knowledge of the Lagrangian, for coordinates with these names.
    ///
    /// # Errors
    /// A cyclic or radial coordinate that is not among them.
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
                Some(Known::Description(description)) => Some(Box::new(description.plain())),
                // The file is read with the configuration.
                Some(Known::File(_)) | None => None,
            },
            joint_friction: self.joint_friction,
            sizes: None,
        })
    }
}

impl Config {
    /// Checks every range, for `n` coordinates; bounds of states may be left out, since a training on given states needs none.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn validate(&self, n: usize) -> Result<(), ConfigError> {
        self.faults(n).into_iter().next().map_or(Ok(()), Err)
    }

    /// Every value out of range, for a training on states of `n` coordinates.
    pub(crate) fn faults(&self, n: usize) -> Vec<ConfigError> {
        let mut faults = Faults::default();
        self.ranges("", &mut faults);
        self.common_faults(n, false, &mut faults);
        // A known system brings its own time.
        self.penalty.time_faults(self.network.time_like.as_deref(), &mut faults);
        faults.0
    }

    /// Every value out of range, bounds that are missing among them, for a training on states drawn of a system.
    pub fn sampling_faults(&self, system: &SystemInstance<f64>) -> Vec<ConfigError> {
        let mut faults = Faults::default();
        self.ranges("", &mut faults);
        self.common_faults(system.coordinates, true, &mut faults);
        let coordinates = system.system.coordinates(system.coordinates);
        let time = system.system.time_like.and_then(|index| coordinates.get(index)).map(|time| time.name.as_ref());
        self.penalty.time_faults(time, &mut faults);
        faults.0
    }

    /// Checks conditions on several keys.
    fn common_faults(&self, n: usize, drawn: bool, faults: &mut Faults) {
        let (data, network) = (&self.data, &self.network);
        let most = format!("a system of at most {MAX_COORDINATES} coordinates, as a model has");
        faults.check(n <= MAX_COORDINATES, "system", most, format!("{n} coordinates"));
        match data.shell() {
            Ok(Some(Shell { radius: [low, high], .. })) => {
                let ok = low > 0.0 && low < high && high.is_finite();
                faults.check(ok, "data.shell_radius", "[low, high], 0 < low < high", format!("[{low}, {high}]"));
            }
            Ok(None) => {}
            Err(fault) => faults.0.push(fault),
        }
        faults.bounds("data.validation_position", &data.validation_position, drawn, n);
        faults.bounds("data.validation_velocity", &data.validation_velocity, drawn, n);
        let hidden = &network.hidden;
        let ok = !hidden.is_empty() && hidden.len() <= 64;
        faults.check(ok, "network.hidden", "1 to 64 widths", hidden.len().to_string());
        for (k, width) in hidden.iter().enumerate() {
            let even = "an even width, for quadratic-softplus is two networks of half the width";
            let ok = width.is_multiple_of(network.activation.branches().len());
            faults.check(ok, &format!("network.hidden[{k}]"), even, width.to_string());
        }
        let lambda = self.penalty.lambda();
        let ok = (0.0..=MOST_LAMBDA).contains(&lambda);
        faults.check(ok, "penalty.lambda", "0 to 10^12", lambda.to_string());
        faults.check(!self.phases.is_empty(), "phase", "at least one phase", "none".to_string());
        for (k, phase) in self.phases.iter().enumerate() {
            phase.faults(k, n, drawn, faults);
        }
    }
}

impl Phase {
    /// Checks conditions on several keys of phase `k`, for `n` coordinates.
    fn faults(&self, k: usize, n: usize, drawn: bool, faults: &mut Faults) {
        let field = |name: &str| format!("phase[{k}].{name}");
        // If the rate itself is wrong, nothing follows for `eta_min`.
        let ok = (0.0..=self.rate).contains(&self.eta_min) || self.rate.is_nan() || self.rate <= 0.0;
        faults.check(ok, &field("eta_min"), "0 to the rate", self.eta_min.to_string());
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

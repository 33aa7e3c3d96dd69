//! Samples training data of analytical systems: uniform states, or states along exact motions, with exact accelerations.

use super::thresholds::{SLOWEST, STATES_PER_MOTION};
use crate::configuration::{Config, ConfigError};
use crate::data::dataset::{Dataset, DatasetError, Datasets, Weighting};
use crate::data::shell::{in_shell, weigh_by_distance};
use crate::lagrangian::system::Coordinate;
use crate::lagrangian::{DescriptionError, EulerLagrange, Interruptible, SystemError, SystemInstance, project};
use crate::random::RngStream;
use crate::rollout::{Domain, Integrator, RolloutOptions, rollout};
use crate::scalar::Scalar;
use rand::Rng;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use thiserror::Error;

impl Dataset<f64> {
    /// Draws `states` states uniformly from a box, with their exact accelerations, all in double precision.
    ///
    /// States of a system with a mass shell are put on it: the velocity of the time-like coordinate follows from the other numbers, and its
    /// bounds are ignored. States of a system under constraints are projected onto them, even out of the box. States outside the system's
    /// domain, or with an acceleration that is not finite, are drawn again.
    ///
    /// # Errors
    /// [`SamplingError::Domain`] if more than nine in ten draws are refused.
    pub fn sample(
        system: &SystemInstance<f64>,
        field: &str,
        bounds: (&[[f64; 2]], &[[f64; 2]]),
        states: usize,
        rng: &mut impl Rng,
    ) -> Result<Self, SamplingError> {
        fill(Drawn::new(system)?, field, bounds, &[], states, (rng, &AtomicBool::new(false)))
    }
}

/// Draws further states, up to `states`, as [`Dataset::sample`] does.
fn fill(
    mut drawn: Drawn<'_>,
    field: &str,
    bounds: (&[[f64; 2]], &[[f64; 2]]),
    log_uniform: &[bool],
    states: usize,
    (rng, interrupt): (&mut impl Rng, &AtomicBool),
) -> Result<Dataset<f64>, SamplingError> {
    let n = bounds.0.len();
    let mut refused = 0_usize;
    while drawn.q.len() < states * n {
        Drawn::check_interrupt(interrupt)?;
        let (mut q, mut v) = draw(bounds, log_uniform, rng);
        let demand = match drawn.impose(&mut q, &mut v)? {
            None => drawn.take(&q, &v)?,
            demand => demand,
        };
        if let Some(demand) = demand {
            refused += 1;
            if refused > 1000 && refused > 9 * (drawn.q.len() / n) {
                return Err(SamplingError::Domain { field: field.to_string(), demand });
            }
        }
    }
    drawn.finish()
}

/// Slows down a `fraction` of geodesic states and reverses half of those: `v -> u v`, `a -> u^2 a`, `|u|` between [`SLOWEST`] and 1,
/// uniform in its logarithm.
///
/// Their residuals have the weight `1 / u^2`, so that an error of the connection counts the same at every speed.
fn rescale_geodesics(mut set: Dataset<f64>, fraction: f64, rng: &mut impl Rng) -> Result<Dataset<f64>, DatasetError> {
    let mut weights = Vec::with_capacity(set.len());
    for k in 0..set.len() {
        let (chance, depth, reversed) = (rng.random::<f64>(), rng.random::<f64>(), rng.random::<bool>());
        let mut weight = set.weight(k);
        if chance < fraction {
            let u = SLOWEST.powf(depth);
            set.rescale_time(k, if reversed { -u } else { u });
            weight /= u * u;
        }
        weights.push(weight);
    }
    set.with_weights(weights)
}

impl<S: Scalar> Datasets<S> {
    /// All datasets of a run in its precision, with the physical scale of the first phase's training states.
    ///
    /// # Errors
    /// [`SamplingError`].
    pub fn sample(config: &Config, system: &SystemInstance<f64>) -> Result<(Self, Vec<f64>), SamplingError> {
        sample_all_until(config, system, &AtomicBool::new(false))
    }
}

/// Like [`Datasets::sample`], but stops when the interrupt flag is raised.
///
/// # Errors
/// [`SamplingError`].
pub(crate) fn sample_all_until<S: Scalar>(
    config: &Config,
    system: &SystemInstance<f64>,
    interrupt: &AtomicBool,
) -> Result<(Datasets<S>, Vec<f64>), SamplingError> {
    if let Some(fault) = config.sampling_faults(system).into_iter().next() {
        return Err(fault.into());
    }
    config.architecture(system, vec![1.0; system.coordinates])?;
    let seed = config.seed;
    let mut training = Vec::with_capacity(config.phases.len());
    for (k, phase) in config.phases.iter().enumerate() {
        let field = format!("phase[{k}].position");
        let bounds = (phase.position.as_slice(), phase.velocity.as_slice());
        let mut rng = RngStream::Training(k).generator(seed);
        let (states, floor) = (config.data.training, config.data.acceleration_weighting);
        let set = if let Some(shell) = config.data.shell()? {
            let set = in_shell(system, &shell, (&field, &phase.position), states, (&mut rng, interrupt))?;
            weigh_by_distance(set, system, &shell, floor)?
        } else {
            let moving = (config.data.trajectory_fraction * states as f64).round() as usize;
            let drawn = along_motions(system, &field, bounds, &phase.log_uniform, moving, (&mut rng, interrupt))?;
            let set = fill(drawn, &field, bounds, &phase.log_uniform, states, (&mut rng, interrupt))?;
            let scale = set.physical_scale();
            Weighting { floor, scale: &scale, errors: &[] }.relative(set)?
        };
        let off = config.data.rescaled_fraction;
        let slowed = off > 0.0 && system.constrained_coordinate().is_some();
        training.push(if slowed { rescale_geodesics(set, off, &mut rng)? } else { set });
    }
    let scale = training[0].physical_scale();
    let data = &config.data;
    let bounds = (data.validation_position.as_slice(), data.validation_velocity.as_slice());
    let field = "data.validation_position";
    let judged = |states: usize, stream: RngStream| {
        let mut rng = stream.generator(seed);
        match data.shell()? {
            Some(shell) => in_shell(system, &shell, (field, bounds.0), states, (&mut rng, interrupt)),
            None => fill(Drawn::new(system)?, field, bounds, &[], states, (&mut rng, interrupt)),
        }
    };
    let (validation, test) = (judged(data.validation, RngStream::Validation)?, judged(data.test, RngStream::Test)?);
    let training = training.iter().map(Dataset::cast).collect();
    Ok((Datasets { training, validation: validation.cast(), test: test.cast() }, scale))
}

/// Why states could not be sampled.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SamplingError {
    /// The system does not exist or has no such parameter.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The description of a system is invalid.
    #[error("description.{0}")]
    Description(#[from] DescriptionError),
    /// The configuration is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Most of the box lies outside the domain of the system.
    #[error("{field}: most of these bounds lie where {demand} is violated or accelerations are not finite")]
    Domain {
        /// The setting that contains the bounds.
        field: String,
        /// The condition that the system requires.
        demand: &'static str,
    },
    /// The motions of the trajectory test hardly pass through the box.
    #[error(
        "{field}: hardly any motion of the trajectory test stays within these bounds, which data.trajectory_fraction needs"
    )]
    Motions {
        /// The setting that contains the bounds.
        field: String,
    },
    /// The interrupt flag was raised.
    #[error("interrupted while states were drawn")]
    Interrupted,
    /// An acceleration is not finite in the precision of training.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// Collects states of a system with their exact accelerations.
pub(crate) struct Drawn<'a> {
    system: &'a SystemInstance<f64>,
    /// The model of a system under constraints or forces.
    model: Option<Box<dyn EulerLagrange<f64>>>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    a: Vec<f64>,
}

/// Name of the condition that a state violates if it is not finite or cannot be projected.
const FINITE: &str = "a finite acceleration";
const CONSTRAINTS: &str = "some constraint";

impl<'a> Drawn<'a> {
    /// Creates an empty collection.
    ///
    /// # Errors
    /// [`SamplingError::System`] for constraints that contradict each other or leave no motion, and for forces that depend on the time.
    pub fn new(system: &'a SystemInstance<f64>) -> Result<Self, SamplingError> {
        system.require_states()?;
        let needs_model = system.constraints().is_some() || system.forces().is_some();
        let model = needs_model.then(|| system.build()).transpose()?;
        Ok(Self { system, model, q: Vec::new(), v: Vec::new(), a: Vec::new() })
    }

    /// Checks that no flag was raised.
    ///
    /// # Errors
    /// [`SamplingError::Interrupted`].
    pub fn check_interrupt(interrupt: &AtomicBool) -> Result<(), SamplingError> {
        if interrupt.load(Ordering::Relaxed) { Err(SamplingError::Interrupted) } else { Ok(()) }
    }

    /// Puts a state on the mass shell of the system, or projects it onto its constraints; returns the unmet condition if that fails.
    pub fn impose(&self, q: &mut [f64], v: &mut [f64]) -> Result<Option<&'static str>, SamplingError> {
        self.system.impose_constraint(q, v)?;
        let manifold = self.model.as_ref().and_then(|model| model.manifold());
        Ok(manifold.and_then(|manifold| project(manifold, q, v).err()).map(|_| CONSTRAINTS))
    }

    /// Accepts a state; returns the unmet condition if it lies outside the system's domain or has no finite acceleration.
    pub fn take(&mut self, q: &[f64], v: &[f64]) -> Result<Option<&'static str>, SamplingError> {
        let a = match &self.model {
            Some(model) => model.acceleration(q, v).unwrap_or_default(),
            None => self.system.exact_acceleration(q, v)?,
        };
        let finite = a.len() == q.len() && a.iter().all(|a| a.is_finite());
        let demand = self.system.check_domain(q).err().or((!finite).then_some(FINITE));
        if demand.is_none() {
            self.q.extend(q);
            self.v.extend(v);
            self.a.extend(a);
        }
        Ok(demand)
    }

    /// The states, with the rows of the constraints if there are any.
    ///
    /// # Errors
    /// [`SamplingError::Dataset`] without any state, or where a constraint is not finite.
    pub fn finish(self) -> Result<Dataset<f64>, SamplingError> {
        let set = Dataset::new(self.system.coordinates, self.q, self.v, self.a)?;
        match self.model.as_ref().and_then(|model| model.manifold()) {
            Some(manifold) => Ok(set.on(manifold)?),
            None => Ok(set),
        }
    }
}

/// Coordinates and velocities of a state, uniform within bounds; half of the [`log_uniform`](crate::configuration::Phase::log_uniform)
/// coordinates uniform in their logarithm.
pub(crate) fn draw(
    (position, velocity): (&[[f64; 2]], &[[f64; 2]]),
    log_uniform: &[bool],
    rng: &mut impl Rng,
) -> (Vec<f64>, Vec<f64>) {
    let mut uniform = |bounds: &[[f64; 2]]| -> Vec<f64> {
        let one = |&[low, high]: &[f64; 2]| match high - low {
            length if length.is_infinite() => {
                let share = rng.random::<f64>();
                (1.0 - share) * low + share * high
            }
            _ if low < high => rng.random_range(low..high),
            _ => low,
        };
        bounds.iter().map(one).collect()
    };
    let (mut q, v) = (uniform(position), uniform(velocity));
    for (i, q) in q.iter_mut().enumerate() {
        if log_uniform.get(i) == Some(&true) && rng.random::<bool>() {
            let [low, high] = position[i];
            *q = low * (high / low).powf(rng.random::<f64>());
        }
    }
    (q, v)
}

/// Converts bounds to the form that a configuration uses.
pub(crate) fn boxes(bounds: &[(f64, f64)]) -> Vec<[f64; 2]> {
    bounds.iter().map(|&(low, high)| [low, high]).collect()
}

/// Draws `states` states of exact motions from the starts of the system's trajectory test, every sample up to its end with
/// the same chance; a motion ends where it leaves the bounds. An angle is turned back into its bounds, to any turn that lies
/// within them. Starts are drawn as states are, half of the log-uniform coordinates uniform in their logarithm.
///
/// # Errors
/// [`SamplingError::Motions`] if hardly any motion stays within the bounds for a while.
fn along_motions<'a>(
    system: &'a SystemInstance<f64>,
    field: &str,
    (position, velocity): (&[[f64; 2]], &[[f64; 2]]),
    log_uniform: &[bool],
    states: usize,
    (rng, interrupt): (&mut impl Rng, &AtomicBool),
) -> Result<Drawn<'a>, SamplingError> {
    let n = system.coordinates;
    let test = system.system.trajectory(n);
    let [places, speeds] = [&test.start.positions, &test.start.velocities].map(|bounds| boxes(bounds));
    let coordinates = system.system.coordinates(n);
    let exact = system.build()?;
    let exact = Interruptible::new(exact.as_ref(), interrupt);
    let fixed = system.constrained_coordinate();
    let chart = position.iter().zip(&coordinates).map(|(b, c)| (!c.periodic).then_some((b[0], b[1])));
    let pace = velocity.iter().enumerate().map(|(i, b)| (Some(i) != fixed).then_some((b[0], b[1])));
    let options = RolloutOptions::new(test.t_end, test.dt)
        .method(Integrator::Dop853)
        .tolerances(1e-9, 1e-9)
        .energy(false)
        .domain(Domain::new(chart.chain(pace).collect()));
    let chance = STATES_PER_MOTION * test.dt / test.t_end;
    let mut drawn = Drawn::new(system)?;
    let mut motions = 0;
    while drawn.q.len() < states * n {
        Drawn::check_interrupt(interrupt)?;
        if motions > 100 && drawn.q.len() < motions * n {
            return Err(SamplingError::Motions { field: field.to_string() });
        }
        motions += 1;
        let (mut start, mut speed) = draw((&places, &speeds), log_uniform, rng);
        if drawn.impose(&mut start, &mut speed)?.is_some() {
            continue;
        }
        let motion = rollout(&exact, &start, &speed, &options).trajectory;
        for (q, v) in motion.q.chunks_exact(n).zip(motion.v.chunks_exact(n)) {
            if drawn.q.len() == states * n || rng.random::<f64>() >= chance {
                continue;
            }
            let (mut q, mut v) = (q.to_vec(), v.to_vec());
            if turn_back(&mut q, &coordinates, position, rng) {
                // The integrator may leave the mass shell by as much as its tolerance.
                if drawn.impose(&mut q, &mut v)?.is_none() {
                    drawn.take(&q, &v)?;
                }
            }
        }
    }
    Ok(drawn)
}

/// Shifts angles by full turns so that they lie within their bounds; `false` if that is impossible.
fn turn_back(q: &mut [f64], coordinates: &[Coordinate], bounds: &[[f64; 2]], rng: &mut impl Rng) -> bool {
    let angles = q.iter_mut().zip(coordinates).zip(bounds).filter(|((_, coordinate), _)| coordinate.periodic);
    for ((q, _), &[low, high]) in angles {
        let first = low + (*q - low).rem_euclid(TAU);
        let more = ((high - first) / TAU).floor();
        if more < 0.0 {
            return false;
        }
        *q = first + TAU * f64::from(rng.random_range(0..=more as u32));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Request, Terms};
    use crate::presets::Preset;
    use std::borrow::Cow;
    use std::f64::consts::PI;

    #[test]
    fn every_state_of_a_relativistic_system_is_on_the_mass_shell() {
        let mut seen = 0;
        for system in crate::lagrangian::System::unconstrained().iter().filter(|s| s.constraint.is_some()) {
            let configured = SystemInstance::<f64>::named(&system.name, &[]).unwrap();
            let mut config = Preset::Quick.config(&configured).unwrap();
            (config.data.training, config.data.validation, config.data.test) = (500, 200, 100);
            config.data.rescaled_fraction = 0.0;
            let (data, scale) = Datasets::<f64>::sample(&config, &configured).unwrap();
            let i = configured.constrained_coordinate().unwrap();
            for set in data.training.iter().chain([&data.validation, &data.test]) {
                let mut terms = Terms::default();
                let exact = configured.build().unwrap();
                exact.terms(set.q(), set.v(), Request::ENERGY, &mut terms).unwrap();
                // 2 L = g(v, v) = -1; the terms of the sum are p_i v_i.
                for ((l, p), v) in terms
                    .lagrangian
                    .iter()
                    .zip(terms.momentum.chunks(set.coordinates()))
                    .zip(set.v().chunks(set.coordinates()))
                {
                    let terms: f64 = p.iter().zip(v).map(|(p, v)| (p * v).abs()).sum();
                    assert!((2.0 * l + 1.0).abs() <= 16.0 * f64::EPSILON * terms, "{}: {l} {terms}", system.name);
                }
                assert!(set.ranges()[1][i][0] > 0.0);
            }
            assert!(scale[i] >= data.training[0].ranges()[1][i][1] && scale.iter().all(|s| s.is_finite()));
            // Whatever the bounds of the constrained velocity, nothing changes.
            config.phases[0].velocity[i] = [-7.0, -7.0];
            assert_eq!(Datasets::<f64>::sample(&config, &configured).unwrap().0.training, data.training);
            seen += 1;
        }
        assert_eq!(seen, 8);
    }

    #[test]
    fn states_under_constraints_lie_on_them() {
        let system = SystemInstance::<f64>::named("cartesian-chain-2", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (200, 50, 50);
        // A chain that falls by its own height is faster than the bounds of its states, where a motion would end.
        config.phases[0].velocity.fill([-12.0, 12.0]);
        for fraction in [0.0, 0.5] {
            config.data.trajectory_fraction = fraction;
            let (data, _) = Datasets::<f64>::sample(&config, &system).unwrap();
            for set in data.training.iter().chain([&data.validation, &data.test]) {
                assert_eq!(set.constraints(), 2);
                for (k, ((q, v), a)) in set.q().chunks(4).zip(set.v().chunks(4)).zip(set.a().chunks(4)).enumerate() {
                    assert!((q[0].hypot(q[1]) - 1.0).abs() < 1e-12 && (q[2] - q[0]).hypot(q[3] - q[1]) < 1.0 + 1e-12);
                    let (rows, drift) = set.constraint(k);
                    for (row, drift) in rows.chunks(4).zip(drift) {
                        let along = |x: &[f64]| row.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
                        assert!(along(v).abs() < 1e-12 && (along(a) + drift).abs() < 1e-9, "{q:?} {v:?}");
                    }
                }
            }
        }
        // Constraints that no state within the bounds can be projected onto.
        let mut description = system.system.description().unwrap().clone();
        description.name = "unreachable".to_string();
        description.constraints.insert("far".to_string(), "x1 + 5*l".to_string());
        let far = crate::lagrangian::SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &[]);
        assert!(Datasets::<f64>::sample(&config, &far.unwrap()).is_err());
    }

    #[test]
    fn a_raised_flag_ends_it() {
        for name in ["harmonic-oscillator", "spring-pendulum", "schwarzschild-cartesian"] {
            let system = SystemInstance::<f64>::named(name, &[]).unwrap();
            let config = Preset::Quick.config(&system).unwrap();
            let ended = sample_all_until::<f64>(&config, &system, &AtomicBool::new(true));
            assert!(matches!(ended, Err(SamplingError::Interrupted)), "{name}");
        }
    }

    #[test]
    fn states_off_the_shell_are_states_of_the_same_motion() {
        for name in ["ads4-geodesic", "schwarzschild-cartesian"] {
            off_the_shell(name);
        }
    }

    fn off_the_shell(name: &str) {
        let system = SystemInstance::<f64>::named(name, &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (2000, 10, 10);
        (config.data.rescaled_fraction, config.data.acceleration_weighting) = (0.25, 0.0);
        let (data, _) = Datasets::<f64>::sample(&config, &system).unwrap();
        let (set, mut terms) = (&data.training[0], Terms::default());
        let exact = system.build().unwrap();
        exact.terms(set.q(), set.v(), Request::ENERGY | Request::ACCELERATION, &mut terms).unwrap();
        let (mut off, mut reversed, mut slow) = (0, 0, 0);
        for k in 0..set.len() {
            let (v, a) = (&set.v()[4 * k..][..4], &set.a()[4 * k..][..4]);
            // 2 L = g(v, v) = -u^2.
            let u = (-2.0 * terms.lagrangian[k]).sqrt();
            assert!((0.03 * (1.0 - 1e-12)..=1.0 + 1e-9).contains(&u), "{u}");
            assert!((set.weight(k) * u * u - 1.0).abs() < 1e-9);
            let exact = &terms.acceleration[4 * k..][..4];
            let size = exact.iter().fold(0.0f64, |m, a| m.max(a.abs()));
            assert!(a.iter().zip(exact).all(|(a, b)| (a - b).abs() <= 1e-12 * size));
            off += usize::from(u < 1.0 - 1e-9);
            reversed += usize::from(v[0] < 0.0);
            slow += usize::from(u < 0.03f64.sqrt());
        }
        // Binomial: means 500, 250, 250, deviations 19, 15, 15.
        assert!((400..600).contains(&off) && (175..325).contains(&reversed) && (175..325).contains(&slow));
        assert!((0..10).all(|k| data.validation.weight(k) == 1.0));
        config.data.rescaled_fraction = 1.5;
        assert!(matches!(Datasets::<f64>::sample(&config, &system), Err(SamplingError::Config(_))));
    }

    #[test]
    fn relative_weights_fall_with_the_acceleration() {
        let set = Dataset::new(2, vec![1.0, 4.0, -2.0, 0.0], vec![0.0; 4], vec![2.0, 0.0, 2.0, 20.0]).unwrap();
        // Scales 2 and 4: sizes 1/2 and 3, mean 7/4.
        let weigh = |set: Dataset<f64>, floor: f64| {
            let scale = set.physical_scale();
            Weighting { floor, scale: &scale, errors: &[] }.relative(set)
        };
        let weighed = weigh(set.clone(), 2.0).unwrap();
        assert_eq!([weighed.weight(0), weighed.weight(1)], [3.5 / 4.0, 3.5 / 6.5]);
        let still = Dataset::new(2, vec![1.0, 4.0], vec![0.0; 2], vec![0.0; 2]).unwrap();
        assert_eq!(weigh(still, 2.0).unwrap().weight(0), 1.0);
        // Slowed and reversed states keep them.
        let mut rng = RngStream::Test.generator(0);
        let slowed = rescale_geodesics(weighed.clone(), 1.0, &mut rng).unwrap();
        for k in 0..2 {
            let squared = slowed.a()[2 * k] / weighed.a()[2 * k];
            assert!((slowed.weight(k) * squared / weighed.weight(k) - 1.0).abs() < 1e-12 && squared < 1.0);
        }
        let system = SystemInstance::<f64>::named("spring-pendulum", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (50, 10, 10);
        let (data, _) = Datasets::<f64>::sample(&config, &system).unwrap();
        assert!((0..50).all(|k| (1e-6..1.0).contains(&data.training[0].weight(k))));
        config.data.acceleration_weighting = -1.0;
        let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("data.acceleration_weighting: ") && refused.ends_with("found -1"), "{refused}");
    }

    #[test]
    fn half_of_a_logarithmic_coordinate_is_uniform_in_its_logarithm() {
        let system = SystemInstance::<f64>::named("ads2-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (8000, 10, 10);
        config.data.trajectory_fraction = 0.0;
        config.phases[0].position = vec![[-5.0, 5.0], [0.25, 64.0]];
        let below_four = |log_uniform: &[bool]| {
            let mut config = config.clone();
            config.phases[0].log_uniform = log_uniform.to_vec();
            let (data, _) = Datasets::<f64>::sample(&config, &system).unwrap();
            let z = data.training[0].q().chunks(2).map(|q| q[1]);
            assert!(z.clone().all(|z| (0.25..=64.0).contains(&z)));
            z.filter(|z| *z < 4.0).count()
        };
        // 3.75 of 63.75 uniformly, 4 of 8 doublings logarithmically; the means' deviations are 21 and 41.
        let (plain, mixed) = (below_four(&[]), below_four(&[false, true]));
        assert!(plain.abs_diff(471) < 110 && mixed.abs_diff(2235) < 210, "{plain} {mixed}");
        config.phases[0].log_uniform = vec![true, false];
        let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("phase[0].position[0]: expected a lowest coordinate above 0"), "{refused}");
        config.phases[0].log_uniform = vec![true];
        let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("phase[0].log_uniform: expected nothing or true or false"), "{refused}");
    }

    #[test]
    fn scales_of_the_papers_geodesics() {
        let system = SystemInstance::<f64>::named("ads4-geodesic", &[]).unwrap();
        let mut config = Preset::Paper.config(&system).unwrap();
        assert_eq!((config.data.training, config.data.validation), (120_000, 24_000));
        (config.data.training, config.data.validation, config.data.test) = (120_000, 10, 10);
        let (_, scale) = Datasets::<f32>::sample(&config, &system).unwrap();
        // s_t = 6.18, s_x = s_y = 5.00, s_z = 6.00; t_dot is at most sqrt(1 + 1 + 0.6^2 + 6^2) = 6.20.
        assert!((6.15..6.2).contains(&scale[0]), "{scale:?}");
        assert!(scale[1..].iter().zip([5.0, 5.0, 6.0]).all(|(s, paper)| (s - paper).abs() < 0.005), "{scale:?}");
    }

    #[test]
    fn bounds_longer_than_the_largest_number_are_refused_and_can_be_drawn_from() {
        let system = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap();
        let quick = Preset::Quick.config(&system).unwrap();
        let wide = [-1e308, 1e308];
        type Bounds<'a> = fn(&mut Config) -> &mut Vec<[f64; 2]>;
        let all: [(&str, Bounds<'_>); 4] = [
            ("phase[0].position", |c| &mut c.phases[0].position),
            ("phase[0].velocity", |c| &mut c.phases[0].velocity),
            ("data.validation_position", |c| &mut c.data.validation_position),
            ("data.validation_velocity", |c| &mut c.data.validation_velocity),
        ];
        for (field, bounds) in all {
            let mut config = quick.clone();
            bounds(&mut config)[1] = wide;
            let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
            let expected = "[low, high] no further apart than the largest number, found [-1e308, 1e308]";
            assert_eq!(refused, format!("{field}[1]: expected {expected}"));
            // Recorded states need no bounds, drawn ones do.
            bounds(&mut config).clear();
            assert!(config.validate(2).is_ok());
            let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
            assert_eq!(refused, format!("{field}: expected one [low, high] per coordinate, found 0 for 2"));
        }
        let mut rng = RngStream::Test.generator(0);
        let (q, v) = draw((&[wide; 50], &[[2.0, 2.0]]), &[], &mut rng);
        assert!(q.iter().all(|q| q.is_finite()) && q.iter().any(|q| *q < 0.0) && q.iter().any(|q| *q > 0.0));
        assert_eq!(v, [2.0]);
    }

    #[test]
    fn a_time_like_coordinate_is_one_of_the_system() {
        let system = SystemInstance::<f64>::named("ads4-geodesic", &[]).unwrap();
        for preset in [Preset::Quick, Preset::Best, Preset::Paper] {
            let config = preset.config(&system).unwrap();
            assert_eq!(config.architecture(&system, vec![1.0; 4]).unwrap().time_like, Some(0));
        }
        let mut config = Preset::Quick.config(&system).unwrap();
        config.network.time_like = Some("w".to_string());
        let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
        assert_eq!(refused, "network.time_like: expected the name of a coordinate, found `w`; there are t, x, y, z");
        let pendulum = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap();
        assert_eq!(Preset::Quick.config(&pendulum).unwrap().network.time_like, None);
    }

    #[test]
    fn velocities_beyond_light_are_drawn_again_or_refused() {
        let system = SystemInstance::<f64>::named("charged-particle", &[]).unwrap();
        let at = |low: f64, high: f64| {
            let mut rng = RngStream::Test.generator(0);
            Dataset::sample(&system, "box", (&[[0.0, 1.0]; 3], &[[low, high]; 3]), 100, &mut rng)
        };
        let set = at(-1.0, 1.0).unwrap();
        assert!(set.v().chunks(3).all(|v| v.iter().map(|v| v * v).sum::<f64>() < 1.0));
        assert!(matches!(at(0.9, 1.0), Err(SamplingError::Domain { demand: "a finite acceleration", .. })));
    }

    #[test]
    fn states_keep_what_their_motions_keep() {
        let system = SystemInstance::<f64>::named("sphere-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (2000, 10, 10);
        config.phases[0].position = vec![[0.2, PI - 0.2], [0.5, 13.5]];
        config.phases[0].velocity = vec![[-5.0, 5.0], [-15.0, 15.0]];
        let mut seen = |fraction: f64| {
            config.data.trajectory_fraction = fraction;
            let (data, _) = Datasets::<f64>::sample(&config, &system).unwrap();
            let set = &data.training[0];
            assert_eq!(set.len(), 2000);
            let (mut slow, mut turns, mut away) = (0, [0; 3], 0);
            for ((q, v), a) in set.q().chunks(2).zip(set.v().chunks(2)).zip(set.a().chunks(2)) {
                let inside =
                    |x: &[f64], bounds: &[[f64; 2]]| x.iter().zip(bounds).all(|(x, b)| (b[0]..=b[1]).contains(x));
                assert!(inside(q, &config.phases[0].position) && inside(v, &config.phases[0].velocity));
                assert_eq!(system.exact_acceleration(q, v).unwrap(), a);
                // No start is faster than sqrt(2^2 + 2^2), and speed is kept.
                slow += usize::from((v[0] * v[0] + (q[0].sin() * v[1]).powi(2)).sqrt() <= 8f64.sqrt() + 1e-6);
                turns[(q[1] / TAU) as usize] += 1;
                // Starts lie between pi/4 and 3 pi/4.
                away += usize::from(q[0].sin() < 0.5f64.sqrt());
            }
            assert!(turns.iter().all(|&k| k > 50), "{turns:?}");
            (slow, away)
        };
        let (slow, away) = seen(1.0);
        assert!(slow == 2000 && away > 300, "{slow} {away}");
        // Uniform states are as slow now and then, by area not above pi (2.83^2) / (10 * 30 sin theta).
        assert!((1000..1500).contains(&seen(0.5).0));
        assert!(seen(0.0).0 < 500);
    }

    #[test]
    fn spacetime_motions_are_on_the_shell_and_keep_their_momenta() {
        let system = SystemInstance::<f64>::named("ads4-geodesic", &[]).unwrap();
        let bounds = (
            &[[-5.0, 5.0], [-5.0, 5.0], [-5.0, 5.0], [0.4, 6.0]][..],
            &[[0.0, 0.0], [-2.0, 2.0], [-2.0, 2.0], [-2.0, 2.0]][..],
        );
        let mut rng = crate::random::RngStream::Training(0).generator(3);
        let drawn =
            along_motions(&system, "phase[0].position", bounds, &[], 500, (&mut rng, &AtomicBool::new(false))).unwrap();
        for (q, v) in drawn.q.chunks(4).zip(drawn.v.chunks(4)) {
            let mut shell = v.to_vec();
            system.impose_constraint(q, &mut shell).unwrap();
            assert_eq!(shell, v);
            // x'/z^2 of the starts is within 0.25/0.5^2.
            assert!((v[1] / q[3].powi(2)).abs() <= 1.0 + 1e-6 && q[0] >= 0.0);
        }
        assert!(drawn.v.chunks(4).any(|v| v[3] > 1.2));
    }

    #[test]
    fn bounds_that_no_motion_passes_through_are_refused() {
        let system = SystemInstance::<f64>::named("ads2-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.trajectory_fraction) = (500, 0.1);
        config.phases[0].position[1] = [5.0, 6.0];
        let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("phase[0].position: hardly any motion"), "{refused}");
        config.data.trajectory_fraction = f64::NAN;
        let refused = Datasets::<f64>::sample(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("data.trajectory_fraction: ") && refused.ends_with("found NaN"), "{refused}");
    }
}

//! Training data of hand-written systems: uniform states with exact accelerations.

use crate::configuration::Config;
use crate::data::dataset::Datasets;
use crate::data::dataset::{Dataset, DatasetError};
use crate::data::draw::{Drawn, SamplingError, draw};
use crate::data::motions::along_motions;
use crate::data::shell::{in_shell, weigh_by_distance};
use crate::data::weights::Weighting;
use crate::lagrangian::SystemInstance;
use crate::random::RngStream;
use crate::scalar::Scalar;
use rand::Rng;
use std::sync::atomic::AtomicBool;

/// Draws `states` states uniformly from a box, with their exact accelerations, all in double precision.
///
/// A system with a mass shell is put on it: the velocity of its time-like coordinate follows from the other numbers, its
/// bounds mean nothing. A state of a system under constraints is brought to them by the shortest way, wherever that leads. States
/// outside the system's domain, or with an acceleration that is not finite, are drawn again.
///
/// # Errors
/// [`SamplingError::Domain`] if more than nine in ten draws are refused.
pub fn sample(
    system: &SystemInstance<f64>,
    field: &str,
    bounds: (&[[f64; 2]], &[[f64; 2]]),
    states: usize,
    rng: &mut impl Rng,
) -> Result<Dataset<f64>, SamplingError> {
    fill(Drawn::new(system)?, field, bounds, &[], states, (rng, &AtomicBool::new(false)))
}

/// Draws further states, up to `states`, as [`sample`] does.
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
        Drawn::go_on(interrupt)?;
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

/// Slowest velocity off a mass shell, as a part of one on it.
const SLOWEST: f64 = 0.03;

/// Slows a `fraction` of geodesic states down and reverses half of them: `v -> u v`, `a -> u^2 a`, `|u|` between
/// [`SLOWEST`] and 1, uniform in its logarithm.
///
/// Their residuals weigh `1 / u^2`: an error of the connection counts at every speed alike.
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

/// All datasets of a run in its precision, with the physical scale of the first phase's training states.
///
/// # Errors
/// [`SamplingError`].
pub fn sample_all<S: Scalar>(
    config: &Config,
    system: &SystemInstance<f64>,
) -> Result<(Datasets<S>, Vec<f64>), SamplingError> {
    sample_all_until(config, system, &AtomicBool::new(false))
}

/// The same, ended by a flag.
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
            if floor > 0.0 { weigh_by_distance(set, system, &shell, floor)? } else { set }
        } else {
            let moving = (config.data.trajectory_fraction * states as f64).round() as usize;
            let drawn = along_motions(system, &field, bounds, &phase.log_uniform, moving, (&mut rng, interrupt))?;
            let set = fill(drawn, &field, bounds, &phase.log_uniform, states, (&mut rng, interrupt))?;
            let scale = set.physical_scale();
            if floor > 0.0 { Weighting { floor, scale: &scale, errors: &[] }.relative(set)? } else { set }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{Request, Terms, configure};
    use crate::presets::Preset;
    use std::borrow::Cow;

    #[test]
    fn every_state_of_a_relativistic_system_is_on_the_mass_shell() {
        let mut seen = 0;
        for system in crate::lagrangian::systems().iter().filter(|s| s.constraint.is_some()) {
            let configured = configure::<f64>(&system.name, &[]).unwrap();
            let mut config = Preset::Quick.config(&configured).unwrap();
            (config.data.training, config.data.validation, config.data.test) = (500, 200, 100);
            config.data.rescaled_fraction = 0.0;
            let (data, scale) = sample_all::<f64>(&config, &configured).unwrap();
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
            assert_eq!(sample_all::<f64>(&config, &configured).unwrap().0.training, data.training);
            seen += 1;
        }
        assert_eq!(seen, 8);
    }

    #[test]
    fn states_under_constraints_lie_on_them() {
        let system = configure::<f64>("cartesian-chain-2", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (200, 50, 50);
        for fraction in [0.0, 0.5] {
            config.data.trajectory_fraction = fraction;
            let (data, _) = sample_all::<f64>(&config, &system).unwrap();
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
        // Constraints that no state of the bounds comes to.
        let mut description = system.system.description().unwrap().clone();
        description.name = "unreachable".to_string();
        description.constraints.insert("far".to_string(), "x1 + 5*l".to_string());
        let far = crate::lagrangian::configure_system::<f64>(Cow::Owned(description.system().unwrap()), &[]);
        assert!(sample_all::<f64>(&config, &far.unwrap()).is_err());
    }

    #[test]
    fn a_raised_flag_ends_it() {
        for name in ["harmonic-oscillator", "spring-pendulum", "schwarzschild-cartesian"] {
            let system = configure::<f64>(name, &[]).unwrap();
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
        let system = configure::<f64>(name, &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (2000, 10, 10);
        (config.data.rescaled_fraction, config.data.acceleration_weighting) = (0.25, 0.0);
        let (data, _) = sample_all::<f64>(&config, &system).unwrap();
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
        assert!(matches!(sample_all::<f64>(&config, &system), Err(SamplingError::Config(_))));
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
        let system = configure::<f64>("spring-pendulum", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (50, 10, 10);
        let (data, _) = sample_all::<f64>(&config, &system).unwrap();
        assert!((0..50).all(|k| (1e-6..1.0).contains(&data.training[0].weight(k))));
        config.data.acceleration_weighting = -1.0;
        let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("data.acceleration_weighting: ") && refused.ends_with("found -1"), "{refused}");
    }

    #[test]
    fn half_of_a_logarithmic_coordinate_is_uniform_in_its_logarithm() {
        let system = configure::<f64>("ads2-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (8000, 10, 10);
        config.data.trajectory_fraction = 0.0;
        config.phases[0].position = vec![[-5.0, 5.0], [0.25, 64.0]];
        let below_four = |log_uniform: &[bool]| {
            let mut config = config.clone();
            config.phases[0].log_uniform = log_uniform.to_vec();
            let (data, _) = sample_all::<f64>(&config, &system).unwrap();
            let z = data.training[0].q().chunks(2).map(|q| q[1]);
            assert!(z.clone().all(|z| (0.25..=64.0).contains(&z)));
            z.filter(|z| *z < 4.0).count()
        };
        // 3.75 of 63.75 uniformly, 4 of 8 doublings logarithmically; the means' deviations are 21 and 41.
        let (plain, mixed) = (below_four(&[]), below_four(&[false, true]));
        assert!(plain.abs_diff(471) < 110 && mixed.abs_diff(2235) < 210, "{plain} {mixed}");
        config.phases[0].log_uniform = vec![true, false];
        let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("phase[0].position[0]: expected a lowest coordinate above 0"), "{refused}");
        config.phases[0].log_uniform = vec![true];
        let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("phase[0].log_uniform: expected nothing or true or false"), "{refused}");
    }

    #[test]
    fn scales_of_the_papers_geodesics() {
        let system = configure::<f64>("ads4-geodesic", &[]).unwrap();
        let mut config = Preset::Paper.config(&system).unwrap();
        assert_eq!((config.data.training, config.data.validation), (120_000, 24_000));
        (config.data.training, config.data.validation, config.data.test) = (120_000, 10, 10);
        let (_, scale) = sample_all::<f32>(&config, &system).unwrap();
        // s_t = 6.18, s_x = s_y = 5.00, s_z = 6.00; t_dot is at most sqrt(1 + 1 + 0.6^2 + 6^2) = 6.20.
        assert!((6.15..6.2).contains(&scale[0]), "{scale:?}");
        assert!(scale[1..].iter().zip([5.0, 5.0, 6.0]).all(|(s, paper)| (s - paper).abs() < 0.005), "{scale:?}");
    }

    #[test]
    fn bounds_longer_than_the_largest_number_are_refused_and_can_be_drawn_from() {
        let system = configure::<f64>("double-pendulum", &[]).unwrap();
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
            let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
            let expected = "[low, high] no further apart than the largest number, found [-1e308, 1e308]";
            assert_eq!(refused, format!("{field}[1]: expected {expected}"));
            // Recorded states need no bounds, drawn ones do.
            bounds(&mut config).clear();
            assert!(config.validate(2).is_ok());
            let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
            assert_eq!(refused, format!("{field}: expected one [low, high] per coordinate, found 0 for 2"));
        }
        let mut rng = RngStream::Test.generator(0);
        let (q, v) = draw((&[wide; 50], &[[2.0, 2.0]]), &[], &mut rng);
        assert!(q.iter().all(|q| q.is_finite()) && q.iter().any(|q| *q < 0.0) && q.iter().any(|q| *q > 0.0));
        assert_eq!(v, [2.0]);
    }

    #[test]
    fn a_time_like_coordinate_is_one_of_the_system() {
        let system = configure::<f64>("ads4-geodesic", &[]).unwrap();
        for preset in [Preset::Quick, Preset::Best, Preset::Paper] {
            let config = preset.config(&system).unwrap();
            assert_eq!(config.architecture(&system, vec![1.0; 4]).unwrap().time_like, Some(0));
        }
        let mut config = Preset::Quick.config(&system).unwrap();
        config.network.time_like = Some("w".to_string());
        let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
        assert_eq!(refused, "network.time_like: expected the name of a coordinate, found `w`; there are t, x, y, z");
        let pendulum = configure::<f64>("double-pendulum", &[]).unwrap();
        assert_eq!(Preset::Quick.config(&pendulum).unwrap().network.time_like, None);
    }

    #[test]
    fn velocities_beyond_light_are_drawn_again_or_refused() {
        let system = configure::<f64>("charged-particle", &[]).unwrap();
        let at = |low: f64, high: f64| {
            let mut rng = RngStream::Test.generator(0);
            sample(&system, "box", (&[[0.0, 1.0]; 3], &[[low, high]; 3]), 100, &mut rng)
        };
        let set = at(-1.0, 1.0).unwrap();
        assert!(set.v().chunks(3).all(|v| v.iter().map(|v| v * v).sum::<f64>() < 1.0));
        assert!(matches!(at(0.9, 1.0), Err(SamplingError::Domain { demand: "a finite acceleration", .. })));
    }
}

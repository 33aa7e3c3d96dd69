//! Training states along exact motions.

use crate::data::draw::boxes;
use crate::data::draw::{Drawn, SamplingError, draw};
use crate::lagrangian::system::Coordinate;
use crate::lagrangian::{Interruptible, SystemInstance};
use crate::rollout::{Domain, Method, Options, rollout};
use rand::Rng;
use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

/// States that a motion of full length gives on average.
const PER_MOTION: f64 = 10.0;

/// Draws `states` states of exact motions from the starts of the system's trajectory test, every sample up to its end with
/// the same chance; a motion ends where it leaves the bounds. An angle is turned back into its bounds, to any turn that lies
/// within them. Starts are drawn as states are, half of the log-uniform coordinates uniform in their logarithm.
///
/// # Errors
/// [`SamplingError::Motions`] if hardly any motion stays within the bounds for a while.
pub(crate) fn along_motions<'a>(
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
    let options = Options {
        method: Method::Dop853,
        rtol: 1e-9,
        atol: 1e-9,
        energy: false,
        domain: Some(Domain::new(chart.chain(pace).collect())),
        ..Options::new(test.t_end, test.dt)
    };
    let chance = PER_MOTION * test.dt / test.t_end;
    let mut drawn = Drawn::new(system)?;
    let mut motions = 0;
    while drawn.q.len() < states * n {
        Drawn::go_on(interrupt)?;
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
                // Integration left the mass shell by its tolerance.
                if drawn.impose(&mut q, &mut v)?.is_none() {
                    drawn.take(&q, &v)?;
                }
            }
        }
    }
    Ok(drawn)
}

/// Turns angles to any turn within their bounds; `false` if there is none.
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
    use crate::data::sample_all;
    use crate::lagrangian::configure;
    use crate::presets::Preset;
    use std::f64::consts::PI;

    #[test]
    fn states_keep_what_their_motions_keep() {
        let system = configure::<f64>("sphere-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.validation, config.data.test) = (2000, 10, 10);
        config.phases[0].position = vec![[0.2, PI - 0.2], [0.5, 13.5]];
        config.phases[0].velocity = vec![[-5.0, 5.0], [-15.0, 15.0]];
        let mut seen = |fraction: f64| {
            config.data.trajectory_fraction = fraction;
            let (data, _) = sample_all::<f64>(&config, &system).unwrap();
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
        let system = configure::<f64>("ads4-geodesic", &[]).unwrap();
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
        let system = configure::<f64>("ads2-geodesic", &[]).unwrap();
        let mut config = Preset::Quick.config(&system).unwrap();
        (config.data.training, config.data.trajectory_fraction) = (500, 0.1);
        config.phases[0].position[1] = [5.0, 6.0];
        let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("phase[0].position: hardly any motion"), "{refused}");
        config.data.trajectory_fraction = f64::NAN;
        let refused = sample_all::<f64>(&config, &system).unwrap_err().to_string();
        assert!(refused.starts_with("data.trajectory_fraction: ") && refused.ends_with("found NaN"), "{refused}");
    }
}

//! Time-like states in a shell around a centre, and weights that make near and far states count equally.

use crate::configuration::{ConfigError, Shell};
use crate::data::dataset::{Dataset, Weighting};
use crate::data::sampling::{Drawn, SamplingError, draw};
use crate::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use crate::linalg::{Workspace, inverse};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::atomic::AtomicBool;

/// Draws `states` states by [`Shell`]; coordinates outside the shell are uniform within `position`.
///
/// # Errors
/// [`SamplingError::Config`] for a system without a time, or for unknown coordinates; [`SamplingError::Domain`] if more than nine in ten
/// draws lie outside the system's domain or where surfaces of equal time are not space-like.
pub(crate) fn in_shell(
    system: &SystemInstance<f64>,
    shell: &Shell<'_>,
    (field, position): (&str, &[[f64; 2]]),
    states: usize,
    (rng, interrupt): (&mut impl Rng, &AtomicBool),
) -> Result<Dataset<f64>, SamplingError> {
    let n = system.coordinates;
    let around = places(system, shell)?;
    let Some(time) = system.system.time_like else {
        return Err(SamplingError::Config(ConfigError {
            field: "data.shell".to_string(),
            expected: "a system with a time-like coordinate".into(),
            found: format!("`{}`", system.system.name),
        }));
    };
    let metric = system.build()?;
    let [low, high] = shell.radius;
    let (mut drawn, mut refused) = (Drawn::new(system)?, 0_usize);
    while drawn.q.len() < states * n {
        Drawn::check_interrupt(interrupt)?;
        let (mut q, _) = draw((position, &[]), &[], rng);
        let radius = low * (high / low).powf(rng.random::<f64>());
        for (&i, part) in around.iter().zip(direction(around.len(), rng)) {
            q[i] = radius * part;
        }
        let rapidity = shell.rapidity * rng.random::<f64>();
        let demand = match moving(metric.as_ref(), time, &q, rapidity, &direction(n - 1, rng)) {
            Some(v) => drawn.take(&q, &v)?,
            None => Some("a space-like surface of equal time"),
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

/// Indices of the coordinates of a shell.
fn places(system: &SystemInstance<f64>, shell: &Shell<'_>) -> Result<Vec<usize>, ConfigError> {
    let names = system.system.coordinates(system.coordinates);
    let place = |name: &String| crate::configuration::place("data.shell", name, names.iter().map(|c| c.name.as_ref()));
    shell.coordinates.iter().map(place).collect()
}

/// Returns a unit vector in a uniformly distributed direction.
fn direction(n: usize, rng: &mut impl Rng) -> Vec<f64> {
    let normal: Vec<f64> = (0..n).map(|_| StandardNormal.sample(rng)).collect();
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    normal.into_iter().map(|x| x / length).collect()
}

/// Returns `cosh(rapidity) n + sinh(rapidity) e`, where `n` is the future unit normal of the surface of equal time and `e` is the unit
/// vector in that surface whose components in an orthonormal frame are `ahead`, `(n - 1)`. `None` where the surface is not space-like.
fn moving(metric: &dyn EulerLagrange<f64>, time: usize, q: &[f64], rapidity: f64, ahead: &[f64]) -> Option<Vec<f64>> {
    let n = q.len();
    let mut terms = Terms::default();
    metric.terms(q, &vec![0.0; n], Request::MASS_MATRIX, &mut terms).ok()?;
    let g = &terms.mass_matrix;
    let mut up = vec![f64::NAN; n * n];
    inverse(n, g, &mut up, &mut Workspace::new()).ok()?;
    // g^tt = -1/lapse^2.
    let lapse = (-up[time * n + time]).sqrt().recip();
    let space: Vec<usize> = (0..n).filter(|&i| i != time).collect();
    let along =
        within(&space.iter().map(|&i| space.iter().map(|&j| g[i * n + j]).collect()).collect::<Vec<_>>(), ahead)?;
    let mut v: Vec<f64> = (0..n).map(|i| -lapse * up[i * n + time] * rapidity.cosh()).collect();
    space.iter().zip(along).for_each(|(&i, part)| v[i] += rapidity.sinh() * part);
    v.iter().all(|v| v.is_finite()).then_some(v)
}

/// Returns the unit vector of a positive definite metric `h` whose components in an orthonormal frame are `ahead`: `L^T e = ahead`, `h = L
/// L^T`. `None` if the metric is not positive definite.
fn within(h: &[Vec<f64>], ahead: &[f64]) -> Option<Vec<f64>> {
    let n = h.len();
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let rest = h[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            if i == j && rest <= 0.0 {
                return None;
            }
            lower[i][j] = if i == j { rest.sqrt() } else { rest / lower[j][j] };
        }
    }
    let mut e = ahead.to_vec();
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| lower[k][i] * e[k]).sum();
        e[i] = (e[i] - known) / lower[i][i];
    }
    Some(e)
}

/// Weights the states so that near and far states count equally, see [`Weighting::by_distance`].
pub(crate) fn weigh_by_distance(
    set: Dataset<f64>,
    system: &SystemInstance<f64>,
    shell: &Shell<'_>,
    floor: f64,
) -> Result<Dataset<f64>, SamplingError> {
    let scale = vec![1.0; set.coordinates()];
    Ok(Weighting { floor, scale: &scale, errors: &[] }.by_distance(set, &places(system, shell)?)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Datasets;
    use crate::presets::Preset;

    /// Checks that velocities are future-directed and normalised, from inside the horizon outward, with distances uniform in their
    /// logarithm and rapidities within bounds.
    #[test]
    fn states_in_a_shell_are_time_like_and_of_all_distances() {
        for name in ["schwarzschild-cartesian", "kerr-cartesian", "reissner-nordstrom-cartesian"] {
            let system = SystemInstance::<f64>::named(name, &[]).unwrap();
            let mut config = Preset::Quick.config(&system).unwrap();
            (config.data.training, config.data.validation, config.data.test) = (4000, 100, 100);
            let (data, scale) = Datasets::<f64>::sample(&config, &system).unwrap();
            let (set, exact, mut terms) = (&data.training[0], system.build().unwrap(), Terms::default());
            exact
                .terms(set.q(), set.v(), Request::LAGRANGIAN | Request::MOMENTUM | Request::ACCELERATION, &mut terms)
                .unwrap();
            assert!(terms.lagrangian.iter().all(|l| (2.0 * l + 1.0).abs() < 1e-11), "{name}");
            assert_eq!(terms.acceleration.len(), set.a().len());
            let radius = |q: &[f64]| q[1..].iter().map(|x| x * x).sum::<f64>().sqrt();
            let shell = config.data.shell().unwrap().unwrap();
            let middle = (shell.radius[0] * shell.radius[1]).sqrt();
            let near = set.q().chunks(4).filter(|q| radius(q) < middle).count();
            assert!((1850..2150).contains(&near), "{name}: {near}");
            for (k, q) in set.q().chunks(4).enumerate() {
                assert!(radius(q) >= shell.radius[0] * (1.0 - 1e-12) && radius(q) <= shell.radius[1] * (1.0 + 1e-12));
                // An observer at rest in the surface of equal time measures the rapidity: u.n = -cosh, u.n = -lapse t'.
                let metric = {
                    let mut terms = Terms::default();
                    exact.terms(q, &[0.0; 4], Request::MASS_MATRIX, &mut terms).unwrap();
                    terms.mass_matrix
                };
                let mut up = vec![0.0; 16];
                inverse(4, &metric, &mut up, &mut Workspace::new()).unwrap();
                let cosh = set.v()[4 * k] / (-up[0]).sqrt();
                assert!(cosh >= 1.0 - 1e-9 && cosh <= shell.rapidity.cosh() + 1e-9, "{name}: {cosh}");
            }
            // A relative error of the typical acceleration counts equally at every distance.
            let size = |k: usize| set.a()[4 * k..][..4].iter().map(|a| a.abs()).sum::<f64>() / 4.0;
            let (mut inner, mut outer) = ((0.0, 0), (0.0, 0));
            for (k, q) in set.q().chunks(4).enumerate() {
                let of = if radius(q) < middle { &mut inner } else { &mut outer };
                *of = (of.0 + set.weight(k) * size(k), of.1 + 1);
            }
            let [inner, outer] = [inner, outer].map(|(sum, count)| sum / f64::from(count));
            assert!((inner / outer - 1.0).abs() < 0.1 && (0.3..0.7).contains(&inner), "{name}: {inner} {outer}");
            assert!(scale.iter().all(|s| *s > 1.0));
        }
    }

    #[test]
    fn a_shell_needs_a_time_and_coordinates_of_the_system() {
        let kepler = SystemInstance::<f64>::named("kepler", &[]).unwrap();
        let mut config = Preset::Quick.config(&kepler).unwrap();
        let mut refused = |names: &[&str], radius: Option<[f64; 2]>| {
            config.data.shell = names.iter().map(|name| name.to_string()).collect();
            config.data.shell_radius = radius;
            Datasets::<f64>::sample(&config, &kepler).unwrap_err().to_string()
        };
        let problem = refused(&["x", "y"], Some([1.0, 2.0]));
        assert_eq!(problem, "data.shell: expected a system with a time-like coordinate, found `kepler`");
        let problem = refused(&["x", "z"], Some([1.0, 2.0]));
        assert!(problem.starts_with("data.shell: expected the name of a coordinate, found `z`"), "{problem}");
        let problem = refused(&["x", "y"], Some([0.0, 2.0]));
        assert_eq!(problem, "data.shell_radius: expected [low, high], 0 < low < high, found [0, 2]");
        assert_eq!(refused(&["x", "y"], None), "data.shell_radius: expected [low, high] beside data.shell, found none");
    }
}

//! Errors of what the exact motion conserves beside its energy, along a trajectory.

use crate::lagrangian::SystemInstance;
use crate::rollout::Trajectory;
use crate::scalar::Scalar;

/// `|C - C(0)| / |C(0)|` (Euclidean norms), by `C(0)` and `C`.
pub(crate) fn conserved_change(first: &[f64], vector: &[f64]) -> f64 {
    let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    distance(vector, first) / distance(first, &vec![0.0; first.len()])
}

/// `|C(t) - C(0)| / |C(0)|` (Euclidean norms) of the system's conserved vector along
/// any trajectory, one value per sample; `None` for a system without one or a trajectory of another number of coordinates.
///
/// `NaN` where `C(0)` vanishes and so does the difference.
pub fn conserved_error<S: Scalar>(system: &SystemInstance<S>, trajectory: &Trajectory<S>) -> Option<Vec<f64>> {
    system.system.conserved?;
    let vectors: Option<Vec<Vec<f64>>> = (0..trajectory.len())
        .map(|k| {
            let (q, v) = trajectory.state(k);
            system.conserved(q, v)
        })
        .collect();
    let vectors = vectors?;
    let Some(first) = vectors.first() else { return Some(Vec::new()) };
    Some(vectors.iter().map(|vector| conserved_change(first, vector)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::StartBox;
    use crate::lagrangian::{configure, systems};
    use crate::rollout::{Options, rollout};

    #[test]
    fn exact_motion_keeps_it() {
        let mut seen = Vec::new();
        for system in systems().iter().filter(|system| system.conserved.is_some()) {
            let (n, parameters) = (system.size.default(), &system.parameters);
            // Other values than the defaults, which are mostly 1.
            let given: Vec<(String, String)> =
                parameters.iter().map(|p| (p.symbol.to_string(), "1.25".into())).collect();
            let system = configure::<f64>(&system.name, &given).unwrap();
            let (exact, test) = (system.build().unwrap(), system.system.trajectory(n));
            let bounds = StartBox { q: test.start.positions, v: test.start.velocities };
            for (q, mut v) in bounds.starts::<f64>(4, 5) {
                system.impose_constraint(&q, &mut v).unwrap();
                let run = rollout(exact.as_ref(), &q, &v, &Options::reference(test.t_end, test.dt));
                assert!(run.stop.is_none(), "{:?}", run.stop);
                let mut trajectory = run.trajectory;
                let error = conserved_error(&system, &trajectory).unwrap();
                assert_eq!(error.len(), trajectory.len());
                assert!(error.iter().all(|&e| e < 1e-9), "{}: {error:?}", system.system.name);
                // One velocity more at one time: the vector is not the same any more.
                let last = trajectory.v.len() - n;
                trajectory.v[last..].iter_mut().for_each(|v| *v *= 1.5);
                let error = conserved_error(&system, &trajectory).unwrap();
                assert!((error[error.len() - 1] - 0.5).abs() < 1e-6, "{}", system.system.name);
            }
            seen.push(system.system.name.clone());
        }
        assert_eq!(seen.len(), 10, "{seen:?}");
    }

    #[test]
    fn a_great_circle_left_by_an_angle_shows_that_angle() {
        let system = configure::<f64>("sphere-geodesic", &[]).unwrap();
        // Along the equator, then along a circle tilted by 0.01.
        let (q, v) = (vec![1.0, 0.3, 1.0, 0.3], vec![0.0, 2.0, 0.0, 2.0]);
        let mut trajectory = Trajectory { coordinates: 2, t: vec![0.0, 1.0], q, v, energy: None };
        trajectory.q[0] = std::f64::consts::FRAC_PI_2;
        trajectory.q[2] = std::f64::consts::FRAC_PI_2;
        (trajectory.v[2], trajectory.v[3]) = (2.0 * 0.01_f64.sin(), 2.0 * 0.01_f64.cos());
        let error = conserved_error(&system, &trajectory).unwrap();
        assert_eq!(error[0], 0.0);
        assert!((error[1] - 2.0 * 0.005_f64.sin()).abs() < 1e-15, "{error:?}");
        assert!(conserved_error(&configure::<f64>("double-pendulum", &[]).unwrap(), &trajectory).is_none());
    }
}

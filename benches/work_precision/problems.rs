//! Motions to integrate: a model in `f64`, the same model in double-double, a start and output times.

use super::super::common::accuracy::{configure, recast};
use super::learned;
use super::options::Options;
use lnn::lagrangian::{EulerLagrange, SystemInstance};
use lnn::scalar::Dd;

/// A motion. All its numbers are exact in both precisions; times are multiples of powers of two.
pub struct Problem {
    pub name: &'static str,
    pub model: Box<dyn EulerLagrange<f64>>,
    pub wide: Box<dyn EulerLagrange<Dd>>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub t_end: f64,
    /// Distance of the output times.
    pub dt: f64,
}

/// Name, system, coordinates, velocities, end and distance of outputs. Spans are short enough that the growth of errors
/// stays far from the rounding floor.
type Start = (&'static str, &'static str, &'static [f64], &'static [f64], f64, f64);

const STARTS: [Start; 5] = [
    ("Henon-Heiles", "henon-heiles", &[0.0, 0.125], &[0.4375, 0.125], 16.0, 1.0),
    ("double pendulum", "double-pendulum", &[1.25, 0.75], &[0.0, 0.5], 4.0, 0.25),
    ("Kepler", "kepler", &[1.0, 0.0], &[0.0, 1.1875], 16.0, 1.0),
    ("sphere geodesic", "sphere-geodesic", &[1.0, 0.0], &[0.5, 1.0], 8.0, 0.5),
    // On the mass shell: t_dot is imposed.
    ("AdS4 geodesic", "ads4-geodesic", &[0.0, 0.0, 0.0, 1.0], &[0.0, 0.25, -0.125, 0.125], 1.0, 0.125),
];

/// Name of the exact problem that the learned one shares its start with.
pub const TAUGHT_BY: &str = "double pendulum";

/// Name of the learned problem.
pub const LEARNED: &str = "learned double pendulum";

/// All problems; the learned one comes last.
///
/// # Errors
/// A model that cannot be read or trained.
pub fn problems(options: &Options) -> Result<Vec<Problem>, String> {
    let mut list = Vec::new();
    for (name, system, q, v, t_end, dt) in STARTS {
        let narrow: SystemInstance<f64> = configure(system, &[]);
        let wide: SystemInstance<Dd> = recast(&narrow);
        let (q, mut v) = (q.to_vec(), v.to_vec());
        narrow.impose_constraint(&q, &mut v).map_err(|e| e.to_string())?;
        let model = narrow.build().map_err(|e| e.to_string())?;
        let wide = wide.build().map_err(|e| e.to_string())?;
        if name == TAUGHT_BY {
            let network = learned::double_pendulum(options)?;
            let (q, v) = (q.clone(), v.clone());
            let wide = Box::new(network.cast::<Dd>());
            // Shorter: its reference is costly.
            let t_end = options.choose(dt, 2.0 * dt, 4.0 * dt);
            list.push(Problem { name: LEARNED, model: Box::new(network), wide, q, v, t_end, dt });
        }
        list.push(Problem { name, model, wide, q, v, t_end, dt });
    }
    list.sort_by_key(|problem| problem.name == LEARNED);
    Ok(list)
}

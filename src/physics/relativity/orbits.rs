//! Orbits that show what a hole does to matter: a precessing ellipse, a zoom and whirl, a plunge.

use super::CentralCoordinates;
use super::event::passing;
use super::periastron::radial_period;
use crate::geometry::{GeometryError, Sense};
use crate::lagrangian::EulerLagrange;
use std::f64::consts::TAU;

/// A motion in the equator from a state until a time, or until it comes to a distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// Title of a picture.
    pub title: &'static str,
    /// Coordinates at the start.
    pub q: [f64; 4],
    /// Velocities at the start, on the mass shell.
    pub v: [f64; 4],
    /// End of the time.
    pub t_end: f64,
    /// Distance between samples of the time.
    pub dt: f64,
    /// Distance from the centre at which it ends.
    pub inner: f64,
}

/// Eccentricity of the ellipse, and of the whirl.
const ECCENTRICITY: [f64; 2] = [0.5, 0.7];
/// Semilatus rectum of the ellipse over the mass.
const ELLIPSE: f64 = 12.0;
/// Halvings of the search for the last orbit that comes back.
const HALVINGS: usize = 24;
/// Excess of the whirl over that orbit, relative.
const EXCESS: f64 = 3e-3;

/// The orbits of a hole of mass `mass`, whose metric is known down to the distance `inner`; those that it does not have are left out.
///
/// # Errors
/// Those of the metric.
pub fn orbits(
    model: &dyn EulerLagrange<f64>,
    around: CentralCoordinates,
    mass: f64,
    inner: f64,
) -> Result<Vec<Orbit>, GeometryError> {
    let origin = around.origin();
    let equator = around.equator(model, &origin);
    let kepler = |a: f64| TAU * a.powf(1.5) / mass.sqrt();
    // From periastron, with the time of a revolution after Kepler.
    type Start = ([[f64; 4]; 2], f64);
    let bound = |p: f64, e: f64| -> Result<Option<Start>, GeometryError> {
        let (near, far) = (p / (1.0 + e) * mass, p / (1.0 - e) * mass);
        let turning = equator.between(near, far, Sense::Forward)?;
        Ok(turning.map(|turning| (around.turning(near, &turning), kepler(0.5 * (near + far)))))
    };
    let mut found = Vec::new();
    let [ellipse, whirl] = ECCENTRICITY;
    if let Some(([q, v], period)) = bound(ELLIPSE, ellipse)? {
        let (t_end, dt) = (5.0 * period, period / 200.0);
        found.push(Orbit { title: "Precessing ellipse", q, v, t_end, dt, inner });
    }
    let comes_back = |p: f64| -> Result<bool, GeometryError> {
        let Some(([q, v], period)) = bound(p, whirl)? else { return Ok(false) };
        let far = p / (1.0 - whirl) * mass;
        // What starts inside the last orbit turns around elsewhere, or not at all.
        let reaches =
            passing(model, (&q, &v), (2.0 * period, period / 400.0), |state| around.distance(&state.q) > 0.99 * far);
        Ok(reaches.is_some() && radial_period(model, (&q, &v), around, (4.0 * period, period / 400.0)).is_some())
    };
    let (mut low, mut high) = (1.0, ELLIPSE);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if comes_back(middle)? {
            high = middle;
        } else {
            low = middle;
        }
    }
    if let Some(([q, v], period)) = bound(high * (1.0 + EXCESS), whirl)? {
        found.push(Orbit { title: "Zoom and whirl", q, v, t_end: 2.2 * period, dt: period / 600.0, inner });
    }
    // Most of what circles at 10 M, too slow to stay.
    let place = 10.0 * mass;
    let circle = equator.at(place)?;
    if let Some(w) = circle.angular_velocity(Sense::Forward).map(|w| 0.6 * w) {
        let [tt, tp, pp] = circle.value;
        let time_rate = (-(tt + (tp + tp + pp * w) * w)).sqrt().recip();
        let turning = crate::geometry::TurningPoint {
            energy: 0.0,
            angular_momentum: 0.0,
            time_rate,
            turning_rate: w * time_rate,
        };
        let [q, v] = around.turning(place, &turning);
        if time_rate.is_finite() {
            found.push(Orbit { title: "Plunge", q, v, t_end: kepler(place), dt: kepler(place) / 4000.0, inner });
        }
    }
    Ok(found)
}

impl Orbit {
    /// The path `(x, y)` of a model from this start, as far as it gets.
    pub fn path(&self, model: &dyn EulerLagrange<f64>, around: CentralCoordinates) -> Vec<(f64, f64)> {
        let mut path = Vec::new();
        passing(model, (&self.q, &self.v), (self.t_end, self.dt), |state| {
            let [x, y, _] = around.position(&state.q);
            path.push((x, y));
            around.distance(&state.q) < self.inner
        });
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::build;
    use crate::relativity::Chart;

    #[test]
    fn a_hole_has_all_three_and_they_do_what_they_are_called() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        for name in ["schwarzschild-cartesian", "kerr-cartesian"] {
            let hole = build::<f64>(name, &[]).unwrap();
            let found = orbits(&*hole, around, 1.0, 1.5).unwrap();
            assert_eq!(
                found.iter().map(|o| o.title).collect::<Vec<_>>(),
                ["Precessing ellipse", "Zoom and whirl", "Plunge"]
            );
            let paths: Vec<Vec<(f64, f64)>> = found.iter().map(|orbit| orbit.path(&*hole, around)).collect();
            let distances = |path: &[(f64, f64)]| path.iter().map(|(x, y)| x.hypot(*y)).collect::<Vec<f64>>();
            let turns = |path: &[(f64, f64)]| {
                let steps = path
                    .windows(2)
                    .map(|w| (w[0].0 * w[1].1 - w[0].1 * w[1].0).atan2(w[0].0 * w[1].0 + w[0].1 * w[1].1));
                steps.sum::<f64>().abs() / TAU
            };
            let ellipse = distances(&paths[0]);
            let (near, far) = ellipse.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &r| (a.min(r), b.max(r)));
            assert!((near - 8.0).abs() < 1e-2 && (far - 24.0).abs() < 1e-2, "{name} {near} {far}");
            // The whirl turns at least twice more than an ellipse would on its way.
            assert!(turns(&paths[1]) > 3.0 && turns(&paths[1]) < 12.0, "{name} {}", turns(&paths[1]));
            assert!(*distances(&paths[2]).last().unwrap() < 1.5, "{name}");
        }
    }
}

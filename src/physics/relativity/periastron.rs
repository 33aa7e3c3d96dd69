//! Precession of bound orbits.

use super::CentralCoordinates;
use super::event::{State, passing, zero};
use crate::lagrangian::EulerLagrange;
use std::f64::consts::TAU;

/// One radial period of a bound orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialPeriod {
    /// Angle from one periastron to the next, over the full turn, in the sense of the motion: the advance of the periastron.
    pub advance: f64,
    /// Time of the motion from one periastron to the next.
    pub time: f64,
}

/// The radial period of the motion in the equator that starts at a periastron `(q, v)`.
///
/// The motion is sampled every `dt`, a small part of its period, and followed until `t_end`; `None` if it does not come back by then.
pub fn radial_period(
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    around: CentralCoordinates,
    (t_end, dt): (f64, f64),
) -> Option<RadialPeriod> {
    let outward = |state: &State| around.outward(&state.q, &state.v);
    let angle = |state: &State| around.azimuth(&state.q);
    let turned = |from: f64, to: f64| (to - from + 1.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
    let start = State { t: 0.0, q: q.to_vec(), v: v.to_vec() };
    let (mut last, mut total, mut kept) = (angle(&start), 0.0, 0.0);
    // Out, back in, and out again.
    let (mut gone, mut returning) = (false, false);
    let found = passing(model, (q, v), (t_end, dt), |state| {
        kept = total;
        let at = angle(state);
        total += turned(last, at);
        let speed = outward(state);
        gone |= speed > 0.0;
        returning |= gone && speed < 0.0;
        let back = returning && speed >= 0.0;
        if !back {
            last = at;
        }
        back
    })?;
    let end = zero(model, &found, outward).ok()?;
    let angle = kept + turned(angle(&found[0]), angle(&end));
    Some(RadialPeriod { advance: angle.abs() - TAU, time: end.t })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Sense;
    use crate::lagrangian::build;
    use crate::relativity::Chart;
    use std::f64::consts::PI;

    /// `2 int_0^pi dx / sqrt(1 - (6 + 2 e cos x)/p) - 2 pi`, by the trapezoidal rule, which converges geometrically here.
    fn of_schwarzschild(p: f64, e: f64) -> f64 {
        const NODES: usize = 400;
        let at = |k: usize| {
            let weight = if k == 0 || k == NODES { 0.5 } else { 1.0 };
            weight / (1.0 - (6.0 + 2.0 * e * (PI * k as f64 / NODES as f64).cos()) / p).sqrt()
        };
        2.0 * PI / NODES as f64 * (0..=NODES).map(at).sum::<f64>() - TAU
    }

    #[test]
    fn orbits_of_schwarzschild_precess_by_the_closed_form_in_both_coordinates() {
        let around = [
            ("schwarzschild-cartesian", CentralCoordinates::Cartesian(Chart::default())),
            ("schwarzschild-geodesic", CentralCoordinates::Spherical { time: 0, radius: 1, polar: 2, azimuth: 3 }),
        ];
        for (name, around) in around {
            let hole = build::<f64>(name, &[]).unwrap();
            let origin = around.origin();
            for (p, e) in [(8.0, 0.5), (20.0, 0.2), (50.0, 0.5)] {
                let (near, far) = (p / (1.0 + e), p / (1.0 - e));
                let turning = around.equator(&*hole, &origin).between(near, far, Sense::Forward).unwrap().unwrap();
                // Chandrasekhar, The Mathematical Theory of Black Holes, section 19.
                let (energy, momentum) = (((p - 2.0).powi(2) - 4.0 * e * e) / p, p * p);
                let common = p - 3.0 - e * e;
                assert!((turning.energy.powi(2) * common / energy - 1.0).abs() < 1e-12, "{name} {p} {e}");
                assert!((turning.angular_momentum.powi(2) * common / momentum - 1.0).abs() < 1e-12, "{name} {p} {e}");
                let [q, v] = around.turning(near, &turning);
                let kepler = TAU * (0.5 * (near + far)).powf(1.5);
                let found = radial_period(&*hole, (&q, &v), around, (4.0 * kepler, kepler / 300.0)).unwrap();
                let exact = of_schwarzschild(p, e);
                assert!((found.advance / exact - 1.0).abs() < 1e-7, "{name} {p} {e}: {} {exact}", found.advance);
            }
        }
    }

    #[test]
    fn what_falls_in_has_no_period() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        let hole = build::<f64>("schwarzschild-cartesian", &[]).unwrap();
        let (q, v) = ([0.0, 6.0, 0.0, 0.0], [1.3, 0.0, 0.1, 0.0]);
        assert_eq!(radial_period(&*hole, (&q, &v), around, (400.0, 0.5)), None);
    }
}

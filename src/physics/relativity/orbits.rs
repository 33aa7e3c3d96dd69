//! Motion near a hole: events along it, a precessing ellipse, a zoom and whirl, a plunge, the precession of bound orbits,
//! free fall through a horizon.

use super::CentralCoordinates;
use super::thresholds::{
    CROSSING_STEPS, CROSSING_VALUE, ECCENTRICITIES, ELLIPSE_RECTUM, MOTION_STEPS, MOTION_TOLERANCE, PLUNGE_VELOCITY,
    REACHED_APASTRON, WHIRL_EXCESS, WHIRL_HALVINGS,
};
use crate::geometry::{GeometryError, Sense, characters};
use crate::lagrangian::EulerLagrange;
use crate::linalg::Inertia;
use crate::rollout::{Integrator, RolloutError, RolloutOptions, rollout, rollout_in_pieces};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// State of a motion at a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MotionState {
    pub t: f64,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
}

/// Options of the motions that are followed.
pub(super) fn options(t_end: f64, dt: f64) -> RolloutOptions<f64> {
    RolloutOptions::new(t_end, dt)
        .method(Integrator::Dop853)
        .tolerances(MOTION_TOLERANCE, MOTION_TOLERANCE)
        .max_steps(MOTION_STEPS)
        .energy(false)
}

/// The first sample for which `next` returns `true`, with the one before it.
///
/// `None` if the motion ends earlier, at `t_end` or where the model fails.
pub(super) fn passing(
    model: &dyn EulerLagrange<f64>,
    start: (&[f64], &[f64]),
    (t_end, dt): (f64, f64),
    mut next: impl FnMut(&MotionState) -> bool,
) -> Option<[MotionState; 2]> {
    let (mut before, mut found): (Option<MotionState>, Option<[MotionState; 2]>) = (None, None);
    rollout_in_pieces(model, start.0, start.1, &options(t_end, dt), &mut |piece| {
        for k in 0..piece.len() {
            let (q, v) = piece.state(k);
            let state = MotionState { t: piece.t[k], q: q.to_vec(), v: v.to_vec() };
            if next(&state) {
                found = before.take().map(|before| [before, state]);
                return ControlFlow::Break(());
            }
            before = Some(state);
        }
        ControlFlow::Continue(())
    });
    found
}

/// The state at which `of` vanishes between two samples of a motion at which its signs differ, by the rule of false position, each trial
/// integrated from the first sample.
///
/// # Errors
/// The point between samples at which the motion fails.
pub(super) fn zero(
    model: &dyn EulerLagrange<f64>,
    [from, to]: &[MotionState; 2],
    of: impl Fn(&MotionState) -> f64,
) -> Result<MotionState, RolloutError> {
    let (mut low, mut high) = ((0.0, of(from)), (to.t - from.t, of(to)));
    let mut best = to.clone();
    let mut kept = 0_i32;
    for _ in 0..CROSSING_STEPS {
        let step = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
        let span = high.0 - low.0;
        if !(step > low.0 && step < high.0 && span > f64::EPSILON * to.t.abs()) {
            break;
        }
        let motion = rollout(model, &from.q, &from.v, &options(step, step)).complete()?;
        let (q, v) = motion.state(motion.len() - 1);
        best = MotionState { t: from.t + step, q: q.to_vec(), v: v.to_vec() };
        let value = of(&best);
        if value == 0.0 {
            break;
        }
        // The end that stays twice counts half: the Illinois variant.
        if (value > 0.0) == (low.1 > 0.0) {
            low = (step, value);
            if kept > 0 {
                high.1 *= 0.5;
            }
            kept = 1;
        } else {
            high = (step, value);
            if kept < 0 {
                low.1 *= 0.5;
            }
            kept = -1;
        }
        if (high.0 - low.0) < MOTION_TOLERANCE * to.t.abs()
            || value.abs() < MOTION_TOLERANCE * (low.1.abs() + high.1.abs()) * CROSSING_VALUE
        {
            break;
        }
    }
    Ok(best)
}

/// Golden angle, and the ratio of the additive recurrence that goes with it: both fill evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
const RATIO: f64 = 0.754_877_666_246_692_8;

/// Distances, uniform in their logarithm, with the directions of a Fibonacci sphere.
pub(super) fn directions(points: usize, (low, high): (f64, f64)) -> impl Iterator<Item = (f64, [f64; 3])> {
    (0..points).map(move |k| {
        let (z, angle) = (1.0 - (2.0 * k as f64 + 1.0) / points as f64, GOLDEN_ANGLE * k as f64);
        let across = (1.0 - z * z).sqrt();
        (low * (high / low).powf((k as f64 * RATIO).fract()), [across * angle.cos(), across * angle.sin(), z])
    })
}

/// `a.b`.
pub(super) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(&b).fold(0.0, |sum, (a, b)| sum + a * b)
}

/// `|a|`.
pub(super) fn norm<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}

/// `a + s b`.
pub(super) fn along<const N: usize>(a: [f64; N], s: f64, b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + s * b[i])
}

/// `s a`.
pub(super) fn scaled<const N: usize>(s: f64, a: [f64; N]) -> [f64; N] {
    a.map(|a| s * a)
}

/// `g(a, b) = g_ij a^i b^j` of a metric `(4, 4)`.
pub(super) fn product(metric: &[f64], a: [f64; 4], b: [f64; 4]) -> f64 {
    dot(a, lower(metric, b))
}

/// `a_i = g_ij a^j` of a metric `(4, 4)`.
pub(super) fn lower(metric: &[f64], a: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| (0..4).fold(0.0, |sum, j| sum + metric[4 * i + j] * a[j]))
}

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

/// The orbits of a hole of mass `mass`, whose metric is known down to the distance `inner`; orbits that it does not have are left out.
///
/// # Errors
/// The errors of the metric.
pub fn orbits(
    model: &dyn EulerLagrange<f64>,
    around: CentralCoordinates,
    mass: f64,
    inner: f64,
) -> Result<Vec<Orbit>, GeometryError> {
    let origin = around.origin();
    let equator = around.equator(model, &origin);
    let kepler = |a: f64| TAU * a.powf(1.5) / mass.sqrt();
    // A start at the periastron, with Kepler's time of a revolution.
    type Start = ([[f64; 4]; 2], f64);
    let bound = |p: f64, e: f64| -> Result<Option<Start>, GeometryError> {
        let (near, far) = (p / (1.0 + e) * mass, p / (1.0 - e) * mass);
        let turning = equator.between(near, far, Sense::Forward)?;
        Ok(turning.map(|turning| (around.turning(near, &turning), kepler(0.5 * (near + far)))))
    };
    let mut found = Vec::new();
    let [ellipse, whirl] = ECCENTRICITIES;
    if let Some(([q, v], period)) = bound(ELLIPSE_RECTUM, ellipse)? {
        let (t_end, dt) = (5.0 * period, period / 200.0);
        found.push(Orbit { title: "Precessing ellipse", q, v, t_end, dt, inner });
    }
    let comes_back = |p: f64| -> Result<bool, GeometryError> {
        let Some(([q, v], period)) = bound(p, whirl)? else { return Ok(false) };
        let far = p / (1.0 - whirl) * mass;
        // Motion that starts inside the last orbit turns around elsewhere, or not at all.
        let reaches = passing(model, (&q, &v), (2.0 * period, period / 400.0), |state| {
            around.distance(&state.q) > REACHED_APASTRON * far
        });
        Ok(reaches.is_some() && radial_period(model, (&q, &v), around, (4.0 * period, period / 400.0)).is_some())
    };
    let (mut low, mut high) = (1.0, ELLIPSE_RECTUM);
    for _ in 0..WHIRL_HALVINGS {
        let middle = 0.5 * (low + high);
        if comes_back(middle)? {
            high = middle;
        } else {
            low = middle;
        }
    }
    if let Some(([q, v], period)) = bound(high * (1.0 + WHIRL_EXCESS), whirl)? {
        found.push(Orbit { title: "Zoom and whirl", q, v, t_end: 2.2 * period, dt: period / 600.0, inner });
    }
    // At 10 M, with a fraction of the circular velocity: too slow to stay.
    let place = 10.0 * mass;
    let circle = equator.at(place)?;
    if let Some(w) = circle.angular_velocity(Sense::Forward).map(|w| PLUNGE_VELOCITY * w) {
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
    let outward = |state: &MotionState| around.outward(&state.q, &state.v);
    let angle = |state: &MotionState| around.azimuth(&state.q);
    let turned = |from: f64, to: f64| (to - from + 1.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
    let start = MotionState { t: 0.0, q: q.to_vec(), v: v.to_vec() };
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

/// A fall from a state down to a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Infall {
    /// Time of the motion: the proper time of a motion on the mass shell.
    pub time: f64,
    /// `true` if the metric has the signature of the start at all samples.
    pub keeps_signature: bool,
}

fn signature(model: &dyn EulerLagrange<f64>, state: &MotionState) -> Option<Inertia> {
    characters(model, &state.q, &state.v).ok()?.first()?.signature
}

/// The fall from `(q, v)` to the distance `to` from the centre, sampled every `dt`, until `t_end`; `None` if the motion does not get there.
pub fn infall(
    model: &dyn EulerLagrange<f64>,
    (q, v): (&[f64], &[f64]),
    (around, to): (CentralCoordinates, f64),
    (t_end, dt): (f64, f64),
) -> Option<Infall> {
    let above = |state: &MotionState| around.distance(&state.q) - to;
    let first = signature(model, &MotionState { t: 0.0, q: q.to_vec(), v: v.to_vec() });
    let mut keeps_signature = first.is_some();
    let found = passing(model, (q, v), (t_end, dt), |state| {
        keeps_signature &= signature(model, state) == first;
        above(state) <= 0.0
    })?;
    let end = zero(model, &found, above).ok()?;
    Some(Infall { time: end.t, keeps_signature })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::SystemInstance;
    use crate::relativity::Chart;
    use std::f64::consts::PI;

    #[test]
    fn directions_and_distances_fill_a_shell_evenly() {
        type Place = (f64, [f64; 3]);
        let all: Vec<Place> = directions(1000, (1.0, 100.0)).collect();
        let mean = |of: &dyn Fn(&Place) -> f64| all.iter().map(of).sum::<f64>() / 1000.0;
        assert!((mean(&|(r, _)| r.ln()) - 10.0_f64.ln()).abs() < 0.01);
        for i in 0..3 {
            assert!(mean(&|(_, d)| d[i]).abs() < 5e-3);
            assert!((mean(&|(_, d)| d[i] * d[i]) - 1.0 / 3.0).abs() < 5e-3);
        }
    }

    #[test]
    fn a_hole_has_all_three_and_they_do_what_they_are_called() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        for name in ["schwarzschild-cartesian", "kerr-cartesian"] {
            let hole = SystemInstance::<f64>::named(name, &[]).unwrap().build().unwrap();
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
            let hole = SystemInstance::<f64>::named(name, &[]).unwrap().build().unwrap();
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
        let hole = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap().build().unwrap();
        let (q, v) = ([0.0, 6.0, 0.0, 0.0], [1.3, 0.0, 0.1, 0.0]);
        assert_eq!(radial_period(&*hole, (&q, &v), around, (400.0, 0.5)), None);
    }

    #[test]
    fn a_fall_from_rest_is_a_cycloid_through_the_horizon() {
        let around = CentralCoordinates::Cartesian(Chart::default());
        let hole = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap().build().unwrap();
        let (start, end) = (10.0_f64, 1.5);
        let q = around.place(start, [0.48, 0.6, 0.64]);
        let v = [(1.0 - 2.0 / start).sqrt().recip(), 0.0, 0.0, 0.0];
        let found = infall(&*hole, (&q, &v), (around, end), (100.0, 0.25)).unwrap();
        // r = r0 (1 + cos x)/2, tau = sqrt(r0^3/8M) (x + sin x).
        let x = (2.0 * end / start - 1.0).acos();
        let exact = (start.powi(3) / 8.0).sqrt() * (x + x.sin());
        assert!((found.time / exact - 1.0).abs() < 1e-9, "{} {exact}", found.time);
        assert!(found.keeps_signature);
        assert_eq!(infall(&*hole, (&q, &v), (around, end), (10.0, 0.25)), None);
    }
}

//! Orbits around a Schwarzschild hole as an experimenter would choose them, exact.
//!
//! In turn a bound orbit (e to 0.5, p from 6.2 + 2 e to 24 M: some whirl), a plunge (from rest, more or less, at 6 to 16 M), a flyby (from 25 M with a
//! velocity of 0.3 to 1.2 by its own clock, aimed 5 to 12 M beside the hole: some whirl, some are captured): what is slow tells the attraction, what is
//! fast the metric of space. The clock is the proper time. It ticks 50 times in the fastest time scale of the orbit, the lesser of `r/v` and
//! `sqrt(r^3/M)`, and at least once in 1 M.

use lnn::geometry::Sense;
use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::random::{RandomGenerator, RngStream};
use lnn::relativity::{CentralCoordinates, Chart};
use lnn::rollout::{RolloutOptions, rollout};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Longest proper time between two ticks, and ticks in the fastest time scale.
const TICK: f64 = 1.0;
const TICKS: f64 = 50.0;
/// Proper times for which bound orbits and plunges, and flybys, are recorded.
const BOUND: f64 = 400.0;
const FLYBY: f64 = 120.0;
/// Distance at which a plunge is lost from sight.
const LOST: f64 = 2.05;
/// Step with which the fastest time scale is looked for.
const LOOK: f64 = 0.25;

/// A recorded orbit in `t, x, y, z` of Kerr and Schild, `(samples, 4)`.
pub struct Orbit {
    /// Proper times.
    pub times: Vec<f64>,
    /// Exact places and times.
    pub q: Vec<f64>,
    /// Their exact second derivatives.
    pub a: Vec<f64>,
    /// Places and times with noise of a part of the distance.
    pub noisy: Vec<f64>,
}

/// The hole.
pub fn hole() -> SystemInstance<f64> {
    SystemInstance::named("schwarzschild-cartesian", &[]).expect("the defaults are valid")
}

/// Distance from the hole.
pub fn distance(q: &[f64]) -> f64 {
    q[1..4].iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A rotation of space, uniform, by Shoemake's quaternions.
fn turned(rng: &mut RandomGenerator) -> impl Fn([f64; 3]) -> [f64; 3] + use<> {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let q = [normal(), normal(), normal(), normal()];
    let size = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|x| x / size);
    move |[a, b, c]| {
        [
            (1.0 - 2.0 * (y * y + z * z)) * a + 2.0 * (x * y - w * z) * b + 2.0 * (x * z + w * y) * c,
            2.0 * (x * y + w * z) * a + (1.0 - 2.0 * (x * x + z * z)) * b + 2.0 * (y * z - w * x) * c,
            2.0 * (x * z - w * y) * a + 2.0 * (y * z + w * x) * b + (1.0 - 2.0 * (x * x + y * y)) * c,
        ]
    }
}

/// State from which orbit `k` starts, in the plane of x and y, and how long it is recorded.
fn start(
    k: usize,
    hole: &dyn EulerLagrange<f64>,
    system: &SystemInstance<f64>,
    rng: &mut RandomGenerator,
) -> ([[f64; 4]; 2], f64) {
    let around = CentralCoordinates::Cartesian(Chart::default());
    let falling = |distance: f64, along: f64, across: f64| {
        let (q, mut v) = ([0.0, distance, 0.0, 0.0], [0.0, along, across, 0.0]);
        system.impose_constraint(&q, &mut v).expect("outside the horizon");
        [q, v]
    };
    match k % 3 {
        0 => {
            let e = rng.random_range(0.0..0.5);
            let p = rng.random_range(6.2 + 2.0 * e..24.0);
            let sense = if rng.random::<bool>() { Sense::Forward } else { Sense::Backward };
            let turning = around.equator(hole, &around.origin()).between(p / (1.0 + e), p / (1.0 - e), sense);
            (around.turning(p / (1.0 + e), &turning.expect("a metric").expect("a bound orbit")), BOUND)
        }
        1 => {
            let (distance, across) = (rng.random_range(6.0..16.0), rng.random_range(-0.1..0.1));
            (falling(distance, rng.random_range(-0.3..0.1), across), BOUND)
        }
        _ => {
            let (distance, speed, beside): (f64, f64, f64) =
                (25.0, rng.random_range(0.3..1.2), rng.random_range(5.0..12.0));
            let angle = (beside / distance).asin();
            (falling(distance, -speed * angle.cos(), speed * angle.sin()), FLYBY)
        }
    }
}

/// Motion from a state, `(samples, 4)` positions and velocities, until it is lost.
fn motion(hole: &dyn EulerLagrange<f64>, [q, v]: &[[f64; 4]; 2], duration: f64, step: f64) -> [Vec<f64>; 2] {
    let found = rollout(hole, q, v, &RolloutOptions::reference(duration, step).energy(false)).trajectory;
    let seen = found.q.chunks_exact(4).take_while(|q| distance(q) > LOST).count();
    [found.q[..4 * seen].to_vec(), found.v[..4 * seen].to_vec()]
}

/// Orbits with this noise.
pub fn orbits(count: usize, noise: f64, seed: u64) -> Vec<Orbit> {
    let rng = &mut RngStream::Training(0).generator(seed);
    let system = hole();
    let hole = system.build().expect("the defaults are valid");
    let orbit = |k: usize| {
        let (state, duration) = start(k, hole.as_ref(), &system, rng);
        let turn = turned(rng);
        let state = state.map(|x| {
            let [a, b, c] = turn([x[1], x[2], x[3]]);
            [x[0], a, b, c]
        });
        let [q, v] = motion(hole.as_ref(), &state, duration, LOOK);
        let pairs = q.chunks_exact(4).zip(v.chunks_exact(4));
        let scales = pairs.map(|(q, v)| (distance(q) / distance(v)).min(distance(q).powf(1.5)));
        let tick = (scales.fold(f64::INFINITY, f64::min) / TICKS).min(TICK);
        let [q, v] = motion(hole.as_ref(), &state, duration, tick);
        let mut terms = Terms::default();
        hole.terms(&q, &v, Request::ACCELERATION, &mut terms).expect("outside the horizon");
        let noisy = q.chunks_exact(4).flat_map(|q| {
            let size = noise * distance(q);
            let mut normal = || -> f64 { StandardNormal.sample(rng) };
            [0, 1, 2, 3].map(|i| q[i] + size * normal())
        });
        let noisy = noisy.collect();
        let times = (0..q.len() / 4).map(|k| tick * k as f64).collect();
        Orbit { times, q, a: terms.acceleration, noisy }
    };
    (0..count).map(orbit).collect()
}

//! A seven-joint arm on a table: exact torques by the recursion of Newton and Euler, and logs as an arm's controller writes them.
//!
//! Rows and masses resemble those of a Franka Panda. The log has what real ones have: gravity far above inertia, viscous and
//! dry friction, noise of torques and encoders, a clock that is not even, lost samples.

use lnn::random::RngStream;
use rand::Rng;
use rand_distr::StandardNormal;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;

type Vector = [f64; 3];
type Matrix = [Vector; 3];

/// Joints.
pub const JOINTS: usize = 7;
/// Acceleration of gravity in m/s^2.
const GRAVITY: f64 = 9.81;

/// One link: its row of Craig's table, and its masses in its own frame.
struct Link {
    /// Offset before the joint in m and twist in rad, offset along the joint in m.
    row: [f64; 3],
    /// kg.
    mass: f64,
    /// Centre of mass in m.
    centre: Vector,
    /// Moments of inertia about the centre of mass along the axes in kg m^2.
    inertia: Vector,
    /// Viscous friction in N m s and dry friction in N m.
    friction: [f64; 2],
}

#[rustfmt::skip]
const LINKS: [Link; JOINTS] = [
    Link { row: [0.0, 0.0, 0.333], mass: 4.97, centre: [0.004, 0.002, -0.048], inertia: [0.060, 0.058, 0.0091], friction: [0.6, 0.6] },
    Link { row: [0.0, -FRAC_PI_2, 0.0], mass: 0.65, centre: [-0.003, -0.029, 0.003], inertia: [0.0080, 0.0281, 0.0260], friction: [0.6, 0.6] },
    Link { row: [0.0, FRAC_PI_2, 0.316], mass: 3.23, centre: [0.028, 0.039, -0.067], inertia: [0.0372, 0.0362, 0.0108], friction: [0.5, 0.5] },
    Link { row: [0.0825, FRAC_PI_2, 0.0], mass: 3.59, centre: [-0.053, 0.104, 0.027], inertia: [0.0259, 0.0196, 0.0283], friction: [0.5, 0.5] },
    Link { row: [-0.0825, -FRAC_PI_2, 0.384], mass: 1.23, centre: [-0.012, 0.041, -0.038], inertia: [0.0355, 0.0295, 0.0086], friction: [0.3, 0.4] },
    Link { row: [0.0, FRAC_PI_2, 0.0], mass: 1.67, centre: [0.060, -0.014, -0.011], inertia: [0.0020, 0.0044, 0.0054], friction: [0.3, 0.3] },
    Link { row: [0.088, FRAC_PI_2, 0.0], mass: 0.74, centre: [0.011, -0.004, 0.062], inertia: [0.0125, 0.0100, 0.0048], friction: [0.2, 0.2] },
];

/// Positions about which the joints move in rad.
const MIDDLE: [f64; JOINTS] = [0.0, 0.4, 0.0, -1.6, 0.0, 1.8, 0.0];
/// Velocity at which dry friction is nearly fully there, in rad/s.
const KNEE: f64 = 0.01;

fn sum(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] + b[i])
}

fn times(a: Vector, x: f64) -> Vector {
    a.map(|a| a * x)
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn apply(m: &Matrix, a: Vector) -> Vector {
    m.map(|row| row.iter().zip(a).map(|(m, a)| m * a).sum())
}

fn transposed(m: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

/// Rotation from the frame of a link to that of the link before it, and the place of its origin there.
fn frame(link: &Link, q: f64) -> (Matrix, Vector) {
    let [offset, twist, along] = link.row;
    let ((s, c), (sa, ca)) = (q.sin_cos(), twist.sin_cos());
    ([[c, -s, 0.0], [s * ca, c * ca, -sa], [s * sa, c * sa, ca]], [offset, -sa * along, ca * along])
}

/// Torques without friction that give the joints these accelerations, in a field of gravity `down`.
fn inverse_dynamics(q: &[f64; JOINTS], v: &[f64; JOINTS], a: &[f64; JOINTS], down: f64) -> [f64; JOINTS] {
    let axis = [0.0, 0.0, 1.0];
    let frames: Vec<(Matrix, Vector)> = LINKS.iter().zip(q).map(|(link, &q)| frame(link, q)).collect();
    let (mut turn, mut turning, mut rising) = ([0.0; 3], [0.0; 3], [0.0, 0.0, down]);
    let mut loads: Vec<[Vector; 2]> = Vec::new();
    for (k, link) in LINKS.iter().enumerate() {
        let (rotation, place) = &frames[k];
        let back = transposed(rotation);
        rising = apply(&back, sum(rising, sum(cross(turning, *place), cross(turn, cross(turn, *place)))));
        let carried = apply(&back, turn);
        turning = sum(apply(&back, turning), sum(times(axis, a[k]), cross(carried, times(axis, v[k]))));
        turn = sum(carried, times(axis, v[k]));
        let at_centre = sum(rising, sum(cross(turning, link.centre), cross(turn, cross(turn, link.centre))));
        let spin = |w: Vector| std::array::from_fn(|i| link.inertia[i] * w[i]);
        loads.push([times(at_centre, link.mass), sum(spin(turning), cross(turn, spin(turn)))]);
    }
    let mut torques = [0.0; JOINTS];
    let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
    for (k, link) in LINKS.iter().enumerate().rev() {
        let (carried, turned) = match frames.get(k + 1) {
            Some((rotation, place)) => {
                let carried = apply(rotation, force);
                (carried, sum(apply(rotation, moment), cross(*place, carried)))
            }
            None => ([0.0; 3], [0.0; 3]),
        };
        let [pull, twist] = loads[k];
        moment = sum(sum(twist, turned), cross(link.centre, pull));
        force = sum(carried, pull);
        torques[k] = moment[2];
    }
    torques
}

/// Mass matrix, `(7, 7)`.
pub fn mass_matrix(q: &[f64; JOINTS]) -> [[f64; JOINTS]; JOINTS] {
    let column =
        |j: usize| inverse_dynamics(q, &[0.0; JOINTS], &std::array::from_fn(|i| if i == j { 1.0 } else { 0.0 }), 0.0);
    std::array::from_fn(column)
}

/// Torques that hold the arm still.
pub fn gravity(q: &[f64; JOINTS]) -> [f64; JOINTS] {
    inverse_dynamics(q, &[0.0; JOINTS], &[0.0; JOINTS], GRAVITY)
}

/// Torques of friction.
pub fn friction(v: &[f64; JOINTS]) -> [f64; JOINTS] {
    std::array::from_fn(|k| {
        let [viscous, dry] = LINKS[k].friction;
        viscous * v[k] + dry * (v[k] / KNEE).tanh()
    })
}

/// Motor torques of a motion: those of the recursion and of friction.
pub fn torques(q: &[f64; JOINTS], v: &[f64; JOINTS], a: &[f64; JOINTS]) -> [f64; JOINTS] {
    let (free, rubbed) = (inverse_dynamics(q, v, a, GRAVITY), friction(v));
    std::array::from_fn(|k| free[k] + rubbed[k])
}

/// The exact constants by the names that a system file gives them: of every link its mass, first moments and inertia about the origin of its
/// frame, and the friction of its joint.
pub fn constants() -> Vec<(String, f64)> {
    const AXES: [&str; 3] = ["x", "y", "z"];
    let mut all = Vec::new();
    for (k, link) in LINKS.iter().enumerate() {
        let Link { mass, centre, inertia, friction: [viscous, dry], .. } = link;
        let mut put = |name: String, value: f64| all.push((format!("{name}{}", k + 1), value));
        put("m".to_string(), *mass);
        for i in 0..3 {
            put(format!("m{}", AXES[i]), mass * centre[i]);
            for j in i..3 {
                let about_centre =
                    if i == j { inertia[i] + mass * centre.iter().map(|c| c * c).sum::<f64>() } else { 0.0 };
                put(format!("I{}{}", AXES[i], AXES[j]), about_centre - mass * centre[i] * centre[j]);
            }
        }
        put("Fv".to_string(), *viscous);
        put("Fc".to_string(), *dry);
    }
    all
}

/// What is wrong with a log.
#[derive(Clone, Copy, Debug)]
pub struct Faults {
    /// Noise of the torques over their size.
    pub torque: f64,
    /// Noise of the encoders in rad.
    pub encoder: f64,
    /// Deviation of a step of the clock over its length.
    pub jitter: f64,
    /// Share of the samples that are lost.
    pub lost: f64,
}

impl Faults {
    /// Those of a usual log.
    pub const USUAL: Self = Self { torque: 0.01, encoder: 2e-4, jitter: 0.1, lost: 0.005 };
}

/// Samples per second.
pub const RATE: f64 = 250.0;

/// Waves of one joint: amplitude, frequency in rad/s, phase.
type Waves = Vec<[f64; 3]>;

/// An exciting motion: five waves per joint about its middle.
pub struct Motion(Vec<Waves>);

impl Motion {
    /// A motion by seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = RngStream::Trajectories.generator(seed);
        let mut waves = || -> Waves {
            (1..=5)
                .map(|k| {
                    let frequency = TAU * 0.075 * f64::from(k) * rng.random_range(0.8..1.2);
                    [rng.random_range(0.1..0.3) / f64::from(k).sqrt(), frequency, rng.random_range(0.0..TAU)]
                })
                .collect()
        };
        Self((0..JOINTS).map(|_| waves()).collect())
    }

    /// Positions, velocities and accelerations at a time.
    pub fn at(&self, t: f64) -> [[f64; JOINTS]; 3] {
        let derivative = |order: u32, k: usize| -> f64 {
            let wave = |[size, frequency, phase]: &[f64; 3]| {
                size * frequency.powi(order as i32) * (frequency * t + phase + f64::from(order) * FRAC_PI_2).sin()
            };
            self.0[k].iter().map(wave).sum()
        };
        [0, 1, 2].map(|order| std::array::from_fn(|k| derivative(order, k) + if order == 0 { MIDDLE[k] } else { 0.0 }))
    }
}

/// Names of the joints and of their torques, as the header of [`log`] has them.
pub fn names(prefix: &str) -> Vec<String> {
    (1..=JOINTS).map(|k| format!("{prefix}{k}")).collect()
}

/// A log as CSV: `t,q1,..,q7,tau1,..,tau7`.
pub fn log(seconds: f64, faults: Faults, seed: u64) -> String {
    let motion = Motion::new(seed);
    let mut rng = RngStream::Test.generator(seed);
    let count = (seconds * RATE) as usize;
    let at = |t: f64| {
        let [q, v, a] = motion.at(t);
        (q, torques(&q, &v, &a))
    };
    let mut squares = [0.0; JOINTS];
    for k in 0..count {
        let (_, torque) = at(k as f64 / RATE);
        squares.iter_mut().zip(torque).for_each(|(sum, torque)| *sum += torque * torque / count as f64);
    }
    let mut csv = format!("t,{},{}\n", names("q").join(","), names("tau").join(","));
    for k in 0..count {
        let jitter = faults.jitter * rng.sample::<f64, _>(StandardNormal);
        // A clock that runs on, however uneven.
        let t = (k as f64 + jitter.clamp(-0.45, 0.45)) / RATE;
        let (q, torque) = at(t);
        let mut noise = |size: f64| size * rng.sample::<f64, _>(StandardNormal);
        let q = q.map(|q| q + noise(faults.encoder));
        let torque: [f64; JOINTS] = std::array::from_fn(|k| torque[k] + noise(faults.torque * squares[k].sqrt()));
        if rng.random_range(0.0..1.0) < faults.lost {
            continue;
        }
        write!(csv, "{t:.6}").expect("room in memory");
        q.iter().chain(&torque).for_each(|x| write!(csv, ",{x:.6}").expect("room in memory"));
        csv.push('\n');
    }
    csv
}

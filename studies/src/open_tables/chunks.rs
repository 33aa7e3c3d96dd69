//! Finzi, Wang and Wilson, "Simplifying Hamiltonian and Lagrangian neural networks via explicit constraints" (2020), by the protocols of
//! their code.
//!
//! Each system is learned from chunks of five states, positions and velocities without accelerations, and 100 motions are predicted: in
//! generalized coordinates, where nothing is known of the constraints, and in Cartesian coordinates, where the constraints are found in the
//! same chunks. Their models in Cartesian coordinates are given the constraints.
//!
//! The error of a motion is the geometric mean over its samples of `|z' - z| / (|z'| + |z|)`, `z` the Cartesian positions and velocities.
//! Means over the motions are printed, arithmetic and geometric.

use super::Coordinates;
use lnn::constraints::{ConstraintSearch, FoundConstraints, MotionSamples};
use lnn::data::Dataset;
use lnn::forward::Dual;
use lnn::lagrangian::{Constrained, EulerLagrange, ExpressionConstraints, Lagrangian, Mechanics, project};
use lnn::network::Structure;
use lnn::presets::Trainer;
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{RolloutOptions, rollout_many};
use lnn::scalar::Real;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Samples of a trajectory, of a chunk, and motions for validation and for the test.
const SAMPLES: usize = 100;
const CHUNK: usize = 5;
const TEST: usize = 100;

const GRAVITY: f64 = 9.81;

/// A system of the table in generalized coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Exact {
    /// Planar chain of bobs, angles from below.
    Pendula { masses: &'static [f64], lengths: &'static [f64] },
    /// Three bobs on rods of 1 side by side, coupled by springs, azimuth and polar angle of each about the x axis.
    Coupled,
    /// A bob of 3 on a rod of 1 above two magnets.
    Magnets,
    /// Euler angles of a heavy symmetric top.
    Gyroscope,
    /// Centre of mass, then Euler angles, of a free body.
    Rotor,
}

/// Moments of inertia of the gyroscope about an axis across and about its own; its weight times the distance of the centre of mass.
const TOP: [f64; 3] = [0.0327483, 0.0482757, 0.2175157];
/// Distance of the gyroscope's centre of mass from the point that it turns about.
const TOP_LENGTH: f64 = 0.2217285;
/// Mass and principal moments of the rotor.
const ROTOR: [f64; 4] = [0.1, 0.0120172, 0.00240936, 0.0102048];

type Point<R> = [R; 3];

fn sum<R: Real>(parts: impl IntoIterator<Item = R>) -> R {
    parts.into_iter().fold(R::zero(), |sum, x| sum + x)
}

fn dot<R: Real>(a: Point<R>, b: Point<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn less<R: Real>(a: Point<R>, b: Point<R>) -> Point<R> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Columns of the rotation by Euler angles, `Rz(phi) Rx(theta) Rz(psi)`.
fn axes<R: Real>(angles: &[R]) -> [Point<R>; 3] {
    let [(sf, cf), (st, ct), (sp, cp)] = [0, 1, 2].map(|i| (angles[i].sin(), angles[i].cos()));
    [
        [cf * cp - sf * ct * sp, sf * cp + cf * ct * sp, st * sp],
        [-(cf * sp) - sf * ct * cp, cf * ct * cp - sf * sp, st * cp],
        [sf * st, -(cf * st), ct],
    ]
}

/// Angular velocity in the frame of the body.
fn spin<R: Real>(angles: &[R], rates: &[R]) -> Point<R> {
    let (st, ct, sp, cp) = (angles[1].sin(), angles[1].cos(), angles[2].sin(), angles[2].cos());
    [rates[0] * st * sp + rates[1] * cp, rates[0] * st * cp - rates[1] * sp, rates[0] * ct + rates[2]]
}

impl Exact {
    /// Bobs of the system, or centre of mass and the ends of the axes from there.
    fn points<R: Real>(&self, q: &[R]) -> Vec<Point<R>> {
        let body = |centre: Point<R>, axes: [Point<R>; 3]| {
            let ends = axes.map(|axis| [centre[0] + axis[0], centre[1] + axis[1], centre[2] + axis[2]]);
            [&[centre][..], &ends].concat()
        };
        match self {
            Self::Pendula { lengths, .. } => {
                let mut at = [R::zero(); 3];
                let mut next = |(q, l): (&R, &f64)| {
                    at = [at[0] + R::of(*l) * q.sin(), R::zero(), at[2] - R::of(*l) * q.cos()];
                    at
                };
                q.iter().zip(*lengths).map(&mut next).collect()
            }
            Self::Coupled | Self::Magnets => {
                let bob = |(i, angles): (usize, &[R])| {
                    let (f, t) = (angles[0], angles[1]);
                    [R::of(i as f64) - t.cos(), t.sin() * f.sin(), t.sin() * f.cos()]
                };
                q.chunks_exact(2).enumerate().map(bob).collect()
            }
            Self::Gyroscope => {
                let axes = axes(q);
                body(axes[2].map(|x| R::of(TOP_LENGTH) * x), axes)
            }
            Self::Rotor => body([q[0], q[1], q[2]], axes(&q[3..])),
        }
    }

    /// Numbers of a point that are not always 0.
    fn plane(&self) -> &'static [usize] {
        if matches!(self, Self::Pendula { .. }) { &[0, 2] } else { &[0, 1, 2] }
    }

    /// Cartesian positions and velocities.
    fn cartesian(&self, q: &[f64], v: &[f64]) -> [Vec<f64>; 2] {
        let duals: Vec<Dual<f64>> = q.iter().zip(v).map(|(q, v)| Dual::new(*q, *v)).collect();
        let points = self.points(&duals);
        let part = |of: fn(&Dual<f64>) -> f64| {
            points.iter().flat_map(|point| self.plane().iter().map(move |&i| of(&point[i]))).collect()
        };
        [part(|x| x.value), part(|x| x.tangent)]
    }

    /// Angles among the coordinates.
    fn angles(&self) -> Vec<usize> {
        let from = if *self == Self::Rotor { 3 } else { 0 };
        (from..self.coordinates()).collect()
    }

    /// A start of the protocol.
    fn start(&self, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>) {
        let mut gauss = || -> f64 { StandardNormal.sample(rng) };
        let pi = std::f64::consts::PI;
        let spherical = |around: [f64; 4], gauss: &mut dyn FnMut() -> f64| {
            let [f, t, df, dt] = around.map(|width| width * gauss());
            ([pi + f, pi / 2.0 + t], [df, dt])
        };
        match self {
            Self::Pendula { masses, lengths } => {
                let n = masses.len();
                let mut draw = |n: usize| -> Vec<f64> { (0..n).map(|_| gauss()).collect() };
                let (q, v) = (draw(n), draw(n));
                let [mut x, mut u] = self.cartesian(&q, &v);
                x.iter_mut().zip(draw(2 * n)).for_each(|(x, noise)| *x += 0.2 * noise);
                u.iter_mut().zip(draw(2 * n)).for_each(|(u, noise)| *u = 1.5 * *u + 1.2 * noise);
                let names: Vec<String> = (0..n).flat_map(|i| [format!("x{i}"), format!("z{i}")]).collect();
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                let rods: Vec<(String, String)> = (0..n)
                    .map(|i| {
                        let before = |c: &str| if i == 0 { String::new() } else { format!(" - {c}{}", i - 1) };
                        (
                            format!("rod{i}"),
                            format!("(x{i}{})^2 + (z{i}{})^2 - {}", before("x"), before("z"), lengths[i].powi(2)),
                        )
                    })
                    .collect();
                let rods: Vec<(&str, &str)> = rods.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
                let rods = ExpressionConstraints::new(&names, &[], &rods).expect("formulas of rods");
                let held = Constrained::new(Mechanics::new(Free(2 * n), []), rods, []).expect("the same coordinates");
                // A start from which Newton's method finds no state on the rods is drawn again.
                if project(held.manifold().expect("rods"), &mut x, &mut u).is_err() {
                    return self.start(rng);
                }
                let at = |of: &[f64], i: usize| [of[2 * i], of[2 * i + 1]];
                let mut found = (Vec::new(), Vec::new());
                for i in 0..n {
                    let before = |of: &[f64]| if i == 0 { [0.0; 2] } else { at(of, i - 1) };
                    let ([x0, z0], [x1, z1]) = (before(&x), at(&x, i));
                    let ([u0, w0], [u1, w1]) = (before(&u), at(&u, i));
                    let angle = (x1 - x0).atan2(z0 - z1);
                    found.0.push(angle);
                    found.1.push(((u1 - u0) * angle.cos() + (w1 - w0) * angle.sin()) / lengths[i]);
                }
                found
            }
            Self::Coupled => {
                let bobs: Vec<_> = (0..3).map(|_| spherical([0.3; 4], &mut gauss)).collect();
                (bobs.iter().flat_map(|bob| bob.0).collect(), bobs.iter().flat_map(|bob| bob.1).collect())
            }
            Self::Magnets => {
                let (q, v) = spherical([0.3, 0.2, 0.05, 0.4], &mut gauss);
                (q.to_vec(), v.to_vec())
            }
            Self::Gyroscope => {
                let mut even = |width: f64| width * (2.0 * rng.random::<f64>() - 1.0);
                let (q, v) = ([1.5; 3].map(&mut even), [4.5, 0.3].map(&mut even));
                let side = if rng.random::<bool>() { 1.5 } else { -1.5 };
                let turn: f64 = StandardNormal.sample(rng);
                (q.to_vec(), vec![v[0], v[1], side * (7.0 + turn)])
            }
            Self::Rotor => {
                let mut all: Vec<f64> = (0..12).map(|_| (2.0 * gauss()).clamp(-3.0, 3.0)).collect();
                all[..3].iter_mut().chain([]).for_each(|x| *x *= 0.1);
                all[6..9].iter_mut().for_each(|x| *x *= 0.1);
                (all[..6].to_vec(), all[6..].to_vec())
            }
        }
    }
}

impl Lagrangian for Exact {
    fn coordinates(&self) -> usize {
        match self {
            Self::Pendula { masses, .. } => masses.len(),
            Self::Coupled | Self::Rotor => 6,
            Self::Magnets => 2,
            Self::Gyroscope => 3,
        }
    }

    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let points = self.points(q);
        let of = |x: f64| R::of(x);
        let half = |x: R| x * R::half();
        // Kinetic energy of a bob of mass 1 on a rod of 1.
        let swing = |angles: &[R], rates: &[R]| half(rates[1].sqr() + (angles[1].sin() * rates[0]).sqr());
        match self {
            Self::Pendula { masses, lengths } => {
                let n = masses.len();
                let below = |i: usize| masses[i..].iter().sum::<f64>();
                let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
                let kinetic = pairs.map(|(i, j)| {
                    of(0.5 * below(i.max(j)) * lengths[i] * lengths[j]) * (q[i] - q[j]).cos() * v[i] * v[j]
                });
                let weight = points.iter().zip(*masses).map(|(point, m)| of(m * GRAVITY) * point[2]);
                sum(kinetic) - sum(weight)
            }
            Self::Coupled => {
                let kinetic = q.chunks_exact(2).zip(v.chunks_exact(2)).map(|(q, v)| swing(q, v));
                let springs = points.windows(2).map(|pair| {
                    let apart = less(pair[1], pair[0]);
                    of(5.0) * (dot(apart, apart).sqrt() - R::one()).sqr()
                });
                sum(kinetic) - sum(springs) - sum(points.iter().map(|point| of(GRAVITY) * point[2]))
            }
            Self::Magnets => {
                let magnets = [0.1, -0.1].map(|x| {
                    let r = less([of(x), R::zero(), of(-1.05)], points[0]);
                    let (u, square) = (points[0].map(|x| of(0.3) * x), dot(r, r));
                    let top = of(3.0 * 0.3) * dot(u, r) * r[2] + square * u[2] * of(0.3);
                    top / (of(4.0 * std::f64::consts::PI) * square.sqr() * square.sqrt())
                });
                of(3.0) * swing(q, v) - of(3.0 * GRAVITY) * points[0][2] + magnets[0] + magnets[1]
            }
            Self::Gyroscope => {
                let ([across, own, weight], spin) = (TOP, spin(q, v));
                half(of(across) * (spin[0].sqr() + spin[1].sqr()) + of(own) * spin[2].sqr()) - of(weight) * q[1].cos()
            }
            Self::Rotor => {
                let spin = spin(&q[3..], &v[3..]);
                let straight = sum(v[..3].iter().map(|v| v.sqr()));
                half(of(ROTOR[0]) * straight + sum((0..3).map(|i| of(ROTOR[i + 1]) * spin[i].sqr())))
            }
        }
    }
}

/// A free particle of so many coordinates.
struct Free(usize);

impl Lagrangian for Free {
    fn coordinates(&self) -> usize {
        self.0
    }
    fn lagrangian<R: Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
        R::half() * sum(v.iter().map(|v| v.sqr()))
    }
}

/// A row of the table with the errors of Hamiltonian, Lagrangian (DeLaN) networks in generalized coordinates and of constrained Lagrangian
/// networks (CLNN), arithmetic and geometric means.
struct Row {
    name: &'static str,
    exact: Exact,
    /// Time between samples in s.
    dt: f64,
    theirs: [(&'static str, [f64; 2]); 3],
}

const fn theirs(hnn: [f64; 2], delan: [f64; 2], clnn: [f64; 2]) -> [(&'static str, [f64; 2]); 3] {
    [("HNN", hnn), ("DeLaN", delan), ("CLNN", clnn)]
}

const ROWS: [Row; 8] = [
    Row {
        name: "1-pendulum",
        exact: Exact::Pendula { masses: &[1.039051], lengths: &[1.172151] },
        dt: 0.03,
        theirs: theirs([1.8e-4, 1.2e-4], [4.2e-4, 2.5e-4], [7.4e-5, 5.2e-5]),
    },
    Row {
        name: "2-pendulum",
        exact: Exact::Pendula { masses: &[1.172151, 1.039051], lengths: &[1.035907, 1.082211] },
        dt: 0.03,
        theirs: theirs([1.3e-2, 1.9e-3], [7.1e-3, 1.2e-3], [1.8e-4, 1.1e-4]),
    },
    Row {
        name: "3-pendulum",
        exact: Exact::Pendula { masses: &[1.082211, 1.172151, 1.039051], lengths: &[1.116715, 0.938924, 1.035907] },
        dt: 0.03,
        theirs: theirs([9.7e-2, 4.7e-2], [8.7e-2, 4.1e-2], [2.0e-3, 3.3e-4]),
    },
    Row {
        name: "5-pendulum",
        exact: Exact::Pendula {
            masses: &[0.938924, 1.035907, 1.082211, 1.172151, 1.039051],
            lengths: &[0.906753, 1.370930, 1.313418, 0.950070, 1.116715],
        },
        dt: 0.03,
        theirs: theirs([0.36, 0.34], [0.35, 0.33], [4.3e-3, 9.3e-4]),
    },
    Row {
        name: "coupled",
        exact: Exact::Coupled,
        dt: 0.05,
        theirs: theirs([8.2e-2, 6.5e-2], [7.3e-2, 5.8e-2], [1.9e-2, 7.4e-3]),
    },
    Row {
        name: "magnets",
        exact: Exact::Magnets,
        dt: 0.05,
        theirs: theirs([0.15, 0.10], [0.17, 0.13], [4.8e-2, 1.0e-2]),
    },
    Row {
        name: "gyroscope",
        exact: Exact::Gyroscope,
        dt: 0.02,
        theirs: theirs([1.8e-2, 2.1e-3], [2.1e-2, 2.4e-3], [3.2e-5, 2.3e-5]),
    },
    Row { name: "rotor", exact: Exact::Rotor, dt: 0.05, theirs: theirs([0.28, 0.26], [0.30, 0.28], [2.0e-5, 1.1e-5]) },
];

/// Positions and velocities, sample by sample.
#[derive(Clone, Default)]
struct States {
    q: Vec<f64>,
    v: Vec<f64>,
}

impl States {
    fn rows(&self, n: usize) -> impl Iterator<Item = (&[f64], &[f64])> {
        self.q.chunks_exact(n).zip(self.v.chunks_exact(n))
    }
}

/// Chunks to learn from and exact motions to predict, in generalized coordinates.
struct Data {
    chunks: Vec<States>,
    motions: Vec<States>,
}

impl Row {
    /// `count` motions from these starts, of so many samples.
    fn motions(&self, starts: &[(Vec<f64>, Vec<f64>)], samples: usize) -> Vec<Option<States>> {
        let model = Mechanics::new(self.exact, []);
        let time = (samples - 1) as f64 * self.dt;
        let options = RolloutOptions::reference(time, self.dt).energy(false).tolerances(1e-11, 1e-11);
        let whole = rollout_many(&model, starts, &options, 2).into_iter().map(|motion| motion.complete().ok());
        whole.map(|motion| motion.map(|motion| States { q: motion.q, v: motion.v })).collect()
    }

    fn data(&self, chunks: usize, seed: u64) -> Data {
        let (n, mut rng) = (self.exact.coordinates(), ChaCha8Rng::seed_from_u64(seed));
        let starts: Vec<_> = (0..chunks + TEST).map(|_| self.exact.start(&mut rng)).collect();
        let mut found: Vec<States> = Vec::with_capacity(chunks + TEST);
        // A motion through a pole of the angles has no end; another one is drawn in its place.
        let mut motions = self.motions(&starts, SAMPLES);
        while let Some(lost) = motions.iter().position(Option::is_none) {
            motions[lost] = self.motions(&[self.exact.start(&mut rng)], SAMPLES).remove(0);
        }
        for motion in motions.into_iter().flatten() {
            let from = n * CHUNK * rng.random_range(0..SAMPLES / CHUNK);
            let part = |of: &[f64]| of[from..from + n * CHUNK].to_vec();
            found.push(States { q: part(&motion.q), v: part(&motion.v) });
        }
        let test: Vec<_> =
            found.split_off(chunks).into_iter().map(|c| (c.q[..n].to_vec(), c.v[..n].to_vec())).collect();
        let motions = self.motions(&test, SAMPLES).into_iter().flatten().collect();
        Data { chunks: found, motions }
    }

    /// States in Cartesian coordinates.
    fn cartesian(&self, states: &States) -> States {
        let mut found = States::default();
        for (q, v) in states.rows(self.exact.coordinates()) {
            let [x, u] = self.exact.cartesian(q, v);
            found.q.extend(x);
            found.v.extend(u);
        }
        found
    }
}

/// Second derivatives at the samples of a chunk by the polynomial through its positions and velocities.
fn accelerations(chunk: &States, n: usize, dt: f64) -> Vec<f64> {
    let (samples, coefficients) = (chunk.q.len() / n, 2 * chunk.q.len() / n);
    // Powers of time in units of the step, from the middle.
    let time = |k: usize| k as f64 - 0.5 * (samples - 1) as f64;
    let power = |t: f64, p: usize, order: usize| {
        let factor: f64 = (0..order).map(|i| p as f64 - i as f64).product();
        if p < order { 0.0 } else { factor * t.powi((p - order) as i32) }
    };
    let rows = (0..samples).flat_map(|k| (0..2).map(move |order| (k, order)));
    let matrix = rows.flat_map(|(k, order)| (0..coefficients).map(move |p| power(time(k), p, order)));
    let matrix = nalgebra::DMatrix::from_row_iterator(coefficients, coefficients, matrix).lu();
    let mut found = vec![0.0; samples * n];
    for i in 0..n {
        let known = (0..samples).flat_map(|k| [chunk.q[k * n + i], dt * chunk.v[k * n + i]]);
        let known = nalgebra::DVector::from_iterator(coefficients, known);
        let polynomial = matrix.solve(&known).expect("distinct samples");
        for k in 0..samples {
            let sum: f64 = polynomial.iter().enumerate().map(|(p, c)| c * power(time(k), p, 2)).sum();
            found[k * n + i] = sum / (dt * dt);
        }
    }
    found
}

/// States of the chunks whose accelerations `a` are known: the polynomial through one sample less gives the same to within the median of
/// their sizes. Where a force changes within a step, or angles turn fast near a pole, it gives others, and a few of those that are far too large
/// would outweigh all the rest.
fn known(chunks: &[States], a: &[f64], n: usize, dt: f64) -> Vec<usize> {
    let length = |a: &mut dyn Iterator<Item = f64>| a.map(|a| a * a).sum::<f64>().sqrt();
    let mut sizes: Vec<f64> = a.chunks_exact(n).map(|a| length(&mut a.iter().copied())).collect();
    let (_, median, _) = sizes.select_nth_unstable_by(a.len() / n / 2, f64::total_cmp);
    let within = |(chunk, a): (&States, &[f64])| -> Vec<bool> {
        let [first, last] = [0, 1].map(|from| {
            let rows = from * n..(from + CHUNK - 1) * n;
            accelerations(&States { q: chunk.q[rows.clone()].to_vec(), v: chunk.v[rows].to_vec() }, n, dt)
        });
        let other = |k: usize| if k <= CHUNK / 2 { &first[k * n..][..n] } else { &last[(k - 1) * n..][..n] };
        let apart = |(k, a): (usize, &[f64])| length(&mut a.iter().zip(other(k)).map(|(a, b)| a - b));
        a.chunks_exact(n).enumerate().map(|row| apart(row) <= *median).collect()
    };
    let within = chunks.iter().zip(a.chunks_exact(CHUNK * n)).flat_map(within);
    within.enumerate().filter(|(_, within)| *within).map(|(row, _)| row).collect()
}

/// Constraints that all chunks obey, by name.
fn constraints(chunks: &[States], n: usize, dt: f64) -> Option<Vec<(String, String)>> {
    let track = |(k, chunk): (usize, &States)| RecordedTrajectory {
        name: format!("chunk {k}"),
        times: (0..CHUNK).map(|k| k as f64 * dt).collect(),
        q: chunk.q.clone(),
        v: chunk.v.clone(),
        a: vec![],
        force: vec![],
    };
    let tracks = chunks.iter().enumerate().map(track).collect();
    let coordinates = (1..=n).map(|i| format!("q{i}")).collect();
    let recording = Recording { coordinates, periodic: vec![false; n], tracks };
    let samples = MotionSamples::exact(&recording).expect("velocities");
    let found = FoundConstraints::of(&samples, ConstraintSearch { degree: 2, velocity_degree: 1 }).ok()?;
    let of_system = found.constraints.into_iter().filter(|found| found.kind.is_imposed());
    Some(of_system.enumerate().map(|(k, found)| (format!("found {k}"), found.formula)).collect())
}

/// Means of the errors over the motions, arithmetic and geometric, `z` and `z'` sample by sample.
fn errors(pairs: impl Iterator<Item = (Vec<[Vec<f64>; 2]>, Vec<[Vec<f64>; 2]>)>) -> [f64; 2] {
    let length = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
    let mut found = Vec::new();
    for (exact, predicted) in pairs {
        let logs: Vec<f64> = (0..exact.len())
            .map(|k| {
                // A motion that ended is as wrong as can be.
                let Some(predicted) = predicted.get(k) else { return 0.0 };
                let (a, b) = (exact[k].concat(), predicted.concat());
                let apart = length(&mut a.iter().zip(&b).map(|(a, b)| a - b));
                (apart / (length(&mut a.iter().copied()) + length(&mut b.iter().copied())) + 1e-8).ln()
            })
            .collect();
        // The trapezoid rule over the time span, as theirs: dt / T times the sum.
        let sum: f64 = logs.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).sum();
        found.push((sum / exact.len() as f64).exp());
    }
    let count = found.len() as f64;
    [found.iter().sum::<f64>() / count, (found.iter().map(|x| x.ln()).sum::<f64>() / count).exp()]
}

/// What a training is given and how large it is.
struct Budget {
    chunks: usize,
    steps: usize,
    hidden: Vec<usize>,
}

const BATCH: usize = 128;

/// Learns a row in generalized or in Cartesian coordinates and predicts.
fn run(row: &Row, data: &Data, cartesian: bool, seed: u64, budget: &Budget) -> Option<([f64; 2], f64, usize)> {
    let started = Instant::now();
    let own = |states: &States| if cartesian { row.cartesian(states) } else { states.clone() };
    let chunks: Vec<States> = data.chunks.iter().map(own).collect();
    let n = if cartesian { chunks[0].q.len() / CHUNK } else { row.exact.coordinates() };
    let part = |of: &dyn Fn(&States) -> Vec<f64>| chunks.iter().flat_map(of).collect::<Vec<f64>>();
    let a = part(&|chunk| accelerations(chunk, n, row.dt));
    let known = known(&chunks, &a, n, row.dt);
    let rows = |of: &[f64]| known.iter().flat_map(|&row| &of[row * n..(row + 1) * n]).copied().collect::<Vec<f64>>();
    let states = Dataset::new(n, rows(&part(&|c| c.q.clone())), rows(&part(&|c| c.v.clone())), rows(&a));
    let states = states.expect("finite states");
    let formulas = if cartesian { constraints(&chunks, n, row.dt)? } else { Vec::new() };
    let formulas: Vec<(&str, &str)> =
        formulas.iter().map(|(name, formula)| (name.as_str(), formula.as_str())).collect();
    let epochs = (budget.steps * BATCH).div_ceil(states.len() * 8 / 10);
    let trained = |structure| {
        let angles = if cartesian { vec![] } else { row.exact.angles() };
        let trainer = Trainer::new(&states).angles(&angles).constraints(&formulas).structure(structure);
        trainer.hidden(&budget.hidden).batch(BATCH).epochs(epochs).seed(seed).threads(2).train().ok()
    };
    // In Cartesian coordinates the mass matrix may be constant: validation decides.
    let structures: &[_] =
        if cartesian { &[Structure::ConstantMass, Structure::Mechanical] } else { &[Structure::Mechanical] };
    let learned = structures.iter().filter_map(|&structure| trained(structure));
    let learned = learned.min_by(|a, b| a.validation_loss.total_cmp(&b.validation_loss))?;
    let starts: Vec<_> = data
        .motions
        .iter()
        .map(|motion| {
            let motion = own(motion);
            (motion.q[..n].to_vec(), motion.v[..n].to_vec())
        })
        .collect();
    let time = (SAMPLES - 1) as f64 * row.dt;
    let options = RolloutOptions::new(time, row.dt).energy(false).tolerances(1e-8, 1e-8);
    let predicted = rollout_many(&*learned.motion().ok()?, &starts, &options, 2);
    let pairs = data.motions.iter().zip(&predicted).map(|(exact, predicted)| {
        let exact = exact.rows(row.exact.coordinates()).map(|(q, v)| row.exact.cartesian(q, v)).collect();
        let motion = &predicted.trajectory;
        let rows = motion.q.chunks_exact(n).zip(motion.v.chunks_exact(n));
        let states =
            rows.map(|(q, v)| if cartesian { [q.to_vec(), v.to_vec()] } else { row.exact.cartesian(q, v) }).collect();
        (exact, states)
    });
    Some((errors(pairs), started.elapsed().as_secs_f64(), states.len()))
}

fn table(rows: &[&Row], seeds: u64, coordinates: &[bool], budget: &Budget) {
    println!("system       coordinates   seed  arithmetic   geometric   seconds   states");
    for row in rows {
        for &cartesian in coordinates {
            for seed in 0..seeds {
                let data = row.data(budget.chunks, seed);
                let name = if cartesian { "cartesian" } else { "generalized" };
                match run(row, &data, cartesian, seed, budget) {
                    Some(([mean, geometric], seconds, states)) => {
                        println!(
                            "{:<12} {name:<12} {seed:>5} {mean:>11.1e} {geometric:>11.1e} {seconds:>9.1} {states:>8}",
                            row.name
                        );
                    }
                    None => println!("{:<12} {name:<12} {seed:>5} nothing learned", row.name),
                }
            }
        }
        for (name, [mean, geometric]) in row.theirs {
            println!("{:<12} {name:<12}       {mean:>11.1e} {geometric:>11.1e}", row.name);
        }
    }
}

/// Names of the rows.
pub fn names() -> impl Iterator<Item = &'static str> {
    ROWS.iter().map(|row| row.name)
}

/// Rows by name, all without one, in one kind of coordinates, in both without one.
pub fn all(name: Option<&str>, seeds: u64, coordinates: Option<Coordinates>, chunks: usize, steps: usize) {
    let rows: Vec<&Row> = ROWS.iter().filter(|row| name.is_none_or(|name| name == row.name)).collect();
    let coordinates: &[bool] = match coordinates {
        Some(Coordinates::Generalized) => &[false],
        Some(Coordinates::Cartesian) => &[true],
        None => &[false, true],
    };
    table(&rows, seeds, coordinates, &Budget { chunks, steps, hidden: vec![128; 3] });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One row at its smallest.
    #[test]
    fn a_row_runs() {
        table(&[&ROWS[0]], 1, &[false, true], &Budget { chunks: 10, steps: 4, hidden: vec![4] });
    }
}

//! Recorded orbits around a Schwarzschild hole, positions with noise: what of the hole a fit tells, by the number of orbits and the noise.
//!
//! The clock is the proper time of what falls: a beacon whose ticks are counted. At every tick its place and the coordinate time are taken, all
//! four with noise of a part of the distance. Two in three orbits are bound, p from 8 to 24 M, e to 0.5; the others plunge from rest, more or
//! less, to 2.3 M.

use lnn::configuration::{Precision, Regularizer};
use lnn::geometry::Sense;
use lnn::lagrangian::{EulerLagrange, SystemInstance, configure};
use lnn::network::Structure;
use lnn::pipeline::{FitOptions, InMemory, PreparedFit, RunOptions, Watch, fit};
use lnn::random::{RandomGenerator, RngStream};
use lnn::recording::{LoadedRecording, RecordedTrajectory, Recording, Targets};
use lnn::relativity::{CentralCoordinates, Chart, LearnedHole, Reading};
use lnn::rollout::{Options, rollout};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::time::Instant;

/// Samples of an orbit, and the proper time between two.
const SAMPLES: usize = 400;
const TICK: f64 = 1.0;
/// Distance at which a plunge is lost from sight.
const LOST: f64 = 2.3;
/// What is told of the hole.
pub const TOLD: [&str; 5] = [
    "metric, R from 1.5 to 20 M, median",
    "innermost stable orbit [M]",
    "critical impact parameter [M]",
    "periastron advance, p = 15 M, e = 0.2 [rad]",
    "parameter M",
];

/// Recordings of the same orbits in other coordinates and structures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// The structure `metric` of Cartesian coordinates, distances seen by their logarithm.
    Metric,
    /// A black box of the same.
    BlackBox,
    /// The structure `metric` of `t, r, theta, phi`.
    Spherical,
}

impl Way {
    fn name(self) -> &'static str {
        match self {
            Self::Metric => "metric, Cartesian",
            Self::BlackBox => "black box, Cartesian",
            Self::Spherical => "metric, spherical",
        }
    }

    fn system(self) -> SystemInstance<f64> {
        let name = if self == Self::Spherical { "schwarzschild-geodesic" } else { "schwarzschild-cartesian" };
        configure(name, &[]).expect("the defaults are valid")
    }

    fn around(self) -> CentralCoordinates {
        match self {
            Self::Spherical => CentralCoordinates::Spherical { time: 0, radius: 1, polar: 2, azimuth: 3 },
            _ => CentralCoordinates::Cartesian(Chart::default()),
        }
    }
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

/// An orbit in Cartesian coordinates, sampled by its own clock.
fn orbit(
    hole: &dyn EulerLagrange<f64>,
    system: &SystemInstance<f64>,
    bound: bool,
    rng: &mut RandomGenerator,
) -> Vec<[f64; 4]> {
    let around = CentralCoordinates::Cartesian(Chart::default());
    let [q, v] = if bound {
        let (p, e) = (rng.random_range(8.0..24.0), rng.random_range(0.0..0.5));
        let origin = around.origin();
        let sense = if rng.random::<bool>() { Sense::Forward } else { Sense::Backward };
        let turning = around.equator(hole, &origin).between(p / (1.0 + e), p / (1.0 - e), sense);
        around.turning(p / (1.0 + e), &turning.expect("a metric").expect("a bound orbit"))
    } else {
        let (distance, across) = (rng.random_range(6.0..16.0), rng.random_range(-0.1..0.1));
        let mut v = [0.0, rng.random_range(-0.3..0.1), across, 0.0];
        let q = [0.0, distance, 0.0, 0.0];
        system.impose_constraint(&q, &mut v).expect("outside the horizon");
        [q, v]
    };
    let turn = turned(rng);
    let space = |x: &[f64]| turn([x[1], x[2], x[3]]);
    let ([a, b, c], [d, e, f]) = (space(&q), space(&v));
    let options = Options { energy: false, ..Options::reference(TICK * (SAMPLES - 1) as f64, TICK) };
    let motion = rollout(hole, &[q[0], a, b, c], &[v[0], d, e, f], &options).trajectory;
    let rows = motion.q.chunks_exact(4).map(|q| [q[0], q[1], q[2], q[3]]);
    rows.take_while(|q| around.distance(q) > LOST).collect()
}

/// The coordinates of a way, angles unwrapped.
fn seen(way: Way, path: &[[f64; 4]]) -> Vec<f64> {
    if way != Way::Spherical {
        return path.concat();
    }
    let (mut all, mut last) = (Vec::new(), 0.0_f64);
    for [t, x, y, z] in path {
        let r = (x * x + y * y + z * z).sqrt();
        let phi = y.atan2(*x);
        last = phi + std::f64::consts::TAU * ((last - phi) / std::f64::consts::TAU).round();
        // The time of Schwarzschild's coordinates runs apart from that of Kerr and Schild.
        all.extend([t - 2.0 * (0.5 * r - 1.0).abs().ln(), r, (z / r).acos(), last]);
    }
    all
}

fn recording(way: Way, orbits: usize, noise: f64, seed: u64) -> Recording {
    let rng = &mut RngStream::Training(0).generator(seed);
    let system = Way::Metric.system();
    let hole = system.build().expect("the defaults are valid");
    let mut tracks = Vec::new();
    for k in 0..orbits {
        let path = orbit(hole.as_ref(), &system, k % 3 != 2, rng);
        let distances: Vec<f64> = path.iter().map(|q| (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt()).collect();
        let noisy: Vec<[f64; 4]> = path
            .iter()
            .zip(&distances)
            .map(|(q, r)| q.map(|x| x + noise * r * Distribution::<f64>::sample(&StandardNormal, rng)))
            .collect();
        let times = (0..path.len()).map(|k| TICK * k as f64).collect();
        let track = RecordedTrajectory {
            name: format!("orbit {k}"),
            times,
            q: seen(way, &noisy),
            v: vec![],
            a: vec![],
            force: vec![],
        };
        tracks.push(track);
    }
    let names = if way == Way::Spherical { ["t", "r", "theta", "phi"] } else { ["t", "x", "y", "z"] };
    let periodic = vec![false, false, false, way == Way::Spherical];
    Recording { coordinates: names.map(String::from).to_vec(), periodic, tracks }
}

/// Fits one recording as `lnn fit` does, and reads the hole.
fn told(way: Way, orbits: usize, noise: f64, (epochs, threads): (Option<usize>, usize)) -> Vec<Reading> {
    let loaded = LoadedRecording::from(recording(way, orbits, noise, 0));
    let options = FitOptions { targets: Some(Targets::Smoothed), ..FitOptions::default() };
    let prepared = PreparedFit::new(&loaded, &options).expect("long orbits");
    let mut config = prepared.suggest("orbits", Precision::F32).expect("states with full windows");
    let training = &mut config.training;
    let time = || "t".to_string();
    training.network.time_like = Some(time());
    training.network.cyclic = vec![time()];
    training.data.acceleration_weighting = 1.0;
    match way {
        Way::BlackBox => training.penalty = Regularizer::LorentzianSylvester { lambda: 100.0, time: time() },
        Way::Metric | Way::Spherical => training.take_structure(Structure::Metric),
    }
    if way != Way::Spherical {
        training.network.scaling = lnn::configuration::Scaling::None;
        training.network.radial = vec![["x", "y", "z"].map(String::from).to_vec()];
        training.network.radial_unit = Some(2.0);
    }
    // A third of the usual steps.
    training.phases[0].epochs = training.phases[0].epochs.div_ceil(3);
    training.phases[0].t_max = training.phases[0].epochs as f64;
    if let Some(epochs) = epochs {
        (training.phases[0].epochs, training.phases[0].t_max) = (epochs, epochs as f64);
        training.network.hidden = vec![8];
    }
    let run = RunOptions { threads, ..RunOptions::default() };
    let fitted = fit(&prepared, &config, &run, &InMemory::default(), &Watch::default()).expect("a fit");
    let (system, learned) = (way.system(), fitted.network);
    let exact = system.build().expect("the defaults are valid");
    let range = if way == Way::Spherical { (3.0, 36.0) } else { (2.5, 36.0) };
    let pair = LearnedHole { exact: &*exact, learned: &learned, system: &system, around: way.around(), range };
    pair.readings().expect("an exact metric")
}

/// Prints and returns rows `learned by,orbits,noise,quantity,error,seconds`.
pub fn compare(cases: &[(usize, f64)], beside: bool, work: (Option<usize>, usize)) -> Vec<String> {
    let mut rows = Vec::new();
    let ways = [Way::Metric, Way::BlackBox, Way::Spherical];
    for way in &ways[..if beside { 3 } else { 1 }] {
        // The others once, where the first has it easy.
        let cases = if *way == Way::Metric { cases } else { &cases[cases.len() - 1..] };
        for &(orbits, noise) in cases {
            let began = Instant::now();
            let readings = told(*way, orbits, noise, work);
            let seconds = began.elapsed().as_secs_f64();
            let error = |name: &str| readings.iter().find(|r| r.quantity == name).and_then(|r| r.error);
            let cells = TOLD.map(|name| error(name).map_or("-".to_string(), |e| format!("{:.3} %", 100.0 * e)));
            let name = way.name();
            println!(
                "  {name:22} {orbits:4} orbits, noise {:5.2} %: {}; {seconds:.0} s",
                100.0 * noise,
                cells.join("  ")
            );
            for quantity in TOLD {
                let error = error(quantity).map_or(String::new(), |e| e.to_string());
                rows.push(format!("{name},{orbits},{noise},\"{quantity}\",{error},{seconds:.1}"));
            }
        }
    }
    rows
}

//! Recorded orbits around a Schwarzschild hole, positions with noise: what of the hole a fit tells, by the number of orbits and the noise.
//!
//! At every tick of the clock of what falls its place and the coordinate time are taken, all four with noise of a part of the distance.

use super::recorded_orbits::{self, Orbit, distance};
use lnn::configuration::{Regularizer, Scaling};
use lnn::lagrangian::SystemInstance;
use lnn::network::Structure;
use lnn::pipeline::{Fit, FitConfig};
use lnn::recording::{RecordedTrajectory, Recording, SmoothOptions, Smoothing, Targets};
use lnn::relativity::{CentralCoordinates, Chart, LearnedHole, Reading};
use std::time::Instant;

/// Distances between which the accuracy of accelerations is told.
const DISTANCES: [f64; 6] = [2.05, 4.0, 6.0, 10.0, 16.0, 50.0];
/// Least distance seen in `t, r, theta, phi`, whose time has no end at the horizon.
const SPHERICAL: f64 = 2.3;
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
enum Variant {
    /// The structure `metric` of Cartesian coordinates, distances seen by their logarithm.
    Metric,
    /// A black box of the same.
    BlackBox,
    /// The structure `metric` of `t, r, theta, phi`.
    Spherical,
}

impl Variant {
    fn name(self) -> &'static str {
        match self {
            Self::Metric => "metric, Cartesian",
            Self::BlackBox => "black box, Cartesian",
            Self::Spherical => "metric, spherical",
        }
    }

    fn system(self) -> SystemInstance<f64> {
        let name = if self == Self::Spherical { "schwarzschild-geodesic" } else { "schwarzschild-cartesian" };
        SystemInstance::named(name, &[]).expect("the defaults are valid")
    }

    fn around(self) -> CentralCoordinates {
        match self {
            Self::Spherical => CentralCoordinates::Spherical { time: 0, radius: 1, polar: 2, azimuth: 3 },
            _ => CentralCoordinates::Cartesian(Chart::default()),
        }
    }
}

/// The coordinates of a variant, angles unwrapped.
fn seen(variant: Variant, path: &[f64]) -> Vec<f64> {
    if variant != Variant::Spherical {
        return path.to_vec();
    }
    let (mut all, mut last) = (Vec::new(), 0.0_f64);
    for q in path.chunks_exact(4) {
        let (r, phi) = (distance(q), q[2].atan2(q[1]));
        last = phi + std::f64::consts::TAU * ((last - phi) / std::f64::consts::TAU).round();
        // The time of Schwarzschild's coordinates runs apart from that of Kerr and Schild.
        all.extend([q[0] - 2.0 * (0.5 * r - 1.0).abs().ln(), r, (q[3] / r).acos(), last]);
    }
    all
}

/// Orbits as they were seen.
fn recording(variant: Variant, orbits: &[Orbit]) -> Recording {
    let tracks = orbits.iter().enumerate().map(|(k, orbit)| {
        let least = if variant == Variant::Spherical { SPHERICAL } else { 0.0 };
        let seen_rows = orbit.q.chunks_exact(4).take_while(|q| distance(q) > least).count();
        RecordedTrajectory {
            name: format!("orbit {k}"),
            times: orbit.times[..seen_rows].to_vec(),
            q: seen(variant, &orbit.noisy[..4 * seen_rows]),
            v: vec![],
            a: vec![],
            force: vec![],
        }
    });
    let names = if variant == Variant::Spherical { ["t", "r", "theta", "phi"] } else { ["t", "x", "y", "z"] };
    let periodic = vec![false, false, false, variant == Variant::Spherical];
    Recording { coordinates: names.map(String::from).to_vec(), periodic, tracks: tracks.collect() }
}

/// Median relative errors of smoothed accelerations between [`DISTANCES`], with windows that vary and with one window, at the states
/// that have full windows of the first kind.
fn accelerations(orbits: usize, noise: f64) -> [Vec<f64>; 2] {
    let orbits = recorded_orbits::orbits(orbits, noise, 0);
    let recording = recording(Variant::Metric, &orbits);
    let varying = Smoothing::choose(&recording, &SmoothOptions::default()).expect("long orbits");
    let constant = Smoothing { varying: false, ..varying.clone() };
    let size = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
    let mut errors = [(); 2].map(|()| vec![Vec::new(); DISTANCES.len() - 1]);
    for (track, orbit) in recording.tracks.iter().zip(&orbits) {
        let found = [&varying, &constant].map(|smoothing| smoothing.apply(track).expect("a long orbit"));
        for row in found[0].interior() {
            let row = 4 * row..4 * row + 4;
            let far = distance(&orbit.q[row.clone()]);
            let part = DISTANCES[1..].iter().position(|most| far < *most).unwrap_or(DISTANCES.len() - 2);
            let exact = &orbit.a[row.clone()];
            for (errors, smoothed) in errors.iter_mut().zip(&found) {
                let error: Vec<f64> = smoothed.a[row.clone()].iter().zip(exact).map(|(a, b)| a - b).collect();
                errors[part].push(size(&error) / size(exact));
            }
        }
    }
    let median = |mut errors: Vec<f64>| {
        errors.sort_by(f64::total_cmp);
        errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN)
    };
    errors.map(|errors| errors.into_iter().map(median).collect())
}

/// Fits one recording as `lnn fit` does, and reads the hole.
fn fitted(variant: Variant, orbits: usize, noise: f64, (epochs, threads): (Option<usize>, usize)) -> Vec<Reading> {
    let fit = Fit::recording(recording(variant, &recorded_orbits::orbits(orbits, noise, 0)))
        .options(|options| options.targets = Some(Targets::Smoothed))
        .configure(move |config| choose(config, variant, epochs))
        .threads(threads);
    let (system, learned) = (variant.system(), fit.run().expect("a fit").network);
    let exact = system.build().expect("the defaults are valid");
    let range = if variant == Variant::Spherical { (3.0, 36.0) } else { (2.5, 36.0) };
    let pair = LearnedHole { exact: &*exact, learned: &learned, system: &system, around: variant.around(), range };
    pair.readings().expect("an exact metric")
}

/// What is chosen beside the usual configuration, for a variant to learn.
fn choose(config: &mut FitConfig, variant: Variant, epochs: Option<usize>) {
    let training = &mut config.training;
    let time = || "t".to_string();
    training.network.time_like = Some(time());
    training.network.cyclic = vec![time()];
    training.data.acceleration_weighting = 1.0;
    match variant {
        Variant::BlackBox => training.penalty = Regularizer::LorentzianSylvester { lambda: 100.0, time: time() },
        Variant::Metric | Variant::Spherical => training.take_structure(Structure::Metric),
    }
    if variant != Variant::Spherical {
        training.network.scaling = Scaling::None;
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
}

/// Prints and returns rows `learned by,orbits,noise,quantity,error,seconds`.
pub fn compare(cases: &[(usize, f64)], beside: bool, work: (Option<usize>, usize)) -> Vec<String> {
    let mut rows = Vec::new();
    let orbits = cases.iter().map(|case| case.0).max().unwrap_or(0).min(100);
    let mut noises: Vec<f64> = cases.iter().map(|case| case.1).collect();
    noises.dedup();
    for noise in noises {
        for (windows, errors) in ["varying windows", "one window"].iter().zip(accelerations(orbits, noise)) {
            let errors: Vec<String> = errors.iter().map(|e| format!("{:.2} %", 100.0 * e)).collect();
            let noise = 100.0 * noise;
            println!("  accelerations, {orbits:4} orbits, noise {noise:5.2} %, {windows:15}: {}", errors.join("  "));
        }
    }
    let variants = [Variant::Metric, Variant::BlackBox, Variant::Spherical];
    for variant in &variants[..if beside { 3 } else { 1 }] {
        // The others once, where the first has it easy.
        let cases = if *variant == Variant::Metric { cases } else { &cases[cases.len() - 1..] };
        for &(orbits, noise) in cases {
            let began = Instant::now();
            let readings = fitted(*variant, orbits, noise, work);
            let seconds = began.elapsed().as_secs_f64();
            let error = |name: &str| readings.iter().find(|r| r.quantity == name).and_then(|r| r.error);
            let cells = TOLD.map(|name| error(name).map_or("-".to_string(), |e| format!("{:.3} %", 100.0 * e)));
            let name = variant.name();
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

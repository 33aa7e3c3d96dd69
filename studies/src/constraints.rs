//! Constraints: found in recorded motion, kept over long times, learned under, and what they cost.
//!
//! `lnn-studies constraints --part found` records every system under constraints, 100 motions of 5 s at 100 Hz with noise of 0,
//! 0.001 and 0.01 of the size of each column, seed 0, and at 0.001 seeds 0 to 9, and looks for its constraints. `--part none` does the
//! same with ten systems without. `--part drift` integrates 10,000 swings; `--part learned` learns Lagrangians in Cartesian coordinates
//! under constraints that were found, not given; `--part cost` times evaluations, roll-outs and training steps beside those of free
//! coordinates. Without `--part` all.

#[path = "../../benches/shared/networks.rs"]
mod networks;

use lnn::analysis::mass_matrix_error_within;
use lnn::configuration::Penalty;
use lnn::constraints::{ConstraintSearch, FoundConstraints, MotionSamples};
use lnn::data::Dataset;
use lnn::lagrangian::{
    Constrained, Constraints, EulerLagrange, ExpressionConstraints, ManifoldRows, Mechanics, Request, SystemInstance,
    Terms, project,
};
use lnn::network::{Initialization, Structure};
use lnn::presets::Trainer;
use lnn::recording::{RecordedTrajectory, Recording, SmoothOptions};
use lnn::rollout::{Integrator, RolloutOptions, rollout};
use lnn::training::Objective;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use std::time::Instant;

/// Systems with the number of their constraints, holonomic or linear in the velocities, and the degree that finds them.
const SYSTEMS: [(&str, usize, usize); 14] = [
    ("cartesian-chain-1", 1, 2),
    ("cartesian-chain-2", 2, 2),
    ("cartesian-chain-3", 3, 2),
    ("cartesian-chain-5", 5, 2),
    ("particle-on-sphere", 1, 2),
    ("particle-on-ellipse", 1, 2),
    ("particle-on-ellipsoid", 1, 2),
    ("particle-on-torus", 1, 4),
    ("rigid-body", 6, 2),
    ("heavy-top", 6, 2),
    ("four-bar-linkage", 3, 2),
    ("chaplygin-sleigh", 1, 2),
    ("rolling-disk", 2, 2),
    ("schwarzschild-by-clock", 1, 2),
];

/// Systems without constraints. Geodesics of anti-de Sitter space leave their coordinates before 5 s are over, and are not among them.
const FREE: [&str; 10] = [
    "double-pendulum",
    "triple-pendulum",
    "spring-pendulum",
    "sphere-geodesic",
    "harmonic-oscillator",
    "kepler",
    "henon-heiles",
    "charged-particle",
    "schwarzschild-geodesic",
    "kerr-geodesic",
];

/// Noise over the size of a column.
const NOISES: [f64; 3] = [0.0, 0.001, 0.01];

/// A particle on a sphere without weight, which moves on great circles.
const SPHERE: &str = "sphere";

fn configured(name: &str) -> SystemInstance<f64> {
    let weightless = [("g".to_string(), "0".to_string())];
    let (name, given) = if name == SPHERE { ("particle-on-sphere", &weightless[..]) } else { (name, &[][..]) };
    SystemInstance::named(name, given).expect("the values are valid")
}

fn model(name: &str) -> Box<dyn EulerLagrange<f64>> {
    configured(name).build().expect("the defaults are valid")
}

/// Random states of a system, on its constraints and its mass shell.
fn starts(name: &str, count: usize, seed: u64) -> Vec<(Vec<f64>, Vec<f64>)> {
    let (system, mut rng) = (configured(name), ChaCha8Rng::seed_from_u64(seed));
    let (model, bounds) = (model(name), system.system.validation(system.coordinates));
    let mut found = Vec::with_capacity(count);
    while found.len() < count {
        let mut draw = |sides: &[(f64, f64)]| -> Vec<f64> {
            sides.iter().map(|&(low, high)| low + (high - low) * rng.random::<f64>()).collect()
        };
        let (mut q, mut v) = (draw(&bounds.positions), draw(&bounds.velocities));
        let on = match model.manifold() {
            Some(manifold) => project(manifold, &mut q, &mut v).is_ok(),
            None => system.check_domain(&q).is_ok() && system.impose_constraint(&q, &mut v).is_ok(),
        };
        if on && q.iter().chain(&v).all(|x| x.is_finite()) {
            found.push((q, v));
        }
    }
    found
}

/// Motions of a system, sampled at 100 Hz, and the same with noise.
fn recorded(name: &str, motions: usize, seconds: f64, noise: f64, seed: u64) -> (Recording, Recording) {
    let (system, model) = (configured(name), model(name));
    let coordinates = system.system.coordinates(system.coordinates);
    let options = RolloutOptions::new(seconds, 0.01).tolerances(1e-10, 1e-10).energy(false);
    let (mut tracks, mut more) = (Vec::new(), 0);
    while tracks.len() < motions {
        for (q, v) in starts(name, motions - tracks.len(), seed + 1000 * more) {
            let motion = rollout(&*model, &q, &v, &options);
            if motion.stop.is_none() {
                let t = motion.trajectory;
                let name = format!("run {}", tracks.len());
                tracks.push(RecordedTrajectory { name, times: t.t, q: t.q, v: t.v, a: vec![], force: vec![] });
            }
        }
        more += 1;
        assert!(more < 100, "{name}: hardly any motion lasts {seconds} s");
    }
    let exact = Recording {
        coordinates: coordinates.iter().map(|c| c.name.to_string()).collect(),
        periodic: coordinates.iter().map(|c| c.periodic).collect(),
        tracks,
    };
    let (n, mut rng) = (exact.n(), ChaCha8Rng::seed_from_u64(seed));
    let mut gauss = || {
        let (a, b): (f64, f64) = (rng.random(), rng.random());
        (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
    };
    let mut noisy = exact.clone();
    for i in 0..n {
        let size = |of: &dyn Fn(&RecordedTrajectory) -> &[f64]| {
            let all = exact.tracks.iter().flat_map(|track| of(track).iter().skip(i).step_by(n));
            let (sum, count) = all.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
            f64::sqrt(sum / count)
        };
        let sizes = [size(&|track| &track.q), size(&|track| &track.v)];
        for track in &mut noisy.tracks {
            for (x, size) in [(&mut track.q, sizes[0]), (&mut track.v, sizes[1])] {
                x.iter_mut().skip(i).step_by(n).for_each(|x| *x += noise * size * gauss());
            }
        }
    }
    (exact, noisy)
}

/// What was found, of a recording whose velocities are looked at if a constraint is linear in them.
fn search(recording: &Recording, degree: usize) -> FoundConstraints {
    let samples = MotionSamples::of(recording, &SmoothOptions::default()).expect("long trajectories");
    FoundConstraints::of(&samples, ConstraintSearch { degree, velocity_degree: 1 }).expect("enough samples")
}

/// Largest distance of exact states from a found constraint, over the size of the coordinates.
fn distance(exact: &Recording, found: &FoundConstraints) -> f64 {
    let names: Vec<&str> = exact.coordinates.iter().map(String::as_str).collect();
    let of_system = found.constraints.iter().filter(|found| found.kind.is_imposed());
    let formulas: Vec<(String, &str)> =
        of_system.enumerate().map(|(k, found)| (k.to_string(), found.formula.as_str())).collect();
    let formulas: Vec<(&str, &str)> = formulas.iter().map(|(name, formula)| (name.as_str(), *formula)).collect();
    let Ok(constraints) = ExpressionConstraints::new(&names, &[], &formulas) else { return f64::NAN };
    let n = names.len();
    struct Still(usize);
    impl lnn::lagrangian::Lagrangian for Still {
        fn coordinates(&self) -> usize {
            self.0
        }
        fn lagrangian<R: lnn::scalar::Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
            v.iter().fold(R::zero(), |sum, v| sum + v.sqr())
        }
    }
    let holonomic: Vec<bool> = (0..formulas.len()).map(|row| constraints.is_holonomic(row)).collect();
    let model = Constrained::new(Mechanics::new(Still(n), []), constraints, []).expect("the same coordinates");
    let manifold = model.manifold().expect("a constrained model");
    let (mut rows, mut worst) = (ManifoldRows::default(), 0.0f64);
    for track in &exact.tracks {
        for (q, v) in track.q.chunks_exact(n).zip(track.v.chunks_exact(n)).step_by(17) {
            manifold.rows(q, v, &mut rows);
            for (c, gradient) in rows.matrix.chunks_exact(n).enumerate() {
                let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
                let (defect, size) =
                    if holonomic[c] { (rows.values[c], length(q)) } else { (rows.rates[c], length(v)) };
                worst = worst.max(defect.abs() / (length(gradient) * size));
            }
        }
    }
    worst
}

/// One search, as a row of the table.
fn row(name: &str, expected: usize, degree: usize, noise: f64, seed: u64, size: (usize, f64)) -> bool {
    let started = Instant::now();
    let (exact, mut noisy) = recorded(name, size.0, size.1, noise, seed);
    let by_velocity = ["chaplygin-sleigh", "rolling-disk", "schwarzschild-by-clock"].contains(&name);
    if !by_velocity {
        noisy.tracks.iter_mut().for_each(|track| track.v.clear());
    }
    let recorded = started.elapsed().as_secs_f64();
    let found = search(&noisy, degree);
    let off = if found.count > 0 { distance(&exact, &found) } else { 0.0 };
    let conserved = found.constraints.len() - found.count;
    println!(
        "{name:<24} {noise:<6} {seed:>4} {expected:>8} {:>5} {conserved:>9} {:>9.1} {:>10.1e} {:>8.1} s",
        found.count,
        found.gap.unwrap_or(f64::INFINITY),
        off,
        started.elapsed().as_secs_f64() - recorded
    );
    found.count == expected && conserved == 0 && off < 0.01
}

fn head() {
    println!("system                   noise  seed expected found conserved       gap   distance   search");
}

fn found(seeds: u64, size: (usize, f64), only: &dyn Fn(&str) -> bool) {
    head();
    let (mut right, mut all) = (0, 0);
    for (name, expected, degree) in SYSTEMS.into_iter().filter(|(name, ..)| only(name)) {
        for noise in NOISES {
            let seeds = if noise == 0.001 { seeds } else { 1 };
            for seed in 0..seeds {
                right += usize::from(row(name, expected, degree, noise, seed, size));
                all += 1;
            }
        }
    }
    println!("{right} of {all} as expected, every coefficient within 1 %");
}

fn none(size: (usize, f64), only: &dyn Fn(&str) -> bool) {
    head();
    let (mut right, mut all) = (0, 0);
    for name in FREE.into_iter().filter(|name| only(name)) {
        for noise in NOISES {
            right += usize::from(row(name, 0, 2, noise, 0, size));
            all += 1;
        }
    }
    println!("{right} of {all} as expected");
}

/// Defect of constraint and energy over so many swings of a rod of 1 m that starts 53 degrees from the vertical.
fn drift(swings: f64) {
    let pendulum = model("cartesian-chain-1");
    let (q, v) = ([0.8, -0.6], [0.0, 0.0]);
    // Period by the arithmetic-geometric mean.
    let (mut a, mut b) = (1.0, (0.6f64.acos() / 2.0).cos());
    while f64::abs(a - b) > 1e-15 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    let period = TAU / (a * 9.81f64.sqrt());
    println!("method       step      rod     energy   after a tenth  seconds");
    for (method, step) in [
        (Integrator::Dopri5, None),
        (Integrator::Dop853, None),
        (Integrator::Variational, Some(0.02)),
        (Integrator::Gauss4, Some(0.04)),
        (Integrator::Gauss6, Some(0.08)),
    ] {
        let options = RolloutOptions::new(swings * period, 0.5 * period)
            .method(method)
            .step(step.map(|step| step * period))
            .tolerances(1e-9, 1e-9)
            .max_steps(usize::MAX);
        let started = Instant::now();
        let motion = rollout(&*pendulum, &q, &v, &options).complete().expect("a pendulum");
        let energy = motion.energy.as_ref().expect("asked for");
        let off = |part: &[f64]| part.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max) / 9.81;
        let rod = (0..motion.len()).map(|k| (motion.state(k).0[0].hypot(motion.state(k).0[1]) - 1.0).abs());
        println!(
            "{:<12} {:<6} {:>9.1e} {:>9.1e} {:>9.1e} {:>9.1}",
            format!("{method:?}"),
            step.map_or("-".into(), |step| step.to_string()),
            rod.fold(0.0, f64::max),
            off(energy),
            off(&energy[..energy.len() / 10 + 1]),
            started.elapsed().as_secs_f64()
        );
    }
}

/// States on the constraints of a system with their accelerations.
fn states(name: &str, count: usize, seed: u64) -> Dataset<f64> {
    let model = model(name);
    let (mut q, mut v, mut a) = (Vec::new(), Vec::new(), Vec::new());
    for (start, speed) in starts(name, count, seed) {
        if let Ok(acceleration) = model.acceleration(&start, &speed) {
            q.extend(start);
            v.extend(speed);
            a.extend(acceleration);
        }
    }
    Dataset::new(model.coordinates(), q, v, a).expect("finite states")
}

/// States of a chain in Cartesian coordinates at the angles and rates at which the pendulum of so many angles is learned.
fn chain_states(bobs: usize, pendulum: &str, count: usize, seed: u64) -> Dataset<f64> {
    let (model, bounds) = (model(&format!("cartesian-chain-{bobs}")), configured(pendulum).system.training(bobs));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut q, mut v) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let (mut place, mut speed) = ([0.0; 2], [0.0; 2]);
        for k in 0..bobs {
            let mut draw = |(low, high): (f64, f64)| low + (high - low) * rng.random::<f64>();
            let (angle, rate) = (draw(bounds.positions[k]), draw(bounds.velocities[k]));
            let (sin, cos) = angle.sin_cos();
            (place[0], place[1]) = (place[0] + sin, place[1] - cos);
            (speed[0], speed[1]) = (speed[0] + rate * cos, speed[1] + rate * sin);
            q.extend(place);
            v.extend(speed);
        }
    }
    let a = model.acceleration(&q, &v).expect("a chain");
    Dataset::new(2 * bobs, q, v, a).expect("finite states")
}

/// What is learned in redundant coordinates: a name for the table, the system, the pendulum whose states are taken, the structure.
const LEARNED: [(&str, &str, Option<&str>, Structure); 9] = [
    ("double pendulum", "cartesian-chain-2", Some("double-pendulum"), Structure::Mechanical),
    ("double pendulum", "cartesian-chain-2", Some("double-pendulum"), Structure::ConstantMass),
    ("triple pendulum", "cartesian-chain-3", Some("triple-pendulum"), Structure::Mechanical),
    ("triple pendulum", "cartesian-chain-3", Some("triple-pendulum"), Structure::ConstantMass),
    ("geodesics of a sphere", SPHERE, None, Structure::Mechanical),
    ("heavy top", "heavy-top", None, Structure::Mechanical),
    ("heavy top", "heavy-top", None, Structure::ConstantMass),
    ("AdS4 by its clock", "ads4-by-clock", None, Structure::BlackBox),
    ("Schwarzschild by clock", "schwarzschild-by-clock", None, Structure::BlackBox),
];

/// Learns Lagrangians in redundant coordinates under the constraints that their own motions obey, which are found first, in motions with
/// this noise.
fn learned(seeds: u64, (count, epochs, noise): (usize, usize, f64), only: &dyn Fn(&str) -> bool) {
    println!(
        "what                   structure     seed  found  validation       test   M off by     at most   roll-outs"
    );
    for (what, name, pendulum, structure) in LEARNED.into_iter().filter(|(_, name, ..)| only(name)) {
        for seed in 0..seeds {
            let started = Instant::now();
            let data = match pendulum {
                Some(pendulum) => {
                    chain_states(name[name.len() - 1..].parse().expect("bobs"), pendulum, count, 100 + seed)
                }
                None => states(name, count, 100 + seed),
            };
            // A state by itself does not tell its noise: constraints are looked for in motions.
            let (_, recording) = recorded(name, 40, 2.0, noise, seed);
            let found = search(&recording, 2);
            let formulas = found.formulas();
            let formulas: Vec<(&str, &str)> =
                formulas.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
            let names: Vec<&str> = recording.coordinates.iter().map(String::as_str).collect();
            let exact = model(name);
            let expected = exact.manifold().expect("a system under constraints").names().len();
            let trainer = Trainer::new(&data).coordinates(&names).constraints(&formulas).structure(structure);
            let learned = trainer.epochs(epochs).seed(seed).train().expect("a training");
            let motion = learned.motion().expect("constraints that were learned under");
            let manifold = exact.manifold().expect("a system under constraints");
            let few = 2000 * data.coordinates();
            let off = mass_matrix_error_within(manifold, (&*exact, &*motion), (&data.q()[..few], &data.v()[..few]));
            println!(
                "{what:<22} {:<13} {seed:>4} {:>4}/{expected} {:>11.2e} {:>10.2e} {:>9.1e} {:>9.1e}   {}  ({:.0} s)",
                structure.name(),
                found.count,
                learned.validation_loss,
                learned.test_loss,
                off.error.median,
                off.error.max,
                rolled_out(name, &*exact, &*motion, seed),
                started.elapsed().as_secs_f64()
            );
        }
    }
}

/// Roll-outs of a learned motion where angles have a pole, a gimbal lock, or nothing of the kind.
fn rolled_out(name: &str, exact: &dyn EulerLagrange<f64>, learned: &dyn EulerLagrange<f64>, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(7 + seed);
    let mut draw = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let options = |end: f64| RolloutOptions::new(end, end / 100.0).tolerances(1e-9, 1e-9).energy(false);
    let (mut errors, what): (Vec<f64>, &str) = match name {
        SPHERE => {
            // Over both poles and back again.
            let one = |(angle, speed): (f64, f64)| {
                let (sin, cos) = angle.sin_cos();
                let motion = rollout(learned, &[cos, sin, 0.0], &[0.0, 0.0, speed], &options(TAU / speed)).trajectory;
                let about = |q: &[f64], v: &[f64]| {
                    let x = q[1] * v[2] - q[2] * v[1] - speed * sin;
                    let y = q[2] * v[0] - q[0] * v[2] + speed * cos;
                    let z = q[0] * v[1] - q[1] * v[0];
                    x.hypot(y).hypot(z) / speed
                };
                let off = (0..motion.len()).map(|k| about(motion.state(k).0, motion.state(k).1));
                if motion.len() < 101 { f64::INFINITY } else { off.fold(0.0, f64::max) }
            };
            (
                (0..1000).map(|_| one((draw(0.0, TAU), draw(0.5, 2.0)))).collect(),
                "angular momentum, 1000 over the poles",
            )
        }
        "heavy-top" => {
            // From the axis of the body along the vertical, where Euler's angles lock, tilted by its rates.
            let one = |(angle, rates): (f64, [f64; 3])| {
                let (sin, cos) = angle.sin_cos();
                let q = [cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0];
                let [a, b, c] = rates;
                let spin = [0.0, -c, b, c, 0.0, -a, -b, a, 0.0];
                let v: Vec<f64> =
                    (0..9).map(|at| (0..3).map(|k| q[at / 3 * 3 + k] * spin[3 * k + at % 3]).sum()).collect();
                distance_of((exact, learned), (&q, &v), &options(2.0), None)
            };
            let rates = |draw: &mut dyn FnMut(f64, f64) -> f64| [draw(-1.5, 1.5), draw(-1.5, 1.5), draw(-2.0, 2.0)];
            let mut starts = Vec::new();
            for _ in 0..50 {
                starts.push((draw(0.0, TAU), rates(&mut draw)));
            }
            (starts.into_iter().map(one).collect(), "distance after 2 s from the gimbal lock")
        }
        _ => {
            let end = if name.starts_with("cartesian") { 1.0 } else { 5.0 };
            let all = starts(name, 50, 900 + seed);
            // Geodesics leave their coordinates sooner or later, and where nothing was learned nothing is judged.
            let range = (end == 5.0)
                .then(|| configured(name))
                .map(|system| system.system.training(system.coordinates).positions);
            let all = all.iter().map(|(q, v)| distance_of((exact, learned), (q, v), &options(end), range.as_deref()));
            (all.collect(), if end == 1.0 { "distance after 1 s" } else { "distance within 5 m and the learned range" })
        }
    };
    errors.sort_by(f64::total_cmp);
    format!("{what}, {:.1e} and {:.1e}", errors[errors.len() / 2], errors[errors.len() - 1])
}

/// Largest distance of the coordinates of a learned motion from those of the exact one, as long as that is within the range, of the
/// coordinates but the first; infinite if one of them ends before.
fn distance_of(
    (exact, learned): (&dyn EulerLagrange<f64>, &dyn EulerLagrange<f64>),
    (q, v): (&[f64], &[f64]),
    options: &RolloutOptions<f64>,
    range: Option<&[(f64, f64)]>,
) -> f64 {
    let n = q.len();
    let (a, b) = (rollout(exact, q, v, options), rollout(learned, q, v, options));
    let inside = |q: &[f64]| {
        range.is_none_or(|range| q.iter().zip(range).skip(1).all(|(x, (low, high))| (low..=high).contains(&x)))
    };
    let judged = a.trajectory.q.chunks_exact(n).take_while(|q| inside(q)).count();
    let ended = a.stop.is_some() && judged == a.trajectory.len();
    if ended || b.trajectory.len() < judged {
        return f64::INFINITY;
    }
    a.trajectory.q.iter().zip(&b.trajectory.q).take(judged * n).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
}

/// Microseconds of a call, the best of several rounds.
fn time(rounds: usize, mut call: impl FnMut()) -> f64 {
    (0..rounds)
        .map(|_| {
            let started = Instant::now();
            call();
            started.elapsed().as_secs_f64() * 1e6
        })
        .fold(f64::INFINITY, f64::min)
}

/// Evaluations, roll-outs and training steps in Cartesian coordinates and in angles.
fn cost(rounds: usize, count: usize) {
    println!("what                          free [us]  constrained [us]");
    let pairs = [("double-pendulum", "cartesian-chain-2"), ("n-pendulum", "cartesian-chain-4")];
    for (free, held) in pairs {
        let [a, b] = [free, held].map(|name| {
            let (data, model) = (states(name, 256, 0), model(name));
            let n = data.coordinates();
            let mut terms = Terms::default();
            let single = time(rounds, || {
                for k in 0..64 {
                    let at = k * n..(k + 1) * n;
                    let _ = model.terms(&data.q()[at.clone()], &data.v()[at], Request::ACCELERATION, &mut terms);
                }
            });
            let options = RolloutOptions::new(5.0, 0.05).energy(false);
            let motion = time(rounds, || drop(rollout(&*model, &data.q()[..n], &data.v()[..n], &options)));
            [single / 64.0, motion]
        });
        println!("{free:<18} one state {:>9.2} {:>12.2}", a[0], b[0]);
        println!("{free:<18} roll-out  {:>9.0} {:>12.0}", a[1], b[1]);
    }
    // The same network on the same states, with rows and without.
    let data = states("cartesian-chain-2", count, 0);
    let held = model("cartesian-chain-2");
    let under = data.clone().on(held.manifold().expect("constraints")).expect("finite rows");
    let architecture = networks::architecture(4, 128, 1.0);
    let rows: Vec<u32> = (0..data.len() as u32).collect();
    let mut objective = Objective::<f64>::new(&architecture, Penalty::None, 1).expect("one thread");
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
    let mut gradient = vec![0.0; weights.len()];
    let free = time(rounds, || _ = objective.step(&weights, &data, &rows, &mut gradient));
    let constrained = time(rounds, || _ = objective.step(&weights, &under, &rows, &mut gradient));
    println!("{:<28} {free:>9.0} {constrained:>12.0}  ({:.2})", "training step, n = 4, m = 2", constrained / free);
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum Part {
    Found,
    None,
    Drift,
    Cost,
    Learned,
}

/// Arguments.
#[derive(clap::Args)]
pub struct Args {
    /// What is measured; all parts if not given
    #[arg(long)]
    part: Option<Part>,
    /// Seeds from 0 on, of `learned` at most 5
    #[arg(long, default_value_t = 10)]
    seeds: u64,
    /// One system of the catalogue
    #[arg(long)]
    system: Option<String>,
    /// Epochs of a training of `learned`
    #[arg(long, default_value_t = 40)]
    epochs: usize,
    /// Noise of the motions in which `learned` finds its constraints
    #[arg(long, default_value_t = 0.0)]
    noise: f64,
}

/// Measures the parts that are asked for.
pub fn run(arguments: Args) {
    let only = |name: &str| arguments.system.as_deref().is_none_or(|system| system == name);
    let asked = |part: Part| arguments.part.is_none_or(|asked| asked == part);
    if asked(Part::Found) {
        found(arguments.seeds, (100, 5.0), &only);
    }
    if asked(Part::None) {
        none((100, 5.0), &only);
    }
    if asked(Part::Drift) {
        drift(10_000.0);
    }
    if asked(Part::Cost) {
        cost(20, 1024);
    }
    if asked(Part::Learned) {
        learned(arguments.seeds.min(5), (60_000, arguments.epochs, arguments.noise), &only);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every part once, at its smallest.
    #[test]
    fn every_part_runs() {
        row("cartesian-chain-1", 1, 2, 0.001, 0, (8, 1.0));
        row("harmonic-oscillator", 0, 2, 0.001, 0, (8, 1.0));
        drift(2.0);
        cost(1, 128);
    }
}

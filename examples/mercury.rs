//! Mercury's perihelion from its orbit: the first corrections of general relativity to Newton's law.
//!
//! `python examples/python/mercury.py planets.csv` writes where the planets are by JPL's ephemeris DE421, which was computed with general
//! relativity and fitted to measured places by those who made it. `cargo run --release --example mercury -- planets.csv` reads them and
//! identifies the constants of `examples/systems/mercury_orbit.toml` in Mercury's motion: the Sun's `GM`, and `beta` and `gamma`, which are 1
//! in Einstein's theory. The pulls of the other planets and of the Sun's flattening are known forces. `--csv FILE.csv` writes positions and
//! pulls as a recording for `lnn identify`. Without files it makes an orbit of its own and compares what it finds with the truth.

use lnn::identification::{Between, Identified, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::pipeline::parse_system;
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{Driven, RolloutOptions};
use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::Write;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;
type Place = [f64; 3];

const FORM: &str = include_str!("systems/mercury_orbit.toml");
/// Astronomical unit of DE421, km.
const AU: f64 = 149_597_870.699_626_2;
/// `GM` of the Sun in DE421, AU^3/d^2.
const SUN: f64 = 2.959_122_082_855_911e-4;
/// The planets with their `GM` in DE421, AU^3/d^2; Mercury first. The Earth has the Moon with it.
const PLANETS: [(&str, f64); 8] = [
    ("mercury", 4.912_549_571_867_94e-11),
    ("venus", 7.243_452_332_698_441e-10),
    ("earthmoon", 8.997_011_408_268_049e-10),
    ("mars", 9.549_548_695_622_39e-11),
    ("jupiter", 2.825_345_840_855_05e-7),
    ("saturn", 8.459_706_073_308_477e-8),
    ("uranus", 1.292_024_825_792_65e-8),
    ("neptune", 1.524_359_109_249_74e-8),
];
/// Flattening and radius of the Sun in AU, and where its axis points.
const J2: f64 = 2e-7;
const RADIUS: f64 = 696_000.0 / AU;
const AXIS: [f64; 2] = [286.13, 63.87];
/// Segments of a third of an orbit, d.
const SEGMENT: f64 = 32.0;
const CENTURY: f64 = 36_525.0;

pub fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let csv = words.iter().position(|word| word == "--csv").and_then(|at| words.get(at + 1));
    let files: Vec<&String> = words.iter().filter(|word| *word != "--csv" && Some(*word) != csv).collect();
    let track = match files[..] {
        [] => made()?,
        [file] => read(&std::fs::read_to_string(file)?).map_err(|problem| format!("{file}: {problem}"))?,
        _ => return Err("expected one file".into()),
    };
    if let Some(path) = csv {
        std::fs::write(path, as_csv(&track))?;
    }
    let precession = show(&track)?;
    assert!(!files.is_empty() || (precession[0] - precession[2]).abs() < 0.1, "{precession:?}");
    Ok(())
}

/// The system with values of its parameters.
fn sun(given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
    let system = parse_system(FORM).map_err(|(line, problem)| format!("{line}: {problem}"))?;
    let given: Vec<(String, String)> = given.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    Ok(SystemInstance::new(Cow::Owned(system), &given)?)
}

/// Mercury's positions in AU with the pulls on it, over days from the first row.
pub fn read(text: &str) -> Outcome<RecordedTrajectory> {
    let mut rows = text.lines().enumerate();
    let head: Vec<&str> = rows.next().ok_or("expected a header")?.1.split(',').map(str::trim).collect();
    let column = |name: &str| head.iter().position(|h| *h == name).ok_or_else(|| format!("expected a column {name}"));
    let date = column("jd")?;
    let mut columns = Vec::new();
    for (planet, _) in PLANETS {
        columns.push([
            column(&format!("{planet}_x"))?,
            column(&format!("{planet}_y"))?,
            column(&format!("{planet}_z"))?,
        ]);
    }
    let mut track = empty();
    let mut first = None;
    for (row, line) in rows.filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Result<Vec<f64>, _> = line.split(',').map(|field| field.trim().parse()).collect();
        let fields = fields.map_err(|_| format!("row {}: expected numbers", row + 1))?;
        if fields.len() != head.len() {
            return Err(format!("row {}: expected {} numbers, found {}", row + 1, head.len(), fields.len()).into());
        }
        let places: Vec<Place> = columns.iter().map(|at| at.map(|at| fields[at] / AU)).collect();
        push(&mut track, fields[date] - *first.get_or_insert(fields[date]), places[0], &places[1..]);
    }
    if track.times.is_empty() { Err("no rows below the header".into()) } else { Ok(track) }
}

fn empty() -> RecordedTrajectory {
    RecordedTrajectory { name: "mercury".into(), times: vec![], q: vec![], v: vec![], a: vec![], force: vec![] }
}

fn push(track: &mut RecordedTrajectory, day: f64, mercury: Place, others: &[Place]) {
    track.times.push(day);
    track.q.extend(mercury);
    track.force.extend(pull(mercury, others));
}

/// What moves Mercury about the Sun beside the Sun as a point, AU/d^2: Mercury's own pull on the Sun, the pulls of the other planets less
/// those on the Sun, and the flattening of the Sun.
fn pull(mercury: Place, others: &[Place]) -> Place {
    let [right, up] = AXIS.map(f64::to_radians);
    let axis = [up.cos() * right.cos(), up.cos() * right.sin(), up.sin()];
    let size = |x: Place| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let r = size(mercury);
    let height: f64 = mercury.iter().zip(axis).map(|(x, n)| x * n).sum();
    let flat = -1.5 * J2 * SUN * RADIUS.powi(2) / r.powi(5);
    let mut sum: Place = std::array::from_fn(|i| {
        flat * ((1.0 - 5.0 * (height / r).powi(2)) * mercury[i] + 2.0 * height * axis[i])
            - PLANETS[0].1 * mercury[i] / r.powi(3)
    });
    for ((_, gm), place) in PLANETS[1..].iter().zip(others) {
        let way: Place = std::array::from_fn(|i| place[i] - mercury[i]);
        let (near, far) = (size(way).powi(3), size(*place).powi(3));
        (0..3).for_each(|i| sum[i] += gm * (way[i] / near - place[i] / far));
    }
    sum
}

fn as_csv(track: &RecordedTrajectory) -> String {
    let mut csv = "t,x,y,z,fx,fy,fz\n".to_string();
    for ((t, q), f) in track.times.iter().zip(track.q.chunks(3)).zip(track.force.chunks(3)) {
        // Text grows without fail.
        let _ = writeln!(csv, "{t},{},{},{},{},{},{}", q[0], q[1], q[2], f[0], f[1], f[2]);
    }
    csv
}

fn found(track: &RecordedTrajectory, constants: &[&str], given: &[(&str, f64)]) -> Outcome<Identified> {
    let coordinates = ["x", "y", "z"].map(String::from).to_vec();
    let recording = Recording { coordinates, periodic: vec![false; 3], tracks: vec![track.clone()] };
    let options =
        IdentifyOptions::new().constants(constants.iter().copied()).between(Between::Cubic).segment(SEGMENT).threads(2);
    Ok(identify(&sun(given)?, &recording, &options)?)
}

/// Prints what the orbit says; the precession with its error, and that of Einstein's theory, seconds of arc in a century.
pub fn show(track: &RecordedTrajectory) -> Outcome<[f64; 3]> {
    let both = found(track, &["GM", "beta", "gamma"], &[])?;
    println!(
        "{:.2} years, {} segments of {} d",
        track.times[track.len() - 1] / 365.25,
        both.segments,
        both.segment_seconds
    );
    let values: Vec<[f64; 2]> =
        both.constants.iter().map(|c| [c.value, c.standard_error.unwrap_or(f64::INFINITY)]).collect();
    for (constant, [value, error]) in both.constants.iter().zip(&values) {
        println!("{:6} {value:.9e} +- {error:.1e} {}", constant.symbol, constant.unit);
    }
    let rms = both.residuals.iter().map(|r| r.rms).fold(0.0, f64::max);
    println!("residual {:.2} m, correlation of beta and gamma {:.3}", rms * AU * 1e3, both.correlations.matrix[1][2]);
    // The precession knows beta and gamma in one combination alone.
    let parts = [0.0, -1.0 / 3.0, 2.0 / 3.0];
    let share = (2.0 - values[1][0] + 2.0 * values[2][0]) / 3.0;
    let covariance = |at: usize| both.correlations.matrix[at / 3][at % 3] * values[at / 3][1] * values[at % 3][1];
    let square = (0..9).filter(|at| parts[at / 3] * parts[at % 3] != 0.0);
    let error = square.map(|at| parts[at / 3] * parts[at % 3] * covariance(at)).sum::<f64>().sqrt();
    println!("(2 + 2 gamma - beta)/3 = {share:.6} +- {error:.1e}");
    let radii = || track.q.chunks(3).map(|q| q.iter().map(|x| x * x).sum::<f64>().sqrt());
    let (nearest, farthest) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    let gm = values[0][0];
    let (a, c) = ((nearest + farthest) / 2.0, 299_792.458 * 86_400.0 / AU);
    // a (1 - e^2)
    let parameter = nearest * farthest / a;
    let turns = CENTURY / (2.0 * PI * (a.powi(3) / gm).sqrt());
    let einstein = (6.0 * PI * gm / (c * c * parameter) * turns).to_degrees() * 3600.0;
    let precession = [share, error, 1.0].map(|x| x * einstein);
    println!(
        "precession of the perihelion {:.3} +- {:.3} seconds of arc in a century; Einstein's {einstein:.3}",
        precession[0], precession[1]
    );
    for (free, fixed) in [("beta", "gamma"), ("gamma", "beta")] {
        let one = found(track, &["GM", free], &[(fixed, 1.0)])?;
        let constant = one.constants.iter().find(|c| c.symbol == free).ok_or("no such constant")?;
        let error = constant.standard_error.unwrap_or(f64::INFINITY);
        println!("with {fixed} = 1: {free} {:.6} +- {error:.1e}", constant.value);
    }
    Ok(precession)
}

/// An orbit like Mercury's for five years, every half a day, by Einstein's values, with Venus and Jupiter on circles.
pub fn made() -> Outcome<RecordedTrajectory> {
    let model = sun(&[("GM", SUN), ("beta", 1.0), ("gamma", 1.0)])?.build()?;
    let others = |day: f64| {
        let place = |(radius, period): (f64, f64)| {
            let (sin, cos) = (2.0 * PI * day / period).sin_cos();
            [radius * cos, radius * sin, 0.03 * radius * sin]
        };
        // Those of which nothing is said are too far away to pull.
        let mut places = vec![[1e6, 0.0, 0.0]; PLANETS.len() - 1];
        (places[0], places[3]) = (place((0.723, 224.7)), place((5.2, 4332.6)));
        places
    };
    let pulls = |day: f64, q: &[f64], _: &[f64], force: &mut [f64]| {
        force.copy_from_slice(&pull([q[0], q[1], q[2]], &others(day)));
    };
    let (q, v) = ([0.3075, 0.0, 0.0], [0.0, 0.0338, 0.0041]);
    let options = RolloutOptions::reference(1826.0, 0.5).energy(false);
    let motion = Driven::new(model.as_ref(), &pulls).rollout(&q, &v, &options).complete()?;
    let mut track = empty();
    for (&day, q) in motion.t.iter().zip(motion.q.chunks(3)) {
        push(&mut track, day, [q[0], q[1], q[2]], &others(day));
    }
    Ok(track)
}

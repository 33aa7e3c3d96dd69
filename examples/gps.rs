//! The Earth from orbits of satellites: its mass, its flattening and its turning, from files of final orbits (SP3).
//!
//! `cargo run --release --example gps -- FILE.sp3...` reads files of the International GNSS Service (or any other), positions in the frame
//! that turns with the Earth, and identifies the constants of `examples/systems/earth_orbit.toml` in it: the mass of the Earth, its shape to the
//! second degree, its turning, and where its axis goes through the ground. The pulls of Sun and Moon, whose places are those of the almanac's
//! short series, are known forces. Such orbits were computed with dynamics by those who measured them.
//! `--csv FILE.csv` writes positions and pulls as a recording for `lnn identify`. Without files it makes orbits of its own and compares what it
//! finds with the truth.

use lnn::identification::{Identified, IdentifyOptions, identify};
use lnn::lagrangian::SystemInstance;
use lnn::pipeline::parse_system;
use lnn::random::RngStream;
use lnn::recording::{RecordedTrajectory, Recording};
use lnn::rollout::{RolloutOptions, rollout};
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const FORM: &str = include_str!("systems/earth_orbit.toml");
/// Known values: GM, the gravity field EGM96, and the usual turning. The pole moves from day to day.
const KNOWN: [(&str, f64); 5] = [
    ("GM", 3.986_004_418e14),
    ("J2", 1.082_63e-3),
    ("C22", 1.574_61e-6),
    ("S22", -9.038_0e-7),
    ("Omega", 7.292_115e-5),
];
/// Place of the pole in the orbits that are made here, rad.
const POLE: [(&str, f64); 2] = [("xp", 3e-7), ("yp", 2.3e-6)];

pub fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let csv = words.iter().position(|word| word == "--csv").and_then(|at| words.get(at + 1));
    let files: Vec<&String> = words.iter().filter(|word| *word != "--csv" && Some(*word) != csv).collect();
    if files.is_empty() {
        return made();
    }
    let mut tracks = Vec::new();
    for file in files {
        tracks.extend(read(&std::fs::read_to_string(file)?).map_err(|problem| format!("{file}: {problem}"))?);
    }
    if let Some(path) = csv {
        std::fs::write(path, as_csv(&tracks))?;
    }
    show(&found(tracks)?);
    Ok(())
}

/// The system with values of its parameters.
fn earth(given: &[(&str, f64)]) -> Outcome<SystemInstance<f64>> {
    let system = parse_system(FORM).map_err(|(line, problem)| format!("{line}: {problem}"))?;
    let given: Vec<(String, String)> = given.iter().map(|(name, x)| (name.to_string(), x.to_string())).collect();
    Ok(SystemInstance::new(Cow::Owned(system), &given)?)
}

/// The positions of a file, one trajectory for each satellite: m, in s from midnight of the first day.
pub fn read(text: &str) -> Outcome<Vec<RecordedTrajectory>> {
    let mut tracks: BTreeMap<String, RecordedTrajectory> = BTreeMap::new();
    let (mut time, mut first_day) = (None, None);
    for (row, line) in text.lines().enumerate() {
        let wrong = |what: &str| format!("row {}: expected {what}", row + 1);
        if let Some(epoch) = line.strip_prefix("* ") {
            let fields: Vec<f64> = epoch.split_whitespace().filter_map(|field| field.parse().ok()).collect();
            let [year, month, day, hour, minute, second] = fields[..] else {
                return Err(wrong("year, month, day, hour, minute and second").into());
            };
            let day = days(year as i64, month as i64, day as i64);
            let first = *first_day.get_or_insert(day);
            time = Some((day - first) as f64 * 86_400.0 + hour * 3600.0 + minute * 60.0 + second);
        } else if let Some(rest) = line.strip_prefix('P') {
            let number = |at: usize| -> Outcome<f64> {
                let field =
                    rest.get(3 + 14 * at..17 + 14 * at).ok_or_else(|| wrong("three positions of 14 columns"))?;
                Ok(1e3 * field.trim().parse::<f64>().map_err(|_| wrong("a number"))?)
            };
            let name = rest.get(..3).ok_or_else(|| wrong("the name of a satellite"))?.to_string();
            let position = [number(0)?, number(1)?, number(2)?];
            if position == [0.0; 3] {
                continue; // the format's way to say that there is none
            }
            let empty = RecordedTrajectory {
                name: name.clone(),
                times: vec![],
                q: vec![],
                v: vec![],
                a: vec![],
                force: vec![],
            };
            let track = tracks.entry(name).or_insert(empty);
            track.times.push(time.ok_or_else(|| wrong("a line with the time before it"))?);
            let days = track.times[track.times.len() - 1] / 86_400.0 + first_day.unwrap_or(0) as f64;
            track.q.extend(position);
            track.force.extend(pull(days - days_before(), position));
        }
    }
    Ok(tracks.into_values().collect())
}

/// Days since 1 March of the year 0.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month < 3 { (year - 1, month + 9) } else { (year, month - 3) };
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day
}

/// Days from 1 March of the year 0 to noon of 1 January 2000.
fn days_before() -> f64 {
    days(2000, 1, 1) as f64 + 0.5
}

/// Pull of Sun and Moon on 1 kg at a place that turns with the Earth, less that on the Earth itself, N; `n` days after noon of
/// 1 January 2000. Their places are those of the short series of the Astronomical Almanac, good to 0.01 and 0.3 degrees.
fn pull(n: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let centuries = n / 36_525.0;
    let sin = |(at, rate): (f64, f64)| (at + rate * centuries).to_radians().sin();
    let cos = |(at, rate): (f64, f64)| (at + rate * centuries).to_radians().cos();
    let tilt = (23.439 - 4e-7 * n).to_radians();
    let anomaly = (357.528 + 0.985_600_3 * n).to_radians();
    let longitude = 280.460 + 0.985_647_4 * n + 1.915 * anomaly.sin() + 0.020 * (2.0 * anomaly).sin();
    let sun = (longitude.to_radians(), 0.0, 1.495_978_707e11 * (1.000_14 - 0.016_71 * anomaly.cos()));
    let longitude = 218.32 + 481_267.881 * centuries + 6.29 * sin((135.0, 477_198.87))
        - 1.27 * sin((259.3, -413_335.36))
        + 0.66 * sin((235.7, 890_534.22))
        + 0.21 * sin((269.9, 954_397.74))
        - 0.19 * sin((357.5, 35_999.05))
        - 0.11 * sin((186.5, 966_404.03));
    let latitude = 5.13 * sin((93.3, 483_202.02)) + 0.28 * sin((228.2, 960_400.89))
        - 0.28 * sin((318.3, 6_003.15))
        - 0.17 * sin((217.6, -407_332.21));
    let parallax = 0.9508
        + 0.0518 * cos((135.0, 477_198.87))
        + 0.0095 * cos((259.3, -413_335.36))
        + 0.0078 * cos((235.7, 890_534.22))
        + 0.0028 * cos((269.9, 954_397.74));
    let moon = (longitude.to_radians(), latitude.to_radians(), 6_378_137.0 / parallax.to_radians().sin());
    // The angle by which the Earth has turned.
    let (turned_sin, turned_cos) = (280.460_618_37 + 360.985_647_366_29 * n).to_radians().sin_cos();
    let mut sum = [0.0; 3];
    for ((longitude, latitude, distance), gm) in [(sun, 1.327_124_4e20), (moon, 4.902_8e12)] {
        let flat = [latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin()];
        let (e, c, s) =
            (flat[0], tilt.cos() * flat[1] - tilt.sin() * flat[2], tilt.sin() * flat[1] + tilt.cos() * flat[2]);
        let body = [turned_cos * e + turned_sin * c, turned_cos * c - turned_sin * e, s].map(|x| distance * x);
        let way = [body[0] - x, body[1] - y, body[2] - z];
        let cube = way.iter().map(|w| w * w).sum::<f64>().sqrt().powi(3);
        for i in 0..3 {
            sum[i] += gm * (way[i] / cube - body[i] / distance.powi(3));
        }
    }
    sum
}

fn as_csv(tracks: &[RecordedTrajectory]) -> String {
    let mut csv = "satellite,t,x,y,z,fx,fy,fz\n".to_string();
    for track in tracks {
        for ((t, q), f) in track.times.iter().zip(track.q.chunks(3)).zip(track.force.chunks(3)) {
            // Text grows without fail.
            let _ = writeln!(csv, "{},{t},{},{},{},{},{},{}", track.name, q[0], q[1], q[2], f[0], f[1], f[2]);
        }
    }
    csv
}

fn found(tracks: Vec<RecordedTrajectory>) -> Outcome<Identified> {
    let coordinates = ["x", "y", "z"].map(String::from).to_vec();
    let recording = Recording { coordinates, periodic: vec![false; 3], tracks };
    Ok(identify(&earth(&[])?, &recording, &IdentifyOptions::new().threads(2))?)
}

fn show(found: &Identified) {
    for constant in &found.constants {
        let error = constant.standard_error.unwrap_or(f64::NAN);
        let known = KNOWN.iter().find(|(name, _)| *name == constant.symbol);
        let beside = match (known, constant.unit.as_str()) {
            (Some((_, known)), _) => format!(", {:+.1e} of the known value from it", constant.value / known - 1.0),
            (None, "rad") => {
                let seconds = |x: f64| x.to_degrees() * 3600.0;
                format!(", {:.4} +- {:.4} seconds of arc", seconds(constant.value), seconds(error))
            }
            _ => String::new(),
        };
        println!("{:6} {:.9e} +- {error:.1e} {}{beside}", constant.symbol, constant.value, constant.unit);
    }
    let rms = found.residuals.iter().map(|r| r.rms).fold(0.0, f64::max);
    println!("{} segments of {} s, residual {rms:.3} m", found.segments, found.segment_seconds);
}

/// Three satellites for a day, every 15 minutes, to 5 cm.
pub fn made() -> Outcome<()> {
    let truth = [&KNOWN[..], &POLE].concat();
    let known = |symbol: &str| truth.iter().find(|(name, _)| *name == symbol).map_or(f64::NAN, |(_, x)| *x);
    let (gm, turning) = (known("GM"), known("Omega"));
    let model = earth(&truth)?.build()?;
    let mut rng = RngStream::Trajectories.generator(0);
    let mut tracks = Vec::new();
    for k in 0..3 {
        // Circles of 26,560 km, 55 degrees from the equator, seen from the turning Earth.
        let (radius, tilt) = (2.656e7, 55.0_f64.to_radians());
        let speed = (gm / radius).sqrt();
        let (node, phase) = (f64::from(k) * 1.05, f64::from(k) * 0.7);
        let place = |x: f64, y: f64| {
            let (y, z) = (y * tilt.cos(), y * tilt.sin());
            [x * node.cos() - y * node.sin(), x * node.sin() + y * node.cos(), z]
        };
        let q = place(radius * phase.cos(), radius * phase.sin());
        let mut v = place(-speed * phase.sin(), speed * phase.cos());
        (v[0], v[1]) = (v[0] + turning * q[1], v[1] - turning * q[0]);
        let options = RolloutOptions::reference(85_500.0, 900.0).energy(false);
        let motion = rollout(model.as_ref(), &q, &v, &options).complete()?;
        let q = motion.q.iter().map(|q| q + 0.05 * Distribution::<f64>::sample(&StandardNormal, &mut rng)).collect();
        tracks.push(RecordedTrajectory {
            name: format!("G{k:02}"),
            times: motion.t,
            q,
            v: vec![],
            a: vec![],
            force: vec![],
        });
    }
    let found = found(tracks)?;
    show(&found);
    for constant in &found.constants {
        let (truth, error) = (known(&constant.symbol), constant.standard_error.ok_or("not determined")?);
        // The small ones are known to some hundredths.
        let most = if truth.abs() < 1e-5 { 0.1 } else { 1e-4 };
        assert!((constant.value - truth).abs() < 4.0 * error && error < most * truth.abs(), "{constant:?}");
    }
    Ok(())
}

//! Recorded rows read and surveyed as `lnn check FILE --coords q1,q2` does: seconds, and the memory that it took.

use lnn::random::RngStream;
use lnn::recording::{Columns, LoadedRecording, Survey, SurveyOptions, survey};
use rand_distr::{Distribution, StandardNormal};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Instant;

/// Samples per second.
const RATE: f64 = 100.0;
/// Noise of both coordinates, in rad.
const NOISE: f64 = 1e-3;

/// One trajectory of two coordinates that swing, columns `t,q1,q2` with six decimals.
fn write(path: &Path, rows: usize) -> std::io::Result<()> {
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    let mut rng = RngStream::Training(0).generator(0);
    let mut noise = || NOISE * Distribution::<f64>::sample(&StandardNormal, &mut rng);
    writeln!(file, "t,q1,q2")?;
    for k in 0..rows {
        let t = k as f64 / RATE;
        let (q1, q2) = ((3.0 * t).sin() + noise(), 0.5 * (5.0 * t).cos() + 0.1 * (7.0 * t).sin() + noise());
        writeln!(file, "{t:.6},{q1:.6},{q2:.6}")?;
    }
    file.flush()
}

/// Most memory that this process had in RAM so far, in MB of 1000 kB, where Linux tells.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kibibytes * 1.024e-3)
}

/// Writes `rows` rows into a file, reads and surveys them, prints what it took and removes the file.
pub fn time(path: &Path, rows: usize) -> Survey {
    write(path, rows).expect("room for the rows");
    let size = std::fs::metadata(path).expect("the file is there").len() as f64 / 1e6;
    let memory = || peak().map_or("unknown".to_string(), |megabytes| format!("{megabytes:.0} MB"));
    let before = memory();
    let start = Instant::now();
    let columns = Columns { coords: ["q1", "q2"].map(String::from).to_vec(), ..Columns::default() };
    let reading = LoadedRecording::read(&[path], &columns).expect("the rows just written");
    let read = start.elapsed().as_secs_f64();
    let found = survey(&reading, &SurveyOptions::default()).expect("a trajectory long enough");
    let all = start.elapsed().as_secs_f64();
    println!(
        "{rows} rows of {size:.0} MB: {read:.2} s to read, {:.2} s to survey, {all:.2} s in all; peak memory {} ({before} before)",
        all - read,
        memory()
    );
    std::fs::remove_file(path).expect("the file is there");
    found
}

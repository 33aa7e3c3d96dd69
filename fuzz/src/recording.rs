//! Any bytes as a file of recorded motion, CSV, XLSX, NPY or NPZ: refused with an error of one line, or trajectories of finite
//! numbers at increasing times.

use lnn::recording::{Columns, LoadedRecording};
use std::path::PathBuf;

/// Reads the bytes as columns with names, by number, with everything that can be asked for, and as trajectories side by side.
pub fn run(bytes: &[u8]) {
    let path = std::env::temp_dir().join(format!("lnn-recording-{}", std::process::id()));
    std::fs::write(&path, bytes).expect("room for a small file");
    let list = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
    let named = Columns { coords: list(&["x"]), periodic: list(&["x"]), ..Columns::default() };
    let numbered = Columns { coords: list(&["1", "2"]), rate: Some(100.0), ..Columns::default() };
    let full = Columns {
        coords: list(&["x"]),
        velocity: list(&["v"]),
        time: Some("t".to_string()),
        trajectory: Some("run".to_string()),
        units: vec![("x".to_string(), "deg".to_string())],
        ..Columns::default()
    };
    let wide = Columns { wide: true, ..named.clone() };
    // Readings may be missing, and whatever else is measured is an input.
    let whole =
        Columns { whole: true, coords: list(&["x", "v"]), input: list(&["t"]), rate: Some(10.0), ..Columns::default() };
    for columns in [named, numbered, full, wide, whole] {
        read(&path, &columns);
    }
}

fn read(path: &PathBuf, columns: &Columns) {
    let reading = match LoadedRecording::read(&[path], columns) {
        Ok(reading) => reading,
        Err(error) => return assert_eq!(error.to_string().lines().count(), 1, "{error:?}"),
    };
    let recording = &reading.recording;
    assert!(!recording.tracks.is_empty());
    assert_eq!(recording.tracks.len(), reading.rows.len());
    let marked = reading.missing.iter().zip(&recording.tracks);
    assert!(marked.clone().all(|(missing, track)| missing.is_empty() || missing.len() == track.q.len()));
    assert!(reading.inputs.iter().zip(&recording.tracks).all(|(own, track)| own.len() == track.len()));
    for (track, rows) in recording.tracks.iter().zip(&reading.rows) {
        match columns.whole {
            true => track.validate_repeated(recording.n()),
            false => track.validate(recording.n()),
        }
        .expect("what was read makes sense");
        assert!((1..track.len()).all(|k| rows.row(k) > rows.row(k - 1)));
    }
}

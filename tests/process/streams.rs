//! Motion of any length is written and read in the memory of what is kept of it.

use crate::alone;
use crate::counting::peak;
use lnn::lagrangian::SystemInstance;
use lnn::recording::{Columns, LoadedRecording};
use lnn::rollout::{RolloutOptions, rollout_in_pieces};
use lnn::storage::{AtomicWriter, Disk};
use std::ffi::OsString;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const MODEL: &str =
    concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/examples/data/double_pendulum.safetensors");

#[test]
fn a_rollout_takes_the_same_memory_however_long_it_is() {
    if !alone("streams::a_rollout_takes_the_same_memory_however_long_it_is") {
        return;
    }
    let system = SystemInstance::<f64>::named("double-pendulum", &[]).unwrap().build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("motion.csv");
    let taken = |dt: f64| {
        let mut samples = 0;
        let bytes = peak(|| {
            let mut file = AtomicWriter::create(&Disk, &out).unwrap();
            let options = RolloutOptions::new(10.0, dt);
            let ending = rollout_in_pieces(&*system, &[0.1, 0.1], &[0.0, 0.0], &options, &mut |piece| {
                file.append(piece.csv_rows().as_bytes()).unwrap();
                ControlFlow::Continue(())
            });
            file.finish().unwrap();
            samples = ending.samples;
        });
        (samples, bytes)
    };
    let ((few, short), (many, long)) = (taken(0.01), taken(0.00005));
    println!("{few} samples: {short} bytes, {many} samples: {long} bytes");
    assert_eq!((few, many), (1001, 200_001));
    assert!(long <= short + (16 << 10) && long < 1 << 20, "{short} and {long} bytes");

    // The program, its model included.
    let csv = out.to_str().unwrap();
    let line = [
        "lnn",
        "rollout",
        MODEL,
        "--state",
        "0.1,0.1,0,0",
        "--t-end",
        "10",
        "--dt",
        "0.00005",
        "--out",
        csv,
        "--overwrite",
    ];
    let arguments: Vec<OsString> = line.iter().map(OsString::from).collect();
    let bytes = peak(|| assert_eq!(lnn_cli::main(arguments), ExitCode::SUCCESS));
    let size = std::fs::metadata(&out).unwrap().len() as usize;
    println!("program: {bytes} bytes for a file of {size}");
    assert!(3 * bytes < size, "{bytes} bytes for a file of {size}");
}

/// A vector of NumPy's format.
fn vector(numbers: impl ExactSizeIterator<Item = f64>, said: usize) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({said},), }}\n");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    let mut bytes = [b"\x93NUMPY\x01\x00", length.as_slice(), header.as_bytes()].concat();
    numbers.for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

fn archive(path: &Path, arrays: &[(&str, Vec<u8>)]) {
    let mut writer = ZipWriter::new(std::fs::File::create(path).unwrap());
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, content) in arrays {
        writer.start_file(*name, options).unwrap();
        writer.write_all(content).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn an_archive_is_read_in_the_memory_of_its_numbers() {
    if !alone("streams::an_archive_is_read_in_the_memory_of_its_numbers") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.npz");
    let columns = Columns { coords: vec!["q".to_string()], ..Columns::default() };
    const ROWS: usize = 500_000;
    let time = || vector((0..ROWS).map(|k| k as f64 / 100.0), ROWS);
    let wave = vector((0..ROWS).map(|k| (k as f64 / 30.0).sin()), ROWS);
    archive(&path, &[("t.npy", time()), ("q.npy", wave)]);
    let taken = peak(|| assert_eq!(LoadedRecording::read(&[&path], &columns).unwrap().recording.samples(), ROWS));
    let numbers = 2 * 8 * ROWS;
    println!("{numbers} bytes of numbers: {taken} bytes");
    assert!(taken < numbers + numbers / 4 + (1 << 20), "{taken} bytes");

    // 80 MB of zeros in 80 kB, and a shape that is not that of the other: refused before a number is unpacked.
    let rate = |name: &str| Columns { coords: vec![name.to_string()], rate: Some(1.0), ..Columns::default() };
    let zeros = || vector((0..10_000_000).map(|_| 0.0), 10_000_000);
    let longer = vector((0..ROWS + 1).map(|k| (k as f64).sqrt()), ROWS + 1);
    for (first, second, columns, problem) in [
        (zeros(), longer.clone(), rate("a"), "more than 100 times as many"),
        (time(), longer, Columns { time: Some("a".to_string()), ..rate("b") }, "expected 500000 as in array a"),
    ] {
        let columns = if columns.time.is_some() { Columns { rate: None, ..columns } } else { columns };
        archive(&path, &[("a.npy", first), ("b.npy", second)]);
        let taken = peak(|| {
            let refusal = LoadedRecording::read(&[&path], &columns).unwrap_err().to_string();
            assert!(refusal.contains(problem), "{refusal}");
        });
        assert!(taken < 1 << 20, "{problem}: {taken} bytes");
    }
    // A table that promises a terabyte.
    let table = folder.path().join("motion.npy");
    std::fs::write(&table, vector([1.0, 2.0].into_iter(), 1 << 37)).unwrap();
    let taken = peak(|| assert!(LoadedRecording::read(&[&table], &rate("1")).is_err()));
    assert!(taken < 1 << 20, "{taken} bytes");
}

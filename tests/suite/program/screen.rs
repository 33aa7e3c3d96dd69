//! What stands on the screen: lines that a terminal holds, headers with units, numbers that a person reads.

use super::fit::swings;
use crate::common::damped;
use crate::running::{Folder, Run, command, lnn};
use lnn_cli::check_arguments;
use std::ffi::OsString;
use std::fs;
use std::path::Path;

/// Columns of a terminal.
const COLUMNS: usize = 120;
/// Headers of columns that are names, counts or words.
const WITHOUT_UNIT: [&str; 20] = [
    "acceleration of",
    "coordinate",
    "determined",
    "experiment",
    "failed",
    "given up",
    "integrated",
    "quantity",
    "by",
    "against",
    "remarks",
    "row",
    "rows",
    "run",
    "runs",
    "samples",
    "samples in it",
    "smoothing",
    "start",
    "trajectory",
];
/// The same where the text names a unit or is one.
const UNITS: [&str; 3] = ["unit", "windows", "suspicious"];

/// Headers in one line: pieces between two blanks and more.
fn headers(line: &str) -> Vec<&str> {
    line.split("  ").map(str::trim).filter(|header| !header.is_empty()).collect()
}

/// Checks what a run printed, and counts its tables.
fn readable(name: &str, run: &Run) -> usize {
    let mut tables = 0;
    let lines: Vec<&str> = run.stdout.lines().collect();
    for (k, line) in lines.iter().enumerate() {
        // A command to paste is one line.
        let wide = line.chars().count() > COLUMNS && !line.starts_with("  lnn ");
        assert!(!wide, "{name}: {} columns: {line}", line.chars().count());
        if line.len() > 4 && line.chars().all(|c| c == '-') {
            tables += 1;
            // Of a header in several lines the last one has the units of what it names.
            let several = k > 1 && lines[k - 2].starts_with("  ") && headers(lines[k - 1]).len() > 2;
            for header in headers(lines[k - 1]) {
                let known = WITHOUT_UNIT.contains(&header) || UNITS.contains(&header) || header.ends_with(']');
                assert!(known || several, "{name}: the column {header:?} has no unit");
            }
        }
        for word in line.split_whitespace() {
            let word = word.trim_matches(|c: char| !c.is_ascii_digit());
            let exponent = word.rsplit_once('e').filter(|_| word.parse::<f64>().is_ok());
            let small = exponent.is_some_and(|(_, e)| e.parse::<i32>().is_ok_and(|e| (-4..6).contains(&e)));
            assert!(!small, "{name}: {word} in {line}");
        }
    }
    // An error or a remark is one line, however long.
    let said = run.stderr.lines().filter(|line| !["note: ", "error: "].iter().any(|begin| line.starts_with(begin)));
    for line in said {
        assert!(line.chars().count() <= COLUMNS, "{name}: {} columns: {line}", line.chars().count());
    }
    tables
}

#[test]
fn lines_fit_headers_have_units_and_numbers_are_plain() {
    let folder = Folder::new();
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("examples/data");
    for file in ["double_pendulum.safetensors", "double_pendulum.toml"] {
        fs::copy(data.join(file), folder.path(file)).unwrap();
    }
    folder.file("swings.csv", swings(&damped::chain(2), 8, 2.0, 1e-3));
    // One sample is wrong, and the path is long.
    let mut rows: Vec<String> =
        fs::read_to_string(data.join("pendulum.csv")).unwrap().lines().map(Into::into).collect();
    let mut fields: Vec<&str> = rows[100].split(',').collect();
    fields[2] = "9.5";
    rows[100] = fields.join(",");
    let long = "a_recording_of_a_pendulum_with_one_wrong_sample_in_a_file_whose_name_nobody_would_want_to_type.csv";
    folder.file(long, rows.join("\n") + "\n");
    let pendulum = "--coords theta1,theta2 --periodic theta1,theta2 --trajectory run";
    let swings = "--coords upper,lower --periodic upper,lower --trajectory run";
    let small = "--hidden 8 --epochs 2 --shooting-epochs 1";
    let commands: [(String, usize); 10] = [
        ("systems".into(), 0),
        (format!("check {long} {pendulum}"), 4),
        (format!("check swings.csv {swings}"), 3),
        ("train double-pendulum --config double_pendulum.toml --epochs 1 --out trained".into(), 3),
        ("train ads4-geodesic --config ads.toml --out ads".into(), 3),
        // Models this small state no ranges.
        (format!("fit {long} {pendulum} {small} --friction --out fitted"), 2),
        (format!("fit swings.csv {swings} --hidden 8 --epochs 2 --targets smoothed --hold-out 0 --out all"), 1),
        ("evaluate double_pendulum.safetensors --until 3 --out evaluation".into(), 3),
        ("sweep small.toml --vary seed=1,2 --out sweep".into(), 2),
        ("rollout fitted --state 0.5,0.2,0,0 --t-end 2 --dt 0.1 --out motion.csv --beyond-range".into(), 0),
    ];
    let config = lnn(&["train", "ads4-geodesic", "--print-config", "--hidden", "8", "--epochs", "1"]).stdout;
    let few = |line: &str| match line.split_once(" = ") {
        Some((key @ ("training" | "validation" | "test"), _)) => format!("{key} = 512\n"),
        _ => format!("{line}\n"),
    };
    folder.file("ads.toml", config.lines().map(few).collect::<String>());
    let training =
        "[data]\ntraining = 128\nvalidation = 64\ntest = 64\n[[phase]]\nepochs = 2\n[network]\nhidden = [4]\n";
    folder.file("small.toml", format!("system = \"harmonic-oscillator\"\n{training}"));
    for (line, tables) in &commands {
        let words: Vec<&str> = line.split_whitespace().collect();
        let run = Run::of(command(&words).current_dir(folder.0.path()));
        assert_eq!(run.code, Some(0), "{line}: {}", run.stderr);
        let found = readable(line, &run);
        assert!(found >= *tables, "{line}: {found} tables, expected {tables}\n{}", run.stdout);
    }
}

/// Help is as wide as a terminal, and begins with what most people want to do, in lines that the program understands.
#[test]
fn help_is_narrow_and_shows_how_to_begin() {
    let commands = ["systems", "check", "train", "fit", "rollout", "evaluate", "sweep", "inspect", "man"];
    for name in commands {
        readable(name, &lnn(&[name, "--help"]));
        readable(name, &lnn(&[name, "-h"]));
    }
    let (without, help) = (lnn(&[]), lnn(&["--help"]));
    assert_eq!((without.code, help.code, without.stderr.as_str()), (Some(2), Some(0), help.stdout.as_str()));
    readable("--help", &help);
    let mut seen = Vec::new();
    for line in help.stdout.lines().filter_map(|line| line.strip_prefix("  lnn ")) {
        for part in format!("lnn {line}").split(" && ") {
            let words = part.split_whitespace().map(OsString::from);
            check_arguments(words).unwrap_or_else(|e| panic!("{part}: {e}"));
            seen.push(part.split_whitespace().nth(1).unwrap().to_string());
        }
    }
    assert_eq!(seen, ["train", "check", "fit", "rollout"]);
    assert!(help.stdout.find("lnn train").unwrap() < help.stdout.find("Commands:").unwrap());
}

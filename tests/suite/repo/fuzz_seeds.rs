//! Every fuzz target on its committed seeds and on mutations of them, the same ones in every run.
#![cfg(unix)]

// The library of the targets, compiled as a part of this test: the fuzzing engine is not needed.
#[path = "../../../fuzz/src/lib.rs"]
mod targets;

use std::path::Path;
use targets::bytes::Random;

/// The seeds of a target, by name of the file.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("fuzz/corpus").join(target);
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{} is empty", folder.display());
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}

/// One to four changes: a flipped bit, another byte, a cut, a repetition, a piece of another seed; or of its lines or words.
fn mutated(seeds: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..=random.below(4) {
        let other = &seeds[random.below(seeds.len())];
        match random.below(10) {
            0 => bytes = moved(&bytes, other, random, |byte| byte == b'\n'),
            1 | 2 => bytes = moved(&bytes, other, random, |byte| !byte.is_ascii_alphanumeric() && byte != b'_'),
            _ => {}
        }
        let at = random.below(bytes.len() + 1);
        let length = random.below(16.min(bytes.len() - at) + 1);
        match random.below(5) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            1 if at < bytes.len() => bytes[at] = random.bits() as u8,
            2 => drop(bytes.drain(at..at + length)),
            3 => bytes.splice(at..at, bytes[at..at + length].to_vec()).for_each(drop),
            _ => {
                let from = random.below(other.len() + 1);
                let piece = &other[from..(from + 16).min(other.len())];
                bytes.splice(at..at, piece.iter().copied()).for_each(drop);
            }
        }
    }
    bytes
}

/// A part between separators, a line or a word, left out, twice, or in the place of another one; the new one from a second text.
fn moved(bytes: &[u8], other: &[u8], random: &mut Random, separates: fn(u8) -> bool) -> Vec<u8> {
    let parts =
        |bytes: &[u8]| bytes.chunk_by(|a, b| separates(*a) == separates(*b)).map(<[u8]>::to_vec).collect::<Vec<_>>();
    let (mut own, others) = (parts(bytes), parts(other));
    if own.is_empty() || others.is_empty() {
        return bytes.to_vec();
    }
    let at = random.below(own.len());
    match random.below(4) {
        0 => drop(own.remove(at)),
        1 => own.insert(at, own[at].clone()),
        2 => own[at] = others[random.below(others.len())].clone(),
        _ => {
            let with = random.below(own.len());
            own.swap(at, with);
        }
    }
    own.concat()
}

fn try_target(name: &str, mutations: usize, run: fn(&[u8])) {
    let seeds = seeds(name);
    seeds.iter().for_each(|seed| run(seed));
    let mut random = Random(1);
    for _ in 0..mutations {
        run(&mutated(&seeds, &mut random));
    }
}

#[test]
fn model_file() {
    try_target("model_file", 5000, targets::model_file::run);
}

#[test]
fn checkpoint() {
    try_target("checkpoint", 3000, targets::checkpoint::run);
}

#[test]
fn states_csv() {
    try_target("states_csv", 5000, targets::states_csv::run);
}

#[test]
fn recording() {
    try_target("recording", 2000, targets::recording::run);
}

#[test]
fn config() {
    try_target("config", 3000, targets::config::run);
}

#[test]
fn command_line() {
    try_target("command_line", 2000, targets::command_line::run);
}

#[test]
fn program() {
    try_target("program", 1000, targets::program::run);
}

#[test]
fn linalg() {
    try_target("linalg", 2000, targets::linalg::run);
}

#[test]
fn network() {
    try_target("network", 1000, targets::network::run);
}

#[test]
fn system_file() {
    try_target("system_file", 2000, targets::system_file::run);
}

#[test]
fn robot_file() {
    try_target("robot_file", 1000, targets::robot_file::run);
}

#[test]
fn fit_config() {
    try_target("fit_config", 2000, targets::fit_config::run);
}

#[test]
fn record() {
    try_target("record", 2000, targets::record::run);
}

#[test]
fn identified() {
    try_target("identified", 1000, targets::identified::run);
}

#[test]
fn formula_file() {
    try_target("formula_file", 60, targets::formula_file::run);
}

#[test]
fn page() {
    try_target("page", 30, targets::page::run);
}

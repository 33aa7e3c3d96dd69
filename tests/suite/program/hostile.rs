//! Hostile input from outside: every refusal is one line that names the file and what is wrong, with the documented
//! exit code, in bounded time and memory, and leaves no file behind.
//!
//! What each kind of failure and abuse is held by (paths of tests are `file::test`; without a file, here):
//!
//! | case | held by |
//! |---|---|
//! | a model cut off anywhere, any flipped bit | `network::file::tests::every_prefix_and_every_flipped_bit_is_refused`; `damaged_models_are_refused` for the program |
//! | trailing bytes, holes and overlaps of tensors | `containers_that_lie_are_refused` |
//! | length of the description 2^63, gigabytes, deep JSON | `containers_that_lie_are_refused`, `storage::container::tests` |
//! | tiny file, huge shape | `claims_cost_nothing` |
//! | duplicate keys, duplicate tensors | `containers_that_lie_are_refused`, `network::file::tests::foreign_newer_and_ambiguous_files_are_named` |
//! | NaN and infinity in weights | `weights_and_versions_are_checked` |
//! | code in a file | impossible: numbers and one JSON object; unknown tensors and keys are refused (`network::file::tests::tensors_that_do_not_fit_are_named`, `claims_of_the_description_are_checked`) |
//! | newer version, other number type, foreign safetensors | `weights_and_versions_are_checked`, `inspect::files_that_are_no_models_are_data_errors` |
//! | CSV: nan, inf, 1e999, empty field | `cli::states::tests::fields_are_checked`, `inspect::bad_states_are_data_errors`, `states_are_placed_by_row_and_column` |
//! | CSV: ragged, header missing, BOM, CRLF, semicolons, no row, one row | the same |
//! | recorded motion: all of this, gaps, duplicates, NPY and NPZ | `check::bad_files_are_refused`, `recording::read::tests` |
//! | sizes 0, 1, 2^40; widths beyond the memory | `sizes_are_refused_before_anything_is_allocated`, `claims_cost_nothing` |
//! | batch 0, -1; rate NaN, negative, 0; dt 0; t infinite | `configurations_are_placed`, `numbers_of_the_command_line_have_ranges`, `train::wrong_trainings_are_refused_before_anything_is_written` |
//! | configuration: typo, duplicate, wrong type | `configurations_are_placed`, `cli::config::tests` |
//! | disk full, I/O errors, short and interrupted writes | `faults`: every operation fails once, and for good; `resume::full_disks_and_lost_directories_are_named`; `inspect::devices_closed_pipes_and_full_disks_end_quietly_or_with_a_line` for standard output |
//! | kill -9 at any moment | `kills::twenty_kills` (200 by `cargo test --test process kills -- --ignored`), `faults::a_checkpoint_is_the_old_one_or_the_new_one` |
//! | read-only directory, directory as target, no parent | `targets_that_cannot_be_written_are_named`, `train::directories_that_cannot_be_written_are_named_before_training` |
//! | Ctrl-C, once and twice | `train::ctrl_c_keeps_the_best_model`, `resume::a_second_ctrl_c_ends_at_once` |
//! | SIGTERM; pictures that do not fit on the disk | `signals` |
//! | an output that is an input, or there already | `overwrite`, `cli::files::tests`, `cli::place::tests` |
//! | names that lead out of their directory | `cli::plain_name::tests`, `fit::what_cannot_be_learned_from_is_named` |
//! | a fit stopped or killed | `fit_resume`, `kills::ten_kills_of_a_fit` |
//! | reader of a pipe gone | `pipes` |
//! | two runs, one directory | `cli::folder::tests::one_run_at_a_time`, `resume::a_directory_has_one_run_and_outlives_a_dead_one` |
//! | loss NaN, singular mass matrix in training | `training::one_number_that_is_not_finite_is_named_and_never_reaches_the_weights`, `a_singular_mass_matrix_stops_or_is_left_out_by_choice` |
//! | resume under another configuration or other data | `checkpoints::other_configurations_data_and_networks_are_refused`, `resume::a_training_stopped_in_the_middle_comes_to_the_same_end` |
//! | training that does not fit into memory | `resume::work_that_does_not_fit_into_memory_is_refused`, `memory` |
//! | roll-out leaves its domain | `train::a_model_moves_and_is_judged` |
//! | symbolic link, FIFO, /dev/zero, directory as input | `only_regular_files_are_read` |
//!
//! The fuzz targets (`fuzz/`) go further with the same readers.
#![cfg(unix)]

use crate::running::{Folder, HEADER, Run, command, inspect, lnn, model, text};
use lnn::lagrangian::SystemInstance;
use lnn::network::ModelFile;
use lnn::presets::Preset;
use std::fs;
use std::process::Command;

/// Looks at a state through a model.
fn through(model: &str, states: &str) -> Run {
    lnn(&["inspect", "--model", model, "--states", states])
}

fn one_state(folder: &Folder) -> String {
    folder.file("s.csv", format!("{HEADER}0.1,0.2,3,4\n"))
}

/// A container of tensors: the text of its description, then the numbers.
fn container(description: &str, payload: &[u8]) -> Vec<u8> {
    [&(description.len() as u64).to_le_bytes()[..], description.as_bytes(), payload].concat()
}

/// Description and numbers of a container.
fn taken_apart(bytes: &[u8]) -> (String, Vec<u8>) {
    let length = u64::from_le_bytes(*bytes.first_chunk().unwrap()) as usize;
    (String::from_utf8(bytes[8..8 + length].to_vec()).unwrap(), bytes[8 + length..].to_vec())
}

/// The small model with another description or other numbers and a checksum that fits.
fn forged(change: impl FnOnce(&mut String, &mut Vec<u8>)) -> Vec<u8> {
    let (description, mut payload) = taken_apart(&model().to_bytes().unwrap());
    let mut description: serde_json::Value = serde_json::from_str(&description).unwrap();
    let about = description["__metadata__"]["lnn"].as_str().unwrap();
    let mut body = about[..about.rfind(",\"checksum\"").unwrap()].to_string();
    change(&mut body, &mut payload);
    let mut checksum = crc32fast::Hasher::new();
    checksum.update(body.as_bytes());
    checksum.update(&payload);
    let about = format!("{body},\"checksum\":\"{:08x}\"}}", checksum.finalize());
    description["__metadata__"]["lnn"] = about.into();
    container(&description.to_string(), &payload)
}

#[test]
fn damaged_models_are_refused() {
    let folder = Folder::new();
    let states = one_state(&folder);
    let bytes = model().to_bytes().unwrap();
    let good = folder.file("m", &bytes);
    assert_eq!(through(&good, &states).objects().len(), 1);
    // The reader's own tests take every prefix and every bit; the program takes some of each part of the file.
    for length in (0..bytes.len()).step_by(bytes.len() / 24).chain([7, 8, 9, bytes.len() - 1]) {
        through(&folder.file("m", &bytes[..length]), &states).refused(1, &["/m: "]);
    }
    for bit in (0..8 * bytes.len()).step_by(bytes.len() / 3 + 1) {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        through(&folder.file("m", flipped), &states).refused(1, &["/m: "]);
    }
    assert_eq!(folder.names(), ["m", "s.csv"]);
}

#[test]
fn containers_that_lie_are_refused() {
    let folder = Folder::new();
    let states = one_state(&folder);
    let refused = |bytes: Vec<u8>, part: &str| {
        let path = folder.file("m", bytes);
        through(&path, &states).refused(1, &[&format!("{path}: "), part]);
        lnn(&["evaluate", &path]).refused(1, &[part]);
    };
    let bytes = model().to_bytes().unwrap();
    refused([&bytes[..], b"\0"].concat(), "not a whole safetensors file");
    refused([&bytes[..], &bytes[..]].concat(), "not a whole safetensors file");
    for length in [1 << 63, u64::MAX, 4 << 30, (1 << 20) + 1] {
        refused([&length.to_le_bytes()[..], &bytes[8..]].concat(), "longer than 1 MiB");
    }
    refused(container(&"[".repeat(1 << 20), b""), "recursion limit");
    refused(container(&format!("{{\"a\":{}", "{\"a\":".repeat(100_000)), b""), "recursion limit");
    refused(container("", b""), "not a whole safetensors file");
    refused(container("{}", b""), "not of an lnn model");
    let tensor = |name: &str, from: usize, to: usize| {
        format!("\"{name}\":{{\"dtype\":\"U8\",\"shape\":[{}],\"data_offsets\":[{from},{to}]}}", to - from)
    };
    let pair = |a: String, b: String| container(&format!("{{{a},{b}}}"), &[0; 4]);
    refused(pair(tensor("a", 0, 2), tensor("a", 2, 4)), "duplicate key \"a\"");
    refused(pair(tensor("a", 0, 3), tensor("b", 2, 4)), "not a whole safetensors file");
    refused(pair(tensor("a", 0, 1), tensor("b", 3, 4)), "not a whole safetensors file");
    refused(pair(tensor("a", 0, 2), tensor("b", 2, 400)), "not a whole safetensors file");
    assert_eq!(folder.names(), ["m", "s.csv"]);
}

#[test]
fn weights_and_versions_are_checked() {
    let folder = Folder::new();
    let states = one_state(&folder);
    let refused = |bytes: Vec<u8>, parts: &[&str]| through(&folder.file("m", bytes), &states).refused(1, parts);
    assert_eq!(through(&folder.file("m", forged(|_, _| ())), &states).objects().len(), 1);
    for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let poisoned = forged(|_, payload| payload[8..12].copy_from_slice(&number.to_le_bytes()));
        refused(poisoned, &["/m: tensor layers.0.bias: number 2 is not finite"]);
    }
    let described = |old: &str, new: &str| {
        forged(|body, _| {
            assert!(body.contains(old), "{old} is not in {body}");
            *body = body.replace(old, new);
        })
    };
    let own = env!("CARGO_PKG_VERSION");
    let newer = described(&format!("\"crate_version\":\"{own}\""), "\"crate_version\":\"9.1.2\"");
    assert_eq!(through(&folder.file("m", newer), &states).objects().len(), 1, "the format decides");
    let newer = described("\"format\":1", "\"format\":2,\"novelty\":{}");
    refused(newer, &["/m: written by lnn", "in format 2", &format!("lnn {own} reads format 1")]);
    refused(described("\"precision\":\"f32\"", "\"precision\":\"f64\""), &["tensor", "expected f64, found f32"]);
    refused(described("\"precision\":\"f32\"", "\"precision\":\"f16\""), &["/m: description: ", "f16"]);
    refused(described("\"hidden\":[8,8]", "\"hidden\":[8,9]"), &["expected shape", "found"]);
    refused(described("\"seed\":1", "\"seed\":1,\"seed\":2"), &["duplicate key \"seed\""]);
    // A system of another version can be looked at and not compared with.
    let unknown = folder.file("m", described("\"system\":\"double-pendulum\"", "\"system\":\"quadruple-pendulum\""));
    assert_eq!(through(&unknown, &states).objects().len(), 1);
    lnn(&["evaluate", &unknown]).refused(1, &["/m: ", "quadruple-pendulum"]);
    let own_columns = folder.file("m", described("\"theta1\"", "\"phi1\""));
    lnn(&["evaluate", &own_columns]).refused(1, &["/m: columns are not those of double-pendulum"]);
    assert_eq!(folder.names(), ["m", "s.csv"]);
}

/// The program with no more than so much memory, in kilobytes of address space.
fn within(kilobytes: u32, arguments: &[&str]) -> Run {
    let script = format!("ulimit -v {kilobytes}; exec \"$0\" \"$@\"");
    Run::of(Command::new("sh").args(["-c", &script, env!("CARGO_BIN_EXE_lnn")]).args(arguments).env_remove("LNN_LOG"))
}

#[cfg(target_os = "linux")]
#[test]
fn claims_cost_nothing() {
    let folder = Folder::new();
    let states = one_state(&folder);
    let refused = |bytes: Vec<u8>, parts: &[&str]| {
        within(1 << 20, &["inspect", "--model", &folder.file("m", bytes), "--states", &states]).refused(1, parts);
    };
    let described = |old: &str, new: &str| {
        forged(|body, _| {
            assert!(body.contains(old), "{old} is not in {body}");
            *body = body.replace(old, new);
        })
    };
    refused(described("\"hidden\":[8,8]", "\"hidden\":[65536,65536]"), &["more weights than a file may hold"]);
    refused(described("\"hidden\":[8,8]", "\"hidden\":[1099511627776]"), &["expected widths of at most 65536"]);
    refused(described("\"hidden\":[8,8]", "\"hidden\":[18446744073709551615]"), &["expected widths"]);
    refused(described("\"hidden\":[8,8]", "\"hidden\":[16384,16384]"), &["expected shape [16384, 6]", "found [8, 6]"]);
    refused(described("\"coordinates\":2", "\"coordinates\":1099511627776"), &["/m: description: "]);
    let huge = "{\"a\":{\"dtype\":\"F64\",\"shape\":[4294967296,4294967296,4294967296],\"data_offsets\":[0,8]}}";
    refused(container(huge, &[0; 8]), &["not a whole safetensors file"]);
    // A hole of a terabyte in the file system: the size is refused before a byte is read.
    let hole = fs::File::create(folder.path("m")).unwrap();
    hole.set_len(1 << 40).unwrap();
    let hole = text(&folder.path("m"));
    let sizes = ["1099511627776 bytes are more than"];
    within(1 << 20, &["inspect", "--model", &hole, "--states", &states]).refused(1, &sizes);
    within(1 << 20, &["inspect", "--system", "double-pendulum", "--states", &hole]).refused(1, &sizes);
    within(1 << 20, &["train", "--config", &hole]).refused(1, &sizes);
    assert_eq!(folder.names(), ["m", "s.csv"]);
}

#[test]
fn states_are_placed_by_row_and_column() {
    let folder = Folder::new();
    let refused = |content: &[u8], parts: &[&str]| {
        let states = folder.file("s.csv", content);
        let place = format!("{states}: ");
        inspect("double-pendulum", &states, &[]).refused(1, &[&[place.as_str()], parts].concat());
    };
    let with = |row: &str| format!("{HEADER}1,2,3,4\r\n\r\n{row}\r\n").into_bytes();
    refused(&with("1,inf,3,4"), &["row 4, column theta2: expected a finite number, found \"inf\""]);
    refused(&with("1,2,-Infinity,4"), &["row 4, column theta1_dot", "\"-Infinity\""]);
    refused(&with("1,2,3,0x10"), &["row 4, column theta2_dot", "\"0x10\""]);
    refused(&with("1,2,3,4,"), &["row 4: expected 4 fields, found 5"]);
    refused(&with("1;2;3;4"), &["row 4: expected 4 fields, found 1"]);
    refused(&with("1,2,3,\x1b[31m4"), &["row 4, column theta2_dot", "\\u{1b}[31m4"]);
    refused(&with("1,2,3,\0"), &["row 4, column theta2_dot", "\\0"]);
    refused(
        b"theta1\ttheta2\ttheta1_dot\ttheta2_dot\n1\t2\t3\n",
        &["row 2: expected 4 fields separated by tabs, found 3"],
    );
    refused(b"1,2,3,4\n", &["row 1: expected a header with the columns theta1,theta2"]);
    refused(b"\xef\xbb\xbf\r\n\r\n", &["the file is empty, expected a header with the columns theta1,theta2"]);
    refused(&[HEADER.as_bytes(), b"\r\n \r\n"].concat(), &["no rows below the header"]);
    // Any number of digits is one number, and quickly.
    let long = "1".repeat(300) + "." + &"7".repeat(1_000_000) + "e-300";
    for precision in ["f32", "f64", "dd"] {
        let states = folder.file("s.csv", format!("{HEADER}1,2,3,{long}\n"));
        assert_eq!(inspect("double-pendulum", &states, &["--precision", precision]).code, Some(0), "{precision}");
        let states = folder.file("s.csv", format!("{HEADER}1,2,3,{}\n", "9".repeat(1_000_000)));
        // Forty digits are shortened.
        let found = "found \"1e40\"";
        inspect("double-pendulum", &states, &["--precision", precision]).refused(1, &["row 2", found]);
    }
    let wide = folder.file("s.csv", ",".repeat(1 << 20));
    inspect("double-pendulum", &wide, &[]).refused(1, &["row 1: unknown column \"\""]);
    // One row, with a mark of byte order and without a line end.
    let states = folder.file("s.csv", format!("\u{feff}{HEADER}1,2,3,4"));
    assert_eq!(inspect("double-pendulum", &states, &[]).objects().len(), 1);
    assert_eq!(folder.names(), ["s.csv"]);
}

/// The quick configuration of a double pendulum.
fn configuration() -> String {
    let mut config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (8, 4, 4);
    config.network.hidden = vec![2];
    config.phases[0].epochs = 1;
    toml::to_string(&config).unwrap()
}

#[test]
fn configurations_are_placed() {
    let folder = Folder::new();
    let out = text(&folder.path("out"));
    let train = |content: &[u8]| lnn(&["train", "--out", &out, "--config", &folder.file("c.toml", content)]);
    let good = configuration();
    let line = |text: &str, old: &str| 1 + text[..text.find(old).unwrap()].matches('\n').count();
    let with = |old: &str, new: &str, parts: &[&str]| {
        assert!(good.contains(old), "{old} is not in {good}");
        let bad = good.replacen(old, new, 1);
        train(bad.as_bytes()).refused(2, &[&["c.toml"], parts].concat());
    };
    // Refused by the reader: with the line.
    let placed = |key: &str, old: &str, new: &str, part: &str| {
        with(old, new, &[&format!("c.toml:{}: {key}: ", line(&good, old)), part]);
    };
    placed("optimizer.batch", "batch = 128", "batch = -1", "-1");
    placed("optimizer.batch", "batch = 128", "batch = 1.5", "1.5");
    placed("optimizer.batch", "batch = 128", "batch = \"128\"", "1 to 2^30 states, found \"128\"");
    placed("seed", "seed = 0", "seed = -1", "-1");
    placed("seed", "seed = 0", "seed = true", "found true");
    placed("optimizer.method", "method = \"soap\"", "method = \"radom\"", "radam");
    placed("optimizer.bacth", "batch = 128", "bacth = 128", "batch");
    placed("network.hiden", "hidden = ", "hiden = ", "hidden");
    with("batch = 128", "batch = 128\nbatch = 128", &["duplicate"]);
    with("[network]", "[network]\nalpha = 1.0", &["duplicate"]);
    with("[optimizer]", "[optimizer]\n[optimizer]", &["duplicate"]);
    with("rate = 0.005", "rate = 1e999999999999", &["c.toml"]);
    // Out of range: with the key.
    with("rate = 0.005", "rate = -0.003", &["phase[0].rate: ", "-0.003"]);
    with("rate = 0.005", "rate = inf", &["phase[0].rate: ", "inf"]);
    with("epochs = 1", "epochs = 1099511627776", &["phase[0].epochs", "1099511627776"]);
    with("hidden = [2]", "hidden = [1099511627776]", &["network.hidden[0]", "1099511627776"]);
    with("training = 8", "training = 0", &["data.training", "found 0"]);
    with("training = 8", "training = 1099511627776", &["data.training", "1099511627776"]);
    with("alpha = 1.0", "alpha = nan", &["network.alpha: ", "NaN"]);
    with("\"double-pendulum\"", "\"duoble-pendulum\"", &["duoble-pendulum", "did you mean \"double-pendulum\"?"]);
    with("[parameters]", "[parameters]\nm3 = 1.0", &["m3"]);
    with("[parameters]", "[parameters]\nm1 = nan", &["m1", "NaN"]);
    with("[parameters]", "[parameters]\nm1 = -1.0", &["m1", "-1"]);
    // No configuration at all.
    train(b"").refused(2, &["c.toml: system: expected a system, here or as an argument"]);
    train(b"\xff\xfe\0").refused(2, &["c.toml: not UTF-8 text"]);
    train(b"\0").refused(2, &["c.toml:1: "]);
    train(format!("a = {}", "[".repeat(100_000)).as_bytes()).refused(2, &["c.toml:1: ", "recurs"]);
    train(format!("a = {}", "{a=".repeat(100_000)).as_bytes()).refused(2, &["c.toml:1: ", "recurs"]);
    train(format!("{}a = 1", "a.".repeat(100_000)).as_bytes()).refused(2, &["c.toml:1: "]);
    train(format!("[{}a]", "a.".repeat(100_000)).as_bytes()).refused(2, &["c.toml:1: "]);
    train("#".repeat((1 << 20) + 1).as_bytes()).refused(1, &["c.toml: 1048577 bytes are more than the 1048576"]);
    assert_eq!(folder.names(), ["c.toml"]);
    // A mark of byte order and Windows line ends are taken.
    let dressed = format!("\u{feff}{}", good.replace('\n', "\r\n"));
    assert_eq!(train(dressed.as_bytes()).code, Some(0));
}

#[test]
fn every_seed_is_written_and_read_again() {
    let folder = Folder::new();
    let config = folder.file("c.toml", configuration());
    let beyond = (1u64 << 63).to_string();
    lnn(&["train", "--config", &config, "--seed", &beyond]).refused(2, &["--seed: seed", &beyond]);
    for seed in [1, i64::MAX as u64] {
        let out = |name: &str| text(&folder.path(name));
        let first =
            lnn(&["train", "--config", &config, "--seed", &seed.to_string(), "--out", &out("one"), "--overwrite"]);
        assert_eq!(first.code, Some(0), "{}", first.stderr);
        let again = lnn(&["train", "--config", &out("one/config.toml"), "--out", &out("two"), "--overwrite"]);
        assert_eq!(again.code, Some(0), "{}", again.stderr);
        let [one, two] = ["one", "two"].map(|name| fs::read(folder.path(name).join("model.safetensors")).unwrap());
        assert_eq!(one, two);
        assert_eq!(ModelFile::<f64>::from_bytes(&one).unwrap().header.seed, seed);
    }
}

#[test]
fn numbers_of_the_command_line_have_ranges() {
    let folder = Folder::new();
    let model = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("out.csv"));
    let base = ["rollout", &model, "--out", &out];
    let with = |state: &str, more: &[&str], parts: &[&str]| {
        let state = ["--state", state];
        lnn(&[&base[..], &state, more].concat()).refused(2, parts);
    };
    let times = ["--t-end", "1", "--dt", "0.5"];
    for bad in ["nan", "inf", "-inf", "1e999", "", "one"] {
        with("1,2,3,4", &["--t-end", bad, "--dt", "0.5"], &["--t-end", "expected a finite number"]);
        with("1,2,3,4", &["--t-end", "1", "--dt", bad], &["--dt", "expected a finite number above 0"]);
        with("1,2,3,4", &[&times[..], &["--rtol", bad]].concat(), &["--rtol", "2e-15"]);
        with("1,2,3,4", &[&times[..], &["--step", bad, "--method", "gauss4"]].concat(), &["--step"]);
        with(&format!("1,2,3,{bad}"), &times, &["--state", "expected a finite number"]);
    }
    for bad in ["0", "-0.0", "-1"] {
        with("1,2,3,4", &["--t-end", "1", "--dt", bad], &["--dt", "expected a finite number above 0"]);
        with("1,2,3,4", &[&times[..], &["--atol", bad]].concat(), &["--atol", "expected a finite number above 0"]);
    }
    with("1,2,3", &times, &["--state: expected 4 numbers (theta1,theta2,theta1_dot,theta2_dot), found 3"]);
    with("1,2,3,4,5", &times, &["--state: expected 4 numbers", "found 5"]);
    let zeros = "0,".repeat(50_000) + "0";
    with(&zeros, &times, &["--state: expected 4 numbers", "found 50001"]);
    for bad in ["-1", "0", "1.5", "18446744073709551616"] {
        lnn(&["evaluate", &model, "--starts", bad]).refused(2, &["--starts", "1000000"]);
        lnn(&["evaluate", &model, "--threads", bad]).refused(2, &["--threads", "256"]);
    }
    assert_eq!(folder.names(), ["m"]);
}

#[cfg(target_os = "linux")]
#[test]
fn sizes_are_refused_before_anything_is_allocated() {
    let folder = Folder::new();
    let model = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("out"));
    for (t_end, dt) in [("1e300", "1e-300"), ("1e9", "1"), ("-1", "5e-324")] {
        let arguments = ["rollout", &model, "--state", "1,2,3,4", "--t-end", t_end, "--dt", dt, "--out", &out];
        within(1 << 20, &arguments).refused(2, &["dt", "at most 1e8 are allowed"]);
    }
    for n in ["0", "1099511627776", "18446744073709551615", "-1", "1e4"] {
        let n = format!("n={n}");
        let states = one_state(&folder);
        let arguments = ["inspect", "--system", "n-pendulum", "--param", &n, "--states", &states];
        within(1 << 20, &arguments).refused(2, &["n-pendulum", "an integer from"]);
        within(1 << 20, &["train", "n-pendulum", "--param", &n, "--out", &out]).refused(2, &["an integer from"]);
    }
    for (system, n) in [("n-pendulum", "n=1000"), ("lattice", "n=257"), ("cloth", "n=18")] {
        let found = within(1 << 20, &["train", system, "--param", n, "--out", &out]);
        found.refused(2, &["at most 256 coordinates"]);
        within(1 << 20, &["symmetries", "--system", system, "--param", n]).refused(2, &["at most 256 coordinates"]);
        let states = one_state(&folder);
        let arguments = ["geometry", "--system", system, "--param", n, "--points", &states];
        within(1 << 20, &arguments).refused(2, &["at most 64 coordinates"]);
    }
    within(1 << 20, &["train", "cartesian-chain-500", "--out", &out]).refused(2, &["at most 256 coordinates"]);
    assert_eq!(folder.names(), ["m", "s.csv"]);
}

#[test]
fn only_regular_files_are_read() {
    let folder = Folder::new();
    let states = one_state(&folder);
    let good = folder.file("m", model().to_bytes().unwrap());
    let path = |name: &str| text(&folder.path(name));
    assert!(Command::new("mkfifo").arg(path("fifo")).status().unwrap().success());
    fs::create_dir(path("directory")).unwrap();
    let link = |target: &str, name: &str| std::os::unix::fs::symlink(target, path(name)).unwrap();
    link("/dev/zero", "zero");
    link("nowhere", "dangling");
    link("loop", "loop");
    link("directory", "to directory");
    let before = folder.names();
    for (name, problem) in [
        ("fifo", "expected a regular file, found a pipe or device"),
        ("directory", "directory"),
        ("zero", "expected a regular file, found a pipe or device"),
        ("dangling", "no such file"),
        ("loop", "cannot read: "),
        ("to directory", "directory"),
        ("m/below a file", "cannot read: "),
        ("", "directory"),
    ] {
        let (path, out) = (path(name), path("out"));
        let parts: &[&str] = &[&format!("{path}: "), problem];
        inspect("double-pendulum", &path, &[]).refused(1, parts);
        through(&path, &states).refused(1, parts);
        lnn(&["evaluate", &path]).refused(1, parts);
        let rollout = ["rollout", &path, "--state", "1,2,3,4", "--t-end", "1", "--dt", "1", "--out", &out];
        lnn(&rollout).refused(1, parts);
        lnn(&["train", "--config", &path, "--out", &out]).refused(1, parts);
        assert_eq!(folder.names(), before);
    }
    // What may not be read, unless by the superuser.
    let secret = folder.file("secret", "x");
    fs::set_permissions(&secret, std::os::unix::fs::PermissionsExt::from_mode(0o0)).unwrap();
    if fs::read(&secret).is_err() {
        inspect("double-pendulum", &secret, &[]).refused(1, &["secret: cannot read: "]);
    }
    // Links to what is asked for are followed.
    link("s.csv", "link.csv");
    link("m", "link");
    assert_eq!(through(&path("link"), &path("link.csv")).objects(), through(&good, &states).objects());
}

#[test]
fn targets_that_cannot_be_written_are_named() {
    let folder = Folder::new();
    let model = folder.file("m", model().to_bytes().unwrap());
    let directory = text(&folder.path("directory"));
    fs::create_dir(&directory).unwrap();
    let before = folder.names();
    // Noticed before the motion, which would take long.
    let rollout =
        |out: &str| lnn(&["rollout", &model, "--state", "1,2,3,4", "--t-end", "10000", "--dt", "0.001", "--out", out]);
    for out in [&directory, &text(&folder.path("no/parent.csv")), &text(&folder.path("m/below.csv")), "/proc/lnn.csv"] {
        rollout(out).refused(1, &[&format!("{out}: cannot write: ")]);
    }
    lnn(&["evaluate", &model, "--out", &model]).refused(1, &["/m: cannot create the directory: "]);
    assert_eq!(folder.names(), before);
    assert_eq!(fs::read_dir(&directory).unwrap().count(), 0);
}

// Elsewhere names are text.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_not_text_are_one_line_too() {
    use std::os::unix::ffi::OsStrExt;
    let bytes = std::ffi::OsStr::from_bytes;
    let nowhere = bytes(b"no\xff\nwhere\x1b[31m");
    let run = Run::of(command(&["inspect", "--system", "kepler", "--states"]).arg(nowhere));
    run.refused(1, &["no such file"]);
    assert!(!run.stderr.contains('\x1b'));
    let run = Run::of(command(&[]).arg(nowhere));
    run.refused(2, &["subcommand"]);
    assert!(!run.stderr.contains('\x1b'));
    Run::of(command(&["train"]).arg(bytes(b"\xff"))).refused(2, &["UTF-8"]);
}

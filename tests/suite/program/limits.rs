//! Bounds of numbers: every number that a user can type is refused or gives a result within seconds and in little memory.
#![cfg(target_os = "linux")]

use crate::running::{Folder, Run, command, lnn, model, text};
use std::process::Command;
use std::time::{Duration, Instant};

/// Values of every numeric option: the ends of floats and of integers, and what is none of their ranges.
const VALUES: [&str; 7] = ["0", "-1", "1e308", "1e-308", "4294967296", "18446744073709551615", "nan"];

/// The program with no more than 2 GB of address space and 20 s of time, on cores that it shares with other tests.
fn bounded(arguments: &[&str]) -> Run {
    let script = "ulimit -v 2097152; exec timeout -s KILL 20 \"$0\" \"$@\"";
    Run::of(Command::new("sh").args(["-c", script, env!("CARGO_BIN_EXE_lnn")]).args(arguments).env_remove("LNN_LOG"))
}

/// Values of a physical parameter, of forces, positions and velocities: large ones make a motion fast or its errors coarse, which takes the steps
/// that are allowed.
const PARAMETERS: [&str; 5] = ["0", "-1", "1e308", "1e-308", "nan"];

/// Runs an option with every value, in place of its own where `base` has it; a result, a refusal of the argument or a failure of the data
/// are the ends that are allowed.
fn every_value(base: &[&str], option: &str, form: &dyn Fn(&str) -> String) {
    let motion = ["--force", "--param", "--positions", "--velocities"].contains(&option);
    let values = if motion { &PARAMETERS[..] } else { &VALUES };
    for value in values.iter().map(|value| form(value)) {
        let given = base.iter().position(|word| *word == option);
        let (before, after) = given.map_or((base, &[][..]), |at| (&base[..at], &base[at + 2..]));
        let joined = format!("{option}={value}");
        let arguments = [before, &[joined.as_str()], after].concat();
        let began = Instant::now();
        let Run { code, stderr, .. } = bounded(&arguments);
        let place = format!("{arguments:?}: {code:?} after {:?}: {stderr}", began.elapsed());
        assert!(matches!(code, Some(0..=2)), "{place}");
        assert!(!stderr.contains("panicked"), "{place}");
        // What is no number of any range is the argument's fault.
        if value.contains("nan") {
            assert_eq!(code, Some(2), "{place}");
        }
    }
}

/// Options of the commands below that take no number.
const WORDS: [&str; 53] = [
    "acceleration",
    "activation",
    "between",
    "box",
    "columns",
    "config",
    "coords",
    "cyclic",
    "format",
    "force",
    "force-time",
    "force-units",
    "from",
    "known",
    "method",
    "model",
    "name",
    "observer",
    "out",
    "events",
    "param",
    "penalty",
    "periodic",
    "plot",
    "positions",
    "precision",
    "preset",
    "print-config",
    "resume",
    "set",
    "scale",
    "shard",
    "signature",
    "space",
    "state",
    "structure",
    "system",
    "targets",
    "time",
    "timelike",
    "trajectory",
    "tube-data",
    "units",
    "vary",
    "velocities",
    "velocity",
    "hidden",
    "noise",
    "constraints",
    "set",
    "friction",
    "joint-friction",
    "checkpoint-every",
];

/// Every option of these commands is one of the numbers that the tests of this file type, or takes no number.
#[test]
fn every_option_is_looked_at() {
    let source = include_str!("limits.rs");
    for name in ["train", "fit", "check", "rollout", "evaluate", "certify", "sweep", "shadow"] {
        let help = lnn(&[name, "--help"]).stdout;
        for line in help.lines().map(str::trim).filter(|line| line.starts_with('-') && line.contains(['<', '='])) {
            let Some(option) = line.split("--").nth(1).and_then(|rest| rest.split([' ', '[', '=', '<']).next()) else {
                continue;
            };
            let tried = source.contains(&format!("\"--{option}\""));
            assert!(tried || WORDS.contains(&option), "{name} --{option}: {line}");
        }
    }
}

fn plain(value: &str) -> String {
    value.to_string()
}

/// Three short swings, told apart by a column.
fn swings(folder: &Folder) -> String {
    let row = |run: u32, k: u32| {
        let (t, run) = (0.02 * f64::from(k), f64::from(run));
        let x = (0.4 + 0.1 * run) * ((3.0 + 0.2 * run) * t).cos() + 1e-3 * (1e3 * t).sin();
        format!("{run},{t},{x}\n")
    };
    let rows = (0..4).flat_map(|run| (0..40).map(move |k| row(run, k)));
    folder.file("swings.csv", "run,t,x\n".to_string() + &rows.collect::<String>())
}

#[test]
fn numbers_of_trainings_are_bounded() {
    let folder = Folder::new();
    let (out, data) = (text(&folder.path("out")), swings(&folder));
    let small = folder.file("small.toml", "[data]\ntraining = 64\nvalidation = 16\ntest = 16\n");
    let train = [
        &[
            "train",
            "harmonic-oscillator",
            "--hidden",
            "4",
            "--epochs",
            "1",
            "--threads",
            "1",
            "--out",
            &out,
            "--overwrite",
        ][..],
        &["--config", &small],
    ]
    .concat();
    for option in ["--seed", "--hidden", "--lambda", "--learning-rate", "--epochs", "--threads", "--checkpoint-every"] {
        every_value(&train, option, &plain);
    }
    every_value(&train, "--checkpoint-every", &|value| format!("{value}s"));
    every_value(&train, "--param", &|value| format!("k={value}"));
    let fit =
        ["fit", &data, "--coords", "x", "--trajectory", "run", "--hidden", "4", "--epochs", "1", "--threads", "1"];
    let fit = [&fit[..], &["--out", &out, "--overwrite"]].concat();
    let options = [
        "--friction",
        "--window",
        "--noise",
        "--hold-out",
        "--horizon",
        "--seed",
        "--lambda",
        "--threads",
        "--members",
    ];
    for option in options {
        every_value(&fit, option, &plain);
    }
    let motion = [&fit[..], &["--targets", "motion", "--shooting-epochs", "1"]].concat();
    for option in ["--shooting-epochs", "--segment"] {
        every_value(&motion, option, &plain);
    }
    every_value(&["check", &data, "--coords", "x", "--trajectory", "run"], "--rate", &plain);
    let config = folder.file("small.toml", "system = \"harmonic-oscillator\"\n");
    every_value(&["sweep", &config, "--list", "--out", &out], "--seeds", &plain);
    every_value(&["sweep", &config, "--list", "--out", &out], "--threads", &plain);
}

#[test]
fn numbers_of_motions_are_bounded() {
    let folder = Folder::new();
    let out = text(&folder.path("r.csv"));
    let rollout =
        ["rollout", "--system", "double-pendulum", "--out", &out, "--overwrite", "--t-end", "1", "--dt", "0.1"];
    let rollout = [&rollout[..], &["--state", "0.6,0.9,0,0"]].concat();
    for option in ["--t-end", "--t-start", "--dt", "--rtol", "--atol", "--tube"] {
        every_value(&rollout, option, &plain);
    }
    every_value(&rollout, "--state", &|value| format!("{value},0.9,0,0"));
    every_value(&rollout, "--param", &|value| format!("g={value}"));
    every_value(&rollout, "--force", &|value| format!("theta1_force={value}"));
    for method in ["midpoint", "gauss4", "gauss6", "variational"] {
        let fixed = [&rollout[..], &["--method", method]].concat();
        for option in ["--t-end", "--dt", "--step"] {
            every_value(&fixed, option, &plain);
        }
    }
    let file = folder.file("m", model().to_bytes().unwrap());
    let out = text(&folder.path("e"));
    let evaluate =
        ["evaluate", &file, "--threads", "2", "--until", "0.5", "--starts", "1", "--out", &out, "--overwrite"];
    for option in ["--starts", "--seed", "--until", "--rtol", "--threads"] {
        every_value(&evaluate, option, &plain);
    }
    for option in ["--positions", "--velocities"] {
        every_value(&evaluate, option, &|value| format!("{value}:{value}"));
    }
}

#[test]
fn numbers_of_metrics_are_bounded() {
    let folder = Folder::new();
    let out = text(&folder.path("s.png"));
    let shadow =
        ["shadow", "--system", "schwarzschild-cartesian", "--width", "4", "--edges", "4", "--out", &out, "--overwrite"];
    let options = ["--distance", "--inclination", "--azimuth", "--field-of-view", "--width", "--height", "--far"];
    for option in options.into_iter().chain(["--tolerance", "--edges", "--threads"]) {
        every_value(&shadow, option, &plain);
    }
    every_value(&shadow, "--param", &|value| format!("M={value}"));
    let certify = ["certify", "--system", "kepler", "--seconds", "0.2"];
    for option in ["--condition", "--seconds", "--boxes", "--threads"] {
        every_value(&certify, option, &plain);
    }
}

/// Every value of the configuration reference that is a number, in a file.
#[test]
fn numbers_of_configurations_are_bounded() {
    let folder = Folder::new();
    let out = text(&folder.path("out"));
    let small = [
        ("data", "training", "64"),
        ("data", "validation", "16"),
        ("data", "test", "16"),
        ("network", "hidden", "[4]"),
    ];
    let small =
        small.into_iter().chain([("phase", "epochs", "1"), ("lbfgs", "iterations", "1"), ("lbfgs", "memory", "1")]);
    let keys = [
        ("data", "training"),
        ("data", "validation"),
        ("data", "test"),
        ("data", "rescaled_fraction"),
        ("data", "trajectory_fraction"),
        ("data", "acceleration_weighting"),
        ("network", "alpha"),
        ("network", "dissipation"),
        ("network", "radial_unit"),
        ("penalty", "lambda"),
        ("optimizer", "batch"),
        ("optimizer", "weight_decay"),
        ("optimizer", "clip"),
        ("optimizer", "averaging"),
        ("phase", "epochs"),
        ("phase", "rate"),
        ("phase", "eta_min"),
        ("phase", "t_max"),
        ("lbfgs", "iterations"),
        ("lbfgs", "memory"),
    ];
    let small: Vec<_> = small.collect();
    for (table, key) in keys {
        // A system with a length among its coordinates where the key is about one, otherwise the one that is evaluated in the least time.
        let system = if key == "radial_unit" { "spring-pendulum" } else { "harmonic-oscillator" };
        for value in ["0", "-1", "1e308", "1e-308", "4294967296", "9223372036854775807", "nan"] {
            let mut content = format!("system = \"{system}\"\n");
            for name in ["data", "network", "penalty", "optimizer", "phase", "lbfgs"] {
                let header = if name == "phase" { "[[phase]]\n".to_string() } else { format!("[{name}]\n") };
                let kept = small.iter().filter(|(t, k, _)| *t == name && (*t, *k) != (table, key));
                let kept: String = kept.map(|(_, key, value)| format!("{key} = {value}\n")).collect();
                let changed = if name == table { format!("{key} = {value}\n") } else { String::new() };
                content += &(header + &kept + &changed);
            }
            let file = folder.file("c.toml", content);
            let began = Instant::now();
            let Run { code, stderr, .. } =
                bounded(&["train", "--config", &file, "--threads", "1", "--out", &out, "--overwrite"]);
            let place = format!("{table}.{key} = {value}: {code:?} after {:?}: {stderr}", began.elapsed());
            assert!(matches!(code, Some(0..=2)) && !stderr.contains("panicked"), "{place}");
            if value == "nan" {
                assert!(code == Some(2) && stderr.contains(key), "{place}");
            }
        }
    }
}

/// The same of system files.
#[test]
fn numbers_of_system_files_are_bounded() {
    let folder = Folder::new();
    let out = text(&folder.path("out"));
    let small = folder.file("small.toml", "[data]\ntraining = 64\nvalidation = 16\ntest = 16\n");
    let usual: [(&str, &str); 5] = [("k", "1"), ("high", "1"), ("fast", "1"), ("t_end", "2"), ("dt", "0.1")];
    for (changed, _) in usual {
        let values = if changed == "k" { &PARAMETERS[..] } else { &VALUES };
        for value in values {
            let of = |key: &str| {
                usual.iter().find(|(k, _)| *k == key).map_or("", |(_, v)| if key == changed { *value } else { *v })
            };
            let system = format!(
                "name = \"own\"\nlagrangian = \"x_dot^2/2 - k*x^2/2\"\n[parameters]\nk = \"{}\"\n[[coordinates]]\nname = \"x\"\n\
                 bounds = [-2, {}]\nvelocity_bounds = [-2, {}]\n[trajectory]\nt_end = {}\ndt = {}\n",
                of("k"),
                of("high"),
                of("fast"),
                of("t_end"),
                of("dt")
            );
            let file = folder.file("own.toml", system);
            let train =
                ["train", &file, "--hidden", "4", "--epochs", "1", "--threads", "1", "--out", &out, "--overwrite"];
            let Run { code, stderr, .. } = bounded(&[&train[..], &["--config", &small]].concat());
            assert!(
                matches!(code, Some(0..=2)) && !stderr.contains("panicked"),
                "{changed} = {value}: {code:?} {stderr}"
            );
        }
    }
}

/// Without a thread more than the first the work is done by that one, or there is an error and no panic.
#[test]
fn threads_that_do_not_start_are_done_without() {
    let folder = Folder::new();
    let file = folder.file("m", model().to_bytes().unwrap());
    let (out, png) = (text(&folder.path("e")), text(&folder.path("s.png")));
    let evaluate = ["evaluate", &file, "--threads", "64", "--until", "0.5", "--starts", "12", "--out", &out];
    let certify = ["certify", "--system", "double-pendulum", "--boxes", "300", "--seconds", "100", "--threads", "64"];
    let shadow = [
        "shadow",
        "--system",
        "schwarzschild-cartesian",
        "--width",
        "16",
        "--edges",
        "0",
        "--threads",
        "64",
        "--out",
        &png,
    ];
    for arguments in [&evaluate[..], &certify, &shadow] {
        // Stacks of threads that the address space has no room for.
        let script = "ulimit -v 200000; exec \"$0\" \"$@\"";
        let mut shell = Command::new("sh");
        shell.args(["-c", script, env!("CARGO_BIN_EXE_lnn")]).args(arguments).env("RUST_MIN_STACK", "60000000");
        let run = Run::of(shell.env_remove("LNN_LOG"));
        assert_eq!(run.code, Some(0), "{arguments:?}: {}", run.stderr);
    }
}

#[test]
fn names_bounds_and_penalties_have_one_rule_each() {
    let folder = Folder::new();
    let out = text(&folder.path("out"));
    let system = |name: &str, bounds: &str| {
        let formula = format!("{name}_dot^2/2 - {name}^2/2");
        let coordinate = format!("[[coordinates]]\nname = \"{name}\"\nbounds = {bounds}\nvelocity_bounds = [-1, 1]\n");
        folder.file("one.toml", format!("name = \"one\"\nlagrangian = \"{formula}\"\n{coordinate}"))
    };
    let rollout = |file: &str| {
        lnn(&["rollout", "--system", file, "--state", "0.1,0", "--t-end", "1", "--dt", "0.5", "--out", "-"])
    };
    assert_eq!(rollout(&system("energetic", "[-1, 1]")).code, Some(0));
    rollout(&system("energy", "[-1, 1]")).refused(2, &["coordinates[0].name", "energy"]);
    for bounds in ["[1, 2, 3]", "[1]", "[]"] {
        rollout(&system("x", bounds)).refused(2, &["one.toml:5: coordinates[0].bounds", "2"]);
    }
    let config =
        folder.file("c.toml", "system = \"harmonic-oscillator\"\n[data]\nvalidation_position = [[-1, 1, 2]]\n");
    lnn(&["train", "--config", &config, "--out", &out]).refused(2, &["c.toml:3: data.validation_position", "2"]);
    let data = folder.file("d.csv", "t,x,energy\n0,1,2\n1,2,3\n");
    lnn(&["check", &data, "--coords", "x,energy"]).refused(2, &["energy"]);

    for penalty in ["eigenvalue", "sylvester"] {
        let train = ["train", "ads4-geodesic", "--penalty", penalty, "--out", &out];
        lnn(&train).refused(2, &["--penalty", "lorentzian-sylvester"]);
        let text = format!("system = \"ads4-geodesic\"\n[penalty]\nkind = \"{penalty}\"\n");
        let config = folder.file("c.toml", text);
        lnn(&["train", "--config", &config, "--out", &out])
            .refused(2, &["penalty.kind", "lorentzian-sylvester", penalty]);
    }
    let fit = ["fit", &swings(&folder), "--coords", "x", "--trajectory", "run", "--epochs", "1", "--out", &out];
    for horizon in ["1e-308", "1e308", "0.001"] {
        let run = lnn(&[&fit[..], &["--horizon", horizon]].concat());
        assert!(
            run.code == Some(2) && run.stderr.contains("--horizon") && run.stderr.contains("0.02"),
            "{}",
            run.stderr
        );
    }
    assert!(!folder.path("out").exists());
}

/// Fixed steps that are too many are refused before the first; signals end the others.
#[test]
fn too_many_fixed_steps_are_known_beforehand() {
    let folder = Folder::new();
    let rollout = |more: &[&str]| {
        let fixed = ["rollout", "--system", "double-pendulum", "--state", "0.6,0.9,0,0", "--method", "gauss4"];
        let out = text(&folder.path("r.csv"));
        lnn(&[&fixed[..], &["--out", &out], more].concat())
    };
    let began = Instant::now();
    rollout(&["--t-end", "1", "--dt", "1", "--step", "1e-9"]).refused(2, &["--step", "1000000"]);
    rollout(&["--t-end", "1", "--dt", "1e-7"]).refused(2, &["--dt", "1000000"]);
    assert!(began.elapsed() < Duration::from_secs(2) && folder.names().is_empty());
}

/// A metric that expands; one that does not, with the name of its time.
#[test]
fn metrics_that_depend_on_their_time_have_no_shadow() {
    let folder = Folder::new();
    let metric = |scale: &str| {
        let mut text = "name = \"expanding\"\n".to_string();
        for name in ["t", "x", "y", "z"] {
            let kind = if name == "t" { "time_like = true" } else { "velocity_bounds = [-1, 1]" };
            text += &format!("[[coordinates]]\nname = \"{name}\"\nbounds = [-1, 1]\n{kind}\n");
        }
        text += "[metric]\n\"t,t\" = \"-1\"\n";
        ["x", "y", "z"].iter().for_each(|name| text += &format!("\"{name},{name}\" = \"{scale}\"\n"));
        folder.file("metric.toml", text)
    };
    let out = text(&folder.path("s.png"));
    let shadow = |file: &str| {
        command(&["shadow", "--system", file, "--width", "4", "--edges", "0", "--out", &out, "--overwrite"])
    };
    Run::of(&mut shadow(&metric("exp(0.1*t)"))).refused(2, &["--time", "depends on its time"]);
    assert!(!folder.path("s.png").exists());
    Run::of(&mut shadow(&metric("2"))).succeeded();
}

#[test]
fn the_curvature_of_many_coordinates_is_refused() {
    let folder = Folder::new();
    let names: Vec<String> = (0..33).map(|k| format!("q{k}")).collect();
    let terms: Vec<String> = names.iter().map(|name| format!("{name}_dot^2/2")).collect();
    let coordinates = names
        .iter()
        .map(|name| format!("[[coordinates]]\nname = \"{name}\"\nbounds = [-1, 1]\nvelocity_bounds = [-1, 1]\n"));
    let system =
        format!("name = \"many\"\nlagrangian = \"{}\"\n{}", terms.join(" + "), coordinates.collect::<String>());
    let (system, zeros) = (folder.file("many.toml", system), vec!["0"; 33].join(","));
    let points = folder.file("p.csv", format!("{}\n{zeros}\n", names.join(",")));
    lnn(&["geometry", "--system", &system, "--points", &points]).refused(2, &["32", "33"]);
}

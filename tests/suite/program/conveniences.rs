//! What makes the program easy to use, from outside: fine-tuning, models by directory, standard input and output, pictures
//! of roll-outs, completions and manual pages.

use crate::running::{Folder, lnn, model, piped, text};
use lnn::network::ModelFile;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A model of a double pendulum in the directory of a run.
fn run_directory(folder: &Folder) -> String {
    fs::create_dir(folder.path("run")).unwrap();
    model().save(&folder.path("run/model.safetensors")).unwrap();
    text(&folder.path("run"))
}

/// A start in the middle of what it was trained on.
const START: [&str; 6] = ["--state", "1,2,0.5,0", "--t-end", "0.5", "--dt", "0.1"];

#[test]
fn a_training_starts_from_a_model() {
    let folder = Folder::new();
    let out = |name: &str| text(&folder.path(name));
    let small = folder.file("small.toml", "[data]\ntraining = 512\nvalidation = 128\ntest = 64\n");
    let small = ["--config", &small];
    let train = |name: &str, more: &[&str]| {
        let run = lnn(&[&["train", "--out", &out(name), "--threads", "1"], &small[..], more].concat());
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
        ModelFile::<f64>::load(&folder.path(name).join("model.safetensors")).unwrap()
    };
    let first = train("first", &["spring-pendulum", "--hidden", "16,16", "--epochs", "12"]);
    // System, network and parameters are the model's; the states are of other parameters.
    let tuned = ["--from", &out("first"), "--param", "k=12", "--epochs", "1", "--learning-rate", "1e-6"];
    let second = train("second", &tuned);
    assert_eq!(second.header.system, "spring-pendulum");
    assert_eq!(second.header.architecture, first.header.architecture);
    assert_eq!((second.header.parameters["k"], first.header.parameters["k"] != 12.0), (12.0, true));
    let moved = second.weights.iter().zip(&first.weights).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(moved > 0.0 && moved < 1e-3, "{moved}");
    let config = fs::read_to_string(folder.path("second/config.toml")).unwrap();
    assert!(config.contains("from = ") && config.contains("hidden = [16, 16]"), "{config}");
    // It repeats from its own configuration.
    let again = lnn(&["train", "--config", &text(&folder.path("second/config.toml")), "--out", &out("third")]);
    assert_eq!((again.code, again.stderr.as_str()), (Some(0), ""));
    let bytes = |name: &str| fs::read(folder.path(name).join("model.safetensors")).unwrap();
    assert_eq!(bytes("second"), bytes("third"));

    let file = text(&folder.path("first/model.safetensors"));
    let refused = |more: &[&str], code, parts: &[&str]| {
        lnn(&[&["train", "--from", &file, "--out", &out("never")], more].concat()).refused(code, parts);
    };
    let other = ["--from", "hidden [8] requested, [16,16] in the model", "activation \"tanh\""];
    refused(&["--hidden", "8", "--activation", "tanh"], 2, &other);
    refused(&["triple-pendulum"], 2, &["another shape", "coordinates 3 requested, 2 in the model"]);
    refused(&["double-pendulum"], 2, &["periodic [true,true] requested, [false,true] in the model"]);
    lnn(&["train", "--from", &out("nowhere")]).refused(1, &["nowhere", "no such file"]);
    assert!(!folder.path("never").exists());
}

#[test]
fn a_training_starts_from_a_metric() {
    let folder = Folder::new();
    let out = |name: &str| text(&folder.path(name));
    let small = folder.file("small.toml", "[data]\ntraining = 256\nvalidation = 64\ntest = 64\n");
    let train = |name: &str, more: &[&str]| {
        let run = lnn(&[&["train", "--config", &small, "--epochs", "1", "--out", &out(name)], more].concat());
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
        ModelFile::<f64>::load(&folder.path(name).join("model.safetensors")).unwrap().header.architecture
    };
    let first = train("first", &["kerr-cartesian", "--hidden", "8"]);
    assert_eq!((first.time_like, &*first.form.cyclic, first.form.radial.len()), (Some(0), &[0][..], 1));
    assert_eq!(train("second", &["--from", &out("first")]), first);
}

#[test]
fn a_fit_starts_from_a_model_and_holds_nothing_out() {
    let folder = Folder::new();
    let mut csv = "run,t,x\n".to_string();
    for (run, k) in (0..4).flat_map(|run| (0..100).map(move |k| (run, k))) {
        let (t, size) = (0.05 * f64::from(k), 1.0 + 0.2 * f64::from(run));
        csv += &format!("{run},{t},{}\n", size * (2.0 * t + f64::from(run)).cos());
    }
    let data = folder.file("swings.csv", &csv);
    let out = |name: &str| text(&folder.path(name));
    let columns = ["--coords", "x", "--trajectory", "run", "--epochs", "4"];
    let fit = |name: &str, more: &[&str]| {
        let run = lnn(&[&["fit", &data, "--out", &out(name)], &columns[..], more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let summary: Value =
            serde_json::from_slice(&fs::read(folder.path(name).join("summary.json")).unwrap()).unwrap();
        (run.stdout, summary)
    };
    let (text, summary) = fit("all", &["--hold-out", "0", "--hidden", "8,8"]);
    assert!(text.contains("nothing was held out for a test") && text.contains("--hold-out 0"), "{text}");
    assert_eq!((&summary["held_out"], &summary["samples"]), (&"nothing".into(), &serde_json::json!([400, 400, 0])));
    assert!(summary["test_loss"].is_null() && summary["wrong_signature"].is_null() && summary["energy"].is_null());
    assert_eq!(summary["model"], serde_json::json!([]));
    assert!(fs::read_to_string(folder.path("all/report.html")).unwrap().contains("this model was not tested"));

    fit("tuned", &["--from", &out("all"), "--learning-rate", "1e-4"]);
    let weights = |name: &str| ModelFile::<f64>::load(&folder.path(name).join("model.safetensors")).unwrap().weights;
    let moved = weights("all").iter().zip(weights("tuned")).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(moved > 0.0 && moved < 1e-3, "{moved}");
    let all = out("all");
    let other = [&["fit", &data, "--from", &all, "--hidden", "4"], &columns[..]].concat();
    let other = lnn(&other);
    let told = other.stderr.lines().last().unwrap();
    assert!(other.code == Some(2) && told.starts_with("error: --from"), "{told}");
    assert!(told.ends_with("hidden [4] requested, [8,8] in the model"), "{told}");
}

#[test]
fn models_are_named_by_the_directory_of_their_run() {
    let folder = Folder::new();
    let (run, file) = (run_directory(&folder), text(&folder.path("run/model.safetensors")));
    let csv = |name: &str| text(&folder.path(name));
    for (model, out) in [(&run, "a.csv"), (&file, "b.csv")] {
        let moved = lnn(&[&["rollout", model, "--out", &csv(out)], &START[..]].concat());
        assert_eq!((moved.code, moved.stderr.as_str()), (Some(0), ""));
    }
    assert_eq!(fs::read(csv("a.csv")).unwrap(), fs::read(csv("b.csv")).unwrap());
    let [first, second] = [&run, &file].map(|model| lnn(&["inspect", "--model", model, "--states", &csv("a.csv")]));
    assert_eq!(first.objects(), second.objects());
    let judged = lnn(&["evaluate", &run, "--starts", "1", "--until", "0.1", "--json"]);
    assert_eq!(judged.code, Some(0), "{}", judged.stderr);
    assert!(folder.path("run/evaluation/evaluation.json").is_file());
    assert!(folder.path("run/evaluation/play.html").is_file());
    let empty = folder.path("empty");
    fs::create_dir(&empty).unwrap();
    for command in ["rollout", "evaluate"] {
        let more: &[&str] = if command == "rollout" { &START } else { &[] };
        let out: &[&str] = if command == "rollout" { &["--out", "-"] } else { &[] };
        let run = lnn(&[&[command, &text(&empty)], more, out].concat());
        run.refused(1, &["empty: there is no model.safetensors in this directory"]);
    }
}

#[test]
fn samples_flow_from_one_command_into_the_next() {
    let folder = Folder::new();
    let run = run_directory(&folder);
    let csv = text(&folder.path("motion.csv"));
    lnn(&[&["rollout", &run, "--out", &csv], &START[..]].concat());
    let printed = lnn(&[&["rollout", &run, "--out", "-"], &START[..]].concat());
    assert_eq!(printed.code, Some(0));
    assert_eq!(printed.stdout, fs::read_to_string(&csv).unwrap());
    assert!(printed.stderr.starts_with("note: 6 samples to t = 0.5 s"), "{}", printed.stderr);
    // A roll-out's samples are states: its energies are those of the terms.
    let looked = piped(&["inspect", "--model", &run, "--states", "-", "--json"], printed.stdout.as_bytes());
    let energies = printed.stdout.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse::<f64>().unwrap());
    for (terms, energy) in looked.objects().iter().zip(energies) {
        assert!((terms["energy"].as_f64().unwrap() - energy).abs() <= 1e-12 * energy.abs().max(1.0));
    }
    assert_eq!(looked.objects().len(), 6);
    // A model is no text that comes through a pipe.
    for command in [&["inspect", "--model", "-", "--states", &csv][..], &["evaluate", "-"]] {
        piped(command, b"").refused(2, &["-: expected a model's file or the directory of a run"]);
    }
    piped(&["inspect", "--model", &run, "--states", "-"], b"").refused(1, &["standard input: the file is empty"]);

    // Recorded motion through a pipe is the motion of the file.
    let long = ["--state", "1,2,0.5,0", "--t-end", "2", "--dt", "0.1", "--beyond-range"];
    assert_eq!(lnn(&[&["rollout", &run, "--out", &csv, "--overwrite"], &long[..]].concat()).code, Some(0));
    let columns = ["--coords", "theta1,theta2", "--json"];
    let of_file = lnn(&[&["check", &csv], &columns[..]].concat());
    let of_pipe = piped(&[&["check", "-"], &columns[..]].concat(), fs::read(&csv).unwrap().as_slice());
    assert_eq!((of_pipe.code, of_pipe.code), (of_file.code, Some(0)), "{}", of_pipe.stderr);
    assert_eq!(of_pipe.stdout, of_file.stdout.replace(&csv, "standard input"));
    let bad = piped(&[&["check", "-"], &columns[..]].concat(), b"t,theta1,theta2\n0,1,x\n");
    bad.refused(1, &["standard input: row 2, column theta2"]);
}

#[test]
fn a_motion_may_leave_the_training_range() {
    let folder = Folder::new();
    let run = run_directory(&folder);
    let csv = text(&folder.path("motion.csv"));
    let moved = |more: &[&str]| {
        let start = ["--state", "1,2,9.999,-10.5", "--t-end", "0.2", "--dt", "0.1", "--out", &csv, "--overwrite"];
        lnn(&[&["rollout", &run], &start[..], more].concat())
    };
    moved(&[]).refused(1, &["left the training range at t = 0", "theta2_dot", "--beyond-range"]);
    let (svg, page) = (text(&folder.path("motion.svg")), text(&folder.path("motion.html")));
    let beyond = moved(&["--beyond-range", "--plot", &svg]);
    assert_eq!(beyond.code, Some(0), "{}", beyond.stderr);
    assert!(beyond.stderr.starts_with("note: left the training range at t = 0: theta2_dot"), "{}", beyond.stderr);
    assert_eq!(fs::read_to_string(&csv).unwrap().lines().count(), 4);
    assert!(fs::read(&svg).unwrap().starts_with(b"<svg"));
    let beyond = moved(&["--beyond-range", "--json", "--plot", &page]);
    let facts: Value = serde_json::from_str(&beyond.stdout).unwrap();
    assert_eq!((&facts["samples"], &facts["time_unit"]), (&3.into(), &"s".into()));
    assert_eq!(facts["left_training_range"]["column"], "theta2_dot");
    assert!(fs::read_to_string(&page).unwrap().contains("Energy of the model"));
    // Neither the model nor what is there already is drawn over.
    lnn(&[&["rollout", &run, "--out", "-", "--plot", &page], &START[..]].concat()).refused(1, &["--overwrite"]);
    moved(&["--plot", "motion.png"]).refused(2, &["--plot", ".svg or .html"]);
    let both = [&["rollout", &run, "--out", "-", "--json"], &START[..]].concat();
    lnn(&both).refused(2, &["--json", "standard output"]);
}

#[test]
fn unlike_units_are_not_drawn_on_one_axis() {
    let folder = Folder::new();
    let [csv, svg] = ["motion.csv", "motion.svg"].map(|name| text(&folder.path(name)));
    let motion = ["rollout", "--system", "spring-pendulum", "--state", "1.2,0.5,0,0", "--t-end", "1", "--dt", "0.1"];
    lnn(&[&motion[..], &["--out", &csv, "--plot", &svg]].concat()).succeeded();
    let drawn = fs::read_to_string(&svg).unwrap();
    for label in [">r [m]<", ">theta [rad]<", ">r sin theta [m]<"] {
        assert_eq!(drawn.matches(label).count(), 1, "{label}");
    }
    // Pendula share a unit, and a panel.
    let motion = ["rollout", "--system", "double-pendulum", "--state", "1,0.5,0,0", "--t-end", "1", "--dt", "0.1"];
    lnn(&[&motion[..], &["--out", &csv, "--plot", &svg, "--overwrite"]].concat()).succeeded();
    assert!(fs::read_to_string(&svg).unwrap().contains(">theta1, theta2 [rad]<"));
}

#[test]
fn shells_and_manuals_know_the_program() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = lnn(&["completions", shell]);
        assert_eq!((script.code, script.stderr.as_str()), (Some(0), ""));
        // Not every shell completes values.
        let value = if ["bash", "zsh", "fish"].contains(&shell) { "lorentzian-sylvester" } else { "penalty" };
        for word in ["rollout", "beyond-range", value] {
            assert!(script.stdout.contains(word), "{word} is not completed in {shell}");
        }
    }
    let page = lnn(&["man"]).stdout;
    assert!(page.contains(".TH lnn 1") && page.contains("lnn\\-train(1)"), "{page}");
    let page = lnn(&["man", "train"]).stdout;
    assert!(page.contains("\\-\\-checkpoint\\-every") && page.contains(".TH lnn-train 1"), "{page}");
    lnn(&["man", "trian"]).refused(2, &["trian", "did you mean \"train\"?"]);
    let out = folder.path("pages");
    assert_eq!(lnn(&["man", "--out", &text(&out)]).code, Some(0));
    let has = |name: &str| Path::new(&out).join(name).is_file();
    assert!(["lnn.1", "lnn-train.1", "lnn-fit.1", "lnn-man.1"].into_iter().all(has));
    assert!(!has("lnn-help.1"));
}

#[test]
fn lists_are_one_object_per_line() {
    let run = lnn(&["systems", "--json"]);
    assert!(run.objects().len() > 5 && run.objects().iter().all(|object| object["name"].is_string()));
}

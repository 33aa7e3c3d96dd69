//! `lnn-studies experiment` from outside: everything runs, nothing finished runs twice.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn lnn(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lnn-studies"))
        .arg("experiment")
        .args(arguments)
        .env_remove("LNN_LOG")
        .output()
        .unwrap()
}

/// What a program printed that said nothing on standard error but how far it is.
fn said_by(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.lines().all(|line| line.starts_with("progress: ")), "{said}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// One object a line.
fn objects(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// A text in one line.
fn joined(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Sentence that a report begins with.
fn lead(report: &str) -> String {
    let (_, rest) = report.split_once("class=\"lead\">").unwrap();
    rest.split_once("</p>").unwrap().0.replace("&#39;", "'")
}

fn smoke(name: &str, out: &Path, threads: &str) -> String {
    said_by(&lnn(&[name, "--scale", "smoke", "--threads", threads, "--out", out.to_str().unwrap()]))
}

#[test]
fn every_experiment_of_the_paper_runs() {
    let listed = said_by(&lnn(&[]));
    let out = tempfile::tempdir().unwrap();
    let arguments = ["--scale", "smoke", "--out", out.path().to_str().unwrap()];
    let all = said_by(&lnn(&[&["all", "--list"], &arguments[..]].concat()));
    // The page of the paper's tables lists what the program lists.
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/paper.md")).unwrap();
    let experiments = objects(&said_by(&lnn(&["--json"])));
    assert!(experiments.len() > 10);
    for experiment in experiments {
        let [name, title, paper] = ["name", "title", "paper"].map(|key| experiment[key].as_str().unwrap());
        assert!(listed.contains(name) && listed.contains(paper));
        assert!(page.contains(&format!("| `{name}` | {paper} |")), "{name}");
        // Of the experiments that take longest, some rows; the next test reads a hole in Cartesian coordinates.
        let only = match name {
            "black-holes" => "spherical",
            "boundary" => "the paper's choices",
            _ => "",
        };
        let printed = said_by(&lnn(&[&[name, "--threads", "2", "--only", only], &arguments[..]].concat()));
        assert!(printed.contains(title));
        let folder = out.path().join(format!("{name}-smoke"));
        let table = fs::read_to_string(folder.join("table.csv")).unwrap();
        let runs = objects(&said_by(&lnn(&[&[name, "--list", "--json"], &arguments[..]].concat())));
        let runs: Vec<[&str; 2]> =
            runs.iter().map(|run| ["run", "row"].map(|key| run[key].as_str().unwrap())).collect();
        assert!(runs.iter().all(|[run, _]| all.contains(run)));
        let runs: Vec<[&str; 2]> = runs.into_iter().filter(|[_, row]| row.starts_with(only)).collect();
        for [run, row] in &runs {
            assert!(table.contains(&format!("\"{row}\"")), "{table}");
            for file in ["record.json", "model.safetensors", "config.toml", "report.html"] {
                assert!(folder.join(run).join(file).is_file(), "{run}: no {file}");
            }
        }
        let report = fs::read_to_string(folder.join("report.html")).unwrap();
        assert!(report.contains(title) && report.matches("<figure").count() >= 2);
        // The report and the screen say the same.
        let sentence = lead(&report);
        assert!(sentence.starts_with("Lowest loss ") && joined(&printed).contains(&sentence), "{sentence}");
        assert!(report.len() < 2_000_000, "{name}: {}", report.len());
        if name == "black-holes" {
            assert!(fs::read_to_string(folder.join("readings.csv")).unwrap().contains("innermost stable orbit"));
        }
        // Relativistic runs are held to their signature, not to positive eigenvalues.
        if name == "ads4-geodesic" {
            let config = fs::read_to_string(folder.join(runs[0][0]).join("config.toml")).unwrap();
            assert!(config.contains("kind = \"lorentzian-sylvester\"") && config.contains("time = \"t\""), "{config}");
        }
    }
}

#[test]
fn a_hole_of_ones_own_is_read_like_those_of_the_experiment() {
    let out = tempfile::tempdir().unwrap();
    let hole = ["--system", "reissner-nordstrom-cartesian", "--param", "Q=0.5", "--scale", "smoke", "--only", "quick"];
    let out_dir = ["--threads", "1", "--out", out.path().to_str().unwrap()];
    let printed = said_by(&lnn(&[&["black-holes"], &hole[..], &out_dir].concat()));
    assert!(printed.contains("quick, reissner-nordstrom-cartesian, Q = 0.5"), "{printed}");
    let folder = out.path().join("black-holes-smoke");
    let readings = fs::read_to_string(folder.join("readings.csv")).unwrap();
    for (picture, head) in [("orbits.svg", &b"<svg"[..]), ("sky.png", b"\x89PNG")] {
        let run = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir()).unwrap();
        assert!(fs::read(run.join(picture)).unwrap().starts_with(head), "{picture}");
    }
    assert!(readings.contains("parameter Q") && !readings.contains("kerr"), "{readings}");
    let refused = lnn(&[&["old-tricks"], &hole[..4], &out_dir].concat());
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && told.contains("--system: old-tricks "), "{told}");
}

#[test]
fn finished_runs_are_kept_and_missing_ones_made_again() {
    let out = tempfile::tempdir().unwrap();
    smoke("old-tricks", out.path(), "1");
    let folder = out.path().join("old-tricks-smoke");
    let read = |file: &str| fs::read(folder.join(file)).unwrap();
    let table = read("table.csv");
    let model = read("liu-tricks-seed0/model.safetensors");
    let kept = "cranmer-initialisation-seed0/record.json";
    let record = String::from_utf8(read(kept)).unwrap();
    // A mark that a new run would not leave; one run lost, one made with another configuration.
    let marked = record.replace("\"seconds\":", "\"seconds\":1000000");
    assert_ne!(marked, record);
    fs::write(folder.join(kept), &marked).unwrap();
    fs::remove_file(folder.join("liu-tricks-seed0/record.json")).unwrap();
    let changed = "paper-s-model-seed0/config.toml";
    let config = String::from_utf8(read(changed)).unwrap();
    fs::write(folder.join(changed), config.replace("rate = 0.001", "rate = 0.002")).unwrap();

    // Of the latter an hour of work could be lost.
    let again = ["old-tricks", "--scale", "smoke", "--threads", "2", "--out", out.path().to_str().unwrap()];
    let refused = lnn(&again);
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("paper-s-model-seed0: ") && stderr.contains("another configuration"), "{stderr}");
    let curves = format!("x={}", folder.join("curves.csv").display());
    let curve: String = (0..20).map(|k| format!("{k},{}\n", 1.0 / f64::from(k + 1))).collect();
    fs::write(folder.join("curves.csv"), format!("seconds,validation_loss\n{curve}")).unwrap();
    let refused = lnn(&[&again[..], &["--overwrite", "--beside", &curves]].concat());
    assert_eq!(refused.status.code(), Some(1));
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(stderr.contains("curves.csv: this command reads it"), "{stderr}");
    assert!(String::from_utf8(read(changed)).unwrap().contains("rate = 0.002"));
    said_by(&lnn(&[&again[..], &["--overwrite"]].concat()));
    assert_eq!(String::from_utf8(read(kept)).unwrap(), marked);
    assert_eq!(read(changed), config.into_bytes());
    // The same numbers on another number of threads.
    assert_eq!(read("table.csv"), table);
    assert_eq!(read("liu-tricks-seed0/model.safetensors"), model);

    // A damaged record is named and its run left out; the tables of the others are made.
    fs::write(folder.join("liu-tricks-seed0/record.json"), &record[..record.len() / 2]).unwrap();
    let merged = lnn(&["merge", "old-tricks", "--scale", "smoke", "--out", out.path().to_str().unwrap()]);
    let stderr = String::from_utf8_lossy(&merged.stderr);
    assert_eq!(merged.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("liu-tricks-seed0/record.json: ") && !stderr.contains("another configuration"), "{stderr}");
    let of_others = String::from_utf8(read("table.csv")).unwrap();
    let whole = String::from_utf8(table).unwrap();
    let different = of_others.lines().zip(whole.lines()).filter(|(a, b)| a != b).count();
    assert!(!merged.stdout.is_empty() && different == 1 && of_others.lines().count() == whole.lines().count());
    let refused = lnn(&again);
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(1) && stderr.contains("liu-tricks-seed0/record.json: "), "{stderr}");
}

#[test]
fn more_seeds_are_more_runs_of_the_same_rows() {
    let out = tempfile::tempdir().unwrap();
    let path = out.path().to_str().unwrap();
    said_by(&lnn(&["scaling", "--scale", "smoke", "--seeds", "2", "--out", path]));
    let folder = out.path().join("scaling-smoke");
    let table = fs::read_to_string(folder.join("table.csv")).unwrap();
    assert_eq!(table.lines().count(), 4);
    assert!(table.lines().skip(1).all(|line| line.split("\",").nth(1).unwrap().starts_with("2,0,")), "{table}");
    // Numbers are numbers, and every run has a line with its choices.
    let place = table.lines().next().unwrap().split(',').position(|name| name == "loss_median").unwrap();
    let first = table.lines().nth(1).unwrap().split(',').collect::<Vec<_>>();
    let [median, low, high] = [0, 1, 2].map(|k| first[place + k].parse::<f64>().unwrap());
    assert!(low < median && median < high && (low + high - 2.0 * median).abs() < 1e-12);
    let runs = fs::read_to_string(folder.join("runs.csv")).unwrap();
    let header: Vec<&str> = runs.lines().next().unwrap().split(',').collect();
    assert!(runs.lines().count() == 7 && header.contains(&"network.scaling") && header.contains(&"loss"), "{runs}");
    let models = ["physical-scaling-seed0", "physical-scaling-seed1"]
        .map(|run| fs::read(folder.join(run).join("model.safetensors")).unwrap());
    assert_ne!(models[0], models[1]);
}

#[test]
fn single_rows_can_be_run_and_tables_say_what_they_compare() {
    let out = tempfile::tempdir().unwrap();
    let path = out.path().to_str().unwrap();
    let only = |text| lnn(&["scaling", "--scale", "smoke", "--only", text, "--out", path]);
    let printed = said_by(&only("DyT"));
    let table = || fs::read_to_string(out.path().join("scaling-smoke/table.csv")).unwrap();
    assert!(table().lines().count() == 2 && table().lines().nth(1).unwrap().starts_with("\"DyT\""), "{}", table());
    for part in ["RAdam", "lambda = 5", "without the penalty"] {
        assert!(printed.contains(part), "{printed} lacks {part}");
    }
    // Without the rows to compare there is no reduction of ours beside the paper's.
    let is_missing = |printed: &str| {
        let line = printed.lines().find(|line| line.contains("physical scaling  no scaling") && line.contains("40.9"));
        line.is_some_and(|line| line.split_whitespace().any(|word| word == "-"))
    };
    assert!(is_missing(&printed), "{printed}");
    let printed = smoke("scaling", out.path(), "1");
    assert_eq!(table().lines().count(), 4);
    assert!(printed.contains("40.9") && !is_missing(&printed), "{printed}");
    let refused = only("dyt");
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert_eq!((refused.status.code(), stderr.lines().count()), (Some(2), 1), "{stderr}");
    assert!(stderr.contains("--only") && stderr.contains("`physical scaling`, `no scaling`, `DyT`"), "{stderr}");
}

#[test]
fn wrong_names_and_directories_are_refused() {
    for (arguments, code, part) in [
        (["activation", "--scale", "smoke"], 2, "activations"),
        (["scaling", "--scale", "tiny"], 2, "tiny"),
        (["scaling", "--seeds", "0"], 2, "--seeds"),
        (["scaling", "--seeds", "-1"], 2, "10000"),
        (["scaling", "--seeds", "1.5"], 2, "--seeds"),
        (["scaling", "--threads", "0"], 2, "256"),
        (["scaling", "--seeds", "18446744073709551615"], 2, "10000"),
        (["scaling", "--out", "Cargo.toml/x"], 1, "Cargo.toml"),
    ] {
        let output = lnn(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{stderr}");
        assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1 && stderr.contains(part), "{stderr}");
    }
}

/// `NAME: share 1/2 is finished, ..` and the rest of what a share prints.
fn share(out: &Path, given: &str) -> String {
    let out = out.to_str().unwrap();
    said_by(&lnn(&["scaling", "--scale", "smoke", "--threads", "1", "--shard", given, "--out", out]))
}

#[test]
fn shares_together_make_what_one_process_makes() {
    let temporary = tempfile::tempdir().unwrap();
    let [alone, shared] = ["alone", "shared"].map(|name| temporary.path().join(name));
    smoke("scaling", &alone, "1");
    let list = || {
        objects(&said_by(&lnn(&["scaling", "--scale", "smoke", "--list", "--json", "--out", shared.to_str().unwrap()])))
    };
    let states = || list().iter().map(|run| run["state"].as_str().unwrap().to_string()).collect::<Vec<_>>();
    let merge = || lnn(&["merge", "scaling", "--scale", "smoke", "--out", shared.to_str().unwrap()]);
    assert_eq!(states(), ["open"; 3]);
    // Looking leaves no traces.
    assert!(!shared.exists());
    let refused = merge();
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(1) && stderr.contains("none of 3 runs is finished"), "{stderr}");

    let printed = share(&shared, "1/2");
    assert!(
        printed.contains("share 1/2 is finished, 2 runs") && printed.contains("lnn-studies experiment merge scaling")
    );
    assert_eq!(states(), ["finished", "open", "finished"]);
    let folder = shared.join("scaling-smoke");
    assert!(!folder.join("table.csv").exists());
    // Of a part there are tables too.
    let part = merge();
    let stderr = String::from_utf8_lossy(&part.stderr);
    assert!(part.status.success() && stderr.contains("1 run is not finished"), "{stderr}");
    let report = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(report.contains("3 runs, 2 of them finished"));

    // A run that another process works on is left to it, and listed with it.
    let run = folder.join("no-scaling-seed0");
    fs::create_dir_all(&run).unwrap();
    let lock = fs::File::create(run.join(".lnn.lock")).unwrap();
    fs::write(run.join(".lnn.lock"), "process 7\nhost far\n").unwrap();
    lock.lock().unwrap();
    let listed = &list()[1];
    let owner = (listed["owner"]["process"].as_u64(), listed["owner"]["host"].as_str());
    assert_eq!((listed["state"].as_str(), owner), (Some("in-progress"), (Some(7), Some("far"))));
    let second = ["scaling", "--scale", "smoke", "--shard", "2/2", "--out", shared.to_str().unwrap()];
    let refused = lnn(&second);
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(1) && stderr.contains("process 7 on far"), "{stderr}");
    // Its death frees the lock.
    drop(lock);
    assert_eq!(states(), ["finished", "open", "finished"]);
    said_by(&lnn(&second));
    assert_eq!(states(), ["finished"; 3]);

    // The bytes do not depend on who made the records, nor on how often they are merged.
    let files = |out: &Path| -> Vec<(String, Vec<u8>)> {
        let entries = fs::read_dir(out.join("scaling-smoke")).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> = entries.filter(|path| path.is_file()).collect();
        files.sort();
        let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_string();
        files.iter().map(|path| (name(path), fs::read(path).unwrap())).collect()
    };
    for _ in 0..2 {
        said_by(&merge());
        assert!(files(&shared) == files(&alone));
    }
    assert!(files(&alone).iter().any(|(name, _)| name == "report.html"));
}

#[test]
fn arrays_of_slurm_are_shares() {
    let out = tempfile::tempdir().unwrap();
    let task = |variables: &[(&str, &str)], arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lnn-studies"));
        variables.iter().for_each(|(part, value)| _ = command.env(format!("SLURM_ARRAY_TASK_{part}"), value));
        let out = ["--scale", "smoke", "--out", out.path().to_str().unwrap()];
        command.args(["experiment", "scaling"]).args(out).args(arguments).output().unwrap()
    };
    let last = [("ID", "3"), ("COUNT", "3"), ("MIN", "1"), ("MAX", "3")];
    let output = task(&last, &["--json"]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && stderr.contains("share 3/3 of the runs, by SLURM_ARRAY_TASK_ID"), "{stderr}");
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((object["shard"].as_str(), object["finished"].as_u64()), (Some("3/3"), Some(1)));
    let made = |run: &str| out.path().join("scaling-smoke").join(run).join("record.json").exists();
    assert_eq!(["physical-scaling-seed0", "no-scaling-seed0", "dyt-seed0"].map(made), [false, false, true]);
    // A share that is given has the last word, and does not fail for variables that tell none.
    let gap = [("ID", "7"), ("COUNT", "2"), ("MIN", "3"), ("MAX", "7")];
    let refused = task(&gap, &[]);
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && stderr.contains("--shard I/N"), "{stderr}");
    let output = task(&gap, &["--shard", "1/3"]);
    assert!(output.status.success() && output.stderr.is_empty());
    assert_eq!(["physical-scaling-seed0", "no-scaling-seed0", "dyt-seed0"].map(made), [true, false, true]);
}

/// A metric that expands; with the name of its time.
#[test]
fn metrics_that_depend_on_their_time_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "name = \"expanding\"\n".to_string();
    for name in ["t", "x", "y", "z"] {
        let kind = if name == "t" { "time_like = true" } else { "velocity_bounds = [-1, 1]" };
        text += &format!("[[coordinates]]\nname = \"{name}\"\nbounds = [-1, 1]\n{kind}\n");
    }
    text += "[metric]\n\"t,t\" = \"-1\"\n";
    ["x", "y", "z"].iter().for_each(|name| text += &format!("\"{name},{name}\" = \"exp(0.1*t)\"\n"));
    let [file, out] = ["metric.toml", "x"].map(|name| folder.path().join(name).to_str().unwrap().to_string());
    fs::write(&file, text).unwrap();
    let refused = lnn(&["black-holes", "--system", &file, "--list", "--out", &out]);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{told}");
    assert!(told.contains("--system") && told.contains("time t"), "{told}");
}

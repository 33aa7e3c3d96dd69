//! What is there already is not lost: models, evaluations, motions, data.

use crate::program::fit::{COLUMNS, pendulum};
use crate::running::{Folder, Run, command, lnn, text};
use lnn::lagrangian::SystemInstance;
use lnn::presets::Preset;
use std::fs;
use std::path::Path;

/// A training of an instant.
fn configuration(folder: &Folder) -> String {
    let mut config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (128, 32, 32);
    config.network.hidden = vec![4];
    config.phases[0].epochs = 2;
    folder.file("c.toml", toml::to_string(&config).unwrap())
}

fn succeeded(run: &Run) {
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_model_is_replaced_on_demand_alone_and_leaves_nothing_behind() {
    let folder = Folder::new();
    let (config, out) = (configuration(&folder), text(&folder.path("out")));
    let train = |seed: &str, more: &[&str]| {
        lnn(&[&["train", "--config", &config, "--seed", seed, "--out", &out], more].concat())
    };
    let read = |name: &str| fs::read(folder.path("out").join(name)).unwrap();
    succeeded(&train("1", &[]));
    let model = text(&folder.path("out/model.safetensors"));
    succeeded(&lnn(&["evaluate", &model, "--starts", "1", "--until", "0.1"]));
    let (first, before) = (read("model.safetensors"), names(&folder.path("out")));
    let there = "out: there is a finished training of double-pendulum (seed 1, 2 epochs); --overwrite replaces it";
    train("2", &[]).refused(1, &[there, "choose another directory (--out)"]);
    let data = folder.file("swings.csv", pendulum(3, false, 0.0));
    let fit = |data: &str, more: &[&str]| {
        let base = ["fit", data, "--out", &out, "--hidden", "4", "--epochs", "1"];
        lnn(&[&base[..], &COLUMNS, more].concat())
    };
    let refused = fit(&data, &[]);
    assert!(refused.code == Some(1) && refused.stderr.contains(there), "{}", refused.stderr);
    assert!(read("model.safetensors") == first && names(&folder.path("out")) == before);

    // Its own configuration is read and would be written.
    let own = text(&folder.path("out/../out/config.toml"));
    lnn(&["train", "--config", &own, "--out", &out, "--overwrite"])
        .refused(1, &["config.toml", "this command reads it"]);

    // A fit takes its place: pictures of another name, the evaluation of the old model and captions of both go.
    assert!(before.contains(&"lagrangian.svg".to_string()) && before.contains(&"evaluation".to_string()));
    fs::write(folder.path("out/notes.txt"), "mine").unwrap();
    let replaced = fit(&data, &["--overwrite"]);
    assert_eq!(replaced.code, Some(0), "{}", replaced.stderr);
    let after = names(&folder.path("out"));
    assert!(!after.contains(&"lagrangian.svg".to_string()) && !after.contains(&"evaluation".to_string()), "{after:?}");
    assert!(after.contains(&"notes.txt".to_string()) && read("model.safetensors") != first, "{after:?}");
    let refused = fit(&data, &[]);
    assert!(refused.stderr.contains("a finished fit of measured (seed 0, 1 epochs)"), "{}", refused.stderr);

    // Data that bear the name of a result.
    let own = folder.file("history.csv", pendulum(3, false, 0.0));
    let here = text(folder.0.path());
    let run = lnn(&[&["fit", &own, "--out", &here, "--overwrite"], &COLUMNS[..]].concat());
    assert!(run.code == Some(1) && run.stderr.contains("history.csv: this command reads it"), "{}", run.stderr);
}

#[test]
fn without_a_directory_a_number_is_found() {
    let folder = Folder::new();
    let config = configuration(&folder);
    let here = |arguments: &[&str]| Run::of(command(arguments).current_dir(folder.0.path()));
    let train = ["train", "--config", &config];
    succeeded(&here(&train));
    let second = here(&train);
    assert_eq!(second.code, Some(0));
    let note = "note: runs/double-pendulum: there is a finished training of double-pendulum (seed 0, 2 epochs); writing into \
                runs/double-pendulum-2\n";
    assert_eq!(second.stderr, note);
    assert!(second.stdout.contains("report: runs/double-pendulum-2/report.html"));
    assert_eq!(names(&folder.path("runs")), ["double-pendulum", "double-pendulum-2"]);
    let model = |run: &str| fs::read(folder.path("runs").join(run).join("model.safetensors")).unwrap();
    let first = model("double-pendulum");
    succeeded(&here(&[&train[..], &["--seed", "7", "--overwrite"]].concat()));
    assert!(model("double-pendulum") != first && names(&folder.path("runs")).len() == 2);

    let evaluate = ["evaluate", "runs/double-pendulum/model.safetensors", "--starts", "1", "--until", "0.1"];
    succeeded(&here(&evaluate));
    assert!(here(&evaluate).stderr.starts_with("note: runs/double-pendulum/evaluation: there is an evaluation of "));
    assert!(folder.path("runs/double-pendulum/evaluation-2/evaluation.json").is_file());
    let into = |out: &str| here(&[&evaluate[..], &["--out", out]].concat());
    into("runs/double-pendulum/evaluation-2")
        .refused(1, &["an evaluation of double-pendulum", "--overwrite replaces it"]);
    let over = here(&[&evaluate[..], &["--out", "runs/double-pendulum-2", "--overwrite"]].concat());
    over.refused(1, &["runs/double-pendulum-2: there is a finished training", "an evaluation would replace"]);
    assert!(folder.path("runs/double-pendulum-2/summary.json").is_file());
}

#[cfg(unix)]
#[test]
fn a_motion_never_takes_the_place_of_its_model() {
    let folder = Folder::new();
    let file = folder.file("m", crate::running::model().to_bytes().unwrap());
    let bytes = fs::read(&file).unwrap();
    let path = |name: &str| text(&folder.path(name));
    fs::create_dir(path("d")).unwrap();
    std::os::unix::fs::symlink("../m", path("d/link")).unwrap();
    fs::hard_link(&file, path("hard")).unwrap();
    let rollout = |out: &str, more: &[&str]| {
        let base = ["rollout", &file, "--state", "1,1,0,0", "--t-end", "0.02", "--dt", "0.01", "--out", out];
        lnn(&[&base[..], more].concat())
    };
    for out in ["m", "d/../m", "./m", "d/link", "hard"] {
        rollout(&path(out), &[]).refused(1, &["never overwrites"]);
        rollout(&path(out), &["--overwrite"]).refused(1, &["never overwrites"]);
    }
    let other = folder.file("thesis.txt", "years of work");
    rollout(&other, &[]).refused(1, &["thesis.txt: there is a file already; --overwrite replaces it"]);
    assert_eq!((fs::read(&file).unwrap(), fs::read_to_string(&other).unwrap()), (bytes, "years of work".to_string()));
    succeeded(&rollout(&other, &["--overwrite"]));
    assert!(fs::read_to_string(&other).unwrap().starts_with("t,theta1"));
    // An empty file, as of a shell's redirection, and devices hold nothing.
    succeeded(&rollout(&folder.file("empty.csv", ""), &[]));
    succeeded(&rollout("/dev/null", &[]));
}

/// One rule for every command that writes a file: nothing that is read, nothing that holds something without `--overwrite`.
#[test]
fn system_files_and_tables_are_replaced_on_demand_alone() {
    let folder = Folder::new();
    let swing: String = (0..120).map(|k| format!("{},{}\n", 0.05 * f64::from(k), (0.1 * f64::from(k)).sin())).collect();
    let data = folder.file("swing.csv", format!("t,x\n{swing}"));
    let spring = "name = \"spring\"\nlagrangian = \"x_dot^2/2 - k*x^2/2\"\n[parameters]\nk = 3.0\n\
                  [[coordinates]]\nname = \"x\"\nbounds = [-1, 1]\nvelocity_bounds = [-3, 3]\n";
    let system = folder.file("spring.toml", spring);
    let circle: String =
        (0..200).map(|k| 0.1 * f64::from(k)).map(|t| format!("{t},{},{}\n", t.cos(), t.sin())).collect();
    let circle = folder.file("circle.csv", format!("t,x,y\n{circle}"));
    let kept = folder.file("kept.toml", "# months of work");
    let identify = ["identify", &data, "--system", &system];
    let formula = ["formula", &data, "--coords", "x", "--basis", "polynomial:2", "--bootstraps", "1"];
    let constraints = ["constraints", &circle, "--coords", "x,y"];
    for (command, own) in [(&identify[..], &system), (&formula[..], &data), (&constraints[..], &circle)] {
        let run = |out: &str, more: &[&str]| lnn(&[command, &["--out", out], more].concat());
        run(&kept, &[]).refused(1, &["kept.toml: there is a file already; --overwrite replaces it"]);
        if own.ends_with(".toml") || command[0] == "constraints" {
            run(own, &["--overwrite"]).refused(1, &["this command reads it", "never overwrites"]);
        }
        assert_eq!(fs::read_to_string(&kept).unwrap(), "# months of work");
    }
    assert_eq!(fs::read_to_string(&system).unwrap(), spring);
    succeeded(&lnn(&[&identify[..], &["--out", &kept, "--overwrite"]].concat()));
    assert!(fs::read_to_string(&kept).unwrap().contains("lagrangian"));
    // On standard output the file stands alone.
    let piped = lnn(&[&identify[..], &["--out", "-"]].concat());
    assert!(piped.code == Some(0) && toml::from_str::<toml::Table>(&piped.stdout).is_ok(), "{}", piped.stdout);
    assert!(piped.stderr.contains("constant"), "{}", piped.stderr);
}

//! The crate inside another program: global state, errors, dependencies.

use super::floors::LIBRARIES;
use lnn::data::Dataset;
use lnn::lagrangian::{EulerLagrange, Mechanics, Terms, systems::DoublePendulum};
use lnn::network::{ModelFile, NetworkLagrangian};
use lnn::rollout::RolloutOptions;
use lnn::training::Objective;
use lnn::{analysis, linalg, network, recording, rollout as motion, scalar, storage, tape, training};
use std::path::{Path, PathBuf};
use std::process::Command;

const fn shared<T: Send + Sync + 'static>() {}
const fn error<T: std::error::Error + Send + Sync + 'static>() {}

/// What embedders hold goes to any thread and may be used by several.
const _: () = {
    shared::<NetworkLagrangian<f32>>();
    shared::<Mechanics<DoublePendulum, f64>>();
    shared::<Box<dyn EulerLagrange<scalar::Dd>>>();
    shared::<tape::Program<f64>>();
    shared::<tape::Replay<f64>>();
    shared::<Terms<f64>>();
    shared::<Dataset<f32>>();
    shared::<Objective<f32>>();
    shared::<lnn::configuration::Config>();
    shared::<training::Trained<f32>>();
    shared::<training::Hooks>();
    shared::<ModelFile<f32>>();
    shared::<motion::Trajectory<f64>>();
    shared::<motion::Rollout<f64>>();
    shared::<RolloutOptions<f64>>();
    shared::<recording::Recording>();
    shared::<linalg::Workspace<f64>>();
    shared::<lnn::tape::Evaluation<f32>>();

    error::<lnn::lagrangian::MechanicsError>();
    error::<lnn::lagrangian::SystemError>();
    error::<linalg::LinalgError>();
    error::<motion::RolloutError>();
    error::<motion::UnderflowCause>();
    error::<network::NetworkError>();
    error::<network::UnknownActivation>();
    error::<network::ModelFileError>();
    error::<recording::TrajectoryError>();
    error::<scalar::UnreadableNumber>();
    error::<storage::ReadError>();
    error::<tape::TapeError>();
    error::<analysis::GridError>();
    error::<training::CheckpointError>();
    error::<lnn::configuration::ConfigError>();
    error::<lnn::data::DatasetError>();
    error::<training::RecipeError>();
    error::<lnn::data::SamplingError>();
    error::<training::StepError>();
    error::<training::TrainingError>();
    error::<training::ThreadsError>();
    error::<lnn::pipeline::PipelineError>();
    error::<lnn::relativity::RelativityError>();
};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Source files below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => sources(&path, found),
            false if path.extension().is_some_and(|e| e == "rs") => found.push(path),
            _ => {}
        }
    }
}

#[test]
fn nothing_is_global() {
    let mut files = Vec::new();
    LIBRARIES.iter().for_each(|folder| sources(&root().join(folder), &mut files));
    assert!(files.len() > 100);
    let mut found = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let cells = ["Atomic", "Mutex", "Lock", "OnceCell", "RefCell", "Cell<"];
        let changes = |line: &str| line.contains("thread_local!") || cells.iter().any(|cell| line.contains(cell));
        let statics = text.lines().filter(|line| {
            let code = line.trim_start();
            let item = ["static ", "pub static ", "pub(crate) static ", "pub(super) static ", "thread_local!"];
            item.iter().any(|start| code.starts_with(start)) && changes(code)
        });
        found.extend(statics.map(|line| (file.strip_prefix(root()).unwrap().to_path_buf(), line.trim().to_string())));
    }
    // Names of temporary files must differ within a process; nothing else is remembered between calls.
    let expected = "static COUNTER: AtomicUsize = AtomicUsize::new(0);".to_string();
    assert_eq!(found, [(PathBuf::from("crates/lnn-engine/src/support/storage/files.rs"), expected)]);
}

/// Crates that a build of a package with these features links.
fn dependencies(package: &str, features: &[&str]) -> Vec<String> {
    let mut command = Command::new(env!("CARGO"));
    command.args([
        "tree",
        "--package",
        package,
        "--edges",
        "normal",
        "--prefix",
        "none",
        "--offline",
        "--locked",
        "--manifest-path",
    ]);
    let output = command.arg(root().join("Cargo.toml")).args(features).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut names: Vec<String> = text.lines().filter_map(|l| l.split(' ').next()).map(String::from).collect();
    names.sort();
    names.dedup();
    names
}

#[test]
fn the_library_leaves_the_program_out() {
    let program = ["clap", "clap_complete", "clap_mangen", "indicatif", "signal-hook", "tracing-subscriber"];
    let learning =
        ["argmin", "faer", "nalgebra", "ode_solvers", "rayon", "safetensors", "serde_json", "tracing", "zip"];
    let (all, library, engine) = (
        dependencies("lnn-cli", &[]),
        dependencies("lnn", &[]),
        dependencies("lnn-engine", &["--no-default-features"]),
    );
    let has = |found: &[String], name: &str| found.iter().any(|d| d == name);
    for name in program {
        assert!(has(&all, name) && !has(&library, name), "the program uses {name}, the library does not");
    }
    for name in learning {
        assert!(has(&library, name) && !has(&engine, name), "the library uses {name}, the engine does not");
    }
    assert!(engine.len() <= 20, "{} packages: {engine:?}", engine.len());
    assert!(has(&dependencies("lnn", &["--no-default-features", "--features", "faer"]), "faer"));
}

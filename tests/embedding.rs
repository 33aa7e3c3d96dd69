//! The crate inside another program: threads, global state, errors, dependencies.

use lnn::lagrangian::{EulerLagrange, HandWritten, Request, Terms, build, systems::double_pendulum::DoublePendulum};
use lnn::network::{NetworkLagrangian, file::ModelFile};
use lnn::rollout::{Options, rollout, rollout_many};
use lnn::training::{Dataset, Objective, Penalty};
use lnn::{analysis, linalg, network, recording, rollout as motion, scalar, storage, tape, training};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

const fn shared<T: Send + Sync + 'static>() {}
const fn error<T: std::error::Error + Send + Sync + 'static>() {}

/// What embedders hold goes to any thread and may be used by several.
const _: () = {
    shared::<NetworkLagrangian<f32>>();
    shared::<HandWritten<DoublePendulum, f64>>();
    shared::<Box<dyn EulerLagrange<scalar::Dd>>>();
    shared::<tape::Program<f64>>();
    shared::<tape::Replay<f64>>();
    shared::<Terms<f64>>();
    shared::<Dataset<f32>>();
    shared::<Objective<f32>>();
    shared::<training::Config>();
    shared::<training::Trained<f32>>();
    shared::<training::Hooks>();
    shared::<ModelFile<f32>>();
    shared::<motion::Trajectory<f64>>();
    shared::<motion::Rollout<f64>>();
    shared::<Options<f64>>();
    shared::<recording::Recording>();
    shared::<linalg::Workspace<f64>>();
    shared::<network::Chunk<f32>>();

    error::<lnn::lagrangian::MechanicsError>();
    error::<lnn::lagrangian::SystemError>();
    error::<linalg::LinalgError>();
    error::<motion::RolloutError>();
    error::<motion::UnderflowCause>();
    error::<network::NetworkError>();
    error::<network::UnknownNonlinearity>();
    error::<network::file::ModelFileError>();
    error::<recording::TrackError>();
    error::<scalar::UnreadableNumber>();
    error::<storage::ReadError>();
    error::<tape::TapeError>();
    error::<analysis::GridError>();
    error::<training::CheckpointError>();
    error::<training::ConfigError>();
    error::<training::DatasetError>();
    error::<training::Failure>();
    error::<training::RecipeError>();
    error::<training::SamplingError>();
    error::<training::StepError>();
    error::<training::TrainingError>();
};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Threads of this process.
fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// Runs one test of this program alone in a process, so that no other test's threads are counted.
fn alone(name: &str) -> bool {
    const INSIDE: &str = "LNN_TEST_ALONE";
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    let mut command = Command::new(std::env::current_exe().unwrap());
    let output = command.args(["--exact", name, "--test-threads=1"]).env(INSIDE, "1").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}{}", String::from_utf8_lossy(&output.stderr));
    false
}

#[test]
#[cfg(target_os = "linux")]
fn threads_are_the_callers_choice() {
    if !alone("threads_are_the_callers_choice") {
        return;
    }
    let before = threads();
    let file = ModelFile::<f64>::load(&root().join("examples/data/double_pendulum.safetensors")).unwrap();
    let architecture = file.header.architecture.clone();
    let learned = NetworkLagrangian::new(file.header.architecture, file.weights.clone()).unwrap();
    let written = build::<f64>("double-pendulum", &[]).unwrap();
    let q: Vec<f64> = (0..400).map(|k| (0.7 * f64::from(k)).sin()).collect();
    let v: Vec<f64> = (0..400).map(|k| (0.3 * f64::from(k)).cos()).collect();
    let mut terms = Terms::default();
    for model in [&learned as &dyn EulerLagrange<f64>, &*written] {
        model.terms(&q, &v, Request::ALL, &mut terms).unwrap();
        assert!(rollout(model, &q[..2], &v[..2], &Options::new(0.1, 0.05)).is_complete());
        let starts = vec![(q[..2].to_vec(), v[..2].to_vec()); 4];
        assert_eq!(rollout_many(model, &starts, &Options::new(0.1, 0.05), 1).len(), 4);
    }
    assert_eq!(threads(), before, "evaluation and roll-outs start no thread");

    let data = Dataset::new(2, q, v, terms.acceleration).unwrap();
    let rows: Vec<u32> = (0..200).collect();
    let mut gradients = Vec::new();
    for count in [1, 3] {
        let mut objective = Objective::new(&architecture, Penalty::Eigenvalue { lambda: 1.0 }, count).unwrap();
        let mut gradient = vec![0.0; file.weights.len()];
        assert!(objective.step(&file.weights, &data, &rows, &mut gradient).loss.is_finite());
        gradients.push(gradient);
        let now = threads();
        assert!(now <= before + count, "{count} threads were asked for, {} started", now - before);
        assert!(count == 1 || now > before, "the count sees threads");
        drop(objective);
        let limit = Instant::now() + Duration::from_secs(20);
        while threads() > before {
            assert!(Instant::now() < limit, "threads outlive the objective");
            std::thread::sleep(Duration::from_millis(2));
        }
    }
    assert!(gradients[0] == gradients[1], "the number of threads changes nothing");
    // Rayon's global pool can be built once in the life of a process: nobody has done so.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the global pool belongs to the application");
}

/// Source files of the library, without the program.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true if !path.ends_with("cli") => sources(&path, found),
            false if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("main.rs") => found.push(path),
            _ => {}
        }
    }
}

#[test]
fn nothing_is_global() {
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
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
    assert_eq!(found, [(PathBuf::from("src/storage/write.rs"), expected)]);
}

/// Crates that a build with these features links.
fn dependencies(features: &[&str]) -> Vec<String> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["tree", "--edges", "normal", "--prefix", "none", "--offline", "--locked", "--manifest-path"]);
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
    let program = ["clap", "ctrlc", "indicatif", "kuva", "toml", "tracing-subscriber"];
    let (all, library) = (dependencies(&[]), dependencies(&["--no-default-features"]));
    for name in program {
        assert!(all.iter().any(|d| d == name), "the program uses {name}");
        assert!(!library.iter().any(|d| d == name), "the library does not need {name}");
    }
    assert!(
        library.iter().any(|d| d == "faer") && library.len() + 30 < all.len(),
        "{} of {}",
        library.len(),
        all.len()
    );
}

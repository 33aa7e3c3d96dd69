//! A training that is stopped anywhere and goes on is the training that was never stopped, to the last bit.

use lnn::configuration::{Config, Lbfgs, Phase};
use lnn::data::Datasets;
use lnn::lagrangian::SystemInstance;
use lnn::network::{Architecture, Layout};
use lnn::presets::Preset;
use lnn::scalar::Scalar;
use lnn::storage::Disk;
use lnn::training::{
    CheckpointError, CheckpointInterval, CheckpointManager, Epoch, Fingerprint, Hooks, LATEST, PREVIOUS, Progress,
    ResumeOptions, StopReason, Trained, TrainingError, remove_checkpoints, resume, saved, train,
};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Two phases of three epochs of four steps, averaged weights, a penalty, polishing.
fn config() -> Config {
    let mut config = Preset::Quick.config(&SystemInstance::named("double-pendulum", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (200, 40, 40);
    config.network.hidden = vec![8, 8];
    config.optimizer.batch = 64;
    config.optimizer.averaging = 0.9;
    config.phases[0].epochs = 3;
    config.phases.push(Phase { rate: 1e-3, epochs: 2, ..config.phases[0].clone() });
    config.lbfgs = Some(Lbfgs { iterations: 3, memory: 4 });
    config
}

struct Case<S> {
    config: Config,
    architecture: Architecture,
    data: Datasets<S>,
}

impl<S: Scalar> Case<S> {
    fn new(config: Config) -> Self {
        let system = config.system().unwrap();
        let (data, scale) = Datasets::<S>::sample(&config, &system).unwrap();
        let architecture = config.architecture(&system, scale).unwrap();
        Self { config, architecture, data }
    }

    fn whole(&self) -> Trained<S> {
        let penalty = self.config.penalty().unwrap();
        train(&self.config, &self.architecture, penalty, self.data.clone(), 1, &Hooks::default()).unwrap()
    }

    fn keeper(&self, directory: &Path, every: CheckpointInterval) -> Arc<CheckpointManager> {
        let identity = Fingerprint { config: format!("{:?}", self.config), data: self.data.checksums() };
        Arc::new(CheckpointManager::new(Arc::new(Disk), directory, every, identity))
    }

    /// Trains from the checkpoint in the directory, if there is one.
    fn sit(
        &self,
        directory: &Path,
        every: CheckpointInterval,
        threads: usize,
        hooks: &Hooks,
    ) -> Result<Trained<S>, TrainingError> {
        let keeper = self.keeper(directory, every);
        let parameters = Layout::new(&self.architecture).parameters;
        let start = match keeper.restore(parameters, self.config.data.training) {
            Ok(restored) => Some(restored.content),
            Err(CheckpointError::Missing) => None,
            Err(error) => panic!("{error}"),
        };
        let resumed = ResumeOptions { checkpoints: Some(keeper), start };
        let penalty = self.config.penalty().unwrap();
        resume(&self.config, &self.architecture, penalty, self.data.clone(), threads, hooks, resumed)
    }
}

/// Raises the interrupt after so many steps.
fn stop_after(steps: usize) -> Hooks {
    let interrupt = Arc::new(AtomicBool::new(false));
    let (raised, taken) = (Arc::clone(&interrupt), AtomicUsize::new(0));
    let watcher = move |progress: Progress<'_>| {
        if matches!(progress, Progress::Step { .. }) && taken.fetch_add(1, Ordering::SeqCst) + 1 == steps {
            raised.store(true, Ordering::SeqCst);
        }
    };
    Hooks { watcher: Some(Arc::new(watcher)), interrupt }
}

/// A row without its time.
fn numbers(e: &Epoch) -> ([u64; 6], [usize; 4]) {
    let floats = [e.rate, e.training_loss, e.penalty, e.penalised, e.validation_loss, e.gradient_norm];
    (floats.map(f64::to_bits), [e.epoch, e.phase, e.left_out, e.skipped])
}

fn assert_same<S: Scalar>(found: &Trained<S>, whole: &Trained<S>, place: &str) {
    let history = |trained: &Trained<S>| trained.history.iter().map(numbers).collect::<Vec<_>>();
    assert_eq!(history(found), history(whole), "{place}");
    assert!(found.weights == whole.weights, "weights, {place}");
    assert_eq!((found.validation_loss, found.states, &found.stop), (whole.validation_loss, whole.states, &whole.stop));
    assert_eq!(found.test, whole.test, "{place}");
    assert!(found.history.windows(2).all(|pair| pair[0].seconds <= pair[1].seconds), "{place}");
}

const STEPS: usize = 20;

#[test]
fn stopping_after_any_step_changes_nothing() {
    let case = Case::<f32>::new(config());
    let whole = case.whole();
    assert_eq!(whole.history[..5].iter().map(|e| e.phase).collect::<Vec<_>>(), [1, 1, 1, 2, 2]);
    assert!(whole.history.len() > 5);
    for steps in 1..=STEPS {
        let directory = tempfile::tempdir().unwrap();
        let every = CheckpointInterval::Seconds(1e9);
        match case.sit(directory.path(), every, 1, &stop_after(steps)) {
            Ok(stopped) => assert_eq!(stopped.stop, StopReason::Interrupted),
            Err(error) => assert!(matches!(error, TrainingError::NothingLearned(None)) && steps <= 4, "{error}"),
        }
        let found = case.sit(directory.path(), every, 2, &Hooks::default()).unwrap();
        assert_same(&found, &whole, &format!("stopped after step {steps}"));
    }
}

#[test]
fn stopping_after_every_step_changes_nothing() {
    let mut config = config();
    // The second half of a mass matrix of the wrong sign: states are left out and penalised.
    config.network.alpha = -1.0;
    let case = Case::<f64>::new(config);
    let whole = case.whole();
    let directory = tempfile::tempdir().unwrap();
    let every = CheckpointInterval::Epochs(1);
    for _ in 0..STEPS {
        let _ = case.sit(directory.path(), every, 1, &stop_after(1));
    }
    let found = case.sit(directory.path(), every, 1, &Hooks::default()).unwrap();
    assert_same(&found, &whole, "stopped after every step");
    // The last checkpoint is behind everything: from it the same comes out without a step.
    let again = case.sit(directory.path(), every, 1, &stop_after(1)).unwrap();
    assert_same(&again, &whole, "from the end");
}

#[test]
fn checkpoints_between_stops_come_as_often_as_asked_for() {
    let case = Case::<f32>::new(config());
    let directory = tempfile::tempdir().unwrap();
    let epochs = |every: CheckpointInterval| {
        remove_checkpoints(&Disk, directory.path()).unwrap();
        let (newest, seen) = (directory.path().join(LATEST), std::sync::Mutex::new(Vec::new()));
        let seen = Arc::new(seen);
        let (list, keeper) = (Arc::clone(&seen), case.keeper(directory.path(), every));
        let parameters = Layout::new(&case.architecture).parameters;
        let watcher = move |progress: Progress<'_>| {
            if let Progress::Step { step, .. } = progress {
                assert!(newest.exists());
                let found = keeper.restore::<f32>(parameters, 200).unwrap().content;
                assert!(found.steps() < step);
                list.lock().unwrap().push(found.steps());
            }
        };
        let hooks = Hooks { watcher: Some(Arc::new(watcher)), interrupt: Arc::default() };
        case.sit(directory.path(), every, 1, &hooks).unwrap();
        let mut steps = seen.lock().unwrap().clone();
        steps.dedup();
        steps
    };
    assert_eq!(epochs(CheckpointInterval::Epochs(1)), [0, 4, 8, 12, 16]);
    assert_eq!(epochs(CheckpointInterval::Epochs(2)), [0, 8, 16]);
    assert_eq!(epochs(CheckpointInterval::Seconds(1e9)), [0]);
    // By time a checkpoint comes at the next step, but writing must not take more than a hundredth of the time.
    assert!(epochs(CheckpointInterval::Seconds(1e-9)).len() <= STEPS);
}

#[test]
fn the_previous_checkpoint_serves_when_the_newest_is_damaged() {
    let case = Case::<f32>::new(config());
    let whole = case.whole();
    let directory = tempfile::tempdir().unwrap();
    let (newest, previous) = (directory.path().join(LATEST), directory.path().join(PREVIOUS));
    let _ = case.sit(directory.path(), CheckpointInterval::Epochs(1), 1, &stop_after(10));
    let parameters = Layout::new(&case.architecture).parameters;
    let restore = || case.keeper(directory.path(), CheckpointInterval::Epochs(1)).restore::<f32>(parameters, 200);
    assert_eq!((restore().unwrap().content.steps(), restore().unwrap().fallback), (10, None));
    let good = fs::read(&newest).unwrap();
    let before = fs::read(&previous).unwrap();
    for damage in [good[..good.len() / 2].to_vec(), Vec::new(), [&good[..], b"x"].concat()] {
        fs::write(&newest, &damage).unwrap();
        let found = restore().unwrap();
        assert_eq!(found.content.steps(), 8);
        assert!(found.fallback.is_some());
        assert!(saved(&Disk, directory.path()).unwrap().fallback.is_some());
    }
    // The damaged one does not take the place of the good one.
    let _ = case.sit(directory.path(), CheckpointInterval::Seconds(1e9), 1, &stop_after(1));
    assert_eq!(fs::read(&previous).unwrap(), before);
    assert_eq!((restore().unwrap().content.steps(), restore().unwrap().fallback), (9, None));
    fs::remove_file(&newest).unwrap();
    assert!(restore().unwrap().fallback.unwrap().contains("no such file"));
    let found = case.sit(directory.path(), CheckpointInterval::Epochs(1), 1, &Hooks::default()).unwrap();
    assert_same(&found, &whole, "from the previous checkpoint");

    fs::write(&newest, b"x").unwrap();
    fs::write(&previous, b"y").unwrap();
    let error = restore().unwrap_err().to_string();
    assert!(error.contains(LATEST) && error.contains(PREVIOUS), "{error}");
    remove_checkpoints(&Disk, directory.path()).unwrap();
    assert!(matches!(restore(), Err(CheckpointError::Missing)));
}

#[test]
fn other_configurations_data_and_networks_are_refused() {
    let case = Case::<f32>::new(config());
    let directory = tempfile::tempdir().unwrap();
    let _ = case.sit(directory.path(), CheckpointInterval::Epochs(1), 1, &stop_after(5));
    let parameters = Layout::new(&case.architecture).parameters;
    let restore = |case: &Case<f32>, parameters, states| {
        let keeper = case.keeper(directory.path(), CheckpointInterval::Epochs(1));
        keeper.restore::<f32>(parameters, states).map(|found| found.content.steps())
    };
    assert_eq!(restore(&case, parameters, 200).unwrap(), 5);
    let mut other = config();
    other.optimizer.batch = 32;
    assert!(matches!(restore(&Case::new(other), parameters, 200), Err(CheckpointError::Config { .. })));
    let mut data = Case::<f32>::new(config());
    data.data.validation = data.data.test.clone();
    let error = restore(&data, parameters, 200).unwrap_err();
    assert!(error.to_string().ends_with("other data: validation states"), "{error}");
    assert!(restore(&case, parameters + 1, 200).unwrap_err().to_string().contains("weights"));
    assert!(restore(&case, parameters, 100).unwrap_err().to_string().contains("200 states"));
}

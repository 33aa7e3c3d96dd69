//! Every operation on files made to fail in every way: what is read afterwards is the old content or the new.

use super::faulty::{Fault, Faulty};
use lnn::configuration::Config;
use lnn::data::Datasets;
use lnn::lagrangian::SystemInstance;
use lnn::network::{ActivationChoice, Architecture, Form, Header, InputLayer, Layout, ModelFile, StoredPrecision};
use lnn::presets::Preset;
use lnn::storage::{Disk, Files, write_whole};
use lnn::training::{
    CheckpointInterval, CheckpointManager, Fingerprint, Hooks, LATEST, PREVIOUS, Progress, ResumeOptions, StopReason,
    resume,
};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn model(value: f64) -> ModelFile<f64> {
    let architecture = Architecture {
        coordinates: 1,
        hidden: vec![3],
        activation: ActivationChoice::Gelu,
        alpha: 0.0,
        time_like: None,
        scale: vec![1.0],
        periodic: vec![false],
        embed_periodic: false,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    };
    let weights = vec![value; Layout::new(&architecture).parameters];
    let header = Header {
        format: Header::FORMAT,
        crate_version: "0.1.0".to_string(),
        architecture,
        system: "harmonic-oscillator".to_string(),
        parameters: [("m".to_string(), 1.0)].into(),
        columns: vec!["x".to_string(), "x_dot".to_string()],
        forces: Vec::new(),
        constraints: [].into(),
        description: None,
        precision: StoredPrecision::F64,
        position: vec![[-1.0, 1.0]],
        velocity: vec![[-1.0, 1.0]],
        seed: 0,
        validation_loss: 1.0,
    };
    ModelFile { header, weights }
}

fn names(directory: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(directory).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// All faults at operation 1, 2, ... until nothing fails any more.
fn every_fault(mut attempt: impl FnMut(Fault, &Arc<Faulty>, &str) -> bool) -> usize {
    let mut attempts = 0;
    for fault in Fault::ALL {
        for persistent in [false, true] {
            for first in 1.. {
                assert!(first < 100, "{fault:?} does not end");
                let files = Arc::new(Faulty::new(fault, first, persistent));
                let place = format!("{fault:?} at operation {first}, persistent: {persistent}");
                let succeeded = attempt(fault, &files, &place);
                attempts += 1;
                if files.operations() < first {
                    assert!(succeeded, "{place}");
                    break;
                }
            }
        }
    }
    attempts
}

#[test]
fn a_model_is_the_old_one_or_the_new_one() {
    for exists in [true, false] {
        let attempts = every_fault(|fault, files, place| {
            let directory = tempfile::tempdir().unwrap();
            let path = directory.path().join("model.safetensors");
            if exists {
                model(1.0).save(&path).unwrap();
            }
            let saved = model(2.0).save_to(files.as_ref(), &path);
            match ModelFile::<f64>::load(&path) {
                Ok(found) => {
                    assert!(found == model(2.0) || (exists && saved.is_err() && found == model(1.0)), "{place}");
                }
                Err(error) => assert!(!exists && saved.is_err(), "{place}: {error}"),
            }
            // A fault that goes on prevents the removal too.
            let removable = !matches!(fault, Fault::Full | Fault::Device | Fault::Interrupted | Fault::Death);
            if saved.is_ok() || removable {
                assert_eq!(names(directory.path()), ["model.safetensors"], "{place}");
            }
            saved.is_ok()
        });
        assert!(attempts > 30);
    }
}

#[test]
fn one_fault_leaves_nothing_behind() {
    for fault in [Fault::Full, Fault::Device, Fault::Interrupted, Fault::Short] {
        for first in 1..=5 {
            let directory = tempfile::tempdir().unwrap();
            let path = directory.path().join("a");
            fs::write(&path, b"old").unwrap();
            let files = Faulty::new(fault, first, false);
            let written = write_whole(&files, &path, b"new content");
            assert_eq!(names(directory.path()), ["a"], "{fault:?} at {first}");
            let content = fs::read(&path).unwrap();
            // Interruptions and short writes are taken up again; synchronising the directory comes after the rename.
            let retried = matches!(fault, Fault::Interrupted | Fault::Short);
            assert_eq!(written.is_ok(), retried, "{fault:?} at {first}");
            assert_eq!(content == b"new content", retried || first == 5, "{fault:?} at {first}");
        }
    }
}

fn config() -> Config {
    let mut config = Preset::Quick.config(&SystemInstance::named("harmonic-oscillator", &[]).unwrap()).unwrap();
    (config.data.training, config.data.validation, config.data.test) = (64, 16, 16);
    config.network.hidden = vec![4];
    config.optimizer.batch = 16;
    config.phases[0].epochs = 2;
    config
}

/// Trains from the checkpoint, if there is one, for some steps; gives the step that it began at.
fn sit(directory: &Path, files: Arc<dyn Files>, steps: usize) -> usize {
    let config = config();
    let system = config.system().unwrap();
    let (data, scale) = Datasets::<f32>::sample(&config, &system).unwrap();
    let architecture = config.architecture(&system, scale).unwrap();
    let identity = Fingerprint { config: String::new(), data: data.checksums() };
    let parameters = Layout::new(&architecture).parameters;
    let keeper = |files: Arc<dyn Files>| {
        Arc::new(CheckpointManager::new(files, directory, CheckpointInterval::Seconds(1e9), identity.clone()))
    };
    let start = keeper(Arc::new(Disk)).restore(parameters, 64).ok().map(|restored| restored.content);
    let began = start.as_ref().map_or(0, |snapshot| snapshot.steps());
    let interrupt = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&interrupt);
    let watcher = move |progress: Progress<'_>| {
        if let Progress::Step { step, .. } = progress {
            raised.store(step == began + steps, Ordering::SeqCst);
        }
    };
    let hooks = Hooks { watcher: Some(Arc::new(watcher)), interrupt };
    let resumed = ResumeOptions { checkpoints: Some(keeper(files)), start };
    let penalty = config.penalty().unwrap();
    // In the first epoch nothing has been learned yet.
    if let Ok(trained) = resume(&config, &architecture, penalty, data, 1, &hooks, resumed) {
        assert_eq!(trained.stop, StopReason::Interrupted);
    }
    began
}

#[test]
fn a_checkpoint_is_the_old_one_or_the_new_one() {
    // One checkpoint at the beginning of a resumed, one at its end.
    let kept = tempfile::tempdir().unwrap();
    assert_eq!(sit(kept.path(), Arc::new(Disk), 2), 0);
    assert_eq!(names(kept.path()), [PREVIOUS, LATEST]);
    let attempts = every_fault(|fault, files, place| {
        let directory = tempfile::tempdir().unwrap();
        for name in [LATEST, PREVIOUS] {
            fs::copy(kept.path().join(name), directory.path().join(name)).unwrap();
        }
        assert_eq!(sit(directory.path(), files.clone(), 1), 2, "{place}");
        let lasting = matches!(fault, Fault::Full | Fault::Device | Fault::Interrupted | Fault::Death);
        if !lasting {
            assert_eq!(names(directory.path()), [PREVIOUS, LATEST], "{place}");
        }
        // Steps 2 or 3 are there, from whichever file, and the training goes on from them.
        let began = sit(directory.path(), Arc::new(Disk), 1);
        assert!(began == 2 || began == 3, "{place}: began at {began}");
        began == 3
    });
    assert!(attempts > 50);
}

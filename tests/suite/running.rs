//! The program `lnn` from outside: runs with a time limit, files to give it, a small model.

use lnn::network::{ActivationChoice, Architecture, Form, Header, InputLayer, Layout, ModelFile, StoredPrecision};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Header of the states of a double pendulum.
pub const HEADER: &str = "theta1,theta2,theta1_dot,theta2_dot\n";

/// The top of the repository.
const TOP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// The program with its arguments at the top of the repository, without a filter of the log.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lnn"));
    command.args(arguments).current_dir(TOP).env_remove("LNN_LOG");
    command
}

/// Runs the program.
pub fn lnn(arguments: &[&str]) -> Run {
    Run::of(&mut command(arguments))
}

/// Runs the program with this on its standard input.
pub fn piped(arguments: &[&str], content: &[u8]) -> Run {
    let mut child =
        command(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // A program that ends before it has read everything closes the pipe.
    let _ = child.stdin.take().unwrap().write_all(content);
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    Run { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Looks at states of a system.
pub fn inspect(system: &str, states: &str, more: &[&str]) -> Run {
    lnn(&[&["inspect", "--system", system, "--states", states], more].concat())
}

/// What a run left behind.
pub struct Run {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// Runs a command to its end; one that takes two minutes waits for what never comes, and fails the test.
    pub fn of(command: &mut Command) -> Self {
        fn read(mut pipe: impl Read + Send + 'static) -> thread::JoinHandle<String> {
            thread::spawn(move || {
                let mut text = String::new();
                pipe.read_to_string(&mut text).expect("UTF-8");
                text
            })
        }
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (out, err) = (read(child.stdout.take().unwrap()), read(child.stderr.take().unwrap()));
        let limit = Instant::now() + Duration::from_secs(120);
        let status = loop {
            match child.try_wait().unwrap() {
                Some(status) => break status,
                None if Instant::now() > limit => {
                    child.kill().unwrap();
                    child.wait().unwrap();
                    panic!("{command:?} does not end");
                }
                None => thread::sleep(Duration::from_millis(1)),
            }
        };
        Self { code: status.code(), stdout: out.join().unwrap(), stderr: without_progress(&err.join().unwrap()) }
    }

    /// The run ended well.
    pub fn succeeded(&self) {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
    }

    /// The run failed with this code and one line that says all of `parts`, and printed no result.
    pub fn refused(&self, code: i32, parts: &[&str]) {
        assert_eq!(self.code, Some(code), "{}", self.stderr);
        assert_eq!(self.stderr.lines().count(), 1, "{}", self.stderr);
        assert!(self.stderr.starts_with("error: ") && !self.stderr.contains("panicked"), "{}", self.stderr);
        for part in parts {
            assert!(self.stderr.contains(part), "{part:?} is not in {}", self.stderr);
        }
        assert_eq!(self.stdout, "");
    }

    /// The run succeeded without a word on standard error; its lines as JSON.
    pub fn objects(&self) -> Vec<Value> {
        assert_eq!((self.code, self.stderr.as_str()), (Some(0), ""));
        self.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }
}

/// What a program says but how far it is, which depends on how busy the machine is.
fn without_progress(text: &str) -> String {
    text.split_inclusive('\n').filter(|line| !line.starts_with("progress: ")).collect()
}

/// A directory of a test's own.
pub struct Folder(pub TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    /// Writes a file and gives its path.
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        fs::write(&path, content).unwrap();
        text(&path)
    }
    /// Names of everything in it.
    pub fn names(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }
}

pub fn text(path: &Path) -> String {
    path.to_str().unwrap().to_string()
}

/// A small network for a double pendulum, with weights of no meaning.
pub fn model() -> ModelFile<f32> {
    let architecture = Architecture {
        coordinates: 2,
        hidden: vec![8, 8],
        activation: ActivationChoice::Softplus,
        alpha: 0.5,
        time_like: None,
        scale: vec![3.0, 4.0],
        periodic: vec![true, true],
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form::default(),
    };
    let count = Layout::new(&architecture).parameters;
    let header = Header {
        format: Header::FORMAT,
        crate_version: env!("CARGO_PKG_VERSION").to_string(),
        architecture,
        system: "double-pendulum".to_string(),
        parameters: ["m1", "m2", "l1", "l2"].map(|s| (s.to_string(), 1.0)).into_iter().collect::<BTreeMap<_, _>>(),
        columns: ["theta1", "theta2", "theta1_dot", "theta2_dot"].map(String::from).to_vec(),
        forces: Vec::new(),
        constraints: BTreeMap::new(),
        description: None,
        precision: StoredPrecision::F32,
        position: vec![[0.0, 6.0]; 2],
        velocity: vec![[-10.0, 10.0]; 2],
        seed: 1,
        validation_loss: 0.25,
    };
    ModelFile { header, weights: (0..count).map(|k| (k as f32 * 0.7).sin() / 4.0).collect() }
}

/// A text with one blank between two words, wherever its lines were cut.
pub fn joined(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Sentence that a report begins with.
pub fn lead(report: &str) -> String {
    let (_, rest) = report.split_once("class=\"lead\">").unwrap();
    rest.split_once("</p>").unwrap().0.replace("&#39;", "'")
}

/// Waits until something has happened, half a minute at most.
pub fn wait_until(what: &str, happened: impl Fn() -> bool) {
    let limit = Instant::now() + Duration::from_secs(30);
    while !happened() {
        assert!(Instant::now() < limit, "{what} does not come");
        thread::sleep(Duration::from_millis(10));
    }
}

/// Waits until a file is there.
pub fn wait_for(path: &Path) {
    wait_until(&path.display().to_string(), || path.exists());
}

/// Standard output of a run that ended well and had nothing to warn of.
pub fn said_by(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(without_progress(&String::from_utf8_lossy(&output.stderr)), "");
    String::from_utf8(output.stdout.clone()).unwrap()
}

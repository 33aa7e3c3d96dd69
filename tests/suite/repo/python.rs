//! The reader of model files in Python, `python/lnn/reader`, beside the program.

use crate::common::kinds;
use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const STATES: &str = "theta1_dot,theta1,theta2,theta2_dot\n0.1,0.5,-3,2\n-4,7,1.5,3\n0,0,0,0\n2.5,-20,4,-0.5\n";

fn at(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(name)
}

fn shipped() -> String {
    text(&at("examples/data/double_pendulum.safetensors"))
}

/// A Python with numpy: the one that `LNN_PYTHON` names, which must have it, or the system's.
fn python() -> Option<PathBuf> {
    let named = std::env::var_os("LNN_PYTHON").map(PathBuf::from);
    let program = named.clone().unwrap_or_else(|| "python3".into());
    match Command::new(&program).args(["-c", "import numpy"]).output() {
        Ok(output) if output.status.success() => Some(program),
        outcome => {
            let why = outcome.map_or_else(|e| e.to_string(), |o| String::from_utf8_lossy(&o.stderr).into_owned());
            assert!(named.is_none(), "LNN_PYTHON cannot evaluate models: {why}");
            eprintln!("skipped: {} {why}", program.display());
            None
        }
    }
}

fn run(python: &Path, arguments: &[&str]) -> Output {
    let folder = at("python");
    Command::new(python).args(arguments).env("PYTHONPATH", folder).env("PYTHONDONTWRITEBYTECODE", "1").output().unwrap()
}

fn lines(output: &Output) -> Vec<Value> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Numbers of a value, whatever its shape; what is not finite is written as null.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(parts) => parts.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().unwrap_or(f64::NAN)],
    }
}

/// Both programs say the same of every state; of accelerations, that they differ by no force, `M (a - a')`, for a matrix near to a singular one makes
/// much of a rounding.
fn agree(theirs: &[Value], model: &str, states: &str) {
    let ours = lnn(&["inspect", "--model", model, "--states", states, "--precision", "f64"]).stdout;
    let ours: Vec<Value> = ours.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((theirs.len(), ours.len()), (4, 4), "{model}: {theirs:?}");
    let largest = |of: &[f64]| of.iter().copied().filter(|x| x.is_finite()).map(f64::abs).fold(0.0, f64::max);
    for name in ["lagrangian", "momentum", "dl_dq", "mass_matrix", "coriolis", "energy"] {
        let all = |rows: &[Value]| rows.iter().flat_map(|row| numbers(&row[name])).collect::<Vec<f64>>();
        let (theirs, ours) = (all(theirs), all(&ours));
        assert!(theirs.len() == ours.len() && ours.iter().any(|x| x.is_finite()), "{model}: {name}");
        let size = largest(&ours);
        for (theirs, ours) in theirs.iter().zip(&ours).filter(|(_, ours)| ours.is_finite()) {
            let difference = (theirs - ours).abs();
            assert!(difference <= 1e-12 * size, "{model}: {name} differs by {difference:e} of {size:e}");
        }
    }
    let mut solved = 0;
    for (theirs, ours) in theirs.iter().zip(&ours) {
        let (m, theirs, ours) =
            (numbers(&ours["mass_matrix"]), numbers(&theirs["acceleration"]), numbers(&ours["acceleration"]));
        assert_eq!(theirs.len(), ours.len(), "{model}: acceleration");
        if ours.iter().any(|a| !a.is_finite()) {
            continue;
        }
        solved += 1;
        let size = largest(&m) * largest(&ours);
        for row in m.chunks(ours.len()) {
            let force = row
                .iter()
                .zip(theirs.iter().zip(&ours))
                .map(|(m, (theirs, ours))| m * (theirs - ours))
                .sum::<f64>()
                .abs();
            assert!(
                force <= 1e-12 * size,
                "{model}: accelerations {theirs:?} and {ours:?} differ by a force {force:e} of {size:e}"
            );
        }
    }
    assert!(solved > 0, "{model}: no acceleration");
}

#[test]
fn python_evaluates_every_kind_of_model() {
    let Some(python) = python() else { return };
    let folder = Folder::new();
    let (pendulum, shipped) = (folder.file("pendulum.csv", STATES), shipped());
    agree(&lines(&run(&python, &["-m", "lnn.reader", &shipped, &pendulum])), &shipped, &pendulum);
    let states = folder.file("states.csv", kinds::STATES);
    let kinds = kinds::kinds();
    let paths: Vec<String> = (0..kinds.len()).map(|k| text(&folder.path(&format!("{k}.safetensors")))).collect();
    for ((_, model), path) in kinds.iter().zip(&paths) {
        model.save(path.as_ref()).unwrap();
    }
    let each = "import sys; from lnn.reader.__main__ import main; [main(model, sys.argv[1]) for model in sys.argv[2:]]";
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let rows = lines(&run(&python, &[&["-c", each, &states], &paths[..]].concat()));
    assert_eq!(rows.len(), 4 * kinds.len());
    for (rows, path) in rows.chunks(4).zip(paths) {
        agree(rows, path, &states);
    }
}

#[test]
fn python_refuses_keys_and_values_of_a_header_that_it_does_not_know() {
    let Some(python) = python() else { return };
    let folder = Folder::new();
    let (_, spacetime) =
        kinds::kinds().into_iter().find(|(name, _)| name == "rectangle of a spacetime, radial").unwrap();
    let path = text(&folder.path("model.safetensors"));
    spacetime.save(path.as_ref()).unwrap();
    let changed = "import sys, copy; from lnn.reader import ModelFile
file = ModelFile.load(sys.argv[1])
net = lambda h: h['architecture']
for table, key, value in [
    (lambda h: h, 'novelty', 0), (net, 'novelty', None), (lambda h: net(h)['form'], 'novelty', False),
    (lambda h: net(h)['form']['radial'][0], 'novelty', 1.5), (lambda h: h, 'format', 2), (net, 'activation', 'relu'),
    (net, 'input_layer', 'norm'), (lambda h: net(h)['form'], 'structure', 'new'), (lambda h: net(h)['form'], 'factor', 'new'),
]:
    other = copy.deepcopy(file.header)
    table(other)[key] = value
    try:
        ModelFile(other, file.tensors)
        print(key, 'is not refused')
    except ValueError as error:
        assert key in str(error), error";
    let output = run(&python, &["-c", changed, &path]);
    assert!(output.status.success() && output.stdout.is_empty(), "{output:?}");
}

#[test]
fn what_python_saves_is_loaded_unless_a_bit_is_wrong() {
    let Some(python) = python() else { return };
    let folder = Folder::new();
    let states = folder.file("states.csv", STATES);
    let (given, made) = (shipped(), text(&folder.path("doubled.safetensors")));
    let double = "import sys; from lnn.reader import ModelFile
file = ModelFile.load(sys.argv[1])
file.tensors['layers.2.weight'] = 2 * file.tensors['layers.2.weight']
file.header['architecture']['alpha'] *= 2
file.save(sys.argv[2])";
    let output = run(&python, &["-c", double, &given, &made]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let look = |model: &str| lnn(&["inspect", "--model", model, "--states", &states, "--precision", "f64"]);
    let once: Vec<Value> = look(&given).objects();
    for (once, twice) in once.iter().zip(look(&made).objects()) {
        // A power of two commutes with every rounding.
        assert_eq!(2.0 * once["lagrangian"].as_f64().unwrap(), twice["lagrangian"].as_f64().unwrap());
    }
    // A changed weight.
    let mut bytes = std::fs::read(&made).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    let broken = folder.file("broken.safetensors", &bytes);
    look(&broken).refused(1, &["broken.safetensors", "checksum"]);
    let output = run(&python, &["-m", "lnn.reader", &broken, &states]);
    assert!(!output.status.success() && String::from_utf8_lossy(&output.stderr).contains("the checksum is wrong"));
}

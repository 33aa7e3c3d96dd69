//! Any text as the file of a system of two coordinates: its page computes what the library computes, and has no acceleration where that has
//! none. Without node nothing is compared.

use lnn::lagrangian::{EulerLagrange, Request, SystemInstance, Terms};
use lnn::network::{ModelFile, NetworkLagrangian};
use lnn::pipeline::parse_system;
use lnn::report::page;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::process::Command;

/// A model of two coordinates; what is compared is the system beside it.
const MODEL: &[u8] = include_bytes!("../../examples/data/double_pendulum.safetensors");
/// The state of the page's engine at states.
const SCRIPT: &str = r#"
const html = require("fs").readFileSync(0, "utf8");
const parts = [...html.matchAll(/<script([^>]*)>([^]*?)<\/script>/g)].map((match) => match[2]);
const shell = { module: { exports: {} } };
new Function("module", parts[1])(shell.module);
const { exact } = shell.module.exports.load(JSON.parse(parts[0]));
const text = (x) => (Number.isFinite(x) ? x : null);
const of = ([q, v]) => {
  const { lagrangian, momentum, mass, acceleration } = exact.terms(q, v);
  return { lagrangian: text(lagrangian), momentum: momentum.map(text), mass: mass.flat().map(text), acceleration: acceleration.map(text) };
};
console.log(JSON.stringify(exact ? JSON.parse(process.argv[1]).map(of) : []));
"#;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(system) = parse_system(text) else { return };
    let Ok(system) = SystemInstance::<f64>::new(Cow::Owned(system), &[]) else { return };
    let (2, Ok(built)) = (system.coordinates, system.build()) else { return };
    let ModelFile { header, weights } = ModelFile::<f64>::from_bytes(MODEL).expect("the shipped model");
    let network = NetworkLagrangian::new(header.architecture.clone(), weights).expect("its weights");
    let Ok(html) = page(&header, &network, Some(&system)) else { return };
    let states = states(&system);
    let Some(found) = in_node(&html, &states) else { return };
    for ((q, v), found) in states.iter().zip(found) {
        let mut terms = Terms::default();
        let done = built.terms(q, v, Request::ALL, &mut terms);
        let moves = done.is_ok() && terms.acceleration.iter().all(|a| a.is_finite());
        let list = |name: &str| -> Vec<f64> {
            let numbers = found[name].as_array().into_iter().flatten();
            numbers.map(|x| x.as_f64().unwrap_or(f64::NAN)).collect()
        };
        if terms.lagrangian.first().is_none_or(|l| l.is_nan()) {
            assert!(list("acceleration").iter().any(|a| a.is_nan()), "it moves where nothing does: {q:?} {v:?} {text}");
        }
        if moves {
            for (name, ours) in [("momentum", &terms.momentum), ("mass", &terms.mass_matrix)] {
                let size = ours.iter().fold(1e-300, |most: f64, x| most.max(x.abs()));
                let alike = list(name).iter().zip(ours).all(|(a, b)| (a - b).abs() <= 1e-8 * size);
                assert!(alike || size > 1e12, "{name} {found} {ours:?} at {q:?} {v:?} of {text}");
            }
        }
    }
}

/// States within the bounds of a system, and beyond.
fn states(system: &SystemInstance<f64>) -> Vec<(Vec<f64>, Vec<f64>)> {
    let bounds = system.system.training(2);
    let at = |sides: &[(f64, f64)], share: f64| -> Vec<f64> {
        let share = |i: usize| share + 0.13 * i as f64;
        sides.iter().enumerate().map(|(i, (low, high))| low + share(i) * (high - low)).collect()
    };
    [-0.4, 0.2, 0.6].map(|share| (at(&bounds.positions, share), at(&bounds.velocities, 0.9 - share))).to_vec()
}

/// What the engine of a page says of states; nothing without node.
fn in_node(html: &str, states: &[(Vec<f64>, Vec<f64>)]) -> Option<Vec<Value>> {
    let directory = std::env::temp_dir().join(format!("lnn-page-{}", std::process::id()));
    std::fs::create_dir_all(&directory).ok()?;
    let file = directory.join("play.html");
    std::fs::write(&file, html).ok()?;
    let input = std::fs::File::open(&file).ok()?;
    let output = Command::new("node").args(["-e", SCRIPT, &json!(states).to_string()]).stdin(input).output().ok()?;
    let _ = std::fs::remove_dir_all(&directory);
    let said = String::from_utf8_lossy(&output.stdout);
    let found = serde_json::from_str(&said);
    assert!(found.is_ok(), "{}", String::from_utf8_lossy(&output.stderr));
    found.ok()
}

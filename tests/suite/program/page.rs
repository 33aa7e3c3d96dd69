//! `lnn page` from outside: the numbers of its JavaScript, where node is, beside those of the program.

use crate::common::kinds;
use crate::running::{Folder, lnn, text};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Evaluates the script of a page at states and follows a motion: prints a JSON object.
const SCRIPT: &str = "
const html = require('fs').readFileSync(process.argv[1], 'utf8');
const parts = [...html.matchAll(/<script([^>]*)>([^]*?)<\\/script>/g)].map((match) => match[2]);
const shell = { module: { exports: {} } };
new Function('module', parts[1])(shell.module);
const { load, Flight, aligned } = shell.module.exports;
const data = JSON.parse(parts[0]), { learned, exact } = load(data);
const states = JSON.parse(process.argv[2]);
const of = (motion) => motion && states.map(({ q, v }) => motion.terms(q, v));
const { factors } = data.learned, matrices = factors && of(learned).map((terms) => aligned(terms, factors, learned.held.length));
const flight = exact && new Flight(exact, states[0].q, states[0].v, 0.01);
if (flight) flight.advance(1);
console.log(JSON.stringify({ learned: of(learned), exact: of(exact), factors, matrices, motion: flight && flight.y, ended: flight && flight.ended }));
";

fn node() -> bool {
    let found = Command::new("node").arg("--version").output().is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("skipped: there is no node");
    }
    found
}

/// Opens a page without a browser: prints what it writes on its canvases, and how often it asked for another picture.
const OPENED: &str = "
const html = require('fs').readFileSync(process.argv[1], 'utf8'), reduced = process.argv[2] === 'reduced';
const parts = [...html.matchAll(/<script([^>]*)>([^]*?)<\\/script>/g)].map((match) => match[2]);
const written = [], elements = {};
let pictures = 0;
const pen = new Proxy({}, { get: (pen, name) => pen[name] || ((text) => {
  if (name === 'fillText') written.push(text);
  return { width: 10 };
}) });
const element = (textContent) => ({ textContent, clientWidth: 400, clientHeight: 400, classList: { add() {} }, append() {},
  replaceChildren() {}, addEventListener() {}, getContext: () => pen });
const document = { getElementById: (id) => (elements[id] = elements[id] || element(id === 'data' ? parts[0] : '')),
  createElement: element, addEventListener() {}, documentElement: null, body: null };
const outside = { document, module: undefined, window: { addEventListener() {} },
  getComputedStyle: () => ({ getPropertyValue: () => '#000' }), requestAnimationFrame: () => pictures++,
  matchMedia: (query) => ({ matches: reduced && query.includes('reduced-motion'), addEventListener() {} }) };
new Function(...Object.keys(outside), parts[1] + parts[2])(...Object.values(outside));
console.log(JSON.stringify({ written, pictures }));
";

#[test]
fn a_page_has_axes_and_plays_at_once_unless_its_reader_wants_no_motion() {
    let folder = Folder::new();
    let model = text(
        &Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("examples/data/double_pendulum.safetensors"),
    );
    let page = text(&folder.path("play.html"));
    lnn(&["page", &model, "--out", &page]).succeeded();
    if !node() {
        return;
    }
    for (wish, pictures) in [("any", 1), ("reduced", 0)] {
        let output = Command::new("node").args(["-e", OPENED, &page, wish]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(found["pictures"], pictures, "{wish}: {found}");
        for text in ["x [m]", "y [m]", "0", "1"] {
            assert!(found["written"].as_array().unwrap().contains(&text.into()), "{wish}, {text}: {found}");
        }
    }
}

/// What the script of a page says of states.
fn evaluated(page: &str, states: &Value) -> Value {
    let output = Command::new("node").args(["-e", SCRIPT, page, &states.to_string()]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(parts) => parts.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().unwrap_or(f64::NAN)],
    }
}

/// The terms of both are the same to `tolerance` of their size.
fn agree(theirs: &Value, ours: &[Value], tolerance: f64, what: &str) {
    for (their, our) in [
        ("lagrangian", "lagrangian"),
        ("momentum", "momentum"),
        ("mass", "mass_matrix"),
        ("acceleration", "acceleration"),
    ] {
        let theirs: Vec<f64> = theirs.as_array().unwrap().iter().flat_map(|row| numbers(&row[their])).collect();
        let ours: Vec<f64> = ours.iter().flat_map(|row| numbers(&row[our])).collect();
        let size = ours.iter().copied().filter(|x| x.is_finite()).map(f64::abs).fold(0.0, f64::max);
        assert_eq!(theirs.len(), ours.len(), "{what}: {our}");
        for (theirs, ours) in theirs.iter().zip(&ours).filter(|(_, ours)| ours.is_finite()) {
            assert!((theirs - ours).abs() <= tolerance * size, "{what}: {our} {theirs} {ours}");
        }
    }
}

/// Rows of a CSV of states as `{q, v}`, in the order of the columns.
fn states(csv: &str, columns: &[&str]) -> Value {
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let fields: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        let state: Vec<f64> =
            columns.iter().map(|name| fields[header.iter().position(|known| known == name).unwrap()]).collect();
        let (q, v) = state.split_at(columns.len() / 2);
        serde_json::json!({ "q": q, "v": v })
    };
    lines.map(row).collect()
}

#[test]
fn a_page_computes_what_the_program_computes_for_every_kind_of_model() {
    let folder = Folder::new();
    let table = folder.file("states.csv", kinds::STATES);
    let states = states(kinds::STATES, &["theta", "x", "y", "theta_dot", "x_dot", "y_dot"]);
    let node = node();
    for (k, (kind, model)) in kinds::kinds().into_iter().enumerate() {
        let [file, page] = ["safetensors", "html"].map(|end| text(&folder.path(&format!("{k}.{end}"))));
        model.save(Path::new(&file)).unwrap();
        lnn(&["page", &file, "--out", &page]).succeeded();
        if node {
            let ours = lnn(&["inspect", "--model", &file, "--states", &table]);
            let ours: Vec<Value> = ours.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
            agree(&evaluated(&page, &states)["learned"], &ours, 1e-5, &kind);
        }
    }
}

#[test]
fn the_exact_motion_runs_beside_the_learned_one() {
    let folder = Folder::new();
    let model = text(
        &Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("examples/data/double_pendulum.safetensors"),
    );
    let page = text(&folder.path("play.html"));
    lnn(&["page", &model, "--out", &page]).succeeded();
    let html = fs::read_to_string(&page).unwrap();
    assert!(html.len() < 500_000 && html.matches("<script").count() == 3, "{} bytes", html.len());
    // Nothing is fetched.
    assert!(!html.contains("http://") && !html.contains("https://") && !html.contains(" src="));
    lnn(&["page", &model, "--out", &page]).refused(1, &["play.html", "--overwrite"]);
    lnn(&["page", &model, "--out", &page, "--overwrite"]).succeeded();
    lnn(&["page", &model, "--out", &model]).refused(1, &["double_pendulum.safetensors"]);
    if !node() {
        return;
    }
    let csv = "theta1,theta2,theta1_dot,theta2_dot\n0.6,0.9,0,0\n-2,5,1,-3\n";
    let table = folder.file("states.csv", csv);
    let result = evaluated(&page, &states(csv, &["theta1", "theta2", "theta1_dot", "theta2_dot"]));
    for (kind, whose, tolerance) in
        [("learned", ["--model", &model], 1e-5), ("exact", ["--system", "double-pendulum"], 1e-12)]
    {
        let ours = lnn(&[&["inspect"], &whose[..], &["--states", &table]].concat());
        agree(&result[kind], &ours.objects(), tolerance, kind);
    }
    // One factor brings the learned mass matrix to the exact one, and its square the determinant.
    let [one, two] = numbers(&result["factors"])[..] else { panic!("{result}") };
    assert!(one == two && (one / 37.0 - 1.0).abs() < 0.1, "{one}");
    for (learned, exact) in result["matrices"].as_array().unwrap().iter().zip(result["exact"].as_array().unwrap()) {
        let [theirs, ours] = [learned, exact].map(|terms| terms["determinant"].as_f64().unwrap());
        assert!((theirs / ours - 1.0).abs() < 0.15, "{theirs} {ours}");
        assert!((learned["diagonal"][0].as_f64().unwrap() / 2.0 - 1.0).abs() < 0.15, "{learned}");
    }
    let motion = folder.path("motion.csv");
    let exact = ["rollout", "--system", "double-pendulum", "--state", "0.6,0.9,0,0", "--t-end", "1", "--dt", "0.5"];
    lnn(&[&exact[..], &["--method", "dop853", "--rtol", "1e-12", "--out", &text(&motion)]].concat()).succeeded();
    let last = fs::read_to_string(&motion).unwrap().lines().last().unwrap().to_string();
    let last: Vec<f64> = last.split(',').skip(1).take(4).map(|x| x.parse().unwrap()).collect();
    for (theirs, ours) in numbers(&result["motion"]).iter().zip(&last) {
        assert!((theirs - ours).abs() < 1e-5, "{result} {last:?}");
    }
}

#[test]
fn a_network_that_is_too_large_has_no_page() {
    let folder = Folder::new();
    let (_, mut model) = kinds::kinds().remove(0);
    model.header.architecture.hidden = vec![400, 400];
    model.weights = vec![0.01; lnn::network::Layout::new(&model.header.architecture).parameters];
    let file = text(&folder.path("large.safetensors"));
    model.save(Path::new(&file)).unwrap();
    let page = folder.path("play.html");
    lnn(&["page", &file, "--out", &text(&page)]).refused(1, &["large.safetensors", "500000"]);
    assert!(!page.exists());
}

//! The page of the model format: every key, value and tensor that the program writes, and none that it does not.

use crate::common::kinds::kinds;
use lnn::network::{ActivationChoice, Factor, Header, ModelFile, Structure};
use safetensors::SafeTensors;
use serde_json::{Map, Value};
use std::collections::BTreeSet;

const PAGE: &str = include_str!("../../../docs/model-format.md");

/// Names in backquotes of a cell of Markdown.
fn names(cell: &str) -> impl Iterator<Item = String> {
    cell.split('`').skip(1).step_by(2).map(String::from)
}

/// Cells of the rows of tables under a heading.
fn rows(heading: &str) -> Vec<Vec<&'static str>> {
    let lines = PAGE.lines().skip_while(|line| *line != heading).skip(1).take_while(|line| !line.starts_with('#'));
    let rows = lines.filter(|line| line.starts_with("| `"));
    rows.map(|row| row.split(" | ").collect()).collect()
}

/// What the page names in the first cells of the tables under a heading.
fn described(heading: &str) -> BTreeSet<String> {
    rows(heading).iter().flat_map(|row| names(row[0])).collect()
}

fn keys<'a>(tables: impl IntoIterator<Item = &'a Value>) -> BTreeSet<String> {
    tables.into_iter().flat_map(|table| table.as_object().unwrap().keys().cloned()).collect()
}

/// The header of a file with its checksum, and the names of its tensors without numbers of layers and branches.
fn parts(model: &ModelFile<f64>) -> (Value, BTreeSet<String>) {
    let bytes = model.to_bytes().unwrap();
    let (_, metadata) = SafeTensors::read_metadata(&bytes).unwrap();
    let header = serde_json::from_str(&metadata.metadata().as_ref().unwrap()["lnn"]).unwrap();
    let plain = |name: &str| {
        let name = name.trim_start_matches("branches.0.").trim_start_matches("branches.1.");
        name.split('.').map(|part| if part.parse::<usize>().is_ok() { "K" } else { part }).collect::<Vec<_>>().join(".")
    };
    (header, SafeTensors::deserialize(&bytes).unwrap().names().into_iter().map(plain).collect())
}

/// All keys of a table, as the reader lists them for one that it does not know.
fn known_to_the_reader(header: &Value, path: &str) -> BTreeSet<String> {
    let mut header = header.clone();
    let table: &mut Map<String, Value> = header.pointer_mut(path).unwrap().as_object_mut().unwrap();
    table.insert("novelty".to_string(), Value::Null);
    let refusal = serde_json::from_value::<Header>(header).unwrap_err().to_string();
    assert!(refusal.contains("novelty"), "{refusal}");
    names(refusal.split_once("expected").unwrap().1).collect()
}

#[test]
fn the_page_describes_every_key_and_every_tensor() {
    let written: Vec<(Value, BTreeSet<String>)> = kinds().iter().map(|(_, model)| parts(model)).collect();
    let tensors: BTreeSet<String> = written.iter().flat_map(|(_, tensors)| tensors.clone()).collect();
    assert_eq!(described("## Tensors"), tensors);
    let headers = || written.iter().map(|(header, _)| header);
    let radial = headers().find(|header| header.pointer("/architecture/form/radial/0").is_some()).unwrap();
    let mut radial = radial.clone();
    radial.as_object_mut().unwrap().remove("checksum");
    for (heading, path) in [
        ("## Header", ""),
        ("### Architecture", "/architecture"),
        ("### Form", "/architecture/form"),
        ("### Radial", "/architecture/form/radial/0"),
    ] {
        let mut emitted = keys(headers().filter_map(|header| header.pointer(path)));
        assert_eq!(described(heading), emitted, "{heading}");
        emitted.remove("checksum");
        assert_eq!(known_to_the_reader(&radial, path), emitted, "{heading}: a model of every kind is written");
    }
}

/// Keys that are said to be left out are left out of the plainest model, and no others.
#[test]
fn the_page_says_which_keys_are_left_out() {
    let written: Vec<Value> = kinds().iter().map(|(_, model)| parts(model).0).collect();
    for (heading, path) in
        [("## Header", ""), ("### Architecture", "/architecture"), ("### Form", "/architecture/form")]
    {
        let all: Vec<BTreeSet<String>> =
            written.iter().filter_map(|h| h.pointer(path)).map(|table| keys([table])).collect();
        for row in rows(heading) {
            let never = row[2].starts_with("never");
            for name in names(row[0]) {
                assert_eq!(all.iter().all(|keys| keys.contains(&name)), never, "{heading}: {name}");
            }
        }
    }
}

#[test]
fn the_page_names_every_value_of_a_choice() {
    let form = "### Form";
    let choices: [(&str, &str, Vec<String>); 5] = [
        ("### Architecture", "activation", ActivationChoice::ALL.map(|choice| choice.to_string()).into()),
        ("### Architecture", "input_layer", vec!["none".to_string(), "dyt".to_string()]),
        (form, "structure", Structure::ALL.map(|structure| structure.name().to_string()).into()),
        (
            form,
            "factor",
            [Factor::Triangle, Factor::Rectangle]
                .map(|factor| serde_json::to_value(factor).unwrap().as_str().unwrap().to_string())
                .into(),
        ),
        ("## Header", "precision", vec!["f32".to_string(), "f64".to_string()]),
    ];
    for (heading, key, values) in choices {
        let row = rows(heading).into_iter().find(|row| names(row[0]).any(|name| name == key)).unwrap();
        let said: BTreeSet<String> = names(row[1]).chain(names(row[2])).collect();
        assert!(values.iter().all(|value| said.contains(value)), "{key}: {values:?}, {said:?}");
    }
}

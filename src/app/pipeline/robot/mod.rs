//! Reads robots from files of other programs: URDF and MJCF. A file is converted to links, and these become the description of a system
//! with `[[links]]` and constants, as if the user had written it.

mod geoms;
mod mjcf;
mod rigid;
#[cfg(test)]
mod tests;
mod urdf;
mod write;
mod xml;

use crate::lagrangian::system::System;
use crate::lagrangian::{Description, inertia_symbols, is_free_name, loss_symbols};
use crate::pipeline::from_table;
use crate::pipeline::thresholds::{DEFAULT_BOUNDS, DEFAULT_SPEED};
use rigid::{Body, Place};
use std::path::Path;
use toml::{Table, Value};
pub use write::rewrite_robot;
use xml::Fault;

/// A robot: its moving links, each after the one that carries it.
#[derive(Debug)]
struct Robot {
    name: String,
    gravity: [f64; 3],
    links: Vec<Link>,
    /// Notes on elements that are ignored or interpreted differently.
    notes: Vec<String>,
}

/// A moving link, with everything fixed to it.
#[derive(Debug)]
struct Link {
    name: String,
    /// Name of the joint that moves it.
    joint: String,
    /// Index of the link that carries it; `None` for the base.
    parent: Option<usize>,
    place: Place,
    axis: [f64; 3],
    slides: bool,
    /// `true` for a joint without limits.
    is_free: bool,
    bounds: Option<(f64, f64)>,
    speed: Option<f64>,
    /// Combined body, about the frame of the joint.
    body: Body,
    /// Its parts: names of links in the file, with their places and bodies; the link itself first.
    parts: Vec<Part>,
    /// Inertia of the drive, viscous friction and dry friction.
    losses: [f64; 3],
    /// For a mimic joint: index of the link whose coordinate moves it, ratio and offset.
    follows: Option<(usize, f64, f64)>,
}

/// A rigid part of a link: the name of its element, its place in the frame of the joint, and its body in its own frame.
#[derive(Clone, Debug)]
struct Part {
    name: String,
    place: Place,
    body: Body,
}

/// `true` if the file name has the extension of a robot file.
pub fn is_robot(path: &Path) -> bool {
    path.extension().is_some_and(|end| ["urdf", "xml"].iter().any(|known| end.eq_ignore_ascii_case(known)))
}

/// Parses the system in a robot file; also returns remarks on parts of the file that were not read.
///
/// # Errors
/// Line, from 1, and what is wrong there.
pub fn parse_robot(text: &str) -> Result<(System, Vec<String>), Fault> {
    let (mut robot, line) = read(text)?;
    let system = robot.system().map_err(|problem| (line, problem))?;
    Ok((system, robot.notes))
}

/// Reads a robot; also returns the line of its root.
fn read(text: &str) -> Result<(Robot, usize), Fault> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let document = xml::parse(text)?;
    let root = document.root_element();
    let (line, _) = xml::fault(root, "");
    let robot = match root.tag_name().name() {
        "robot" => urdf::read(root)?,
        "mujoco" => mjcf::read(root)?,
        _ => return Err(xml::fault(root, "expected <robot> of a URDF or <mujoco> of an MJCF file")),
    };
    match robot.links.len() {
        1..=Description::MOST_LINKS => Ok((robot, line)),
        count => Err((line, format!("expected 1 to {} joints that move, found {count}", Description::MOST_LINKS))),
    }
}

impl Robot {
    /// Creates the system: first a description without constants, which lists them, then one with the values of the file.
    fn system(&mut self) -> Result<System, String> {
        let table = self.table();
        let description: Description =
            from_table(Value::Table(table)).map_err(|(path, problem)| format!("{path}: {problem}"))?;
        let plain = description.system().map_err(|error| error.to_string())?;
        let values = self.constants();
        let values: Vec<(&str, f64)> = values.iter().map(|(name, x)| (name.as_str(), *x)).collect();
        let full = plain.with_defaults(&values).ok_or("no description")?;
        full.system().map_err(|error| error.to_string())
    }

    /// Lists the constants of the links and joints, by symbol.
    fn constants(&self) -> Vec<(String, f64)> {
        let of = |(k, link): (usize, &Link)| {
            let bodies = inertia_symbols(k + 1).into_iter().zip(link.body.0);
            bodies.chain(loss_symbols(k + 1).into_iter().zip(link.losses)).collect::<Vec<_>>()
        };
        self.links.iter().enumerate().flat_map(of).collect()
    }

    /// Writes the description without constants.
    fn table(&mut self) -> Table {
        let numbers = |x: &[f64]| Value::Array(x.iter().map(|&x| Value::Float(x)).collect());
        let mut chain = Table::new();
        chain.insert("gravity".into(), numbers(&self.gravity));
        chain.insert("friction".into(), true.into());
        if self.links.iter().any(|link| link.losses[0] != 0.0) {
            chain.insert("armature".into(), true.into());
        }
        let number = |at: Option<usize>| Value::Integer(at.map_or(0, |at| at as i64 + 1));
        let mut rows = Vec::new();
        for (k, link) in self.links.iter().enumerate() {
            let mut row = Table::new();
            let named = |other: &Link| other.name == link.name;
            if is_shown(&link.name) && link.name.parse::<usize>().is_err() && !self.links[..k].iter().any(named) {
                row.insert("name".into(), link.name.clone().into());
            }
            row.insert("parent".into(), number(link.parent));
            row.insert("xyz".into(), numbers(&link.place.at));
            row.insert("rpy".into(), numbers(&link.place.angles()));
            row.insert("axis".into(), numbers(&link.axis));
            row.insert("prismatic".into(), link.slides.into());
            if let Some((leader, ratio, offset)) = link.follows {
                row.insert("mimic".into(), number(Some(leader)));
                row.insert("ratio".into(), ratio.into());
                row.insert("offset".into(), offset.into());
            }
            rows.push(Value::Table(row));
        }
        let mut table = Table::new();
        table.insert("name".into(), self.plain_name().into());
        if is_shown(&self.name) {
            table.insert("title".into(), self.name.clone().into());
        }
        table.insert("chain".into(), chain.into());
        table.insert("links".into(), rows.into());
        table.insert("coordinates".into(), self.coordinates().into());
        table
    }

    /// Converts the name to one that systems may have.
    fn plain_name(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '-' };
        let name: String = self.name.chars().map(plain).take(60).collect();
        let name = name.trim_start_matches('-');
        match name.is_empty() || System::named(name).is_ok() {
            true => format!("{name}_robot"),
            false => name.to_string(),
        }
    }

    /// Names the coordinates after the joints, as far as formulas allow such names.
    fn coordinates(&mut self) -> Vec<Value> {
        let constants: Vec<String> = self.constants().into_iter().map(|(name, _)| name).collect();
        let (mut names, mut renamed): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
        let mut tables = Vec::new();
        for link in self.links.iter().filter(|link| link.follows.is_none()) {
            let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
            let mut name: String = link.joint.chars().map(plain).take(40).collect();
            if !name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
                name.insert(0, 'q');
            }
            while is_taken(&name, &constants, &names) {
                name.push('_');
            }
            if name != link.joint {
                renamed.push(format!("{} is {name}", link.joint));
            }
            let mut table = Table::new();
            let pair = |(low, high): (f64, f64)| Value::Array(vec![low.into(), high.into()]);
            let usual = if link.slides { DEFAULT_BOUNDS.1 } else { DEFAULT_BOUNDS.0 };
            let speed = link.speed.unwrap_or(DEFAULT_SPEED);
            table.insert("name".into(), name.clone().into());
            table.insert("unit".into(), if link.slides { "m" } else { "rad" }.into());
            table.insert("periodic".into(), link.is_free.into());
            table.insert("bounds".into(), pair(link.bounds.unwrap_or((-usual, usual))));
            table.insert("velocity_bounds".into(), pair((-speed, speed)));
            tables.push(Value::Table(table));
            names.push(name);
        }
        if !renamed.is_empty() {
            self.notes.push(format!("joints whose names are none of coordinates have others: {}", xml::list(&renamed)));
        }
        tables
    }
}

/// `true` if a name is printable.
fn is_shown(name: &str) -> bool {
    !name.is_empty() && name.chars().count() <= 100 && !name.chars().any(char::is_control)
}

/// `true` if a name cannot be used for a coordinate, because the description or the results already use it.
fn is_taken(name: &str, constants: &[String], names: &[String]) -> bool {
    let ends = ["_dot", "_ddot", "_force"];
    // Definitions of links, such as `link1_wx`.
    let part = name.strip_prefix("link").and_then(|rest| rest.split_once('_'));
    let of_part = part.is_some_and(|(number, rest)| number.parse::<usize>().is_ok() && rest.len() <= 3);
    let of_result = ["energy", "t", "tau"].contains(&name) || ends.iter().any(|end| name.ends_with(end));
    !is_free_name(name) || of_part || of_result || constants.iter().chain(names).any(|known| known == name)
}

//! Writes new constants into a URDF: only the numbers of inertials and of joint dynamics are replaced.

use super::rigid::{Body, Place, back, turned};
use super::urdf::origin;
use super::xml::{Fault, child, children, fault};
use super::{Link, read, xml};
use crate::lagrangian::{applied, inertia_symbols, loss_symbols};
use crate::pipeline::thresholds::{SAME_NUMBER, WRITTEN_ROUNDING};
use roxmltree::Node;
use std::ops::Range;

/// Ranges of a text with their replacements.
struct Edits(Vec<(Range<usize>, String)>);

/// Replaces constants, given by symbol, in the text of a URDF; missing and unchanged constants change nothing.
///
/// Parts fixed to a link keep their bodies, and the remainder becomes the body of the link itself. If the remainder is not a physical body,
/// all parts are transformed by the same map.
///
/// # Errors
/// Line, from 1, and what is wrong there: with the file, or with the constants of a link.
pub fn rewrite_robot(text: &str, values: &[(&str, f64)]) -> Result<String, Fault> {
    let (robot, _) = read(text)?;
    let value = |symbol: &String, usual: f64| values.iter().find(|(name, _)| name == symbol).map_or(usual, |(_, x)| *x);
    let plain = text.strip_prefix('\u{feff}').unwrap_or(text);
    let document = xml::parse(plain)?;
    let root = document.root_element();
    if !root.has_tag_name("robot") {
        return Err(fault(
            root,
            "only a URDF is written with other constants; let the name of the result end in .toml",
        ));
    }
    let mut edits = Edits(Vec::new());
    let named = |tag: &str, name: &str| children(root, tag).find(|node| node.attribute("name") == Some(name));
    let mut expected = Vec::new();
    for (k, link) in robot.links.iter().enumerate() {
        let symbols = inertia_symbols(k + 1);
        let whole = Body(std::array::from_fn(|i| value(&symbols[i], link.body.0[i])));
        expected.push(whole);
        let parts = if whole == link.body { Vec::new() } else { shares(link, &whole) };
        for (part, own) in link.parts.iter().zip(&parts) {
            let Some(node) = named("link", &part.name) else { continue };
            let body = own.ok_or_else(|| {
                fault(node, "its constants are none of a body: the sum with what is fixed to it has no room for it")
            })?;
            if body != part.body {
                edits.set_body(node, &body)?;
            }
        }
        let [_, viscous, dry] = loss_symbols(k + 1);
        let losses = [value(&viscous, link.losses[1]), value(&dry, link.losses[2])];
        if let Some(node) = named("joint", &link.joint).filter(|_| losses != link.losses[1..]) {
            edits.set_dynamics(node, losses, [link.losses[1], link.losses[2]])?;
        }
    }
    let mark = &text[..text.len() - plain.len()];
    let written = mark.to_string() + &edits.applied_to(plain);
    let (again, line) = read(&written)?;
    for (link, whole) in again.links.iter().zip(&expected) {
        let size = whole.0.iter().fold(0f64, |most, x| most.max(x.abs()));
        let is_same = link.body.0.iter().zip(whole.0).all(|(a, b)| (a - b).abs() <= WRITTEN_ROUNDING * size);
        if !is_same {
            return Err((
                line,
                format!("link {:?}: its constants cannot be written as mass, centre and inertia", link.name),
            ));
        }
    }
    Ok(written)
}

/// Distributes a body over the parts of a link, each in its own frame; the first is `None` if no physical distribution exists.
fn shares(link: &Link, whole: &Body) -> Vec<Option<Body>> {
    let seen: Vec<Body> = link.parts.iter().map(|part| part.body.seen(&part.place)).collect();
    let rest = seen[1..].iter().fold(*whole, |rest, part| rest.plus(part, -1.0));
    let fixed = link.parts[1..].iter().map(|part| Some(part.body));
    if rest.exists() {
        return std::iter::once(Some(rest)).chain(fixed).collect();
    }
    match Body::stretched(&seen, whole).filter(|_| seen.len() > 1) {
        Some(bodies) => {
            let away = |place: &Place| {
                let turn = back(&place.turn);
                let at = applied(&turn, place.at).map(|x| -x);
                Place { turn, at }
            };
            link.parts.iter().zip(bodies).map(|(part, body)| Some(body.seen(&away(&part.place)))).collect()
        }
        None => std::iter::once(None).chain(fixed).collect(),
    }
}

impl Edits {
    /// Applies the edits to a text.
    fn applied_to(mut self, text: &str) -> String {
        // Edits at the same place keep their order.
        self.0.sort_by_key(|(range, _)| range.start);
        let (mut out, mut at) = (String::with_capacity(text.len()), 0);
        for (range, new) in self.0 {
            out += &text[at..range.start];
            out += &new;
            at = range.end;
        }
        out + &text[at..]
    }

    /// Sets attributes of an element, in place where they exist.
    fn set(&mut self, node: Node<'_, '_>, attributes: &[(&str, String)]) {
        for (key, new) in attributes {
            match node.attribute_node(*key) {
                // Unchanged numbers keep their text.
                Some(attribute) if is_same(attribute.value(), new) => {}
                Some(attribute) => self.0.push((attribute.range_value(), new.clone())),
                None => {
                    let at = node.range().start + 1 + node.tag_name().name().len();
                    self.0.push((at..at, format!(" {key}=\"{new}\"")));
                }
            }
        }
    }

    /// Inserts elements at the beginning of another one.
    fn insert(&mut self, node: Node<'_, '_>, elements: &str) {
        let (text, range) = (node.document().input_text(), node.range());
        let line = text[..range.start].rfind('\n').map_or(0, |at| at + 1);
        let indent: String = text[line..range.start].chars().take_while(|c| c.is_whitespace()).collect();
        let (mut quoted, mut end) = (None, range.end);
        for (at, c) in text[range.clone()].char_indices() {
            match (quoted, c) {
                (None, '"' | '\'') => quoted = Some(c),
                (Some(open), c) if c == open => quoted = None,
                (None, '>') => {
                    end = range.start + at;
                    break;
                }
                _ => {}
            }
        }
        let inside: String = elements.lines().map(|line| format!("\n{indent}  {line}")).collect();
        match text[..end].ends_with('/') {
            true => self.0.push((end - 1..end + 1, format!(">{inside}\n{indent}</{}>", node.tag_name().name()))),
            false => self.0.push((end + 1..end + 1, inside)),
        }
    }

    /// Sets the body of a link, given about the origin of its frame. A rotated inertial keeps its rotation.
    fn set_body(&mut self, link: Node<'_, '_>, body: &Body) -> Result<(), Fault> {
        let (mass, centre, inertia) = body.central();
        let node = child(link, "inertial")?;
        let turn = back(&node.map_or(Ok(Place::HERE), origin)?.turn);
        let i = turned(&turn, &inertia);
        let keys = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        let entries = [i[0][0], i[0][1], i[0][2], i[1][1], i[1][2], i[2][2]].map(number);
        let inertia: Vec<(&str, String)> = keys.into_iter().zip(entries).collect();
        let elements = [
            ("inertia", inertia),
            ("mass", vec![("value", number(mass))]),
            ("origin", vec![("xyz", centre.map(number).join(" "))]),
        ];
        let Some(node) = node else {
            let lines: Vec<String> =
                elements.iter().rev().map(|(tag, own)| format!("  {}", element(tag, own))).collect();
            self.insert(link, &format!("<inertial>\n{}\n</inertial>", lines.join("\n")));
            return Ok(());
        };
        let mut missing = Vec::new();
        for (tag, own) in elements.iter().rev() {
            match child(node, tag)? {
                Some(found) => self.set(found, own),
                None => missing.push(element(tag, own)),
            }
        }
        if !missing.is_empty() {
            self.insert(node, &missing.join("\n"));
        }
        Ok(())
    }

    /// Sets viscous and dry friction of a joint if they differ from the present values.
    fn set_dynamics(&mut self, joint: Node<'_, '_>, [viscous, dry]: [f64; 2], before: [f64; 2]) -> Result<(), Fault> {
        let both = [("damping", viscous, before[0]), ("friction", dry, before[1])];
        let changed = both.iter().filter(|(_, new, old)| new != old);
        let own: Vec<(&str, String)> = changed.map(|(key, new, _)| (*key, number(*new))).collect();
        match child(joint, "dynamics")? {
            Some(node) => self.set(node, &own),
            None => self.insert(joint, &element("dynamics", &own)),
        }
        Ok(())
    }
}

/// `true` if two attributes have equal numbers up to rounding relative to the largest of them.
fn is_same(before: &str, after: &str) -> bool {
    let numbers = |text: &str| text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>();
    let (Some(before), Some(after)) = (numbers(before), numbers(after)) else { return false };
    let size = before.iter().fold(0f64, |most, x| most.max(x.abs()));
    before.len() == after.len() && before.iter().zip(&after).all(|(a, b)| (a - b).abs() <= SAME_NUMBER * size)
}

/// Formats an element without content.
fn element(tag: &str, attributes: &[(&str, String)]) -> String {
    let own: String = attributes.iter().map(|(key, x)| format!(" {key}=\"{x}\"")).collect();
    format!("<{tag}{own}/>")
}

/// Formats a number without loss, without a decimal point if it needs none.
fn number(x: f64) -> String {
    let text = format!("{:?}", x + 0.0);
    text.strip_suffix(".0").map(String::from).unwrap_or(text)
}

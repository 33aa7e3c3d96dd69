//! Access to the elements of a robot file: numbers, names, and positions of mistakes.

use crate::names::first_few;
use crate::pipeline::thresholds::{MAX_NODES, SHOWN_ITEMS};
use roxmltree::{Document, Node, ParsingOptions};

/// Line, from 1, and description of the mistake.
pub(super) type Fault = (usize, String);

/// Parses a document.
pub(super) fn parse(text: &str) -> Result<Document<'_>, Fault> {
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
        .map_err(|error| ((error.pos().row as usize).max(1), format!("no XML: {error}")))
}

/// Creates the fault for a mistake in an element.
pub(super) fn fault(node: Node<'_, '_>, problem: impl std::fmt::Display) -> Fault {
    let line = node.document().text_pos_at(node.range().start).row as usize;
    let named = node.attribute("name").map_or(String::new(), |name| format!(" name={name:?}"));
    (line.max(1), format!("<{}{named}>: {problem}", node.tag_name().name()))
}

/// Child elements with this name.
pub(super) fn children<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.has_tag_name(tag))
}

/// The only child element with this name, if there is one.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Result<Option<Node<'a, 'i>>, Fault> {
    let mut found = children(node, tag);
    let first = found.next();
    match found.next() {
        Some(second) => Err(fault(second, format!("expected one <{tag}>, there is one before"))),
        None => Ok(first),
    }
}

/// Returns a required attribute.
pub(super) fn required<'a>(node: Node<'a, '_>, key: &str) -> Result<&'a str, Fault> {
    node.attribute(key).ok_or_else(|| fault(node, format!("missing attribute `{key}`")))
}

/// Parses the finite numbers of an optional attribute, separated by spaces; their count must be one of `allowed`.
pub(super) fn numbers(node: Node<'_, '_>, key: &str, allowed: &[usize]) -> Result<Option<Vec<f64>>, Fault> {
    let Some(text) = node.attribute(key) else { return Ok(None) };
    let read = |word: &str| word.parse().ok().filter(|x: &f64| x.is_finite());
    let found: Option<Vec<f64>> = text.split_ascii_whitespace().map(read).collect();
    let shown: String = text.chars().take(40).collect();
    let counts = || allowed.iter().map(usize::to_string).collect::<Vec<_>>().join(" or ");
    match found.filter(|found| allowed.contains(&found.len())) {
        Some(found) => Ok(Some(found)),
        None => Err(fault(
            node,
            format!(
                "`{key}`: expected {} finite, found {shown:?}",
                match allowed {
                    [1] => "a number,".to_string(),
                    _ => format!("{} numbers,", counts()),
                }
            ),
        )),
    }
}

/// Parses the finite number of an optional attribute.
pub(super) fn number(node: Node<'_, '_>, key: &str) -> Result<Option<f64>, Fault> {
    Ok(numbers(node, key, &[1])?.map(|found| found[0]))
}

/// Parses three finite numbers of an attribute; `usual` is the default.
pub(super) fn triple(node: Node<'_, '_>, key: &str, usual: [f64; 3]) -> Result<[f64; 3], Fault> {
    Ok(numbers(node, key, &[3])?.map_or(usual, |found| [found[0], found[1], found[2]]))
}

/// Joins items by commas, shortened if there are too many.
pub(super) fn list(items: &[String]) -> String {
    first_few(items, SHOWN_ITEMS, ", ")
}

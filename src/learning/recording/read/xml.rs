//! A minimal XML parser for workbooks: tags, their attributes, and the text before them.

use super::Problem;
use super::thresholds::LONGEST_TAG;
use std::io::{BufRead, Read};

/// A tag and the text before it.
#[derive(Debug, Default)]
pub struct Tag {
    /// Text between the tag before and this one, escapes resolved.
    pub text: String,
    /// Its name, without a prefix.
    pub name: String,
    /// `true` if the tag ends an element, like `</name>` and `<name/>`.
    pub end: bool,
    /// `true` if the tag begins an element.
    pub start: bool,
    attributes: String,
}

impl Tag {
    /// The value of an attribute, whatever its prefix.
    pub fn attribute(&self, name: &str) -> Option<String> {
        let mut rest = self.attributes.as_str();
        loop {
            let (before, after) = rest.split_once('=')?;
            let after = after.trim_start();
            let quote = after.chars().next().filter(|quote| ['"', '\''].contains(quote))?;
            let (value, behind) = after[1..].split_once(quote)?;
            if local(before.trim()) == name {
                return Some(unescaped(value));
            }
            rest = behind;
        }
    }
}

/// Reads the next tag; none at the end.
pub fn next(input: &mut impl BufRead) -> Result<Option<Tag>, Problem> {
    let mut until = |mark: u8| -> Result<Option<String>, Problem> {
        let mut bytes = Vec::new();
        input.by_ref().take(LONGEST_TAG).read_until(mark, &mut bytes)?;
        let long = bytes.len() as u64 == LONGEST_TAG;
        match bytes.pop() {
            Some(last) if last == mark => {}
            _ if long => return Err(damaged()),
            _ => return Ok(None),
        }
        String::from_utf8(bytes).map(Some).map_err(|_| damaged())
    };
    let mut tag = Tag::default();
    loop {
        let Some(text) = until(b'<')? else { return Ok(None) };
        tag.text += &unescaped(&text);
        let inside = until(b'>')?.ok_or_else(damaged)?;
        if inside.starts_with(['!', '?']) {
            continue;
        }
        let (inside, closes) = inside.strip_prefix('/').map_or((inside.as_str(), false), |inside| (inside, true));
        let (inside, alone) = inside.strip_suffix('/').map_or((inside, false), |inside| (inside, true));
        let (name, attributes) = inside.split_once(char::is_whitespace).unwrap_or((inside, ""));
        (tag.name, tag.attributes) = (local(name).to_string(), attributes.to_string());
        (tag.start, tag.end) = (!closes, closes || alone);
        return Ok(Some(tag));
    }
}

/// The error for an invalid workbook.
pub fn damaged() -> Problem {
    Problem::Array("an incomplete or damaged workbook".to_string())
}

/// A name without its prefix.
fn local(name: &str) -> &str {
    name.rsplit(':').next().unwrap_or(name)
}

/// A text with its escapes resolved.
fn unescaped(text: &str) -> String {
    let mut parts = text.split('&');
    let mut plain = parts.next().unwrap_or_default().to_string();
    for part in parts {
        let (escape, rest) = part.split_once(';').unwrap_or(("", part));
        let code = |digits: &str, radix| u32::from_str_radix(digits, radix).ok().and_then(char::from_u32);
        let letter = match escape {
            "lt" => Some('<'),
            "gt" => Some('>'),
            "amp" => Some('&'),
            "quot" => Some('"'),
            "apos" => Some('\''),
            _ => match escape.strip_prefix("#x") {
                Some(digits) => code(digits, 16),
                None => escape.strip_prefix('#').and_then(|digits| code(digits, 10)),
            },
        };
        plain.extend(letter);
        plain.push_str(rest);
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_attributes_and_escapes_are_read() {
        let mut text: &[u8] = b"<?xml?><a:row r = '1' x:id=\"a&amp;b\">1 &lt; &#x32;<!-- no --><c/></a:row>";
        let row = next(&mut text).unwrap().unwrap();
        assert!(row.name == "row" && row.start && !row.end);
        assert_eq!(["r", "id", "q"].map(|name| row.attribute(name)), [Some("1".into()), Some("a&b".into()), None]);
        let cell = next(&mut text).unwrap().unwrap();
        assert_eq!((cell.text.as_str(), cell.name.as_str(), cell.start, cell.end), ("1 < 2", "c", true, true));
        let end = next(&mut text).unwrap().unwrap();
        assert!(end.name == "row" && !end.start && end.end && next(&mut text).unwrap().is_none());
    }
}

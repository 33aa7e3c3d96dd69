//! Splits lines of text into fields.

use serde::Serialize;

/// Separator of the fields of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Separator {
    /// `,`.
    Comma,
    /// `;`.
    Semicolon,
    /// A tab.
    Tab,
    /// `|`.
    Bar,
    /// Any number of spaces and tabs.
    Blanks,
}

impl Separator {
    /// The separator of a line: the first of `;`, `,`, tab and `|` outside double quotes, or blanks between words. A comma is not the
    /// separator if another separator divides the line differently, or if blanks separate numbers with decimal commas.
    pub fn of(line: &str) -> Self {
        let outside: String =
            line.split('"').enumerate().map(|(k, part)| if k % 2 == 0 { part } else { "q" }).collect();
        let (line, known) = (outside.trim(), [(';', Self::Semicolon), ('\t', Self::Tab), ('|', Self::Bar)]);
        let inside = |c: char| line.split(',').any(|part| part.trim().contains(c));
        let decimal = |word: &str| is_decimal_comma(word) || word.parse::<f64>().is_ok();
        let words = || line.split_whitespace();
        match known.iter().find(|(c, _)| inside(*c)) {
            Some((_, found)) => *found,
            None if line.contains(',') && !(words().nth(1).is_some() && words().all(decimal)) => Self::Comma,
            None if words().nth(1).is_some() => Self::Blanks,
            None => Self::Comma,
        }
    }

    /// Words that a message adds to "fields"; nothing for commas.
    pub fn named(self) -> &'static str {
        match self {
            Self::Comma => "",
            Self::Semicolon => " separated by semicolons",
            Self::Tab => " separated by tabs",
            Self::Bar => " separated by bars",
            Self::Blanks => " separated by blanks",
        }
    }

    fn is(self, byte: u8) -> bool {
        match self {
            Self::Comma => byte == b',',
            Self::Semicolon => byte == b';',
            Self::Tab => byte == b'\t',
            Self::Bar => byte == b'|',
            Self::Blanks => byte == b' ' || byte == b'\t',
        }
    }

    /// The fields of a line; separators between double quotes do not separate.
    pub(crate) fn fields(self, line: &[u8]) -> Fields<'_> {
        Fields { rest: Some(if self == Self::Blanks { line.trim_ascii() } else { line }), separator: self }
    }
}

/// `true` for a number with a decimal comma between two digits, such as `0,5`.
fn is_decimal_comma(word: &str) -> bool {
    let digit = |letter: Option<char>| letter.is_some_and(|letter| letter.is_ascii_digit());
    let parts = word.split_once(',');
    parts.is_some_and(|(whole, part)| digit(whole.chars().last()) && digit(part.chars().next()))
        && with_point(word).is_some()
}

/// Replaces a decimal comma by a point and parses the number; `None` if the text has no comma or also a point.
pub(crate) fn with_point(text: &str) -> Option<f64> {
    let mut plain = [0; 64];
    let plain = plain.get_mut(..text.len())?;
    plain.copy_from_slice(text.as_bytes());
    let mut marks = plain.iter_mut().filter(|byte| matches!(**byte, b',' | b'.'));
    match (marks.next(), marks.next()) {
        (Some(mark), None) if *mark == b',' => *mark = b'.',
        _ => return None,
    }
    std::str::from_utf8(plain).ok()?.parse().ok()
}

/// The byte that ends the lines of a text with this beginning: LF (with or without a CR before it), or CR alone if there is no LF.
pub fn line_end(beginning: &[u8]) -> u8 {
    if beginning.contains(&b'\r') && !beginning.contains(&b'\n') { b'\r' } else { b'\n' }
}

/// Fields of a line, from left to right.
pub(crate) struct Fields<'a> {
    rest: Option<&'a [u8]>,
    separator: Separator,
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest?;
        let mut quoted = false;
        let end = rest.iter().position(|&byte| {
            quoted ^= byte == b'"';
            !quoted && self.separator.is(byte)
        });
        let (field, after) = match end {
            Some(at) => (&rest[..at], Some(&rest[at + 1..])),
            None => (rest, None),
        };
        self.rest = match self.separator {
            Separator::Blanks => after.map(<[u8]>::trim_ascii_start),
            _ => after,
        };
        Some(field)
    }
}

/// Text of a comment after its `#`, if the line is one.
pub fn comment(line: &[u8]) -> Option<&[u8]> {
    line.starts_with(b"#").then(|| {
        let marks = line.iter().take_while(|byte| **byte == b'#').count();
        line[marks..].trim_ascii()
    })
}

/// The names of columns in the last comment above the numbers, if it has one for every column.
pub fn names_in(comment: &str, width: usize) -> Option<Vec<String>> {
    let names: Vec<&str> = split(comment, Separator::of(comment));
    let good = names.len() == width && names.iter().all(|name| !name.is_empty() && name.parse::<f64>().is_err());
    good.then(|| names.iter().map(ToString::to_string).collect())
}

/// The fields of a line of text without the spaces and quotes around them.
pub fn split(line: &str, separator: Separator) -> Vec<&str> {
    // A separator is one ASCII byte, so a field between two of them is valid text if the line is.
    separator.fields(line.as_bytes()).map(|field| unquoted(std::str::from_utf8(field).unwrap_or_default())).collect()
}

/// A field without the spaces and quotes around it.
pub(crate) fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).map_or(field, str::trim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_are_seen_and_cut() {
        for (line, expected) in [
            ("a,b,c", Separator::Comma),
            ("0,1;0,2;0,3", Separator::Semicolon),
            ("a\tb c\td", Separator::Tab),
            ("a|b|c", Separator::Bar),
            ("1  2 \t3", Separator::Tab),
            ("1   2 3", Separator::Blanks),
            ("\"a;b\" c d", Separator::Blanks),
            ("alone", Separator::Comma),
            ("0,1\t0,2", Separator::Tab),
            ("t [s]\tcart, x", Separator::Tab),
            ("t,\tx,\ty", Separator::Comma),
            ("0,1|0,2", Separator::Bar),
            ("0,1 0 -0,2e-3", Separator::Blanks),
            ("1, 2, 3", Separator::Comma),
            ("0,1", Separator::Comma),
        ] {
            assert_eq!(Separator::of(line), expected, "{line}");
        }
        assert_eq!(split(" 1   2  3 ", Separator::Blanks), ["1", "2", "3"]);
        assert_eq!(split("\"a b\"  c", Separator::Blanks), ["a b", "c"]);
        assert_eq!(split("\"a;b\"; \"c\" ;;é", Separator::Semicolon), ["a;b", "c", "", "é"]);
        assert_eq!(split("", Separator::Comma), [""]);
    }

    #[test]
    fn a_comment_may_name_the_columns() {
        assert_eq!(comment(b"## t, x "), Some(&b"t, x"[..]));
        assert_eq!(comment(b"t # x"), None);
        assert_eq!(names_in("t, \"x\"", 2).unwrap(), ["t", "x"]);
        assert_eq!(names_in("t x", 2).unwrap(), ["t", "x"]);
        assert_eq!((names_in("measured by hand", 2), names_in("1, 2", 2), names_in("t,", 2)), (None, None, None));
    }
}

//! Numbers of a text, whose decimals have a point or a comma, the same throughout a file.

use super::Problem;
use super::encoding::decode;
use super::text::{unquoted, with_point};

/// Words for a missing reading.
const MISSING: [&str; 6] = ["nan", "na", "n/a", "null", "none", "-"];

/// Decimal mark of a file, once it is known.
#[derive(Clone, Copy, Debug, Default)]
pub struct Numbers {
    /// Row of the first decimal point.
    point: Option<u64>,
    /// Row of the first decimal comma.
    comma: Option<u64>,
}

impl Numbers {
    /// `true` if decimals have a comma.
    pub fn have_commas(&self) -> bool {
        self.comma.is_some()
    }

    /// Parses a finite number with the decimal mark of the file; the first mark that occurs decides. Fast if there are no blanks or quotes
    /// around the number.
    #[inline]
    pub fn parse(&mut self, field: &[u8], row: u64) -> Option<f64> {
        let text = std::str::from_utf8(field).ok()?;
        match self.parse_point(text, row) {
            None => {
                let text = unquoted(text);
                self.parse_point(text, row).or_else(|| self.parse_comma(text, row))
            }
            number => number,
        }
    }

    /// Like `parse`, but returns `NaN` for a missing reading: an empty field, or a word for it.
    #[inline]
    pub fn reading(&mut self, field: &[u8], row: u64) -> Option<f64> {
        self.parse(field, row).or_else(|| {
            let text = unquoted(std::str::from_utf8(field).ok()?.trim());
            (text.is_empty() || MISSING.iter().any(|word| text.eq_ignore_ascii_case(word))).then_some(f64::NAN)
        })
    }

    /// A number without a decimal comma.
    #[inline]
    fn parse_point(&mut self, text: &str, row: u64) -> Option<f64> {
        if self.comma.is_some() {
            return None;
        }
        let number = text.parse().ok().filter(|x: &f64| x.is_finite())?;
        if self.point.is_none() && text.contains('.') {
            self.point = Some(row);
        }
        Some(number)
    }

    /// A number without a decimal point, in a file that had none so far.
    fn parse_comma(&mut self, text: &str, row: u64) -> Option<f64> {
        if self.point.is_some() || text.contains('.') {
            return None;
        }
        let number = with_point(text);
        if number.is_some() {
            self.comma.get_or_insert(row);
        }
        number.or_else(|| text.parse().ok()).filter(|x| x.is_finite())
    }

    /// Explains why a field is not a number.
    pub fn refusal(&self, field: &[u8], row: u64, column: &str) -> Problem {
        let Some((text, _)) = decode(field) else { return Problem::NotText(row) };
        let (text, column) = (unquoted(&text), column.to_string());
        let found = text.chars().take(40).collect();
        match (self.point, self.comma) {
            (Some(since), _) if with_point(text).is_some() => {
                Problem::Decimal { row, column, found, comma: false, since }
            }
            (_, Some(since)) if text.parse::<f64>().is_ok_and(f64::is_finite) => {
                Problem::Decimal { row, column, found, comma: true, since }
            }
            _ => Problem::Field { row, column, found },
        }
    }
}

//! Named columns of CSV text, in any precision.

use super::text::{Separator, comment, line_end, names_in, split};
use crate::names::{nearest, pluralize, unknown};
use crate::scalar::Scalar;
use std::ops::Range;
use thiserror::Error;

/// A mistake in a table of numbers; rows are lines of the file, from 1.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NumberTableError {
    /// The file is empty.
    #[error("the file is empty, expected a header with the columns {0}")]
    Empty(String),
    /// Bytes that are not text.
    #[error("row {0}: not UTF-8 text")]
    NotText(usize),
    /// The first row contains numbers instead of column names.
    #[error("row {row}: expected a header with the columns {names}, found numbers")]
    NoHeader {
        /// The first row.
        row: usize,
        /// Names of the columns.
        names: String,
    },
    /// A column appears twice in the header.
    #[error("row {row}: duplicate column {name}")]
    Duplicate {
        /// Row of the header.
        row: usize,
        /// Its name.
        name: String,
    },
    /// A column of another name.
    #[error("row {row}: {problem}")]
    Unknown {
        /// Row of the header.
        row: usize,
        /// Its name and the nearest known one.
        problem: String,
    },
    /// Some columns are missing.
    #[error("row {row}: missing column {names}")]
    Missing {
        /// Row of the header.
        row: usize,
        /// Their names.
        names: String,
    },
    /// A row has too few or too many fields.
    #[error("row {row}: expected {}{separated}, found {found}", pluralize(*expected, "field", "fields"))]
    Ragged {
        /// The row.
        row: usize,
        /// Fields of the header.
        expected: usize,
        /// Separator of the fields, such as ` separated by blanks`; empty for commas.
        separated: &'static str,
        /// Fields of the row.
        found: usize,
    },
    /// A field is not a finite number.
    #[error("row {row}, column {column}: expected a finite number, found {found:?}")]
    Field {
        /// The row.
        row: usize,
        /// Name of the column.
        column: String,
        /// Text found there.
        found: String,
    },
    /// There is a header but no rows.
    #[error("no rows below the header")]
    NoRows,
}

/// Columns of a file of states or points, in the order they were requested.
#[derive(Clone, Debug, PartialEq)]
pub struct NumberTable<S> {
    /// Number of columns.
    width: usize,
    /// Finite numbers, `(rows, columns)`.
    pub values: Vec<S>,
    /// Line of the file, from 1, that each row is on.
    pub rows: Vec<usize>,
}

/// Text of a table: column names, separator, and the lines of numbers.
struct Columns<'a> {
    /// Row of the names.
    row: usize,
    names: Vec<String>,
    separator: Separator,
    lines: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
}

/// Finds the column names; `asked` are the columns that an error lists.
fn opened<'a>(bytes: &'a [u8], asked: &str) -> Result<Columns<'a>, NumberTableError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let row = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        NumberTableError::NotText(row)
    })?;
    let end = char::from(line_end(bytes));
    let rows =
        move || text.split(end).enumerate().map(|(k, line)| (k + 1, line)).filter(|(_, line)| !line.trim().is_empty());
    let remark = |line: &str| comment(line.trim().as_bytes()).is_some();
    let mut lines = rows().filter(move |(_, line)| !remark(line)).peekable();
    let above = rows().take_while(|(_, line)| remark(line)).last();
    let &(first, header) = lines.peek().ok_or_else(|| NumberTableError::Empty(asked.to_string()))?;
    let separator = Separator::of(header);
    let names: Vec<String> = split(header, separator).into_iter().map(String::from).collect();
    if names.iter().any(|name| name.parse::<f64>().is_err()) {
        lines.next();
        return Ok(Columns { row: first, names, separator, lines: Box::new(lines) });
    }
    let said = above.and_then(|(row, line)| {
        let said = line.trim().trim_start_matches('#').trim();
        Some((row, names_in(said, names.len())?))
    });
    let (row, names) = said.ok_or_else(|| NumberTableError::NoHeader { row: first, names: asked.to_string() })?;
    let names = names.into_iter().map(|name| name.to_string()).collect();
    Ok(Columns { row, names, separator, lines: Box::new(lines) })
}

impl<S: Scalar> NumberTable<S> {
    /// Names of all columns of CSV text.
    ///
    /// # Errors
    /// [`NumberTableError`] for text without a header.
    pub fn names(bytes: &[u8]) -> Result<Vec<String>, NumberTableError> {
        Ok(opened(bytes, "of the data")?.names)
    }

    /// Reads columns from CSV text.
    ///
    /// The first line that is neither blank nor a comment, which begins with `#`, names the columns, all of `columns` in any order; the last
    /// comment above numbers may do so too. Other columns are ignored. Fields are separated by commas, semicolons, tabs, bars or blanks, as in
    /// that line; spaces around them, double quotes, a byte order mark, blank lines and the line ends of Windows and of old Macs are accepted.
    /// Numbers are read in the precision of `S`: a double-double sees the decimal text, not its nearest `f64`.
    ///
    /// # Errors
    /// [`NumberTableError`] naming the first offending row and column.
    pub fn read(bytes: &[u8], columns: &[String]) -> Result<Self, NumberTableError> {
        let Columns { row, names, separator, lines } = opened(bytes, &columns.join(","))?;
        let order = read_header(row, &names, columns)?;
        let mut table = Self { width: columns.len(), values: Vec::new(), rows: Vec::new() };
        let mut numbers = vec![S::default(); columns.len()];
        for (row, line) in lines {
            let fields = split(line, separator);
            if fields.len() != order.len() {
                let (expected, separated, found) = (order.len(), separator.named(), fields.len());
                return Err(NumberTableError::Ragged { row, expected, separated, found });
            }
            for (field, &column) in fields.into_iter().zip(&order) {
                let Some(column) = column else { continue };
                numbers[column] = S::parse(field).filter(|x| x.is_finite()).ok_or_else(|| NumberTableError::Field {
                    row,
                    column: columns[column].clone(),
                    found: field.chars().take(40).collect(),
                })?;
            }
            table.values.extend_from_slice(&numbers);
            table.rows.push(row);
        }
        if table.rows.is_empty() { Err(NumberTableError::NoRows) } else { Ok(table) }
    }

    /// Some columns of some rows, `(rows, columns)`; rows beyond the last one are left out.
    pub fn part(&self, rows: Range<usize>, columns: Range<usize>) -> Vec<S> {
        let all = self.values.chunks_exact(self.width).skip(rows.start).take(rows.len());
        all.flat_map(|row| &row[columns.clone()]).copied().collect()
    }
}

/// For every field of a row, the index of its column, if it has one.
fn read_header(row: usize, names: &[String], columns: &[String]) -> Result<Vec<Option<usize>>, NumberTableError> {
    let mut order = Vec::with_capacity(names.len());
    for name in names {
        let column = columns.iter().position(|known| known == name);
        if column.is_some() && order.contains(&column) {
            return Err(NumberTableError::Duplicate { row, name: name.clone() });
        }
        order.push(column);
    }
    let missing: Vec<&str> =
        (0..columns.len()).filter(|k| !order.contains(&Some(*k))).map(|k| columns[k].as_str()).collect();
    if missing.is_empty() {
        return Ok(order);
    }
    // If a column is missing, an unknown one may be a misspelling of it.
    let near = |name: &&String| nearest(name, missing.iter().copied()).is_some();
    let foreign = || names.iter().zip(&order).filter(|(_, column)| column.is_none()).map(|(name, _)| name);
    let nothing_known = order.iter().all(Option::is_none);
    match foreign().find(near).or_else(|| foreign().next().filter(|_| nothing_known)) {
        Some(name) => {
            let problem = unknown("column", name, columns.iter().map(String::as_str));
            Err(NumberTableError::Unknown { row, problem })
        }
        None => Err(NumberTableError::Missing { row, names: missing.join(", ") }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn columns() -> Vec<String> {
        ["theta1", "theta2", "theta1_dot", "theta2_dot"].map(String::from).to_vec()
    }

    fn refusal(text: &str) -> String {
        NumberTable::<f64>::read(text.as_bytes(), &columns()).unwrap_err().to_string()
    }

    #[test]
    fn columns_come_in_any_order_and_dress() {
        let text = "\u{feff}\r\n\"theta2\", theta1 ,theta2_dot,theta1_dot\r\n 2,+1e0 ,4.,\"3\"\r\n\r\n-6,5,.8,7";
        let states = NumberTable::<f64>::read(text.as_bytes(), &columns()).unwrap();
        assert_eq!(states.values, [1.0, 2.0, 3.0, 4.0, 5.0, -6.0, 7.0, 0.8]);
        assert_eq!((states.part(0..9, 0..2), states.part(1..2, 2..4)), (vec![1.0, 2.0, 5.0, -6.0], vec![7.0, 0.8]));
        assert_eq!(states.rows, [3, 5]);
    }

    #[test]
    fn separators_and_comments_are_read() {
        let expected =
            NumberTable::<f64>::read(b"theta1,theta2,theta1_dot,theta2_dot\n1,-2,3,4.5\n", &columns()).unwrap();
        for text in [
            "theta1;theta2;theta1_dot;theta2_dot\n1;-2;3;4.5\n",
            "theta1\ttheta2\ttheta1_dot\ttheta2_dot\n1\t-2\t3\t4.5\n",
            "theta1 | theta2 | theta1_dot | theta2_dot\n1|-2|3|4.5\n",
            "  theta1  theta2 theta1_dot theta2_dot\n   1 -2   3 4.5\n",
            "# theta1 theta2 theta1_dot theta2_dot\n1 -2 3 4.5\n",
            "theta1,theta2,theta1_dot,theta2_dot\r1,-2,3,4.5\r",
            "theta1,theta2,theta1_dot,theta2_dot\r\n1,-2,3,4.5\r\n",
        ] {
            let states = NumberTable::<f64>::read(text.as_bytes(), &columns()).unwrap();
            assert_eq!((states.values, states.rows), (expected.values.clone(), vec![2]), "{text}");
        }
        let text = "# by hand\n\ntheta1,theta2,theta1_dot,theta2_dot\n# first\n1,-2,3,4.5\n # last\n";
        let states = NumberTable::<f64>::read(text.as_bytes(), &columns()).unwrap();
        assert_eq!((states.values, states.rows), (expected.values, vec![5]));
    }

    #[test]
    fn headers_are_checked() {
        assert!(refusal("").starts_with("the file is empty"));
        assert_eq!(refusal("theta1;theta2;theta1_dot;theta2_dot\n"), "no rows below the header");
        assert_eq!(refusal("theta1\ttheta2\n"), "row 1: missing column theta1_dot, theta2_dot");
        let expected = "row 2: expected a header with the columns theta1,theta2,theta1_dot,theta2_dot, found numbers";
        assert_eq!(refusal("# by hand\n1,2,3,4\n"), expected);
        assert_eq!(refusal("theta1,theta2,theta1\n"), "row 1: duplicate column theta1");
        assert_eq!(
            refusal("theta1,theta2,theta1_dto\n"),
            "row 1: unknown column \"theta1_dto\", did you mean \"theta1_dot\"?"
        );
        assert_eq!(refusal("\ntheta1,theta2_dot\n"), "row 2: missing column theta2, theta1_dot");
        assert_eq!(refusal("theta1,theta2,theta1_dot,theta2_dot\n\n"), "no rows below the header");
    }

    #[test]
    fn columns_of_a_roll_out_that_are_no_state_are_left_out() {
        let text = "t,theta1,theta2,theta1_dot,theta2_dot,energy\n0,1,2,3,4,nan\n0.1,5,6,7,8,x\n";
        let states = NumberTable::<f64>::read(text.as_bytes(), &columns()).unwrap();
        assert_eq!(states.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        assert_eq!(refusal("t,theta1,theta2,theta1_dot\n"), "row 1: missing column theta2_dot");
        let near = refusal("t,theta1,theta2,theta1_dot,theta2_do\n");
        assert_eq!(near, "row 1: unknown column \"theta2_do\", did you mean \"theta2_dot\"?");
    }

    #[test]
    fn fields_are_checked() {
        let with = |row: &str| refusal(&format!("theta1,theta2,theta1_dot,theta2_dot\n1,2,3,4\n{row}\n"));
        for bad in ["nan", "NaN", "inf", "-infinity", "1e999", "", "x", "0x10", "1_000", "1;2"] {
            assert_eq!(
                with(&format!("1,2,{bad},4")),
                format!("row 3, column theta1_dot: expected a finite number, found {bad:?}")
            );
        }
        assert_eq!(with("1,2,3"), "row 3: expected 4 fields, found 3");
        assert_eq!(with("1,2,3,4,"), "row 3: expected 4 fields, found 5");
        let bytes = b"theta1,theta2,theta1_dot,theta2_dot\n1,2,3,4\n1,\xff,3,4\n";
        assert_eq!(NumberTable::<f64>::read(bytes, &columns()), Err(NumberTableError::NotText(3)));
    }

    proptest! {
        #![proptest_config(crate::properties::properties(256))]

        #[test]
        fn numbers_survive(values in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, 4)) {
            let fields: Vec<String> = values.iter().map(|x| format!("{x:?}")).collect();
            let text = format!("theta1,theta2,theta1_dot,theta2_dot\n{}", fields.join(","));
            let states = NumberTable::<f64>::read(text.as_bytes(), &columns()).unwrap();
            prop_assert_eq!(states.values, values);
        }

        #[test]
        fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let text = [b"theta1,theta2,theta1_dot,theta2_dot\n".as_slice(), &bytes].concat();
            let _ = NumberTable::<f32>::read(&bytes, &columns());
            if let Ok(states) = NumberTable::<f64>::read(&text, &columns()) {
                prop_assert!(states.values.iter().all(|x| x.is_finite()));
            }
        }
    }
}

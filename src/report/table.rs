//! Tables for a terminal.

/// Text of a table with aligned columns: numbers to the right, words to the left, one line per row, no trailing blanks.
///
/// Rows may be shorter than the header. A cell counts as a number if it begins with a digit, a sign or a point.
pub fn text_table<H: AsRef<str>, C: AsRef<str>>(headers: &[H], rows: &[Vec<C>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0).max(headers.len());
    let width = |text: &str| text.chars().count();
    let mut widths = vec![0; columns];
    for (w, header) in widths.iter_mut().zip(headers) {
        *w = width(header.as_ref());
    }
    let mut numeric = vec![!rows.is_empty(); columns];
    for row in rows {
        for (i, cell) in row.iter().enumerate() {
            let cell = cell.as_ref();
            widths[i] = widths[i].max(width(cell));
            let number = cell.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
                || ["", "NaN", "inf"].contains(&cell);
            numeric[i] &= number;
        }
    }
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let mut text = String::new();
        for (i, cell) in cells.enumerate() {
            let pad = " ".repeat(widths[i] - width(cell));
            if i > 0 {
                text.push_str("  ");
            }
            if numeric[i] {
                text.push_str(&pad);
                text.push_str(cell);
            } else {
                text.push_str(cell);
                text.push_str(&pad);
            }
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
        text
    };
    let mut text = line(&mut headers.iter().map(AsRef::as_ref));
    let total = widths.iter().sum::<usize>() + 2 * columns.saturating_sub(1);
    text.push_str(&"-".repeat(total));
    text.push('\n');
    for row in rows {
        text.push_str(&line(&mut row.iter().map(AsRef::as_ref)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_align() {
        let text = text_table(&["name", "error"], &[vec!["θ₁", "1.5e-3"], vec!["longer", "-2"], vec!["short"]]);
        assert_eq!(text, "name     error\n--------------\nθ₁      1.5e-3\nlonger      -2\nshort\n");
        assert_eq!(text_table::<&str, &str>(&[], &[]), "\n\n");
    }
}

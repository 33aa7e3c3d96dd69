//! Names and numbers in messages: suggestions for mistyped names, wrapped and single-line texts, counts, digits, and names of result
//! columns.

use alloc::string::{String, ToString};
use alloc::vec::Vec;

/// Returns the candidate with the fewest edits (insert, delete, replace, swap neighbours) from `name`; `None` if each needs edits to more
/// than a third of the letters: `y` is not near `x`, nor `m3` near `m1`.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name: Vec<char> = name.to_lowercase().chars().take(64).collect();
    let near = |candidate: &'a str| {
        let letters: Vec<char> = candidate.to_lowercase().chars().collect();
        let distance = edits(&name, &letters);
        (distance <= name.len().max(letters.len()) / 3).then_some((distance, candidate))
    };
    candidates.into_iter().filter_map(near).min_by_key(|(distance, _)| *distance).map(|(_, candidate)| candidate)
}

/// Formats a count with its noun in the singular or the plural: `1 row`, `2 rows`.
pub fn pluralize(count: usize, singular: &str, plural: &str) -> String {
    format!("{count} {}", if count == 1 { singular } else { plural })
}

/// Lists the first items, separated by `between`, and the number of the others: `a, b and 3 more`.
pub fn first_few<T: core::fmt::Display>(items: &[T], most: usize, between: &str) -> String {
    let listed: Vec<String> = items.iter().take(most).map(ToString::to_string).collect();
    let clause = if between.starts_with(',') { " " } else { between };
    match items.len().saturating_sub(most) {
        0 => listed.join(between),
        more => format!("{}{clause}and {more} more", listed.join(between)),
    }
}

/// Formats `unknown WHAT "NAME"` with the nearest candidate, or with all of them if none is near.
pub fn unknown<'a>(what: &str, name: &str, candidates: impl IntoIterator<Item = &'a str> + Clone) -> String {
    let shown: String = name.chars().take(40).collect();
    match nearest(name, candidates.clone()) {
        Some(near) => format!("unknown {what} {shown:?}, did you mean {near:?}?"),
        None => {
            let all: Vec<&str> = candidates.into_iter().collect();
            if all.is_empty() {
                return format!("unknown {what} {shown:?}: there are none");
            }
            format!("unknown {what} {shown:?}, expected one of {}", all.join(", "))
        }
    }
}

/// Computes the optimal string alignment distance (Damerau 1964, Levenshtein 1966).
fn edits(a: &[char], b: &[char]) -> usize {
    let mut before = vec![0; b.len() + 1];
    let mut above: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut row = vec![i + 1];
        for j in 0..b.len() {
            let replaced = above[j] + usize::from(a[i] != b[j]);
            let mut least = replaced.min(above[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j] {
                least = least.min(before[j - 1] + 1);
            }
            row.push(least);
        }
        before = core::mem::replace(&mut above, row);
    }
    above[b.len()]
}

/// Joins lines with spaces and escapes control characters, so that an error is one line, whatever a file name contains. Removes the numbers
/// of system errors, and writes long numbers with an exponent.
pub fn one_line(text: &str) -> String {
    let joined = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
    short_numbers(&without_error_numbers(&joined)).chars().fold(String::with_capacity(joined.len()), |mut line, c| {
        if c.is_control() {
            line.extend(c.escape_default())
        } else {
            line.push(c)
        }
        line
    })
}

/// Removes the ` (os error 28)` that Rust adds to the message of the system.
fn without_error_numbers(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let first = parts.next().unwrap_or_default().to_string();
    parts.fold(first, |whole, part| match part.split_once(')') {
        Some((number, rest)) if number.parse::<i32>().is_ok() => whole + rest,
        _ => whole + " (os error " + part,
    })
}

/// Numbers with at least this many digits are written with an exponent; the largest 64-bit integer has one fewer.
const MOST_DIGITS: usize = 21;

/// Writes long decimal numbers in a text with exponents, but not digits inside words and paths.
fn short_numbers(text: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let mut whole = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(is_part) {
        let length = rest[start..].find(|c| !is_part(c)).unwrap_or(rest.len() - start);
        let (before, number, after) = (&rest[..start], &rest[start..start + length], &rest[start + length..]);
        let inside = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || "_/\\-".contains(c));
        // A minus sign that does not follow a word is not part of a word.
        let left = before.strip_suffix('-').filter(|left| !inside(left.chars().last())).unwrap_or(before);
        let apart = length > MOST_DIGITS && !inside(left.chars().last()) && !inside(after.chars().next());
        whole.push_str(before);
        match number.parse::<f64>() {
            Ok(x) if apart && x.is_finite() => whole.push_str(&format!("{x:e}")),
            _ => whole.push_str(number),
        }
        rest = after;
    }
    whole + rest
}

/// Returns the first coordinate whose name is used for another column, and the meaning of that column. Result columns are the time `t`, or
/// `tau` if a coordinate is called `t`, the energy, and for every coordinate `NAME_dot`, `NAME_ddot` and `NAME_force`.
pub fn taken_column(coordinates: &[&str]) -> Option<(usize, String)> {
    coordinates.iter().enumerate().find_map(|(index, name)| {
        let of_another = |end: &str| name.strip_suffix(end).filter(|other| coordinates.contains(other));
        let column = match *name {
            "energy" => "the energy of results".to_string(),
            "tau" if coordinates.contains(&"t") => "the time of results beside a coordinate t".to_string(),
            _ => {
                let ends = [("_dot", "velocity"), ("_ddot", "acceleration"), ("_force", "force")];
                let (other, what) = ends.iter().find_map(|(end, what)| Some((of_another(end)?, what)))?;
                format!("the {what} of {other}")
            }
        };
        Some((index, format!("{name} is the column of {column}, expected another name")))
    })
}

/// Formats a number with three significant digits: `0.0196`, `12.3`, `4.30e-5`. See [`rounded`].
pub fn number(x: f64) -> String {
    rounded(x, 3)
}

/// Formats a number with this many significant digits, as a decimal from `0.0001` to a million and with an exponent otherwise; digits
/// before the point are never cut. Numbers that are not finite become `-`.
pub fn rounded(x: f64, digits: usize) -> String {
    let after = digits.max(1) - 1;
    if !x.is_finite() {
        return "-".to_string();
    }
    if x == 0.0 {
        return "0".to_string();
    }
    let scientific = format!("{x:.after$e}");
    // The exponent of the rounded number: 9.999 becomes 10.0, which has one decimal fewer.
    let exponent: i32 = scientific.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let decimals = usize::try_from(after as i32 - exponent).unwrap_or(0);
        format!("{x:.decimals$}")
    } else {
        scientific
    }
}

/// Formats a fraction in per cent with three significant digits, without the sign `%`.
pub fn percentage(fraction: f64) -> String {
    number(100.0 * fraction)
}

/// Formats a fraction in per cent with three significant digits: `1.23 %`.
pub fn percent(fraction: f64) -> String {
    if fraction.is_finite() { format!("{} %", percentage(fraction)) } else { "-".to_string() }
}

/// Formats a number as [`rounded`] does, without trailing zeros: `3`, `1.25e-9`.
pub fn trimmed(x: f64, digits: usize) -> String {
    let text = rounded(x, digits);
    let (mantissa, exponent) = text.split_at(text.find('e').unwrap_or(text.len()));
    let short = if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
    format!("{short}{exponent}")
}

/// Formats a number as [`trimmed`] does, in LaTeX: `1.25 \times 10^{-9}`.
pub fn latex_number(x: f64, digits: usize) -> String {
    let text = trimmed(x, digits);
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{mantissa} \\times 10^{{{exponent}}}"),
        None => text,
    }
}

/// Formats a name in LaTeX: Greek letters as commands, trailing digits as an index.
pub fn latex_name(name: &str) -> String {
    const GREEK: [&str; 20] = [
        "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi",
        "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
    ];
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let index = &name[stem.len()..];
    let (stem, index) =
        (stem.trim_end_matches('_'), if index.is_empty() { String::new() } else { format!("_{{{index}}}") });
    let stem = match stem {
        greek if GREEK.contains(&greek) => format!("\\{greek}"),
        letter if letter.chars().count() == 1 => letter.to_string(),
        word => format!("\\mathrm{{{}}}", word.replace('_', "\\_")),
    };
    stem + &index
}

/// Maximal number of characters in a line of texts and tables.
pub const WIDTH: usize = 120;

/// Returns the width of a text in characters.
pub fn width(text: &str) -> usize {
    text.chars().count()
}

/// Wraps a text at spaces to lines of at most `most` characters, but not between a number and its `%`; a longer word gets a line of its
/// own.
pub fn cut(text: &str, most: usize) -> Vec<String> {
    let (mut lines, mut words) = (Vec::<String>::new(), Vec::<String>::new());
    for word in text.split(' ').filter(|word| !word.is_empty()) {
        match words.last_mut().filter(|_| word.starts_with('%')) {
            Some(number) => *number += &format!(" {word}"),
            None => words.push(word.to_string()),
        }
    }
    for word in &words {
        match lines.last_mut() {
            Some(line) if width(line) + 1 + width(word) <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    if lines.is_empty() {
        lines.push(String::new());
    }
    lines
}

/// Wraps a text as [`cut`] does, but splits words that do not fit in a line.
pub fn cut_hard(text: &str, most: usize) -> Vec<String> {
    let most = most.max(1);
    let pieces = |line: String| -> Vec<String> {
        let letters: Vec<char> = line.chars().collect();
        let chunks = letters.chunks(most).map(|chunk| chunk.iter().collect());
        if letters.is_empty() { vec![String::new()] } else { chunks.collect() }
    };
    cut(text, most).into_iter().flat_map(pieces).collect()
}

/// Wraps every line longer than `most` at spaces. Continuation lines are indented to the text of that line: after its indentation and, if
/// there are two columns, after the first one.
pub fn wrap_text(text: &str, most: usize) -> String {
    let mut whole = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let (body, end) = line.strip_suffix('\n').map_or((line, ""), |body| (body, "\n"));
        if width(body) <= most {
            whole.push_str(line);
            continue;
        }
        let indent = hang(body, most);
        let head: String = body.chars().take(indent).collect();
        let rest: String = body.chars().skip(indent).collect();
        let lines = cut(&rest, most - indent);
        whole.push_str(&head);
        whole.push_str(&lines.join(&format!("\n{}", " ".repeat(indent))));
        whole.push_str(end);
    }
    whole
}

/// Returns the column at which the text of a line begins: after its indentation, or after the first of two columns separated by spaces.
fn hang(line: &str, most: usize) -> usize {
    let indent = line.chars().take_while(|c| *c == ' ').count();
    let letters: Vec<char> = line.chars().collect();
    let gap = (indent + 1..letters.len().saturating_sub(2)).find(|&k| letters[k..k + 2] == [' ', ' ']);
    let second = gap.map(|gap| gap + letters[gap..].iter().take_while(|c| **c == ' ').count());
    second.filter(|second| 2 * second <= most).unwrap_or(if 2 * indent <= most { indent } else { 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_end_with_the_number_of_the_others() {
        let items = ["a", "b", "c", "d"];
        assert_eq!(first_few(&items, 2, ", "), "a, b and 2 more");
        assert_eq!(first_few(&items, 3, "; "), "a; b; c; and 1 more");
        assert_eq!(first_few(&items, 4, ", "), "a, b, c, d");
        assert_eq!(first_few(&items[..0], 4, ", "), "");
    }

    #[test]
    fn edits_are_counted() {
        let distance = |a: &str, b: &str| edits(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>());
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("epcohs", "epochs"), 1);
        assert_eq!(distance("same", "same"), 0);
    }

    #[test]
    fn one_is_singular() {
        assert_eq!([0, 1, 2].map(|n| pluralize(n, "row", "rows")), ["0 rows", "1 row", "2 rows"]);
    }

    #[test]
    fn messages_hold_no_numbers_of_machines() {
        let full = std::io::Error::from_raw_os_error(28);
        assert!(
            full.to_string().contains("os error") && !one_line(&format!("a: {full}; b: {full}")).contains("os error")
        );
        assert_eq!(one_line("x (os error 5), y (os error five)"), "x, y (os error five)");
        let (huge, tiny) = (1e300, 1.5e-300);
        assert_eq!(one_line(&format!("found {huge}, {tiny} and -{huge}")), "found 1e300, 1.5e-300 and -1e300");
        for same in
            [&format!("at most {}", u64::MAX), "runs/20261124130000000000001/x.csv", "a-0000000000000000000000001"]
        {
            assert_eq!(one_line(same), *same);
        }
    }

    #[test]
    fn only_near_names_are_offered() {
        let names = ["double-pendulum", "triple-pendulum", "sphere-geodesic"];
        assert_eq!(nearest("duoble-pendulm", names), Some("double-pendulum"));
        assert_eq!(nearest("Sphere-Geodesic", names), Some("sphere-geodesic"));
        assert_eq!(nearest("kepler", names), None);
        assert_eq!(nearest("", names), None);
        assert_eq!([nearest("y", ["x", "t", "yy"]), nearest("m3", ["m1", "m2"]), nearest("v", ["rv"])], [None; 3]);
        assert_eq!((nearest("X", ["x"]), nearest("alhpa", ["beta", "alpha"])), (Some("x"), Some("alpha")));
        assert!(unknown("system", "kepler", names).ends_with("double-pendulum, triple-pendulum, sphere-geodesic"));
    }

    #[test]
    fn names_of_other_columns_are_found() {
        let taken = |names: &[&str]| taken_column(names).map(|(index, _)| index);
        for (names, index) in [
            (&["x", "energy"][..], Some(1)),
            (&["energy"], Some(0)),
            (&["t", "tau"], Some(1)),
            (&["tau", "t"], Some(0)),
            (&["x_dot", "x"], Some(0)),
            (&["x", "x_ddot"], Some(1)),
            (&["x", "x_force"], Some(1)),
            (&["tau", "x"], None),
            (&["t", "x"], None),
            (&["x", "y_dot", "y_force", "my_energy", "_dot"], None),
        ] {
            assert_eq!(taken(names), index, "{names:?}");
        }
    }

    #[test]
    fn numbers_have_three_digits_and_an_exponent_only_where_needed() {
        let texts = [0.0196, 1.0, -12.345, 0.000_456_7, 123.4, 13_643.2, 999.6].map(number);
        assert_eq!(texts, ["0.0196", "1.00", "-12.3", "0.000457", "123", "13643", "1000"]);
        let texts = [0.0, -0.0, 4.3e-5, -1.2345e-7, 999_999.0, 1_234_567.0, 1e300].map(number);
        assert_eq!(texts, ["0", "0", "4.30e-5", "-1.23e-7", "1.00e6", "1.23e6", "1.00e300"]);
        // Rounding may add a digit before the point.
        assert_eq!([9.999, 0.999_9, 0.000_099_99].map(number), ["10.0", "1.00", "0.000100"]);
        assert_eq!([f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(number), ["-"; 3]);
    }

    #[test]
    fn other_counts_of_digits() {
        let texts = [0.0, 1.0, -0.012_345_6, 98_765.4, 1e-9].map(|x| rounded(x, 4));
        assert_eq!(texts, ["0", "1.000", "-0.01235", "98765", "1.000e-9"]);
        assert_eq!([rounded(2.5, 1), rounded(0.36, 1), rounded(7.0, 0)], ["2", "0.4", "7"]);
    }

    #[test]
    fn fractions_are_per_cent() {
        assert_eq!([0.0123, 0.0, 1.0, f64::NAN].map(percent), ["1.23 %", "0 %", "100 %", "-"]);
        assert_eq!(percentage(4.3e-7), "4.30e-5");
    }

    #[test]
    fn lines_are_cut_at_blanks() {
        assert_eq!(cut("one two  three", 7), ["one two", "three"]);
        assert_eq!(cut("below 5 %, said", 7), ["below", "5 %,", "said"]);
        assert_eq!(cut("immeasurable x", 4), ["immeasurable", "x"]);
        assert_eq!(cut_hard("immeasurable x", 5), ["immea", "surab", "le", "x"]);
        assert_eq!((cut("", 3), cut_hard("", 3)), (vec![String::new()], vec![String::new()]));
    }

    #[test]
    fn only_long_lines_are_wrapped() {
        assert_eq!(wrap_text("short\n\n  a line of words\nend", 10), "short\n\n  a line\n  of words\nend");
        let two = "  --seed <N>  seed of the states and of the weights\n";
        assert_eq!(
            wrap_text(two, 30),
            "  --seed <N>  seed of the\n              states and of\n              the weights\n"
        );
        assert!(wrap_text(&"word ".repeat(100), WIDTH).lines().all(|line| width(line) <= WIDTH));
    }

    #[test]
    fn names_are_written_as_letters() {
        assert_eq!(latex_name("theta12"), "\\theta_{12}");
        assert_eq!((latex_name("x"), latex_name("r2")), ("x".to_string(), "r_{2}".to_string()));
        assert_eq!(latex_name("arm_angle"), "\\mathrm{arm\\_angle}");
    }

    #[test]
    fn numbers_in_latex_have_powers_of_ten() {
        let of = |x: f64| latex_number(x, 7);
        assert_eq!([of(3.0), of(-0.25), of(1200.0), of(0.0)], ["3", "-0.25", "1200", "0"]);
        assert_eq!((trimmed(1.5e-9, 7), trimmed(0.25, 1)), ("1.5e-9".to_string(), "0.2".to_string()));
        assert_eq!([of(1.5e-9), of(-2e12)], ["1.5 \\times 10^{-9}", "-2 \\times 10^{12}"]);
    }
}

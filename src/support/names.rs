//! Names and numbers in messages: the known name nearest to a mistyped one, texts on one line or in short ones, counts, digits.

mod columns;
mod number;
mod wrap;

pub use columns::taken_column;
pub use number::{number, percent, percentage, rounded};
pub use wrap::{WIDTH, cut, cut_hard, width, wrap_text};

/// The candidate that fewest edits (insert, delete, replace, swap neighbours) turn `name` into; none if every one takes more
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

/// `1 row`, `2 rows`: a count with its noun in the singular or the plural.
pub fn pluralize(count: usize, singular: &str, plural: &str) -> String {
    format!("{count} {}", if count == 1 { singular } else { plural })
}

/// `unknown WHAT "NAME"` with the nearest candidate, or all of them when none is near.
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

/// Optimal string alignment distance (Damerau 1964, Levenshtein 1966).
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
        before = std::mem::replace(&mut above, row);
    }
    above[b.len()]
}

/// Lines joined by a space, control characters written out: an error is one line whatever a file name contains. The numbers of
/// the system's errors are left out, and numbers of many digits have an exponent.
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

/// A text without the ` (os error 28)` that Rust adds to the words of the system.
fn without_error_numbers(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let first = parts.next().unwrap_or_default().to_string();
    parts.fold(first, |whole, part| match part.split_once(')') {
        Some((number, rest)) if number.parse::<i32>().is_ok() => whole + rest,
        _ => whole + " (os error " + part,
    })
}

/// Digits from which on a number is written with an exponent; the largest whole number of 64 bits has one fewer.
const MOST_DIGITS: usize = 21;

/// A text whose long decimal numbers have exponents; digits inside words and paths stay.
fn short_numbers(text: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let mut whole = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(is_part) {
        let length = rest[start..].find(|c| !is_part(c)).unwrap_or(rest.len() - start);
        let (before, number, after) = (&rest[..start], &rest[start..start + length], &rest[start + length..]);
        let inside = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || "_/\\-".contains(c));
        // A sign is no part of a word if none stands before it.
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

#[cfg(test)]
mod tests {
    use super::*;

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
}

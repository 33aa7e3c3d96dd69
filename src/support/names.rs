//! Names and numbers in messages: the known name nearest to a mistyped one, texts on one line or in short ones, counts, digits.

mod columns;
mod number;
mod wrap;

pub use columns::taken_column;
pub use number::{hundredths, number, percent, rounded};
pub use wrap::{WIDTH, cut, cut_hard, width, wrapped};

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
pub fn counted(count: usize, singular: &str, plural: &str) -> String {
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

/// Lines joined by a space, control characters written out: an error is one line whatever a file name contains.
pub fn one_line(text: &str) -> String {
    let joined = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
    joined.chars().fold(String::with_capacity(joined.len()), |mut line, c| {
        if c.is_control() {
            line.extend(c.escape_default())
        } else {
            line.push(c)
        }
        line
    })
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
        assert_eq!([0, 1, 2].map(|n| counted(n, "row", "rows")), ["0 rows", "1 row", "2 rows"]);
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

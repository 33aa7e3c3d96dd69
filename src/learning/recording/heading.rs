//! Names and units of columns as headers state them.

/// A column by its header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Heading {
    /// The unprocessed header of the file.
    pub text: String,
    /// Name of the column.
    pub name: String,
    /// Unit in brackets after the name.
    pub unit: Option<String>,
}

/// The columns of a header: `arm angle [deg]` is called `arm_angle` and is in `deg`. Columns that would share a name keep their texts.
pub(crate) fn headings(texts: &[String]) -> Vec<Heading> {
    let parts: Vec<_> = texts.iter().map(|text| parts(text)).collect();
    let mut names: Vec<&str> = parts.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    let shared = |name: &str| {
        let first = names.partition_point(|other| *other < name);
        names.get(first + 1).is_some_and(|other| *other == name)
    };
    let heading = |(text, (name, unit)): (&String, &(String, Option<&str>))| Heading {
        text: text.clone(),
        name: if shared(name) { text.clone() } else { name.clone() },
        unit: unit.map(str::to_string),
    };
    texts.iter().zip(&parts).map(heading).collect()
}

/// `true` if two texts name the same column, one of them perhaps with its unit or with blanks.
pub(crate) fn is_same(a: &str, b: &str) -> bool {
    a == b || parts(a).0 == b || a == parts(b).0
}

/// The name of a column with `_` for blanks; none if the text has a unit.
pub(crate) fn plain(text: &str) -> Option<String> {
    let (name, unit) = parts(text);
    unit.is_none().then_some(name)
}

/// Name and unit of a header: a number in brackets is an index and part of the name, `-` in brackets is no unit.
fn parts(text: &str) -> (String, Option<&str>) {
    let text = text.trim();
    let bracketed = [('[', ']'), ('(', ')')].into_iter().find_map(|(open, close)| {
        let (name, unit) = text.strip_suffix(close)?.rsplit_once(open)?;
        let plain = !unit.contains(['[', ']', '(', ')']) && unit.trim().parse::<f64>().is_err();
        (plain && !name.trim().is_empty()).then(|| (name, unit.trim()))
    });
    let (name, unit) = bracketed.unwrap_or((text, ""));
    let name = name.split_whitespace().collect::<Vec<_>>().join("_");
    (name, Some(unit).filter(|unit| !["", "-"].contains(unit)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_blanks_leave_names() {
        for (text, name, unit) in [
            ("s [cm]", "s", Some("cm")),
            (" theta(deg) ", "theta", Some("deg")),
            ("arm  angle [ m/s ]", "arm_angle", Some("m/s")),
            ("ratio [-]", "ratio", None),
            ("x []", "x", None),
            ("q[0]", "q[0]", None),
            ("[cm]", "[cm]", None),
            ("f (a (b))", "f_(a_(b))", None),
            ("angle_deg", "angle_deg", None),
        ] {
            assert_eq!(parts(text), (name.to_string(), unit), "{text}");
        }
        let names = |texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(ToString::to_string).collect();
            headings(&texts).into_iter().map(|heading| heading.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&["x [cm]", "y [cm]", "x [mm]", "a b"]), ["x [cm]", "y", "x [mm]", "a_b"]);
        assert!(is_same("s", "s [cm]") && is_same("a b", "a_b") && !is_same("x [cm]", "x [mm]"));
    }
}

//! Keys of configurations that had other names in earlier versions, which are still read.

/// A key with another name than in earlier versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Renamed {
    /// Table that it stands in, empty for none.
    pub table: &'static str,
    /// Name in earlier versions.
    pub old: &'static str,
    /// Name now.
    pub new: &'static str,
}

/// All keys that were given other names.
pub const RENAMED: [Renamed; 5] = [
    Renamed { table: "", old: "polish", new: "lbfgs" },
    Renamed { table: "data", old: "motions", new: "trajectory_fraction" },
    Renamed { table: "data", old: "off_shell", new: "rescaled_fraction" },
    Renamed { table: "data", old: "relative", new: "acceleration_weighting" },
    Renamed { table: "phase", old: "logarithmic", new: "log_uniform" },
];

/// The text of a configuration that this or an earlier version wrote, be it part of a larger text, with the names that keys have
/// now: the same configuration is the same text then.
pub fn in_current_words(text: &str) -> String {
    let mut table = String::new();
    let mut current = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        if let Some((path, rest)) = line.trim_start_matches('[').split_once(']').filter(|_| line.starts_with('[')) {
            let (before, name) = path.rsplit_once('.').map_or(("", path), |(before, name)| (before, name));
            let brackets = &line[..line.len() - path.len() - rest.len() - 1];
            let point = if before.is_empty() { "" } else { "." };
            name_now("", name).clone_into(&mut table);
            current += &format!("{brackets}{before}{point}{table}]{rest}");
            continue;
        }
        match line.split_once(" = ") {
            Some((name, value)) => current += &format!("{} = {value}", name_now(&table, name)),
            None => current += line,
        }
    }
    current
}

/// The name that a key of a table has now.
fn name_now<'a>(table: &str, name: &'a str) -> &'a str {
    let renamed = RENAMED.iter().find(|renamed| renamed.old == name && renamed.table == table);
    renamed.map_or(name, |renamed| renamed.new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_earlier_versions_become_those_of_this_one() {
        let old = "seed = 1\nmotions = 2\n\n[data]\ntraining = 5\nmotions = 0.5\noff_shell = 0.75\nrelative = 0.1\n\n\
                   [[phase]]\nepochs = 3\nlogarithmic = [true, false]\nrelative = 1\n\n[polish]\nmemory = 3\n";
        let new = "seed = 1\nmotions = 2\n\n[data]\ntraining = 5\ntrajectory_fraction = 0.5\nrescaled_fraction = 0.75\n\
                   acceleration_weighting = 0.1\n\n[[phase]]\nepochs = 3\nlog_uniform = [true, false]\nrelative = 1\n\n\
                   [lbfgs]\nmemory = 3\n";
        assert_eq!(in_current_words(old), new);
        assert_eq!(in_current_words(new), new);
        // As part of the text of a fit.
        let within = |text: &str| text.replace("[[", "[[fit.training.").replace("\n[", "\n[fit.training.");
        let within = |text: &str| within(text).replace("[fit.training.[", "[[");
        assert_eq!(in_current_words(&within(old)), within(new));
        for text in ["", "[", "[]", "[a", "a = [1]", "[polish", "x\n[polish]\r\n"] {
            let expected = text.replace("[polish]", "[lbfgs]");
            assert_eq!(in_current_words(text), expected, "{text:?}");
        }
    }
}

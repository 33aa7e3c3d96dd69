//! Mistakes in the arguments, in one line that names the option.

use crate::cli::CliError;

/// The usage error of arguments that clap refuses: its message and its hint, without the usage.
pub fn misunderstood(error: &clap::Error) -> CliError {
    let text = error.to_string();
    let mut parts = text.trim().split("\n\n");
    let problem = parts.next().unwrap_or_default().trim_start_matches("error: ").to_string();
    let hints = parts.filter_map(|part| part.trim().strip_prefix("tip: "));
    CliError::usage(hints.fold(problem, |text, hint| format!("{text}; {hint}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::Cli;
    use clap::Parser;

    #[test]
    fn options_are_named() {
        for (line, parts) in [
            ("lnn rolout", &["rolout", "rollout"][..]),
            ("lnn systems --jsn", &["--jsn", "--json"]),
            ("lnn systems more", &["more"]),
            ("lnn train x --preset qick", &["--preset", "qick", "quick"]),
            ("lnn train x --epochs -1", &["--epochs", "-1", "1 to 16777216"]),
            ("lnn train x --seed", &["--seed", "value"]),
            ("lnn evaluate m --rtol 1e-30", &["--rtol", "1e-30", "2e-15"]),
            ("lnn check data.csv", &["--coords"]),
            ("lnn experiment merge quick --seds 3", &["--seds", "--seeds"]),
            ("lnn check d --coords x --rate 5 --time t", &["--rate", "--time"]),
        ] {
            let found = misunderstood(&Cli::try_parse_from(line.split(' ')).unwrap_err()).to_string();
            assert!(!found.contains('\n') && !found.contains("Usage"), "{line}: {found}");
            assert!(parts.iter().all(|part| found.contains(part)), "{line}: {found}");
        }
    }
}

//! Text of a fit's checkpoint: the command it was started by, where, and the configuration that came of it.

use crate::cli::CliError;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The command of a fit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Said {
    /// Arguments behind `lnn fit`.
    pub arguments: Vec<String>,
    /// Directory in which it was started.
    pub directory: String,
}

/// The text of the checkpoint.
#[derive(Serialize)]
struct Text<'a, T> {
    #[serde(flatten)]
    said: &'a Said,
    fit: &'a T,
}

impl Said {
    /// A command that is started here and now.
    pub fn now(arguments: &[OsString]) -> Self {
        let here = std::env::current_dir().unwrap_or_default();
        let words = arguments.iter().map(|word| word.to_string_lossy().into_owned());
        Self { arguments: words.collect(), directory: here.to_string_lossy().into_owned() }
    }

    /// Reads the text of a checkpoint; `None` if it is not of a fit.
    pub fn parse(text: &str) -> Option<Self> {
        toml::from_str(text).ok()
    }

    /// The text of the checkpoint, with the configuration of the fit.
    ///
    /// # Errors
    /// A configuration that TOML cannot hold.
    pub fn text(&self, fit: &impl Serialize) -> Result<String, CliError> {
        toml::to_string(&Text { said: self, fit }).map_err(CliError::data)
    }

    /// A path that was given there, as seen from here; in the same directory it is what was given.
    pub fn path(&self, given: &Path) -> PathBuf {
        let there = Path::new(&self.directory);
        if std::env::current_dir().is_ok_and(|here| here == there) { given.to_path_buf() } else { there.join(given) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_comes_back() {
        #[derive(Serialize)]
        struct Fit {
            seed: u64,
        }
        let words = ["a b.csv", "--coords", "\"x\"", "--noise", "-1"].map(OsString::from);
        let said = Said::now(&words);
        let text = said.text(&Fit { seed: 5 }).unwrap();
        assert_eq!(Said::parse(&text), Some(said.clone()));
        assert!(text.contains("[fit]\nseed = 5"), "{text}");
        assert_eq!(Said::parse("seed = 5\n[network]\n"), None);
        assert_eq!(said.path(Path::new("/x/y")), Path::new("/x/y"));
        assert_eq!(said.path(Path::new("y")), Path::new("y"));
        let elsewhere = Said { directory: "/elsewhere".to_string(), ..said };
        assert_eq!(elsewhere.path(Path::new("y")), Path::new("/elsewhere/y"));
    }
}

//! Names of directories and of systems.

use crate::thresholds::LONGEST_NAME;

/// A plain name: letters, digits, `-`, `_`, `.` and spaces within, the first a letter or digit. Names that lead elsewhere as part of a path
/// are rejected.
///
/// # Errors
/// A description of plain names.
pub fn plain_name(text: &str) -> Result<String, String> {
    let known = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
    let begins = text.starts_with(char::is_alphanumeric) && !text.ends_with([' ', '.']);
    if begins && text.len() <= LONGEST_NAME && text.chars().all(known) {
        Ok(text.to_string())
    } else {
        Err("expected a plain name: letters, digits, - _ . and spaces within, a letter or digit first".to_string())
    }
}

/// The name of a system in its file: 1 to 64 letters, digits, `-` and `_`.
///
/// # Errors
/// A description of such names.
pub fn system_name(text: &str) -> Result<String, String> {
    let known = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if !text.is_empty() && text.len() <= 64 && text.chars().all(known) {
        Ok(text.to_string())
    } else {
        Err("expected 1 to 64 letters, digits, - and _".to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lnn::lagrangian::System;

    #[test]
    fn plain_names_stay_where_they_are_put() {
        for good in ["measured", "Arm 2", "x", "m_1-b.3", "Pendel-gedämpft"] {
            assert_eq!(plain_name(good).as_deref(), Ok(good));
        }
        let long = "x".repeat(LONGEST_NAME + 1);
        for bad in ["", " ", ".", "..", "../evil", "a/b", "/tmp/x", "a\\b", ".hidden", "-x", "a\nb", "a.", "c:", &long]
        {
            assert!(plain_name(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn systems_have_plain_names() {
        assert!(
            System::unconstrained().len() > 10
                && System::unconstrained().iter().all(|system| plain_name(&system.name).is_ok())
        );
    }
}

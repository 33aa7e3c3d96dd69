//! Placeholder until the rates of this part are measured.

use super::{Outcome, Rate};

/// Rates of `seeds` systems a case.
pub fn rates(_seeds: u64) -> Outcome<Vec<Rate>> {
    Ok(Vec::new())
}

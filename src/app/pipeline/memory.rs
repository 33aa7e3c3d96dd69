//! Rejects work that does not fit into memory before it begins.

use crate::pipeline::PipelineError;
use crate::storage::available_memory;

/// Rejects work that needs more memory than is available. If the available memory is unknown, only work whose memory cannot be counted is
/// rejected.
///
/// # Errors
/// [`PipelineError::Memory`] with both figures.
pub fn require(work: &str, needed: Option<u64>) -> Result<(), PipelineError> {
    check(work, needed, available_memory())
}

fn check(work: &str, needed: Option<u64>, available: Option<u64>) -> Result<(), PipelineError> {
    let refuse = |needed: Option<u64>, available: u64| {
        let (work, needed, available) = (work.to_string(), needed.map(size), size(available));
        Err(PipelineError::Memory { work, needed, available })
    };
    match (needed, available) {
        (None, available) => refuse(None, available.unwrap_or(0)),
        (Some(needed), Some(available)) if needed > available => refuse(Some(needed), available),
        _ => Ok(()),
    }
}

/// Formats a size such as `1.5 GB`, with powers of ten.
fn size(bytes: u64) -> String {
    let units = ["kB", "MB", "GB", "TB", "PB", "EB"];
    let mut value = bytes as f64 / 1e3;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < units.len() {
        (value, unit) = (value / 1e3, unit + 1);
    }
    format!("{value:.1} {}", units[unit])
}

/// Counts the bytes of `motions` sampled motions of `n` coordinates with `samples` samples each: `2 n + 2` numbers per sample in three
/// copies (computed, stored and evaluated), in vectors whose capacity may be twice their length, and `text` bytes of text.
pub(crate) fn motions(motions: u64, samples: f64, n: usize, text: u64) -> Option<u64> {
    let numbers = (n as u64).checked_add(1)?.checked_mul(2)?;
    // A quotient beyond 64 bits saturates, and the sums below detect the overflow.
    let samples = (samples.abs().ceil() as u64).checked_add(1)?;
    numbers.checked_mul(48 + text)?.checked_mul(samples)?.checked_mul(motions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_both_figures() {
        assert!(check("training", Some(1000), Some(1000)).is_ok());
        assert!(check("training", Some(u64::MAX), None).is_ok());
        let refusal = check("training", Some(2_340_000_000), Some(999_000)).unwrap_err().to_string();
        assert_eq!(refusal, "training takes about 2.3 GB of memory, 999.0 kB are available");
        assert!(check("training", None, None).is_err());
        assert_eq!(size(u64::MAX), "18.4 EB");
    }

    #[test]
    fn motions_are_counted() {
        assert_eq!(motions(1, 99.0, 1, 0), Some(4 * 48 * 100));
        assert_eq!(motions(u64::MAX, 10.0, 2, 50), None);
        assert_eq!(motions(1, f64::INFINITY, 2, 50), None);
    }
}

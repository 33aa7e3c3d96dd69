//! Memory that the machine has left.

/// Bytes that can be taken without the machine beginning to swap, where the system tells (`MemAvailable` of Linux).
pub fn available_memory() -> Option<u64> {
    parse(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

/// The line `MemAvailable:   12345 kB`.
fn parse(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::{available_memory, parse};

    #[test]
    fn the_line_is_found_and_read() {
        assert_eq!(parse("MemTotal:  9 kB\nMemAvailable:    2 kB\n"), Some(2048));
        assert_eq!(parse("MemTotal: 9 kB\n"), None);
        assert_eq!(parse("MemAvailable: many kB\n"), None);
        assert_eq!(available_memory().is_some(), std::path::Path::new("/proc/meminfo").exists());
    }
}

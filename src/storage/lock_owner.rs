//! Who holds a directory: process, machine and time, as lock files and claims say them.

use std::fmt;
use std::time::{SystemTime, UNIX_EPOCH};

/// A process that writes into a directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LockOwner {
    process: u32,
    host: String,
    /// Seconds since 1970, UTC.
    since: u64,
}

impl LockOwner {
    /// This process, from now on.
    pub fn this() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
        Self { process: std::process::id(), host: host(), since }
    }

    /// Number of the process.
    pub fn process(&self) -> u32 {
        self.process
    }

    /// Name of its machine.
    pub fn host(&self) -> &str {
        &self.host
    }

    /// Beginning, in seconds since 1970, UTC.
    pub fn since(&self) -> u64 {
        self.since
    }

    /// The text of the lock file.
    pub fn text(&self) -> String {
        format!("process {}\nhost {}\nsince {}\n", self.process, self.host, self.since)
    }

    /// Reads the text of a lock file.
    pub fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let mut value = |key: &str| lines.next()?.strip_prefix(key)?.strip_prefix(' ');
        let (process, host, since) = (value("process")?, value("host")?, value("since")?);
        Some(Self { process: process.parse().ok()?, host: host.to_string(), since: since.parse().ok()? })
    }
}

impl fmt::Display for LockOwner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { process, host, since } = self;
        write!(f, "process {process} on {host} since {}", utc(*since))
    }
}

/// Mark of this machine since it was started, which its processes have in common; `None` where the system does not tell.
pub fn machine() -> Option<String> {
    let text = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    Some(text.trim().to_string()).filter(|id| !id.is_empty() && id.len() <= 64)
}

/// Name of this machine.
fn host() -> String {
    let kernel = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let variable = || ["HOSTNAME", "COMPUTERNAME"].iter().find_map(|name| std::env::var(name).ok());
    let name = kernel.or_else(variable).unwrap_or_default();
    let name: String = name.trim().chars().filter(|c| !c.is_control()).take(64).collect();
    if name.is_empty() { "a machine without a name".to_string() } else { name }
}

/// Date and time of the Gregorian calendar; `days` are counted in eras of 400 years that begin in March.
fn utc(seconds: u64) -> String {
    let (days, time) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = 400 * era + year + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC", time / 3600, time / 60 % 60, time % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calendar_is_right() {
        for (seconds, text) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (1_709_251_199, "2024-02-29 23:59:59 UTC"),
            (1_735_689_599, "2024-12-31 23:59:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
        ] {
            assert_eq!(utc(seconds), text);
        }
    }

    #[test]
    fn the_text_comes_back() {
        let holder = LockOwner::this();
        assert_eq!(LockOwner::parse(&holder.text()), Some(holder));
        for bad in ["", "process x\nhost a\nsince 1\n", "process 1\nsince 1\n", "process 1\nhost a\nsince -1\n"] {
            assert_eq!(LockOwner::parse(bad), None, "{bad}");
        }
    }
}

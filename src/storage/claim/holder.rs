//! Holders of claims, as their claims tell.

use crate::storage::lock_owner::LockOwner;
use std::fmt;
use std::time::Duration;

/// State of a claim that its claimant has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Held,
    Released,
}

impl State {
    /// Its word, as long as any other.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Held => "held    ",
            Self::Released => "released",
        }
    }
}

/// The claimant of a directory.
#[derive(Clone, Debug, PartialEq)]
pub struct Holder {
    /// Its process.
    pub owner: LockOwner,
    /// Mark that processes of its machine have in common, if that is known.
    pub(super) machine: Option<String>,
    /// Silence after which its claim may be taken over.
    pub lease: Duration,
    /// Time since its last heartbeat.
    pub silent: Duration,
}

impl Holder {
    /// Reads a claim; how long it has been silent its text does not tell.
    pub(super) fn parse(text: &str) -> Option<(Self, State)> {
        let owner = LockOwner::parse(text)?;
        let mut lines = text.lines().skip(3);
        let mut value = |key: &str| lines.next()?.strip_prefix(key)?.strip_prefix(' ').map(str::to_string);
        let (machine, _, lease, _) = (value("machine")?, value("serial")?, value("lease")?, value("beats")?);
        let lease = Duration::try_from_secs_f64(lease.parse().ok()?).ok()?;
        let word = lines.next()?;
        let state = [State::Held, State::Released].into_iter().find(|state| state.word() == word)?;
        let machine = Some(machine).filter(|machine| !machine.is_empty());
        Some((Self { owner, machine, lease, silent: Duration::ZERO }, state))
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (silent, lease) = (self.silent.as_secs_f64(), self.lease.as_secs_f64());
        write!(f, "{}, last heard of {silent:.0} s ago, lease {lease} s", self.owner)
    }
}

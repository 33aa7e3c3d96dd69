//! Cancellation of long searches with a flag, and reports of their progress.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Shortest time between two reports, which is often enough to show progress.
const EVERY: Duration = Duration::from_millis(200);

/// The progress of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SearchProgress {
    /// The current stage, such as `short segments`.
    pub stage: &'static str,
    /// Number of iterations in this stage.
    pub iteration: usize,
    /// Root mean square residual in units of noise, once it is known.
    pub residual: Option<f64>,
    /// Number of finished pieces of work, such as batches of segments.
    pub pieces: u64,
}

impl fmt::Display for SearchProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.stage)?;
        if self.iteration > 0 {
            write!(f, ", iteration {}", self.iteration)?;
        }
        self.residual.map_or(Ok(()), |residual| write!(f, ", residual {residual:.3} of the noise"))?;
        if self.pieces > 0 { write!(f, ", batch {}", self.pieces) } else { Ok(()) }
    }
}

/// The error of a search that the flag has ended, so that there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cancelled;

impl fmt::Display for Cancelled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("interrupted")
    }
}

impl std::error::Error for Cancelled {}

struct Reports {
    to: Box<dyn Fn(SearchProgress) + Send + Sync>,
    now: Mutex<(SearchProgress, Option<Instant>)>,
}

/// The flag that ends a search and the receiver of its reports; clones share both. The default one never ends a search.
///
/// ```
/// use lnn::cancellation::Cancellation;
///
/// let cancellation = Cancellation::default();
/// assert!(cancellation.go_on());
/// cancellation.cancel();
/// assert!(!cancellation.go_on() && cancellation.check().is_err());
/// ```
#[derive(Clone, Default)]
pub struct Cancellation {
    flag: Arc<AtomicBool>,
    reports: Option<Arc<Reports>>,
}

impl Cancellation {
    /// Creates a cancellation with a given flag.
    pub fn by(flag: &Arc<AtomicBool>) -> Self {
        Self { flag: Arc::clone(flag), reports: None }
    }

    /// Adds a receiver of reports, which is called from several threads at most five times a second.
    #[must_use]
    pub fn reporting(self, to: impl Fn(SearchProgress) + Send + Sync + 'static) -> Self {
        let reports = Reports { to: Box::new(to), now: Mutex::default() };
        Self { reports: Some(Arc::new(reports)), ..self }
    }

    /// Returns a separate cancellation that is raised with this one, or after a time limit. The search notices the limit when it reports.
    #[must_use]
    pub fn within(&self, limit: Duration) -> Self {
        let (outer, inner, started) = (self.clone(), Self::default(), Instant::now());
        let flag = Arc::clone(&inner.flag);
        inner.reporting(move |progress| {
            if outer.is_cancelled() || started.elapsed() > limit {
                flag.store(true, Ordering::SeqCst);
            }
            outer.report(|now| *now = progress);
        })
    }

    /// Returns the flag.
    pub fn flag(&self) -> &AtomicBool {
        &self.flag
    }

    /// Raises the flag.
    pub fn cancel(&self) {
        self.flag.store(true, Ordering::SeqCst);
    }

    /// Returns `true` once the flag is raised.
    pub fn is_cancelled(&self) -> bool {
        self.flag.load(Ordering::SeqCst)
    }

    /// Fails once the flag is raised.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    /// Reports the start of a stage of the search.
    pub fn stage(&self, stage: &'static str) {
        self.report(|now| *now = SearchProgress { stage, pieces: now.pieces, ..SearchProgress::default() });
    }

    /// Reports the start of an iteration, with the residual in units of noise; returns `false` once the flag is raised, and the loop must
    /// end.
    pub fn iterate(&self, residual: f64) -> bool {
        self.report(|now| (now.iteration, now.residual) = (now.iteration + 1, Some(residual)));
        !self.is_cancelled()
    }

    /// Reports the start of a piece of work; returns `false` once the flag is raised, and the loop must end.
    pub fn go_on(&self) -> bool {
        self.report(|now| now.pieces += 1);
        !self.is_cancelled()
    }

    fn report(&self, change: impl FnOnce(&mut SearchProgress)) {
        let Some(reports) = &self.reports else { return };
        let mut now = reports.now.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut now.0);
        if now.1.is_none_or(|last| last.elapsed() >= EVERY) {
            now.1 = Some(Instant::now());
            (reports.to)(now.0);
        }
    }
}

/// The comparison of settings ignores cancellations: all of them are equal.
impl PartialEq for Cancellation {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Cancellation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cancellation").field("flag", &self.flag).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_reports_at_once_and_then_now_and_then() {
        let seen: Arc<Mutex<Vec<SearchProgress>>> = Arc::default();
        let to = Arc::clone(&seen);
        let cancellation = Cancellation::default().reporting(move |progress| to.lock().unwrap().push(progress));
        cancellation.stage("first");
        (0..1000).for_each(|_| assert!(cancellation.clone().go_on()));
        std::thread::sleep(EVERY);
        assert!(cancellation.iterate(1.5));
        let seen = seen.lock().unwrap();
        assert!((2..20).contains(&seen.len()), "{seen:?}");
        let last = SearchProgress { stage: "first", iteration: 1, residual: Some(1.5), pieces: 1000 };
        assert_eq!((seen[0].stage, seen[seen.len() - 1]), ("first", last));
    }

    #[test]
    fn a_limit_of_time_ends_the_inner_search_alone() {
        let outer = Cancellation::default();
        let (long, short) = (outer.within(Duration::from_secs(3600)), outer.within(Duration::ZERO));
        let ends = |search: &Cancellation| {
            (0..100).any(|_| {
                std::thread::sleep(EVERY / 4);
                !search.go_on()
            })
        };
        assert!(ends(&short) && !outer.is_cancelled() && !long.is_cancelled());
        outer.cancel();
        assert!(ends(&long));
    }
}

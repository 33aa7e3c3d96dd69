//! Runs of an experiment that wait to be worked on, shared by the threads of a process, and the results of the others.

use crate::experiments::Record;
use crate::pipeline::{PipelineError, Watch};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time between two looks at a run that another process works on.
const LOOK: Duration = Duration::from_millis(500);
/// Time between two looks at the flag that ends the waiting.
const TICK: Duration = Duration::from_millis(20);

/// Result of a run.
type Found = Result<Record, PipelineError>;

/// Runs by their indices.
pub(crate) struct Queue {
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// Runs, each with the time before which it is not tried again.
    waiting: VecDeque<(usize, Option<Instant>)>,
    /// Times that another process was seen to work on a run.
    seen: BTreeMap<usize, u64>,
    results: BTreeMap<usize, Found>,
}

impl Queue {
    /// So many runs, none of them tried.
    pub fn new(total: usize) -> Self {
        let waiting = (0..total).map(|index| (index, None)).collect();
        Self { state: Mutex::new(State { waiting, ..State::default() }) }
    }

    /// The run to try next, when its time has come; `None` if none is left for this thread, or the flag of the watch was raised.
    pub fn next(&self, watch: &Watch) -> Option<usize> {
        let (index, due) = self.state().waiting.pop_front()?;
        while due.is_some_and(|due| Instant::now() < due) && !watch.is_interrupted() {
            std::thread::sleep(TICK);
        }
        (!watch.is_interrupted()).then_some(index)
    }

    /// Puts a run back that another process works on; `true` the second time: the run is now waited for.
    pub fn put_back(&self, index: usize) -> bool {
        let mut state = self.state();
        state.waiting.push_back((index, Some(Instant::now() + LOOK)));
        let seen = state.seen.entry(index).or_default();
        *seen += 1;
        *seen == 2
    }

    /// Keeps the result of a run and returns how many are kept; after a failure no run is begun any more.
    pub fn finish(&self, index: usize, result: Found) -> usize {
        let mut state = self.state();
        if result.is_err() {
            state.waiting.clear();
        }
        state.results.insert(index, result);
        state.results.len()
    }

    /// The results by the indices of their runs.
    pub fn into_results(self) -> BTreeMap<usize, Found> {
        self.state.into_inner().unwrap_or_else(PoisonError::into_inner).results
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::Outcome;
    use std::sync::atomic::Ordering;

    #[test]
    fn runs_come_in_order_and_those_of_others_again() {
        let (queue, watch) = (Queue::new(3), Watch::default());
        assert_eq!(queue.next(&watch), Some(0));
        assert!(!queue.put_back(0));
        assert_eq!((queue.next(&watch), queue.next(&watch)), (Some(1), Some(2)));
        let began = Instant::now();
        assert_eq!(queue.next(&watch), Some(0));
        assert!(began.elapsed() >= LOOK / 2 && queue.put_back(0) && !queue.put_back(0));
        watch.interrupt.store(true, Ordering::SeqCst);
        assert_eq!(queue.next(&watch), None);
    }

    #[test]
    fn after_a_failure_none_is_begun() {
        let (queue, watch) = (Queue::new(3), Watch::default());
        let outcome = Outcome::Nothing { reason: String::new() };
        let record = Record { outcome, losses: Vec::new(), times: Vec::new(), seconds: 0.0 };
        assert_eq!((queue.next(&watch), queue.finish(0, Ok(record))), (Some(0), 1));
        assert_eq!(queue.finish(1, Err(PipelineError::NoAccelerations)), 2);
        assert_eq!(queue.next(&watch), None);
        let results = queue.into_results();
        assert!(results[&0].is_ok() && results[&1].is_err() && results.len() == 2);
    }
}

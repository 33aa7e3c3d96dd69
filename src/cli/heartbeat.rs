//! Heartbeats of a claim while its run goes on, and the flag that ends the run when the claim is lost.

use crate::storage::{Claim, Claimant};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest time until the flag of a run follows that of the program.
const TICK: Duration = Duration::from_millis(50);

/// A thread that renews a claim until it is stopped.
#[derive(Debug)]
pub struct Heartbeat {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    /// `true` when no more heartbeats are wanted.
    stopped: Mutex<bool>,
    wake: Condvar,
    /// Ends the run.
    flag: Arc<AtomicBool>,
    lost: AtomicBool,
}

impl Heartbeat {
    /// Heartbeats of a claim, until it is lost or they are stopped; `interrupt` is the flag that ends all runs.
    ///
    /// # Errors
    /// The system's, if it has no thread left.
    pub fn start(claim: Arc<Claim>, claimant: &Claimant, interrupt: &Arc<AtomicBool>) -> io::Result<Self> {
        let flag = Arc::new(AtomicBool::new(interrupt.load(Ordering::SeqCst)));
        let shared =
            Arc::new(Shared { stopped: Mutex::new(false), wake: Condvar::new(), flag, lost: AtomicBool::new(false) });
        let (inside, interrupt, claimant) = (Arc::clone(&shared), Arc::clone(interrupt), claimant.clone());
        let thread = std::thread::Builder::new().name("heartbeat".to_string());
        let thread = thread.spawn(move || beat(&inside, &claim, &claimant, &interrupt))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Flag that ends the run: raised with that of all runs, and when the claim is lost.
    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.shared.flag)
    }

    /// `true` if the claim was found to be lost.
    pub fn is_lost(&self) -> bool {
        self.shared.lost.load(Ordering::SeqCst)
    }

    /// No more heartbeats but for one under way.
    pub fn stop(&self) {
        *self.shared.stopped.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.shared.wake.notify_all();
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            // A thread that failed beats no more.
            let _ = thread.join();
        }
    }
}

fn beat(shared: &Shared, claim: &Claim, claimant: &Claimant, interrupt: &AtomicBool) {
    let (beat, lease) = (claimant.beat(), claimant.lease());
    let (mut tried, mut succeeded) = (Instant::now(), Instant::now());
    let mut stopped = shared.stopped.lock().unwrap_or_else(PoisonError::into_inner);
    while !*stopped {
        stopped = shared.wake.wait_timeout(stopped, TICK.min(beat)).unwrap_or_else(PoisonError::into_inner).0;
        if *stopped {
            break;
        }
        if interrupt.load(Ordering::SeqCst) {
            shared.flag.store(true, Ordering::SeqCst);
        }
        if tried.elapsed() < beat || shared.lost.load(Ordering::SeqCst) {
            continue;
        }
        tried = Instant::now();
        let lost = match claim.renew() {
            Ok(true) => {
                succeeded = tried;
                false
            }
            Ok(false) => true,
            // Others may soon take it for dead.
            Err(_) => succeeded.elapsed() + 2 * beat > lease,
        };
        if lost {
            shared.lost.store(true, Ordering::SeqCst);
            shared.flag.store(true, Ordering::SeqCst);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::Taken;

    fn wait_for(condition: impl Fn() -> bool) {
        let began = Instant::now();
        while !condition() {
            assert!(began.elapsed() < Duration::from_secs(30), "nothing happened");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn a_claim_is_renewed_until_it_is_lost() {
        let directory = tempfile::tempdir().unwrap();
        let claimant = Claimant::this(Duration::from_millis(60));
        let Taken::Ours(claim, None) = claimant.take(directory.path(), true).unwrap() else { panic!("not ours") };
        let file = directory.path().join(".lnn.claim.1");
        let text = || std::fs::read_to_string(&file).unwrap();
        let (before, interrupt) = (text(), Arc::new(AtomicBool::new(false)));
        let heart = Heartbeat::start(Arc::new(claim), &claimant, &interrupt).unwrap();
        wait_for(|| text() != before && !text().is_empty());
        assert!(!heart.is_lost() && !heart.flag().load(Ordering::SeqCst));
        interrupt.store(true, Ordering::SeqCst);
        wait_for(|| heart.flag().load(Ordering::SeqCst));
        assert!(!heart.is_lost());
        // Another claimant, which took it for dead.
        std::fs::write(directory.path().join(".lnn.claim.2"), "").unwrap();
        wait_for(|| heart.is_lost());
        drop(heart);
        let last = text();
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(text(), last);
    }

    #[test]
    fn a_lost_claim_ends_its_run() {
        let directory = tempfile::tempdir().unwrap();
        let claimant = Claimant::this(Duration::from_millis(60));
        let Taken::Ours(claim, None) = claimant.take(directory.path(), true).unwrap() else { panic!("not ours") };
        let heart = Heartbeat::start(Arc::new(claim), &claimant, &Arc::default()).unwrap();
        std::fs::remove_file(directory.path().join(".lnn.claim.1")).unwrap();
        wait_for(|| heart.flag().load(Ordering::SeqCst));
        assert!(heart.is_lost() && std::fs::read_dir(directory.path()).unwrap().count() == 0);
    }
}

//! Available memory of the machine, and threads: as many as requested, or as many as the system can start.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, scope};

/// Returns how many bytes can be allocated before the machine starts to swap, if the system reports it (`MemAvailable` on Linux).
pub fn available_memory() -> Option<u64> {
    parse(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

/// Parses the line `MemAvailable:   12345 kB`.
fn parse(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Largest number of threads: more bring no gain on any machine, and thousands overload it.
pub const MOST_THREADS: usize = 256;

/// Runs `work` on several threads at a time, including this one; on fewer if the system cannot start more.
fn abreast(threads: usize, work: impl Fn() + Sync) {
    scope(|scope| {
        for _ in 1..threads.min(MOST_THREADS) {
            if Builder::new().spawn_scoped(scope, &work).is_err() {
                break;
            }
        }
        work();
    });
}

/// Applies `work` to every item on this many threads; the results keep the order of the items.
pub fn in_order<T: Sync, R: Send>(items: &[T], threads: usize, work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(items.len()));
    abreast(threads.min(items.len()), || {
        while let Some((k, item)) = {
            let k = next.fetch_add(1, Ordering::Relaxed);
            items.get(k).map(|item| (k, item))
        } {
            let result = work(item);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((k, result));
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::thread::current;
    use std::time::Duration;

    #[test]
    fn the_line_is_found_and_read() {
        assert_eq!(parse("MemTotal:  9 kB\nMemAvailable:    2 kB\n"), Some(2048));
        assert_eq!(parse("MemTotal: 9 kB\n"), None);
        assert_eq!(parse("MemAvailable: many kB\n"), None);
        assert_eq!(available_memory().is_some(), std::path::Path::new("/proc/meminfo").exists());
    }

    #[test]
    fn results_are_in_order_on_no_more_threads_than_asked_for() {
        let items: Vec<usize> = (0..40).collect();
        for threads in [0, 1, 3, usize::MAX] {
            let seen = Mutex::new(BTreeSet::new());
            let squares = in_order(&items, threads, |k| {
                seen.lock().unwrap().insert(format!("{:?}", current().id()));
                std::thread::sleep(Duration::from_micros(200));
                k * k
            });
            assert_eq!(squares, items.iter().map(|k| k * k).collect::<Vec<_>>());
            let seen = seen.into_inner().unwrap().len();
            assert!((1..=threads.clamp(1, items.len())).contains(&seen), "{threads}: {seen}");
        }
        assert!(in_order(&[], 4, |x: &u8| *x).is_empty());
    }
}

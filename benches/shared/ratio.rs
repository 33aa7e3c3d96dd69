//! Two ways to the same numbers, timed in turns, with the ratio that is asked for.

#[path = "turns.rs"]
mod turns;

use std::time::Duration;
use turns::{Work, in_turns};

/// Rounds of a comparison.
const ROUNDS: usize = 201;
/// Time of one turn.
const TURN: Duration = Duration::from_micros(100);

/// Prints nanoseconds per element (medians) of both and how many times as long `slow` takes; `target` is what the
/// ratio should be.
pub fn compare(name: &str, elements: usize, target: &str, fast: impl FnMut(), slow: impl FnMut()) {
    let mut work = [Work::new("fast", fast), Work::new("slow", slow)];
    in_turns(&mut work, ROUNDS, TURN);
    let [fast, slow] = [&work[0], &work[1]].map(|w| w.median() * 1e9 / elements as f64);
    println!("{name}: {fast:.2} ns against {slow:.2} ns, ratio {:.2} (target {target})", work[1].times_of(&work[0]));
}

//! Two ways to the same numbers, timed in turn, so that the load of the machine falls on both alike.

use std::time::Instant;

/// Rounds of a comparison.
const ROUNDS: usize = 201;
/// Least time of one measurement in nanoseconds.
const SPAN: f64 = 1e5;

/// Prints nanoseconds per element (medians) of both and how many times as long `slow` takes; `target` is what the
/// ratio should be.
pub fn compare(name: &str, elements: usize, target: &str, mut fast: impl FnMut(), mut slow: impl FnMut()) {
    let (fast, slow) = medians(&mut fast, &mut slow);
    let per = elements as f64;
    println!("{name}: {:.2} ns against {:.2} ns, ratio {:.2} (target {target})", fast / per, slow / per, slow / fast);
}

fn medians(fast: &mut dyn FnMut(), slow: &mut dyn FnMut()) -> (f64, f64) {
    let calls = [repeats(fast), repeats(slow)];
    let mut times = [Vec::with_capacity(ROUNDS), Vec::with_capacity(ROUNDS)];
    for _ in 0..ROUNDS {
        times[0].push(measure(fast, calls[0]));
        times[1].push(measure(slow, calls[1]));
    }
    let [fast, slow] = times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    });
    (fast, slow)
}

/// Calls that fill a measurement.
fn repeats(f: &mut dyn FnMut()) -> u32 {
    measure(f, 3);
    (SPAN / measure(f, 3).max(1.0)).ceil() as u32
}

/// Nanoseconds of a call.
fn measure(f: &mut dyn FnMut(), calls: u32) -> f64 {
    let start = Instant::now();
    (0..calls).for_each(|_| f());
    start.elapsed().as_nanos() as f64 / f64::from(calls)
}

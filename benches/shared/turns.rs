//! Times of several pieces of work taken in turns, so that a busy machine slows all of them alike.
#![allow(dead_code, reason = "each benchmark uses its part")]

use std::time::{Duration, Instant};

/// A piece of work with its name.
pub struct Work<'a> {
    pub name: String,
    run: Box<dyn FnMut() + 'a>,
    /// Runs in a turn.
    repeats: usize,
    /// Seconds of a run, one number per round.
    pub times: Vec<f64>,
}

impl<'a> Work<'a> {
    pub fn new(name: impl Into<String>, run: impl FnMut() + 'a) -> Self {
        Self { name: name.into(), run: Box::new(run), repeats: 1, times: Vec::new() }
    }

    fn turn(&mut self) -> f64 {
        let start = Instant::now();
        for _ in 0..self.repeats {
            (self.run)();
        }
        start.elapsed().as_secs_f64() / self.repeats as f64
    }

    /// Median time of a run in seconds.
    pub fn median(&self) -> f64 {
        median(self.times.clone())
    }

    /// Median of the ratios to another piece of work, each within one round.
    pub fn times_of(&self, other: &Self) -> f64 {
        median(self.times.iter().zip(&other.times).map(|(a, b)| a / b).collect())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Runs everything in turns of about so long.
pub fn in_turns(work: &mut [Work<'_>], rounds: usize, turn: Duration) {
    for w in &mut *work {
        w.turn();
        let once = w.turn().max(1e-9);
        w.repeats = ((turn.as_secs_f64() / once) as usize).clamp(1, 1_000_000);
    }
    for _ in 0..rounds {
        for w in &mut *work {
            let time = w.turn();
            w.times.push(time);
        }
    }
}

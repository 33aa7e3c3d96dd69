//! Wall time of repeated work.

use std::time::Instant;

/// How to measure.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    /// Repeats wanted.
    pub repeats: usize,
    /// Shortest measured stretch in seconds: quicker work is run several times in each repeat.
    pub shortest: f64,
    /// Seconds after which repeats end early.
    pub longest: f64,
}

/// Seconds of one run of the work.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    pub min: f64,
    /// Lower quartile.
    pub lower: f64,
    pub median: f64,
    /// Upper quartile.
    pub upper: f64,
    pub repeats: usize,
}

impl Timing {
    /// Header of [`Timing::cells`] for a unit such as `ns_per_state`.
    pub const HEADER: [&'static str; 5] = ["min", "lower_quartile", "median", "upper_quartile", "repeats"];

    /// The times multiplied by `factor`, and the number of repeats.
    pub fn cells(&self, factor: f64) -> [String; 5] {
        let [min, lower, median, upper] =
            [self.min, self.lower, self.median, self.upper].map(|seconds| format!("{:.4e}", seconds * factor));
        [min, lower, median, upper, self.repeats.to_string()]
    }
}

impl Stopwatch {
    /// Times `work` after one run that does not count, unless that alone takes a third of the time there is.
    pub fn measure(&self, mut work: impl FnMut()) -> Timing {
        let mut once = |times: usize| {
            let begun = Instant::now();
            (0..times).for_each(|_| work());
            begun.elapsed().as_secs_f64() / times as f64
        };
        let first = once(1);
        if first > self.longest / 3.0 {
            return Timing { min: first, lower: first, median: first, upper: first, repeats: 1 };
        }
        // A first run is slow: look again before deciding how often.
        let single = if first < self.shortest { first.min(once(3)) } else { first };
        let times = (self.shortest / single.max(1e-9)).ceil().max(1.0) as usize;
        let affordable = (self.longest / (single * times as f64)) as usize;
        let mut seconds: Vec<f64> = (0..self.repeats.min(affordable.max(1))).map(|_| once(times)).collect();
        seconds.sort_by(f64::total_cmp);
        let at = |fraction: f64| {
            let place = fraction * (seconds.len() - 1) as f64;
            let (below, above) = (seconds[place.floor() as usize], seconds[place.ceil() as usize]);
            below + (above - below) * place.fract()
        };
        Timing { min: at(0.0), lower: at(0.25), median: at(0.5), upper: at(0.75), repeats: seconds.len() }
    }
}

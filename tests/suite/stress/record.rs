//! Rows of the printed table.

use lnn::scalar::Scalar;

/// Rounding stays below this, algorithms that lose accuracy do not.
pub const LIMIT: f64 = 30.0;

/// The largest R of a case and where it was found.
pub struct Row {
    case: u32,
    name: &'static str,
    precision: &'static str,
    worst: f64,
    place: String,
}

impl Row {
    /// Nothing seen yet.
    pub fn new<S: Scalar>(case: u32, name: &'static str) -> Self {
        Self { case, name, precision: S::NAME, worst: 0.0, place: String::from("everywhere") }
    }

    /// Takes an R into account; `NaN` is the worst of all.
    pub fn see(&mut self, r: f64, place: impl FnOnce() -> String) {
        let r = if r.is_nan() { f64::INFINITY } else { r };
        if r > self.worst {
            (self.worst, self.place) = (r, place());
        }
    }

    /// Prints the row and demands `R < LIMIT`.
    pub fn end(self) {
        self.end_below(LIMIT);
    }

    /// Prints the row and demands `R` not above the case's own limit.
    pub fn end_below(self, limit: f64) {
        let Self { case, name, precision, worst, place } = self;
        println!("{case:>4} | {name} | {precision} | {worst:.2e} | {place}");
        assert!(worst <= limit, "case {case}, {name}, {precision}: R = {worst} at {place}, limit {limit}");
    }
}

/// Prints the row of a property that holds exactly, asserted where it was checked.
pub fn exact<S: Scalar>(case: u32, name: &str, checks: usize) {
    assert!(checks > 0, "case {case}, {name}: nothing checked");
    println!("{case:>4} | {name} | {} | exact | {checks} checks", S::NAME);
}

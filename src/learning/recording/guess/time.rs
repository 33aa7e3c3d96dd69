//! Finds the column of time and the rows at which it restarts.

use super::names::{is_index, is_time, unit_of_time};
use super::thresholds::{EVEN_STEP, ROWS_PER_RESTART, STEPS_PER_UNEVEN_ONE, SUSPICIOUS_STEP};
use crate::names::number;
use crate::recording::statistics::median;

/// A column that can be the time.
#[derive(Clone, Debug, PartialEq)]
pub struct Time {
    /// Its place in the file.
    pub column: usize,
    /// Its unit, if it is not the second.
    pub unit: Option<&'static str>,
    /// Rows at which it restarts, from 0.
    pub restarts: Vec<usize>,
    /// The reason.
    pub because: String,
}

/// Rows at which a column decreases; none if it decreases or repeats a value too often for a time.
pub fn restarts(values: &[f64]) -> Option<Vec<usize>> {
    let falls: Vec<usize> = (1..values.len()).filter(|&k| values[k] < values[k - 1]).collect();
    let still = values.windows(2).filter(|pair| pair[0] == pair[1]).count();
    // Repeated rows are left out on reading.
    (values.len() > 1 && falls.len() * ROWS_PER_RESTART <= values.len() && still * ROWS_PER_RESTART <= values.len())
        .then_some(falls)
}

/// `true` for 0, 1, 2, .. or 1, 2, 3, .., possibly with restarts.
pub fn counts(values: &[f64]) -> bool {
    values.windows(2).all(|pair| pair[1] - pair[0] == 1.0 || pair[1] < pair[0])
        && values.iter().all(|x| x.fract() == 0.0)
}

/// `true` if the steps of an increasing column are nearly equal.
fn even(values: &[f64]) -> bool {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let middle = median(&mut steps);
    let far = steps.iter().filter(|step| (**step - middle).abs() > EVEN_STEP * middle).count();
    far * STEPS_PER_UNEVEN_ONE <= steps.len()
}

/// The time among columns: by its name, or as the only one that increases by nearly equal steps and does not count rows.
pub fn find(names: &[String], numbers: &[Result<Vec<f64>, String>]) -> Option<Time> {
    let candidates = || {
        numbers.iter().enumerate().filter_map(|(k, values)| {
            let values = values.as_deref().ok()?;
            Some((k, values, restarts(values)?))
        })
    };
    let made = |(column, values, restarts): (usize, &[f64], Vec<usize>), because: &str| {
        let (unit, said) = unit(&names[column], values);
        let because = if said.is_empty() { because.to_string() } else { format!("{because}; {said}") };
        Time { column, unit, restarts, because }
    };
    if let Some(named) = candidates().find(|(k, ..)| is_time(&names[*k])) {
        return Some(made(named, "its name"));
    }
    let mut others = candidates().filter(|(k, values, _)| !is_index(&names[*k]) && !counts(values) && even(values));
    match (others.next(), others.next()) {
        (Some(one), None) => Some(made(one, "it increases by equal steps")),
        _ => None,
    }
}

/// Unit of a time and the reason: of its name, or of the size of a time stamp since 1970.
fn unit(name: &str, values: &[f64]) -> (Option<&'static str>, String) {
    if let Some(unit) = unit_of_time(name) {
        return (Some(unit), format!("in {unit} by its name"));
    }
    let size = values.first().map_or(0.0, |first| first.abs());
    let stamp = [(1e17, "ns"), (1e14, "us"), (1e11, "ms")].into_iter().find(|(least, _)| size >= *least);
    match stamp {
        Some((_, unit)) => (Some(unit), format!("in {unit} since 1970 by its size")),
        None => {
            let mut steps: Vec<f64> =
                values.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
            let step = median(&mut steps);
            let coarse = step >= SUSPICIOUS_STEP && values.iter().all(|x| x.fract() == 0.0);
            let hint = format!("steps of {} s: if they are milliseconds, add --units {name}=ms", number(step));
            (None, if coarse { hint } else { String::new() })
        }
    }
}

//! What the motion determines: standard errors, and the directions that it leaves open, in words.

use super::follow::{Follower, Segment};
use super::found::{Combination, Undetermined};
use super::solve::{Normal, Problem};
use crate::lagrangian::system::Bounds;
use crate::linalg::{Workspace, dot, eigh};

/// Eigenvalue of the matrix of correlations below which the motion does not depend on a direction: the ridge under the starts leaves about
/// this much of one that is none.
pub(super) const NULL: f64 = 1e-8;
/// Relative standard error from which on a direction is open.
const OPEN: f64 = 1.0;
/// Part of the effect of a change below which a constant has none in it: rounding.
const PIVOT: f64 = 1e-5;
/// Part of the largest change from which on another one is as large.
const EQUAL: f64 = 0.99;
/// Share of a direction below which a constant has no part in it.
const NO_PART: f64 = 0.02;
/// Largest power of a constant in a combination.
const MOST_POWER: f64 = 6.0;
/// Accelerations relative to the usual ones that are rounding.
const ROUNDING: f64 = 1e-8;
/// States at which the effect of a direction is examined, at most.
const MOST_STATES: usize = 256;
/// A motion this many times as telling as the recorded one is worth a word.
const WORTH: f64 = 2.0;

/// Errors of the unknowns, and what is open.
pub(super) struct Determined {
    /// `(m, m)`.
    pub covariance: Vec<f64>,
    /// `None` for unknowns that the motion says nothing of.
    pub errors: Vec<Option<f64>>,
    /// Directions in relative changes of the unknowns, each with its relative error if it has one.
    pub open: Vec<(Vec<f64>, Option<f64>)>,
    /// Changes of the unknowns that have no effect at all, in their own units.
    pub null: Vec<Vec<f64>>,
    /// Effect of the unknowns, each for itself.
    pub effects: Vec<f64>,
}

impl Determined {
    /// From undamped normal equations; variances are `inflation` times those of independent noise of the given size.
    pub fn new(problem: &Problem<'_>, x: &[f64], normal: &Normal, inflation: f64) -> Self {
        let m = x.len();
        let muted = problem.without_effect(x, normal);
        let live: Vec<usize> = (0..m).filter(|&k| !muted[k] && normal.matrix[k * m + k] > 0.0).collect();
        let count = live.len();
        let root = |k: usize| normal.matrix[k * m + k].sqrt();
        let correlated: Vec<f64> = (0..count * count)
            .map(|at| (live[at / count], live[at % count]))
            .map(|(i, j)| normal.matrix[i * m + j] / (root(i) * root(j)))
            .collect();
        let (mut values, mut vectors) = (vec![0.0; count], vec![0.0; count * count]);
        // Finite by construction.
        let _ = eigh(count, &correlated, &mut values, &mut vectors, &mut Workspace::new());
        // A constant that may be 0 is compared with what the motion tells of it alone.
        let alone = |k: usize| 10.0 * inflation.sqrt() / root(k);
        let scale = |k: usize| Some(problem.scale(k, x[k])).filter(|scale| *scale > 0.0).unwrap_or_else(|| alone(k));
        let mut covariance = vec![0.0; m * m];
        let mut null: Vec<Vec<f64>> = Vec::new();
        let mut changes: Vec<Vec<f64>> = Vec::new();
        for k in (0..m).filter(|k| !live.contains(k)) {
            null.push((0..m).map(|j| f64::from(u8::from(j == k))).collect());
            changes.extend(null.last().cloned());
        }
        for (value, vector) in values.iter().zip(vectors.chunks_exact(count.max(1))) {
            let along: Vec<f64> = vector.iter().zip(&live).map(|(x, &k)| x / root(k)).collect();
            if *value > NULL {
                for (a, &i) in along.iter().zip(&live) {
                    for (b, &j) in along.iter().zip(&live) {
                        covariance[i * m + j] += inflation * a * b / value;
                    }
                }
            } else {
                let (mut direction, mut change) = (vec![0.0; m], vec![0.0; m]);
                along.iter().zip(&live).for_each(|(a, &k)| (direction[k], change[k]) = (a / scale(k), *a));
                null.push(unit(direction));
                changes.push(change);
            }
        }
        let null = sparse(null);
        let part = |k: usize| null.iter().any(|direction| direction[k].abs() > NO_PART);
        let errors: Vec<Option<f64>> = (0..m).map(|k| (!part(k)).then(|| covariance[k * m + k].sqrt())).collect();
        // Directions that depend on the motion, but too weakly.
        let known: Vec<usize> = (0..m).filter(|&k| !part(k)).collect();
        let size = known.len();
        let relative: Vec<f64> = (0..size * size)
            .map(|at| (known[at / size], known[at % size]))
            .map(|(i, j)| covariance[i * m + j] / (scale(i) * scale(j)))
            .collect();
        let (mut variances, mut directions) = (vec![0.0; size], vec![0.0; size * size]);
        let _ = eigh(size, &relative, &mut variances, &mut directions, &mut Workspace::new());
        let weak: Vec<Vec<f64>> = variances
            .iter()
            .zip(directions.chunks_exact(size.max(1)))
            .filter(|(variance, _)| **variance > OPEN * OPEN)
            .map(|(_, vector)| {
                let mut direction = vec![0.0; m];
                vector.iter().zip(&known).for_each(|(x, &k)| direction[k] = *x);
                direction
            })
            .collect();
        let error = |direction: &[f64]| {
            let largest = (0..m).max_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs())).unwrap_or(0);
            covariance[largest * m + largest].sqrt() / scale(largest)
        };
        let weak = sparse(weak).into_iter().map(|direction| {
            let error = error(&direction);
            (direction, Some(error))
        });
        let open = null.into_iter().map(|direction| (direction, None)).chain(weak).collect();
        let effects = (0..m).map(|k| if muted[k] { 0.0 } else { root(k) }).collect();
        Self { covariance, errors, open, null: changes, effects }
    }

    /// Sums of constants that determine the forces: the base parameters of a robot (Khalil and Dombre, "Modeling, Identification and Control of
    /// Robots", 2002). Every change of the constants without effect removes one of them from the list, and adds it to the sums of others.
    /// Constants with short names are removed first, so that masses are added to moments.
    pub fn base_parameters(&self, names: &[&str], units: &[&str], x: &[f64]) -> Vec<Combination> {
        let m = x.len();
        let size = |row: &[f64], k: usize| row[k].abs() * if self.effects[k] > 0.0 { self.effects[k] } else { 1.0 };
        let mut open = self.null.clone();
        let mut done: Vec<(usize, Vec<f64>)> = Vec::new();
        let mut order: Vec<usize> = (0..m).rev().collect();
        order.sort_by_key(|&k| names[k].len());
        for k in order {
            let most = (0..open.len()).max_by(|&a, &b| size(&open[a], k).total_cmp(&size(&open[b], k)));
            let Some(at) = most else { break };
            let largest = (0..m).map(|j| size(&open[at], j)).fold(0.0, f64::max);
            if size(&open[at], k) < PIVOT * largest {
                continue;
            }
            let mut row = open.swap_remove(at);
            let pivot = row[k];
            row.iter_mut().for_each(|x| *x /= pivot);
            for other in open.iter_mut().chain(done.iter_mut().map(|(_, other)| other)) {
                let factor = other[k];
                other.iter_mut().zip(&row).for_each(|(x, own)| *x -= factor * own);
            }
            done.push((k, row));
        }
        let kept = (0..m).filter(|k| done.iter().all(|(gone, _)| gone != k));
        let sum = |k: usize| {
            let mut factors = vec![0.0; m];
            factors[k] = 1.0;
            for (gone, row) in &done {
                if size(row, k) > PIVOT * size(row, *gone) {
                    factors[*gone] = -row[k];
                }
            }
            let along: Vec<f64> =
                (0..m).map(|i| dot(&self.covariance[i * m..(i + 1) * m], &factors) * factors[i]).collect();
            let others = (0..m).filter(|&j| j != k && factors[j] != 0.0);
            Combination {
                terms: [k].into_iter().chain(others).map(|j| (names[j].to_string(), factors[j])).collect(),
                value: dot(&factors, x),
                standard_error: along.iter().sum::<f64>().max(0.0).sqrt(),
                unit: units[k].to_string(),
            }
        };
        kept.map(sum).collect()
    }
}

fn unit(mut direction: Vec<f64>) -> Vec<f64> {
    let size = dot(&direction, &direction).sqrt();
    direction.iter_mut().for_each(|x| *x /= size);
    direction
}

/// The same space by directions of few constants each, the largest change 1.
fn sparse(mut rows: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let m = rows.first().map_or(0, Vec::len);
    let mut done: Vec<usize> = Vec::new();
    for at in 0..rows.len() {
        let open = (0..m).filter(|k| !done.contains(k));
        let places: Vec<(usize, usize)> = open.flat_map(|k| (at..rows.len()).map(move |row| (row, k))).collect();
        let size = |&(row, k): &(usize, usize)| rows[row][k].abs();
        let largest = places.iter().map(size).fold(0.0, f64::max);
        // Of equal ones the first, whatever rounding says.
        let Some(&(row, pivot)) = places.iter().find(|place| size(place) >= EQUAL * largest) else { break };
        rows.swap(at, row);
        let value = rows[at][pivot];
        rows[at].iter_mut().for_each(|x| *x /= value);
        let own = rows[at].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(k, _)| *k != at) {
            let factor = row[pivot];
            row.iter_mut().zip(&own).for_each(|(x, o)| *x -= factor * o);
        }
        done.push(pivot);
    }
    for row in &mut rows {
        let largest = row.iter().fold(0.0, |most: f64, x| if x.abs() > most.abs() { *x } else { most });
        row.iter_mut().for_each(|x| *x = if (*x / largest).abs() < NO_PART { 0.0 } else { *x / largest });
    }
    rows
}

/// Whole numbers in the ratio of some changes, if small ones do.
fn powers(direction: &[f64]) -> Option<Vec<i32>> {
    let least = direction.iter().map(|x| x.abs()).filter(|x| *x > 0.0).fold(f64::INFINITY, f64::min);
    (1..=3).find_map(|factor| {
        let scaled: Vec<f64> = direction.iter().map(|x| x / least * f64::from(factor)).collect();
        let whole = scaled.iter().all(|x| (x - x.round()).abs() < 0.03 && x.abs() <= MOST_POWER);
        whole.then(|| scaled.iter().map(|x| x.round() as i32).collect())
    })
}

fn divisor(a: i32, b: i32) -> i32 {
    if b == 0 { a.abs() } else { divisor(b, a % b) }
}

/// `name^power` in a product.
fn factor(name: &str, power: i32) -> String {
    if power == 1 { name.to_string() } else { format!("{name}^{power}") }
}

/// Combinations of the constants of an open direction that stay the same along it, with their values.
fn combinations(names: &[&str], x: &[f64], direction: &[f64]) -> Vec<(String, f64)> {
    let inside: Vec<usize> = (0..x.len()).filter(|&k| direction[k] != 0.0).collect();
    let Some((&first, rest)) = inside.split_first().filter(|_| inside.iter().all(|&k| x[k] != 0.0)) else {
        return Vec::new();
    };
    let changes: Vec<f64> = inside.iter().map(|&k| direction[k] * x[k]).collect();
    let exchanged = inside.len() == 2 && (changes[0] + changes[1]).abs() < 1e-3 * changes[0].abs();
    let whole = powers(&inside.iter().map(|&k| direction[k]).collect::<Vec<_>>()).filter(|_| !exchanged);
    let of = |(at, &k): (usize, &usize)| match &whole {
        Some(powers) => {
            let (mut own, mut other) = (powers[0], -powers[at + 1]);
            let common = divisor(own, other).max(1) * own.signum();
            (own, other) = (own / common, other / common);
            let text = if other < 0 {
                format!("{}/{}", factor(names[k], own), factor(names[first], -other))
            } else {
                format!("{}*{}", factor(names[k], own), factor(names[first], other))
            };
            (text, x[k].powi(own) * x[first].powi(other))
        }
        None => {
            let slope = -changes[at + 1] / changes[0];
            let (sign, size) = if slope < 0.0 { ("-", -slope) } else { ("+", slope) };
            let size_text = if (size - 1.0).abs() < 1e-3 { String::new() } else { format!("{size:.4}*") };
            (format!("{} {sign} {size_text}{}", names[k], names[first]), x[k] + slope * x[first])
        }
    };
    rest.iter().enumerate().map(of).collect()
}

/// Names in a sentence.
fn listed(names: &[String]) -> String {
    match names.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}

/// Spreads coordinate `i` of states evenly over a range.
fn spread((values, n): (&mut [f64], usize), i: usize, [low, high]: [f64; 2]) {
    for (k, x) in values.iter_mut().skip(i).step_by(n).enumerate() {
        *x = low + (high - low) * ((k + 1) as f64 * 0.618_033_988_749_895 * (i + 1) as f64).fract();
    }
}

/// Looks for motion that would tell an open direction.
pub(super) struct Examiner<'a> {
    pub problem: &'a Problem<'a>,
    pub x: &'a [f64],
    pub segments: &'a [Segment],
    pub coordinates: &'a [String],
    pub bounds: Bounds,
    pub names: &'a [&'a str],
}

/// States, `(states, n)`, and forces, empty for none.
struct Probe {
    q: Vec<f64>,
    v: Vec<f64>,
    force: Vec<f64>,
}

impl Examiner<'_> {
    /// An open direction in words.
    pub fn describe(&self, direction: &[f64], relative_error: Option<f64>) -> Undetermined {
        let inside: Vec<usize> = (0..self.x.len()).filter(|&k| direction[k] != 0.0).collect();
        let constants: Vec<String> = inside.iter().map(|&k| self.names[k].to_string()).collect();
        let known = combinations(self.names, self.x, direction);
        let listed = listed(&constants);
        let error = relative_error.map(|error| format!(", relative error {error:.1}")).unwrap_or_default();
        let text = if known.is_empty() {
            format!("{listed} is not determined{error}")
        } else {
            let combinations: Vec<&str> = known.iter().map(|(text, _)| text.as_str()).collect();
            format!("{listed} are not determined apart{error}, only {}", combinations.join(", "))
        };
        let cure = self.cure(direction, relative_error);
        let direction = inside.iter().map(|&k| direction[k]).collect();
        Undetermined { constants, direction, known, relative_error, text, cure }
    }

    fn n(&self) -> usize {
        self.coordinates.len()
    }

    /// Recorded states.
    fn recorded(&self) -> Probe {
        let n = self.n();
        let stride = self.segments.len().div_ceil(MOST_STATES).max(1);
        let starts = || self.segments.iter().step_by(stride).map(|segment| segment.start.split_at(n));
        let q = starts().flat_map(|(q, _)| q.to_vec()).collect();
        let v = starts().flat_map(|(_, v)| v.to_vec()).collect();
        Probe { q, v, force: Vec::new() }
    }

    /// Change of accelerations along a direction, relative to `sizes`, root mean square over states; that of the constants for
    /// themselves, summed, is the second number.
    fn effect(&self, direction: &[f64], probe: &Probe, sizes: &[f64]) -> [f64; 2] {
        let (n, m) = (self.n(), self.problem.chosen.len());
        let values = self.problem.parameters(self.x);
        let mut follower = Follower::new(&self.problem.course);
        let mut a = vec![0.0; probe.q.len()];
        follower.accelerate(&values, (&probe.q, &probe.v), &probe.force, &mut a);
        let slopes = follower.slopes(&values, (&probe.q, &probe.v, &a));
        let (mut sums, mut count) = ([0.0; 2], 0.0);
        for state in slopes.chunks_exact(n * (2 * n + m)) {
            let (mut whole, mut apart) = (0.0, 0.0);
            for (row, size) in state.chunks_exact(2 * n + m).zip(sizes) {
                let parts = (0..m).map(|k| row[2 * n + k] * direction[k] * self.x[k] / size);
                let (sum, sizes) = parts.fold((0.0, 0.0), |(sum, sizes), part| (sum + part, sizes + part.abs()));
                whole += sum * sum;
                apart += sizes * sizes;
            }
            if whole.is_finite() && apart.is_finite() {
                sums[0] += whole;
                sums[1] += apart;
                count += 1.0;
            }
        }
        sums.map(|sum: f64| if count > 0.0 { (sum / count).sqrt() } else { 0.0 })
    }

    /// Root mean square of the accelerations of every coordinate.
    fn sizes(&self, probe: &Probe) -> Vec<f64> {
        let n = self.n();
        let values = self.problem.parameters(self.x);
        let mut a = vec![0.0; probe.q.len()];
        Follower::new(&self.problem.course).accelerate(&values, (&probe.q, &probe.v), &[], &mut a);
        let of = |i: usize| {
            let own: Vec<f64> = a.iter().skip(i).step_by(n).copied().filter(|a| a.is_finite()).collect();
            let square = dot(&own, &own) / own.len().max(1) as f64;
            if square > 0.0 { square.sqrt() } else { 1.0 }
        };
        (0..n).map(of).collect()
    }

    /// Lowest and highest of a column, three times as wide or to the bounds of the system.
    fn wider(values: &[f64], (n, i): (usize, usize), bounds: (f64, f64)) -> ([f64; 2], [f64; 2]) {
        let own = values.iter().skip(i).step_by(n).copied();
        let (low, high) = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (middle, half) = ((low + high) / 2.0, 1.5 * (high - low));
        ([low, high], [(middle - half).min(bounds.0), (middle + half).max(bounds.1)])
    }

    /// Lowest and highest of every position and velocity, as recorded and wider.
    fn ranges(&self, recorded: &Probe) -> [Vec<([f64; 2], [f64; 2])>; 2] {
        let n = self.n();
        let wider = |values: &[f64], bounds: &[(f64, f64)]| {
            (0..n).map(|i| Self::wider(values, (n, i), bounds[i])).collect::<Vec<_>>()
        };
        [wider(&recorded.q, &self.bounds.positions), wider(&recorded.v, &self.bounds.velocities)]
    }

    /// States spread evenly over the wider ranges, whatever the recorded ones are.
    fn wild(&self) -> Probe {
        let n = self.n();
        let mut wild = self.recorded();
        let [wide_q, wide_v] = self.ranges(&wild);
        for i in 0..n {
            spread((&mut wild.q, n), i, wide_q[i].1);
            spread((&mut wild.v, n), i, wide_v[i].1);
        }
        wild
    }

    /// What sums alone tell of constants: those that the equations hold together, and those that this motion does.
    pub fn together(&self, changes: &[Vec<f64>]) -> Vec<Undetermined> {
        let (n, m) = (self.n(), self.problem.chosen.len());
        let probe = self.wild();
        let mut a = probe.v.clone();
        a.iter_mut().enumerate().for_each(|(at, a)| *a *= if at % 3 == 0 { -1.7 } else { 1.3 });
        let mut follower = Follower::new(&self.problem.course);
        let slopes = follower.force_slopes(&self.problem.parameters(self.x), (&probe.q, &probe.v, &a));
        let everywhere = |change: &[f64]| {
            let rows = slopes.chunks_exact(2 * n + m).map(|row| &row[2 * n..]);
            let (whole, apart) = rows.fold((0.0, 0.0), |(whole, apart): (f64, f64), row| {
                let parts = || row.iter().zip(change).map(|(r, c)| r * c);
                (whole + parts().sum::<f64>().powi(2), apart + parts().map(|x| x * x).sum::<f64>())
            });
            whole <= ROUNDING * ROUNDING * apart
        };
        let (always, here): (Vec<&Vec<f64>>, Vec<&Vec<f64>>) = changes.iter().partition(|change| everywhere(change));
        let single = |change: &&Vec<f64>| change.iter().filter(|x| **x != 0.0).count() == 1;
        let (silent, always): (Vec<&Vec<f64>>, Vec<&Vec<f64>>) = always.into_iter().partition(single);
        let told = |changes: &[&Vec<f64>], (text, cure): (&str, &str)| {
            let largest = |change: &[f64]| change.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let inside = |k: &usize| changes.iter().any(|change| change[*k].abs() > NO_PART * largest(change));
            let constants: Vec<String> = (0..m).filter(inside).map(|k| self.names[k].to_string()).collect();
            let (text, cure) = (format!("{} {text}", listed(&constants)), cure.to_string());
            Undetermined { constants, direction: Vec::new(), known: Vec::new(), relative_error: None, text, cure }
        };
        let all = [
            (silent, ("have no effect on the forces, whatever the motion", "none: nothing depends on them")),
            (
                always,
                (
                    "are held together by the equations, whatever the motion",
                    "none: their sums are all that the forces depend on",
                ),
            ),
            (here, ("are not told apart by this motion", "motion that goes farther, faster, or by other joints")),
        ];
        all.into_iter().filter(|(some, _)| !some.is_empty()).map(|(some, words)| told(&some, words)).collect()
    }

    /// What would determine a direction.
    fn cure(&self, direction: &[f64], relative_error: Option<f64>) -> String {
        let (n, m) = (self.n(), self.problem.chosen.len());
        let more = || {
            let factor =
                relative_error.map_or_else(String::new, |error| format!(" by a factor of {:.0}", 10.0 * error));
            format!("more motion of this kind, or less noise: errors would have to be smaller{factor}")
        };
        if direction[m..].iter().any(|x| *x != 0.0) {
            return "a sensor that is calibrated: its constants and those of the system do the same to this motion"
                .into();
        }
        let recorded = self.recorded();
        let sizes = self.sizes(&recorded);
        let [now, _] = self.effect(direction, &recorded, &sizes);
        let [wide_q, wide_v] = self.ranges(&recorded);
        let wild = self.wild();
        let [anywhere, apart] = self.effect(direction, &wild, &sizes);
        if anywhere < ROUNDING * apart.max(1.0) {
            let forced = self.problem.course.recording.tracks.iter().any(|track| !track.force.is_empty());
            let mut driven = self.recorded();
            let mut follower = Follower::new(&self.problem.course);
            let mut a = vec![0.0; driven.q.len()];
            follower.accelerate(&self.problem.parameters(self.x), (&driven.q, &driven.v), &[], &mut a);
            let push = |(at, mass): (usize, &f64)| mass.abs() * sizes[at % n];
            let rows = follower.mass().chunks_exact(n).map(|row| row.iter().enumerate().map(push).sum::<f64>());
            driven.force = rows.enumerate().map(|(k, size)| if k % 3 == 0 { -size } else { size }).collect();
            let [under_force, apart] = self.effect(direction, &driven, &sizes);
            return if under_force < ROUNDING * apart.max(1.0) {
                "none: whatever the motion, the equations hold them in this combination alone; give one of them its value"
                    .into()
            } else if forced {
                more()
            } else {
                "motion under a known force (--force), without which no motion depends on it; or a value that is known"
                    .into()
            };
        }
        let mut best: (f64, String) = (WORTH * now, String::new());
        let mut try_out = |probe: Probe, text: String| {
            let [effect, _] = self.effect(direction, &probe, &sizes);
            if effect > best.0 {
                best = (effect, text);
            }
        };
        for (i, name) in self.coordinates.iter().enumerate() {
            let range = |[low, high]: [f64; 2]| format!("{low:.3} .. {high:.3}");
            let mut probe = self.recorded();
            spread((&mut probe.q, n), i, wide_q[i].1);
            try_out(
                probe,
                format!("motion in which {name} goes farther, over {}, not {}", range(wide_q[i].1), range(wide_q[i].0)),
            );
            let mut probe = self.recorded();
            spread((&mut probe.v, n), i, wide_v[i].1);
            try_out(
                probe,
                format!(
                    "motion in which {name} is faster, with {name}_dot over {}, not {}",
                    range(wide_v[i].1),
                    range(wide_v[i].0)
                ),
            );
        }
        if best.1.is_empty() { more() } else { best.1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_are_written_as_products_or_sums() {
        let names = ["m", "l", "g"];
        let text = |x: &[f64], direction: &[f64]| combinations(&names, x, direction);
        assert_eq!(text(&[1.0, 2.0, 10.0], &[0.0, 1.0, 1.0]), [("g/l".to_string(), 5.0)]);
        assert_eq!(text(&[3.0, 2.0, 10.0], &[1.0, -0.5, 0.0]), [("l^2*m".to_string(), 12.0)]);
        assert_eq!(text(&[3.0, 2.0, 10.0], &[0.0, 1.0, -0.2]), [("g + l".to_string(), 12.0)]);
        assert_eq!(text(&[3.0, 2.0, 10.0], &[1.0, 0.0, 0.0]), []);
        let both = text(&[1.0, 2.0, 10.0], &[1.0, 1.0, 1.0]);
        assert_eq!(both.iter().map(|(t, _)| t.as_str()).collect::<Vec<_>>(), ["l/m", "g/m"]);
    }

    #[test]
    fn a_space_is_told_by_few_constants_each() {
        let rows = vec![unit(vec![1.0, 1.0, 1.0, 1.0]), unit(vec![1.0, 1.0, -1.0, -1.0])];
        let mut found = sparse(rows);
        found.sort_by(|a, b| b[0].total_cmp(&a[0]));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close(&found[0], &[1.0, 1.0, 0.0, 0.0]) && close(&found[1], &[0.0, 0.0, 1.0, 1.0]), "{found:?}");
    }
}

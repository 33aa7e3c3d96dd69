//! Recognises motion of first order, such as that of tanks and circuits: velocities are functions of positions and other measured
//! quantities, and no Lagrangian with a kinetic energy describes the motion.

use super::thresholds::{
    ACCEPTED_RESIDUAL, FIRST_ORDER_DEGREE, FIRST_ORDER_RIDGE, FIRST_ORDER_TERMS, GAIN_BY_OTHERS, LEAST_WINDOWS,
    MOST_WINDOWS, REFUSED_RESIDUAL, RESIDUAL_OVER_ERROR, SAME_QUANTITY, WINDOW_BLOCK, WINDOW_OVERLAP, WINDOWS_PER_TERM,
};
use crate::linalg::{Workspace, dot, solve_symmetric};
use crate::names::percent;
use crate::recording::{LoadedRecording, RecordedTrajectory, Smoothing, deviation, rms};
use serde::Serialize;

/// Weights of the samples about a time, `w(s) = (1 - s^2)^3` over their sum, with which
///
/// ```text
/// mean of x' = -sum w'(t) x(t) h / sum w(t) h
/// ```
///
/// is taken from positions alone. A relation `x' = f(x, u)` holds for the means of both sides, whatever the noise and however fast the motion.
struct Window {
    track: usize,
    first: usize,
    weights: Vec<f64>,
}

/// The mean velocities of a coordinate and the quantities that may determine them.
struct Equation<'a> {
    /// Positions, then other quantities, of every trajectory, `(samples, columns)`, with mean 0 and standard deviation 1.
    known: &'a [Vec<f64>],
    columns: usize,
    windows: Vec<Window>,
    velocities: Vec<f64>,
    /// Standard error of the velocities that results from the noise of the positions.
    error: f64,
}

impl<'a> Equation<'a> {
    /// The equation of coordinate `i`, with windows as wide as those that smooth it.
    fn of(reading: &LoadedRecording, known: &'a [Vec<f64>], columns: usize, smoothing: &Smoothing, i: usize) -> Self {
        let (recording, n, chosen) = (&reading.recording, reading.recording.n(), &smoothing.coordinates[i]);
        let half = chosen.seconds / 2.0;
        let all: f64 = recording.tracks.iter().map(RecordedTrajectory::span).sum();
        let step = (half / WINDOW_OVERLAP).max(all / MOST_WINDOWS);
        let (mut windows, mut velocities, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for (at, track) in recording.tracks.iter().enumerate() {
            let RecordedTrajectory { times, q, .. } = track;
            let Some(start) = times.first().map(|t| t + half) else { continue };
            let count = ((track.span() - 2.0 * half) / step).floor();
            for centre in (0..).map(f64::from).take_while(|k| *k <= count).map(|k| start + k * step) {
                let first = times.partition_point(|t| *t <= centre - half);
                let end = times.partition_point(|t| *t < centre + half);
                let (mut weights, mut slope, mut square) = (Vec::with_capacity(end - first), 0.0, 0.0);
                for k in first..end {
                    let h = (times[(k + 1).min(times.len() - 1)] - times[k.saturating_sub(1)]) / 2.0;
                    let s = (times[k] - centre) / half;
                    let inside = 1.0 - s * s;
                    let derivative = 6.0 * s * inside * inside / half * h;
                    weights.push(inside.powi(3) * h);
                    slope += derivative * q[k * n + i];
                    square += derivative * derivative;
                }
                let whole: f64 = weights.iter().sum();
                weights.iter_mut().for_each(|w| *w /= whole);
                windows.push(Window { track: at, first, weights });
                velocities.push(slope / whole);
                errors.push(chosen.noise.sigma * square.sqrt() / whole);
            }
        }
        Self { known, columns, windows, velocities, error: rms(errors) }
    }

    fn spread(&self) -> f64 {
        deviation(self.velocities.iter())
    }

    /// Means over a window of the monomials of some columns.
    fn mean(&self, window: &Window, of: &[usize], monomials: &Monomials) -> Vec<f64> {
        let (mut mean, mut values) = (vec![0.0; monomials.count()], vec![1.0; monomials.count()]);
        let rows = self.known[window.track].chunks_exact(self.columns).skip(window.first);
        for (weight, row) in window.weights.iter().zip(rows) {
            monomials.write(|k| row[of[k]], &mut values);
            mean.iter_mut().zip(&values).for_each(|(sum, x)| *sum += weight * x);
        }
        mean
    }

    /// `true` if column `k` varies and does not measure this velocity.
    fn is_independent(&self, k: usize) -> bool {
        let alone = Monomials::new(1, 1);
        let column: Vec<f64> = self.windows.iter().map(|window| self.mean(window, &[k], &alone)[1]).collect();
        let (mean, spread) = (column.iter().sum::<f64>() / column.len() as f64, deviation(column.iter()));
        let centred: Vec<f64> = column.iter().map(|x| x - mean).collect();
        spread > 0.0
            && dot(&centred, &self.velocities).abs() < SAME_QUANTITY * column.len() as f64 * spread * self.spread()
    }

    /// Root mean square residual of the velocity on the odd blocks, for a polynomial of some of the known columns fitted to the even
    /// blocks; the best degree counts. `None` for too few windows.
    fn residual(&self, of: &[usize]) -> Option<f64> {
        let least = |count: usize| (WINDOWS_PER_TERM * count).max(LEAST_WINDOWS);
        let enough = |count: usize| count <= FIRST_ORDER_TERMS && self.windows.len() >= least(count);
        let degrees = || (1..=FIRST_ORDER_DEGREE).filter(|&degree| enough(terms(of.len(), degree)));
        let monomials = Monomials::new(of.len(), degrees().next_back()?);
        let rows: Vec<Vec<f64>> = self.windows.iter().map(|window| self.mean(window, of, &monomials)).collect();
        degrees().filter_map(|degree| self.residual_of(&rows, terms(of.len(), degree))).min_by(f64::total_cmp)
    }

    /// The same residual with the first `count` functions of every row.
    fn residual_of(&self, rows: &[Vec<f64>], count: usize) -> Option<f64> {
        let rows = || rows.iter().map(|row| &row[..count]).zip(&self.velocities).enumerate();
        let block = |odd: usize| rows().filter(move |(at, _)| at / WINDOW_BLOCK % 2 == odd).map(|(_, row)| row);
        let (mut matrix, mut right) = (vec![0.0; count * count], vec![0.0; count]);
        for (row, velocity) in block(0) {
            for (i, x) in row.iter().enumerate() {
                right[i] += x * velocity;
                row.iter().enumerate().for_each(|(j, y)| matrix[i * count + j] += x * y);
            }
        }
        let largest = (0..count).map(|i| matrix[i * count + i]).fold(0.0, f64::max);
        (0..count).for_each(|i| matrix[i * count + i] += FIRST_ORDER_RIDGE * largest);
        let mut solution = vec![0.0; count];
        solve_symmetric(count, &matrix, &right, &mut solution, &mut Workspace::new()).ok()?;
        Some(rms(block(1).map(|(row, velocity)| velocity - dot(row, &solution))))
    }
}

/// Positions and inputs of every trajectory, `(samples, columns)`, with mean 0 and standard deviation 1.
fn standardised(reading: &LoadedRecording, inputs: usize) -> Vec<Vec<f64>> {
    let n = reading.recording.n();
    let rows = |(track, beside): (&RecordedTrajectory, &Vec<f64>)| -> Vec<f64> {
        track.q.chunks_exact(n).zip(beside.chunks_exact(inputs)).flat_map(|(q, u)| [q, u].concat()).collect()
    };
    let mut known: Vec<Vec<f64>> = reading.recording.tracks.iter().zip(&reading.inputs).map(rows).collect();
    let columns = n + inputs;
    for k in 0..columns {
        let column = || known.iter().flat_map(|rows| rows.iter().skip(k).step_by(columns));
        let (count, spread) = (column().count().max(1) as f64, deviation(column()));
        let mean = column().sum::<f64>() / count;
        let scaled = |x: f64| if spread > 0.0 { (x - mean) / spread } else { 0.0 };
        known.iter_mut().flat_map(|rows| rows.iter_mut().skip(k).step_by(columns)).for_each(|x| *x = scaled(*x));
    }
    known
}

/// Number of monomials of `variables` variables up to a degree.
fn terms(variables: usize, degree: usize) -> usize {
    (1..=degree).fold(1, |product, k| product * (variables + k) / k)
}

/// All monomials of some variables up to a degree, the lower degrees first.
struct Monomials {
    /// For each monomial except the first, which is 1: the monomial and the variable whose product it is.
    factors: Vec<(usize, usize)>,
}

impl Monomials {
    fn new(variables: usize, degree: usize) -> Self {
        let mut factors = Vec::new();
        // Monomials of the last degree, each with its last variable: only that and later variables multiply it, so that each product occurs
        // once.
        let mut last = vec![(0, 0)];
        for _ in 0..degree {
            let mut next = Vec::new();
            for (at, from) in last {
                for variable in from..variables {
                    factors.push((at, variable));
                    next.push((factors.len(), variable));
                }
            }
            last = next;
        }
        Self { factors }
    }

    fn count(&self) -> usize {
        self.factors.len() + 1
    }

    /// Writes the values of all monomials, `(count)`; the first is 1.
    fn write(&self, x: impl Fn(usize) -> f64, values: &mut [f64]) {
        for (k, (at, variable)) in self.factors.iter().enumerate() {
            values[k + 1] = values[*at] * x(*variable);
        }
    }
}

/// Result for motion of first order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstOrder {
    /// Other quantities that determine the velocities together with the positions.
    pub from: Vec<String>,
    /// Largest residual of a velocity, relative to its spread.
    pub residual: f64,
}

impl FirstOrder {
    /// Tests whether positions and inputs of a recording determine the velocities to within their errors, while positions alone do not.
    ///
    /// A polynomial of both is fitted to one half of the motion and tested on the other half. Periodic motion driven at a single
    /// frequency also looks like this.
    pub(super) fn of(reading: &LoadedRecording, smoothing: &Smoothing) -> Option<Self> {
        let (recording, n, inputs) = (&reading.recording, reading.recording.n(), &reading.columns.input);
        if inputs.is_empty() || reading.inputs.len() != recording.tracks.len() || recording.is_driven() {
            return None;
        }
        let (known, columns) = (standardised(reading, inputs.len()), n + inputs.len());
        let equations: Vec<Equation<'_>> =
            (0..n).map(|i| Equation::of(reading, &known, columns, smoothing, i)).collect();
        let positions: Vec<usize> = (0..n).collect();
        let others: Vec<usize> = (n..columns).filter(|&k| equations.iter().all(|own| own.is_independent(k))).collect();
        let all = [positions.as_slice(), &others].concat();
        let (mut others_matter, mut residual) = (false, 0f64);
        for equation in &equations {
            let spread = equation.spread();
            let (with, without) = (equation.residual(&all)?, equation.residual(&positions)?);
            // A window without samples has no mean.
            if with.is_nan()
                || with
                    > (RESIDUAL_OVER_ERROR * equation.error)
                        .max(ACCEPTED_RESIDUAL * spread)
                        .min(REFUSED_RESIDUAL * spread)
            {
                return None;
            }
            others_matter |= without > GAIN_BY_OTHERS * with;
            residual = residual.max(with / spread);
        }
        let from = others.iter().map(|k| inputs[k - n].clone()).collect();
        others_matter.then_some(Self { from, residual })
    }

    /// The warning.
    pub(super) fn warning(&self) -> String {
        format!(
            "the velocities follow from the positions and {} to within {} of their spread: motion of first order, as of \
             tanks and circuits, has no Lagrangian with a kinetic energy. Motion driven at a single frequency looks the \
             same: record motion driven at other frequencies",
            self.from.join(", "),
            percent(self.residual)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Columns, Recording, SmoothOptions};

    /// Two tanks, the first with a pump: `h1' = -c sqrt(h1) + u`, `h2' = c (sqrt(h1) - sqrt(h2))`.
    fn tanks(_: f64, h: &[f64; 4], u: f64) -> [f64; 4] {
        [0.2 * (u - h[0].sqrt()), 0.2 * (h[0].sqrt() - h[1].sqrt()), 0.0, 0.0]
    }

    /// Two masses between springs, the first pushed.
    fn masses(_: f64, x: &[f64; 4], u: f64) -> [f64; 4] {
        [x[2], x[3], u - 2.0 * x[0] + x[1] - 0.1 * x[2], x[0] - 2.0 * x[1] - 0.1 * x[3]]
    }

    fn recorded(rate: fn(f64, &[f64; 4], f64) -> [f64; 4], start: [f64; 4], noise: f64) -> LoadedRecording {
        let (step, count) = (0.1, 1500);
        let drive = |t: f64| 2.0 + (0.31 * t).sin() * 0.5 + (0.17 * t + 1.0).cos() * 0.4 + (0.73 * t).sin() * 0.3;
        let (mut x, mut q) = (start, Vec::new());
        for k in 0..count {
            let rough = |seed: usize| noise * (1.7 * ((seed * seed) as f64)).sin();
            q.extend([x[0] + rough(k), x[1] + rough(k + 5000)]);
            for j in 0..20 {
                let t = step * (k as f64 + f64::from(j) / 20.0);
                let half: [f64; 4] = std::array::from_fn(|i| x[i] + step / 40.0 * rate(t, &x, drive(t))[i]);
                let slope = rate(t, &half, drive(t + step / 40.0));
                x = std::array::from_fn(|i| x[i] + step / 20.0 * slope[i]);
            }
        }
        let times: Vec<f64> = (0..count).map(|k| step * k as f64).collect();
        let inputs = vec![times.iter().map(|t| drive(*t)).collect()];
        let track = RecordedTrajectory { name: "a".into(), times, q, v: vec![], a: vec![], force: vec![] };
        let coordinates = ["a", "b"].map(String::from).to_vec();
        let recording = Recording { coordinates, periodic: vec![false; 2], tracks: vec![track] };
        let columns = Columns { input: vec!["u".to_string()], ..Columns::default() };
        LoadedRecording { inputs, columns, ..LoadedRecording::from(recording) }
    }

    fn first_order(reading: &LoadedRecording) -> Option<FirstOrder> {
        FirstOrder::of(reading, &Smoothing::choose(&reading.recording, &SmoothOptions::default()).unwrap())
    }

    #[test]
    fn tanks_are_of_first_order_and_masses_on_springs_are_not() {
        for noise in [1e-4, 1e-3, 1e-2] {
            let found = |rate, start| first_order(&recorded(rate, start, noise));
            let tanks = found(tanks, [3.0, 2.0, 0.0, 0.0]);
            assert!(tanks.as_ref().is_some_and(|found| found.from == ["u"]), "{noise} {tanks:?}");
            assert_eq!(found(masses, [0.0; 4]), None, "{noise}");
        }
        // Without the other quantity no statement is possible.
        let mut short = recorded(tanks, [3.0, 2.0, 0.0, 0.0], 1e-3);
        let unknown = LoadedRecording::from(short.recording.clone());
        assert_eq!(first_order(&unknown), None);
        // Nor if no block is left to test a polynomial on.
        let track = &mut short.recording.tracks[0];
        track.times.truncate(200);
        track.q.truncate(400);
        short.inputs[0].truncate(200);
        assert_eq!(first_order(&short), None);
    }
}

//! Whether velocities follow from positions and other measured quantities, as of tanks and circuits: such motion is of first order, and no
//! Lagrangian with a kinetic energy describes it.

use crate::linalg::{Workspace, dot, solve_symmetric};
use crate::names::percent;
use crate::recording::{LoadedRecording, RecordedTrajectory, Smoothing, deviation, rms};
use serde::Serialize;

/// Degree of the polynomials, and the number of their terms at most; with more, the degree is lower.
const DEGREE: usize = 3;
const TERMS: usize = 84;
/// Samples for each term, at least.
const SAMPLES_PER_TERM: usize = 8;
/// Largest residual of a velocity over its error; share of its spread up to which the polynomial may miss it all the same, and from which on it
/// says nothing; and how many times larger the residual is at least without the other quantities, of one velocity. By the rates of
/// `lnn-studies rates --part check`.
const AT_ERROR: f64 = 2.5;
const MISSED: f64 = 0.03;
const OF_SPREAD: f64 = 0.35;
const WITHOUT: f64 = 2.0;
/// Correlation with a velocity from which another quantity is taken for a measurement of it.
const MEASURED: f64 = 0.995;
/// Largest number of samples that are used, evenly spaced.
const MOST_SAMPLES: usize = 20_000;
/// Windows of smoothing in a block of samples; every other block is fitted.
const WINDOWS: usize = 8;
/// Ridge, over the largest entry of the normal matrix.
const RIDGE: f64 = 1e-10;

/// Columns of samples with full windows.
struct States {
    /// Positions, then other quantities, with mean 0 and standard deviation 1: for each velocity smoothed as it is. A filter leaves linear
    /// relations what they are; another one for each column would not.
    known: Vec<Vec<Vec<f64>>>,
    velocities: Vec<Vec<f64>>,
    errors: Vec<Vec<f64>>,
    /// Samples of a block.
    block: usize,
}

impl States {
    fn of(reading: &LoadedRecording, inputs: usize, smoothing: &Smoothing) -> Self {
        let (recording, n) = (&reading.recording, reading.recording.n());
        let columns = |count: usize| vec![Vec::new(); count];
        let stride = recording.samples().div_ceil(MOST_SAMPLES).max(1);
        let block = (WINDOWS * smoothing.window()).div_ceil(stride);
        let known = vec![columns(n + inputs); n];
        let mut states = Self { known, velocities: columns(n), errors: columns(n), block };
        for (track, beside) in recording.tracks.iter().zip(&reading.inputs) {
            let Ok(smoothed) = smoothing.apply(track) else { continue };
            // A column in the place of every coordinate.
            let alike = |column: &mut dyn Iterator<Item = &f64>| {
                let q = column.flat_map(|x| std::iter::repeat_n(*x, n)).collect();
                smoothing.apply(&RecordedTrajectory { q, v: Vec::new(), ..track.clone() }).ok()
            };
            let positions = (0..n).map(|k| alike(&mut track.q.iter().skip(k).step_by(n)));
            let others = (0..inputs).map(|k| alike(&mut beside.iter().skip(k).step_by(inputs)));
            let Some(all) = positions.chain(others).collect::<Option<Vec<_>>>() else { continue };
            for row in smoothed.interior().step_by(stride).filter(|row| smoothed.is_full(*row)) {
                for i in 0..n {
                    let at = row * n + i;
                    states.known[i].iter_mut().zip(&all).for_each(|(column, own)| column.push(own.q[at]));
                    states.velocities[i].push(smoothed.v[at]);
                    states.errors[i].push(smoothed.v_error[at].hypot(smoothed.v_bias[at]));
                }
            }
        }
        for column in states.known.iter_mut().flatten() {
            let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
            let spread = deviation(column.iter());
            column.iter_mut().for_each(|x| *x = if spread > 0.0 { (*x - mean) / spread } else { 0.0 });
        }
        states
    }

    fn len(&self) -> usize {
        self.velocities[0].len()
    }

    /// `true` for a quantity that varies and is no measurement of a velocity.
    fn is_other(&self, k: usize) -> bool {
        let like = |(known, v): (&Vec<Vec<f64>>, &Vec<f64>)| {
            dot(&known[k], v).abs() / (self.len() as f64 * deviation(v.iter()))
        };
        let varies = self.known.iter().all(|known| known[k].iter().any(|x| *x != 0.0));
        varies && self.known.iter().zip(&self.velocities).all(|pair| like(pair) < MEASURED)
    }

    /// Root mean square over the odd blocks of what a polynomial of some of the known quantities leaves of a velocity, fitted to the even ones;
    /// `None` of too few samples.
    fn residual(&self, i: usize, of: &[usize]) -> Option<f64> {
        let (known, velocity) = (&self.known[i], &self.velocities[i]);
        let degree = (1..=DEGREE).rev().find(|&degree| terms(of.len(), degree) <= TERMS)?;
        let count = terms(of.len(), degree);
        if self.len() < SAMPLES_PER_TERM * count {
            return None;
        }
        let row = |at: usize| monomials(&of.iter().map(|&k| known[k][at]).collect::<Vec<_>>(), degree);
        let blocks = |odd: usize| (0..self.len()).filter(move |at| at / self.block % 2 == odd);
        let (mut matrix, mut right) = (vec![0.0; count * count], vec![0.0; count]);
        for at in blocks(0) {
            let row = row(at);
            for (i, x) in row.iter().enumerate() {
                right[i] += x * velocity[at];
                row.iter().enumerate().for_each(|(j, y)| matrix[i * count + j] += x * y);
            }
        }
        let largest = (0..count).map(|i| matrix[i * count + i]).fold(0.0, f64::max);
        (0..count).for_each(|i| matrix[i * count + i] += RIDGE * largest);
        let mut solution = vec![0.0; count];
        solve_symmetric(count, &matrix, &right, &mut solution, &mut Workspace::new()).ok()?;
        Some(rms(blocks(1).map(|at| velocity[at] - dot(&row(at), &solution))))
    }
}

/// Number of monomials of so many variables up to a degree.
fn terms(variables: usize, degree: usize) -> usize {
    (1..=degree).fold(1, |product, k| product * (variables + k) / k)
}

/// All monomials of some variables up to a degree.
fn monomials(x: &[f64], degree: usize) -> Vec<f64> {
    let mut all = vec![1.0];
    // Those of the last degree with the last of their variables, from which on others join them: each comes once.
    let mut last = vec![(0, 1.0)];
    for _ in 0..degree {
        last = last.iter().flat_map(|&(from, value)| (from..x.len()).map(move |k| (k, value * x[k]))).collect();
        all.extend(last.iter().map(|(_, value)| value));
    }
    all
}

/// Motion of first order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FirstOrder {
    /// Other quantities from which, with the positions, the velocities follow.
    pub from: Vec<String>,
    /// Largest residual of a velocity, over its spread.
    pub residual: f64,
}

impl FirstOrder {
    /// Whether the velocities follow, to within their errors, from the positions and the inputs of a recording, and not from the positions alone.
    ///
    /// A polynomial of both is fitted to one half of the motion and tried on the other half. Motion that repeats itself under one tone looks alike.
    pub(super) fn of(reading: &LoadedRecording, smoothing: &Smoothing) -> Option<Self> {
        let (recording, n, inputs) = (&reading.recording, reading.recording.n(), &reading.columns.input);
        if inputs.is_empty() || reading.inputs.len() != recording.tracks.len() || recording.is_driven() {
            return None;
        }
        let states = States::of(reading, inputs.len(), smoothing);
        let positions: Vec<usize> = (0..n).collect();
        let others: Vec<usize> = (n..n + inputs.len()).filter(|&k| states.is_other(k)).collect();
        let all = [positions.as_slice(), &others].concat();
        let (mut matter, mut residual) = (false, 0f64);
        for i in 0..n {
            let (error, spread) = (rms(states.errors[i].iter().copied()), deviation(states.velocities[i].iter()));
            let (with, without) = (states.residual(i, &all)?, states.residual(i, &positions)?);
            if with > (AT_ERROR * error).max(MISSED * spread).min(OF_SPREAD * spread) {
                return None;
            }
            matter |= without > WITHOUT * with;
            residual = residual.max(with / spread);
        }
        let from = others.iter().map(|k| inputs[k - n].clone()).collect();
        matter.then_some(Self { from, residual })
    }

    /// The warning.
    pub(super) fn text(&self) -> String {
        format!(
            "the velocities follow from the positions and {} to within {} of their spread: motion of first order, as of \
             tanks and circuits, has no Lagrangian with a kinetic energy. Motion under a single tone looks alike: record \
             it under others",
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
        // Without the other quantity nothing can be said.
        let unknown = LoadedRecording::from(recorded(tanks, [3.0, 2.0, 0.0, 0.0], 1e-3).recording);
        assert_eq!(first_order(&unknown), None);
    }
}

//! Means of force equations over neighbouring states. States are processed in order, so that only a window of them is stored.

use super::smoothed::States;
use std::collections::VecDeque;

/// Moving sums over a row and `half` rows on either side.
struct Sums {
    half: usize,
    /// The rows of the window, and their sum.
    rows: VecDeque<Vec<f64>>,
    sum: Vec<f64>,
    steps: usize,
}

impl Sums {
    fn new(half: usize, size: usize) -> Self {
        Self { half, rows: VecDeque::new(), sum: vec![0.0; size], steps: 0 }
    }

    /// Adds a row, or none after the last one, and emits the sum around the row `half` rows earlier.
    fn step(&mut self, row: Option<&[f64]>, mut emit: impl FnMut(&[f64])) {
        let mut place = Vec::new();
        if let Some(row) = row {
            self.sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
        }
        if self.steps > 2 * self.half {
            place = self.rows.pop_front().unwrap_or_default();
            self.sum.iter_mut().zip(&place).for_each(|(sum, x)| *sum -= x);
        }
        if let Some(row) = row {
            place.clear();
            place.extend_from_slice(row);
            self.rows.push_back(place);
        }
        if self.steps >= self.half {
            emit(&self.sum);
        }
        self.steps += 1;
    }

    /// Emits the sums around the last rows, and starts over.
    fn finish(&mut self, mut emit: impl FnMut(&[f64])) {
        (0..self.half).for_each(|_| self.step(None, &mut emit));
        self.rows.clear();
        self.sum.fill(0.0);
        self.steps = 0;
    }
}

/// Weighted means of equations over neighbouring states of every trajectory.
///
/// The true constants satisfy averages of equations, forces included, as they satisfy each equation. Averaging removes the noise of the
/// accelerations from the regressors before these are squared, so that it hardly biases least squares, and the smoothing polynomials can have a
/// higher degree. Robots are identified this way ("parallel filtering", Gautier, IEEE ICRA 1997). Sums are taken twice, so that the weights form a
/// triangle.
pub(super) struct Averages<'a> {
    states: &'a States,
    /// Number of equations of a state.
    n: usize,
    sums: [Sums; 2],
    /// The numbers of a state, then the weights of its equations.
    row: Vec<f64>,
    mean: Vec<f64>,
    /// Marks the equations that are not finite, starting with the next state to be emitted.
    failed: VecDeque<bool>,
    /// Number of states that were processed.
    received: usize,
}

impl<'a> Averages<'a> {
    /// Creates averages for states with `n` equations of `width` numbers each.
    pub fn new(states: &'a States, (n, width): (usize, usize)) -> Self {
        let size = n * (width + 1);
        let sums = [(); 2].map(|()| Sums::new(states.averaged, size));
        Self { states, n, sums, row: vec![0.0; size], mean: vec![0.0; n * width], failed: VecDeque::new(), received: 0 }
    }

    /// Adds the numbers of the next state, `(n, width)`, and emits the means of states whose windows are complete, in order.
    pub fn take(&mut self, values: &[f64], mut emit: impl FnMut(&[f64])) {
        if self.states.averaged == 0 {
            return emit(values);
        }
        let (n, width, states) = (self.n, values.len() / self.n, self.states);
        let (numbers, weights) = self.row.split_at_mut(values.len());
        for (i, (own, given)) in numbers.chunks_exact_mut(width).zip(values.chunks_exact(width)).enumerate() {
            let finite = given.iter().all(|x| x.is_finite());
            weights[i] = if finite { states.share.get(self.received * n + i).copied().unwrap_or(1.0) } else { 0.0 };
            own.iter_mut().zip(given).for_each(|(own, x)| *own = if finite { x * weights[i] } else { 0.0 });
            self.failed.push_back(!finite);
        }
        let [first, second] = &mut self.sums;
        let (failed, mean) = (&mut self.failed, &mut self.mean);
        let mut divide = |sum: &[f64]| {
            let (numbers, weights) = sum.split_at(n * width);
            for (i, weight) in weights.iter().enumerate() {
                let range = i * width..(i + 1) * width;
                let (own, sums) = (&mut mean[range.clone()], &numbers[range]);
                match failed.pop_front() {
                    Some(true) => own.fill(f64::NAN),
                    _ if *weight > 0.0 => own.iter_mut().zip(sums).for_each(|(own, x)| *own = x / weight),
                    _ => own.fill(0.0),
                }
            }
            emit(mean);
        };
        first.step(Some(&self.row), |sum| second.step(Some(sum), &mut divide));
        let (current, next) = (states.places[self.received], states.places.get(self.received + 1));
        if next.is_none_or(|next| next.0 != current.0 || next.1 > current.1 + states.stride) {
            first.finish(|sum| second.step(Some(sum), &mut divide));
            second.finish(&mut divide);
        }
        self.received += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_averaged_along_their_trajectory_by_their_weights() {
        // Two trajectories, the second with a sample missing between its parts; one equation has a weight of 0, one is not finite.
        let places: Vec<(usize, usize)> =
            (0..9).map(|k| (0, k)).chain((0..4).map(|k| (1, k))).chain((5..9).map(|k| (1, k))).collect();
        let mut states = States { places, stride: 1, averaged: 1, share: vec![1.0; 17], ..States::default() };
        states.share[2] = 0.0;
        let given: Vec<f64> = (0..34).map(|k| f64::from(k * k % 11)).collect();
        let mut rows = given.clone();
        rows[2 * 15] = f64::NAN;
        let (mut averages, mut found) = (Averages::new(&states, (1, 2)), Vec::new());
        rows.chunks_exact(2).for_each(|row| averages.take(row, |mean| found.extend_from_slice(mean)));
        assert_eq!(found.len(), given.len());
        let runs = [0..9, 9..13, 13..17];
        for (at, row) in found.chunks_exact(2).enumerate() {
            let run = runs.iter().find(|run| run.contains(&at)).unwrap();
            let near = |k: &usize| run.contains(k) && *k != 2 && *k != 15;
            let weight = |k: usize| [3.0, 2.0, 1.0, 0.0][k.abs_diff(at).min(3)];
            // At the ends a first average of two counts once more.
            let twice = |k: usize| {
                let inner = at.saturating_sub(1).max(run.start)..(at + 2).min(run.end);
                inner.filter(|middle| middle.abs_diff(k) <= 1).count() as f64
            };
            let all = || (0..17).filter(near);
            let mean = all().map(|k| twice(k) * given[2 * k + 1]).sum::<f64>() / all().map(twice).sum::<f64>();
            match at {
                15 => assert!(row[0].is_nan() && row[1].is_nan()),
                _ => assert!((row[1] - mean).abs() < 1e-12, "{at}: {row:?} {mean}"),
            }
            if at == 6 {
                assert!((4..9).all(|k| twice(k) == weight(k)));
            }
        }
    }
}

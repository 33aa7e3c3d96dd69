//! Finite moves along open directions. They confirm which combinations of unknowns are determined, and return undetermined unknowns to their
//! starting values.

use super::descent::hold_fixed;
use super::determined::{Determined, OpenDirection};
use super::invariants::{Invariant, Kind, products, sums};
use super::linear::{inverse_with, times};
use super::solve::{Normal, Problem};
use super::thresholds::{
    CONFIRMING_FACTOR, EQUAL_FIT_INCREASE, MOVED_DECREMENT, MOVED_HALVINGS, MOVED_ITERATIONS, RIDGE,
};
use crate::lagrangian::system::Range;
use crate::linalg::dot;

/// Moves away from a fit.
pub(super) struct Moves<'a> {
    pub problem: &'a Problem<'a>,
    pub determined: &'a Determined,
    /// Variance of the residuals.
    pub variance: f64,
    /// Gives the normal equations at other unknowns, with the initial states fitted.
    pub normal_at: &'a dyn Fn(&[f64]) -> Option<Normal>,
}

/// A group of open directions and the combinations that they leave unchanged.
pub(super) struct Group<'a> {
    pub columns: Vec<&'a OpenDirection>,
    /// Unknowns that a direction changes.
    pub inside: Vec<usize>,
    pub kind: Kind,
    pub invariants: Vec<Invariant>,
    /// Points along the directions that fit the motion equally well.
    pub points: Vec<Vec<f64>>,
}

impl<'a> Group<'a> {
    /// Directions without invariants.
    pub fn without_invariants(columns: Vec<&'a OpenDirection>) -> Self {
        let m = columns.first().map_or(0, |column| column.change.len());
        let inside = (0..m).filter(|&k| columns.iter().any(|column| column.change[k] != 0.0)).collect();
        Self { columns, inside, kind: Kind::Product, invariants: Vec::new(), points: Vec::new() }
    }

    /// `true` if every determined combination is among the invariants.
    pub fn is_complete(&self) -> bool {
        self.invariants.len() + self.columns.len() == self.inside.len()
    }

    /// The directions at a point that was reached by moving along them.
    pub fn changes_at(&self, x: &[f64], moved: &[f64]) -> Vec<Vec<f64>> {
        let transported = |column: &&OpenDirection| {
            let parts = column.change.iter().zip(x.iter().zip(moved));
            let part = |(change, (x, moved)): (&f64, (&f64, &f64))| match self.kind {
                Kind::Product if *x != 0.0 => change * moved / x,
                _ => *change,
            };
            parts.map(part).collect()
        };
        self.columns.iter().map(transported).collect()
    }
}

impl<'a> Moves<'a> {
    /// Fits the unknowns again, with the pivots and the unknowns without effect held fixed; returns the sum of squares in units of the variance.
    pub fn refit(&self, mut x: Vec<f64>) -> Option<(Vec<f64>, f64)> {
        let m = x.len();
        let held = |k: usize| {
            self.determined.without_effect.contains(&k) || self.determined.open.iter().any(|column| column.pivot == k)
        };
        let held: Vec<bool> = (0..m).map(held).collect();
        let normal_at = |x: &[f64]| (self.normal_at)(x).filter(|n| n.failed == 0 && n.square.is_finite());
        let mut best = normal_at(&x)?;
        for _ in 0..MOVED_ITERATIONS {
            if self.problem.cancellation.is_cancelled() {
                return None;
            }
            let (mut matrix, mut right) = (best.matrix.clone(), best.right.clone());
            hold_fixed(&held, &mut matrix, &mut right);
            let mut change = times(m, &inverse_with(m, &matrix, RIDGE)?, &right);
            if dot(&change, &right) < MOVED_DECREMENT * self.variance {
                break;
            }
            let mut better = None;
            for _ in 0..MOVED_HALVINGS {
                let moved = self.problem.stepped(&x, &change, &best);
                better = normal_at(&moved).filter(|tried| tried.square < best.square).map(|tried| (moved, tried));
                if better.is_some() {
                    break;
                }
                change.iter_mut().for_each(|x| *x /= 2.0);
            }
            let Some(better) = better else { break };
            (x, best) = better;
        }
        Some((x, best.square / self.variance))
    }

    /// Groups of open directions with the invariants that finite moves confirm.
    pub fn groups(&self, x: &[f64]) -> Vec<Group<'a>> {
        let base = if self.determined.open.is_empty() { None } else { self.refit(x.to_vec()) };
        let of = |places: Vec<usize>| {
            let mut best = Group::without_invariants(places.iter().map(|&at| &self.determined.open[at]).collect());
            let Some((x, square)) = &base else { return best };
            for kind in [Kind::Product, Kind::Sum] {
                if best.is_complete() {
                    break;
                }
                let (invariants, points) = self.confirmed((x, *square), &best, kind);
                if invariants.len() > best.invariants.len() {
                    best = Group { kind, invariants, points, ..best };
                }
            }
            best
        };
        self.determined.groups().into_iter().map(of).collect()
    }

    /// Invariants of one kind whose values stay within their standard errors when the pivots are moved and the other unknowns are fitted again, with
    /// the points that were reached.
    fn confirmed(&self, (x, square): (&[f64], f64), group: &Group<'_>, kind: Kind) -> (Vec<Invariant>, Vec<Vec<f64>>) {
        let mut candidates = match kind {
            Kind::Product => products(&group.columns, x, &group.inside),
            Kind::Sum => sums(&group.columns, &group.inside, x.len()),
        };
        let mut points = Vec::new();
        for moves in self.moves_of(x, &group.columns) {
            if candidates.is_empty() {
                break;
            }
            let moved = self.refit(along(x, &moves, kind));
            let Some((moved, _)) = moved.filter(|(_, after)| after - square < EQUAL_FIT_INCREASE) else {
                candidates.clear();
                break;
            };
            let stays = |known: &Invariant| {
                let error = self.determined.error_of(&known.gradient(x));
                (known.value(&moved) - known.value(x)).abs() <= error
            };
            candidates.retain(stays);
            points.push(moved);
        }
        (candidates, points)
    }

    /// The unknowns as close to their starting values as the determined sums and products allow.
    pub fn least_change(&self, x: &[f64], start: &[f64], groups: &[Group<'_>]) -> Vec<f64> {
        if self.determined.without_effect.is_empty() && self.determined.open.is_empty() {
            return x.to_vec();
        }
        let mut closest = x.to_vec();
        self.determined.without_effect.iter().for_each(|&k| closest[k] = start[k]);
        for group in groups.iter().filter(|group| group.is_complete()) {
            match group.kind {
                Kind::Product => nearest_product(&mut closest, start, group),
                Kind::Sum => {
                    let columns: Vec<&[f64]> = group.columns.iter().map(|column| &column.change[..]).collect();
                    nearest(&mut closest, start, &columns, &self.determined.size);
                }
            }
        }
        let closest = Some(closest).filter(|closest| self.is_in_range(closest)).and_then(|closest| self.refit(closest));
        closest.map_or_else(|| x.to_vec(), |(x, _)| x)
    }

    /// Moves along each direction, up and down, and along all together, with alternating signs, because an invariant of each single direction need
    /// not be one of all. A pivot far below its size is first raised to it.
    fn moves_of<'c>(&self, x: &[f64], columns: &[&'c OpenDirection]) -> Vec<Vec<(&'c OpenDirection, f64)>> {
        let factors = |column: &'c OpenDirection| {
            let far = self.determined.size[column.pivot] / x[column.pivot].abs();
            [(column, CONFIRMING_FACTOR.max(far.min(f64::MAX))), (column, CONFIRMING_FACTOR.recip())]
        };
        let alone = columns.iter().copied().flat_map(|column| factors(column).map(|one| vec![one]));
        let all =
            |first: usize| columns.iter().enumerate().map(|(at, column)| factors(column)[(at + first) % 2]).collect();
        alone.chain((0..2).filter(|_| columns.len() > 1).map(all)).collect()
    }

    fn is_in_range(&self, x: &[f64]) -> bool {
        self.problem.chosen.iter().zip(x).all(|(&k, &x)| match self.problem.ranges[k] {
            Range::Positive => x > 0.0,
            Range::AtLeastZero => x >= 0.0,
            Range::Any => true,
        })
    }
}

/// Unknowns moved along directions until each pivot has changed by a factor.
fn along(x: &[f64], moves: &[(&OpenDirection, f64)], kind: Kind) -> Vec<f64> {
    let mut moved = x.to_vec();
    for (column, factor) in moves {
        let (pivot, own) = (x[column.pivot], column.change[column.pivot]);
        for ((moved, &x), &change) in moved.iter_mut().zip(x).zip(&column.change) {
            match kind {
                Kind::Product if x != 0.0 => *moved *= factor.powf(change / x * pivot / own),
                Kind::Product => {}
                // The change is already as large as the size.
                Kind::Sum => *moved += (factor.min(CONFIRMING_FACTOR) - 1.0) * change,
            }
        }
    }
    moved
}

/// Moves `x` along directions to the point with the smallest change from `start`, in units of `size`.
pub(super) fn nearest(x: &mut [f64], start: &[f64], columns: &[&[f64]], size: &[f64]) {
    let count = columns.len();
    let scaled: Vec<Vec<f64>> =
        columns.iter().map(|column| column.iter().zip(size).map(|(x, size)| x / size).collect()).collect();
    let missing: Vec<f64> = x.iter().zip(start).zip(size).map(|((x, start), size)| (start - x) / size).collect();
    let gram: Vec<f64> = (0..count * count).map(|at| dot(&scaled[at / count], &scaled[at % count])).collect();
    let right: Vec<f64> = scaled.iter().map(|column| dot(column, &missing)).collect();
    let Some(inverse) = inverse_with(count, &gram, RIDGE) else { return };
    for (amount, column) in times(count, &inverse, &right).into_iter().zip(columns) {
        x.iter_mut().zip(*column).for_each(|(x, change)| *x += amount * change);
    }
}

/// The same along directions that leave products of powers unchanged, in logarithms.
fn nearest_product(x: &mut [f64], start: &[f64], group: &Group<'_>) {
    let exponents = |column: &OpenDirection| {
        let relative = |(change, x): (&f64, &f64)| if *change == 0.0 { 0.0 } else { change / x };
        column.change.iter().zip(x.iter()).map(relative).collect::<Vec<f64>>()
    };
    let columns: Vec<Vec<f64>> = group.columns.iter().map(|column| exponents(column)).collect();
    let ratio = |(x, start): (&f64, &f64)| if start / x > 0.0 { (start / x).ln() } else { 0.0 };
    let wanted: Vec<f64> = x.iter().zip(start).map(ratio).collect();
    let mut logarithms = vec![0.0; x.len()];
    let columns: Vec<&[f64]> = columns.iter().map(|column| &column[..]).collect();
    nearest(&mut logarithms, &wanted, &columns, &vec![1.0; x.len()]);
    x.iter_mut().zip(logarithms).for_each(|(x, logarithm)| *x *= logarithm.exp());
}

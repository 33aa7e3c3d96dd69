//! Backward elimination by the weak form, with refits and exchanges.

use super::thresholds::{
    CHOICE_TIE, MOST_ERROR_OVER_MEDIAN, MOST_EXCHANGED_TERMS, MOST_JUDGED_REMOVALS, MOST_REFITTED_TERMS, TRIED_CHANGES,
    WEAK_EXCHANGE_ROUNDS,
};
use super::weak::{Group, Normal, Windows};
use crate::cancellation::Cancellation;
use crate::identification::linear::{inverse, part, times};
use crate::linalg::dot;
use std::collections::BTreeMap;

/// A choice of terms.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Indices of the terms.
    pub set: Vec<usize>,
    /// Coefficients of all terms, 0 outside the set.
    pub coefficients: Vec<f64>,
    /// Mean squared error of accelerations on the training data.
    pub error: f64,
    /// The error on held-out data.
    pub held_out: f64,
}

/// Choices of terms by their number of terms.
#[derive(Default)]
pub(super) struct Path {
    /// The best choice of every size.
    pub best: BTreeMap<usize, Choice>,
    /// All terms in the order of removal, the last ones first.
    pub order: Vec<usize>,
    /// `false` if exchanges were stopped while they still improved choices.
    pub converged: bool,
}

impl Path {
    /// The choices of this path; its terms precede those of another one.
    pub fn before(mut self, other: Self) -> Self {
        self.order.extend(other.order.into_iter().filter(|k| !self.order.contains(k)).collect::<Vec<_>>());
        self
    }
}

/// A backward elimination.
struct Search<'a> {
    windows: &'a Windows,
    sigma: &'a [f64],
    complexity: &'a [f64],
    cancellation: &'a Cancellation,
    /// Windows that are used for training, and those that are held out.
    training: Vec<bool>,
    held_out: Vec<bool>,
}

/// Coefficients that solve normal equations, group by group: those of known forces, or those of the smallest error with a mass matrix of
/// constant size. With a joint size, the group with the larger errors would vanish.
fn solve(normal: &Normal, groups: &[Group]) -> Option<Vec<f64>> {
    let mut all = vec![0.0; normal.size.len()];
    for Group { places, share } in groups {
        let own = normal.of(places);
        let m = places.len();
        let mut x = times(m, &inverse(m, &own.matrix)?, own.target());
        if !own.driven() {
            let length = dot(&own.size, &x);
            x.iter_mut().for_each(|x| *x *= share / length);
        }
        places.iter().zip(x).for_each(|(&at, x)| all[at] = x);
    }
    all.iter().all(|x| x.is_finite()).then_some(all)
}

impl Normal {
    pub fn of(&self, places: &[usize]) -> Self {
        let m = self.size.len();
        let pick = |list: &[f64]| places.iter().map(|&k| list[k]).collect();
        Self { matrix: part(m, &self.matrix, places), right: pick(&self.right), size: pick(&self.size) }
    }

    /// `true` if known forces determine the size.
    fn driven(&self) -> bool {
        self.right.iter().any(|x| *x != 0.0)
    }

    /// Condition that determines the coefficients: the forces, or a size.
    fn target(&self) -> &[f64] {
        if self.driven() { &self.right } else { &self.size }
    }

    /// The smallest possible error, without the part that no choice changes.
    fn least(&self, groups: &[Group]) -> Option<f64> {
        let of = |Group { places, share }: &Group| {
            let own = self.of(places);
            let m = places.len();
            let gain = dot(own.target(), &times(m, &inverse(m, &own.matrix)?, own.target()));
            Some(if own.driven() { -gain } else { share * share / gain })
        };
        groups.iter().map(of).sum()
    }

    /// First-order cost of removing each term.
    pub fn costs(&self, groups: &[Group]) -> Option<Vec<f64>> {
        let mut costs = vec![0.0; self.size.len()];
        for Group { places, share } in groups {
            let own = self.of(places);
            let m = places.len();
            let inverse = inverse(m, &own.matrix)?;
            let x = times(m, &inverse, own.target());
            let total = dot(own.target(), &x);
            for (k, &place) in places.iter().enumerate() {
                let gain = x[k] * x[k] / inverse[k * m + k];
                let without = (total - gain).max(1e-300 + 1e-14 * total);
                costs[place] = if own.driven() { gain } else { share * share * (1.0 / without - 1.0 / total) };
            }
        }
        Some(costs)
    }
}

/// Mean of the errors that are used.
pub(super) fn mean(errors: &[f64], used: &[bool]) -> f64 {
    let mut of: Vec<f64> = errors.iter().zip(used).filter(|(_, used)| **used).map(|(e, _)| *e).collect();
    if of.is_empty() {
        return f64::NAN;
    }
    of.sort_by(f64::total_cmp);
    // A single window next to a pole of the accelerations must not decide.
    let most = MOST_ERROR_OVER_MEDIAN * of[of.len() / 2];
    of.iter().map(|e| e.min(most)).sum::<f64>() / of.len() as f64
}

impl Search<'_> {
    fn spread(&self, set: &[usize], x: &[f64]) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.windows.terms];
        set.iter().zip(x).for_each(|(&k, x)| coefficients[k] = *x);
        coefficients
    }

    /// The choice of a set, refitted from previous coefficients; `None` if it does not move all coordinates.
    fn choice(&self, set: &[usize], start: &[f64], refits: usize) -> Option<Choice> {
        if !self.windows.moves_all(set) {
            return None;
        }
        let groups = self.windows.groups(set);
        let mut coefficients = start.to_vec();
        for _ in 0..refits {
            let normal = self.windows.normal(&coefficients, set, self.sigma, &self.training);
            coefficients = self.spread(set, &solve(&normal, &groups)?);
        }
        // A nearly singular mass matrix fits everything.
        if !self.windows.is_regular(&coefficients) {
            return None;
        }
        self.judged(set.to_vec(), coefficients)
    }

    /// Coefficients moved towards others as far as the mass matrix stays regular.
    fn kept_regular(&self, from: &[f64], to: Vec<f64>) -> Vec<f64> {
        let between = |share: f64| from.iter().zip(&to).map(|(a, b)| a + share * (b - a)).collect::<Vec<f64>>();
        let regular = [1.0, 0.5, 0.25, 0.1].map(between).into_iter().find(|x| self.windows.is_regular(x));
        regular.unwrap_or_else(|| from.to_vec())
    }

    fn judged(&self, set: Vec<usize>, coefficients: Vec<f64>) -> Option<Choice> {
        let errors = self.windows.errors(&coefficients, self.sigma);
        let (error, held_out) = (mean(&errors, &self.training), mean(&errors, &self.held_out));
        error.is_finite().then_some(Choice { set, coefficients, error, held_out })
    }

    /// The best choice with one term fewer.
    fn shorter(&self, from: &Choice) -> Option<Choice> {
        let normal = self.windows.normal(&from.coefficients, &from.set, self.sigma, &self.training);
        let costs = normal.costs(&self.windows.groups(&from.set))?;
        let mut order: Vec<usize> = (0..costs.len()).collect();
        order.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
        let refits = if from.set.len() <= MOST_REFITTED_TERMS { 2 } else { 0 };
        let tries = order.iter().take(TRIED_CHANGES).filter_map(|&gone| {
            let places: Vec<usize> = (0..from.set.len()).filter(|&k| k != gone).collect();
            let set: Vec<usize> = places.iter().map(|&k| from.set[k]).collect();
            if !self.windows.moves_all(&set) {
                return None;
            }
            let x = solve(&normal.of(&places), &self.windows.groups(&set))?;
            self.choice(&set, &self.spread(&set, &x), refits).map(|choice| (gone, choice))
        });
        let tries: Vec<(usize, Choice)> = tries.collect();
        let least = tries.iter().map(|(_, choice)| choice.error).fold(f64::INFINITY, f64::min);
        // Of equally good terms the most complex one is removed.
        let equal = tries.into_iter().filter(|(_, choice)| choice.error <= least * (1.0 + CHOICE_TIE));
        let involved = |gone: usize| self.complexity[from.set[gone]];
        equal.max_by(|a, b| involved(a.0).total_cmp(&involved(b.0))).map(|(_, choice)| choice)
    }

    /// Choices with one more term, for the most promising terms.
    fn longer(&self, from: &Choice, all: &[usize]) -> Vec<Choice> {
        let normal = self.windows.normal(&from.coefficients, all, self.sigma, &self.training);
        let own: Vec<usize> = (0..all.len()).filter(|&k| from.set.contains(&all[k])).collect();
        let mut gains: Vec<(f64, usize)> = (0..all.len())
            .filter(|k| !own.contains(k))
            .filter_map(|k| {
                let mut places = own.clone();
                places.push(k);
                let set: Vec<usize> = places.iter().map(|&k| all[k]).collect();
                normal.of(&places).least(&self.windows.groups(&set)).map(|value| (value, k))
            })
            .collect();
        gains.sort_by(|a, b| a.0.total_cmp(&b.0));
        let longer = gains.iter().take(TRIED_CHANGES).filter_map(|&(_, k)| {
            let mut set = from.set.clone();
            set.push(all[k]);
            set.sort_unstable();
            self.choice(&set, &from.coefficients, 2)
        });
        longer.collect()
    }
}

/// Removes terms from a set one after the other, down to one per coordinate or fewer, then exchanges terms while that improves the choices.
///
/// `start` holds coefficients with a regular mass matrix, `sigma` the unit of the errors of accelerations; `held_out` is `true` for blocks that
/// are used for validation alone. The result is meaningless after a cancellation.
pub(super) fn eliminate_backward(
    windows: &Windows,
    (all, start): (&[usize], &[f64]),
    (sigma, complexity): (&[f64], &[f64]),
    held_out: &dyn Fn(usize) -> bool,
    cancellation: &Cancellation,
) -> Path {
    let held_out: Vec<bool> = windows.blocks.iter().map(|&block| held_out(block)).collect();
    let training: Vec<bool> = held_out.iter().map(|held| !held).collect();
    let search = Search { windows, sigma, complexity, cancellation, training, held_out };
    let mut set = all.to_vec();
    let mut coefficients = search.refitted(&set, start.to_vec());
    let mut order = Vec::new();
    search.remove_many(&mut set, &mut coefficients, &mut order);
    let mut best = search.remove_singly(&set, &coefficients, &mut order);
    order.reverse();
    let converged = search.exchange(&mut best, all);
    Path { best, order, converged }
}

impl Search<'_> {
    /// Coefficients of a set after a few refits.
    fn refitted(&self, set: &[usize], mut coefficients: Vec<f64>) -> Vec<f64> {
        for _ in 0..3 {
            let normal = self.windows.normal(&coefficients, set, self.sigma, &self.training);
            if let Some(x) = solve(&normal, &self.windows.groups(set)) {
                coefficients = self.kept_regular(&coefficients, self.spread(set, &x));
            }
        }
        coefficients
    }

    /// Removes at most a tenth of the terms at a time, those of the smallest costs at fixed mass matrices, while there are many; appends them to
    /// `order`.
    fn remove_many(&self, set: &mut Vec<usize>, coefficients: &mut Vec<f64>, order: &mut Vec<usize>) {
        while set.len() > MOST_JUDGED_REMOVALS && self.cancellation.go_on() {
            let normal = self.windows.normal(coefficients, set, self.sigma, &self.training);
            let mut places: Vec<usize> = (0..set.len()).collect();
            let goal = (set.len() * 9 / 10).max(MOST_JUDGED_REMOVALS);
            while places.len() > goal && self.cancellation.go_on() {
                let left: Vec<usize> = places.iter().map(|&k| set[k]).collect();
                let Some(costs) = normal.of(&places).costs(&self.windows.groups(&left)) else { break };
                let gone = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
                let kept: Vec<usize> = (0..places.len()).filter(|&k| k != gone).map(|k| set[places[k]]).collect();
                if !self.windows.moves_all(&kept) {
                    break;
                }
                order.push(set[places.remove(gone)]);
            }
            if places.len() == set.len() {
                break;
            }
            let left: Vec<usize> = places.iter().map(|&k| set[k]).collect();
            let Some(x) = solve(&normal.of(&places), &self.windows.groups(&left)) else { break };
            let before = self.spread(&left, &left.iter().map(|&k| coefficients[k]).collect::<Vec<_>>());
            *coefficients = self.kept_regular(&before, self.spread(&left, &x));
            *set = left;
        }
    }

    /// The best choice of every size, removing one term after the other; appends them to `order`.
    fn remove_singly(&self, set: &[usize], coefficients: &[f64], order: &mut Vec<usize>) -> BTreeMap<usize, Choice> {
        let mut best: BTreeMap<usize, Choice> = BTreeMap::new();
        let mut choice = self.choice(set, coefficients, 0);
        while let Some(found) = choice {
            choice = if found.set.len() > 1 && self.cancellation.go_on() { self.shorter(&found) } else { None };
            if let Some(next) = &choice {
                order.extend(found.set.iter().filter(|k| !next.set.contains(k)));
            } else {
                order.extend(&found.set);
            }
            best.insert(found.set.len(), found);
        }
        best
    }

    /// Improves short choices by adding a term and removing one; `false` if it is stopped before that has converged.
    fn exchange(&self, best: &mut BTreeMap<usize, Choice>, all: &[usize]) -> bool {
        for _ in 0..WEAK_EXCHANGE_ROUNDS {
            let mut changed = false;
            let sizes: Vec<usize> = best.keys().copied().filter(|size| *size <= MOST_EXCHANGED_TERMS).collect();
            for size in sizes.into_iter().take_while(|_| self.cancellation.go_on()) {
                let Some(from) = best.get(&size).cloned() else { continue };
                for longer in self.longer(&from, all) {
                    if let Some(shorter) = self.shorter(&longer) {
                        changed |= improve(best, shorter);
                    }
                    changed |= improve(best, longer);
                }
            }
            if !changed {
                return true;
            }
        }
        false
    }
}

/// Stores a choice if it is better than the current choice of the same size.
fn improve(best: &mut BTreeMap<usize, Choice>, choice: Choice) -> bool {
    let known = best.get(&choice.set.len()).map_or(f64::INFINITY, |known| known.error);
    let better = choice.error < known * (1.0 - CHOICE_TIE);
    if better {
        best.insert(choice.set.len(), choice);
    }
    better
}

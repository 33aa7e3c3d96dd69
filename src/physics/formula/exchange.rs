//! Exchanges of terms after convergence: one candidate replaces one to four terms of the formula.

use super::motion::{BlockSum, Model, inflation, total};
use super::search::Search;
use super::thresholds::{
    CHOICES_AFTER_EXCHANGE, EXCHANGE_ROUNDS, MOST_CHECKED_EXCHANGES, MOST_EXCHANGE_COST, MOST_EXCHANGE_SQUARE,
    MOST_EXCHANGES, MOST_REPLACED_TERMS, RIDGE, TERM_COST, USUAL_EXCHANGES,
};
use crate::identification::Segment;
use crate::identification::linear::{inverse_with, part, times};
use crate::linalg::dot;
use std::collections::BTreeMap;

/// Another choice of terms and its additional cost: the sum of squares over the noise variance, plus a threshold for every term.
#[derive(Clone, Debug)]
pub(super) struct Exchanged {
    pub model: Model,
    pub cost: f64,
}

impl Search<'_> {
    /// Exchanges terms while that improves the formula; returns the best choice that was not taken.
    pub fn exchange(
        &self,
        model: &mut Model,
        segments: &mut Vec<Segment>,
        blocks: &mut BTreeMap<usize, BlockSum>,
    ) -> Option<Exchanged> {
        let mut rival: Option<Exchanged> = None;
        for _ in (0..EXCHANGE_ROUNDS).take_while(|_| self.motion.data.cancellation.go_on()) {
            let Some((proposals, noise)) = self.proposals(model, segments, blocks) else { break };
            let before = self.motion.fit_initial_states(model, segments, 1).0;
            let mut best: Option<(Exchanged, Vec<Segment>)> = None;
            rival = None;
            for (at, proposal) in proposals.into_iter().enumerate() {
                let gained = best.as_ref().map_or(0.0, |(best, _)| best.cost.min(0.0));
                if at >= MOST_EXCHANGES || (at >= USUAL_EXCHANGES && proposal.cost >= gained) {
                    rival = Some(proposal);
                    break;
                }
                let mut tried = proposal.model;
                let mut starts = segments.clone();
                for rounds in [0, CHOICES_AFTER_EXCHANGE] {
                    // Tries all terms, then only those that are still needed after the exchange.
                    self.converge(&mut tried, &mut starts, rounds);
                    if tried.terms.len() == model.terms.len() && tried.terms.iter().all(|k| model.terms.contains(k)) {
                        break;
                    }
                    let square = self.motion.fit_initial_states(&tried, &mut starts, 1).0;
                    let longer = tried.terms.len() as f64 - model.terms.len() as f64;
                    let cost = (square - before) / noise + TERM_COST * longer;
                    let better = best.as_ref().is_none_or(|(best, _)| cost < best.cost);
                    if better && self.regular(model, (&tried.terms, &tried.coefficients)) {
                        best = Some((Exchanged { model: tried.clone(), cost }, starts.clone()));
                    }
                }
            }
            let Some((found, starts)) = best else { break };
            if found.cost >= 0.0 {
                if rival.as_ref().is_none_or(|rival| found.cost < rival.cost) {
                    rival = Some(found);
                }
                break;
            }
            tracing::debug!(cost = found.cost, terms = ?found.model.terms, "exchanged");
            rival = Some(Exchanged { model: model.clone(), cost: -found.cost });
            (*model, *segments) = (found.model, starts);
            *blocks = self.motion.blocks(model, &self.candidates, segments);
        }
        rival
    }

    /// Exchanges by the normal equations of all candidates, the cheapest first, and the noise variance.
    fn proposals(
        &self,
        model: &Model,
        segments: &[Segment],
        blocks: &BTreeMap<usize, BlockSum>,
    ) -> Option<(Vec<Exchanged>, f64)> {
        let m = self.candidates.len();
        let mut sum = total(blocks, &|_| 1.0);
        if sum.square > MOST_EXCHANGE_SQUARE * sum.count {
            return None;
        }
        self.motion.pin(model, &self.candidates, segments, &mut sum);
        let change = times(m, &inverse_with(m, &sum.matrix, RIDGE)?, &sum.right);
        let noise = inflation(blocks, &|_| 1.0, &sum, &change);
        let own = times(m, &sum.matrix, &self.model_over_candidates(model));
        let target: Vec<f64> = own.iter().zip(&sum.right).map(|(own, right)| own + right).collect();
        let set: Vec<usize> = (0..m).filter(|&k| model.terms.contains(&self.candidates[k])).collect();
        let pick = |set: &[usize]| set.iter().map(|&k| target[k]).collect::<Vec<f64>>();
        let gain = dot(
            &pick(&set),
            &times(set.len(), &inverse_with(set.len(), &part(m, &sum.matrix, &set), RIDGE)?, &pick(&set)),
        );
        let mut proposals = Vec::new();
        for more in (0..m).filter(|k| !set.contains(k)) {
            let longer = [&set[..], &[more]].concat();
            let size = longer.len();
            let Some(inverse) = inverse_with(size, &part(m, &sum.matrix, &longer), RIDGE) else { continue };
            let x = times(size, &inverse, &pick(&longer));
            let gained = dot(&x, &pick(&longer)) - gain;
            let most = gained + noise * (MOST_EXCHANGE_COST + (MOST_REPLACED_TERMS - 1) as f64 * TERM_COST);
            for (lost, gone) in removals(&inverse, &x, most) {
                let cost = (lost - gained) / noise + TERM_COST * (1.0 - gone.len() as f64);
                let column = |k: usize| gone.iter().map(|&g| inverse[k * size + g]).collect::<Vec<f64>>();
                let Some(pivot) = inverse_with(gone.len(), &part(size, &inverse, &gone), 0.0) else { continue };
                let away = times(gone.len(), &pivot, &gone.iter().map(|&g| x[g]).collect::<Vec<f64>>());
                let left: Vec<usize> = (0..size).filter(|k| !gone.contains(k)).collect();
                let terms: Vec<usize> = left.iter().map(|&k| self.candidates[longer[k]]).collect();
                let coefficients: Vec<f64> = left.iter().map(|&k| x[k] - dot(&column(k), &away)).collect();
                if cost < MOST_EXCHANGE_COST {
                    let model = Model { terms, coefficients, frequency: model.frequency };
                    proposals.push(Exchanged { model, cost });
                }
            }
        }
        proposals.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let regular = |tried: &Exchanged| self.regular(model, (&tried.model.terms, &tried.model.coefficients));
        Some((
            proposals.into_iter().take(MOST_CHECKED_EXCHANGES).filter(regular).take(MOST_EXCHANGES + 1).collect(),
            noise,
        ))
    }
}

/// One to four of all terms except the last whose joint loss is below `most`, with their costs.
fn removals(inverse: &[f64], x: &[f64], most: f64) -> Vec<(f64, Vec<usize>)> {
    let size = x.len();
    let lost = |gone: &[usize]| {
        let own: Vec<f64> = gone.iter().map(|&g| x[g]).collect();
        let pivot = inverse_with(gone.len(), &part(size, inverse, gone), 0.0)?;
        Some(dot(&own, &times(gone.len(), &pivot, &own)))
    };
    // Removing more terms never costs less than removing one of them.
    let mut found: Vec<(f64, Vec<usize>)> = Vec::new();
    let mut last: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..MOST_REPLACED_TERMS {
        let mut next = Vec::new();
        for gone in &last {
            let from = gone.last().map_or(0, |last| last + 1);
            for k in from..size - 1 {
                let tried = [&gone[..], &[k]].concat();
                if let Some(lost) = lost(&tried).filter(|lost| *lost < most) {
                    found.push((lost, tried.clone()));
                    next.push(tried);
                }
            }
        }
        last = next;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_that_another_one_stands_for_are_found() {
        // The third column is the sum of the first two.
        let matrix = [1.0, 0.0, 0.9, 0.0, 1.0, 0.9, 0.9, 0.9, 2.0].map(|x| x * 100.0);
        let inverse = inverse_with(3, &matrix, 0.0).unwrap();
        // y is the last one.
        let x = times(3, &inverse, &[90.0, 90.0, 200.0]);
        let found = removals(&inverse, &x, 1e-3);
        let sets: Vec<&[usize]> = found.iter().map(|(_, gone)| gone.as_slice()).collect();
        assert_eq!(sets, [&[0][..], &[1], &[0, 1]]);
    }
}

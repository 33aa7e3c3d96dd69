//! From combinations that vanish to formulas that a person reads.

use super::features::Features;
use super::pencil::{Moments, Pencil};
use super::{ConstraintKind, FoundConstraint, MotionSamples};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// A combination of this many times the variance of its noise still counts as vanishing.
const TAKEN: f64 = 4.0;
/// Deviation of the smallest combination that does not vanish over that of the largest that does, at least.
const LEAST_GAP: f64 = 2.5;
/// The same of a part of the data that was left out.
const HOLDS: f64 = 9.0;
/// A term may go if the ratio rises by no more than this over the number of independent samples.
const RISE: f64 = 30.0;
/// Shares of the largest weight below which terms are left out at a time.
const SHARES: [f64; 5] = [0.1, 0.03, 0.01, 3e-3, 1e-3];
/// Terms are left out one by one where there are at most so many.
const FEW: usize = 40;
/// Quantile of Student's distribution for 95 %, 7 degrees of freedom, as of eight parts.
const STUDENT: f64 = 2.365;

/// A combination that vanishes.
#[derive(Clone, Debug)]
pub struct Generator {
    /// Factors of all terms; the leading term has 1.
    pub weights: Vec<f64>,
    lead: usize,
    /// Half widths of their ranges.
    spread: Vec<f64>,
    /// `c.G c / c.N c`.
    ratio: f64,
    /// Whether it vanishes on every part of the data by what the others say.
    pub holds: bool,
}

/// The combinations of some terms that vanish.
pub struct Vanishing<'a> {
    features: &'a Features,
    moments: Moments,
    whole: Pencil,
    centred: bool,
    /// Samples whose errors are independent.
    independent: f64,
    terms: Vec<usize>,
    /// A basis of them, over the terms.
    rows: Vec<Vec<f64>>,
    /// Size of the step between what vanishes and what does not.
    pub gap: Option<f64>,
}

impl<'a> Vanishing<'a> {
    /// Looks for combinations that vanish, or `centred`, that are constant along each trajectory; of `shared` samples the errors are as
    /// one.
    pub fn of(samples: &MotionSamples, features: &'a Features, centred: bool, shared: f64) -> Self {
        let p = features.len();
        let moments = Moments::of(samples, features, if p > 300 { 4 } else { 8 });
        // Every constant is constant.
        let terms: Vec<usize> = (0..p).filter(|&term| !(centred && features.is_constant(term))).collect();
        let whole = moments.pencil(centred, |_| true);
        let (ratios, combinations) = whole.on(&terms).solve();
        let count = ratios.iter().filter(|ratio| **ratio <= TAKEN).count();
        let largest = if count > 0 { ratios[count - 1].max(1.0) } else { 1.0 };
        let gap = ratios.get(count).map(|next| (next / largest).sqrt());
        let count = if gap.is_some_and(|gap| gap < LEAST_GAP) { 0 } else { count };
        let rows = combinations.chunks_exact(terms.len()).take(count).map(<[f64]>::to_vec).collect();
        Self { features, moments, whole, centred, independent: samples.len() as f64 / shared, terms, rows, gap }
    }

    /// As many as there are, none of which follows from the others, simple ones first, each with the terms that it needs. Another `form`
    /// than 0 prefers other terms.
    pub fn generators(&self, form: u64) -> Vec<Generator> {
        let mut rows = self.rows.clone();
        let mut rng = ChaCha8Rng::seed_from_u64(form);
        let preference: Vec<f64> =
            self.terms.iter().map(|_| if form == 0 { 1.0 } else { rng.random_range(-3.0..0.0f64).exp() }).collect();
        let pivots = reduce(&mut rows, &preference);
        let mut found: Vec<Generator> = rows
            .iter()
            .zip(&pivots)
            .map(|(row, &own)| {
                let free = (0..self.terms.len()).filter(|k| *k == own || !pivots.contains(k));
                let support: Vec<(usize, f64)> = free.map(|k| (self.terms[k], row[k])).collect();
                let support = needed(&self.whole, support, self.independent);
                fitted(&self.moments, self.features, &support, self.centred)
            })
            .collect();
        found.sort_by_key(|generator| (generator.degree(self.features), generator.terms().count()));
        found
    }
}

/// Reduced row echelon form with the largest pivots, times the preference of their columns; returns the column of each row's pivot.
fn reduce(rows: &mut [Vec<f64>], preference: &[f64]) -> Vec<usize> {
    let mut pivots = vec![usize::MAX; rows.len()];
    for _ in 0..rows.len() {
        let mut best = (0.0, 0, 0);
        for (r, row) in rows.iter().enumerate().filter(|(r, _)| pivots[*r] == usize::MAX) {
            for (c, (x, preference)) in row.iter().zip(preference).enumerate() {
                if x.abs() * preference > best.0 {
                    best = (x.abs() * preference, r, c);
                }
            }
        }
        let (_, r, c) = best;
        if best.0 == 0.0 {
            break;
        }
        pivots[r] = c;
        let unit = rows[r][c].recip();
        rows[r].iter_mut().for_each(|x| *x *= unit);
        let pivot = rows[r].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(other, _)| *other != r) {
            let factor = row[c];
            row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    pivots
}

/// The smallest combination of some terms.
fn smallest(pencil: &Pencil, support: &[usize]) -> Option<(f64, Vec<f64>)> {
    let (ratios, combinations) = pencil.on(support).solve();
    Some((*ratios.first()?, combinations[..support.len()].to_vec()))
}

/// The terms that a combination needs.
fn needed(pencil: &Pencil, mut support: Vec<(usize, f64)>, independent: f64) -> Vec<usize> {
    let terms = |support: &[(usize, f64)]| support.iter().map(|(term, _)| *term).collect::<Vec<_>>();
    let all: Vec<f64> = support.iter().map(|(_, weight)| *weight).collect();
    let start = pencil.on(&terms(&support)).ratio(&all);
    let allowed = (start + RISE / independent * start.max(1.0)).min(TAKEN);
    let most = |support: &[(usize, f64)]| support.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
    let mut refit = |fewer: Vec<(usize, f64)>| -> Option<Vec<(usize, f64)>> {
        let (ratio, weights) = smallest(pencil, &terms(&fewer)).filter(|_| !fewer.is_empty())?;
        let kept = fewer.iter().zip(weights).map(|(&(term, _), weight)| (term, weight)).collect();
        (ratio <= allowed).then_some(kept)
    };
    for share in SHARES {
        let least = share * most(&support);
        let fewer: Vec<(usize, f64)> = support.iter().copied().filter(|(_, weight)| weight.abs() >= least).collect();
        if let Some(fitted) = refit(fewer) {
            support = fitted;
            break;
        }
    }
    if support.len() <= FEW {
        loop {
            support.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            match support.get(1..).map(<[_]>::to_vec).filter(|rest| !rest.is_empty()).and_then(&mut refit) {
                Some(fitted) => support = fitted,
                None => break,
            }
        }
    }
    let mut terms = terms(&support);
    terms.sort_unstable();
    terms
}

/// Factors of the needed terms with their ranges, by leaving parts of the data out (jackknife).
fn fitted(moments: &Moments, features: &Features, support: &[usize], centred: bool) -> Generator {
    let folds = moments.folds();
    let fit = |pencil: &Pencil| {
        let (ratio, scaled) = smallest(pencil, support)?;
        let raw: Vec<f64> = scaled.iter().zip(support).map(|(c, &term)| c / moments.scale[term]).collect();
        Some((ratio, scaled, raw))
    };
    let over = |raw: Vec<f64>, lead: usize| -> Vec<f64> { raw.iter().map(|c| c / raw[lead]).collect() };
    let mut generator = Generator {
        weights: vec![0.0; features.len()],
        lead: 0,
        spread: vec![0.0; features.len()],
        ratio: f64::INFINITY,
        holds: true,
    };
    let Some((ratio, _, raw)) = fit(&moments.pencil(centred, |_| true)) else { return generator };
    let lead = leading(features, support, &raw);
    let weights = over(raw, lead);
    (generator.ratio, generator.lead) = (ratio, support[lead]);
    let mut squares = vec![0.0; support.len()];
    for part in 0..folds {
        let Some((_, scaled, raw)) = fit(&moments.pencil(centred, |other| other != part)) else { continue };
        let left_out = moments.pencil(centred, |other| other == part).on(support);
        let others = over(raw, lead);
        generator.holds &= left_out.ratio(&scaled) <= HOLDS;
        squares.iter_mut().zip(others.iter().zip(&weights)).for_each(|(sum, (a, b))| *sum += (a - b) * (a - b));
    }
    for ((&term, weight), square) in support.iter().zip(weights).zip(squares) {
        generator.weights[term] = weight;
        generator.spread[term] = STUDENT * (square * (folds - 1) as f64 / folds as f64).sqrt();
    }
    generator
}

/// The term that has the factor 1: the first of the highest degree, unless another of that degree weighs more than three times as much.
fn leading(features: &Features, support: &[usize], raw: &[f64]) -> usize {
    let first = (0..support.len()).find(|&k| !features.is_constant(support[k])).unwrap_or(0);
    let same = (0..support.len()).filter(|&k| features.degree(support[k]) == features.degree(support[first]));
    let same = same.filter(|&k| features.moves(support[k]) == features.moves(support[first]));
    let heaviest = same.max_by(|&a, &b| raw[a].abs().total_cmp(&raw[b].abs())).unwrap_or(first);
    if raw[heaviest].abs() > 3.0 * raw[first].abs() { heaviest } else { first }
}

impl Generator {
    /// The terms that it has.
    pub fn terms(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.weights.len()).filter(|&term| self.weights[term] != 0.0)
    }

    /// The highest degree of its terms.
    pub fn degree(&self, features: &Features) -> i32 {
        self.terms().map(|term| features.degree(term)).max().unwrap_or(0)
    }

    /// In words.
    pub fn described(&self, features: &Features, kind: ConstraintKind) -> FoundConstraint {
        let (mut formula, mut coefficients, mut range) = (String::new(), BTreeMap::new(), BTreeMap::new());
        let others = self.terms().filter(|term| *term != self.lead);
        for term in [self.lead].into_iter().chain(others) {
            let weight = self.weights[term];
            let (text, spread) = (features.text(term).to_string(), self.spread[term]);
            coefficients.insert(text.clone(), weight);
            range.insert(text.clone(), [weight - spread, weight + spread]);
            let size = digits(weight.abs(), spread);
            let sign = match (formula.is_empty(), weight < 0.0) {
                (true, false) => "",
                (true, true) => "-",
                (false, false) => " + ",
                (false, true) => " - ",
            };
            formula += sign;
            formula += &match (features.is_constant(term), size.as_str()) {
                (true, _) => size,
                (false, "1") => text,
                (false, _) => format!("{size}*{text}"),
            };
        }
        FoundConstraint { kind, formula, coefficients, range, defect: self.ratio.sqrt() }
    }
}

/// A positive number with the digits that its spread leaves.
fn digits(value: f64, spread: f64) -> String {
    // Beyond this the data say nothing, whatever their scatter.
    let spread = spread.max(1e-11 * value);
    if spread == 0.0 {
        return value.to_string();
    }
    let decimals = (1.0 - spread.log10().floor()).clamp(0.0, 15.0) as usize;
    let text = format!("{value:.decimals$}");
    match (text.contains('.'), value) {
        (true, _) => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        _ => text,
    }
}

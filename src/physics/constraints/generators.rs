//! Reduces combinations that vanish to readable formulas.

use super::features::Features;
use super::pencil::{Moments, Pencil};
use super::thresholds::{
    HEAVIER_TERM, LEAST_GAP, LEAST_SPARSE_FACTOR, LOWER_DEGREE_PREFERENCE, MOST_HELD_OUT_RATIO, MOST_MULTIPLICATIONS,
    MOST_TERMS_IN_EIGHTHS, MOST_TERMS_REMOVED_SINGLY, MOST_VARIANCE_RATIO, NOISE_DEVIATIONS, REMOVAL_RISE,
    REMOVED_SHARES, REWEIGHTING_ROUNDS, STARTS_PER_TERM, UNDETERMINED_FACTOR,
};
use super::{ConstraintKind, FoundConstraint, MotionSamples};
use crate::cancellation::Cancellation;
use crate::linalg::{Workspace, dot, solve};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};

/// Quantile of Student's distribution for 95 % and 7 degrees of freedom, from eight parts of the data.
const STUDENT: f64 = 2.365;

/// Largest ratios of variances at which a combination vanishes, and at which it does so within the noise.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest ratio at which a combination counts as vanishing.
    pub taken: f64,
    /// Largest ratio at which only noise remains. The ratio of pure noise has the standard deviation `sqrt(2/N)`, where `N` is the number of
    /// samples with independent noise; the noise itself is known from differences to about `sqrt(6/N)`.
    pub within: f64,
}

impl Limits {
    /// Limits for functions of positions, or for rows with measured velocities.
    pub fn of(samples: &MotionSamples) -> Self {
        let (count, independent) = (samples.len().max(1) as f64, samples.independent().max(1.0));
        let scatter = (2.0 / independent + 6.0 / count).sqrt();
        Self {
            taken: MOST_VARIANCE_RATIO * samples.slack(),
            within: samples.slack() * (1.0 + NOISE_DEVIATIONS * scatter),
        }
    }

    /// Limits for rows with smoothed velocities, whose errors are less well known.
    pub fn of_smoothed() -> Self {
        Self { taken: MOST_VARIANCE_RATIO, within: MOST_VARIANCE_RATIO }
    }
}

/// A combination that vanishes.
#[derive(Clone, Debug)]
pub struct Generator {
    /// Factors of all terms; the leading term has 1.
    pub weights: Vec<f64>,
    lead: usize,
    /// Half-widths of the confidence intervals of the factors.
    spread: Vec<f64>,
    /// `c.G c / c.N c`.
    ratio: f64,
    /// Whether it vanishes on every part of the data when fitted to the other parts.
    pub holds: bool,
    /// Whether only noise remains.
    pub within: bool,
    /// Root mean square length of its gradient with respect to the coordinates.
    size: f64,
}

/// Terms with their factors.
type Combination = Vec<(usize, f64)>;

/// The combinations of terms that vanish, degree by degree. Multiples of combinations that already vanish are excluded: higher degrees omit
/// terms that their leading terms divide.
pub struct Vanishing<'a> {
    features: &'a Features,
    cancellation: &'a Cancellation,
    moments: Moments,
    whole: Pencil,
    centred: bool,
    /// Number of samples with independent errors.
    independent: f64,
    limits: Limits,
    levels: Vec<Level>,
    /// Leading terms of the combinations that vanish.
    leading: Vec<usize>,
}

/// Combinations of terms up to a degree that vanish.
struct Level {
    degree: i32,
    terms: Vec<usize>,
    /// A basis over the terms in reduced row echelon form, and the column of each row's pivot.
    rows: Vec<Vec<f64>>,
    pivots: Vec<usize>,
    /// Ratio between combinations that do not vanish and those that do.
    gap: Option<f64>,
}

impl<'a> Vanishing<'a> {
    /// Searches for combinations that vanish, in addition to `known` ones, or, if `centred`, that are constant along each trajectory; `shared`
    /// samples have one common error.
    pub fn of(
        samples: &'a MotionSamples,
        features: &'a Features,
        known: Option<&Vanishing<'_>>,
        centred: bool,
        (shared, limits): (f64, Limits),
    ) -> Self {
        let p = features.len();
        let moments = Moments::of(samples, features, if p > MOST_TERMS_IN_EIGHTHS { 4 } else { 8 });
        let whole = moments.pencil(centred, |_| true);
        let independent = samples.len() as f64 / shared;
        let (levels, leading) = (Vec::new(), Vec::new());
        let cancellation = &samples.cancellation;
        let mut found = Self { features, cancellation, moments, whole, centred, independent, limits, levels, leading };
        let highest = (0..p).map(|term| features.degree(term)).max().unwrap_or(0);
        // The product of a constant and another function is not constant, so centred functions have one level.
        let degrees = if centred { highest..=highest } else { 0..=highest };
        for degree in degrees.take_while(|_| cancellation.go_on()) {
            let left = |&term: &usize| {
                let follows =
                    || known.is_some_and(|known| known.divides(features, term)) || found.divides(features, term);
                // The constant term is trivially constant along trajectories.
                features.degree(term) <= degree && !(centred && features.is_constant(term)) && !follows()
            };
            let level = found.level((0..p).filter(left).collect(), degree);
            found.leading.extend(level.pivots.iter().filter_map(|&column| level.terms.get(column)));
            found.levels.push(level);
        }
        found
    }

    /// `true` if a term of these or of other features is a leading term times variables.
    fn divides(&self, features: &Features, term: usize) -> bool {
        self.leading.iter().any(|&lead| features.is_multiple(term, self.features, lead))
    }

    /// The combinations of some terms that vanish.
    fn level(&self, terms: Vec<usize>, degree: i32) -> Level {
        let (ratios, combinations) = self.whole.on(&terms).solve();
        let count = ratios.iter().filter(|ratio| **ratio <= self.limits.taken).count();
        let largest = if count > 0 { ratios[count - 1].max(1.0) } else { 1.0 };
        let gap = ratios.get(count).map(|next| (next / largest).sqrt());
        let count = if gap.is_some_and(|gap| gap < LEAST_GAP) { 0 } else { count };
        let mut rows: Vec<Vec<f64>> =
            combinations.chunks_exact(terms.len().max(1)).take(count).map(<[f64]>::to_vec).collect();
        let highest = |&term: &usize| {
            if self.centred || self.features.degree(term) == degree { 1.0 } else { LOWER_DEGREE_PREFERENCE }
        };
        let pivots = reduce(&mut rows, &terms.iter().map(highest).collect::<Vec<f64>>());
        Level { degree, terms, rows, pivots, gap }
    }

    /// Size of the smallest combination that does not vanish over that of the largest one that does. Of several degrees it is the smallest
    /// ratio; if no generator was taken, it is that of the highest degree.
    pub fn gap(&self, taken: &[Generator]) -> Option<f64> {
        let has = |degree| taken.iter().any(|generator| generator.degree(self.features) == degree);
        let gaps = self.levels.iter().filter(|level| has(level.degree)).filter_map(|level| level.gap);
        if taken.is_empty() { self.levels.last().and_then(|level| level.gap) } else { gaps.reduce(f64::min) }
    }

    /// Combinations reduced to the terms they need, simple ones first: an independent basis, and combinations of few terms. Also returns
    /// whether the search for those of few terms was complete.
    pub fn generators(&self) -> (Vec<Generator>, bool) {
        let mut supports: Vec<Vec<usize>> = Vec::new();
        for level in &self.levels {
            let combinations = level.basis().chain(level.sparse(self.cancellation));
            for support in combinations.take_while(|_| self.cancellation.go_on()) {
                let support = needed(&self.whole, support, self.independent, self.limits.taken);
                if !supports.contains(&support) {
                    supports.push(support);
                }
            }
        }
        let go_on = |_: &&Vec<usize>| self.cancellation.go_on();
        let fit = |support: &Vec<usize>| fitted(&self.moments, self.features, support, self.centred, self.limits);
        let mut found: Vec<Generator> =
            supports.iter().take_while(go_on).map(fit).filter(Generator::is_determined).collect();
        found.sort_by_key(|generator| (generator.degree(self.features), generator.terms().count()));
        (found, self.levels.iter().all(Level::is_searched))
    }
}

impl Level {
    /// Each row of the basis, reduced by the pivots of the others.
    fn basis(&self) -> impl Iterator<Item = Combination> + '_ {
        self.rows.iter().zip(&self.pivots).map(|(row, own)| {
            let free = (0..self.terms.len()).filter(|k| k == own || !self.pivots.contains(k));
            free.map(|k| (self.terms[k], row[k])).collect()
        })
    }

    /// Starts of the search for combinations of few terms, up to the requested number.
    fn starts(&self) -> [usize; 2] {
        let (size, count) = (self.rows.len(), self.terms.len());
        let once = REWEIGHTING_ROUNDS * size * size * (count + size);
        [(MOST_MULTIPLICATIONS / once.max(1)).min(STARTS_PER_TERM * count), STARTS_PER_TERM * count]
    }

    /// `true` if the search can use all requested starts.
    fn is_searched(&self) -> bool {
        let [taken, wanted] = self.starts();
        taken == wanted
    }

    /// Combinations of few terms in which one given term has the factor 1. They minimize `sum log |c_k|` by reweighted least squares, with
    /// weights `1 / (c_k^2 + eps^2)` from the previous factors (Candès, Wakin and Boyd 2008) and random weights at the start.
    fn sparse(&self, cancellation: &Cancellation) -> Vec<Combination> {
        let (size, count) = (self.rows.len(), self.terms.len());
        let (mut rng, mut workspace) = (ChaCha8Rng::seed_from_u64(0), Workspace::new());
        let (mut found, mut known) = (Vec::new(), BTreeSet::new());
        for lead in (0..count).cycle().take(self.starts()[0]).take_while(|_| cancellation.go_on()) {
            let column: Vec<f64> = self.rows.iter().map(|row| row[lead]).collect();
            let mut weights: Vec<f64> = (0..count).map(|_| rng.random_range(-6.0..0.0f64).exp()).collect();
            let mut factors = vec![0.0; count];
            for round in 1..=REWEIGHTING_ROUNDS {
                let weighted = |a: &[f64], b: &[f64]| -> f64 {
                    a.iter().zip(b).zip(&weights).map(|((a, b), weight)| weight * a * b).sum()
                };
                let products: Vec<f64> =
                    self.rows.iter().flat_map(|a| self.rows.iter().map(|b| weighted(a, b))).collect();
                let mut mix = vec![0.0; size];
                if solve(size, &products, &column, &mut mix, &mut workspace).is_err() {
                    break;
                }
                let unit = dot(&mix, &column).recip();
                factors.fill(0.0);
                for (row, share) in self.rows.iter().zip(&mix) {
                    factors.iter_mut().zip(row).for_each(|(c, x)| *c += unit * share * x);
                }
                let least = 0.25_f64.powi(round.min(5) as i32);
                weights = factors.iter().map(|c| (c * c + least * least).recip()).collect();
            }
            let support: Vec<usize> = (0..count).filter(|&k| factors[k].abs() > LEAST_SPARSE_FACTOR).collect();
            if factors.iter().all(|c| c.is_finite()) && !support.is_empty() && known.insert(support) {
                found.push(self.terms.iter().copied().zip(factors).collect());
            }
        }
        found
    }
}

/// Reduced row echelon form; pivots are the largest elements times the preference of their columns. Returns the column of each row's pivot.
pub fn reduce(rows: &mut [Vec<f64>], preference: &[f64]) -> Vec<usize> {
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

/// The combination of the given terms with the smallest ratio.
fn smallest(pencil: &Pencil, support: &[usize]) -> Option<(f64, Vec<f64>)> {
    let (ratios, combinations) = pencil.on(support).solve();
    Some((*ratios.first()?, combinations[..support.len()].to_vec()))
}

/// The terms that a combination needs.
fn needed(pencil: &Pencil, mut support: Combination, independent: f64, taken: f64) -> Vec<usize> {
    let terms = |support: &[(usize, f64)]| support.iter().map(|(term, _)| *term).collect::<Vec<_>>();
    let all: Vec<f64> = support.iter().map(|(_, weight)| *weight).collect();
    let start = pencil.on(&terms(&support)).ratio(&all);
    let allowed = (start + REMOVAL_RISE / independent * start.max(1.0)).min(taken);
    let most = |support: &[(usize, f64)]| support.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
    let mut refit = |fewer: Combination| -> Option<Combination> {
        let (ratio, weights) = smallest(pencil, &terms(&fewer)).filter(|_| !fewer.is_empty())?;
        let kept = fewer.iter().zip(weights).map(|(&(term, _), weight)| (term, weight)).collect();
        (ratio <= allowed).then_some(kept)
    };
    for share in REMOVED_SHARES {
        let least = share * most(&support);
        let fewer: Combination = support.iter().copied().filter(|(_, weight)| weight.abs() >= least).collect();
        if let Some(fitted) = refit(fewer) {
            support = fitted;
            break;
        }
    }
    if support.len() <= MOST_TERMS_REMOVED_SINGLY {
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

/// Factors of the needed terms with their confidence intervals, by leaving out parts of the data (jackknife).
fn fitted(moments: &Moments, features: &Features, support: &[usize], centred: bool, limits: Limits) -> Generator {
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
        within: false,
        size: 0.0,
    };
    let Some((ratio, _, raw)) = fit(&moments.pencil(centred, |_| true)) else { return generator };
    let lead = leading(features, support, &raw);
    let weights = over(raw, lead);
    (generator.ratio, generator.lead, generator.within) = (ratio, support[lead], ratio <= limits.within);
    let mut squares = vec![0.0; support.len()];
    for part in 0..folds {
        let Some((_, scaled, raw)) = fit(&moments.pencil(centred, |other| other != part)) else { continue };
        let left_out = moments.pencil(centred, |other| other == part).on(support);
        let others = over(raw, lead);
        generator.holds &= left_out.ratio(&scaled) <= MOST_HELD_OUT_RATIO * limits.taken / MOST_VARIANCE_RATIO;
        squares.iter_mut().zip(others.iter().zip(&weights)).for_each(|(sum, (a, b))| *sum += (a - b) * (a - b));
    }
    for ((&term, weight), square) in support.iter().zip(weights).zip(squares) {
        generator.weights[term] = weight;
        generator.spread[term] = STUDENT * (square * (folds - 1) as f64 / folds as f64).sqrt();
    }
    generator
}

/// The term that gets the factor 1: the first of the highest degree, unless another of that degree has more than three times its weight.
fn leading(features: &Features, support: &[usize], raw: &[f64]) -> usize {
    let first = (0..support.len()).find(|&k| !features.is_constant(support[k])).unwrap_or(0);
    let same = (0..support.len()).filter(|&k| features.degree(support[k]) == features.degree(support[first]));
    let same = same.filter(|&k| features.moves(support[k]) == features.moves(support[first]));
    let heaviest = same.max_by(|&a, &b| raw[a].abs().total_cmp(&raw[b].abs())).unwrap_or(first);
    if raw[heaviest].abs() > HEAVIER_TERM * raw[first].abs() { heaviest } else { first }
}

impl Generator {
    /// Terms with nonzero factors.
    pub fn terms(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.weights.len()).filter(|&term| self.weights[term] != 0.0)
    }

    /// Root mean square length of its gradient with respect to the coordinates, once computed.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Sets the length of its gradient from some samples.
    pub fn sized(self, samples: &MotionSamples, features: &Features, places: &[usize]) -> Self {
        let square = |&at: &usize| {
            let row = features.gradient(samples, at, &self.weights);
            dot(&row, &row)
        };
        let size = (places.iter().map(square).sum::<f64>() / places.len().max(1) as f64).sqrt();
        Self { size, ..self }
    }

    /// `false` if several combinations of the same terms vanish, so that parts of the data give different ones.
    fn is_determined(&self) -> bool {
        let most = self.weights.iter().fold(0.0, |most: f64, weight| most.max(weight.abs()));
        self.spread.iter().all(|spread| *spread < UNDETERMINED_FACTOR * most)
    }

    /// The highest degree of the terms.
    pub fn degree(&self, features: &Features) -> i32 {
        self.terms().map(|term| features.degree(term)).max().unwrap_or(0)
    }

    /// The combination as a formula.
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

/// A positive number with the digits that its spread justifies.
pub fn digits(value: f64, spread: f64) -> String {
    // Beyond this the data do not determine the number, whatever their scatter.
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

//! Terms of constraints: monomials of coordinates and of sines and cosines of angles, possibly times a velocity.

use super::MotionSamples;

/// A function of one coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Function {
    Plain,
    Sine,
    Cosine,
}

/// A product of powers of variables, and of a velocity.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Term {
    /// Variables with their powers, at least 1.
    powers: Vec<(usize, i32)>,
    velocity: Option<usize>,
}

impl Term {
    fn degree(&self) -> i32 {
        self.powers.iter().map(|(_, power)| power).sum()
    }
}

/// The terms, and the variables in them.
#[derive(Clone, Debug)]
pub struct Features {
    n: usize,
    /// Coordinate and function of each variable.
    variables: Vec<(usize, Function)>,
    terms: Vec<Term>,
    texts: Vec<String>,
}

impl Features {
    /// Monomials up to a degree of the coordinates that move, the constant last.
    pub fn of_positions(samples: &MotionSamples, degree: usize) -> Self {
        let mut features = Self::without_terms(samples);
        let monomials = features.monomials(degree);
        features.terms = monomials.into_iter().map(|powers| Term { powers, velocity: None }).collect();
        features.written(samples)
    }

    /// Velocities times monomials up to a degree of the coordinates that move, then these monomials alone.
    pub fn of_velocities(samples: &MotionSamples, degree: usize) -> Self {
        let mut features = Self::without_terms(samples);
        let monomials = features.monomials(degree);
        for velocity in (0..samples.n()).filter(|&i| samples.moves(i)).map(Some).chain([None]) {
            features.terms.extend(monomials.iter().map(|powers| Term { powers: powers.clone(), velocity }));
        }
        features.written(samples)
    }

    fn without_terms(samples: &MotionSamples) -> Self {
        let moving = samples.periodic().iter().enumerate().filter(|(i, _)| samples.moves(*i));
        let variables = moving.flat_map(|(i, &periodic)| {
            let functions: &[Function] =
                if periodic { &[Function::Sine, Function::Cosine] } else { &[Function::Plain] };
            functions.iter().map(move |&function| (i, function))
        });
        Self { n: samples.n(), variables: variables.collect(), terms: Vec::new(), texts: Vec::new() }
    }

    /// Powers of variables up to a total degree, higher degrees first; the square of a sine is not a separate term.
    fn monomials(&self, degree: usize) -> Vec<Vec<(usize, i32)>> {
        let mut all: Vec<Vec<(usize, i32)>> = vec![Vec::new()];
        let mut last = all.clone();
        for _ in 0..degree {
            let mut next = Vec::new();
            for powers in &last {
                let from = powers.last().map_or(0, |&(variable, _)| variable);
                for variable in from..self.variables.len() {
                    let mut longer = powers.clone();
                    match longer.last_mut() {
                        Some((same, power)) if *same == variable => *power += 1,
                        _ => longer.push((variable, 1)),
                    }
                    let twice = longer.iter().any(|&(k, power)| power > 1 && self.variables[k].1 == Function::Sine);
                    if !twice {
                        next.push(longer);
                    }
                }
                if all.len() + next.len() > 4 * super::MOST_TERMS {
                    break;
                }
            }
            all.extend(next.iter().cloned());
            last = next;
        }
        all.sort_by_key(|powers| -powers.iter().map(|(_, power)| power).sum::<i32>());
        all
    }

    fn written(mut self, samples: &MotionSamples) -> Self {
        let variable = |k: usize| {
            let (i, function) = self.variables[k];
            let name = &samples.names()[i];
            match function {
                Function::Plain => name.clone(),
                Function::Sine => format!("sin({name})"),
                Function::Cosine => format!("cos({name})"),
            }
        };
        let text = |term: &Term| {
            let powers = term.powers.iter().map(|&(k, power)| match power {
                1 => variable(k),
                _ => format!("{}^{power}", variable(k)),
            });
            let velocity = term.velocity.map(|i| format!("{}_dot", samples.names()[i]));
            let parts: Vec<String> = powers.chain(velocity).collect();
            if parts.is_empty() { "1".to_string() } else { parts.join("*") }
        };
        self.texts = self.terms.iter().map(text).collect();
        self
    }

    /// Number of terms.
    pub fn len(&self) -> usize {
        self.terms.len()
    }
    /// A term as text in a formula.
    pub fn text(&self, term: usize) -> &str {
        &self.texts[term]
    }
    /// Total degree of a term.
    pub fn degree(&self, term: usize) -> i32 {
        self.terms[term].degree()
    }
    /// `true` if a term is a multiple of one of the `others`, over the same variables.
    pub fn is_multiple(&self, term: usize, others: &Self, other: usize) -> bool {
        let (whole, factor) = (&self.terms[term], &others.terms[other]);
        let power = |variable: usize| whole.powers.iter().find(|(k, _)| *k == variable).map_or(0, |(_, power)| *power);
        factor.velocity.is_none_or(|_| factor.velocity == whole.velocity)
            && factor.powers.iter().all(|&(k, least)| power(k) >= least)
    }
    /// `true` for the constant.
    pub fn is_constant(&self, term: usize) -> bool {
        self.terms[term].powers.is_empty() && self.terms[term].velocity.is_none()
    }
    /// `true` for a term with a velocity.
    pub fn moves(&self, term: usize) -> bool {
        self.terms[term].velocity.is_some()
    }
    /// `true` if a combination of terms with velocities also contains a term without one.
    pub fn has_rate(&self, weights: &[f64]) -> bool {
        self.terms.iter().zip(weights).any(|(term, &weight)| term.velocity.is_none() && weight != 0.0)
    }

    /// Coordinates in the terms of a combination, possibly repeated.
    pub fn coordinates(&self, weights: &[f64]) -> impl Iterator<Item = usize> + '_ {
        let used: Vec<usize> = (0..self.terms.len()).filter(|&term| weights[term] != 0.0).collect();
        used.into_iter().flat_map(|term| self.terms[term].powers.iter().map(|&(k, _)| self.variables[k].0))
    }

    /// Values of the variables and their derivatives by their coordinates.
    fn variables(&self, state: &[f64]) -> Vec<(f64, f64)> {
        let value = |&(i, function): &(usize, Function)| match function {
            Function::Plain => (state[i], 1.0),
            Function::Sine => (state[i].sin(), state[i].cos()),
            Function::Cosine => (state[i].cos(), -state[i].sin()),
        };
        self.variables.iter().map(value).collect()
    }

    /// The product of powers of a term, and its derivative by one variable.
    fn product(term: &Term, variables: &[(f64, f64)], by: Option<usize>) -> f64 {
        let factor = |&(k, power): &(usize, i32)| {
            let x = variables[k].0;
            if by == Some(k) { f64::from(power) * x.powi(power - 1) * variables[k].1 } else { x.powi(power) }
        };
        term.powers.iter().map(factor).product()
    }

    /// Values of all terms at a sample, and their derivatives by components of the state, as triples of component, term and derivative.
    pub fn evaluate(
        &self,
        samples: &MotionSamples,
        at: usize,
        values: &mut Vec<f64>,
        slopes: &mut Vec<(usize, usize, f64)>,
    ) {
        let state = samples.state(at);
        let variables = self.variables(state);
        values.clear();
        slopes.clear();
        for (j, term) in self.terms.iter().enumerate() {
            let product = Self::product(term, &variables, None);
            let speed = term.velocity.map_or(1.0, |i| state[self.n + i]);
            values.push(product * speed);
            slopes.extend(
                term.powers
                    .iter()
                    .map(|&(k, _)| (self.variables[k].0, j, Self::product(term, &variables, Some(k)) * speed)),
            );
            slopes.extend(term.velocity.map(|i| (self.n + i, j, product)));
        }
    }

    /// Gradient of a combination with respect to the coordinates.
    pub fn gradient(&self, samples: &MotionSamples, at: usize, weights: &[f64]) -> Vec<f64> {
        let (mut values, mut slopes, mut gradient) = (Vec::new(), Vec::new(), vec![0.0; self.n]);
        self.evaluate(samples, at, &mut values, &mut slopes);
        for (i, j, slope) in slopes.into_iter().filter(|(i, ..)| *i < self.n) {
            gradient[i] += weights[j] * slope;
        }
        gradient
    }

    /// Factors of the velocities in a combination.
    pub fn velocity_row(&self, samples: &MotionSamples, at: usize, weights: &[f64]) -> Vec<f64> {
        let variables = self.variables(samples.state(at));
        let mut row = vec![0.0; self.n];
        for (term, &weight) in self.terms.iter().zip(weights) {
            if let Some(i) = term.velocity {
                row[i] += weight * Self::product(term, &variables, None);
            }
        }
        row
    }

    /// Derivatives of these factors, by coordinate `i` of factor `j` at `(i, j)`.
    pub fn row_derivatives(&self, samples: &MotionSamples, at: usize, weights: &[f64]) -> Vec<f64> {
        let variables = self.variables(samples.state(at));
        let mut derivatives = vec![0.0; self.n * self.n];
        for (term, &weight) in self.terms.iter().zip(weights) {
            let Some(j) = term.velocity else { continue };
            for &(k, _) in &term.powers {
                derivatives[self.variables[k].0 * self.n + j] += weight * Self::product(term, &variables, Some(k));
            }
        }
        derivatives
    }
}

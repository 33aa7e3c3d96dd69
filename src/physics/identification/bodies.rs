//! Physical inertias for a chain of links. Often only sums of the constants of links are determined. Among all constants with these sums, this
//! module chooses ones that rigid bodies can have.
//!
//! A rigid body of mass `m`, first moments `h` and inertia `I` about the origin has a positive definite pseudo-inertia
//! `P = [[tr(I)/2 E - I, h], [h', m]]` (Wensing, Kim and Slotine, 2018), and a chain of bodies a positive definite mass matrix at every pose.
//! With the normal matrix `S` and the size `D` of each constant, `(y - x)' (S + D^-2) (y - x)/2 - w sum ln det P(y)` is convex: `S` keeps the
//! determined sums, and `D` keeps the other constants close to `x`.

use super::determined::{Determined, quadratic};
use super::found::Bodies;
use super::linear::{inverse_with, times};
use super::solve::Problem;
use super::thresholds::{
    BARRIER_DECREASE, BARRIER_DECREMENT, BARRIER_HALVINGS, BARRIER_RIDGE, BARRIER_STEPS, BARRIER_WEIGHTS, BODY_ERRORS,
    LEAST_INERTIA,
};
use crate::lagrangian::{SystemInstance, inertia_symbols, loss_symbols};
use crate::linalg::{Workspace, dot, eigh, inverse, is_positive_definite};

/// `P` is linear in the ten constants of a link: row, column and factor for each constant.
const ENTRIES: [&[(usize, usize, f64)]; 10] = [
    &[(3, 3, 1.0)],
    &[(0, 3, 1.0), (3, 0, 1.0)],
    &[(1, 3, 1.0), (3, 1, 1.0)],
    &[(2, 3, 1.0), (3, 2, 1.0)],
    &[(0, 0, -0.5), (1, 1, 0.5), (2, 2, 0.5)],
    &[(0, 1, -1.0), (1, 0, -1.0)],
    &[(0, 2, -1.0), (2, 0, -1.0)],
    &[(0, 0, 0.5), (1, 1, -0.5), (2, 2, 0.5)],
    &[(1, 2, -1.0), (2, 1, -1.0)],
    &[(0, 0, 0.5), (1, 1, 0.5), (2, 2, -0.5)],
];

/// A link: the value of each of its ten constants, and its index among the unknowns.
struct Link {
    given: [f64; 10],
    unknown: [Option<usize>; 10],
}

impl Link {
    /// The ten constants with unknowns `x`.
    fn constants(&self, x: &[f64]) -> [f64; 10] {
        std::array::from_fn(|j| self.unknown[j].map_or(self.given[j], |k| x[k]))
    }

    /// The pseudo-inertia.
    fn matrix(&self, x: &[f64]) -> [f64; 16] {
        let mut matrix = [0.0; 16];
        for (parts, value) in ENTRIES.iter().zip(self.constants(x)) {
            parts.iter().for_each(|&(i, j, factor)| matrix[4 * i + j] += factor * value);
        }
        matrix
    }

    /// `true` if a rigid body can have these constants, with a margin.
    fn is_body(&self, x: &[f64]) -> bool {
        let matrix = self.matrix(x);
        let root: [f64; 4] = std::array::from_fn(|i| matrix[5 * i].sqrt());
        if !root.iter().all(|root| *root > 0.0) {
            return false;
        }
        let scaled: Vec<f64> = matrix.iter().enumerate().map(|(at, x)| x / (root[at / 4] * root[at % 4])).collect();
        let (mut values, mut vectors) = ([0.0; 4], [0.0; 16]);
        let done = eigh(4, &scaled, &mut values, &mut vectors, &mut Workspace::new());
        done.is_ok() && values.iter().all(|value| *value > LEAST_INERTIA)
    }

    /// Writes a rigid body to `x`: its current constants if they are physical, otherwise ones close to its moments. `false` if given constants
    /// prevent this.
    fn place_body(&self, x: &mut [f64]) -> bool {
        if !self.is_body(x) {
            let [mass, hx, hy, hz, ..] = self.constants(x);
            let mass = if mass > 0.0 { mass } else { 1.0 };
            let inertia = 4.0 * (hx * hx + hy * hy + hz * hz) / mass + 0.1 * mass;
            for (j, unknown) in self.unknown.iter().enumerate() {
                let value = [mass, hx, hy, hz, inertia, 0.0, 0.0, inertia, 0.0, inertia][j];
                unknown.iter().for_each(|&k| x[k] = value);
            }
        }
        self.is_body(x)
    }
}

/// The links of a chain.
fn links(instance: &SystemInstance<f64>, problem: &Problem<'_>, x: &[f64]) -> Vec<Link> {
    let values = problem.parameters(x);
    let place = |symbol: &String| instance.system.parameters.iter().position(|known| known.symbol == *symbol);
    let of = |number: usize| {
        let places = inertia_symbols(number).map(|symbol| place(&symbol));
        let unknown = places.map(|at| at.and_then(|at| problem.chosen.iter().position(|&chosen| chosen == at)));
        Link { given: places.map(|at| at.map_or(0.0, |at| values[at])), unknown }
    };
    (1..=instance.system.links()).map(of).collect()
}

/// Moves the constants of a chain to the closest physical ones that keep the determined sums; `None` for a system that is not a chain.
pub(super) fn physical(
    instance: &SystemInstance<f64>,
    problem: &Problem<'_>,
    determined: &Determined,
    x: &mut Vec<f64>,
) -> Option<Bodies> {
    if !instance.system.is_chain() {
        return None;
    }
    let links = links(instance, problem, x);
    let losses: Vec<usize> = (1..=links.len())
        .flat_map(loss_symbols)
        .collect::<Vec<_>>()
        .iter()
        .filter_map(|symbol| problem.chosen.iter().position(|&at| instance.system.parameters[at].symbol == *symbol))
        .collect();
    let mut search = Search { determined, centre: x.clone(), links: &links, active: Vec::new(), held: Vec::new() };
    let mut found = x.clone();
    // Every round adds at least one link or loss.
    loop {
        let bad = |k: &usize| !search.active.contains(k) && !links[*k].is_body(&found) && links[*k].has_unknown();
        let bad: Vec<usize> = (0..links.len()).filter(bad).collect();
        let negative: Vec<usize> =
            losses.iter().copied().filter(|k| !search.held.contains(k) && found[*k] < 0.0).collect();
        if bad.is_empty() && negative.is_empty() {
            break;
        }
        search.active.extend(bad);
        search.held.extend(negative);
        let Some(next) = search.solve() else {
            return Some(Bodies { moved: Vec::new(), largest_change: 0.0, exist: false });
        };
        found = next;
    }
    let change: Vec<f64> = found.iter().zip(x.iter()).map(|(after, before)| after - before).collect();
    // At the truth, the squared distance in standard errors has a chi-squared distribution. No determined sum changes by more standard errors than
    // its root.
    let square = quadratic(&determined.information, &change).max(0.0);
    let known = (change.len() - determined.without_effect.len() - determined.open.len()) as f64;
    *x = found;
    search.active.sort_unstable();
    let moved = search.active.iter().map(|k| k + 1).collect();
    let exist = square <= known + BODY_ERRORS * (2.0 * known).sqrt();
    Some(Bodies { moved, largest_change: square.sqrt(), exist })
}

/// The convex optimization.
struct Search<'a> {
    determined: &'a Determined,
    centre: Vec<f64>,
    links: &'a [Link],
    /// Links that must be physical; the others keep their constants.
    active: Vec<usize>,
    /// Losses that are fixed at 0.
    held: Vec<usize>,
}

impl Search<'_> {
    /// The closest physical constants; `None` if no rigid body has the given constants.
    fn solve(&self) -> Option<Vec<f64>> {
        let mut y = self.centre.clone();
        self.held.iter().for_each(|&k| y[k] = 0.0);
        if !self.active.iter().all(|&at| self.links[at].place_body(&mut y)) {
            return None;
        }
        let m = y.len();
        let mut pull = self.determined.information.clone();
        self.determined.size.iter().enumerate().for_each(|(k, size)| pull[k * m + k] += (size * size).recip());
        for weight in BARRIER_WEIGHTS {
            for _ in 0..BARRIER_STEPS {
                let decrement = self.step(&pull, weight, &mut y)?;
                if decrement < BARRIER_DECREMENT * weight.max(1.0) {
                    break;
                }
            }
        }
        Some(y)
    }

    /// The objective; `None` outside the physical inertias.
    fn value(&self, pull: &[f64], weight: f64, y: &[f64]) -> Option<f64> {
        let off: Vec<f64> = y.iter().zip(&self.centre).map(|(y, centre)| y - centre).collect();
        let mut value = quadratic(pull, &off) / 2.0;
        for &at in &self.active {
            let matrix = self.links[at].matrix(y);
            let mut scratch = [0.0; 16];
            if !is_positive_definite(4, &matrix, &mut scratch) {
                return None;
            }
            // The pivots of the elimination.
            value -= weight * (0..4).map(|i| scratch[5 * i].ln()).sum::<f64>();
        }
        value.is_finite().then_some(value)
    }

    /// Performs one step of Newton's method; returns its decrement.
    fn step(&self, pull: &[f64], weight: f64, y: &mut Vec<f64>) -> Option<f64> {
        let m = y.len();
        let off: Vec<f64> = y.iter().zip(&self.centre).map(|(y, centre)| y - centre).collect();
        let (mut gradient, mut hessian) = (times(m, pull, &off), pull.to_vec());
        for &at in &self.active {
            self.links[at].add_barrier(y, weight, &mut gradient, &mut hessian)?;
        }
        for &k in &self.held {
            (0..m).for_each(|j| (hessian[k * m + j], hessian[j * m + k]) = (0.0, 0.0));
            (hessian[k * m + k], gradient[k]) = (1.0, 0.0);
        }
        let change = times(m, &inverse_with(m, &hessian, BARRIER_RIDGE)?, &gradient);
        let decrement = dot(&change, &gradient);
        let before = self.value(pull, weight, y)?;
        let mut part = 1.0;
        for _ in 0..BARRIER_HALVINGS {
            let tried: Vec<f64> = y.iter().zip(&change).map(|(y, change)| y - part * change).collect();
            if self
                .value(pull, weight, &tried)
                .is_some_and(|after| after <= before - BARRIER_DECREASE * part * decrement)
            {
                *y = tried;
                return Some(decrement);
            }
            part /= 2.0;
        }
        // Any further decrease is rounding.
        Some(0.0)
    }
}

impl Link {
    /// `true` if a constant of the link is unknown.
    fn has_unknown(&self) -> bool {
        self.unknown.iter().any(Option::is_some)
    }

    /// Adds gradient and Hessian of `-weight ln det P`: `-tr(P^-1 P_i)` and `tr(P^-1 P_i P^-1 P_j)`.
    fn add_barrier(&self, y: &[f64], weight: f64, gradient: &mut [f64], hessian: &mut [f64]) -> Option<()> {
        let m = y.len();
        let mut inverted = [0.0; 16];
        inverse(4, &self.matrix(y), &mut inverted, &mut Workspace::new()).ok()?;
        // P^-1 P_j.
        let products: Vec<[f64; 16]> = ENTRIES
            .iter()
            .map(|parts| {
                let mut product = [0.0; 16];
                for &(i, j, factor) in *parts {
                    (0..4).for_each(|row| product[4 * row + j] += inverted[4 * row + i] * factor);
                }
                product
            })
            .collect();
        let trace = |a: &[f64; 16], b: &[f64; 16]| -> f64 { (0..16).map(|at| a[at] * b[at % 4 * 4 + at / 4]).sum() };
        for (a, i) in products.iter().zip(self.unknown).filter_map(|(a, k)| Some((a, k?))) {
            gradient[i] -= weight * (0..4).map(|at| a[5 * at]).sum::<f64>();
            for (b, j) in products.iter().zip(self.unknown).filter_map(|(b, k)| Some((b, k?))) {
                hessian[i * m + j] += weight * trace(a, b);
            }
        }
        Some(())
    }
}

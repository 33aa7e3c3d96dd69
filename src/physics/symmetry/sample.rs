//! States at which the terms of a Lagrangian are evaluated, with the typical sizes of the motion and of the terms.

use super::SymmetryError;
use super::thresholds::{DRAWS_PER_STATE, EQUAL_TERMS, INNER_RANGE, LEAST_EIGENVALUE};
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Workspace, eigh, inertia};
use crate::random::RngStream;
use rand::Rng;
use serde::Serialize;

/// Terms of a Lagrangian at states `(states, n)`.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Number of coordinates.
    pub n: usize,
    /// Coordinates, `(states, n)`.
    pub q: Vec<f64>,
    /// Velocities, `(states, n)`.
    pub v: Vec<f64>,
    /// `dL/dv`, `(states, n)`.
    pub p: Vec<f64>,
    /// `dL/dq`, `(states, n)`.
    pub g: Vec<f64>,
    /// Forces that are not in `L`, such as friction, `(states, n)`; empty if there are none.
    pub force: Vec<f64>,
    /// `E = p.v - L`, `(states)`.
    pub energy: Vec<f64>,
    /// `|M|`, the mass matrix with the magnitudes of its eigenvalues, `(states, n, n)`.
    pub frame: Vec<f64>,
    /// Size of the terms of `xi.g + (D xi v).p` at every state for a field of unit size, `(states)`.
    pub size: Vec<f64>,
    /// Time in which momenta change by their own size at every state, `(states)`.
    pub pace: Vec<f64>,
    /// States at which the mass matrix is singular to working precision: there `L` is degenerate and determines no motion.
    pub singular: usize,
    /// `true` if `L(q, -v) = L(q, v)`.
    pub even: bool,
    /// `true` if `L` is a quadratic form of the velocity, as for geodesics: then it equals the energy.
    pub homogeneous: bool,
    /// States at which the mass matrix has positive and negative eigenvalues, as the metric of a space with a time.
    pub indefinite: usize,
}

/// The quantity that every motion conserves because `L` does not depend on the parameter of the motion, in words for people and for files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Invariant {
    /// The energy.
    #[serde(rename = "energy")]
    Energy,
    /// The squared length of geodesics of a metric with a time, whose parameter is not the time. The energy is the charge of a time
    /// translation, if the metric does not depend on time.
    #[serde(rename = "g(v, v)")]
    Square,
    /// `p.v - L` of another Lagrangian with a time among its coordinates.
    #[serde(rename = "p.v - L")]
    Legendre,
    /// Nothing, because of friction.
    #[serde(rename = "nothing")]
    Nothing,
}

impl Invariant {
    /// The quantity that the motions of a model conserve, according to its terms at states `(states, n)`.
    ///
    /// # Errors
    /// [`SymmetryError::Shape`] for slices of wrong length, [`SymmetryError::States`] if fewer than half of the states have finite terms.
    pub fn of(model: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> Result<Self, SymmetryError> {
        Ok(Sample::new(model, q, v)?.invariant())
    }

    /// Name of the number `p.v - L`.
    pub fn charge(self) -> &'static str {
        match self {
            Self::Energy | Self::Nothing => "energy",
            Self::Square => "g(v, v)/2",
            Self::Legendre => "p.v - L",
        }
    }
}

impl Sample {
    /// The terms of `model` at states where they are finite.
    ///
    /// # Errors
    /// [`SymmetryError::Shape`] for slices of the wrong length, [`SymmetryError::States`] if fewer than half of the states have
    /// finite terms.
    pub fn new(model: &dyn EulerLagrange<f64>, q: &[f64], v: &[f64]) -> Result<Self, SymmetryError> {
        let n = model.coordinates();
        if q.len() != v.len() || n == 0 || !q.len().is_multiple_of(n) {
            return Err(SymmetryError::Shape { coordinates: n, q: q.len(), v: v.len() });
        }
        let request = Request::MOMENTUM | Request::DL_DQ | Request::MASS_MATRIX | Request::ENERGY | Request::FORCE;
        let (mut terms, mut back) = (Terms::default(), Terms::default());
        // A state that is not finite is reported and left out below.
        let _ = model.terms(q, v, request, &mut terms);
        let reversed: Vec<f64> = v.iter().map(|v| -v).collect();
        let _ = model.terms(q, &reversed, Request::MOMENTUM | Request::DL_DQ, &mut back);
        let mut sample = Self {
            n,
            q: vec![],
            v: vec![],
            p: vec![],
            g: vec![],
            force: vec![],
            energy: vec![],
            frame: vec![],
            size: vec![],
            pace: vec![],
            singular: 0,
            even: true,
            homogeneous: true,
            indefinite: 0,
        };
        let (states, mut scratch) = (q.len() / n, vec![0.0; n * n]);
        for k in 0..states {
            let (one, matrix) = (k * n..(k + 1) * n, k * n * n..(k + 1) * n * n);
            let [Some(p), Some(g)] = [&terms.momentum, &terms.dl_dq].map(|x| x.get(one.clone())) else { continue };
            let (Some(m), Some(&energy)) = (terms.mass_matrix.get(matrix), terms.energy.get(k)) else { continue };
            let state = q[one.clone()].iter().chain(&v[one.clone()]);
            if !state.chain(p).chain(g).chain(m).chain([&energy]).all(|x| x.is_finite()) {
                continue;
            }
            sample.q.extend_from_slice(&q[one.clone()]);
            sample.v.extend_from_slice(&v[one.clone()]);
            sample.p.extend_from_slice(p);
            sample.g.extend_from_slice(g);
            sample.energy.push(energy);
            sample.frame.extend_from_slice(m);
            sample.force.extend_from_slice(terms.force.get(one.clone()).unwrap_or_default());
            if let Ok(signs) = inertia(n, m, &mut scratch) {
                sample.singular += usize::from(signs.zero > 0);
                sample.indefinite += usize::from(signs.positive > 0 && signs.negative > 0);
            }
            let same = |here: &[f64], there: &[f64], sign: f64| {
                let size = here.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                here.iter().zip(there).all(|(a, b)| (a - sign * b).abs() <= EQUAL_TERMS * size)
            };
            let action: f64 = p.iter().zip(&v[one.clone()]).map(|(p, v)| p * v).sum();
            let size: f64 = p.iter().zip(&v[one.clone()]).map(|(p, v)| (p * v).abs()).sum();
            sample.homogeneous &= (action - 2.0 * energy).abs() <= EQUAL_TERMS * size;
            let reversed = [&back.momentum, &back.dl_dq].map(|x| x.get(one.clone()));
            sample.even &= match reversed {
                [Some(there), Some(pull)] => same(p, there, -1.0) && same(g, pull, 1.0),
                _ => false,
            };
        }
        let found = sample.energy.len();
        if 2 * found < states || found == 0 {
            return Err(SymmetryError::States { states, found });
        }
        sample.measure();
        Ok(sample)
    }

    /// Number of states.
    pub fn len(&self) -> usize {
        self.energy.len()
    }

    /// Turns mass matrices into frames and finds the sizes of the terms.
    ///
    /// For a field of unit size `|xi|_M`, `xi.g` is at most `|g|`, and `(D xi v).p` is about `|v| |p|` over the length on which the field
    /// changes, estimated by the spread of the coordinates; all norms are those of the frame.
    fn measure(&mut self) {
        let (n, states) = (self.n, self.len());
        let (mut values, mut vectors) = (vec![0.0; states * n], vec![0.0; states * n * n]);
        // Matrices are finite.
        let _ = eigh(n, &self.frame, &mut values, &mut vectors, &mut Workspace::new());
        let spread = self.spread();
        let (mut length, mut parts, mut momenta) = (0.0, Vec::with_capacity(states), Vec::with_capacity(states));
        for k in 0..states {
            let (w, u) = (&values[k * n..(k + 1) * n], &vectors[k * n * n..(k + 1) * n * n]);
            let largest = w.iter().fold(f64::MIN_POSITIVE, |m, w| m.max(w.abs()));
            let w: Vec<f64> = w.iter().map(|w| w.abs().max(LEAST_EIGENVALUE * largest)).collect();
            let norm = |x: &[f64], inverse: bool| -> f64 {
                let square = w.iter().zip(u.chunks_exact(n)).map(|(w, u)| {
                    let along: f64 = u.iter().zip(x).map(|(u, x)| u * x).sum();
                    along * along * if inverse { 1.0 / w } else { *w }
                });
                square.sum::<f64>().sqrt()
            };
            let one = k * n..(k + 1) * n;
            let momentum = norm(&self.p[one.clone()], true);
            let motion = norm(&self.v[one.clone()], false) * momentum;
            momenta.push(momentum);
            parts.push([motion, norm(&self.g[one], true)]);
            length += norm(&spread, false).powi(2) / states as f64;
            for i in 0..n {
                for j in 0..n {
                    let entry = w.iter().zip(u.chunks_exact(n)).map(|(w, u)| w * u[i] * u[j]);
                    self.frame[k * n * n + i * n + j] = entry.sum();
                }
            }
        }
        let length = length.sqrt();
        let least = f64::MIN_POSITIVE.sqrt();
        self.size = parts.iter().map(|[motion, pull]| (motion / length).hypot(*pull).max(least)).collect();
        self.pace = momenta.iter().zip(&self.size).map(|(momentum, size)| momentum / size).collect();
    }

    /// Force that is not in `L` on coordinate `i` at state `k`.
    pub fn force(&self, k: usize, i: usize) -> f64 {
        self.force.get(k * self.n + i).copied().unwrap_or(0.0)
    }

    /// The quantity that every motion conserves because `L` does not depend on its parameter.
    pub fn invariant(&self) -> Invariant {
        match 2 * self.indefinite > self.len() {
            _ if !self.force.is_empty() => Invariant::Nothing,
            true if self.homogeneous => Invariant::Square,
            true => Invariant::Legendre,
            false => Invariant::Energy,
        }
    }

    /// For every coordinate, whether `L` is independent of it.
    pub fn cyclic(&self) -> Vec<bool> {
        let size = |i: usize| self.g.iter().skip(i).step_by(self.n).fold(0.0, |m: f64, g| m.max(g.abs()));
        let momentum = self.p.iter().fold(f64::MIN_POSITIVE, |m: f64, p| m.max(p.abs()));
        (0..self.n).map(|i| size(i) <= EQUAL_TERMS * momentum).collect()
    }

    /// Root mean square of every coordinate about its mean; 1 for a constant one.
    pub fn spread(&self) -> Vec<f64> {
        let states = self.len() as f64;
        let one = |i: usize| {
            let values = || self.q.iter().skip(i).step_by(self.n);
            let mean = values().sum::<f64>() / states;
            let rms = (values().map(|x| (x - mean).powi(2)).sum::<f64>() / states).sqrt();
            if rms > 0.0 { rms } else { 1.0 }
        };
        (0..self.n).map(one).collect()
    }
}

/// A box of states: `[low, high]` of every coordinate and velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Ranges of the coordinates, `(n)`.
    pub position: Vec<[f64; 2]>,
    /// Ranges of the velocities, `(n)`.
    pub velocity: Vec<[f64; 2]>,
}

impl Region {
    /// The range of a column, coordinates before velocities.
    pub fn range(&self, column: usize) -> [f64; 2] {
        let n = self.position.len();
        if column < n { self.position[column] } else { self.velocity[column - n] }
    }

    /// The states in both regions, which have the same number of coordinates. A range without width, such as that of a velocity that a mass
    /// shell fixes, is no bound.
    ///
    /// # Errors
    /// The first column whose ranges have nothing in common, or a single number, on which no functions could be distinguished.
    pub fn meet(&self, other: &Self) -> Result<Self, usize> {
        let mut both = self.clone();
        let ranges = both.position.iter_mut().chain(&mut both.velocity);
        for (column, range) in ranges.enumerate() {
            let ([low, high], beside) = (*range, other.range(column));
            let common = [low.max(beside[0]), high.min(beside[1])];
            match (low < high, beside[0] < beside[1]) {
                (true, true) if common[0] >= common[1] => return Err(column),
                (true, true) => *range = common,
                (true, false) => {}
                _ => *range = beside,
            }
        }
        Ok(both)
    }

    /// Coordinates and velocities `(states, n)`, uniform in the box, the same for the same seed.
    ///
    /// `accept` may change a velocity, such as the one that a mass shell fixes, and returns `false` to reject a state. If it rejects nearly
    /// all of them, fewer states are returned.
    pub fn states(
        &self,
        states: usize,
        seed: u64,
        mut accept: impl FnMut(&[f64], &mut [f64]) -> bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let mut random = RngStream::Region.generator(seed);
        let mut draw = |bounds: &[[f64; 2]]| -> Vec<f64> {
            bounds.iter().map(|[low, high]| low + (high - low) * random.random::<f64>()).collect()
        };
        let (mut all, mut taken) = ((Vec::new(), Vec::new()), 0);
        for _ in 0..DRAWS_PER_STATE * states {
            if taken == states {
                break;
            }
            let (q, mut v) = (draw(&self.position), draw(&self.velocity));
            if accept(&q, &mut v) && v.iter().all(|v| v.is_finite()) {
                all.0.extend(q);
                all.1.extend(v);
                taken += 1;
            }
        }
        all
    }
}

/// The middle of a range.
pub fn middle([low, high]: [f64; 2]) -> [f64; 2] {
    let (middle, half) = (0.5 * (low + high), 0.5 * INNER_RANGE * (high - low));
    [middle - half, middle + half]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_meet_where_both_are() {
        let region =
            |position: [f64; 2], velocity: [f64; 2]| Region { position: vec![position], velocity: vec![velocity] };
        let (wide, free) = (region([0.0, 4.0], [-1.0, 1.0]), region([2.0, 6.0], [0.0, 0.0]));
        // A velocity that a mass shell fixes is bounded by the other region.
        assert_eq!(wide.meet(&free), Ok(region([2.0, 4.0], [-1.0, 1.0])));
        assert_eq!(free.meet(&wide), wide.meet(&free));
        assert_eq!(wide.meet(&region([4.0, 5.0], [-1.0, 1.0])), Err(0));
        assert_eq!(wide.meet(&region([0.0, 4.0], [2.0, 3.0])), Err(1));
    }
}

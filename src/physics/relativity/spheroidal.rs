//! Oblate spheroidal coordinates around a spin, in which Carter's constant has a short formula.

use crate::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};

/// A model of Cartesian coordinates in the coordinates `t`, `r`, `theta`, `phi`:
/// `x + i y = (r + i a) e^(i phi) sin(theta)`, `z = r cos(theta)`.
///
/// It gives `L`, `p`, `dL/dq`, `M` and the energy: `p` and `dL/dq` are pulled back, `P = J^T p`, `G = J^T g + (dJ/dQ V)^T p`.
/// Accelerations are refused.
pub(super) struct Spheroidal<'a> {
    /// The model.
    pub model: &'a dyn EulerLagrange<f64>,
    /// `a`.
    pub spin: f64,
    /// Index of the time.
    pub time: usize,
    /// Indices of `x`, `y`, `z`.
    pub space: [usize; 3],
}

/// Place, `dx_i/dQ_j` and `d2x_i/dQ_j dQ_k` of `Q = (r, theta, phi)`.
struct Place {
    x: [f64; 3],
    first: [[f64; 3]; 3],
    second: [[[f64; 3]; 3]; 3],
}

impl Place {
    fn new(spin: f64, [r, theta, phi]: [f64; 3]) -> Self {
        let ((s, c), (sine, cosine)) = (theta.sin_cos(), phi.sin_cos());
        // The distances from the axis over sin(theta), as components.
        let (u, w) = (r * cosine - spin * sine, r * sine + spin * cosine);
        let row = |rr: f64, rt: f64, rp: f64, tt: f64, tp: f64, pp: f64| [[rr, rt, rp], [rt, tt, tp], [rp, tp, pp]];
        Self {
            x: [u * s, w * s, r * c],
            first: [[cosine * s, u * c, -w * s], [sine * s, w * c, u * s], [c, -r * s, 0.0]],
            second: [
                row(0.0, cosine * c, -sine * s, -u * s, -w * c, -u * s),
                row(0.0, sine * c, cosine * s, -w * s, u * c, -w * s),
                row(0.0, -s, 0.0, -r * c, 0.0, 0.0),
            ],
        }
    }
}

impl EulerLagrange<f64> for Spheroidal<'_> {
    fn coordinates(&self) -> usize {
        4
    }

    fn terms(&self, q: &[f64], v: &[f64], request: Request, terms: &mut Terms<f64>) -> Result<(), MechanicsError> {
        if request.includes(Request::ACCELERATION) {
            return Err(MechanicsError::Derivatives { what: "acceleration in spheroidal coordinates" });
        }
        let places: Vec<Place> = q.chunks_exact(4).map(|q| Place::new(self.spin, [q[1], q[2], q[3]])).collect();
        let (mut at, mut rate) = (vec![0.0; q.len()], vec![0.0; v.len()]);
        for (k, place) in places.iter().enumerate() {
            (at[4 * k + self.time], rate[4 * k + self.time]) = (q[4 * k], v[4 * k]);
            for (i, &target) in self.space.iter().enumerate() {
                at[4 * k + target] = place.x[i];
                rate[4 * k + target] = (0..3).map(|j| place.first[i][j] * v[4 * k + 1 + j]).sum();
            }
        }
        let outcome = self.model.terms(&at, &rate, request, terms);
        if !terms.record_failures(&outcome) {
            return outcome;
        }
        let space = self.space;
        for (k, place) in places.iter().enumerate() {
            let speed = &v[4 * k + 1..4 * k + 4];
            let gather = |from: &[f64]| (from[4 * k + self.time], space.map(|i| from[4 * k + i]));
            let back = |(time, x): (f64, [f64; 3])| {
                [time, 0.0, 0.0, 0.0].into_iter().enumerate().map(move |(j, time)| match j {
                    0 => time,
                    j => (0..3).map(|i| place.first[i][j - 1] * x[i]).sum(),
                })
            };
            let momentum = (!terms.momentum.is_empty()).then(|| gather(&terms.momentum));
            if !terms.dl_dq.is_empty() {
                let mut pulled: Vec<f64> = back(gather(&terms.dl_dq)).collect();
                let Some((_, p)) = momentum else {
                    return Err(MechanicsError::Derivatives { what: "dL/dq without momenta" });
                };
                for j in 0..3 {
                    for (i, p) in p.iter().enumerate() {
                        pulled[1 + j] += p * (0..3).map(|l| place.second[i][j][l] * speed[l]).sum::<f64>();
                    }
                }
                terms.dl_dq[4 * k..4 * k + 4].copy_from_slice(&pulled);
            }
            if let Some(momentum) = momentum {
                let pulled: Vec<f64> = back(momentum).collect();
                terms.momentum[4 * k..4 * k + 4].copy_from_slice(&pulled);
            }
            if !terms.mass_matrix.is_empty() {
                let matrix = terms.mass_matrix[16 * k..16 * k + 16].to_vec();
                // Columns of the whole Jacobian, `(4, 4)`.
                let column = |j: usize| {
                    let mut column = [0.0; 4];
                    match j {
                        0 => column[self.time] = 1.0,
                        j => space.iter().enumerate().for_each(|(i, &target)| column[target] = place.first[i][j - 1]),
                    }
                    column
                };
                for a in 0..4 {
                    for b in 0..4 {
                        let (left, right) = (column(a), column(b));
                        let sum = |i: usize| (0..4).map(|j| matrix[4 * i + j] * right[j]).sum::<f64>();
                        terms.mass_matrix[16 * k + 4 * a + b] = (0..4).map(|i| left[i] * sum(i)).sum();
                    }
                }
            }
        }
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::build;

    /// In flat space the pulled-back terms are those of the oblate spheroidal metric; of Kerr they are the derivatives of `L`.
    #[test]
    fn pulled_back_terms_are_derivatives_of_the_lagrangian() {
        let hole = build::<f64>("kerr-cartesian", &[]).unwrap();
        let model = Spheroidal { model: &*hole, spin: 0.9, time: 0, space: [1, 2, 3] };
        let (q, v) = ([0.3, 4.0, 1.1, 0.7], [1.2, 0.3, -0.1, 0.05]);
        let of = |q: &[f64], v: &[f64], request: Request| {
            let mut terms = Terms::default();
            model.terms(q, v, request, &mut terms).unwrap();
            terms
        };
        let request = Request::LAGRANGIAN | Request::MOMENTUM | Request::DL_DQ | Request::MASS_MATRIX;
        let found = of(&q, &v, request);
        let step = 1e-5;
        let moved = |x: &[f64; 4], i: usize, by: f64| {
            let mut x = *x;
            x[i] += by;
            x
        };
        let lagrangian = |q: &[f64], v: &[f64]| of(q, v, Request::LAGRANGIAN).lagrangian[0];
        for i in 0..4 {
            let by_v = (lagrangian(&q, &moved(&v, i, step)) - lagrangian(&q, &moved(&v, i, -step))) / (2.0 * step);
            let by_q = (lagrangian(&moved(&q, i, step), &v) - lagrangian(&moved(&q, i, -step), &v)) / (2.0 * step);
            assert!((found.momentum[i] - by_v).abs() < 1e-8, "p {i}");
            assert!((found.dl_dq[i] - by_q).abs() < 1e-8, "g {i}");
            let row: f64 = (0..4).map(|j| found.mass_matrix[4 * i + j] * v[j]).sum();
            assert!((found.momentum[i] - row).abs() < 1e-12, "M {i}");
        }
    }
}

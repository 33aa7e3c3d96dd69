//! Derivatives of the equations of motion of a network, computed with the same sweeps as in training.

use super::{Dynamics, NetworkLagrangian};
use crate::lagrangian::{Held, MechanicsError, Products, Slopes};
use crate::scalar::{Real, Scalar, update};
use crate::tape::{Depth, MixedDirections, STATES};
use alloc::vec::Vec;

/// Buffers for the derivatives of a network; up to [`STATES`] equations are differentiated at once.
pub(super) struct NetworkSlopes<'a, S> {
    network: &'a NetworkLagrangian<S>,
    dynamics: Dynamics<S>,
    directions: MixedDirections<S>,
    q: Vec<S>,
    v: Vec<S>,
    by_q: Vec<S>,
    by_v: Vec<S>,
    by_weights: Vec<S>,
}

impl<'a, S: Scalar> NetworkSlopes<'a, S> {
    pub fn new(network: &'a NetworkLagrangian<S>) -> Self {
        Self {
            network,
            dynamics: Dynamics::new(network.model()),
            directions: MixedDirections::default(),
            q: Vec::new(),
            v: Vec::new(),
            by_q: Vec::new(),
            by_v: Vec::new(),
            by_weights: vec![<S as Real>::zero(); network.weights().len()],
        }
    }

    /// Computes derivatives of `x.f` in physical units at the states collected in `q`, `v`, with the weights `x` and accelerations
    /// collected in the directions. Derivatives by the weights of the network are added to `by_weights`.
    fn sweep(&mut self) {
        let Self { network, dynamics, directions, q, v, by_q, by_v, by_weights } = self;
        let (scale, n, zero) = (network.model().scale(), network.model().coordinates(), <S as Real>::zero());
        network.model().wrap(q);
        for field in [&mut *by_q, &mut *by_v] {
            field.clear();
            field.resize(q.len(), zero);
        }
        // The sweeps differentiate `-s.f` in scaled coordinates.
        directions.s.iter_mut().enumerate().for_each(|(k, x)| *x = -*x / scale[k % n]);
        directions.t.iter_mut().enumerate().for_each(|(k, a)| *a /= scale[k % n]);
        dynamics.evaluate(network.weights(), q, v, Depth::Training, true);
        dynamics.add_gradient(network.weights(), directions, by_weights, Some((by_q, by_v)));
        for field in [by_q, by_v] {
            field.iter_mut().enumerate().for_each(|(k, x)| *x /= scale[k % n]);
        }
    }

    fn clear(&mut self) {
        self.q.clear();
        self.v.clear();
        self.directions.clear(true);
    }

    /// Adds a state with its accelerations and the weights of its equations.
    fn push(&mut self, held: &Held<'_, S>, row: usize, weights: impl Iterator<Item = S>) {
        let n = self.network.model().coordinates();
        let at = row * n..(row + 1) * n;
        self.q.extend_from_slice(&held.state.0[at.clone()]);
        self.v.extend_from_slice(&held.state.1[at.clone()]);
        self.directions.t.extend_from_slice(&held.a[at]);
        self.directions.s.extend(weights);
    }
}

impl<S: Scalar> Slopes<S> for NetworkSlopes<'_, S> {
    fn add_matrices(&mut self, held: &Held<'_, S>, matrices: &mut [S]) -> Result<(), MechanicsError> {
        let n = self.network.model().coordinates();
        let (rows, unit) = (n + held.constraints, [<S as Real>::zero(), <S as Real>::one()]);
        let equations: Vec<(usize, usize)> =
            (0..held.a.len() / n).flat_map(|state| (0..n).map(move |i| (state, i))).collect();
        for chunk in equations.chunks(STATES) {
            self.clear();
            for &(state, i) in chunk {
                self.push(held, state, (0..n).map(|j| unit[usize::from(i == j)]));
            }
            self.sweep();
            let found = self.by_q.chunks_exact(n).zip(self.by_v.chunks_exact(n));
            for (&(state, i), (by_q, by_v)) in chunk.iter().zip(found) {
                let to = &mut matrices[(state * rows + i) * 2 * n..][..2 * n];
                update(&mut to[..n], by_q, |sum, x| *sum += x);
                update(&mut to[n..], by_v, |sum, x| *sum += x);
            }
        }
        Ok(())
    }

    fn add_products(
        &mut self,
        held: &Held<'_, S>,
        weights: &[S],
        products: &mut Products<'_, S>,
    ) -> Result<(), MechanicsError> {
        let n = self.network.model().coordinates();
        self.by_weights.fill(<S as Real>::zero());
        let states: Vec<usize> = (0..held.a.len() / n).collect();
        for chunk in states.chunks(STATES) {
            self.clear();
            for &state in chunk {
                self.push(held, state, weights[state * (n + held.constraints)..][..n].iter().copied());
            }
            self.sweep();
            let at = chunk[0] * n..(chunk[0] + chunk.len()) * n;
            update(&mut products.by_q[at.clone()], &self.by_q, |sum, x| *sum += x);
            update(&mut products.by_v[at], &self.by_v, |sum, x| *sum += x);
        }
        products.add_parameters(&self.by_weights);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lagrangian::{EulerLagrange, Linearizer};
    use crate::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer};
    use crate::random::RngStream;
    use crate::scalar::Dd;

    /// Compares the derivatives of a network with an angle, scales and friction with differences of its accelerations in double-double
    /// precision.
    #[test]
    fn a_network_is_linearized_exactly() {
        let architecture = Architecture {
            coordinates: 2,
            hidden: vec![6, 6],
            activation: ActivationChoice::Softplus,
            alpha: 0.8,
            time_like: None,
            scale: vec![1.0, 2.5],
            periodic: vec![true, false],
            embed_periodic: true,
            input_layer: InputLayer::None,
            dissipation: Some(3),
            form: Form::default(),
        };
        let mut rng = RngStream::Region.generator(3);
        let weights: Vec<f64> = architecture.initial_weights(Initialization::Default, &mut rng);
        let network = NetworkLagrangian::new(architecture, weights).unwrap();
        let wide = network.cast::<Dd>();
        let (q, v, w) = ([7.5, -0.4, 0.3, 1.1], [0.6, -1.2, 0.1, 0.4], [0.9, -0.5, 0.2, 1.0]);
        let mut linearizer = Linearizer::new(&network);
        let found = linearizer.at(&q, &v).unwrap().clone();
        let gradient = linearizer.gradient(&q, &v, &w).unwrap().clone();
        let lift = |x: &[f64]| x.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<_>>();
        let h = Dd::of_f64(1e-9);
        let slope = |f: &dyn Fn(Dd) -> Vec<Dd>| -> Vec<f64> {
            f(h).iter().zip(f(-h)).map(|(&a, b)| ((a - b) / (h + h)).to_f64()).collect()
        };
        for row in 0..2 {
            for j in 0..2 {
                for (which, field, by) in [(0, &found.by_q, &gradient.by_q), (1, &found.by_v, &gradient.by_v)] {
                    let exact = slope(&|h| {
                        let mut state = [lift(&q), lift(&v)];
                        state[which][row * 2 + j] += h;
                        wide.acceleration(&state[0], &state[1]).unwrap()
                    });
                    let exact = &exact[row * 2..][..2];
                    for i in 0..2 {
                        let x = field[row * 4 + i * 2 + j];
                        assert!((x - exact[i]).abs() < 1e-11 * (1.0 + exact[i].abs()), "{x} for {}", exact[i]);
                    }
                    let sum = w[row * 2] * exact[0] + w[row * 2 + 1] * exact[1];
                    assert!((by[row * 2 + j] - sum).abs() < 1e-11 * (1.0 + sum.abs()));
                }
            }
        }
        for k in (0..network.weights().len()).step_by(7) {
            let exact = slope(&|h| {
                let mut weights = lift(network.weights());
                weights[k] += h;
                let moved = NetworkLagrangian::new(network.architecture().clone(), weights).unwrap();
                moved.acceleration(&lift(&q), &lift(&v)).unwrap()
            });
            let sum: f64 = exact.iter().zip(&w).map(|(a, w)| a * w).sum();
            let found = gradient.by_parameters[k];
            assert!((found - sum).abs() < 1e-11 * (1.0 + sum.abs()), "weight {k}: {found} for {sum}");
        }
    }
}

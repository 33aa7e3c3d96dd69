//! Dense layers `W x + b`: one product for all channels and states, and two for its adjoints.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::linalg::{MatMut, MatRef, gemm};
use crate::scalar::{Real, Scalar, update, vectorized};
use crate::tape::engine::kernel::add_rows;
use crate::tape::engine::value::{Mixed, Order};

/// `W x + b`, `W` `(outputs, inputs)` row-major and `b` `(outputs)` among the parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dense {
    pub x: usize,
    pub inputs: usize,
    pub outputs: usize,
    /// First parameter of `W`.
    pub weights: usize,
    /// First parameter of `b`.
    pub bias: Option<usize>,
}

impl Dense {
    fn matrix<'a, S>(&self, parameters: &'a [S]) -> &'a [S] {
        &parameters[self.weights..self.weights + self.inputs * self.outputs]
    }

    /// `out = x W^T`, `x` `(rows, inputs)`.
    fn apply<S: Scalar>(&self, parameters: &[S], rows: usize, x: &[S], out: &mut [S]) {
        let matrix = self.matrix(parameters);
        let weights = MatRef::new(matrix, self.outputs, self.inputs).t();
        let x = MatRef::new(x, rows, self.inputs);
        gemm(MatMut::new(out, rows, self.outputs), false, <S as Real>::one(), x, weights);
    }

    /// `below = adjoint W`, or `below += adjoint W`.
    fn pull_back<S: Scalar>(&self, parameters: &[S], rows: usize, accumulate: bool, adjoint: &[S], below: &mut [S]) {
        let matrix = self.matrix(parameters);
        if self.outputs == 1 {
            return vectorized(
                #[inline(always)]
                || {
                    for lane in 0..rows {
                        let (row, a) = (&mut below[lane * self.inputs..][..self.inputs], adjoint[lane]);
                        update(row, matrix, |sum, w| *sum = if accumulate { *sum + a * w } else { a * w });
                    }
                },
            );
        }
        let weights = MatRef::new(matrix, self.outputs, self.inputs);
        let adjoint = MatRef::new(adjoint, rows, self.outputs);
        gemm(MatMut::new(below, rows, self.inputs), accumulate, <S as Real>::one(), adjoint, weights);
    }

    /// `gradient of W += adjoint^T x`.
    fn add_weights<S: Scalar>(&self, rows: usize, adjoint: &[S], x: &[S], gradient: &mut [S]) {
        let gradient = &mut gradient[self.weights..self.weights + self.inputs * self.outputs];
        let gradient = MatMut::new(gradient, self.outputs, self.inputs);
        let adjoint = MatRef::new(adjoint, rows, self.outputs).t();
        gemm(gradient, true, <S as Real>::one(), adjoint, MatRef::new(x, rows, self.inputs));
    }

    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let lanes = sweep.store.lanes;
        let rows = sweep.store.layout.count(out) * lanes;
        let (before, planes) = sweep.store.split(out);
        self.apply(sweep.parameters, rows, &before.all(self.x)[..rows * self.inputs], planes);
        if let Some(bias) = self.bias {
            let bias = &sweep.parameters[bias..bias + self.outputs];
            vectorized(
                #[inline(always)]
                || {
                    for lane in 0..lanes {
                        update(&mut planes[lane * self.outputs..][..self.outputs], bias, |x, b| *x += b);
                    }
                },
            );
        }
    }

    pub fn reverse<S: Scalar>(self, out: usize, sweep: &mut Reverse<'_, S>) {
        let accumulate = !sweep.kept.values[self.x].in_place;
        let (mut before, adjoint) = sweep.adjoints.reverse(out);
        self.pull_back(sweep.kept.parameters, before.lanes, accumulate, adjoint, before.plane_mut(self.x, 0));
    }

    /// The mixed channel is a product; the directions' channels are combinations of tangents already there.
    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let lanes = sweep.mixed.lanes;
        let [own, from] = [out, self.x].map(|value| sweep.kept.values[value].mixed(sweep.order));
        if let (Some(to), true) = (from.value, own.value.is_some()) {
            sweep.mixed.plane_mut(self.x, to).copy_from_slice(sweep.kept.forward.plane(self.x, 0));
        }
        let (before, planes) = sweep.mixed.split(out);
        let size = lanes * self.outputs;
        if let (Some(to), Some(from)) = (own.st, from.st) {
            self.apply(sweep.kept.parameters, lanes, before.plane(self.x, from), &mut planes[to * size..][..size]);
        }
        if sweep.order == Order::First {
            return;
        }
        let Mixed { s, t, .. } = own;
        let (forward, directions, n) = (sweep.kept.forward, sweep.directions, sweep.kept.scale.len());
        let velocities = &sweep.kept.values[out].velocities;
        let moving = directions.moving;
        vectorized(
            #[inline(always)]
            || {
                for lane in 0..lanes {
                    let row = lane * self.outputs..(lane + 1) * self.outputs;
                    let tangent = |channel: usize| &forward.plane(out, channel)[row.clone()];
                    if let Some(t) = t {
                        let plane = &mut planes[t * size..][row.clone()];
                        if moving {
                            plane.copy_from_slice(tangent(1));
                        } else {
                            plane.fill(<S as Real>::zero());
                        }
                    }
                    let (Some(s), Some(t)) = (s, t) else { continue };
                    let (before_t, from_t) = planes.split_at_mut(t * size);
                    let (plane_s, plane_t) = (&mut before_t[s * size..][row.clone()], &mut from_t[row.clone()]);
                    for (k, &i) in velocities.iter().enumerate() {
                        let (by_s, by_t) = (directions.s[lane * n + i], directions.t[lane * n + i]);
                        update(plane_s, tangent(2 + k), |s, e| *s = if k == 0 { by_s * e } else { *s + by_s * e });
                        update(plane_t, tangent(2 + k), |t, e| *t += by_t * e);
                    }
                }
            },
        );
    }

    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let lanes = sweep.adjoints.lanes;
        let (size_out, size_in) = (lanes * self.outputs, lanes * self.inputs);
        let [own, from] = [out, self.x].map(|value| sweep.channels(value));
        if let Some(st) = own.st {
            sweep.adjoints.plane_mut(out, st).copy_from_slice(sweep.value_adjoints.plane(out, 0));
        }
        let accumulate = !sweep.kept.values[self.x].in_place;
        let wanted = sweep.wants(self.x);
        let (mut before, adjoints) = sweep.adjoints.reverse(out);
        let x = sweep.mixed.all(self.x);
        let Some(value) = own.value else {
            // Terminal: of the channels of `x` only the mixed one counts.
            if let (Some(st), Some(from)) = (own.st, from.st) {
                let adjoint = &adjoints[st * size_out..][..size_out];
                self.add_weights(lanes, adjoint, &x[from * size_in..][..size_in], sweep.gradient);
            }
            return;
        };
        self.add_weights(own.count * lanes, adjoints, x, sweep.gradient);
        if let Some(bias) = self.bias {
            let plane = &adjoints[value * size_out..][..size_out];
            add_rows(plane, &mut sweep.gradient[bias..bias + self.outputs]);
        }
        if wanted {
            // The adjoint of the mixed channel, which comes last, equals that of the value and is already known.
            let rows = (own.count - usize::from(own.st.is_some())) * lanes;
            let below = &mut before.all_mut(self.x)[..rows * self.inputs];
            self.pull_back(sweep.kept.parameters, rows, accumulate, &adjoints[..rows * self.outputs], below);
        }
    }
}

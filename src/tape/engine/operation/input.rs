//! Coordinates and velocities.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Real, Scalar};

/// Input `index` of a state `(q, v)`: a coordinate below `n`, a velocity from there on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input {
    pub index: usize,
}

impl Input {
    /// Copies the column and places its tangents: `v_i` along `(v, 0)`, `s_i` along `e_i`.
    pub fn forward<S: Scalar>(self, out: usize, sweep: &mut Forward<'_, S>) {
        let n = sweep.scale.len();
        let (field, column) = if self.index < n { (sweep.q, self.index) } else { (sweep.v, self.index - n) };
        let lanes = sweep.store.lanes;
        let directions = sweep.store.layout.directions(out);
        let planes = sweep.store.all_mut(out);
        let (value, tangents) = planes.split_at_mut(lanes);
        value.iter_mut().zip(field.chunks_exact(n)).for_each(|(to, row)| *to = row[column]);
        for (plane, &direction) in tangents.chunks_exact_mut(lanes).zip(directions) {
            match direction {
                0 if self.index < n => {
                    plane.iter_mut().zip(sweep.v.chunks_exact(n)).for_each(|(to, v)| *to = v[column])
                }
                0 => plane.fill(<S as Real>::zero()),
                _ => plane.fill(sweep.scale[column]),
            }
        }
    }

    pub fn reverse<S: Scalar>(self, _out: usize, _sweep: &mut Reverse<'_, S>) {}

    /// `x_s = (0, s)`, `x_t = tau (v, 0) + (0, t)`, `x_st = -tau (s, 0)`; a first derivative has `x_st = (0, s)`.
    pub fn mixed<S: Scalar>(self, out: usize, sweep: &mut MixedForward<'_, S>) {
        let n = sweep.kept.scale.len();
        let channels = sweep.kept.values[out].mixed(sweep.order);
        let (directions, zero) = (sweep.directions, <S as Real>::zero());
        let (position, column) = (self.index < n, self.index % n);
        let scale = sweep.kept.scale[column];
        let mut place = |channel: Option<usize>, field: &[S], factor: S| {
            if let Some(channel) = channel {
                let plane = sweep.mixed.plane_mut(out, channel);
                if factor == zero {
                    plane.fill(zero);
                } else {
                    plane.iter_mut().zip(field.chunks_exact(n)).for_each(|(to, row)| *to = factor * row[column]);
                }
            }
        };
        let moving = if directions.moving { <S as Real>::one() } else { zero };
        if position {
            place(channels.t, sweep.v, moving);
            place(channels.st, &directions.s, if sweep.order == super::Order::Second { -moving * scale } else { zero });
        } else {
            place(channels.s, &directions.s, scale);
            place(channels.t, &directions.t, scale);
            place(channels.st, &directions.s, if sweep.order == super::Order::First { scale } else { zero });
        }
    }

    /// Adjoints of the scaled state; the second direction holds `v` itself if it is moving.
    pub fn mixed_reverse<S: Scalar>(self, out: usize, sweep: &mut MixedReverse<'_, S>) {
        let n = sweep.kept.scale.len();
        let channels = sweep.channels(out);
        let (position, column) = (self.index < n, self.index % n);
        let scale = sweep.kept.scale[column];
        let Some((dq, dv)) = &mut sweep.inputs else { return };
        let mut add = |field: &mut [S], channel: Option<usize>| {
            if let Some(channel) = channel {
                let plane = sweep.adjoints.plane_mut(out, channel);
                field.chunks_exact_mut(n).zip(plane).for_each(|(row, b)| row[column] += scale * *b);
            }
        };
        if position {
            add(dq, channels.value);
            if sweep.moving {
                add(dv, channels.t);
            }
        } else {
            add(dv, channels.value);
        }
    }
}

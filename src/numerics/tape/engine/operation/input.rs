//! Coordinates and velocities.

use super::{Forward, MixedForward, MixedReverse, Reverse};
use crate::scalar::{Column, Real, Scalar, update_column};

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
        update_column(lanes, Column::all(value), Column::new(field, column, n), |to, x| *to = x);
        for (plane, &direction) in tangents.chunks_exact_mut(lanes).zip(directions) {
            match direction {
                0 if self.index < n => {
                    update_column(lanes, Column::all(plane), Column::new(sweep.v, column, n), |to, v| *to = v);
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
                    let (rows, field) = (plane.len(), Column::new(field, column, n));
                    update_column(rows, Column::all(plane), field, |to, x| *to = factor * x);
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
                let (rows, field) = (plane.len(), Column::new(field, column, n));
                update_column(rows, field, Column::all(plane), |to, b| *to += scale * b);
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

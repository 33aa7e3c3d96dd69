//! Programs of the derivatives in the equations of motion, recorded from the program of a Lagrangian's value.

use super::Request;
use super::elimination::Lists;
use crate::scalar::{Real, Scalar};
use crate::tape::{Depth, Directions, Program, ROWS, TANGENTS, Tracer};
use alloc::vec::Vec;

/// The derivatives of a Lagrangian at a traced state.
pub(super) struct Recorded<'t, S> {
    pub value: Tracer<'t, S>,
    pub momentum: Vec<Tracer<'t, S>>,
    pub dl_dq: Vec<Tracer<'t, S>>,
    /// The lower triangle of `M`.
    pub mass_matrix: Lists<Tracer<'t, S>>,
    pub coriolis: Vec<Tracer<'t, S>>,
}

/// Records the needed derivatives; returns `None` if there are too many.
pub(super) fn derivatives<'t, S: Scalar>(
    value: &Program<S>,
    state: &[Tracer<'t, S>],
    parameters: &[Tracer<'t, S>],
    need: Request,
) -> Option<Recorded<'t, S>> {
    let n = state.len() / 2;
    // Each velocity has a separate direction, and all coordinates move along `(v, 0)`.
    let seed = |input: usize| match input.checked_sub(n) {
        Some(i) => vec![(i as u32, Tracer::one())],
        None => vec![(n as u32, state[n + input])],
    };
    let directions = Directions {
        seeds: (0..2 * n).map(seed).collect(),
        rows: (0..2 * n).map(|input| input.checked_sub(n).map(|i| i as u32)).collect(),
        shared: n as u32,
        budget: TANGENTS,
    };
    let directions = (need.depth() > Depth::Gradient).then_some(&directions);
    let mut found = value.derivatives(state, parameters, directions)?;
    let momentum = found.first.split_off(n);
    let (mut mass_matrix, mut coriolis) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for mut row in found.second.split_off(n) {
        let moving = row.pop_if(|(direction, _)| *direction as usize == n);
        coriolis.push(moving.map_or(Tracer::zero(), |(_, c)| c));
        mass_matrix.push(row.into_iter().map(|(j, m)| (j as usize, m)).collect());
    }
    Some(Recorded { value: found.value, momentum, dl_dq: found.first, mass_matrix, coriolis })
}

/// Records the program of the needed terms, in the order `L`, `p`, `g`, `M`, `c`; returns `None` if it is too large.
pub(super) fn program_of_terms<S: Scalar>(value: &Program<S>, need: Request) -> Option<Program<S>> {
    let n = value.inputs() / 2;
    let record = Program::record_within(ROWS, (2 * n, value.parameters()), |state, parameters| {
        let found = derivatives(value, state, parameters, need)?;
        let mut outputs = Vec::new();
        if need.includes(Request::LAGRANGIAN) {
            outputs.push(found.value);
        }
        if need.includes(Request::MOMENTUM) {
            outputs.extend(found.momentum);
        }
        if need.includes(Request::DL_DQ) {
            outputs.extend(found.dl_dq);
        }
        if need.includes(Request::MASS_MATRIX) {
            let start = outputs.len();
            outputs.resize(start + n * n, Tracer::zero());
            for (i, row) in found.mass_matrix.into_iter().enumerate() {
                for (j, m) in row {
                    outputs[start + i * n + j] = m;
                    outputs[start + j * n + i] = m;
                }
            }
        }
        if need.includes(Request::CORIOLIS) {
            outputs.extend(found.coriolis);
        }
        Some(outputs)
    });
    record.ok()
}

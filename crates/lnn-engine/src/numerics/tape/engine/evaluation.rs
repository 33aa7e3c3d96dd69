//! Sweeps over a recorded Lagrangian on a chunk of states.

use super::kernel::resize;
use super::operation::{Forward, Kept, MixedForward, MixedReverse, PARTIALS, Reverse, SecondOrder};
use super::value::{Dependence, Order, Store, View};
use super::{Recorded, STATES};
use crate::scalar::{Column, Real, Scalar, compiled, update_column};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Directions of mixed Taylor coefficients `L_st`, one of every state; vectors are in scaled coordinates.
#[derive(Clone, Debug, Default)]
pub struct MixedDirections<S> {
    /// Velocity direction `s`, `(states, n)`; zeros leave a state out.
    pub s: Vec<S>,
    /// Velocity direction `t`, `(states, n)`.
    pub t: Vec<S>,
    /// `true` if the second direction moves along `(v, 0)` too (`tau = 1`).
    pub moving: bool,
}

impl<S> MixedDirections<S> {
    /// Forgets all directions; keeps the buffers.
    pub fn clear(&mut self, moving: bool) {
        self.s.clear();
        self.t.clear();
        self.moving = moving;
    }
}

/// A recorded Lagrangian on a chunk of at most [`STATES`] states, and everything computed of it; buffers are reused from call to
/// call. All results are in scaled coordinates.
#[derive(Debug)]
pub struct Evaluation<S> {
    recorded: Arc<Recorded<S>>,
    lanes: usize,
    q: Vec<S>,
    v: Vec<S>,
    numbers: Vec<S>,
    adjoints: Vec<S>,
    slopes: [Vec<S>; 3],
    partials: Vec<S>,
    mixed: Vec<S>,
    mixed_adjoints: Vec<S>,
    second: SecondOrder<S>,
    /// `L`, `(batch)`.
    pub lagrangian: Vec<S>,
    /// `dL/d(v/s)`, `(batch, n)`.
    pub momentum: Vec<S>,
    /// `dL/d(q/s)`, `(batch, n)`.
    pub dl_dq: Vec<S>,
    /// `d2L/d(v/s)2`, `(batch, n, n)`.
    pub mass_matrix: Vec<S>,
    /// `(d2L/d(v/s)d(q/s)) v/s`, `(batch, n)`.
    pub coriolis: Vec<S>,
}

impl<S: Scalar> Clone for Evaluation<S> {
    fn clone(&self) -> Self {
        Self::new(Arc::clone(&self.recorded))
    }
}

impl<S: Scalar> Evaluation<S> {
    /// Buffers for a Lagrangian.
    pub fn new(recorded: Arc<Recorded<S>>) -> Self {
        Self {
            recorded,
            lanes: 0,
            q: Vec::new(),
            v: Vec::new(),
            numbers: Vec::new(),
            adjoints: Vec::new(),
            slopes: Default::default(),
            partials: Vec::new(),
            mixed: Vec::new(),
            mixed_adjoints: Vec::new(),
            second: SecondOrder::default(),
            lagrangian: Vec::new(),
            momentum: Vec::new(),
            dl_dq: Vec::new(),
            mass_matrix: Vec::new(),
            coriolis: Vec::new(),
        }
    }

    /// The Lagrangian.
    pub(crate) fn recorded(&self) -> &Arc<Recorded<S>> {
        &self.recorded
    }

    /// Evaluates states `q`, `v`, both `(batch, n)` in physical units with `batch <= STATES`, with these parameters.
    ///
    /// Fills the public fields up to `depth`; fields beyond are empty.
    ///
    /// # Panics
    /// Panics if there are more than [`STATES`] states or too few parameters.
    pub fn evaluate(&mut self, parameters: &[S], q: &[S], v: &[S], depth: Depth) {
        (Routines::get().evaluate)(self, parameters, (q, v), depth);
    }

    fn sweep(&mut self, parameters: &[S], (q, v): (&[S], &[S]), depth: Depth) {
        let recorded = Arc::clone(&self.recorded);
        let n = recorded.coordinates();
        let lanes = q.len() / n;
        assert!(lanes <= STATES && v.len() == q.len() && parameters.len() >= recorded.parameters, "a chunk of states");
        self.lanes = lanes;
        for (own, given) in [(&mut self.q, q), (&mut self.v, v)] {
            own.clear();
            own.extend_from_slice(given);
        }
        let layout = recorded.layout(depth);
        resize(&mut self.numbers, layout.total * lanes);
        let kept = match depth {
            Depth::Training => 3,
            Depth::MassMatrix | Depth::Motion => 2,
            _ => 1,
        };
        self.slopes.iter_mut().take(kept).for_each(|slopes| resize(slopes, recorded.slopes * lanes));
        resize(&mut self.partials, recorded.functions * PARTIALS * lanes);
        let mut sweep = Forward {
            values: &recorded.values,
            store: Store { layout, lanes, numbers: &mut self.numbers },
            depth,
            slopes: &mut self.slopes,
            partials: &mut self.partials,
            parameters,
            q,
            v,
            scale: &recorded.scale,
        };
        for (out, operation) in recorded.operations.iter().enumerate() {
            operation.forward(out, &mut sweep);
        }
        let fields = [&mut self.lagrangian, &mut self.momentum, &mut self.dl_dq, &mut self.mass_matrix];
        fields.into_iter().chain([&mut self.coriolis]).for_each(Vec::clear);
        self.lagrangian.extend_from_slice(sweep.store.view().plane(recorded.output, 0));
        if depth >= Depth::Gradient {
            self.reverse(&recorded, parameters, depth);
        }
    }

    /// The reverse sweep of the value, and the second derivatives along the way.
    fn reverse(&mut self, recorded: &Recorded<S>, parameters: &[S], depth: Depth) {
        let (n, lanes, zero) = (recorded.coordinates(), self.lanes, <S as Real>::zero());
        resize(&mut self.adjoints, recorded.adjoint.total * lanes);
        self.second.start(n, lanes, depth >= Depth::Motion);
        let mut sweep = Reverse {
            kept: Kept {
                values: &recorded.values,
                forward: View { layout: recorded.layout(depth), lanes, numbers: &self.numbers },
                slopes: &self.slopes,
                partials: &self.partials,
                parameters,
                scale: &recorded.scale,
            },
            adjoints: Store { layout: &recorded.adjoint, lanes, numbers: &mut self.adjoints },
            depth,
            second: &mut self.second,
        };
        for (value, _) in recorded.values.iter().enumerate().filter(|(_, value)| !value.in_place) {
            sweep.adjoints.all_mut(value).fill(zero);
        }
        sweep.adjoints.all_mut(recorded.output).fill(<S as Real>::one());
        for (out, operation) in recorded.operations.iter().enumerate().rev() {
            if recorded.values[out].kind != Dependence::Constant {
                operation.reverse(out, &mut sweep);
            }
        }
        let adjoints = sweep.adjoints.view();
        let by = |field: &mut Vec<S>, first: usize| {
            field.resize(lanes * n, zero);
            for (i, input) in recorded.inputs[first..first + n].iter().enumerate() {
                let Some(input) = *input else { continue };
                let (scale, adjoint) = (recorded.scale[i], Column::all(adjoints.plane(input, 0)));
                update_column(lanes, Column::new(field, i, n), adjoint, |to, a| *to = a * scale);
            }
        };
        by(&mut self.dl_dq, 0);
        by(&mut self.momentum, n);
        if depth >= Depth::MassMatrix {
            self.mass_matrix.resize(lanes * n * n, zero);
            for i in 0..n {
                for j in i..n {
                    let plane = &self.second.mass[SecondOrder::<S>::pair(n, i, j) * lanes..][..lanes];
                    for place in [i * n + j, j * n + i] {
                        let element = Column::new(&mut self.mass_matrix[..], place, n * n);
                        update_column(lanes, element, Column::all(plane), |to, m| *to = m);
                    }
                }
            }
        }
        if depth >= Depth::Motion {
            self.coriolis.resize(lanes * n, zero);
            for (i, plane) in self.second.drift.chunks_exact(lanes).enumerate() {
                let column = Column::new(&mut self.coriolis[..], i, n);
                update_column(lanes, column, Column::all(plane), |to, c| *to = c);
            }
        }
    }

    /// Adds to `gradient` the derivative of the sum over the states of `L_st` by every parameter, and to `inputs`, both
    /// `(batch, n)`, those by the scaled states `q/s`, `v/s` with `s`, `t` held fixed.
    ///
    /// With `s = -M^-1 u`, `t = a` and moving directions these are `u da/dtheta`, `u da/dq` and `u da/dv` of the accelerations `a = M^-1 (g
    /// - c)`. The states are those evaluated last, to [`Depth::Training`], with these parameters; all their numbers must be finite.
    pub fn add_gradient(
        &mut self,
        parameters: &[S],
        directions: &MixedDirections<S>,
        gradient: &mut [S],
        inputs: Option<(&mut [S], &mut [S])>,
    ) {
        (Routines::get().add_mixed)(self, Order::Second, parameters, directions, gradient, inputs);
    }

    /// Gradient of the first derivative `u . dL/d(v/s)`, with `u` the directions' `s`.
    pub fn add_momentum_gradient(
        &mut self,
        parameters: &[S],
        directions: &MixedDirections<S>,
        gradient: &mut [S],
        inputs: Option<(&mut [S], &mut [S])>,
    ) {
        (Routines::get().add_mixed)(self, Order::First, parameters, directions, gradient, inputs);
    }

    fn add_mixed(
        &mut self,
        order: Order,
        parameters: &[S],
        directions: &MixedDirections<S>,
        gradient: &mut [S],
        inputs: Option<(&mut [S], &mut [S])>,
    ) {
        let recorded = Arc::clone(&self.recorded);
        let (lanes, layout) = (self.lanes, recorded.mixed_layout(order));
        let kept = || Kept {
            values: &recorded.values,
            forward: View { layout: recorded.layout(Depth::Training), lanes, numbers: &self.numbers },
            slopes: &self.slopes,
            partials: &self.partials,
            parameters,
            scale: &recorded.scale,
        };
        resize(&mut self.mixed, layout.total * lanes);
        resize(&mut self.mixed_adjoints, layout.total * lanes);
        let mut sweep = MixedForward {
            kept: kept(),
            mixed: Store { layout, lanes, numbers: &mut self.mixed },
            order,
            directions,
            v: &self.v,
        };
        for (out, operation) in recorded.operations.iter().enumerate() {
            operation.mixed(out, &mut sweep);
        }
        let mut sweep = MixedReverse {
            kept: kept(),
            value_adjoints: View { layout: &recorded.adjoint, lanes, numbers: &self.adjoints },
            mixed: View { layout, lanes, numbers: &self.mixed },
            adjoints: Store { layout, lanes, numbers: &mut self.mixed_adjoints },
            order,
            gradient,
            inputs,
            moving: directions.moving,
        };
        for (value, _) in recorded.values.iter().enumerate().filter(|(_, value)| !value.in_place) {
            sweep.adjoints.all_mut(value).fill(<S as Real>::zero());
        }
        for (out, operation) in recorded.operations.iter().enumerate().rev() {
            if sweep.wants(out) {
                operation.mixed_reverse(out, &mut sweep);
            }
        }
    }
}

/// The sweeps of an evaluation, which are compiled once for each scalar.
#[derive(Clone, Copy)]
struct Routines<S> {
    evaluate: EvaluateOf<S>,
    add_mixed: AddMixedOf<S>,
}

type EvaluateOf<S> = fn(&mut Evaluation<S>, &[S], (&[S], &[S]), Depth);
type Inputs<'a, S> = Option<(&'a mut [S], &'a mut [S])>;
type AddMixedOf<S> = fn(&mut Evaluation<S>, Order, &[S], &MixedDirections<S>, &mut [S], Inputs<'_, S>);

impl<S: Scalar> Routines<S> {
    const ALL: Self = Self { evaluate: Evaluation::sweep, add_mixed: Evaluation::add_mixed };
}

compiled!(Tapes, Routines);

/// Depth of an evaluation of a Lagrangian; each step includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// `L`: one pass.
    Value,
    /// `p`, `g`: two passes.
    Gradient,
    /// `M`: `n + 2` passes.
    MassMatrix,
    /// `c`: `n + 3` passes.
    Motion,
    /// As `Motion`, keeping the data for gradients of losses.
    Training,
}

//! Values of a recorded Lagrangian: vectors of numbers per state, and the channels each of them carries.
//!
//! A value of `units` numbers on a chunk of `lanes` states is a stack of planes `(lanes, units)`, one plane per channel: the value itself,
//! then its derivatives along directions of the inputs. A value carries only channels that it can have: a constant has no derivatives, a
//! value that depends on positions alone has none along velocities, and a value that reaches `L` by linear operations only needs no
//! tangents.

use super::Depth;
use alloc::vec::Vec;
use core::ops::Range;

/// Dependence of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Dependence {
    /// Parameters and constants alone.
    Constant,
    /// Positions, no velocity.
    Position,
    /// Velocities, perhaps positions too.
    Velocity,
}

/// A vector of numbers per state.
#[derive(Clone, Debug)]
pub(super) struct Value {
    pub units: usize,
    pub kind: Dependence,
    /// The velocities it depends on, ascending.
    pub velocities: Vec<usize>,
    /// It reaches `L` by operations that are linear in the varying values.
    pub is_output: bool,
    /// It depends on parameters.
    pub trainable: bool,
    /// `true` if the only reader overwrites the adjoints, so that they need not be set to zero.
    pub in_place: bool,
}

/// Channels of mixed sweeps that a value carries, in this order; its adjoints have the same layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mixed {
    /// The value, for products that take all channels at once.
    pub value: Option<usize>,
    /// The derivative along the first direction.
    pub s: Option<usize>,
    /// The derivative along the second.
    pub t: Option<usize>,
    /// The mixed coefficient.
    pub st: Option<usize>,
    pub count: usize,
}

/// Which directions a mixed sweep has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// Only that of `x_st`: a first derivative.
    First,
    /// Both.
    Second,
}

impl Value {
    /// Directions of the tangents of the forward sweep: `(v, 0)` is 0, the velocity `e_i` is `1 + i`.
    fn directions(&self, depth: Depth) -> Vec<usize> {
        let mut directions = Vec::new();
        if !self.is_output && self.kind != Dependence::Constant {
            if depth >= Depth::Motion {
                directions.push(0);
            }
            if depth >= Depth::MassMatrix {
                directions.extend(self.velocities.iter().map(|i| 1 + i));
            }
        }
        directions
    }

    /// Channels of a mixed sweep.
    pub fn mixed(&self, order: Order) -> Mixed {
        let moving = self.kind != Dependence::Constant;
        let second = order == Order::Second && !self.is_output;
        let carried = [!self.is_output, second && self.kind == Dependence::Velocity, second && moving, moving];
        let mut count = 0;
        let [value, s, t, st] = carried.map(|carried| {
            count += usize::from(carried);
            carried.then(|| count - 1)
        });
        Mixed { value, s, t, st, count }
    }
}

/// Offsets of the planes of all values in a buffer, in numbers per state.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    starts: Vec<usize>,
    units: Vec<usize>,
    counts: Vec<usize>,
    pub total: usize,
    /// Directions of the channels from the first tangent on.
    directions: Vec<Vec<usize>>,
    /// Channel of every value and direction, 0 if there is none.
    channels: Vec<usize>,
    width: usize,
}

impl Layout {
    pub fn new(values: &[Value], count: impl Fn(&Value) -> usize) -> Self {
        let counts: Vec<usize> = values.iter().map(count).collect();
        let mut total = 0;
        let place = |(value, &count): (&Value, &usize)| {
            total += value.units * count;
            total - value.units * count
        };
        let starts = values.iter().zip(&counts).map(place).collect();
        let units = values.iter().map(|value| value.units).collect();
        Self { starts, units, counts, total, directions: Vec::new(), channels: Vec::new(), width: 0 }
    }
    /// Channels of the forward sweep.
    pub fn forward(values: &[Value], depth: Depth, n: usize) -> Self {
        let directions: Vec<Vec<usize>> = values.iter().map(|value| value.directions(depth)).collect();
        let mut channels = vec![0; values.len() * (n + 1)];
        for (own, channels) in directions.iter().zip(channels.chunks_exact_mut(n + 1)) {
            own.iter().enumerate().for_each(|(k, &direction)| channels[direction] = k + 1);
        }
        let layout = Self::new(values, |value| 1 + value.directions(depth).len());
        Self { directions, channels, width: n + 1, ..layout }
    }
    /// Number of channels of a value.
    #[inline]
    pub fn count(&self, value: usize) -> usize {
        self.counts[value]
    }
    /// Directions of the tangents of a value, in the order of its channels from 1 on.
    #[inline]
    pub fn directions(&self, value: usize) -> &[usize] {
        &self.directions[value]
    }
    #[inline]
    fn range(&self, value: usize, lanes: usize) -> Range<usize> {
        let start = self.starts[value] * lanes;
        start..start + self.counts[value] * self.units[value] * lanes
    }
}

/// Numbers of all values by a layout.
pub(super) struct Store<'a, S> {
    pub layout: &'a Layout,
    pub lanes: usize,
    pub numbers: &'a mut [S],
}

/// Stored values, for reading.
#[derive(Clone, Copy)]
pub(super) struct View<'a, S> {
    pub layout: &'a Layout,
    pub lanes: usize,
    pub numbers: &'a [S],
}

impl<'a, S> View<'a, S> {
    /// All planes of a value.
    #[inline]
    pub fn all(&self, value: usize) -> &'a [S] {
        &self.numbers[self.layout.range(value, self.lanes)]
    }
    /// One plane of a value.
    #[inline]
    pub fn plane(&self, value: usize, channel: usize) -> &'a [S] {
        let size = self.layout.units[value] * self.lanes;
        &self.all(value)[channel * size..(channel + 1) * size]
    }
    /// The tangent along a direction, if the value has one.
    #[inline]
    pub fn tangent(&self, value: usize, direction: usize) -> Option<&'a [S]> {
        let channel = self.layout.channels[value * self.layout.width + direction];
        (channel > 0).then(|| self.plane(value, channel))
    }
}

impl<S> Store<'_, S> {
    #[inline]
    pub fn view(&self) -> View<'_, S> {
        View { layout: self.layout, lanes: self.lanes, numbers: self.numbers }
    }
    /// The values before a value, and the planes of the value itself.
    #[inline]
    pub fn split(&mut self, value: usize) -> (View<'_, S>, &mut [S]) {
        let range = self.layout.range(value, self.lanes);
        let (before, rest) = self.numbers.split_at_mut(range.start);
        (View { layout: self.layout, lanes: self.lanes, numbers: before }, &mut rest[..range.end - range.start])
    }
    /// The planes of earlier values, to be added to, and those of a value.
    #[inline]
    pub fn reverse(&mut self, value: usize) -> (Store<'_, S>, &[S]) {
        let range = self.layout.range(value, self.lanes);
        let (before, rest) = self.numbers.split_at_mut(range.start);
        (Store { layout: self.layout, lanes: self.lanes, numbers: before }, &rest[..range.end - range.start])
    }
    #[inline]
    pub fn all_mut(&mut self, value: usize) -> &mut [S] {
        &mut self.numbers[self.layout.range(value, self.lanes)]
    }
    #[inline]
    pub fn plane_mut(&mut self, value: usize, channel: usize) -> &mut [S] {
        let size = self.layout.units[value] * self.lanes;
        &mut self.all_mut(value)[channel * size..(channel + 1) * size]
    }
}

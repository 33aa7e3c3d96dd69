//! Memory and arithmetic of the numbers with which a Lagrangian is evaluated.

use super::form::{self, Basis, Expansion};
use super::function::Function;
use super::interval::Interval;
use super::thresholds::LANES;
use crate::ops::Unary;
use crate::scalar::vectorized;
use std::cell::{Cell, RefCell};
use std::sync::Arc;

/// A number of an [`Arena`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub pack: u32,
    pub lane: u32,
}

/// Memory of all numbers of one evaluation, in packs of up to [`LANES`]: the units of a layer lie side by side.
///
/// A number has `1 + n + n (n + 1)/2` forms of [`Basis::stride`] coefficients: the value, `n` first derivatives, and the second derivatives
/// with `j <= i`, row by row.
pub struct Arena {
    pub basis: Arc<Basis>,
    /// Directions of the derivatives.
    n: usize,
    parts: usize,
    /// Coefficients of all packs, one pack after the other; in a pack the same coefficient of all its numbers lies side by side.
    forms: RefCell<Vec<f64>>,
    packs: RefCell<Vec<Pack>>,
    /// Set when a value was read: the Lagrangian may have branched on it.
    read: Cell<bool>,
    /// Bits of the axes that a function depended on where it is not known.
    blamed: Cell<u64>,
}

/// Numbers side by side, with the requested functions of them.
struct Pack {
    layout: Layout,
    /// Requested functions of all numbers in the pack.
    functions: Vec<(Function, u32)>,
}

/// Range of the coefficients of a pack.
#[derive(Clone, Copy)]
struct Layout {
    /// Index of the first coefficient.
    start: usize,
    /// Places side by side: one for a single number, [`LANES`] otherwise.
    width: usize,
    /// Numbers in them.
    lanes: usize,
}

/// Slots side by side for a count of numbers.
pub fn width(lanes: usize) -> usize {
    if lanes == 1 { 1 } else { LANES }
}

impl Arena {
    /// For `n` coordinates.
    pub fn new(n: usize, basis: &Arc<Basis>) -> Self {
        let parts = 1 + n + n * (n + 1) / 2;
        let (basis, read, blamed) = (Arc::clone(basis), Cell::new(false), Cell::new(0));
        Self { basis, n, parts, forms: RefCell::default(), packs: RefCell::default(), read, blamed }
    }
    /// Removes all numbers.
    pub fn clear(&self) {
        self.forms.borrow_mut().clear();
        self.packs.borrow_mut().clear();
        self.read.set(false);
        self.blamed.set(0);
    }
    /// Records that a value was read.
    pub fn note_read(&self) {
        self.read.set(true);
    }
    /// `true` if a value was read since the arena was cleared.
    pub fn was_read(&self) -> bool {
        self.read.get()
    }
    /// Bits of the axes along which to cut a box so that what is unknown may become known.
    pub fn blamed(&self) -> u64 {
        self.blamed.get()
    }
    /// Records the axes on which the value of a number depends.
    pub fn blame(&self, place: Place) {
        self.blame_form(&self.form(place, 0), 0);
    }
    fn blame_form<const W: usize>(&self, form: &[[f64; W]], lane: usize) {
        if !form::deviation(form)[lane].is_finite() {
            // The axes were recorded where the unbounded value arose.
            return;
        }
        let dependent = (1..self.basis.count()).filter(|&k| form[k][lane] != 0.0);
        let axes = dependent.flat_map(|k| self.basis.factors(k));
        self.blamed.set(axes.fold(self.blamed.get(), |bits, axis| bits | 1 << (axis % 64)));
    }
    /// Coefficients of a number.
    pub fn block(&self) -> usize {
        self.parts * self.basis.stride()
    }
    /// Place of the second derivative along `i` and `j`.
    pub fn second(&self, i: usize, j: usize) -> usize {
        let (i, j) = (i.max(j), i.min(j));
        1 + self.n + i * (i + 1) / 2 + j
    }

    fn layout(&self, pack: u32) -> Layout {
        self.packs.borrow()[pack as usize].layout
    }
    /// The coefficients of a pack.
    fn of<'f>(&self, forms: &'f [f64], Layout { start, width, .. }: Layout) -> &'f [f64] {
        &forms[start..start + self.block() * width]
    }

    /// Makes packs of `lanes` numbers each; `fill` receives the coefficients of all earlier packs and those of the new ones, which are
    /// zeros.
    pub fn make(&self, lanes: &[usize], fill: impl FnOnce(&[f64], &mut [f64])) -> u32 {
        let (mut forms, mut packs) = (self.forms.borrow_mut(), self.packs.borrow_mut());
        let (first, before) = (packs.len(), forms.len());
        let mut start = before;
        for &lanes in lanes {
            let layout = Layout { start, width: width(lanes), lanes };
            packs.push(Pack { layout, functions: Vec::new() });
            start += self.block() * layout.width;
        }
        forms.resize(start, 0.0);
        let (earlier, new) = forms.split_at_mut(before);
        fill(earlier, new);
        first as u32
    }
    /// Makes one number.
    fn single(&self, fill: impl FnOnce(&[f64], &mut [[f64; 1]])) -> Place {
        Place { pack: self.make(&[1], |earlier, new| fill(earlier, new.as_chunks_mut().0)), lane: 0 }
    }
    /// Passes the coefficients of a pack, and how many lie side by side, to `read`.
    pub fn look<T>(&self, pack: u32, read: impl FnOnce(&[f64], usize) -> T) -> T {
        let layout = self.layout(pack);
        read(self.of(&self.forms.borrow(), layout), layout.width)
    }
    /// A form of a number.
    pub fn form(&self, place: Place, part: usize) -> Vec<[f64; 1]> {
        let stride = self.basis.stride();
        let lane = place.lane as usize;
        self.look(place.pack, |forms, width| {
            (part * stride..(part + 1) * stride).map(|k| [forms[k * width + lane]]).collect()
        })
    }
    /// Every value of a number on the box.
    pub fn range(&self, place: Place) -> Interval {
        form::range(&self.basis, &self.form(place, 0), 0)
    }
    /// `true` for the function 0.
    pub fn is_zero(&self, place: Place) -> bool {
        self.look(place.pack, |forms, width| forms.iter().skip(place.lane as usize).step_by(width).all(|x| *x == 0.0))
    }

    /// A number that is equal to axis `axis` of the box, whose ends are those of `range`, and whose derivative along `direction` is 1.
    pub fn variable(&self, axis: usize, range: Interval, direction: Option<usize>) -> Place {
        self.single(|_, new| {
            (new[0][0], new[1 + axis][0]) = (range.middle(), range.radius());
            if let Some(i) = direction {
                new[(1 + i) * self.basis.stride()][0] = 1.0;
            }
        })
    }
    /// The unbounded value (top).
    pub fn unknown(&self) -> Place {
        self.single(|_, new| new.fill([f64::NAN]))
    }

    /// The pack of a single number, copied if it shares a pack with others.
    fn alone(&self, place: Place) -> Layout {
        let layout = self.layout(place.pack);
        if layout.width == 1 {
            return layout;
        }
        let copy = self.single(|earlier, new| {
            let old = self.of(earlier, layout).iter().skip(place.lane as usize).step_by(layout.width);
            new.iter_mut().zip(old).for_each(|(new, old)| *new = [*old]);
        });
        self.layout(copy.pack)
    }

    /// A function of a number; those of its pack are computed with it and stored.
    pub fn function(&self, f: Function, place: Place) -> Place {
        let known = {
            let packs = self.packs.borrow();
            packs[place.pack as usize].functions.iter().find(|(known, _)| *known == f).map(|(_, pack)| *pack)
        };
        let pack = known.unwrap_or_else(|| self.function_of_pack(f, place.pack));
        Place { pack, lane: place.lane }
    }

    fn function_of_pack(&self, f: Function, pack: u32) -> u32 {
        let layout = self.layout(pack);
        let made = self.make(&[layout.lanes], |earlier, new| {
            let old = self.of(earlier, layout);
            if layout.width == 1 {
                self.write_function::<1>(f, layout.lanes, old.as_chunks().0, new.as_chunks_mut().0);
            } else {
                self.write_function::<LANES>(f, layout.lanes, old.as_chunks().0, new.as_chunks_mut().0);
            }
        });
        self.packs.borrow_mut()[pack as usize].functions.push((f, made));
        made
    }

    /// A function of numbers side by side.
    fn write_function<const W: usize>(&self, f: Function, lanes: usize, old: &[[f64; W]], new: &mut [[f64; W]]) {
        let (basis, n, parts, stride) = (&*self.basis, self.n, self.parts, self.basis.stride());
        let part = |k: usize| &old[k * stride..(k + 1) * stride];
        let z = part(0);
        let flat = (1..parts).all(|k| form::is_zero(part(k)));
        let orders = if flat { 1 } else { 3 };
        let mut expansions = [Expansion::<W>::ZERO; 3];
        let distance = form::deviation(z);
        for lane in 0..lanes {
            let (at, over) = f.about(z[0][lane], distance[lane]);
            for (order, expansion) in expansions[..orders].iter_mut().enumerate() {
                expansion.set(lane, (&at, &over), distance[lane], (order, basis.degree()));
            }
            if !over.iter().all(|x| x.is_bounded()) {
                self.blame_form(z, lane);
            }
        }
        // The powers of the deviation from the middle, the derivatives of the function, and the terms that give second derivatives from
        // first ones.
        let mut scratch = vec![[0.0; W]; (basis.degree() + 2 + n) * stride];
        let (powers, rest) = scratch.split_at_mut(basis.degree() * stride);
        let (first, rest) = rest.split_at_mut(stride);
        let (second, bent) = rest.split_at_mut(stride);
        vectorized(
            #[inline(always)]
            || {
                powers[..stride].copy_from_slice(z);
                powers[0] = [0.0; W];
                for p in 1..basis.degree() {
                    let (lower, power) = powers.split_at_mut(p * stride);
                    form::add_product(basis, &mut power[..stride], &lower[(p - 1) * stride..], &lower[..stride]);
                }
                expansions[0].write(basis, &mut new[..stride], powers);
                if flat {
                    return;
                }
                expansions[1].write(basis, first, powers);
                expansions[2].write(basis, second, powers);
                for (i, bent) in bent.chunks_exact_mut(stride).enumerate() {
                    form::add_product(basis, bent, second, part(1 + i));
                }
                for (k, new) in new.chunks_exact_mut(stride).enumerate().skip(1) {
                    form::add_product(basis, new, first, part(k));
                }
                for i in 0..n {
                    for j in 0..=i {
                        let k = self.second(i, j);
                        let bent = &bent[i * stride..(i + 1) * stride];
                        form::add_product(basis, &mut new[k * stride..(k + 1) * stride], bent, part(1 + j));
                    }
                }
            },
        );
    }

    /// `constant + sum_k s_k x_k` of a few numbers.
    pub fn combine(&self, terms: &[(Interval, Place)], constant: Interval) -> Place {
        let stride = self.basis.stride();
        let terms: Vec<(Interval, Layout)> = terms.iter().map(|&(factor, place)| (factor, self.alone(place))).collect();
        self.single(|earlier, new| {
            if constant != Interval::ZERO {
                form::set_constant(&mut new[..stride], 0, constant);
            }
            vectorized(
                #[inline(always)]
                || {
                    for &(factor, layout) in &terms {
                        let (old, _) = self.of(earlier, layout).as_chunks::<1>();
                        let forms = new.chunks_exact_mut(stride).zip(old.chunks_exact(stride));
                        forms.for_each(|(new, old)| form::add_multiple(new, factor, old));
                    }
                },
            );
        })
    }

    /// The product of two numbers.
    pub fn product(&self, a: Place, b: Place) -> Place {
        if a == b && self.layout(a.pack).width > 1 {
            // The square of a unit of a layer is computed together with its neighbours.
            return self.function(Function::Table(Unary::Powi(2)), a);
        }
        let (basis, n, stride) = (&*self.basis, self.n, self.basis.stride());
        let (a, b) = (self.alone(a), self.alone(b));
        self.single(|earlier, new| {
            let (a, b) = (self.of(earlier, a).as_chunks::<1>().0, self.of(earlier, b).as_chunks::<1>().0);
            let part_a = |k: usize| &a[k * stride..(k + 1) * stride];
            let part_b = |k: usize| &b[k * stride..(k + 1) * stride];
            vectorized(
                #[inline(always)]
                || {
                    for (k, out) in new.chunks_exact_mut(stride).enumerate() {
                        form::add_product(basis, out, part_a(0), part_b(k));
                        if k > 0 {
                            form::add_product(basis, out, part_a(k), part_b(0));
                        }
                    }
                    for i in 0..n {
                        for j in 0..=i {
                            let k = self.second(i, j);
                            let out = &mut new[k * stride..(k + 1) * stride];
                            form::add_product(basis, out, part_a(1 + i), part_b(1 + j));
                            form::add_product(basis, out, part_a(1 + j), part_b(1 + i));
                        }
                    }
                },
            );
        })
    }
}

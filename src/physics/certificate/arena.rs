//! Memory and rules of the numbers that a Lagrangian is evaluated with.

use super::basis::Basis;
use super::form::{self, Expansion};
use super::function::Function;
use super::interval::Interval;
use crate::scalar::vectorized;
use std::cell::{Cell, RefCell};
use std::sync::Arc;

/// Numbers that lie side by side, so that one vector instruction works on all.
pub const LANES: usize = 8;
/// The same coefficient of numbers side by side.
pub type Lanes = [f64; LANES];

/// A number of an [`Arena`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub pack: u32,
    pub lane: u32,
}

/// Memory of all numbers of one evaluation, up to [`LANES`] of them in a pack: units of a layer lie side by side.
///
/// A number has `1 + n + n (n + 1)/2` forms of [`Basis::stride`] coefficients: the value, `n` first derivatives, and of the second ones those with
/// `j <= i`, row by row.
pub struct Arena {
    pub basis: Arc<Basis>,
    /// Directions of the derivatives.
    n: usize,
    parts: usize,
    forms: RefCell<Vec<Lanes>>,
    packs: RefCell<Vec<Pack>>,
    /// Set when a value was read, on which the Lagrangian may then branch unseen.
    read: Cell<bool>,
    /// Bits of the axes that a function depended on where it is not known.
    blamed: Cell<u64>,
}

/// What is known of a pack.
struct Pack {
    /// Numbers in it, from the first lane on.
    lanes: usize,
    /// Functions of all its numbers that were asked for.
    functions: Vec<(Function, u32)>,
}

impl Arena {
    /// For `n` coordinates.
    pub fn new(n: usize, basis: &Arc<Basis>) -> Self {
        let parts = 1 + n + n * (n + 1) / 2;
        let (basis, read, blamed) = (Arc::clone(basis), Cell::new(false), Cell::new(0));
        Self { basis, n, parts, forms: RefCell::default(), packs: RefCell::default(), read, blamed }
    }
    /// Forgets all numbers.
    pub fn clear(&self) {
        self.forms.borrow_mut().clear();
        self.packs.borrow_mut().clear();
        self.read.set(false);
        self.blamed.set(0);
    }
    /// Notes that a value was read.
    pub fn note_read(&self) {
        self.read.set(true);
    }
    /// `true` if a value was read since.
    pub fn was_read(&self) -> bool {
        self.read.get()
    }
    /// Bits of the axes along which a box has to be cut for what is not known to become so.
    pub fn blamed(&self) -> u64 {
        self.blamed.get()
    }
    /// Notes the axes on which the value of a number depends.
    pub fn blame(&self, place: Place) {
        self.look(place.pack, |forms| self.blame_form(&forms[..self.basis.stride()], place.lane as usize));
    }
    fn blame_form(&self, form: &[Lanes], lane: usize) {
        if !form::deviation(form)[lane].is_finite() {
            // Those to blame for it have been noted where it came from.
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

    /// Makes packs of so many numbers each; `fill` is given the forms of all earlier packs and of the new ones, zeros.
    pub fn make(&self, lanes: &[usize], fill: impl FnOnce(&[Lanes], &mut [Lanes])) -> u32 {
        let (mut forms, mut packs) = (self.forms.borrow_mut(), self.packs.borrow_mut());
        let (start, first) = (forms.len(), packs.len());
        forms.resize(start + lanes.len() * self.block(), [0.0; LANES]);
        packs.extend(lanes.iter().map(|&lanes| Pack { lanes, functions: Vec::new() }));
        let (earlier, new) = forms.split_at_mut(start);
        fill(earlier, new);
        first as u32
    }
    /// Makes one number, in the first lane of a pack.
    pub fn single(&self, fill: impl FnOnce(&[Lanes], &mut [Lanes])) -> Place {
        Place { pack: self.make(&[1], fill), lane: 0 }
    }
    /// Reads the forms of a pack, one after the other.
    pub fn look<T>(&self, pack: u32, read: impl FnOnce(&[Lanes]) -> T) -> T {
        read(of(&self.forms.borrow(), pack, self.block()))
    }
    /// Every value of a number on the box.
    pub fn range(&self, place: Place) -> Interval {
        let value = |forms: &[Lanes]| form::range(&self.basis, &forms[..self.basis.stride()], place.lane as usize);
        self.look(place.pack, value)
    }
    /// `true` for the function 0.
    pub fn is_zero(&self, place: Place) -> bool {
        self.look(place.pack, |forms| forms.iter().all(|x| x[place.lane as usize] == 0.0))
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
    /// A number of which nothing is known.
    pub fn unknown(&self) -> Place {
        self.single(|_, new| new.fill([f64::NAN; LANES]))
    }

    /// The pack of a number that is alone in it, a copy if it has neighbours.
    fn alone(&self, place: Place) -> u32 {
        if self.packs.borrow()[place.pack as usize].lanes == 1 {
            return place.pack;
        }
        let copy = self.single(|earlier, new| {
            let old = of(earlier, place.pack, new.len());
            new.iter_mut().zip(old).for_each(|(new, old)| new[0] = old[place.lane as usize]);
        });
        copy.pack
    }

    /// A function of a number; its neighbours' are found with it and remembered.
    pub fn function(&self, f: Function, place: Place) -> Place {
        let known = {
            let packs = self.packs.borrow();
            packs[place.pack as usize].functions.iter().find(|(known, _)| *known == f).map(|(_, pack)| *pack)
        };
        let pack = known.unwrap_or_else(|| self.function_of_pack(f, place.pack));
        Place { pack, lane: place.lane }
    }

    fn function_of_pack(&self, f: Function, pack: u32) -> u32 {
        let (basis, n, parts, stride) = (&*self.basis, self.n, self.parts, self.basis.stride());
        let lanes = self.packs.borrow()[pack as usize].lanes;
        let made = self.make(&[lanes], |earlier, new| {
            let old = of(earlier, pack, parts * stride);
            let part = |k: usize| &old[k * stride..(k + 1) * stride];
            let z = part(0);
            let flat = (1..parts).all(|k| form::is_zero(part(k)));
            let orders = if flat { 1 } else { 3 };
            let mut expansions = [Expansion::<LANES>::ZERO; 3];
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
            // The powers of what differs from the middle, the derivatives of the function, and what makes second derivatives of first ones.
            let mut scratch = vec![[0.0; LANES]; (basis.degree() + 2 + n) * stride];
            let (powers, rest) = scratch.split_at_mut(basis.degree() * stride);
            let (first, rest) = rest.split_at_mut(stride);
            let (second, bent) = rest.split_at_mut(stride);
            vectorized(
                #[inline(always)]
                || {
                    powers[..stride].copy_from_slice(z);
                    powers[0] = [0.0; LANES];
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
        });
        self.packs.borrow_mut()[pack as usize].functions.push((f, made));
        made
    }

    /// `constant + sum_k s_k x_k` of a few numbers.
    pub fn combine(&self, terms: &[(Interval, Place)], constant: Interval) -> Place {
        let stride = self.basis.stride();
        let terms: Vec<(Interval, u32)> = terms.iter().map(|&(factor, place)| (factor, self.alone(place))).collect();
        self.single(|earlier, new| {
            if constant != Interval::ZERO {
                form::set_constant(&mut new[..stride], 0, constant);
            }
            vectorized(
                #[inline(always)]
                || {
                    for &(factor, pack) in &terms {
                        let old = of(earlier, pack, new.len());
                        let forms = new.chunks_exact_mut(stride).zip(old.chunks_exact(stride));
                        forms.for_each(|(new, old)| form::add_multiple(new, factor, old));
                    }
                },
            );
        })
    }

    /// The product of two numbers.
    pub fn product(&self, a: Place, b: Place) -> Place {
        let (basis, n, stride) = (&*self.basis, self.n, self.basis.stride());
        let (a, b) = (self.alone(a), self.alone(b));
        self.single(|earlier, new| {
            let (a, b) = (of(earlier, a, new.len()), of(earlier, b, new.len()));
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

/// The forms of a pack.
pub fn of(forms: &[Lanes], pack: u32, block: usize) -> &[Lanes] {
    &forms[pack as usize * block..(pack as usize + 1) * block]
}

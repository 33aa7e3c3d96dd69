//! Branch and bound: cuts a region into boxes until each is decided or the time is up.

use super::spectrum::{Enclose, Spectrum};
use super::thresholds::{BOXES_AT_A_TIME, HALVING_CAUTION, LARGE_BOX, MOST_HALVINGS};
use super::{CertificateOptions, Signature, Witness};
use crate::storage::in_order;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::fmt::{Debug, Formatter};
use std::sync::atomic;
use std::time::{Duration, Instant};

/// Verdict on a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Every state has the signature, and a condition number of at most `condition`.
    Certified {
        /// Proven bound; infinite if the signature is proven by construction.
        condition: f64,
    },
    /// No state has the signature, or every state has a condition number above the requested one.
    Refuted,
    /// Neither is proven.
    Open,
}

/// A box of the search and its children.
#[derive(Clone, Debug)]
struct Node {
    verdict: Verdict,
    /// Axis and place of the cut, and the index of the first of its two parts.
    cut: Option<(usize, f64, usize)>,
}

/// The tree of boxes.
#[derive(Clone, Default)]
pub struct Tree {
    nodes: Vec<Node>,
}

impl Debug for Tree {
    /// Number of boxes, which may reach millions.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "Tree of {} boxes", self.nodes.len())
    }
}

/// A box in the queue.
struct Waiting {
    node: usize,
    bounds: Vec<(f64, f64)>,
    /// Fraction of the whole region that the box covers.
    share: f64,
    /// Estimated number of halvings until its parts are decided, from the spectrum of its parent.
    halvings: f64,
}

impl Waiting {
    /// Boxes with a larger rank come first: at the beginning large ones, which show where the matrix violates the conditions; then boxes
    /// with the largest decided share expected per evaluated box, the smallest of them first, whose neighbours were decided last.
    fn rank(&self) -> (bool, i64, Reverse<i64>, Reverse<usize>) {
        let size = self.share.log2();
        let large = size > LARGE_BOX;
        let rate = if large || !self.halvings.is_finite() { size } else { size - self.halvings };
        (large, rate.floor() as i64, Reverse(size.floor() as i64), Reverse(self.node))
    }
}
impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.rank().cmp(&other.rank())
    }
}

/// Result of a search.
#[derive(Default)]
pub struct Found {
    pub tree: Tree,
    pub certified: f64,
    pub refuted: f64,
    /// Largest proven condition number of a certified box; 0 if there is none.
    pub condition: f64,
    pub boxes: usize,
    pub witness: Option<Witness>,
}

/// Cuts boxes, given with their shares of the region, until each is decided or the time, the number of boxes or a flag ends the search.
pub fn search(source: &dyn Enclose, regions: Vec<(Vec<(f64, f64)>, f64)>, options: &CertificateOptions<'_>) -> Found {
    let deadline = Instant::now().checked_add(Duration::try_from_secs_f64(options.seconds).unwrap_or(Duration::MAX));
    let may_continue = || {
        let stopped = options.stop.is_some_and(|stop| stop.load(atomic::Ordering::Relaxed));
        !stopped && deadline.is_none_or(|deadline| Instant::now() < deadline)
    };
    let n = source.coordinates();
    let scale: Vec<f64> = regions.first().map_or(Vec::new(), |(bounds, _)| bounds.iter().map(|b| b.1 - b.0).collect());
    let active = active_axes(source, &regions);
    let mut found = Found::default();
    let mut queue: BinaryHeap<Waiting> = BinaryHeap::new();
    for (bounds, share) in regions {
        queue.push(Waiting { node: found.tree.add(), bounds, share, halvings: f64::INFINITY });
    }
    while !queue.is_empty() && found.boxes < options.boxes {
        let room = BOXES_AT_A_TIME.min(options.boxes - found.boxes);
        let chunk: Vec<Waiting> = std::iter::from_fn(|| queue.pop()).take(room).collect();
        let spectra = evaluate(source, &chunk, options.threads, &may_continue);
        let ended = !may_continue();
        for (waiting, spectrum) in chunk.iter().zip(&spectra) {
            let Some(spectrum) = spectrum else { continue };
            found.boxes += 1;
            let verdict = options.verdict(spectrum);
            found.tree.nodes[waiting.node].verdict = verdict;
            match verdict {
                Verdict::Certified { condition } => {
                    found.certified += waiting.share;
                    found.condition = found.condition.max(condition);
                    continue;
                }
                Verdict::Refuted => {
                    found.refuted += waiting.share;
                    found.look_for_witness(source, waiting, spectrum, options);
                    continue;
                }
                Verdict::Open if found.witness.is_none() && options.suspects(&spectrum.middle, n) => {
                    found.look_for_witness(source, waiting, spectrum, options);
                }
                Verdict::Open => {}
            }
            found.tree.cut(waiting, &mut Cut::new(spectrum, &scale, &active), &mut queue);
        }
        if ended {
            break;
        }
    }
    found
}

/// The spectra of boxes; `None` for boxes that were not evaluated before `may_continue` returned `false`.
fn evaluate(
    source: &dyn Enclose,
    chunk: &[Waiting],
    threads: usize,
    may_continue: &(dyn Fn() -> bool + Sync),
) -> Vec<Option<Spectrum>> {
    // Several parts per thread balance the load: some parts take longer than others.
    let share = chunk.len().div_ceil(threads.clamp(1, BOXES_AT_A_TIME) * 4).max(1);
    let parts: Vec<&[Waiting]> = chunk.chunks(share).collect();
    let evaluated = in_order(&parts, threads, |boxes| {
        let mut spectra: Vec<Option<Spectrum>> = boxes.iter().map(|_| None).collect();
        if !may_continue() {
            return spectra;
        }
        let bounds: Vec<&[(f64, f64)]> = boxes.iter().map(|waiting| waiting.bounds.as_slice()).collect();
        source.each(&bounds, &mut |index, matrix| {
            spectra[index] = Some(matrix.spectrum());
            may_continue()
        });
        spectra
    });
    evaluated.into_iter().flatten().collect()
}

/// Axes along which the mass matrix changes at some of a few places; all if it is not known to change at any.
fn active_axes(source: &dyn Enclose, regions: &[(Vec<(f64, f64)>, f64)]) -> Vec<bool> {
    let axes = 2 * source.coordinates();
    let places: Vec<Vec<(f64, f64)>> = regions
        .iter()
        .flat_map(|(bounds, _)| {
            (1..=4).map(|k| {
                // Small boxes at irrational fractions of the sides.
                let part = |(axis, &(low, high)): (usize, &(f64, f64))| {
                    let fraction = (0.618_034 * f64::from(k) * (2.0 + axis as f64).sqrt()).fract();
                    let low = low + 0.99 * fraction * (high - low);
                    (low, low + 1e-3 * (high - low).max(0.0))
                };
                bounds.iter().enumerate().map(part).collect()
            })
        })
        .collect();
    let mut active = vec![false; axes];
    let places: Vec<&[(f64, f64)]> = places.iter().map(Vec::as_slice).collect();
    source.each(&places, &mut |_, matrix| {
        for form in matrix.forms.chunks_exact(matrix.basis.stride()) {
            let slopes = active.iter_mut().zip(&form[1..]);
            slopes.for_each(|(active, [slope])| *active |= slope.is_finite() && *slope != 0.0);
        }
        true
    });
    if !active.contains(&true) {
        active.fill(true);
    }
    active
}

/// Decides where and how often to cut a box.
struct Cut<'a> {
    /// For every axis, how much the matrix changes along it in the part that is cut next.
    influence: Vec<f64>,
    spectrum: &'a Spectrum,
    /// Sides of the region.
    scale: &'a [f64],
    active: &'a [bool],
}

impl<'a> Cut<'a> {
    fn new(spectrum: &'a Spectrum, scale: &'a [f64], active: &'a [bool]) -> Self {
        Self { influence: spectrum.influence.clone(), spectrum, scale, active }
    }

    /// The axis to cut and its middle: where the matrix changes most, by its polynomial and by a share of the distance from it as large as
    /// the side. If the matrix is not known, the longest of the axes responsible.
    fn place(&self, bounds: &[(f64, f64)]) -> Option<(usize, f64)> {
        let relative = |axis: usize| {
            let (low, high) = bounds[axis];
            if self.scale[axis] > 0.0 { (high - low) / self.scale[axis] } else { 0.0 }
        };
        let Spectrum { remainder, blamed, .. } = *self.spectrum;
        let known = remainder.is_finite();
        let is_responsible = |axis: usize| blamed >> (axis % 64) & 1 == 1;
        let any = known || blamed == 0;
        let axes = || (0..bounds.len()).filter(|&axis| if any { self.active[axis] } else { is_responsible(axis) });
        let sides: f64 = axes().map(relative).sum();
        let score = |axis: usize| {
            let side = relative(axis) / sides.max(f64::MIN_POSITIVE);
            if known { self.influence[axis] + remainder * side } else { side }
        };
        let best = axes().max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a)))?;
        let (low, high) = bounds[best];
        let middle = 0.5 * low + 0.5 * high;
        (low < middle && middle < high).then_some((best, middle))
    }

    /// Number of halvings before a part of the box is evaluated.
    fn halvings(&self, share: f64) -> usize {
        let halvings = self.spectrum.halvings;
        if share.log2() > LARGE_BOX || !halvings.is_finite() {
            1
        } else {
            ((HALVING_CAUTION * halvings) as usize).clamp(1, MOST_HALVINGS)
        }
    }
}

impl Tree {
    fn add(&mut self) -> usize {
        self.nodes.push(Node { verdict: Verdict::Open, cut: None });
        self.nodes.len() - 1
    }

    /// Cuts a box and puts its parts into the queue; a box that cannot be cut stays open.
    fn cut(&mut self, waiting: &Waiting, cut: &mut Cut<'_>, queue: &mut BinaryHeap<Waiting>) {
        let halvings = cut.spectrum.halvings;
        let mut parts = vec![Waiting { bounds: waiting.bounds.clone(), halvings, ..*waiting }];
        for round in 0..cut.halvings(waiting.share) {
            // All parts have the same sides.
            let Some((axis, _)) = cut.place(&parts[0].bounds) else {
                if round > 0 {
                    break;
                }
                return;
            };
            parts = parts.into_iter().flat_map(|part| self.halve(part, axis)).collect();
            cut.influence[axis] *= 0.5;
        }
        queue.extend(parts);
    }

    /// The two parts of a box.
    fn halve(&mut self, Waiting { node, bounds, share, halvings }: Waiting, axis: usize) -> [Waiting; 2] {
        let (low, high) = bounds[axis];
        let place = 0.5 * low + 0.5 * high;
        self.nodes[node].cut = Some((axis, place, self.nodes.len()));
        [(low, place), (place, high)].map(|side| {
            let mut bounds = bounds.clone();
            bounds[axis] = side;
            Waiting { node: self.add(), bounds, share: 0.5 * share, halvings: (halvings - 1.0).max(0.0) }
        })
    }

    /// The verdict of the smallest box that contains a state of the `root`-th region.
    pub fn verdict(&self, root: usize, state: &[f64]) -> Verdict {
        let mut at = root;
        while let Some((axis, place, first)) = self.nodes[at].cut {
            at = if state[axis] <= place { first } else { first + 1 };
        }
        self.nodes[at].verdict
    }
}

impl Found {
    /// One region, certified without a bound of the condition number.
    pub fn proven() -> Self {
        let node = Node { verdict: Verdict::Certified { condition: f64::INFINITY }, cut: None };
        Self { tree: Tree { nodes: vec![node] }, ..Self::default() }
    }

    /// Proves that the middle of a box is a state without the signature or with a larger condition number.
    fn look_for_witness(
        &mut self,
        source: &dyn Enclose,
        waiting: &Waiting,
        spectrum: &Spectrum,
        options: &CertificateOptions<'_>,
    ) {
        if self.witness.is_some() {
            return;
        }
        let state: Vec<f64> =
            waiting.bounds.iter().map(|&(low, high)| (0.5 * low + 0.5 * high).clamp(low, high)).collect();
        let point: Vec<(f64, f64)> = state.iter().map(|&x| (x, x)).collect();
        let mut at = None;
        source.each(&[&point], &mut |_, matrix| {
            at = Some(matrix.spectrum());
            true
        });
        let proven = at.filter(|at| options.verdict(at) == Verdict::Refuted);
        self.witness = proven.map(|at| {
            let n = state.len() / 2;
            let eigenvalues = if at.middle.is_empty() { spectrum.middle.clone() } else { at.middle };
            Witness { q: state[..n].to_vec(), v: state[n..].to_vec(), eigenvalues }
        });
    }
}

impl CertificateOptions<'_> {
    fn verdict(&self, spectrum: &Spectrum) -> Verdict {
        let Some((positive, negative)) = spectrum.inertia else { return Verdict::Open };
        let (least, most) = spectrum.condition;
        if (Signature { positive, negative }) != self.signature || self.condition.is_some_and(|limit| least > limit) {
            Verdict::Refuted
        } else if self.condition.is_none_or(|limit| most <= limit) {
            Verdict::Certified { condition: most }
        } else {
            Verdict::Open
        }
    }

    /// `true` if the computed eigenvalues suggest that a state is a witness, which is worth a proof.
    fn suspects(&self, eigenvalues: &[f64], n: usize) -> bool {
        let size = |x: &f64| x.abs();
        let condition = eigenvalues.iter().map(size).fold(0.0, f64::max)
            / eigenvalues.iter().map(size).fold(f64::INFINITY, f64::min);
        let positive = eigenvalues.iter().filter(|x| **x > 0.0).count();
        eigenvalues.len() == n
            && (positive != self.signature.positive || self.condition.is_some_and(|limit| condition > limit))
    }
}

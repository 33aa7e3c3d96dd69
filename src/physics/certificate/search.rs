//! Branch and bound: a region is cut into boxes until each is decided or time is up.

use super::enclosure::Enclose;
use super::spectrum::Spectrum;
use super::{Options, Signature, Witness};
use crate::storage::in_order;
use std::fmt::{Debug, Formatter};
use std::time::{Duration, Instant};

/// Knowledge of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Every state has the signature, and a condition number of at most `condition`.
    Certified {
        /// Proven bound; infinite if the signature is proven by construction.
        condition: f64,
    },
    /// No state has the signature, or every state has a condition number above the one asked for.
    Refuted,
    /// Neither is proven.
    Open,
}

/// A box of the search with those that it was cut into.
#[derive(Clone, Debug)]
struct Node {
    verdict: Verdict,
    /// Axis of the cut, its place, and the first of the two parts.
    cut: Option<(usize, f64, usize)>,
}

/// The tree of boxes.
#[derive(Clone, Default)]
pub struct Tree {
    nodes: Vec<Node>,
}

impl Debug for Tree {
    /// The number of boxes: there may be millions.
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "Tree of {} boxes", self.nodes.len())
    }
}

/// A box that waits for its turn.
struct Waiting {
    node: usize,
    bounds: Vec<(f64, f64)>,
    /// Share of the whole region.
    share: f64,
}

/// Findings of a search.
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

/// Boxes that are taken from the queue at a time.
const CHUNK: usize = 128;

/// Cuts boxes, the largest first, whose shares of the region are given with them.
pub fn search(source: &dyn Enclose, regions: Vec<(Vec<(f64, f64)>, f64)>, options: &Options) -> Found {
    let deadline = Instant::now().checked_add(Duration::try_from_secs_f64(options.seconds).unwrap_or(Duration::MAX));
    let n = source.coordinates();
    let scale: Vec<f64> = regions.first().map_or(Vec::new(), |(bounds, _)| bounds.iter().map(|b| b.1 - b.0).collect());
    let active = active_axes(source, &regions);
    let mut found = Found::default();
    let mut queue: Vec<Waiting> = Vec::new();
    for (bounds, share) in regions {
        queue.push(Waiting { node: found.tree.add(), bounds, share });
    }
    let mut next = Vec::new();
    while !queue.is_empty() {
        for chunk in queue.chunks(CHUNK) {
            let chunk = &chunk[..chunk.len().min(options.boxes - found.boxes)];
            let spectra = judge(source, chunk, options.threads, deadline);
            let out_of_time = spectra.iter().any(Option::is_none);
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
                if let Some(parts) = cut(waiting, spectrum, &scale, &active) {
                    found.tree.cut(waiting, parts, &mut next);
                }
            }
            if out_of_time || found.boxes >= options.boxes {
                return found;
            }
        }
        queue = std::mem::take(&mut next);
    }
    found
}

/// The spectra of boxes, `None` for those that time did not suffice for.
fn judge(source: &dyn Enclose, chunk: &[Waiting], threads: usize, deadline: Option<Instant>) -> Vec<Option<Spectrum>> {
    let share = chunk.len().div_ceil(threads.max(1)).max(1);
    let parts: Vec<&[Waiting]> = chunk.chunks(share).collect();
    let judged = in_order(&parts, threads, |boxes| {
        let mut spectra: Vec<Option<Spectrum>> = boxes.iter().map(|_| None).collect();
        let bounds: Vec<&[(f64, f64)]> = boxes.iter().map(|waiting| waiting.bounds.as_slice()).collect();
        source.each(&bounds, &mut |index, matrix| {
            spectra[index] = Some(matrix.spectrum());
            deadline.is_none_or(|deadline| Instant::now() < deadline)
        });
        spectra
    });
    judged.into_iter().flatten().collect()
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
        for form in matrix.forms.chunks_exact(matrix.stride) {
            let slopes = active.iter_mut().zip(&form[1..]);
            slopes.for_each(|(active, slope)| *active |= slope.is_finite() && *slope != 0.0);
        }
        true
    });
    if !active.contains(&true) {
        active.fill(true);
    }
    active
}

/// The axis to cut and its middle: where the matrix changes most, by its plane and, for a share as large as the side, by the distance from
/// it. Of a matrix that is not known, the longest side of those to blame.
fn cut(waiting: &Waiting, spectrum: &Spectrum, scale: &[f64], active: &[bool]) -> Option<(usize, f64)> {
    let relative = |axis: usize| {
        let (low, high) = waiting.bounds[axis];
        if scale[axis] > 0.0 { (high - low) / scale[axis] } else { 0.0 }
    };
    let known = spectrum.remainder.is_finite();
    let blamed = |axis: usize| spectrum.blamed >> (axis % 64) & 1 == 1;
    let any = known || spectrum.blamed == 0;
    let axes = || (0..waiting.bounds.len()).filter(|&axis| if any { active[axis] } else { blamed(axis) });
    let sides: f64 = axes().map(relative).sum();
    let score = |axis: usize| {
        let side = relative(axis) / sides.max(f64::MIN_POSITIVE);
        if known { spectrum.influence[axis] + spectrum.remainder * side } else { side }
    };
    let best = axes().max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a)))?;
    let (low, high) = waiting.bounds[best];
    let middle = 0.5 * low + 0.5 * high;
    (low < middle && middle < high).then_some((best, middle))
}

impl Tree {
    fn add(&mut self) -> usize {
        self.nodes.push(Node { verdict: Verdict::Open, cut: None });
        self.nodes.len() - 1
    }

    fn cut(&mut self, waiting: &Waiting, (axis, place): (usize, f64), queue: &mut Vec<Waiting>) {
        let first = self.nodes.len();
        self.nodes[waiting.node].cut = Some((axis, place, first));
        for lower in [true, false] {
            let mut bounds = waiting.bounds.clone();
            if lower {
                bounds[axis].1 = place;
            } else {
                bounds[axis].0 = place;
            }
            queue.push(Waiting { node: self.add(), bounds, share: 0.5 * waiting.share });
        }
    }

    /// The verdict of the smallest box that holds a state of the `root`-th region.
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
    fn look_for_witness(&mut self, source: &dyn Enclose, waiting: &Waiting, spectrum: &Spectrum, options: &Options) {
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

impl Options {
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

    /// `true` if the computed eigenvalues of a state make it worth a proof that it is a witness.
    fn suspects(&self, eigenvalues: &[f64], n: usize) -> bool {
        let size = |x: &f64| x.abs();
        let condition = eigenvalues.iter().map(size).fold(0.0, f64::max)
            / eigenvalues.iter().map(size).fold(f64::INFINITY, f64::min);
        let positive = eigenvalues.iter().filter(|x| **x > 0.0).count();
        eigenvalues.len() == n
            && (positive != self.signature.positive || self.condition.is_some_and(|limit| condition > limit))
    }
}

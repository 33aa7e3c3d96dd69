//! Terms of many states, computed side by side, for Python.

use crate::arrays::Numbers;
use crate::attend::whole;
use crate::errors::value;
use crate::subject::Subject;
use lnn::lagrangian::{EulerLagrange, MechanicsError, Request, Terms};
use lnn::linalg::Workspace;
use lnn::pipeline::Watch;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// States whose terms are computed at a time.
const CHUNK: usize = 4096;

impl Subject {
    /// Terms of states; few of them, which are computed in a moment, without a look at signals.
    pub fn attended(
        &self,
        py: Python<'_>,
        states: States<'_>,
        (request, friction): (Request, bool),
        threads: usize,
    ) -> PyResult<Vec<(Terms<f64>, usize)>> {
        if states.times.is_empty() && !states.q.is_empty() && self.moving().is_timed() {
            return Err(value(MechanicsError::Timed));
        }
        let work = |watch: &Watch| {
            self.with_friction(friction, |model| computed(model, states, request, threads, &watch.interrupt))
        };
        if states.q.len() <= CHUNK * self.n() {
            return Ok(py.detach(|| work(&Watch::default())));
        }
        whole(py, None, work)
    }
}

/// States `(b, n)`, the forces from outside that act on them, and their times `(b)`, which only a system that depends on the time needs.
#[derive(Clone, Copy)]
pub struct States<'a> {
    pub q: &'a [f64],
    pub v: &'a [f64],
    pub force: Option<&'a [f64]>,
    pub times: &'a [f64],
}

/// Terms of states, chunk by chunk, parts of them side by side.
fn computed(
    model: &dyn EulerLagrange<f64>,
    States { q, v, force, times }: States<'_>,
    request: Request,
    threads: usize,
    stop: &AtomicBool,
) -> Vec<(Terms<f64>, usize)> {
    let n = model.coordinates();
    // The same work of many coordinates takes fewer states.
    let chunk = (4 * CHUNK / (n * n)).clamp(64, CHUNK);
    let part = |range: Range<usize>| {
        let chunks = range.clone().step_by(chunk).map(|row| row * n..(row + chunk).min(range.end) * n);
        let terms = chunks.take_while(|_| !stop.load(Ordering::Relaxed)).map(|at| {
            let (q, v, mut terms) = (&q[at.clone()], &v[at.clone()], Terms::default());
            let times = times.get(at.start / n..at.end / n).unwrap_or_default();
            // Every row that fails is among the failures, its accelerations are NaN.
            let _ = model.terms_at(times, q, v, request, &mut terms);
            if let Some(force) = force {
                let _ = terms.add_force(n, v, &force[at], &mut Workspace::new());
            }
            (terms, q.len() / n)
        });
        terms.collect::<Vec<_>>()
    };
    let states = q.len() / n;
    let threads = threads.clamp(1, 256).min(states.div_ceil(CHUNK)).max(1);
    if threads == 1 {
        return part(0..states);
    }
    let share = states.div_ceil(threads).next_multiple_of(CHUNK);
    std::thread::scope(|scope| {
        let parts = (0..states).step_by(share).map(|row| row..(row + share).min(states));
        let running: Vec<_> = parts.map(|rows| scope.spawn(|| part(rows))).collect();
        running.into_iter().flat_map(|part| part.join().unwrap_or_default()).collect()
    })
}

/// A field of terms.
pub type Field = fn(&mut Terms<f64>) -> &mut Vec<f64>;

/// One field of all chunks; `NaN` where a chunk has none of it.
pub fn field<'py>(py: Python<'py>, parts: &mut [(Terms<f64>, usize)], width: usize, take: Field) -> Numbers<'py> {
    let whole = |numbers: Vec<f64>, states: usize| {
        if numbers.len() == states * width { numbers } else { vec![f64::NAN; states * width] }
    };
    if let [(terms, states)] = parts {
        return whole(std::mem::take(take(terms)), *states).into_pyarray(py);
    }
    let mut all = Vec::with_capacity(parts.iter().map(|part| part.1 * width).sum());
    for (terms, states) in parts {
        all.append(&mut whole(std::mem::take(take(terms)), *states));
    }
    all.into_pyarray(py)
}

//! Integrates many segments side by side, with derivatives by initial states and constants. Each segment is a lane of a batch.

use super::closed::Closed;
use super::driven::{DrivenEquations, Segment, forces};
use super::lanes::State;
use crate::linalg::{self, Workspace};
use crate::recording::RecordedTrajectory;
use crate::scalar::{update, update2};
use crate::tape::Replay;
use std::sync::Arc;

/// Evaluates and integrates the equations of motion of many states side by side, with reused buffers.
pub(super) struct Follower<'a> {
    driven: &'a DrivenEquations<'a>,
    motion: Replay<f64>,
    slopes: Replay<f64>,
    workspace: Workspace<f64>,
    mass: Vec<f64>,
    inverse: Vec<f64>,
    rest: Vec<f64>,
    by_state: Vec<f64>,
    force: Vec<f64>,
    /// Known functions of the time at the states, `(lanes, known)`; empty if the equations do not depend on them.
    known: Vec<f64>,
    row: Vec<f64>,
    /// Constraints, for systems that have some.
    closed: Option<Closed>,
}

impl<'a> Follower<'a> {
    pub fn new(driven: &'a DrivenEquations<'a>) -> Self {
        let equations = driven.equations;
        Self {
            driven,
            motion: Replay::new(Arc::clone(&equations.motion)),
            slopes: Replay::new(Arc::clone(&equations.slopes)),
            workspace: Workspace::new(),
            mass: Vec::new(),
            inverse: Vec::new(),
            rest: Vec::new(),
            by_state: Vec::new(),
            force: Vec::new(),
            known: Vec::new(),
            row: Vec::new(),
            closed: equations.rows.as_ref().map(|rows| Closed::new(equations.n, rows)),
        }
    }

    /// Sets trajectories and times of the states that are evaluated next. If they are not set, the states are spread over the recording.
    pub fn at(&mut self, places: impl Iterator<Item = (usize, f64)>) {
        let (driven, count) = (self.driven, self.driven.equations.known);
        if count > 0 {
            self.known.clear();
            for (lane, (track, t)) in places.enumerate() {
                self.known.resize((lane + 1) * count, 0.0);
                driven.known(track, t, &mut self.known[lane * count..]);
            }
        }
    }

    /// Spreads the states over the recording if their times are not set.
    fn spread_times(&mut self, lanes: usize) {
        let (driven, count) = (self.driven, self.driven.equations.known);
        if self.known.len() != lanes * count {
            let tracks = driven.recording.tracks.iter().enumerate();
            let samples: Vec<(usize, f64)> =
                tracks.flat_map(|(k, track)| track.times.iter().map(move |t| (k, *t))).collect();
            self.at((0..lanes).map(|lane| samples[(2 * lane + 1) * samples.len() / (2 * lanes)]));
        }
    }

    /// Mass matrices of the states evaluated last, `(lanes, n, n)`.
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// Rows of the constraints of the states evaluated last, `(lanes, m, n)`; none without constraints.
    pub fn rows(&self) -> &[f64] {
        self.closed.as_ref().map_or(&[], Closed::matrix)
    }

    /// Number of constraints.
    pub fn constraints(&self) -> usize {
        self.driven.equations.rows.as_ref().map_or(0, |rows| rows.names.len())
    }

    /// Accelerations by a unit force on each coordinate at the states evaluated last, `(lanes, n, n)`; without constraints, the inverse of the mass
    /// matrix. `NaN` if it is singular.
    pub fn mobility(&self) -> Vec<f64> {
        if let Some(closed) = &self.closed {
            return closed.mobility();
        }
        let mut inverse = vec![0.0; self.mass.len()];
        let _ = linalg::inverse(self.driven.equations.n, &self.mass, &mut inverse, &mut Workspace::new());
        inverse
    }

    /// Accelerations of states under forces, `(lanes, n)` each; `force` may be empty. `NaN` if the equations have no solution.
    pub fn accelerate(&mut self, values: &[f64], (q, v): (&[f64], &[f64]), force: &[f64], a: &mut [f64]) {
        let n = self.driven.equations.n;
        let lanes = q.len() / n;
        self.mass.resize(lanes * n * n, 0.0);
        self.rest.resize(lanes * n, 0.0);
        // Shapes are those of the recorded program.
        self.spread_times(lanes);
        let inputs: [&[f64]; 3] = [q, v, &self.known];
        let inputs = &inputs[..2 + usize::from(self.driven.equations.known > 0)];
        let _ = self.motion.evaluate(lanes, inputs, values, &mut [&mut self.mass, &mut self.rest]);
        if !force.is_empty() {
            self.rest.iter_mut().zip(force).for_each(|(rest, force)| *rest += force);
        }
        if let Some(closed) = &mut self.closed {
            closed.accelerate(values, (q, v), (&self.mass, &self.rest), (a, &mut self.workspace));
        } else if n == 1 {
            a.iter_mut().zip(self.rest.iter().zip(&self.mass)).for_each(|(a, (rest, mass))| *a = rest / mass);
        } else {
            // Lanes that fail are NaN.
            let _ = linalg::solve(n, &self.mass, &self.rest, a, &mut self.workspace);
        }
    }

    /// The force residuals `Q + h - M a` at the states evaluated last, `(lanes, n)`: forces minus mass times acceleration.
    pub fn unbalanced_forces(&self, a: &[f64], into: &mut [f64]) {
        let n = self.driven.equations.n;
        let rows = self.mass.chunks_exact(n).zip(&self.rest).zip(into).enumerate();
        rows.for_each(|(at, ((row, rest), into))| *into = rest - linalg::dot(row, &a[at / n * n..][..n]));
    }

    /// Derivatives of `M a - h - Q` by positions, velocities and constants, with the accelerations held fixed: `(lanes, n, 2n + chosen)`.
    pub fn force_slopes(&mut self, values: &[f64], (q, v, a): (&[f64], &[f64], &[f64])) -> &[f64] {
        let n = self.driven.equations.n;
        self.by_state.resize(q.len() * (2 * n + self.driven.chosen), 0.0);
        self.spread_times(q.len() / n);
        let inputs: [&[f64]; 4] = [q, v, a, &self.known];
        let inputs = &inputs[..3 + usize::from(self.driven.equations.known > 0)];
        let _ = self.slopes.evaluate(q.len() / n, inputs, values, &mut [&mut self.by_state]);
        &self.by_state
    }

    /// Derivatives of the accelerations found last by positions, velocities and constants: `(lanes, n, 2n + chosen)`.
    pub fn slopes(&mut self, values: &[f64], (q, v, a): (&[f64], &[f64], &[f64])) -> &[f64] {
        let n = self.driven.equations.n;
        let (lanes, width) = (q.len() / n, 2 * n + self.driven.chosen);
        self.force_slopes(values, (q, v, a));
        let closed = self.closed.as_mut().map(|closed| closed.slopes(values, [q, v, a], &self.by_state));
        let matrices = closed.map_or(&self.mass[..], |(_, matrices)| matrices);
        // Number of coordinates and constraints.
        let k = (matrices.len() / lanes.max(1)).isqrt();
        self.inverse.resize(matrices.len(), 0.0);
        if k == 1 {
            self.inverse.iter_mut().zip(matrices).for_each(|(inverse, mass)| *inverse = mass.recip());
        } else {
            let _ = linalg::inverse(k, matrices, &mut self.inverse, &mut self.workspace);
        }
        self.row.resize(n * width, 0.0);
        let blocks = self.by_state.chunks_exact_mut(n * width).zip(self.inverse.chunks_exact(k * k)).enumerate();
        for (lane, (block, inverse)) in blocks {
            let whole = closed.map_or(&*block, |(whole, _)| &whole[lane * k * width..][..k * width]);
            self.row.fill(0.0);
            for (i, row) in self.row.chunks_exact_mut(width).enumerate() {
                for j in 0..k {
                    let x = inverse[i * k + j];
                    update(row, &whole[j * width..][..width], |row, from| *row -= x * from);
                }
            }
            block.copy_from_slice(&self.row);
        }
        &self.by_state
    }

    /// The rate of change of a state and of its derivatives.
    fn rate(&mut self, values: &[f64], at: &State, columns: usize, rate: &mut State) {
        let n = self.driven.equations.n;
        let force = std::mem::take(&mut self.force);
        self.accelerate(values, (&at.q, &at.v), &force, &mut rate.v);
        self.force = force;
        rate.q.copy_from_slice(&at.v);
        if columns == 0 {
            return;
        }
        rate.q_slopes.copy_from_slice(&at.v_slopes);
        let (width, starts) = (2 * n + self.driven.chosen, columns - self.driven.chosen);
        let a = std::mem::take(&mut rate.v);
        let slopes = self.slopes(values, (&at.q, &at.v, &a));
        rate.v_slopes.fill(0.0);
        let lanes = slopes.chunks_exact(n * width).zip(rate.v_slopes.chunks_exact_mut(n * columns));
        let states = at.q_slopes.chunks_exact(n * columns).zip(at.v_slopes.chunks_exact(n * columns));
        for ((slopes, out), (sq, sv)) in lanes.zip(states) {
            for (i, out) in out.chunks_exact_mut(columns).enumerate() {
                let row = &slopes[i * width..][..width];
                for j in 0..n {
                    let (x, y, at) = (row[j], row[n + j], j * columns..(j + 1) * columns);
                    update2(out, &sq[at.clone()], &sv[at], |out, q, v| *out += x * q + y * v);
                }
                update(&mut out[starts..], &row[2 * n..], |out, by_constant| *out += by_constant);
            }
        }
        rate.v = a;
    }

    /// Integrates segments, longest first, and calls `visit` with every sample, counted from the first of each segment, and the states of all lanes.
    /// States of segments that have ended must be ignored. With `derivatives`, the states have `starts + chosen` of them, by initial states and
    /// constants.
    pub fn follow(
        &mut self,
        values: &[f64],
        segments: &[&Segment],
        derivatives: bool,
        mut visit: impl FnMut(&mut Self, usize, &State),
    ) {
        let driven = self.driven;
        let (n, lanes) = (driven.equations.n, segments.len());
        let columns = if derivatives { driven.starts() + driven.chosen } else { 0 };
        let mut now = State::sized(lanes, n, columns);
        for (lane, segment) in segments.iter().enumerate() {
            now.q[lane * n..(lane + 1) * n].copy_from_slice(&segment.start[..n]);
            now.v[lane * n..(lane + 1) * n].copy_from_slice(&segment.start[n..]);
            for i in (0..n).filter(|_| derivatives && driven.equations.rows.is_none()) {
                now.q_slopes[(lane * n + i) * columns + i] = 1.0;
                now.v_slopes[(lane * n + i) * columns + n + i] = 1.0;
            }
        }
        if derivatives {
            now.begin_within(n, columns, &driven.tangents(values, segments));
        }
        let mut scratch = Scratch::like(&now);
        let longest = segments.iter().map(|segment| segment.samples).max().unwrap_or(0);
        let track = |segment: &Segment| -> &RecordedTrajectory { &driven.recording.tracks[segment.track] };
        let forced = segments.iter().any(|segment| !track(segment).force.is_empty());
        self.force = vec![0.0; if forced { lanes * n } else { 0 }];
        let ends = |segment: &&Segment, sample: usize| {
            let at = segment.first + sample.min(segment.samples - 1);
            (track(segment).times[at.saturating_sub(1)], track(segment).times[at])
        };
        self.at(segments.iter().map(|segment| (segment.track, track(segment).times[segment.first])));
        visit(self, 0, &now);
        for sample in 1..longest {
            let interval = |segment: &&Segment| {
                let at = segment.first + sample;
                let times = &track(segment).times;
                if sample < segment.samples { times[at] - times[at - 1] } else { 0.0 }
            };
            let intervals: Vec<f64> = segments.iter().map(interval).collect();
            let most = intervals.iter().copied().fold(0.0, f64::max);
            // The number of steps across a gap grows with its length.
            let steps = ((driven.substeps as f64 * most / driven.step - 0.5).ceil() as usize).max(driven.substeps);
            let h: Vec<f64> = intervals.iter().map(|interval| interval / steps as f64).collect();
            for step in 0..steps {
                self.advance((values, columns), (&h, &mut now), &mut scratch, |share, force, known| {
                    let x = (step as f64 + share) / steps as f64;
                    for (segment, known) in segments.iter().zip(known.chunks_exact_mut(driven.equations.known.max(1))) {
                        let (before, after) = ends(segment, sample);
                        driven.known(segment.track, before + x * (after - before), known);
                    }
                    for (segment, into) in segments.iter().zip(force.chunks_exact_mut(n)) {
                        let at = segment.first + sample.min(segment.samples - 1);
                        forces(track(segment), driven.between, (at, x), into);
                    }
                });
            }
            self.at(segments.iter().map(|segment| (segment.track, ends(segment, sample).1)));
            visit(self, sample, &now);
        }
    }

    /// A step of the classical Runge-Kutta method by `h` of each lane; `push` fills in the known forces, times and inputs at a share of the step.
    fn advance(
        &mut self,
        (values, columns): (&[f64], usize),
        (h, now): (&[f64], &mut State),
        Scratch { stage, rates }: &mut Scratch,
        push: impl Fn(f64, &mut [f64], &mut [f64]),
    ) {
        let n = self.driven.equations.n;
        let widths = [n, n * columns];
        let part = |part: f64| h.iter().map(|h| h * part).collect::<Vec<f64>>();
        let half = part(0.5);
        for k in 0..4 {
            if !self.force.is_empty() || !self.known.is_empty() {
                push([0.0, 0.5, 0.5, 1.0][k], &mut self.force, &mut self.known);
            }
            let (before, rest) = rates.split_at_mut(k);
            match k {
                0 => self.rate(values, now, columns, &mut rest[0]),
                _ => {
                    stage.set_step(now, (if k == 3 { h } else { &half }, widths), &before[k - 1]);
                    self.rate(values, stage, columns, &mut rest[0]);
                }
            }
        }
        for (rate, weight) in rates.iter().zip([1.0, 2.0, 2.0, 1.0]) {
            std::mem::swap(stage, now);
            now.set_step(stage, (&part(weight / 6.0), widths), rate);
        }
    }

    /// Integrates the states of segments, with their derivatives, from a sample over a time that may be negative. The integration goes from sample
    /// to sample, so that the known forces of each interval apply.
    pub fn shifted(
        &mut self,
        values: &[f64],
        (segments, sample): (&[&Segment], usize),
        (state, by): (&State, f64),
        late: &mut State,
    ) {
        late.clone_from(state);
        let driven = self.driven;
        let n = driven.equations.n;
        let columns = state.q_slopes.len() / state.q.len().max(1);
        let mut scratch = Scratch::like(state);
        let tracks: Vec<&RecordedTrajectory> =
            segments.iter().map(|segment| &driven.recording.tracks[segment.track]).collect();
        let of = |(segment, track): (&&Segment, &&RecordedTrajectory)| match sample < segment.samples {
            true => (track.times[segment.first + sample], by),
            false => (track.times[segment.first], 0.0),
        };
        let mut places: Vec<(f64, f64)> = segments.iter().zip(&tracks).map(of).collect();
        while places.iter().any(|(_, remaining)| remaining.abs() > 0.0) {
            // For each lane the end of its interval, the time to integrate, and the time that is reached.
            let interval = |((now, remaining), track): (&(f64, f64), &&RecordedTrajectory)| {
                let (times, last) = (&track.times, track.len() - 1);
                let end =
                    times.partition_point(|t| if *remaining < 0.0 { t < now } else { t <= now }).clamp(1, last.max(1));
                let bound = times[if *remaining < 0.0 { end - 1 } else { end.min(last) }];
                let outside = if *remaining < 0.0 { end == 1 } else { end >= last };
                let whole = outside || remaining.abs() <= (bound - now).abs();
                (end, if whole { *remaining } else { bound - now }, if whole { now + remaining } else { bound })
            };
            let intervals: Vec<(usize, f64, f64)> = places.iter().zip(&tracks).map(interval).collect();
            let most = intervals.iter().fold(0.0, |most: f64, interval| most.max(interval.1.abs()));
            let steps = (driven.substeps as f64 * most / driven.step).ceil().max(1.0);
            let h: Vec<f64> = intervals.iter().map(|interval| interval.1 / steps).collect();
            for step in 0..steps as usize {
                self.advance((values, columns), (&h, late), &mut scratch, |share, force, known| {
                    for (lane, known) in known.chunks_exact_mut(driven.equations.known.max(1)).enumerate() {
                        let now = places[lane].0 + (step as f64 + share) * h[lane];
                        driven.known(segments[lane].track, now, known);
                    }
                    for (lane, into) in force.chunks_exact_mut(n).enumerate() {
                        let (track, end) = (tracks[lane], intervals[lane].0.min(tracks[lane].len() - 1));
                        let before = track.times[end.saturating_sub(1)];
                        let now = places[lane].0 + (step as f64 + share) * h[lane];
                        let length = track.times[end] - before;
                        let x = if length > 0.0 { (now - before) / length } else { 0.0 };
                        forces(track, driven.between, (end, x), into);
                    }
                });
            }
            for (place, (_, elapsed, now)) in places.iter_mut().zip(intervals) {
                *place = (now, if elapsed == place.1 { 0.0 } else { place.1 - elapsed });
            }
        }
    }
}

/// Intermediate states of a Runge-Kutta step.
struct Scratch {
    stage: State,
    rates: [State; 4],
}

impl Scratch {
    fn like(state: &State) -> Self {
        Self { stage: state.clone(), rates: std::array::from_fn(|_| state.clone()) }
    }
}

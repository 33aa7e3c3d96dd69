//! Readings of sensors along a motion, `y = h(q, v, a, t; p)`, if other quantities than the coordinates were measured.
//!
//! With the derivatives `(Q, V)` of a state by the initial state and the constants, those of a reading are `h_q Q + h_v V + h_a A + h_p`, where
//! `A = a_q Q + a_v V + a_p` follows from the equations of motion.

use super::IdentifyError;
use super::driven::{DrivenEquations, Segment};
use super::follow::Follower;
use super::lanes::State;
use super::solve::Problem;
use super::thresholds::LEAST_SEGMENT;
use crate::lagrangian::SystemInstance;
use crate::recording::Recording;
use crate::recording::smooth::Smoothed;
use crate::tape::{Program, ROWS, Replay, TapeError};
use std::sync::Arc;

/// The measured quantities of a system.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    /// Marks the angles: readings that differ by full turns are equal.
    pub angles: Vec<bool>,
    /// For each coordinate, the index of the reading that measures it directly, if there is one.
    pub sources: Vec<Option<usize>>,
    /// `true` if a formula contains accelerations.
    accelerated: bool,
    /// Number of known functions of the time in the formulas: the time itself, then inputs.
    known: usize,
    /// Computes the readings, `(m)`, and their derivatives by `q`, `v`, `a` and the chosen parameters, `(m, 3n + chosen)`, from `(q, v, a, known)`.
    program: Arc<Program<f64>>,
}

impl Measured {
    /// Records the formulas of a system, with derivatives by the chosen parameters; `None` if the system has no table `[measured]`.
    ///
    /// # Errors
    /// [`TapeError`] for formulas that are too long.
    pub fn record(instance: &SystemInstance<f64>, chosen: &[usize]) -> Result<Option<Self>, TapeError> {
        let readings = instance.readings();
        if readings.is_empty() {
            return Ok(None);
        }
        let (n, count) = (instance.coordinates, instance.parameters.len());
        let known = 1 + instance.inputs().count();
        let state = 3 * n + known;
        let single = |reading| {
            let reading: &crate::lagrangian::FormulaReading = reading;
            Program::<f64>::record(state + count, 0, |x, _| {
                let (x, p) = x.split_at(state);
                vec![reading.value(p, (&x[..n], &x[n..2 * n], &x[2 * n..3 * n]), &x[3 * n..])]
            })
        };
        let singles = readings.iter().map(single).collect::<Result<Vec<_>, _>>()?;
        let program = Program::record_within(ROWS, (state, count), |x, p| {
            let inputs = [x, p].concat();
            let mut outputs = Vec::new();
            for single in &singles {
                outputs.push(single.interpret(&inputs, &[]).ok()?[0]);
            }
            for single in &singles {
                let first = single.derivatives(&inputs, &[], None)?.first;
                outputs.extend((0..3 * n).chain(chosen.iter().map(|k| state + k)).map(|place| first[place]));
            }
            Some(outputs)
        })?;
        let source = |i: usize| readings.iter().position(|reading| reading.coordinate == Some(i));
        Ok(Some(Self {
            angles: readings.iter().map(|reading| reading.periodic).collect(),
            sources: (0..n).map(source).collect(),
            accelerated: readings.iter().any(|reading| reading.accelerated),
            known,
            program: Arc::new(program),
        }))
    }

    /// Number of readings of a sample.
    pub fn count(&self) -> usize {
        self.angles.len()
    }

    /// `true` if a coordinate is not measured directly, so that initial states must be searched.
    pub fn is_searched(&self) -> bool {
        self.sources.contains(&None)
    }

    /// The smoothed coordinates, if every coordinate is measured directly.
    pub fn coordinates(&self, smoothed: &[Option<Smoothed>]) -> Option<Vec<Option<Smoothed>>> {
        let sources: Vec<usize> = self.sources.iter().copied().collect::<Option<_>>()?;
        Some(smoothed.iter().map(|own| own.as_ref().map(|own| own.columns(self.count(), &sources))).collect())
    }
}

/// Checks that a recording has the readings of a system, or its coordinates if it has no table `[measured]`.
pub(super) fn check_columns(instance: &SystemInstance<f64>, recording: &Recording) -> Result<(), IdentifyError> {
    let n = instance.coordinates;
    if instance.readings().is_empty() {
        return match recording.n() == n {
            true => Ok(()),
            false => Err(IdentifyError::Coordinates { expected: n, found: recording.n() }),
        };
    }
    if !instance.measured().eq(recording.coordinates.iter().map(String::as_str)) {
        let expected = instance.measured().map(str::to_string).collect();
        return Err(IdentifyError::Readings { expected, found: recording.coordinates.clone() });
    }
    if recording.tracks.iter().any(|track| !track.force.is_empty()) {
        return Err(IdentifyError::ForcesBesideReadings);
    }
    if instance.acting_constraints()?.is_empty() { Ok(()) } else { Err(IdentifyError::ConstrainedReadings) }
}

/// Computes the readings of states side by side, with their derivatives.
pub(super) struct ReadingSlopes<'a> {
    measured: &'a Measured,
    replay: Replay<f64>,
    a: Vec<f64>,
    known: Vec<f64>,
    /// Readings, `(lanes, m)`.
    pub readings: Vec<f64>,
    /// Derivatives of the formulas, `(lanes, m, 3n + chosen)`.
    by_state: Vec<f64>,
    /// Derivatives by initial states and constants, `(lanes, m, columns)`; empty if those of the states are empty.
    pub slopes: Vec<f64>,
}

impl<'a> ReadingSlopes<'a> {
    pub fn new(measured: &'a Measured) -> Self {
        let replay = Replay::new(Arc::clone(&measured.program));
        let [a, known, readings, by_state, slopes] = [(); 5].map(|()| Vec::new());
        Self { measured, replay, a, known, readings, by_state, slopes }
    }

    /// Computes the readings of all lanes at a sample of their segments, with derivatives if the states have derivatives.
    pub fn evaluate(
        &mut self,
        (follower, driven): (&mut Follower<'_>, &DrivenEquations<'_>),
        values: &[f64],
        (segments, sample): (&[&Segment], usize),
        state: &State,
    ) {
        let Measured { known, accelerated, .. } = *self.measured;
        let (n, m, lanes) = (driven.equations.n, self.measured.count(), segments.len());
        let width = 3 * n + driven.chosen;
        self.known.resize(lanes * known, 0.0);
        for (segment, into) in segments.iter().zip(self.known.chunks_exact_mut(known)) {
            let at = segment.first + sample.min(segment.samples - 1);
            driven.known(segment.track, driven.recording.tracks[segment.track].times[at], into);
        }
        self.a.resize(lanes * n, 0.0);
        if accelerated {
            follower.accelerate(values, (&state.q, &state.v), &[], &mut self.a);
        }
        self.readings.resize(lanes * m, 0.0);
        self.by_state.resize(lanes * m * width, 0.0);
        let inputs: [&[f64]; 4] = [&state.q, &state.v, &self.a, &self.known];
        // Shapes are those of the recorded program.
        let _ = self.replay.evaluate(lanes, &inputs, values, &mut [&mut self.readings, &mut self.by_state]);
        let columns = state.q_slopes.len() / (lanes * n).max(1);
        self.slopes.clear();
        self.slopes.resize(lanes * m * columns, 0.0);
        if columns == 0 {
            return;
        }
        if accelerated {
            let slopes = follower.slopes(values, (&state.q, &state.v, &self.a));
            through_accelerations((n, m, driven.chosen), &mut self.by_state, slopes);
        }
        self.chain((n, m, columns), state);
    }

    /// Chain rule: derivatives by initial states and constants from those by states.
    fn chain(&mut self, (n, m, columns): (usize, usize, usize), state: &State) {
        let width = self.by_state.len() * columns / self.slopes.len();
        let rows = self.by_state.chunks_exact(width).zip(self.slopes.chunks_exact_mut(columns)).enumerate();
        for (at, (row, out)) in rows {
            let lane = at / m * n * columns;
            for (j, (x, y)) in row[..n].iter().zip(&row[n..2 * n]).enumerate() {
                let from = lane + j * columns..lane + (j + 1) * columns;
                let pairs = state.q_slopes[from.clone()].iter().zip(&state.v_slopes[from]);
                out.iter_mut().zip(pairs).for_each(|(o, (q, v))| *o += x * q + y * v);
            }
            out[2 * n..].iter_mut().zip(&row[3 * n..]).for_each(|(o, p)| *o += p);
        }
    }
}

/// Chain rule for accelerations: adds the effect of positions, velocities and constants through the accelerations to the derivatives of readings,
/// `(lanes, m, 3n + chosen)`. `slopes` are the derivatives of the accelerations, `(lanes, n, 2n + chosen)`.
fn through_accelerations((n, m, chosen): (usize, usize, usize), by_state: &mut [f64], slopes: &[f64]) {
    let (width, own) = (3 * n + chosen, 2 * n + chosen);
    for (rows, slopes) in by_state.chunks_exact_mut(m * width).zip(slopes.chunks_exact(n * own)) {
        for row in rows.chunks_exact_mut(width) {
            let (moving, rest) = row.split_at_mut(2 * n);
            let (by_a, by_p) = rest.split_at_mut(n);
            for (x, slopes) in by_a.iter().zip(slopes.chunks_exact(own)) {
                moving.iter_mut().chain(&mut *by_p).zip(slopes).for_each(|(sum, slope)| *sum += x * slope);
            }
        }
    }
}

impl Problem<'_> {
    /// Smallest number of samples in a segment, so that it has as many readings as [`LEAST_SEGMENT`] positions would have.
    pub(super) fn least_segment(&self) -> usize {
        (LEAST_SEGMENT * self.n()).div_ceil(self.width()).max(LEAST_SEGMENT)
    }

    /// Readings at the last sample of each segment, `(m)`.
    pub(super) fn last_readings(&self, x: &[f64], segments: &[&Segment]) -> Vec<Vec<f64>> {
        let Some(measured) = self.measured else { return self.ends(x, segments) };
        let (m, values) = (measured.count(), self.parameters(x));
        let mut found = vec![vec![f64::NAN; m]; segments.len()];
        let mut reader = ReadingSlopes::new(measured);
        Follower::new(&self.driven).follow(&values, segments, false, |follower, sample, state| {
            let is_last = |segment: &Segment| sample + 1 == segment.samples;
            if segments.iter().any(|segment| is_last(segment)) {
                reader.evaluate((follower, &self.driven), &values, (segments, sample), state);
                let lanes = segments.iter().zip(&mut found).zip(reader.readings.chunks_exact(m));
                lanes
                    .filter(|((segment, _), _)| is_last(segment))
                    .for_each(|((_, into), readings)| into.copy_from_slice(readings));
            }
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::Between;
    use crate::lagrangian::{Description, Equations};
    use crate::recording::RecordedTrajectory;
    use std::borrow::Cow;

    const FORM: &str = r#"{"name": "watched",
        "lagrangian": "m*a_dot^2/2 + k*cos(a - b)*a_dot*b_dot + b_dot^2*(1 + a^2) + g*cos(a) + m*sin(b)",
        "coordinates": [{"name": "a", "periodic": true, "velocity_bounds": [-1, 1]},
            {"name": "b", "periodic": true, "velocity_bounds": [-1, 1]}],
        "parameters": {"m": 3, "k": 0.4, "g": 9.8, "s": 2},
        "forces": {"b": "0.3*cos(t) - k*b_dot"},
        "measured": {"b": "b", "pull": "m*a_ddot*cos(b) + s*sin(t) + b_ddot*a_dot", "far": {"formula": "sqrt((s - a)^2 + b^2*k)"}}}"#;

    /// Readings at the last of a few samples, and their slopes by initial state and parameters 3, 0, 1.
    fn readings_at_end(start: &[f64], change: (usize, f64)) -> (Vec<f64>, Vec<f64>) {
        let description: Description = serde_json::from_str(FORM).unwrap();
        let mut instance = SystemInstance::<f64>::new(Cow::Owned(description.system().unwrap()), &[]).unwrap();
        instance.parameters[change.0] += change.1;
        let chosen = [3, 0, 1];
        let equations = Equations::record(&instance, &chosen, &[]).unwrap().unwrap();
        let measured = Measured::record(&instance, &chosen).unwrap().unwrap();
        assert!(measured.sources == [None, Some(0)] && measured.angles == [true, false, false]);
        let times: Vec<f64> = (0..9).map(|k| 0.1 * f64::from(k)).collect();
        let [v, a, force] = [(); 3].map(|()| Vec::new());
        let track = RecordedTrajectory { name: "log".into(), q: vec![0.0; 3 * times.len()], times, v, a, force };
        let coordinates = instance.measured().map(str::to_string).collect();
        let recording = Recording { coordinates, periodic: vec![false; 3], tracks: vec![track] };
        let driven = DrivenEquations {
            recording: &recording,
            equations: &equations,
            chosen: chosen.len(),
            between: Between::Linear,
            inputs: Vec::new(),
            step: 0.1,
            substeps: 8,
        };
        let segment = Segment { track: 0, first: 0, samples: 9, start: start.to_vec() };
        let mut reader = ReadingSlopes::new(&measured);
        Follower::new(&driven).follow(&instance.parameters, &[&segment], true, |follower, sample, state| {
            reader.evaluate((follower, &driven), &instance.parameters, (&[&segment], sample), state);
        });
        (reader.readings, reader.slopes)
    }

    #[test]
    fn slopes_of_readings_are_those_of_differences() {
        const H: f64 = 1e-5;
        let start = [0.3, 1.1, 0.7, -0.4];
        let (_, slopes) = readings_at_end(&start, (0, 0.0));
        for column in 0..7 {
            let at = |h: f64| {
                let mut start = start;
                if column < 4 {
                    start[column] += h;
                }
                readings_at_end(&start, ([3, 0, 1][column.max(4) - 4], if column < 4 { 0.0 } else { h })).0
            };
            let (up, down) = (at(H), at(-H));
            for i in 0..3 {
                let (difference, slope) = ((up[i] - down[i]) / (2.0 * H), slopes[7 * i + column]);
                assert!((difference - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{i} {column}: {difference} {slope}");
            }
        }
    }
}

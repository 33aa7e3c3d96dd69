//! Recommends motion that would determine the open directions. The equations are evaluated at other states: with larger positions, higher
//! velocities, or forces.
//!
//! The criteria are ranks and determinants of the joint effect of all open directions, which do not depend on their basis. The advice is specific
//! only if it is the same at every point along the open directions where the search may have ended.

use super::determined::{OpenDirection, echelon};
use super::driven::Segment;
use super::follow::Follower;
use super::moves::Group;
use super::solve::Problem;
use super::thresholds::{LANES, LEAST_EFFECT, MOST_PROBED_STATES, RECOMMENDED_GAIN, SINGULAR_ROUNDING, STANDSTILL};
use crate::lagrangian::system::Bounds;
use crate::linalg::{dot, singular};

/// Kinds of numbers that are spread over a range.
pub(super) const POSITION: usize = 0;
pub(super) const VELOCITY: usize = 1;
const DRIVE: usize = 2;

const MORE_MOTION: &str = "record more motion of this kind, or reduce the noise";
const OTHER_READINGS: &str = "measure another quantity, record larger motion, or fix one of the constants";

/// Examines which motion would determine open directions.
pub(super) struct Examiner<'a> {
    pub problem: &'a Problem<'a>,
    pub segments: &'a [Segment],
    pub coordinates: &'a [String],
    pub bounds: Bounds,
}

/// States, `(states, n)`, and forces, empty for free motion.
#[derive(Clone)]
struct Probe {
    q: Vec<f64>,
    v: Vec<f64>,
    force: Vec<f64>,
}

/// A point in the space of unknowns, with open directions there.
struct Point<'a> {
    x: &'a [f64],
    changes: Vec<Vec<f64>>,
}

/// Open directions of equations that are linear in the constants, by their cause.
pub(super) struct LinearDirections {
    /// Single constants on which no force depends.
    pub without_effect: Vec<Vec<f64>>,
    /// Combinations that no motion determines.
    pub inseparable: Vec<Vec<f64>>,
    /// Combinations that this motion does not determine.
    pub undetermined: Vec<Vec<f64>>,
}

/// Spreads coordinate `i` of states evenly over a range. Positions, velocities and drives, the `kind`s of numbers, are independent of each other,
/// because they are multiples of different irrational numbers.
pub(super) fn spread((values, n): (&mut [f64], usize), (i, kind): (usize, usize), [low, high]: [f64; 2]) {
    let turn = ((kind * n + i + 2) as f64).powf(0.7);
    for (k, x) in values.iter_mut().skip(i).step_by(n).enumerate() {
        *x = low + (high - low) * ((k + 1) as f64 * turn).fract();
    }
}

/// Right singular vectors of columns: those with singular values above rounding, and the others.
fn split(columns: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let Some(found) = singular(columns) else { return (Vec::new(), Vec::new()) };
    let vectors = found.values.into_iter().zip(found.vectors);
    let (visible, invisible): (Vec<_>, Vec<_>) = vectors.partition(|(value, _)| *value > SINGULAR_ROUNDING);
    [visible, invisible].map(|side| side.into_iter().map(|(_, vector)| vector).collect()).into()
}

/// Linear combinations of columns, with factors from the rows of a matrix.
fn combined(columns: &[Vec<f64>], rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let sum = |row: &Vec<f64>| {
        let mut sum = vec![0.0; columns[0].len()];
        row.iter().zip(columns).for_each(|(factor, column)| {
            sum.iter_mut().zip(column).for_each(|(sum, x)| *sum += factor * x);
        });
        sum
    };
    rows.iter().map(sum).collect()
}

impl Examiner<'_> {
    fn n(&self) -> usize {
        self.coordinates.len()
    }

    /// Recorded states: the initial states of segments or, for few segments, the states along them.
    fn recorded(&self, x: &[f64]) -> Probe {
        let n = self.n();
        let mut probe = Probe { q: Vec::new(), v: Vec::new(), force: Vec::new() };
        if self.segments.len() >= LANES {
            for segment in self.segments.iter().step_by(self.segments.len().div_ceil(MOST_PROBED_STATES)) {
                probe.q.extend(&segment.start[..n]);
                probe.v.extend(&segment.start[n..]);
            }
            return probe;
        }
        let lanes: Vec<&Segment> = self.segments.iter().collect();
        let all: usize = lanes.iter().map(|segment| segment.samples).sum();
        let stride = all.div_ceil(MOST_PROBED_STATES).max(1);
        Follower::new(&self.problem.driven).follow(&self.problem.parameters(x), &lanes, false, |_, sample, state| {
            if sample % stride == 0 {
                let over = |lane: usize| sample >= lanes[lane].samples;
                for lane in (0..lanes.len()).filter(|lane| !over(*lane)) {
                    probe.q.extend(&state.q[lane * n..(lane + 1) * n]);
                    probe.v.extend(&state.v[lane * n..(lane + 1) * n]);
                }
            }
        });
        probe
    }

    /// Changes of the accelerations along directions, in units of `sizes`, a column each, and the sum of the separate effects of their unknowns.
    fn effects(&self, point: &Point<'_>, probe: &Probe, sizes: &[f64]) -> (Vec<Vec<f64>>, Vec<f64>) {
        let (n, m) = (self.n(), self.problem.chosen.len());
        let probe = &self.on_constraints(point.x, probe.clone());
        let values = self.problem.parameters(point.x);
        let mut follower = Follower::new(&self.problem.driven);
        let mut a = vec![0.0; probe.q.len()];
        follower.accelerate(&values, (&probe.q, &probe.v), &probe.force, &mut a);
        let slopes = follower.slopes(&values, (&probe.q, &probe.v, &a));
        let rows: Vec<&[f64]> = slopes.chunks_exact(2 * n + m).map(|row| &row[2 * n..]).collect();
        effects((&rows, 1.0), &point.changes, |at| sizes[at % n])
    }

    /// The states, projected onto the constraints.
    fn on_constraints(&self, x: &[f64], mut probe: Probe) -> Probe {
        self.problem.project_states(x, (&mut probe.q, &mut probe.v));
        probe
    }

    /// Root mean square of the accelerations of every coordinate.
    fn sizes(&self, x: &[f64], probe: &Probe) -> Vec<f64> {
        let n = self.n();
        let mut a = vec![0.0; probe.q.len()];
        let values = self.problem.parameters(x);
        Follower::new(&self.problem.driven).accelerate(&values, (&probe.q, &probe.v), &[], &mut a);
        let of = |i: usize| {
            let own: Vec<f64> = a.iter().skip(i).step_by(n).copied().filter(|a| a.is_finite()).collect();
            let square = dot(&own, &own) / own.len().max(1) as f64;
            if square > 0.0 { square.sqrt() } else { 1.0 }
        };
        (0..n).map(of).collect()
    }

    /// Range of a column, and a wider range: three times as wide, and at least the bounds of the system.
    fn wider(values: &[f64], (n, i): (usize, usize), bounds: (f64, f64)) -> ([f64; 2], [f64; 2]) {
        let own = values.iter().skip(i).step_by(n).copied();
        let (low, high) = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (middle, half) = ((low + high) / 2.0, 1.5 * (high - low));
        ([low, high], [(middle - half).min(bounds.0), (middle + half).max(bounds.1)])
    }

    /// Ranges of every position and velocity, as recorded and wider.
    fn ranges(&self, recorded: &Probe) -> [Vec<([f64; 2], [f64; 2])>; 2] {
        let n = self.n();
        let wider = |values: &[f64], bounds: &[(f64, f64)]| {
            (0..n).map(|i| Self::wider(values, (n, i), bounds[i])).collect::<Vec<_>>()
        };
        [wider(&recorded.q, &self.bounds.positions), wider(&recorded.v, &self.bounds.velocities)]
    }

    /// States spread evenly over the wider ranges.
    fn wide_probe(&self, recorded: &Probe) -> Probe {
        let n = self.n();
        let mut wide = recorded.clone();
        let [wide_q, wide_v] = self.ranges(&wide);
        for i in 0..n {
            spread((&mut wide.q, n), (i, POSITION), wide_q[i].1);
            spread((&mut wide.v, n), (i, VELOCITY), wide_v[i].1);
        }
        wide
    }

    /// Recorded states under forces as large as the inertial forces.
    fn forced_probe(&self, x: &[f64], (recorded, sizes): (&Probe, &[f64])) -> Probe {
        let n = self.n();
        let mut driven = recorded.clone();
        let mut follower = Follower::new(&self.problem.driven);
        let mut a = vec![0.0; driven.q.len()];
        follower.accelerate(&self.problem.parameters(x), (&driven.q, &driven.v), &[], &mut a);
        let push = |(at, mass): (usize, &f64)| mass.abs() * sizes[at % n];
        let rows = follower.mass().chunks_exact(n).map(|row| row.iter().enumerate().map(push).sum::<f64>());
        let mut shares = vec![0.0; driven.q.len()];
        (0..n).for_each(|i| spread((&mut shares, n), (i, DRIVE), [-1.0, 1.0]));
        driven.force = rows.zip(shares).map(|(size, share)| size * share).collect();
        driven
    }

    /// Advice on how to determine a group of open directions.
    pub fn advise(&self, x: &[f64], group: &Group<'_>) -> String {
        if self.problem.measured.is_some() {
            return OTHER_READINGS.into();
        }
        if group.inside.iter().any(|k| *k >= self.problem.chosen.len()) {
            return "calibrate the sensor, because its constants and those of the system have the same effect on this motion"
                .into();
        }
        let own = Point { x, changes: group.columns.iter().map(|column| column.change.clone()).collect() };
        let advice = self.cure_at(&own);
        let elsewhere = |moved: &Vec<f64>| self.cure_at(&Point { x: moved, changes: group.changes_at(x, moved) });
        if group.points.iter().all(|moved| elsewhere(moved) == advice) { advice } else { MORE_MOTION.into() }
    }

    /// The advice at one point along the open directions.
    fn cure_at(&self, point: &Point<'_>) -> String {
        let (count, recorded) = (point.changes.len(), self.recorded(point.x));
        let sizes = self.sizes(point.x, &recorded);
        let (free, separate) = self.effects(point, &self.wide_probe(&recorded), &sizes);
        let unit = |columns: Vec<Vec<f64>>| scaled(columns, &separate);
        let free = unit(free);
        let (under, under_separate) = self.effects(point, &self.forced_probe(point.x, (&recorded, &sizes)), &sizes);
        let both: Vec<Vec<f64>> =
            free.iter().zip(scaled(under, &under_separate)).map(|(a, b)| [&a[..], &b[..]].concat()).collect();
        let (by_motion, _) = split(&free);
        let (by_either, _) = split(&both);
        let never = count - by_either.len();
        let by_force = by_either.len().saturating_sub(by_motion.len());
        let forced = self.problem.driven.recording.tracks.iter().any(|track| !track.force.is_empty());
        let mut cures = Vec::new();
        if by_force > 0 {
            cures.push(match forced {
                true => MORE_MOTION.to_string(),
                false => "record motion under a known force (--force), or fix one of the constants".to_string(),
            });
        }
        if !by_motion.is_empty() {
            let effects = |probe: &Probe| combined(&unit(self.effects(point, probe, &sizes).0), &by_motion);
            cures.push(self.best_extension(&recorded, effects).unwrap_or_else(|| MORE_MOTION.to_string()));
        }
        match (never, cures.is_empty()) {
            (0, _) => {}
            (_, true) => {
                return "fix one of the constants: no motion can separate them, because only combinations of them occur in the equations".into();
            }
            (1, _) => cures
                .push("in addition, fix one of the constants, because no motion determines all of them".to_string()),
            (never, _) => cures
                .push(format!("in addition, fix {never} of the constants, because no motion determines all of them")),
        }
        cures.dedup();
        cures.join("; ")
    }

    /// Advice on the coordinate whose larger range or speed determines the directions best; `None` if no larger motion is much more informative.
    fn best_extension(&self, recorded: &Probe, effects: impl Fn(&Probe) -> Vec<Vec<f64>>) -> Option<String> {
        let n = self.n();
        let [wide_q, wide_v] = self.ranges(recorded);
        // A change of basis of the directions adds a constant to the mean logarithm of the singular values.
        let information = |probe: &Probe| {
            let columns = effects(probe);
            let values = singular(&columns).map(|found| found.values).unwrap_or_default();
            let sum: f64 = values.iter().map(|value| value.max(LEAST_EFFECT).ln()).sum();
            sum / columns.len() as f64
        };
        let mut best = (RECOMMENDED_GAIN.ln() + information(recorded), None);
        let range = |[low, high]: [f64; 2]| format!("{low:.3} .. {high:.3}");
        for (i, name) in self.coordinates.iter().enumerate() {
            let mut far = recorded.clone();
            spread((&mut far.q, n), (i, POSITION), wide_q[i].1);
            let (now, then) = (range(wide_q[i].0), range(wide_q[i].1));
            let farther = (far, format!("record motion with a larger range of {name}: {then} instead of {now}"));
            let mut fast = recorded.clone();
            spread((&mut fast.v, n), (i, VELOCITY), wide_v[i].1);
            let (now, then) = (range(wide_v[i].0), range(wide_v[i].1));
            let faster =
                (fast, format!("record faster motion of {name}, with {name}_dot over {then} instead of {now}"));
            for (probe, text) in [farther, faster] {
                let information = information(&probe);
                if information > best.0 {
                    best = (information, Some(text));
                }
            }
        }
        best.1
    }

    /// Classifies open directions of equations that are linear in the constants by their cause.
    pub fn linear_directions(&self, x: &[f64], (changes, size): (&[Vec<f64>], &[f64])) -> LinearDirections {
        let (n, m) = (self.n(), self.problem.chosen.len());
        let probe = self.on_constraints(x, self.wide_probe(&self.recorded(x)));
        let largest = probe.v.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let mut a = vec![0.0; probe.v.len()];
        (0..n).for_each(|i| spread((&mut a, n), (i, DRIVE), [-largest, largest]));
        let mut follower = Follower::new(&self.problem.driven);
        let slopes = follower.force_slopes(&self.problem.parameters(x), (&probe.q, &probe.v, &a));
        let rows: Vec<&[f64]> = slopes.chunks_exact(2 * n + m).map(|row| &row[2 * n..]).collect();
        let (columns, separate) = effects((&rows, 0.0), changes, |_| 1.0);
        let (visible, invisible) = split(&scaled(columns, &separate));
        let basis = |rows: &[Vec<f64>]| {
            let own =
                if changes.is_empty() { Vec::new() } else { combined(&scaled(changes.to_vec(), &separate), rows) };
            let exact = |(x, size): (f64, &f64)| if (x / size).abs() > SINGULAR_ROUNDING { x } else { 0.0 };
            let of = |column: OpenDirection| column.change.into_iter().zip(size).map(exact).collect::<Vec<f64>>();
            echelon(own, size).into_iter().map(of).collect::<Vec<_>>()
        };
        let single = |change: &Vec<f64>| change.iter().filter(|x| **x != 0.0).count() == 1;
        let (without_effect, inseparable) = basis(&invisible).into_iter().partition(single);
        LinearDirections { without_effect, inseparable, undetermined: basis(&visible) }
    }

    /// Coordinates that do not move.
    pub fn still(&self) -> Vec<String> {
        let recording = self.problem.driven.recording;
        let n = self.n();
        let deviation = |i: usize| {
            let own = recording.tracks.iter().flat_map(|track| track.q.iter().skip(i).step_by(n));
            crate::recording::deviation(own)
        };
        let all: Vec<f64> = (0..n).map(deviation).collect();
        let most = all.iter().copied().fold(0.0, f64::max);
        (0..n).filter(|&i| all[i] <= STANDSTILL * most).map(|i| self.coordinates[i].clone()).collect()
    }
}

/// Effects of changes on the equations, a column each, and the root of the sum of squares of the separate effects of their unknowns, to which every
/// row contributes at least `least`.
fn effects(
    (rows, least): (&[&[f64]], f64),
    changes: &[Vec<f64>],
    size: impl Fn(usize) -> f64,
) -> (Vec<Vec<f64>>, Vec<f64>) {
    let finite = |row: &&[f64]| row.iter().all(|x| x.is_finite());
    let of = |change: &Vec<f64>| {
        let (mut column, mut separate) = (Vec::with_capacity(rows.len()), 0.0);
        for (at, row) in rows.iter().enumerate().filter(|(_, row)| finite(row)) {
            let parts = || row.iter().zip(change).map(|(slope, change)| slope * change / size(at));
            column.push(parts().sum::<f64>());
            separate += parts().map(f64::abs).sum::<f64>().powi(2);
        }
        let least = least * (column.len() as f64).sqrt();
        (column, separate.sqrt().max(least))
    };
    changes.iter().map(of).unzip()
}

/// Columns divided by their sizes, unless these are 0.
fn scaled(columns: Vec<Vec<f64>>, sizes: &[f64]) -> Vec<Vec<f64>> {
    let over =
        |(column, size): (Vec<f64>, &f64)| column.into_iter().map(|x| if *size > 0.0 { x / size } else { x }).collect();
    columns.into_iter().zip(sizes).map(over).collect()
}

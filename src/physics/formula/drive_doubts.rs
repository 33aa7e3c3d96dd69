//! Other explanations of motion that a formula with a drive fits.

use super::drive::longest;
use super::function::{Factor, Function};
use super::library::{Kind, Library};
use super::motion::{Model, Motion};
use super::prepared::Prepared;
use super::thresholds::{
    LEAST_COMPARED_SAMPLES, LEAST_DRIVE_PERIODS, MOST_DRIVEN_TERMS, MOST_PERIOD_DIFFERENCE, MOST_REPEATED_PERIODS,
};
use crate::identification::Between;
use crate::names::rounded;
use std::f64::consts::TAU;

/// Reasons why a model with a drive may not be the law of the motion that it fits.
pub(super) fn drive_doubts(motion: &Motion<'_>, model: &Model) -> Vec<String> {
    let (data, library) = (motion.data, motion.library);
    let period = TAU / model.frequency.abs();
    let mut doubts = Vec::new();
    let periods = longest(data) / period;
    if periods < LEAST_DRIVE_PERIODS {
        let periods = rounded(periods, 2);
        doubts.push(format!(
            "the longest trajectory has {periods} periods of the drive: too few to show that it is periodic"
        ));
    }
    if let Some(count) = (1..=MOST_REPEATED_PERIODS).find(|&count| repeats(data, count as f64 * period)) {
        let periods = if count == 1 { "period".to_string() } else { format!("{count} periods") };
        doubts.push(format!(
            "the motion repeats itself after each {periods} of the drive: a system that oscillates by itself moves in the same way"
        ));
    }
    if model.terms.len() > MOST_DRIVEN_TERMS {
        let count = model.terms.len();
        doubts.push(format!(
            "it has {count} terms and a drive: so many terms may also overfit the motion of another law"
        ));
    }
    if data.recording.tracks.len() == 1 && model.terms.iter().all(|&k| is_linear(library, k)) {
        doubts.push(
            "the equations are linear without friction: in a single trajectory, another coordinate that was not recorded has the same effect as a drive"
                .to_string(),
        );
    }
    doubts
}

/// `true` for a term with linear equations of motion and without friction.
fn is_linear(library: &Library, k: usize) -> bool {
    let degree = |factor: &Factor| match factor {
        Factor::Power(_, degree) if *degree > 0 => *degree,
        _ => 3,
    };
    let term = library.terms[k];
    let function = match &library.functions[term.function] {
        Function::Product(factors) => factors.iter().map(degree).sum(),
        Function::Formula(..) => 3,
    };
    let own = match term.kind {
        Kind::Kinetic(..) => 2,
        Kind::Gyroscopic(_) => 1,
        Kind::Potential => 0,
        Kind::Dissipation(..) => return false,
    };
    library.is_driven(k) || own + function <= 2
}

/// `true` if the whole motion repeats after a time.
fn repeats(data: &Prepared<'_>, after: f64) -> bool {
    let n = data.n;
    let (mut squares, mut count) = (vec![0.0; n], 0.0);
    for track in &data.recording.tracks {
        for (k, t) in track.times.iter().enumerate() {
            let next = track.times.partition_point(|later| *later < t + after);
            if next == 0 || next >= track.len() {
                continue;
            }
            let share = (t + after - track.times[next - 1]) / (track.times[next] - track.times[next - 1]);
            let mut later = vec![0.0; n];
            Between::Cubic.weigh(&track.times, (next, share), |at, weight| {
                later.iter_mut().zip(&track.q[at * n..]).for_each(|(q, x)| *q += weight * x);
            });
            for (i, square) in squares.iter_mut().enumerate() {
                let gone = later[i] - track.q[k * n + i];
                *square += if data.recording.periodic[i] { 2.0 * (gone / 2.0).sin() } else { gone }.powi(2);
            }
            count += 1.0;
        }
    }
    let same = |i: usize| {
        let noise = 2.0 * data.sigma[i].powi(2);
        squares[i] / count - noise < 2.0 * (MOST_PERIOD_DIFFERENCE * data.spread[i]).powi(2)
    };
    count >= LEAST_COMPARED_SAMPLES && (0..n).all(same)
}

//! Functions that constrain a motion without a second branch: relations between integer multiples of angles, and gradients that do not vanish
//! along the motion.

use super::features::Features;
use super::generators::{Generator, Limits, digits, reduce};
use super::thresholds::{
    ANGLE_MULTIPLES, BRANCH_RATIO, COMMON_DIRECTIONS, INDEPENDENCE_STATES, ROUNDING_SHARE, VISIBLE_GRADIENT,
    WHOLE_NUMBER_ERROR,
};
use super::{ConstraintKind, FoundConstraint, MotionSamples};
use crate::linalg::{Workspace, dot, eigh};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Replaces functions of angles alone whose gradients have the same directions everywhere by `sin(k.q - delta)` with integers `k`: `cos(b) -
/// cos(2a)` has a second branch at every half turn, the sine of `b - 2a` has none. Returns the remaining functions.
pub(super) fn phases(
    samples: &MotionSamples,
    features: &Features,
    limits: Limits,
    functions: &[Generator],
) -> (Vec<FoundConstraint>, Vec<Generator>) {
    let of_angles = |generator: &&Generator| features.coordinates(&generator.weights).all(|i| samples.periodic()[i]);
    let (angles, others): (Vec<&Generator>, Vec<&Generator>) = functions.iter().partition(of_angles);
    let found = directions(samples, features, &angles)
        .and_then(|rows| rows.iter().map(|k| phase(samples, limits, k)).collect::<Option<Vec<_>>>());
    match found {
        Some(found) if !angles.is_empty() => (found, others.into_iter().cloned().collect()),
        _ => (Vec::new(), functions.to_vec()),
    }
}

/// Integer multiples of the coordinates that span the gradients of some functions everywhere, if they exist.
fn directions(samples: &MotionSamples, features: &Features, functions: &[&Generator]) -> Option<Vec<Vec<i32>>> {
    let (n, mut mean, mut count) = (samples.n(), vec![0.0; samples.n() * samples.n()], 0.0);
    for at in samples.places(INDEPENDENCE_STATES) {
        let rows = functions.iter().map(|function| {
            let row = features.gradient(samples, at, &function.weights);
            // Where a gradient nearly vanishes, its direction is noise.
            let seen = dot(&row, &row) > VISIBLE_GRADIENT * function.size().powi(2);
            if seen { row } else { vec![0.0; n] }
        });
        let rows: Vec<Vec<f64>> = rows.collect();
        let size: f64 = rows.iter().map(|row| dot(row, row)).sum();
        if size > 0.0 {
            rows.iter().for_each(|row| (0..n * n).for_each(|k| mean[k] += row[k / n] * row[k % n] / size));
            count += 1.0;
        }
    }
    mean.iter_mut().for_each(|x| *x /= f64::max(count, 1.0));
    let (mut shares, mut vectors) = (vec![0.0; n], vec![0.0; n * n]);
    eigh(n, &mean, &mut shares, &mut vectors, &mut Workspace::new()).ok()?;
    let alike = |r: &usize| shares[n - r..].iter().sum::<f64>() >= COMMON_DIRECTIONS;
    let r = (1..=functions.len().min(n)).find(alike)?;
    let mut rows: Vec<Vec<f64>> = vectors.chunks_exact(n).skip(n - r).map(<[f64]>::to_vec).collect();
    reduce(&mut rows, &vec![1.0; n]);
    let whole = |row: &Vec<f64>| {
        let near =
            |s: &u32| row.iter().all(|x| (f64::from(*s) * x - (f64::from(*s) * x).round()).abs() < WHOLE_NUMBER_ERROR);
        ANGLE_MULTIPLES.into_iter().find(near).map(|s| row.iter().map(|x| (f64::from(s) * x).round() as i32).collect())
    };
    rows.iter().map(whole).collect()
}

/// `sin(k.q - delta)`, if it vanishes along the motion within the noise.
fn phase(samples: &MotionSamples, limits: Limits, k: &[i32]) -> Option<FoundConstraint> {
    let angle = |at: usize| k.iter().zip(samples.state(at)).map(|(k, q)| f64::from(*k) * q).sum::<f64>();
    let (sin, cos) = (0..samples.len()).map(angle).fold((0.0, 0.0), |(s, c), a| (s + a.sin(), c + a.cos()));
    let first = sin.atan2(cos);
    let off = |at: usize| {
        let turned = angle(at) - first;
        turned - TAU * (turned / TAU).round()
    };
    let count = samples.len() as f64;
    let mean = (0..samples.len()).map(off).sum::<f64>() / count;
    let square = (0..samples.len()).map(|at| (off(at) - mean).powi(2)).sum::<f64>() / count;
    let noise: f64 = k.iter().enumerate().map(|(i, k)| (f64::from(*k) * samples.noise(0, i)).powi(2)).sum();
    let noise = noise + (ROUNDING_SHARE * PI).powi(2);
    let ratio = square / noise;
    if ratio > limits.taken {
        return None;
    }
    let (delta, spread) = (first + mean, 1.96 * (square.max(noise) / samples.independent()).sqrt());
    let sign = if k.iter().find(|k| **k != 0).is_some_and(|k| *k < 0) { -1 } else { 1 };
    let (mut terms, mut coefficients, mut range) = (String::new(), BTreeMap::new(), BTreeMap::new());
    let mut add = |weight: f64, text: String| {
        let joined = match (terms.is_empty(), weight < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        terms += joined;
        terms += &text;
    };
    for (name, k) in samples.names().iter().zip(k).filter(|(_, k)| **k != 0) {
        let k = sign * k;
        let factor = if k.abs() == 1 { String::new() } else { format!("{}*", k.abs()) };
        add(f64::from(k), format!("{factor}{name}"));
        coefficients.insert(name.clone(), f64::from(k));
        range.insert(name.clone(), [f64::from(k); 2]);
    }
    let constant = -f64::from(sign) * delta;
    if constant.abs() > spread {
        add(constant, digits(constant.abs(), spread));
        coefficients.insert("1".to_string(), constant);
        range.insert("1".to_string(), [constant - spread, constant + spread]);
    }
    let kind = if ratio <= limits.within { ConstraintKind::Holonomic } else { ConstraintKind::Nearly };
    Some(FoundConstraint { kind, formula: format!("sin({terms})"), coefficients, range, defect: ratio.sqrt() })
}

/// Which of the functions reach a second branch along the motion: their gradient reverses from one sample to the next, or depends on the
/// gradients of the others.
pub(super) fn branching(samples: &MotionSamples, features: &Features, functions: &[Generator]) -> Vec<bool> {
    let (m, mut found) = (functions.len(), vec![false; functions.len()]);
    let sizes: Vec<f64> = functions.iter().map(Generator::size).collect();
    let row = |at: usize, i: usize| -> Vec<f64> {
        let row = features.gradient(samples, at, &functions[i].weights);
        row.iter().map(|x| x / sizes[i].max(f64::MIN_POSITIVE)).collect()
    };
    let mut least: Vec<(f64, usize)> = Vec::with_capacity(samples.len());
    for track in samples.tracks() {
        let mut before: Option<Vec<Vec<f64>>> = None;
        for at in track {
            let rows: Vec<Vec<f64>> = (0..m).map(|i| row(at, i)).collect();
            for (i, (now, last)) in rows.iter().zip(before.iter().flatten()).enumerate() {
                found[i] |= dot(now, last) < 0.0;
            }
            let gram: Vec<f64> = (0..m * m).map(|k| dot(&rows[k / m], &rows[k % m])).collect();
            let (mut squares, mut directions) = (vec![0.0; m], vec![0.0; m * m]);
            if eigh(m, &gram, &mut squares, &mut directions, &mut Workspace::new()).is_ok() && m > 0 {
                let most =
                    (0..m).fold(0, |most, i| if directions[i].abs() > directions[most].abs() { i } else { most });
                least.push((squares[0].max(0.0).sqrt(), most));
            }
            before = Some(rows);
        }
    }
    let largest = least.iter().map(|(value, _)| *value).fold(0.0, f64::max);
    least.iter().filter(|(value, _)| *value < BRANCH_RATIO * largest).for_each(|(_, i)| found[*i] = true);
    found
}

//! Tests of the constraint search on motions whose constraints are known.

use super::independence::{extend, least_part};
use super::thresholds::NEARLY_DEPENDENT;
use super::*;
use crate::linalg::dot;
use crate::recording::smooth::SmoothOptions;
use crate::recording::{RecordedTrajectory, Recording};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;

/// Coordinates and velocities as functions of time.
type Path = Box<dyn Fn(f64) -> (Vec<f64>, Vec<f64>)>;

/// A recording of motions `t -> (q, v)`, with noise of a share of the size of all positions.
fn recorded(
    names: &[&str],
    periodic: &[bool],
    noise: f64,
    velocities: bool,
    motions: &mut dyn FnMut(&mut ChaCha8Rng) -> Path,
) -> Recording {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut normal = ChaCha8Rng::seed_from_u64(4);
    let mut gauss = move || {
        let (a, b): (f64, f64) = (normal.random(), normal.random());
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    };
    let tracks = (0..24).map(|k| {
        let motion = motions(&mut rng);
        let times: Vec<f64> = (0..120).map(|i| 0.02 * f64::from(i)).collect();
        let states: Vec<_> = times.iter().map(|&t| motion(t)).collect();
        let mut noisy = |x: f64| x + noise * gauss();
        let q = states.iter().flat_map(|(q, _)| q.clone()).map(&mut noisy).collect();
        let v = states.iter().flat_map(|(_, v)| v.clone()).map(&mut noisy).collect();
        let v = if velocities { v } else { Vec::new() };
        RecordedTrajectory { name: format!("run {k}"), times, q, v, a: vec![], force: vec![] }
    });
    Recording {
        coordinates: names.iter().map(|name| name.to_string()).collect(),
        periodic: periodic.to_vec(),
        tracks: tracks.collect(),
    }
}

fn found(recording: &Recording) -> FoundConstraints {
    let samples = MotionSamples::of(recording, &SmoothOptions::default()).unwrap();
    FoundConstraints::of(&samples, ConstraintSearch::default()).unwrap()
}

/// Two rods of lengths 1 and 0.8: one turns at a constant rate, the other accelerates.
fn two_rods(rng: &mut ChaCha8Rng) -> Path {
    let [a, b, da, db]: [f64; 4] = [0; 4].map(|_| 3.0 * rng.random::<f64>() - 1.5);
    Box::new(move |t| {
        let ((s, c), (u, w)) = ((a + da * t).sin_cos(), (b + db * t * t).sin_cos());
        let db = 2.0 * db * t;
        let q = vec![s, -c, s + 0.8 * u, -c - 0.8 * w];
        (q, vec![c * da, s * da, c * da + 0.8 * w * db, s * da + 0.8 * u * db])
    })
}

#[test]
fn rods_are_found_at_any_noise_with_their_lengths() {
    for noise in [0.0, 0.001, 0.01] {
        let names = ["x1", "y1", "x2", "y2"];
        let recording = recorded(&names, &[false; 4], noise, false, &mut |rng| two_rods(rng));
        let found = found(&recording);
        let kinds: Vec<ConstraintKind> = found.constraints.iter().map(|c| c.kind).collect();
        assert_eq!((found.count, kinds), (2, vec![ConstraintKind::Holonomic; 2]), "{noise}: {found:?}");
        assert!(found.gap.unwrap() > 5.0 && found.trajectories == 24 && found.refuted == 0);
        // Higher degrees only add products of these functions.
        let samples = MotionSamples::of(&recording, &SmoothOptions::default()).unwrap();
        let further =
            FoundConstraints::of(&samples, ConstraintSearch { degree: 4, ..ConstraintSearch::default() }).unwrap();
        assert_eq!(further.formulas(), found.formulas(), "{noise}");
        let first = &found.constraints[0];
        assert_eq!(first.coefficients.keys().collect::<Vec<_>>(), ["1", "x1^2", "y1^2"], "{noise}: {first:?}");
        for (term, exact) in [("x1^2", 1.0), ("y1^2", 1.0), ("1", -1.0)] {
            assert!((first.coefficients[term] - exact).abs() < 0.01, "{noise}: {first:?}");
            let [low, high] = first.range[term];
            assert!(low <= exact + 1e-9 && exact - 1e-9 <= high, "{noise} {term}: {low} {high}");
        }
    }
}

/// A rotation matrix whose axis changes with time.
fn rotation(rng: &mut ChaCha8Rng) -> Path {
    let [a, b, c, da, db, dc]: [f64; 6] = [0; 6].map(|_| 4.0 * rng.random::<f64>() - 2.0);
    Box::new(move |t| {
        let [(sa, ca), (sb, cb), (sc, cc)] = [a + da * t, b + db * t, c + dc * t].map(f64::sin_cos);
        let q = [
            [ca * cc - sa * cb * sc, -ca * sc - sa * cb * cc, sa * sb],
            [sa * cc + ca * cb * sc, -sa * sc + ca * cb * cc, -ca * sb],
            [sb * sc, sb * cc, cb],
        ];
        (q.concat(), vec![0.0; 9])
    })
}

/// The products of columns and of rows determine a rotation matrix at most states, but depend on each other where it turns about an axis.
#[test]
fn what_holds_a_rotation_holds_it_about_every_axis() {
    let names = ["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"];
    let recording = recorded(&names, &[false; 9], 0.001, false, &mut |rng| rotation(rng));
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).unwrap();
    let features = Features::of_positions(&samples, 2);
    let vanishing = Vanishing::of(&samples, &features, None, false, (1.0, Limits::of(&samples)));
    let mut held = RowsTaken::at(&samples, GRADIENT_STATES);
    let simplest = held.take(&samples, &features, vanishing.generators().0, false, NEW_FUNCTION);
    let taken = independent_everywhere(&samples, &features, simplest.clone(), vanishing.generators().0);
    assert_eq!((simplest.len(), taken.len()), (6, 6));
    // Orthonormal columns of unit gradients at a turn about the vertical.
    let least = |generators: &[Generator], angle: f64| {
        let (s, c) = angle.sin_cos();
        let turned = MotionSamples::of(
            &Recording {
                tracks: vec![RecordedTrajectory {
                    name: String::new(),
                    times: (0..120).map(f64::from).collect(),
                    q: [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0].repeat(120),
                    v: vec![],
                    a: vec![],
                    force: vec![],
                }],
                ..recording.clone()
            },
            &SmoothOptions::default(),
        );
        let turned = turned.unwrap();
        let rows: Vec<Vec<f64>> = generators.iter().map(|g| features.gradient(&turned, 60, &g.weights)).collect();
        let rows = rows.iter().map(|row| {
            let length = dot(row, row).sqrt();
            row.iter().map(|x| x / length).collect::<Vec<f64>>()
        });
        let rows: Vec<Vec<f64>> = rows.collect();
        least_part(rows.iter().map(Vec::as_slice))
    };
    let worst = |of: &[Generator]| (1..20).map(|k| least(of, 0.31 * f64::from(k))).fold(f64::INFINITY, f64::min);
    assert!(
        worst(&taken) > NEARLY_DEPENDENT && worst(&simplest) < NEARLY_DEPENDENT,
        "{} {}",
        worst(&simplest),
        worst(&taken)
    );
}

/// A rotation about a fixed point: a point of its third axis, then the ends of all three, seen from there.
fn top(rng: &mut ChaCha8Rng) -> Path {
    let rotation = rotation(rng);
    Box::new(move |t| {
        let (r, _) = rotation(t);
        let axis = |j: usize| [r[j], r[3 + j], r[6 + j]];
        let point = axis(2).map(|x| 0.22 * x);
        let end = |j: usize| -> [f64; 3] { [0, 1, 2].map(|i| point[i] + axis(j)[i]) };
        ([point, end(0), end(1), end(2)].concat(), vec![0.0; 12])
    })
}

/// Linear functions are found themselves, not their products with coordinates, which constrain nothing where those vanish.
#[test]
fn what_follows_from_linear_functions_is_not_found_again() {
    let names: Vec<String> = (1..=12).map(|i| format!("q{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for noise in [0.0, 0.001] {
        let found = found(&recorded(&names, &[false; 12], noise, false, &mut |rng| top(rng)));
        assert_eq!(found.count, 9, "{noise}: {found:?}");
        for linear in &found.constraints[..3] {
            let least = linear.coefficients.values().fold(f64::INFINITY, |least, c| c.abs().min(least));
            assert!((least - 0.22 / 1.22).abs() < 1e-3, "{noise}: {linear:?}");
        }
        // The other six contain the remaining nine coordinates, and their terms are squares and products of two.
        let others = found.constraints[3..].iter().flat_map(|found| found.coefficients.keys());
        let used: BTreeSet<&str> =
            others.flat_map(|term| term.split(['*', '^'])).filter(|x| x.starts_with('q')).collect();
        assert_eq!(used.len(), 9, "{noise}: {found:?}");
    }
}

/// A disk of radius 0.5 that turns and rolls at independent rates.
fn rolling_disk(rng: &mut ChaCha8Rng) -> Path {
    let [x, y, heading, turn, speed]: [f64; 5] = [0; 5].map(|_| 4.0 * rng.random::<f64>() - 2.0);
    let turn = turn + 0.3 * turn.signum();
    Box::new(move |t| {
        let theta = heading + turn * t;
        let (s, c) = theta.sin_cos();
        let (s0, c0) = heading.sin_cos();
        let path = 0.5 * speed / turn;
        let q = vec![x + path * (s - s0), y - path * (c - c0), theta, speed * t];
        (q, vec![0.5 * speed * c, 0.5 * speed * s, turn, speed])
    })
}

#[test]
fn rolling_is_nonholonomic_and_what_it_conserves_is_not_imposed() {
    for noise in [0.0, 0.001] {
        let names = ["x", "y", "theta", "phi"];
        let recording = recorded(&names, &[false, false, true, true], noise, true, &mut |rng| rolling_disk(rng));
        let found = found(&recording);
        let kinds: Vec<ConstraintKind> = found.constraints.iter().map(|c| c.kind).collect();
        assert_eq!((found.count, kinds), (2, vec![ConstraintKind::Nonholonomic; 2]), "{noise}: {found:?}");
        // A row may do without the rolling: the centre moves along the heading.
        let rows = found.constraints.iter().flat_map(|row| &row.coefficients);
        let rolled: Vec<f64> = rows.filter(|(term, _)| term.ends_with("phi_dot")).map(|(_, c)| c.abs()).collect();
        assert!(!rolled.is_empty() && rolled.iter().all(|c| (c - 0.5).abs() < 0.005), "{found:?}");
    }
    // Points on circles of different radii.
    let mut circle = |rng: &mut ChaCha8Rng| -> Path {
        let [r, turn]: [f64; 2] = [0; 2].map(|_| 1.0 + rng.random::<f64>());
        let phase: f64 = 6.0 * rng.random::<f64>();
        Box::new(move |t| {
            let (s, c) = (phase + turn * t).sin_cos();
            (vec![r * c, r * s], vec![-r * turn * s, r * turn * c])
        })
    };
    let found = found(&recorded(&["x", "y"], &[false; 2], 0.001, true, &mut circle));
    assert_eq!((found.count, found.constraints.len()), (0, 1), "{found:?}");
    assert_eq!(found.constraints[0].kind, ConstraintKind::PerTrajectory);
    let radius = &found.constraints[0].coefficients;
    assert!(radius.len() == 2 && (radius["x^2"] / radius["y^2"] - 1.0).abs() < 1e-3, "{found:?}");
}

/// The row of a rolling disk along its heading has no curl in the null space of both rows, and yet is not the derivative of a function.
#[test]
fn a_row_beside_others_is_integrable_by_itself_or_not_at_all() {
    let names = ["x", "y", "theta", "phi"];
    let recording = recorded(&names, &[false, false, true, true], 0.0, true, &mut |rng| rolling_disk(rng));
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).unwrap();
    let features = Features::of_velocities(&samples, 1);
    let row = |terms: &[(&str, f64)]| {
        let weight = |name: &str| terms.iter().find(|(term, _)| *term == name).map_or(0.0, |(_, weight)| *weight);
        (0..features.len()).map(|term| weight(features.text(term))).collect::<Vec<f64>>()
    };
    let along = row(&[("cos(theta)*x_dot", 1.0), ("sin(theta)*y_dot", 1.0), ("phi_dot", -0.5)]);
    let across = row(&[("sin(theta)*x_dot", 1.0), ("cos(theta)*y_dot", -1.0)]);
    let mut held = RowsTaken::at(&samples, GRADIENT_STATES);
    let none = held.bases.clone();
    for weights in [&along, &across] {
        assert_eq!(weights.iter().filter(|weight| **weight != 0.0).count(), if weights == &along { 3 } else { 2 });
        for (&at, basis) in held.places.iter().zip(&mut held.bases) {
            extend(basis, &features.velocity_row(&samples, at, weights));
        }
    }
    assert_eq!(integrable(&features, &samples, &[along.as_slice(), across.as_slice()], (&held, none)), [false; 2]);
}

#[test]
fn nothing_is_found_where_nothing_is() {
    let mut free = |rng: &mut ChaCha8Rng| -> Path {
        let [a, b, c, d]: [f64; 4] = [0; 4].map(|_| 2.0 * rng.random::<f64>() - 1.0);
        Box::new(move |t| {
            let (s, w) = ((1.3 * t + 3.0 * a).sin(), (2.1 * t + 3.0 * b).cos());
            (vec![c * s, d * w], vec![1.3 * c * (1.3 * t + 3.0 * a).cos(), -2.1 * d * (2.1 * t + 3.0 * b).sin()])
        })
    };
    for noise in [0.0, 0.001, 0.01] {
        let found = found(&recorded(&["x", "y"], &[false; 2], noise, false, &mut free));
        assert_eq!((found.count, found.constraints.len()), (0, 0), "{noise}: {found:?}");
    }
}

#[test]
fn too_few_samples_and_too_many_terms_are_refused() {
    let mut recording = recorded(&["x1", "y1", "x2", "y2"], &[false; 4], 0.0, false, &mut |rng| two_rods(rng));
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).unwrap();
    let search = |degree| FoundConstraints::of(&samples, ConstraintSearch { degree, velocity_degree: 1 });
    assert!(matches!(search(12), Err(ConstraintSearchError::Terms { .. })));
    recording.tracks.truncate(1);
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).unwrap();
    let few = FoundConstraints::of(&samples, ConstraintSearch { degree: 4, velocity_degree: 1 });
    assert!(matches!(few, Err(ConstraintSearchError::Samples { terms: 70, .. })), "{few:?}");
}

/// The end of a rod of length 1 that swings.
fn rod(rng: &mut ChaCha8Rng) -> impl Fn(f64) -> (f64, f64) + 'static {
    let [a, da, w]: [f64; 3] = [0; 3].map(|_| 2.0 * rng.random::<f64>() - 1.0);
    move |t| (3.0 * a + 2.0 * da * t + (1.5 * t + w).sin()).sin_cos()
}

#[test]
fn a_column_that_stands_still_says_nothing_of_a_constraint() {
    for noise in [0.0, 0.01] {
        let mut motion = |rng: &mut ChaCha8Rng| -> Path {
            let rod = rod(rng);
            Box::new(move |t| (vec![rod(t).0, -rod(t).1, 0.3], vec![]))
        };
        let found = found(&recorded(&["x", "y", "z"], &[false; 3], noise, false, &mut motion));
        assert_eq!((found.count, found.constraints.len()), (1, 1), "{noise}: {found:?}");
        assert_eq!(found.still.keys().collect::<Vec<_>>(), ["z"], "{noise}");
        assert!(!found.constraints[0].formula.contains('z'));
    }
    // All of them are noise.
    let mut still = |_: &mut ChaCha8Rng| -> Path { Box::new(|_| (vec![0.3, -1.0], vec![])) };
    let found = found(&recorded(&["x", "y"], &[false; 2], 0.01, false, &mut still));
    assert_eq!((found.count, found.constraints.len(), found.still.len()), (0, 0, 2), "{found:?}");
}

#[test]
fn what_stretches_by_more_than_the_noise_is_nearly_a_constraint() {
    let kinds = |stretch: f64| {
        let mut motion = |rng: &mut ChaCha8Rng| -> Path {
            let rod = rod(rng);
            Box::new(move |t| {
                let (length, (sin, cos)) = (1.0 + stretch * (2.3 * t).sin(), rod(t));
                (vec![length * sin, -length * cos], vec![])
            })
        };
        let found = found(&recorded(&["x", "y"], &[false; 2], 0.01, false, &mut motion));
        assert_eq!(found.count, found.formulas().len());
        found.constraints.iter().map(|c| c.kind).collect::<Vec<_>>()
    };
    // A root mean square stretch of 1.6 times the noise, and one of a tenth.
    assert_eq!(kinds(0.01 * 1.6 * 2f64.sqrt()), [ConstraintKind::Nearly]);
    assert_eq!(kinds(0.01 * 0.1), [ConstraintKind::Holonomic]);
}

#[test]
fn wheels_that_are_geared_are_held_by_the_sine_of_their_difference() {
    for noise in [0.0, 0.01] {
        let mut motion = |rng: &mut ChaCha8Rng| -> Path {
            let [start, rate]: [f64; 2] = [0; 2].map(|_| 6.0 * rng.random::<f64>() - 3.0);
            Box::new(move |t| {
                let a = start + rate * t;
                (vec![a, 2.0 * a + 0.3], vec![])
            })
        };
        let found = found(&recorded(&["a", "b"], &[true; 2], noise, false, &mut motion));
        let gear = &found.constraints[0];
        assert_eq!((found.count, found.constraints.len(), gear.kind), (1, 1, ConstraintKind::Holonomic), "{found:?}");
        let of = |name: &str| gear.coefficients[name];
        assert!(
            gear.formula.starts_with("sin(2*a - b + 0.3") || gear.formula.starts_with("sin(2*a - b + 0.29"),
            "{gear:?}"
        );
        assert!((of("a"), of("b")) == (2.0, -1.0) && (of("1") - 0.3).abs() < 2e-3, "{gear:?}");
        let [low, high] = gear.range["1"];
        assert!(low <= 0.3 + 1e-9 && 0.3 - 1e-9 <= high, "{gear:?}");
    }
}

/// A bead on a figure eight passes through its crossing, where the gradient vanishes.
#[test]
fn a_curve_that_crosses_itself_on_the_way_is_no_constraint_to_compute_with() {
    let mut motion = |rng: &mut ChaCha8Rng| -> Path {
        let [start, rate]: [f64; 2] = [0; 2].map(|_| 1.0 + 2.0 * rng.random::<f64>());
        Box::new(move |t| {
            let (sin, cos) = (start + rate * t).sin_cos();
            (vec![cos, sin * cos], vec![])
        })
    };
    // x^4 = x^2 - y^2
    let recording = recorded(&["x", "y"], &[false; 2], 1e-4, false, &mut motion);
    let samples = MotionSamples::of(&recording, &SmoothOptions::default()).unwrap();
    let found = FoundConstraints::of(&samples, ConstraintSearch { degree: 4, velocity_degree: 0 }).unwrap();
    assert_eq!((found.count, found.formulas().len()), (0, 0), "{found:?}");
    assert!(found.constraints.iter().any(|c| c.kind == ConstraintKind::Branching), "{found:?}");
}

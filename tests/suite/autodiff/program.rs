//! Replayed programs against the same functions of floats.

use lnn::forward::{Dual, HyperDual};
use lnn::scalar::{Real, Scalar};
use lnn::tape::{Program, Replay, ScalarFunction, TapeError, Tracer};
use std::sync::Arc;

/// Numbers in `(-1, 1)`, the same every time.
fn numbers<S: Scalar>(count: usize, seed: u32) -> Vec<S> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12345);
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1u32 << 23) - 1.0
    };
    (0..count).map(|_| S::of_f64(next())).collect()
}

/// Outputs of all lanes.
fn run<S: Scalar>(program: Program<S>, lanes: usize, x: &[S], p: &[S]) -> Vec<S> {
    let mut y = vec![S::nan(); lanes * program.outputs()];
    Replay::new(Arc::new(program)).evaluate(lanes, &[x], p, &mut [&mut y]).unwrap();
    y
}

fn close<S: Scalar>(a: &[S], b: &[S], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let scale = b.iter().fold(1.0f64, |most, x| most.max(x.to_f64().abs()));
    for (i, (&x, &y)) in a.iter().zip(b).enumerate() {
        let gap = (x - y).to_f64().abs() / scale;
        assert!(gap <= tolerance, "{i}: {x:?} {y:?} differ by {gap:e}");
    }
}

/// Two states, three parameters, every kind of scalar operation.
struct Mixture;
impl ScalarFunction for Mixture {
    fn eval<R: Real>(&self, z: &[R]) -> R {
        let [a, b, m, k, l] = [z[0], z[1], z[2], z[3], z[4]];
        let inertia = m * m + k.exp() * R::two();
        let (sin, cos) = (a - b).sin_cos();
        let energy = R::half() * inertia * b.sqr() - l * cos.powi(3) + (sin * m).tanh() / (inertia + a.sqr());
        let clipped = a.max(b).min(l) + (a * b).abs() + a.relu() * k.softplus();
        let rest = inertia.powf(sin) + a.atan2(inertia) + inertia.sqrt().recip() + (b * k).erfc() + b.cos();
        energy + clipped * rest + b.logistic().ln() + a.sinh() - (a * a).ln_1p()
    }
}

#[test]
fn replay_agrees_with_floats_lane_by_lane() {
    let record = || {
        Program::<f64>::record(2, 3, |x, p| {
            let z = [x[0], x[1], p[0], p[1], p[2]];
            vec![Mixture.eval(&z), x[0] * p[0], p[1] * p[2]]
        })
        .unwrap()
    };
    let parameters = numbers::<f64>(3, 1);
    for lanes in [1, 3, 64, 65, 200] {
        let x = numbers::<f64>(2 * lanes, 2);
        let y = run(record(), lanes, &x, &parameters);
        for lane in 0..lanes {
            let state = &x[2 * lane..2 * lane + 2];
            let value = Mixture.eval(&[state, &parameters].concat());
            // Rows and single numbers take the elementary functions from different places: alike up to their rounding.
            close(&y[3 * lane..3 * lane + 1], &[value], 16.0 * f64::EPSILON);
            assert_eq!(&y[3 * lane + 1..3 * lane + 3], [state[0] * parameters[0], parameters[1] * parameters[2]]);
            // One lane alone: the same bits.
            assert_eq!(run(record(), 1, state, &parameters), &y[3 * lane..3 * lane + 3]);
        }
    }
}

#[test]
fn forward_numbers_ride_on_programs_and_records_are_lean() {
    // d/dx of x^2 sin p, written twice: the second costs nothing; nor does what no output needs.
    let program = Program::<f64>::record(1, 1, |x, p| {
        let f = |x| {
            let x = Dual::new(x, Tracer::one());
            (x * x * Dual::lift(p[0].sin())).tangent
        };
        let unused = x[0].exp();
        let _ = unused * unused;
        vec![f(x[0]), f(x[0])]
    })
    .unwrap();
    // x; p and (sin p, cos p); x + x; (x + x) sin p.
    assert_eq!((program.lane_operations(), program.uniform_operations()), (3, 2));
    assert_eq!(run(program, 1, &[3.0], &[0.5]), [6.0 * 0.5f64.sin(); 2]);
}

#[test]
fn dead_lanes_and_nan() {
    let program = Program::<f64>::record(1, 0, |x, _| vec![x[0].select(x[0].sqrt().ln(), Real::zero())]).unwrap();
    let y = run(program, 4, &[0.0, -1.0, 4.0, f64::NAN], &[]);
    assert_eq!(y[..3], [0.0, 0.0, 2.0f64.ln()]);
    assert!(y[3].is_nan());
}

#[test]
fn errors_are_typed() {
    let program = Program::<f64>::record(2, 1, |x, p| vec![x[0] * x[1] + p[0]]).unwrap();
    let short = Replay::new(Arc::new(program)).evaluate(2, &[&[1.0; 4]], &[], &mut [&mut [0.0; 2]]);
    assert_eq!(short, Err(TapeError::Shape { what: "parameters", expected: 1, found: 0 }));
    let mut foreign = Ok(());
    let outer = Program::<f64>::record(1, 0, |x, _| {
        foreign = Program::<f64>::record(1, 0, |y, _| {
            let _ = y[0] * x[0];
            vec![y[0]]
        })
        .map(|_| ());
        vec![x[0]]
    });
    assert_eq!((outer.map(|_| ()), foreign), (Err(TapeError::MixedTapes), Err(TapeError::MixedTapes)));
}

#[test]
fn fields_give_what_rows_give() {
    // Three inputs from two fields, three outputs to two fields and one that is left out; a chunk and a part of one.
    let lanes = 70;
    let program = Program::<f64>::record(3, 2, |x, p| vec![x[0] * p[0] + x[2], x[1].sin() * p[1], p[0]]).unwrap();
    let (rows, p) = (numbers::<f64>(3 * lanes, 21), numbers::<f64>(2, 22));
    let column = |from: usize, width: usize| -> Vec<f64> {
        rows.chunks(3).flat_map(|row| row[from..from + width].to_vec()).collect()
    };
    let (first, second) = (column(0, 1), column(1, 2));
    let mut replay = Replay::new(Arc::new(program));
    let mut want = vec![0.0; 3 * lanes];
    replay.evaluate(lanes, &[&rows], &p, &mut [&mut want]).unwrap();
    let (mut a, mut b) = (vec![0.0; 2 * lanes], vec![0.0; lanes]);
    replay.evaluate(lanes, &[&first, &second], &p, &mut [&mut a, &mut [], &mut b]).unwrap();
    for (lane, row) in want.chunks(3).enumerate() {
        assert_eq!(
            [a[2 * lane], a[2 * lane + 1], b[lane]].map(f64::to_bits),
            [row[0], row[1], row[2]].map(f64::to_bits)
        );
    }
    let short = replay.evaluate(lanes, &[&first], &p, &mut [&mut a, &mut b]);
    assert_eq!(short, Err(TapeError::Shape { what: "inputs of a state", expected: 3, found: 1 }));
    let ragged = replay.evaluate(lanes, &[&rows], &p, &mut [&mut a, &mut b[1..]]);
    assert_eq!(ragged, Err(TapeError::Shape { what: "outputs of a state", expected: 3, found: 2 }));
}

/// Everything the table has, of two inputs and a parameter.
fn assorted<R: Real>(x: &[R], p: &[R]) -> [R; 2] {
    let (sin, cos) = (x[0] * p[0]).sin_cos();
    let root = (x[1].sqr() + R::one()).sqrt();
    [sin * root.ln() + x[1].atan2(cos), (x[0] - x[1]).select(cos.powi(3), root.exp()) / p[0]]
}

#[test]
fn an_interpreted_program_is_the_recorded_function_of_any_number() {
    let program = Program::<f64>::record(2, 1, |x, p| assorted(x, p).to_vec()).unwrap();
    let (x, p) = ([0.3, -0.8], [1.7]);
    assert_eq!(program.interpret(&x, &p).unwrap(), assorted(&x, &p));
    let seeded = [HyperDual::new(0.3, 1.0, 0.5, 0.0), HyperDual::new(-0.8, 0.0, 2.0, 1.0)];
    let (found, expected) =
        (program.interpret(&seeded, &[HyperDual::lift(1.7)]), assorted(&seeded, &[HyperDual::lift(1.7)]));
    for (a, b) in found.unwrap().into_iter().zip(expected) {
        close(&[a.value, a.s, a.t, a.st], &[b.value, b.s, b.t, b.st], 4e-16);
    }
    // Recorded again it is the same program.
    let again = Program::<f64>::record(2, 1, |x, p| program.interpret(x, p).unwrap()).unwrap();
    assert_eq!(again.lane_operations(), program.lane_operations());
    assert_eq!(again.interpret(&x, &p).unwrap(), assorted(&x, &p));
    let wrong = program.interpret(&x[..1], &p).unwrap_err();
    assert_eq!(wrong, TapeError::Shape { what: "inputs", expected: 2, found: 1 });
}

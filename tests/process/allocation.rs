//! Replays and reused tapes allocate nothing after the first call.

#[path = "../../examples/batched_hessians.rs"]
mod batched_hessians;

use crate::alone;
use crate::counting::allocations;
use lnn::scalar::Real;
use lnn::tape::{Adjoints, Program, Replay, Tape};
use std::sync::Arc;

#[test]
fn replay_and_reused_tape_allocate_nothing() {
    if !alone("allocation::replay_and_reused_tape_allocate_nothing") {
        return;
    }
    assert!(allocations(|| drop(std::hint::black_box(vec![1u8; 100]))) > 0, "the counter counts");

    let program = Program::<f64>::record(3, 12, |x, p| {
        let hidden = (x[0] * p[0] + x[2].sin() * p[8]).tanh();
        let determinant = (x[0].exp() + p[1]) * x[2].cosh() - x[1].sqr();
        vec![hidden / determinant, x[1].atan2(hidden), x[0].select(hidden, x[2]) + p[11]]
    })
    .unwrap();
    let lanes = 100;
    let inputs: Vec<f64> = (0..3 * lanes).map(|i| (i as f64 * 0.37).sin()).collect();
    let parameters: Vec<f64> = (0..12).map(|i| 0.5 + 0.1 * f64::from(i)).collect();
    let mut outputs = vec![0.0; 3 * lanes];
    let mut replay = Replay::new(Arc::new(program));
    let mut round = |inputs: &[f64]| {
        replay.evaluate(lanes, &[inputs], &parameters, &mut [&mut outputs]).unwrap();
    };
    round(&inputs);
    assert_eq!(allocations(|| (0..10).for_each(|_| round(&inputs))), 0);
    assert!(outputs.iter().all(|x| x.is_finite()));

    let (mut tape, mut adjoints) = (Tape::<f64>::new(), Adjoints::new());
    let mut round = || {
        tape.reset();
        let x = tape.variable(0.3);
        let y = (0..1000).fold(x, |y, _| (y * x).sin());
        tape.reverse(y, &mut adjoints).unwrap();
        assert!(adjoints.of(x).is_finite());
    };
    // The reset after the first recording makes room for it.
    round();
    round();
    assert_eq!(allocations(|| (0..10).for_each(|_| round())), 0);
}

#[test]
fn a_control_loop_allocates_nothing() {
    if alone("allocation::a_control_loop_allocates_nothing") {
        batched_hessians::main().unwrap();
    }
}

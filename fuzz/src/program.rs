//! A random expression, differentiated by replayed programs and by the tape, against nested forward numbers.
//!
//! The judge evaluates the expression over nested forward numbers in double-double and tells how far one relative
//! rounding of every component of every operand moves each of its answers (its condition). Values, gradients and
//! products of the Hessian with a direction must agree within that many roundings, in `f64` and in double-double; lanes
//! of a batch must agree to the bit.

use super::accuracy::cast;
use super::bytes::{Bytes, Random};
use lnn::forward::HyperDual;
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{Function, Program, Replay, ScalarFunction, gradient};
use std::sync::Arc;

/// Variables of the expression: the first two are lane inputs, the others parameters.
const VARIABLES: usize = 4;
const INPUTS: usize = 2;
/// Operations at most.
const LENGTH: usize = 24;
/// Most roundings per operation that an answer may be off; see `tests/suite/linalg.rs` for the number.
const R: f64 = 30.0;
/// Relative perturbation of the judge: larger than the roundings of `f64` add up to, so that a kink or a pole within
/// their reach is within its own.
const STEP: f64 = 1.0 / (1u64 << 48) as f64;

/// One operation on earlier results.
#[derive(Clone, Copy, Debug)]
struct Operation {
    code: u8,
    operands: [usize; 3],
    number: f64,
}

/// A chain of operations; the last result is the value.
#[derive(Debug)]
struct Expression {
    operations: Vec<Operation>,
}

impl Expression {
    fn of(bytes: &mut Bytes<'_>) -> Self {
        let mut operations = Vec::new();
        while operations.len() < LENGTH && !bytes.is_empty() {
            let known = VARIABLES + operations.len();
            let code = bytes.byte();
            // Late results are used more often: long chains.
            let mut operand = || known - 1 - bytes.below(known.min(8));
            let operands = [operand(), operand(), operand()];
            operations.push(Operation { code, operands, number: bytes.small() });
        }
        Self { operations }
    }

    /// The value; every operand passes through `read` on its way.
    fn eval<T: Real>(&self, variables: &[T], mut read: impl FnMut(T) -> T) -> T {
        let mut results = variables.to_vec();
        for operation in &self.operations {
            let [a, b, c] = operation.operands.map(|k| read(results[k]));
            results.push(apply(operation, a, b, c));
        }
        let last = results[results.len() - 1];
        read(last)
    }
}

fn apply<T: Real>(operation: &Operation, a: T, b: T, c: T) -> T {
    let number = T::of(operation.number);
    match operation.code % 40 {
        0 | 1 => a + b,
        2 | 3 => a - b,
        4..=6 => a * b,
        7 => a / b,
        8 => -a,
        9 => a.recip(),
        10 => a.sqrt(),
        11 => a.exp(),
        12 => a.exp_m1(),
        13 => a.ln(),
        14 => a.ln_1p(),
        15 => a.sin(),
        16 => a.cos(),
        17 => a.tan(),
        18 => a.asin(),
        19 => a.acos(),
        20 => a.atan(),
        21 => a.sinh(),
        22 => a.cosh(),
        23 => a.tanh(),
        24 => a.erfc(),
        25 => a.logistic(),
        26 => a.softplus(),
        27 => a.abs(),
        28 => a.powi(operation.number as i32),
        29 => a.powf(b),
        30 => a.atan2(b),
        31 => a.max(b),
        32 => a.min(b),
        33 => a.select(b, c),
        34 => a.mul_add(b, c),
        35 => a.relu(),
        36 => {
            let (sin, cos) = a.sin_cos();
            sin * b + cos
        }
        37 => a + number,
        38 => a * number,
        _ => a.sqr(),
    }
}

impl ScalarFunction for Expression {
    fn eval<T: Real>(&self, x: &[T]) -> T {
        Self::eval(self, x, |x| x)
    }
}

/// `f`, `df/dx` and `(d2f/dx dx) u`: one plus twice the variables.
type Answer<S> = [S; 1 + 2 * VARIABLES];

/// By nested forward numbers, one variable at a time.
fn nested<S: Scalar>(
    f: &Expression,
    x: &[S],
    u: &[S],
    mut read: impl FnMut(HyperDual<S>) -> HyperDual<S>,
) -> Answer<S> {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let mut answer = [zero; 1 + 2 * VARIABLES];
    for i in 0..VARIABLES {
        let seed = |k: usize| HyperDual::new(x[k], if k == i { one } else { zero }, u[k], zero);
        let point: [HyperDual<S>; VARIABLES] = std::array::from_fn(seed);
        let y = f.eval(&point, &mut read);
        answer[0] = y.value;
        answer[1 + i] = y.s;
        answer[1 + VARIABLES + i] = y.st;
    }
    answer
}

/// By programs on `lanes` equal states: the value's, and one for each derivative by forward numbers.
fn replayed<S: Scalar>(f: &Expression, x: &[S], u: &[S], lanes: usize) -> Answer<S> {
    let (zero, one) = (<S as Real>::zero(), <S as Real>::one());
    let program = Program::record(INPUTS, VARIABLES - INPUTS, |x, p| {
        let z = [x, p].concat();
        let mut outputs = Vec::new();
        for i in 0..VARIABLES {
            let seed = |k: usize| {
                let along = if k == i { one } else { zero };
                HyperDual::new(z[k], Real::constant(along), Real::constant(u[k]), Real::zero())
            };
            let y = f.eval(&std::array::from_fn::<_, VARIABLES, _>(seed), |x| x);
            outputs.push((y.value, y.s, y.st));
        }
        let value = outputs[..1].iter().map(|y| y.0);
        value.chain(outputs.iter().map(|y| y.1)).chain(outputs.iter().map(|y| y.2)).collect()
    });
    let mut replay = Replay::new(Arc::new(program.expect("an expression without branches can be recorded")));
    let mut y = vec![zero; lanes * (1 + 2 * VARIABLES)];
    replay.evaluate(lanes, &[&x[..INPUTS].repeat(lanes)], &x[INPUTS..], &mut [&mut y]).expect("shapes fit");
    let mut answer = [zero; 1 + 2 * VARIABLES];
    answer.copy_from_slice(&y[(lanes - 1) * (1 + 2 * VARIABLES)..]);
    answer
}

/// By a recorded function, all variables alike.
fn recorded<S: Scalar>(f: &Expression, x: &[S], u: &[S]) -> Answer<S> {
    let function = Function::record(VARIABLES, |z| f.eval(z, |x| x));
    let mut function = function.expect("an expression without branches can be recorded");
    let mut answer = [<S as Real>::zero(); 1 + 2 * VARIABLES];
    let (first, products) = answer.split_at_mut(1 + VARIABLES);
    let (value, gradient) = first.split_at_mut(1);
    function.gradients(x, value, gradient).expect("shapes fit");
    function.hessian_vectors(x, u, products).expect("shapes fit");
    answer
}

/// The judge's answer with its condition, or `None` where numbers come near the ends of the range or where roundings
/// move an answer by more than can be told.
fn judged(f: &Expression, x: &[f64], u: &[f64]) -> Option<(Answer<Dd>, [f64; 1 + 2 * VARIABLES])> {
    let (x, u): (Vec<Dd>, Vec<Dd>) = (cast(x), cast(u));
    let (mut tame, mut largest) = (true, 0f64);
    let exact = nested(f, &x, &u, |y| {
        for part in [y.value, y.s, y.t, y.st] {
            let size = part.to_f64().abs();
            largest = largest.max(size);
            // Smaller ones may be the roundings that double-double leaves of a difference that is zero.
            tame &= size == 0.0 || (1e-20..1e60).contains(&size);
        }
        y
    });
    if !tame {
        return None;
    }
    // Any way may lose roundings of the largest number on it, even where no perturbation of operands tells.
    let mut condition = exact.map(|y| y.to_f64().abs().max(largest));
    for pattern in 0..8 {
        let mut random = Random(pattern);
        let mut moved = |y: Dd| y + y * Dd::of_f64(STEP * random.sign());
        // A zero among the values may be all that is left of larger numbers, and other ways come to their roundings; on a
        // kink or a cut they may come to either side.
        let nothing = Dd::of_f64(if pattern % 2 == 0 { STEP } else { -STEP });
        let other = nested(f, &x, &u, |y| {
            let value = if y.value == <Dd as Real>::zero() { nothing } else { moved(y.value) };
            HyperDual::new(value, moved(y.s), moved(y.t), moved(y.st))
        });
        for ((condition, &a), &b) in condition.iter_mut().zip(&exact).zip(&other) {
            let change = ((a - b).to_f64() / STEP).abs();
            // Not a number beside a number (a negative one to a power that is no longer whole) tells nothing.
            if change.is_nan() || change > *condition {
                *condition = change;
            }
        }
    }
    // Beyond, a perturbation is not small and a kink or a pole may lie within it.
    let size = exact.iter().fold(1.0f64, |most, y| most.max(y.to_f64().abs()));
    condition.iter().all(|c| *c <= 1e9 * size).then_some((exact, condition))
}

fn agrees<S: Scalar>(
    way: &str,
    f: &Expression,
    found: &[S],
    (exact, condition): &(Answer<Dd>, [f64; 1 + 2 * VARIABLES]),
) {
    let roundings = R * S::epsilon().to_f64() * (1 + f.operations.len()) as f64;
    for (k, &y) in found.iter().enumerate() {
        let error = (y.cast::<Dd>() - exact[k]).to_f64().abs();
        let bound = roundings * condition[k];
        assert!(
            error <= bound,
            "{way}, {}: number {k} is {y:?}, not {}: {error:e} > {bound:e} in {f:?}",
            S::NAME,
            exact[k]
        );
    }
}

/// Compares all ways.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let x: [f64; VARIABLES] = std::array::from_fn(|_| bytes.small());
    let u: [f64; VARIABLES] = std::array::from_fn(|_| bytes.small());
    let f = Expression::of(&mut bytes);

    let alone = replayed(&f, &x, &u, 1);
    let among = replayed(&f, &x, &u, 67);
    assert_eq!(alone.map(bits), among.map(bits), "lanes differ: {alone:?} {among:?} of {f:?}");
    let Some(judged) = judged(&f, &x, &u) else { return };
    agrees("nested", &f, &nested(&f, &x, &u, |y| y), &judged);
    agrees("replayed", &f, &alone, &judged);
    agrees("recorded", &f, &recorded(&f, &x, &u), &judged);
    let (value, slopes) = gradient(&f, &x).expect("one tape");
    agrees("tape", &f, &[&[value], &slopes[..]].concat(), &judged);
    agrees("replayed", &f, &replayed(&f, &cast::<_, Dd>(&x), &cast(&u), 1), &judged);
}

/// The bits, every `NaN` and both zeros alike: a sum over lanes adds zeros.
fn bits(x: f64) -> u64 {
    if x.is_nan() { u64::MAX } else { (x + 0.0).to_bits() }
}

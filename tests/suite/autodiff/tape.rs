//! The eager tape, forward numbers and drivers against each other, on random expressions and at the edges.

use crate::common::properties;
use lnn::forward::{Dual, HyperDual, Jet2};
use lnn::scalar::{Dd, Real, Scalar};
use lnn::tape::{
    Adjoints, Program, ScalarFunction, Tape, TapeError, Var, VectorFunction, derivative, gradient, hessian,
    hessian_vector, jacobian,
};
use proptest::prelude::*;

/// A random smooth expression in three variables, defined everywhere.
#[derive(Clone, Debug)]
enum Expression {
    Variable(usize),
    Constant(i32),
    Unary(u8, Box<Expression>),
    Binary(u8, Box<Expression>, Box<Expression>),
}

fn expressions() -> impl Strategy<Value = Expression> {
    let leaf = prop_oneof![(0usize..3).prop_map(Expression::Variable), (-4i32..5).prop_map(Expression::Constant)];
    leaf.prop_recursive(5, 40, 2, |inner| {
        prop_oneof![
            (0u8..14, inner.clone()).prop_map(|(f, a)| Expression::Unary(f, Box::new(a))),
            (0u8..7, inner.clone(), inner).prop_map(|(f, a, b)| Expression::Binary(f, Box::new(a), Box::new(b))),
        ]
    })
}

impl ScalarFunction for Expression {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let positive = |a: R| a * a + R::one();
        match self {
            Self::Variable(i) => x[*i],
            Self::Constant(c) => R::ratio(*c, 2),
            Self::Unary(f, a) => {
                let a = a.eval(x);
                match f {
                    0 => -a,
                    1 => a.sin(),
                    2 => a.cos(),
                    3 => a.tanh(),
                    4 => a.atan(),
                    5 => a.logistic(),
                    6 => a.softplus(),
                    7 => positive(a).sqrt(),
                    8 => positive(a).ln(),
                    9 => positive(a).recip(),
                    10 => a.sin().exp(),
                    11 => a.sin().powi(3),
                    12 => a.cos().exp_m1(),
                    _ => a.sqr().ln_1p(),
                }
            }
            Self::Binary(f, a, b) => {
                let (a, b) = (a.eval(x), b.eval(x));
                match f {
                    0 => a + b,
                    1 => a - b,
                    2 => a.tanh() * b,
                    3 => a / positive(b),
                    4 => a.atan2(positive(b)),
                    5 => positive(a.sin()).powf(b.sin()),
                    _ => a.sin().select(b, b * b.cos()),
                }
            }
        }
    }
}

/// Largest difference relative to the size of the numbers, `NaN` if any is.
fn distance<S: Scalar>(a: &[S], b: &[S]) -> f64 {
    let scale = a.iter().chain(b).fold(1.0f64, |most, x| most.max(x.to_f64().abs()));
    a.iter().zip(b).fold(0.0, |most: f64, (&x, &y)| {
        let gap = (x - y).to_f64().abs() / scale;
        if gap.is_nan() { f64::NAN } else { most.max(gap) }
    })
}

/// Gradient and Hessian of an expression by every route; `true` if they agree to `tolerance`.
fn routes_agree<S: Scalar>(f: &impl ScalarFunction, x: &[S; 3], tolerance: f64) -> bool {
    let (value, first, second) = hessian(f, x).unwrap();
    let variables = [0, 1, 2].map(|i| Jet2::<S, 3>::variable(x[i], i));
    let jet = f.eval(&variables);
    let flat: Vec<S> = jet.hessian().into_iter().flatten().collect();
    let mut hyper = Vec::new();
    let mut nested = Vec::new();
    // Dual numbers over the tape, against the tape over dual numbers that `hessian` uses.
    let mut over_tape = Vec::new();
    for i in 0..3 {
        for j in 0..3 {
            let unit = |k: usize, l: usize| if k == l { S::of_f64(1.0) } else { S::of_f64(0.0) };
            let p = [0, 1, 2].map(|k| HyperDual::new(x[k], unit(k, i), unit(k, j), S::of_f64(0.0)));
            hyper.push(f.eval(&p).st);
            let p = [0, 1, 2].map(|k| Dual::new(Dual::new(x[k], unit(k, i)), Dual::lift(unit(k, j))));
            nested.push(f.eval(&p).tangent.tangent);
        }
        let tape = Tape::new();
        let p = [0, 1, 2].map(|k| tape.variable(x[k]));
        let seeded = [0, 1, 2].map(|k| Dual::new(p[k], if k == i { Var::one() } else { Var::zero() }));
        let mut adjoints = Adjoints::new();
        tape.reverse(f.eval(&seeded).tangent, &mut adjoints).unwrap();
        over_tape.extend(p.map(|v| adjoints.of(v)));
    }
    [
        distance(&[value], &[jet.value]),
        distance(&first, &jet.gradient),
        distance(&second, &flat),
        distance(&second, &hyper),
        distance(&second, &nested),
        distance(&second, &over_tape),
    ]
    .iter()
    .all(|&gap| gap <= tolerance)
}

proptest! {
    #![proptest_config(properties(400))]
    #[test]
    fn every_route_gives_the_same_derivatives(f in expressions(), x in prop::array::uniform3(-2.0f64..2.0)) {
        // Deep towers amplify: the tolerance is eps times the size of the numbers and the depth of the tree.
        prop_assert!(routes_agree(&f, &x, 1e-11));
        prop_assert!(routes_agree(&f, &x.map(Dd::of_f64), 1e-26));
    }

    #[test]
    fn integer_polynomials_are_exact(
        terms in prop::collection::vec((-9i32..10, prop::array::uniform3(0i32..4)), 1..6),
        x in prop::array::uniform3(-5i32..6),
    ) {
        let f = Polynomial(terms);
        let point = x.map(f64::from);
        let (value, first, second) = hessian(&f, &point).unwrap();
        prop_assert_eq!(value, f.derivative(x, &[]) as f64);
        let jet = f.eval(&[0, 1, 2].map(|i| Jet2::<f64, 3>::variable(point[i], i)));
        for i in 0..3 {
            prop_assert_eq!(first[i], f.derivative(x, &[i]) as f64);
            for j in 0..3 {
                let exact = f.derivative(x, &[i, j]) as f64;
                prop_assert_eq!(second[3 * i + j], exact);
                prop_assert_eq!(jet.second(i, j), exact);
            }
        }
        // Products are exact in double-double too.
        let (_, dd) = gradient(&Products(&f), &point.map(Dd::of_f64)).unwrap();
        for i in 0..3 {
            prop_assert_eq!(dd[i].parts(), (first[i], 0.0));
        }
    }

    #[test]
    fn adjoint_identity(
        f in prop::array::uniform2(expressions()),
        x in prop::array::uniform3(-2.0f64..2.0),
        v in prop::array::uniform3(-1.0f64..1.0),
        w in prop::array::uniform2(-1.0f64..1.0),
    ) {
        // <J v, w> = <v, J' w>: J v by forward numbers, J' w by sweeps.
        let forward: Vec<f64> = f.iter().map(|f| derivative(f, &x, &v).unwrap().1).collect();
        let reverse: Vec<Vec<f64>> = f.iter().map(|f| gradient(f, &x).unwrap().1).collect();
        let left: f64 = forward.iter().zip(w).map(|(jv, w)| jv * w).sum();
        let right: f64 = (0..3).map(|i| v[i] * (w[0] * reverse[0][i] + w[1] * reverse[1][i])).sum();
        let scale: f64 = reverse.iter().flatten().map(|d| d.abs()).sum::<f64>() + 1.0;
        prop_assert!((left - right).abs() <= 1e-12 * scale, "{} {}", left, right);
        // H v from one sweep equals H times v.
        let (_, _, product) = hessian_vector(&f[0], &x, &v).unwrap();
        let (_, _, matrix) = hessian(&f[0], &x).unwrap();
        let plain: Vec<f64> = (0..3).map(|i| (0..3).map(|j| matrix[3 * i + j] * v[j]).sum()).collect();
        prop_assert!(distance(&product, &plain) <= 1e-11);
    }
}

/// `sum c x^a y^b z^c` with integer coefficients.
#[derive(Debug)]
struct Polynomial(Vec<(i32, [i32; 3])>);

impl ScalarFunction for Polynomial {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let mut sum = R::zero();
        for &(c, powers) in &self.0 {
            sum += R::ratio(c, 1) * x[0].powi(powers[0]) * x[1].powi(powers[1]) * x[2].powi(powers[2]);
        }
        sum
    }
}

/// The same by products alone.
struct Products<'a>(&'a Polynomial);

impl ScalarFunction for Products<'_> {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let term = |&(c, powers): &(i32, [i32; 3])| {
            (0..3).fold(R::ratio(c, 1), |product, i| (0..powers[i]).fold(product, |product, _| product * x[i]))
        };
        self.0.0.iter().map(term).fold(R::zero(), |sum, term| sum + term)
    }
}

impl Polynomial {
    /// A partial derivative in integers.
    fn derivative(&self, x: [i32; 3], by: &[usize]) -> i64 {
        let term = |&(c, mut powers): &(i32, [i32; 3])| {
            let mut product = i64::from(c);
            for &i in by {
                product *= i64::from(powers[i]);
                powers[i] = (powers[i] - 1).max(0);
            }
            (0..3).fold(product, |product, i| product * i64::from(x[i]).pow(powers[i] as u32))
        };
        self.0.iter().map(term).sum()
    }
}

/// `n` products by the same variable.
struct Chain(usize);
impl ScalarFunction for Chain {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        (0..self.0).fold(x[0], |y, _| y * x[1])
    }
}
/// One variable used `n` times.
struct FanOut(usize);
impl ScalarFunction for FanOut {
    fn eval<R: Real>(&self, x: &[R]) -> R {
        let mut sum = R::zero();
        for _ in 0..self.0 {
            sum += x[0];
        }
        sum
    }
}

#[test]
fn long_chains_wide_fans_and_reuse() {
    let (value, d) = gradient(&Chain(1_000_000), &[1.0, 1.0]).unwrap();
    assert_eq!((value, d[0], d[1]), (1.0, 1.0, 1e6));
    assert_eq!(gradient(&FanOut(1_000_000), &[2.0]).unwrap(), (2e6, vec![1e6]));
    let (mut tape, mut adjoints) = (Tape::new(), Adjoints::new());
    let f = Chain(50);
    let gradient = |tape: &mut Tape<f64>, adjoints: &mut Adjoints<f64>| {
        tape.reset();
        let x = [0.7, 1.01].map(|value| tape.variable(value));
        let y = f.eval(&x);
        tape.reverse(y, adjoints).unwrap();
        x.map(|x| adjoints.of(x))
    };
    let first = gradient(&mut tape, &mut adjoints);
    let bytes = tape.statistics().bytes;
    for _ in 0..10_000 {
        let again = gradient(&mut tape, &mut adjoints);
        assert_eq!(first.map(f64::to_bits), again.map(f64::to_bits));
    }
    assert_eq!(tape.statistics().bytes, bytes);
    assert_eq!(tape.statistics().nodes, 52);
}

/// `(-2)^2` with both numbers moving, by every route.
#[test]
fn powers_of_negative_numbers_have_one_set_of_derivatives() {
    struct Power;
    impl ScalarFunction for Power {
        fn eval<R: Real>(&self, x: &[R]) -> R {
            x[0].powf(x[1]) * x[2]
        }
    }
    let x = [-2.0, 2.0, 3.0];
    assert!(routes_agree(&Power, &x, 2.0 * f64::EPSILON));
    let (value, first, second) = hessian(&Power, &x).unwrap();
    let log = 2f64.ln();
    let mixed = -2.0 * (1.0 + 2.0 * log) * 3.0;
    let expected = [6.0, mixed, -4.0, mixed, 12.0 * log * log, 4.0 * log, -4.0, 4.0 * log, 0.0];
    assert_eq!(value, 12.0);
    assert!(distance(&first, &[-12.0, 12.0 * log, 4.0]) <= f64::EPSILON);
    assert!(distance(&second, &expected) <= 2.0 * f64::EPSILON, "{second:?}");
}

#[test]
fn dead_branch_gives_no_nan() {
    struct Root;
    impl ScalarFunction for Root {
        fn eval<R: Real>(&self, x: &[R]) -> R {
            x[0].select(x[0].sqrt(), R::zero())
        }
    }
    assert_eq!(gradient(&Root, &[0.0]).unwrap(), (0.0, vec![0.0]));
    assert_eq!(hessian(&Root, &[0.0]).unwrap(), (0.0, vec![0.0], vec![0.0]));
    assert_eq!(gradient(&Root, &[4.0]).unwrap(), (2.0, vec![0.25]));
    let (value, d) = gradient(&Root, &[f64::NAN]).unwrap();
    assert!(value.is_nan() && d[0].is_nan());
}

#[test]
fn constants_are_not_recorded() {
    let tape = Tape::<f64>::new();
    let x = tape.variable(2.0);
    let c = Var::of(3.0);
    let _ = (c * c + c).sin().sqrt().powf(c).atan2(c).select(c, c);
    assert_eq!(tape.statistics().nodes, 1);
    let y = x + c - c;
    assert_eq!((y.value(), y.id(), tape.statistics().nodes), (2.0, x.id(), 1));
    let zero = x * Var::zero();
    assert_eq!((zero.id(), tape.statistics().nodes), (0, 1));
    // 0 * inf is not a constant: NaN must not vanish.
    let infinite = x * Var::of(f64::INFINITY);
    assert!((infinite * Var::zero()).value().is_nan());
    let mut adjoints = Adjoints::new();
    tape.reverse(zero, &mut adjoints).unwrap();
    assert_eq!(adjoints.of(x), 0.0);
}

#[test]
fn functions_of_one_variable_are_not_recorded() {
    let tape = Tape::<f64>::new();
    let mut adjoints = Adjoints::new();
    let x = tape.variable(0.5);
    let scaled = Var::of(3.0) - x * Var::of(4.0);
    let y = -(scaled.sqr() / Var::of(2.0)).exp();
    assert_eq!((y.id(), tape.statistics().nodes), (x.id(), 1));
    // d/dx -exp((3 - 4x)^2 / 2) = 4 (3 - 4x) exp((3 - 4x)^2 / 2).
    tape.reverse(y, &mut adjoints).unwrap();
    assert_eq!(adjoints.of(x), 4.0 * 0.5f64.exp());
    // A number that is no node has no adjoint; one that differs by a constant has that of its node.
    assert!(adjoints.of(scaled).is_nan() && adjoints.of(y).is_nan());
    assert_eq!(adjoints.of(x + Var::one()), adjoints.of(x));
    // Both uses of a number find their way to its variable.
    let z = tape.variable(2.0);
    let product = scaled * (z * scaled);
    assert_eq!(tape.statistics().nodes, 4);
    tape.reverse(product, &mut adjoints).unwrap();
    assert_eq!((adjoints.of(x), adjoints.of(z)), (2.0 * 2.0 * 1.0 * -4.0, 1.0));
}

#[test]
fn a_zero_partial_derivative_hides_an_infinite_slope() {
    let tape = Tape::<f64>::new();
    let mut adjoints = Adjoints::new();
    let (x, y) = (tape.variable(0.0), tape.variable(3.0));
    let root = x.sqrt();
    for hidden in [x.select(root, y), y * root.sqr() + y, root.sqr() + y, Var::max(root, y)] {
        tape.reverse(hidden, &mut adjoints).unwrap();
        assert_eq!((adjoints.of(x), adjoints.of(y)), (0.0, 1.0), "{hidden:?}");
    }
    tape.reverse(root * y, &mut adjoints).unwrap();
    assert_eq!((adjoints.of(x), adjoints.of(y)), (f64::INFINITY, 0.0));
}

#[test]
fn mixed_tapes_are_refused_by_both() {
    let (first, second) = (Tape::<f64>::new(), Tape::<f64>::new());
    let (a, b) = (first.variable(1.0), second.variable(2.0));
    let mixed = [a + b, a * b, a / b, a.powf(b), a.select(b, b), a.select(a, b)];
    assert!(mixed.iter().all(|y| y.value().is_nan()));
    let mut adjoints = Adjoints::new();
    assert_eq!(first.reverse(a, &mut adjoints), Err(TapeError::MixedTapes));
    assert_eq!(second.reverse(b, &mut adjoints), Err(TapeError::MixedTapes));
    let third = Tape::<f64>::new();
    assert_eq!(third.reverse(a, &mut adjoints), Err(TapeError::Foreign));
}

#[test]
fn a_full_tape_says_so() {
    let tape = Tape::<f64>::with_limit(4);
    let x = tape.variable(1.0);
    let y = (x.sin() * x * x * x).exp();
    assert!(y.value().is_nan());
    assert_eq!(tape.check(), Err(TapeError::Full { limit: 4 }));
}

#[test]
fn branches_on_values_are_refused_in_programs_only() {
    struct Branch;
    impl ScalarFunction for Branch {
        fn eval<R: Real>(&self, x: &[R]) -> R {
            if x[0].primal() > R::Scalar::of_f64(0.0) { x[0] } else { -x[0] }
        }
    }
    assert_eq!(gradient(&Branch, &[-3.0]).unwrap(), (3.0, vec![-1.0]));
    let refused = Program::<f64>::record(1, 0, |x, _| vec![Branch.eval(x)]);
    assert_eq!(refused.map(|_| ()), Err(TapeError::DataDependentBranch));
    assert!(TapeError::DataDependentBranch.to_string().contains("select"));
}

#[test]
fn jacobian_picks_either_mode_and_agrees() {
    struct Wide;
    impl VectorFunction for Wide {
        fn outputs(&self) -> usize {
            2
        }
        fn eval<R: Real>(&self, x: &[R], out: &mut [R]) {
            let sum = x.iter().fold(R::zero(), |sum, &x| sum + x);
            out[0] = sum.sin();
            out[1] = x[0] * sum;
        }
    }
    // Three inputs: reverse; one or two: forward.
    for n in 1..4 {
        let x: Vec<f64> = (0..n).map(|i| 0.3 + i as f64).collect();
        let sum: f64 = x.iter().sum();
        let (value, matrix) = jacobian(&Wide, &x).unwrap();
        assert_eq!(value, [sum.sin(), x[0] * sum]);
        for j in 0..n {
            assert_eq!(matrix[j], sum.cos());
            let want = if j == 0 { sum + x[0] } else { x[0] };
            assert!((matrix[n + j] - want).abs() <= 2.0 * f64::EPSILON * want);
        }
    }
    assert_eq!(
        derivative(&Chain(3), &[1.0, 2.0], &[1.0]),
        Err(TapeError::Shape { what: "direction", expected: 2, found: 1 })
    );
}

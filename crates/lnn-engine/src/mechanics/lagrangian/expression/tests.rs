use super::{Compiler, Expression, ExpressionLagrangian, Meaning};
use crate::forward::Jet2;
use crate::lagrangian::{EulerLagrange, Mechanics, MechanicsError, Request, Terms};
use crate::scalar::{Dd, Real, Scalar};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Two coordinates, their velocities, one parameter.
fn scope() -> BTreeMap<String, Meaning> {
    let position = |i| Meaning::Position(i);
    [
        ("x", position(0)),
        ("y", position(1)),
        ("x_dot", Meaning::Velocity(0)),
        ("y_dot", Meaning::Velocity(1)),
        ("m", Meaning::Parameter(0)),
    ]
    .map(|(name, meaning)| (name.to_string(), meaning))
    .into()
}

fn evaluate<R: Real>(text: &str, [m, x, y, u, v]: [R; 5]) -> Result<R, String> {
    let expression: Expression = text.parse().map_err(|e: super::ExpressionError| e.to_string())?;
    let mut compiler = Compiler::default();
    let value = compiler.add(&expression, &scope(), false).map_err(|e| e.to_string())?;
    Ok(compiler.formula(value).evaluate(&[m], &[x, y], &[u, v]))
}

const POINT: [f64; 5] = [2.0, 0.5, -0.25, 3.0, 0.75];

#[track_caller]
fn is(text: &str, expected: f64) {
    assert_eq!(evaluate(text, POINT), Ok(expected), "{text}");
}

#[track_caller]
fn refused(text: &str, message: &str) {
    assert_eq!(evaluate(text, POINT), Err(message.to_string()), "{text}");
}

#[test]
fn operators_bind_as_on_paper() {
    is("1 + 2*3", 7.0);
    is("8/4/2", 1.0);
    is("8 - 4 - 2", 2.0);
    is("2^3^2", 512.0);
    is("-m^2", -4.0);
    is("(-m)^2", 4.0);
    is("2^-1", 0.5);
    is("-2*-3", 6.0);
    is("2*-m^2", -8.0);
    is("--m", 2.0);
    is("m^-2", 0.25);
    is("x^0", 1.0);
    is(".5e1 + 5.", 10.0);
    is("x_dot*y", -0.75);
    is("atan2(y, x)", (-0.25_f64).atan2(0.5));
    is("max(x, y) - min(x, y)", 0.75);
    is("sin(x)^2 + cos( x )^2", 0.5f64.sin() * 0.5f64.sin() + 0.5f64.cos() * 0.5f64.cos());
    is("x^0.5", 0.5f64.sqrt());
    is("x^m", 0.25);
    is("2*pi", std::f64::consts::TAU);
    is("log(m) - ln(m) + abs(y)", 0.25);
}

#[test]
fn mistakes_are_placed_and_explained() {
    refused("", "column 1: expected a formula, found nothing");
    refused("  ", "column 1: expected a formula, found nothing");
    refused("x +", "column 4: expected a number, a name or a parenthesis, found the end");
    refused("(x", "column 3: expected an operator or `)` for the `(` of column 1, found the end");
    refused("x)", "column 2: expected an operator or the end, found `)`");
    refused("2 x", "column 3: expected an operator or the end, found `x`; a product needs a *");
    refused("2x", "column 2: expected an operator or the end, found `x`; a product needs a *");
    refused("(x)(y)", "column 4: expected an operator or the end, found `(`; a product needs a *");
    refused("x**2", "column 3: expected a number, a name or a parenthesis, found `*`; a power is written ^");
    refused("x_dott", "column 1: unknown name \"x_dott\", did you mean \"x_dot\"?");
    refused("m*theta", "column 3: unknown name \"theta\", expected one of m, x, x_dot, y, y_dot, pi");
    refused("sinn(x)", "column 1: `sinn` is not a function; did you mean \"sin\"?");
    refused("m(x + y)", "column 1: `m` is not a function; a product needs a *, as in 2*(a + b)");
    refused("cos x", "column 5: expected `(` behind the function `cos`, found `x`");
    refused("sin(x, y)", "column 6: expected `)`: `sin` takes one number, found `,`");
    refused("atan2(x)", "column 8: expected a comma: `atan2` takes two numbers, found `)`");
    refused("1e999", "column 1: expected a number from about 1e-307 to 1e308");
    refused("1e-999", "column 1: expected a number from about 1e-307 to 1e308");
    refused(
        "x = 2",
        "column 3: expected a number, a name, an operator (+ - * / ^), a comma or a parenthesis, found `=`",
    );
    refused(
        "ä\u{7}",
        "column 2: expected a number, a name, an operator (+ - * / ^), a comma or a parenthesis, found `\\u{7}`",
    );
}

#[test]
fn depth_and_length_are_bounded_and_chains_are_not() {
    for (open, close) in [("(", ")"), ("-", ""), ("sin(", ")"), ("2^", "")] {
        let nested = |depth: usize| format!("{}x{}", open.repeat(depth), close.repeat(depth));
        assert!(evaluate(&nested(100), POINT).is_ok(), "{open}");
        let error = evaluate(&nested(101), POINT).unwrap_err();
        assert!(error.contains("at most 100 parentheses"), "{error}");
        assert!(evaluate(&nested(20_000), POINT).is_err());
    }
    assert_eq!(evaluate(&vec!["x"; 20_000].join("+"), POINT), Ok(10_000.0));
    let error = evaluate(&" ".repeat(1 << 17), POINT).unwrap_err();
    assert!(error.contains("at most 65536 characters"), "{error}");
}

#[test]
fn numbers_are_read_in_the_precision_of_the_run() {
    let tenth = Dd::parse("0.1").unwrap();
    let point = POINT.map(Dd::of_f64);
    assert_eq!(evaluate("0.1", point), Ok(tenth));
    assert_ne!(Dd::of_f64(0.1), tenth);
    assert_eq!(evaluate("pi", point), Ok(<Dd as Scalar>::pi()));
    // This number is between two f32 numbers and must be rounded once, not via f64.
    let text = "1.000000059604644775390625000000000000001";
    assert_eq!(evaluate(text, POINT.map(|x| x as f32)), Ok(f32::parse(text).unwrap()));
    assert_ne!(f32::parse(text).unwrap(), f64::parse(text).unwrap() as f32);
}

#[test]
fn what_occurs_twice_is_computed_once() {
    let expression: Expression = "(x*y + m)^2*sin(x*y + m) + cos(y*x + m)/4".parse().unwrap();
    let mut compiler = Compiler::default();
    let value = compiler.add(&expression, &scope(), false).unwrap();
    let formula = format!("{:?}", compiler.formula(value));
    // The operations: x*y, its sum, the square, sine, product, cosine, a quarter of it, the sum.
    assert_eq!(formula.matches("Instruction").count(), 8, "{formula}");
}

/// Generates random formulas over the names of [`scope`].
fn formulas() -> impl Strategy<Value = String> {
    let number = (0u32..1000, -3i32..3).prop_map(|(digits, power)| format!("{digits}e{power}"));
    let leaf = prop_oneof![
        number,
        prop::sample::select(vec!["x", "y", "x_dot", "y_dot", "m", "pi", "2", "0.1"]).prop_map(str::to_string),
    ];
    leaf.prop_recursive(6, 60, 3, |inner| {
        let pair = (inner.clone(), inner.clone());
        prop_oneof![
            (pair.clone(), prop::sample::select(vec!["+", "-", "*", "/", " ^ "]))
                .prop_map(|((a, b), sign)| format!("({a}){sign}({b})")),
            (pair, prop::sample::select(vec!["+", "-", "*", "/"])).prop_map(|((a, b), sign)| format!("{a} {sign} {b}")),
            (inner.clone(), prop::sample::select(vec!["sin", "exp", "tanh", "sqrt", "abs", "-", "softplus"]))
                .prop_map(|(a, f)| format!("{f}({a})")),
            (inner.clone(), inner).prop_map(|(a, b)| format!("atan2({a}, {b})")),
        ]
    })
}

fn same<S: Scalar>(a: S, b: S) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

proptest! {
    #![proptest_config(crate::properties::properties(300))]
    #[test]
    fn printed_formulas_read_back_to_the_same_value(text in formulas(), x in -2.0f64..2.0) {
        let expression: Expression = text.parse().unwrap();
        let printed = expression.to_string();
        let again: Expression = printed.parse().unwrap();
        prop_assert_eq!(&again.to_string(), &printed);
        let point = [2.0, x, -0.25, 3.0, 0.75];
        prop_assert!(same(evaluate(&text, point).unwrap(), evaluate(&printed, point).unwrap()), "{} {}", text, printed);
        let wide = point.map(Dd::of_f64);
        prop_assert!(same(evaluate(&text, wide).unwrap(), evaluate(&printed, wide).unwrap()));
        // Forward-mode numbers have the same value.
        let jets: [Jet2<f64, 2>; 5] = std::array::from_fn(|i| if i < 2 { Jet2::variable(point[i], i) } else { Jet2::lift(point[i]) });
        prop_assert!(same(evaluate(&text, jets).unwrap().value, evaluate(&text, point).unwrap()));
    }

    #[test]
    fn any_text_is_read_or_refused(text in "[-+*/^(),.0-9a-z_ ]{0,40}|\\PC{0,20}") {
        if let Err(message) = evaluate(&text, POINT) {
            prop_assert!(message.starts_with("column ") && !message.contains('\n'), "{}", message);
        }
    }
}

#[test]
fn another_number_of_parameters_is_an_error_of_every_call() {
    let pendulum = ExpressionLagrangian::new(&["x"], &["l", "g"], "l^2*x_dot^2/2 + g*l*cos(x)").unwrap();
    for found in [0, 1, 3] {
        let pendulum = Mechanics::<_, f64>::new(pendulum.clone(), vec![1.0; found]);
        let refused = MechanicsError::Shape { what: "parameters", expected: 2, found };
        let outcome = pendulum.terms(&[0.5], &[1.0], Request::ALL, &mut Terms::default());
        assert_eq!(outcome, Err(refused));
        assert_eq!(pendulum.metric_jets(&[0.5], &[1.0]).err(), Some(refused));
    }
    let pendulum = Mechanics::<_, f64>::new(pendulum, vec![2.0, 9.8]);
    pendulum.terms(&[0.5], &[1.0], Request::ALL, &mut Terms::default()).unwrap();
}

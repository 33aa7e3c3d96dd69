//! The formula that is found of a random polynomial Lagrangian of one coordinate: its system file is read, and moves as the Lagrangian.

use super::bytes::Bytes;
use lnn::formula::{FormulaOptions, FoundFormula};
use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, SystemInstance};
use lnn::pipeline::parse_system;
use std::borrow::Cow;

/// Makes the Lagrangian of the bytes and looks for it.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let mass = 0.25 + bytes.small().abs();
    let coefficients: Vec<f64> = (0..3).map(|_| bytes.small()).collect();
    let friction = bytes.flag();
    let names = ["x".to_string()];
    let [a, b, c] = [coefficients[0], coefficients[1], coefficients[2]];
    let text = format!("{mass}*x_dot^2/2 + {a}*x + {b}*x^2 + {c}*x^3");
    let written = ExpressionLagrangian::new(&["x"], &[], &text).expect("a formula");
    let model = Mechanics::<_, f64>::new(written, []);
    let q: Vec<f64> = (0..40).map(|k| -1.0 + 0.05 * f64::from(k)).collect();
    let v: Vec<f64> = (0..40).map(|k| (1.7 * f64::from(k)).sin()).collect();
    let options = FormulaOptions {
        families: Some("polynomial:3".parse().expect("a family")),
        gyroscopic: false,
        friction,
        bootstraps: 1,
        ..FormulaOptions::default()
    };
    let Ok(found) = FoundFormula::of_model(&model, (&names, &[false]), (&q, &v), &options) else { return };
    let system = parse_system(&found.system_file("found")).expect("the file of a formula is one of a system");
    let again = SystemInstance::<f64>::new(Cow::Owned(system), &[]).expect("its constants are in range");
    let again = again.build().expect("and it moves");
    let (one, other) = (model.acceleration(&q, &v).expect("mass"), again.acceleration(&q, &v).expect("mass"));
    let size = one.iter().fold(1e-3, |most: f64, a| most.max(a.abs()));
    if found.residual < 1e-6 {
        one.iter().zip(&other).for_each(|(a, b)| assert!((a - b).abs() < 1e-3 * size, "{a} {b} of {text}"));
    }
}

//! Comparison up to factor, gauge, and functions of `L` of geodesics.

use super::{Coordinate, PHI, Subject, THETA, line, radius};
use lnn::symmetry::Comparison;

fn compared(a: &Subject, b: &Subject) -> Comparison {
    let (q, v) = a.states(300);
    Comparison::of(a.model.as_ref(), b.model.as_ref(), &a.basis(None), (&q, &v)).unwrap()
}

fn distances(found: &Comparison) -> [f64; 4] {
    [found.lagrangian, found.motion, found.mass_matrix, found.energy]
}

const XY: [Coordinate; 2] = [line("x"), line("y")];
const PLAIN: &str = "(x_dot^2 + (1 + x^2)*y_dot^2)/2 - x^2*y";

#[test]
fn factor_and_gauge_are_taken_out() {
    let plain = Subject::formula(&XY, PLAIN);
    // F = 3 x y + x^2, s = -2, constant 5.
    let moved = format!("-2*({PLAIN}) + 3*(x_dot*y + x*y_dot) + 2*x*x_dot + 5");
    let found = compared(&Subject::formula(&XY, &moved), &plain);
    assert!(distances(&found).iter().all(|x| *x < 1e-12), "{found:?}");
    assert!((found.factors[0] + 2.0).abs() < 1e-12 && found.factors.len() == 1, "{found:?}");
    assert!((found.constant - 5.0).abs() < 1e-11, "{found:?}");
    let mut terms: Vec<&str> = found.gauge_formula.split(" + ").collect();
    terms.sort_unstable();
    assert_eq!(terms, ["3*x*y", "x^2"]);
}

#[test]
fn what_is_left_is_stated_by_quantity() {
    let plain = Subject::formula(&XY, PLAIN);
    // Another potential moves otherwise and has the same mass matrix.
    let found = compared(&Subject::formula(&XY, &format!("{PLAIN} + 0.1*y^3")), &plain);
    assert!(found.mass_matrix < 0.1 && found.motion > 1e-2 && found.energy > 1e-2, "{found:?}");
    // Free motion has many Lagrangians: the same straight lines, another mass matrix.
    let [round, long, skew] =
        ["(x_dot^2 + y_dot^2)/2", "(x_dot^2 + 4*y_dot^2)/2", "(x_dot^2 + 4*y_dot^2 + 2*x_dot*y_dot)/2"]
            .map(|formula| Subject::formula(&XY, formula));
    let found = compared(&skew, &round);
    assert!(found.motion == 0.0 && found.mass_matrix > 0.1 && found.lagrangian > 0.1, "{found:?}");
    // Those of coordinates that do not act on each other differ by a factor each.
    let found = compared(&long, &round);
    assert!(distances(&found).iter().all(|x| *x < 1e-12), "{found:?}");
    assert!(found.group_factors.len() == 2 && (found.group_factors[1] - 4.0).abs() < 1e-12, "{found:?}");
}

#[test]
fn geodesics_have_functions_of_their_lagrangian() {
    let metric = "(theta_dot^2 + sin(theta)^2*phi_dot^2)/2";
    let sphere = Subject::formula(&[THETA, PHI], metric);
    let system = Subject::system("sphere-geodesic", &[THETA, PHI]);
    assert!(distances(&compared(&system, &sphere)).iter().all(|x| *x < 1e-12));
    // L^2 + 3 L moves along the same curves, at the same pace.
    let curved = Subject::formula(&[THETA, PHI], &format!("({metric})^2 + 3*{metric}"));
    let found = compared(&curved, &sphere);
    assert!(distances(&found).iter().all(|x| *x < 1e-10), "{found:?}");
    assert!((found.factors[0] - 3.0).abs() < 1e-9 && (found.factors[1] - 1.0).abs() < 1e-9, "{found:?}");
}

#[test]
fn a_mass_shell_knows_the_slope_of_the_function() {
    let metric = "(-t_dot^2 + x_dot^2)/(2*x^2)";
    let coordinates = [line("t"), radius("x")];
    let plain = Subject::formula(&coordinates, metric);
    let (q, mut v) = plain.states(200);
    for (q, v) in q.chunks(2).zip(v.chunks_mut(2)) {
        v[0] = (v[1] * v[1] + q[1] * q[1]).sqrt();
    }
    let compared = |formula: &str| {
        let other = Subject::formula(&coordinates, formula);
        Comparison::of(other.model.as_ref(), plain.model.as_ref(), &plain.basis(None), (&q, &v)).unwrap()
    };
    // On the shell L = -1/2: f = L^2 + 4 L + 7 is -1.75 + 7 there and has the slope 3; what vanishes twice is not seen.
    for more in ["", "+ (1 + x^2 + x_dot^2)*(L + 1/2)^2"] {
        let more = more.replace('L', metric);
        let found = compared(&format!("({metric})^2 + 4*{metric} + 7 {more}"));
        assert!(found.on_shell && distances(&found).iter().all(|x| *x < 1e-10), "{found:?}");
        assert!(found.factors.len() == 1 && (found.factors[0] - 3.0).abs() < 1e-9, "{found:?}");
        assert!((found.constant - (7.0 - 1.75 + 1.5)).abs() < 1e-9, "{found:?}");
    }
    // Another metric is a factor.
    let found = compared(&format!("3*{metric}"));
    assert!(!found.on_shell && found.factors.len() == 1 && (found.factors[0] - 3.0).abs() < 1e-12, "{found:?}");
}

#[test]
fn other_coordinates_are_refused() {
    let (a, b) = (Subject::formula(&XY, PLAIN), Subject::formula(&XY[..1], "x_dot^2/2"));
    let (q, v) = a.states(10);
    assert!(Comparison::of(a.model.as_ref(), b.model.as_ref(), &a.basis(None), (&q, &v)).is_err());
}

//! Canonical forms: motion as it was, factor and gauge fixed at a base state.

use super::{Coordinate, PHI, Subject, THETA, line, radius};
use crate::common::accuracy::{configure, random_state};
use crate::common::properties;
use lnn::geometry::Geometry;
use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Mechanics, MechanicsError, Request, Terms};
use lnn::scalar::{Dd, Scalar};
use lnn::symmetry::{Canonical, CanonicalForm, SymmetryError};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const XY: [Coordinate; 2] = [line("x"), line("y")];

fn terms<S: Scalar>(model: &dyn EulerLagrange<S>, q: &[S], v: &[S]) -> Terms<S> {
    let mut terms = Terms::default();
    model.terms(q, v, Request::ALL, &mut terms).unwrap();
    terms
}

fn largest<S: Scalar>(values: &[S]) -> f64 {
    values.iter().fold(0.0, |most, x| most.max(x.to_f64().abs()))
}

/// Determinant of a matrix `(n, n)` of at most four rows, by minors.
fn determinant<S: Scalar>(n: usize, m: &[S]) -> S {
    let one = S::of_f64(1.0);
    if n == 0 {
        return one;
    }
    (0..n).fold(S::of_f64(0.0), |sum, j| {
        let minor: Vec<S> = (1..n).flat_map(|i| (0..n).filter(move |k| *k != j).map(move |k| m[i * n + k])).collect();
        let sign = if j % 2 == 0 { one } else { -one };
        sum + sign * m[j] * determinant(n - 1, &minor)
    })
}

/// A system of the catalogue at a random base state, in numbers `S`, with friction if it has any.
fn is_canonical<S: Scalar>(name: &str, seed: u64) {
    let system = configure::<S>(name, &[]);
    let (n, mut rng) = (system.coordinates, ChaCha8Rng::seed_from_u64(seed));
    let bounds = system.system.validation(n);
    let (q0, v0) = random_state(&system, &bounds, &mut rng);
    let model = system.build().unwrap();
    let form = CanonicalForm::at(model.as_ref(), &q0, &v0).unwrap();
    let canonical = Canonical::new(model, form.clone());
    let eps = S::epsilon().to_f64();

    let (before, base) = (terms(canonical.model().as_ref(), &q0, &v0), terms(&canonical, &q0, &v0));
    assert_eq!((largest(&base.lagrangian), largest(&base.momentum)), (0.0, 0.0), "{name}");
    assert!(largest(&base.energy) <= 16.0 * eps * (largest(&before.energy) + largest(&before.lagrangian)), "{name}");
    let size = determinant(n, &base.mass_matrix).to_f64().abs();
    let products: f64 = (0..n).map(|i| largest(&base.mass_matrix[i * n..(i + 1) * n])).product();
    assert!((size - 1.0).abs() <= 300.0 * eps * products.max(1.0), "{name}: {size}");

    // Normal again, there is nothing left to do.
    let again = CanonicalForm::at(&canonical, &q0, &v0).unwrap();
    assert!((again.factor.to_f64() - 1.0).abs() <= 300.0 * eps * products.max(1.0), "{name}: {}", again.factor);
    assert_eq!((again.lagrangian.to_f64(), largest(&again.momentum)), (0.0, 0.0), "{name}");

    // Elsewhere: motion to the bit, and the formula.
    let (q, v) = random_state(&system, &bounds, &mut rng);
    let (old, new) = (terms(canonical.model().as_ref(), &q, &v), terms(&canonical, &q, &v));
    assert!(old.acceleration == new.acceleration, "{name}");
    let s = form.factor;
    for (old, new) in [(&old.mass_matrix, &new.mass_matrix), (&old.dl_dq, &new.dl_dq), (&old.coriolis, &new.coriolis)] {
        assert!(old.iter().zip(new).all(|(&a, &b)| a * s == b), "{name}");
    }
    let action: S = new.momentum.iter().zip(&v).fold(-new.lagrangian[0], |sum, (&p, &v)| sum + p * v);
    let scale = (largest(&old.momentum) + largest(&form.momentum)) * (largest(&v) + largest(&v0)) * n as f64
        + largest(&old.lagrangian)
        + form.lagrangian.to_f64().abs();
    let apart = (new.energy[0] - action).to_f64().abs();
    assert!(apart <= 64.0 * eps * s.to_f64().abs() * scale, "{name}: {apart}");
}

#[test]
fn systems_have_canonical_forms_in_every_precision() {
    let names = ["double-pendulum", "kepler", "charged-particle", "sphere-geodesic", "ads2-geodesic", "ads4-geodesic"];
    for (seed, name) in (0..).zip(names) {
        is_canonical::<f32>(name, seed);
        is_canonical::<f64>(name, seed);
        is_canonical::<Dd>(name, seed);
    }
}

#[test]
fn the_sign_keeps_the_majority() {
    let sign = |coordinates: &[Coordinate], formula: &str, q: &[f64]| {
        let subject = Subject::formula(coordinates, formula);
        let form = CanonicalForm::at(subject.model.as_ref(), q, &vec![0.5; q.len()]).unwrap();
        let mirrored = Subject::formula(coordinates, &format!("-3*({formula})"));
        let other = CanonicalForm::at(mirrored.model.as_ref(), q, &vec![0.5; q.len()]).unwrap();
        // The mirror image has the same form.
        assert!((other.factor / form.factor + 1.0 / 3.0).abs() < 1e-14, "{formula}");
        form.factor.signum()
    };
    let three = [line("t"), line("x"), line("y")];
    assert_eq!(sign(&XY, "x_dot^2 + y_dot^2 - x", &[0.3, 0.2]), 1.0);
    assert_eq!(sign(&three, "-t_dot^2 + x_dot^2 + y_dot^2", &[0.3, 0.2, 0.1]), 1.0);
    assert_eq!(sign(&three, "t_dot^2 - x_dot^2 - y_dot^2", &[0.3, 0.2, 0.1]), -1.0);
    // As many of both signs: the last coordinate, or the first product of null coordinates.
    assert_eq!(sign(&XY, "-x_dot^2 + y_dot^2", &[0.3, 0.2]), 1.0);
    assert_eq!(sign(&XY, "x_dot^2 - y_dot^2", &[0.3, 0.2]), -1.0);
    assert_eq!(sign(&XY, "x_dot^2 + x_dot*y_dot", &[0.3, 0.2]), 1.0);
    assert_eq!(sign(&XY, "x_dot*y_dot", &[0.3, 0.2]), 1.0);
    assert_eq!(sign(&XY, "-x_dot*y_dot", &[0.3, 0.2]), -1.0);
}

#[test]
fn a_lagrangian_in_canonical_form_is_a_lagrangian() {
    let formula = "(theta_dot^2 + sin(theta)^2*phi_dot^2) + 0.3*cos(theta)*phi_dot - theta";
    let expression = || ExpressionLagrangian::new(&["theta", "phi"], &[], formula).unwrap();
    let plain = Mechanics::<_, f64>::new(expression(), vec![]);
    let (q0, v0) = ([1.0, 0.2], [0.4, -0.3]);
    let form = CanonicalForm::at(&plain, &q0, &v0).unwrap();
    let outside = Canonical::new(plain, form.clone());
    let inside = Mechanics::new(Canonical::new(expression(), form), vec![]);
    let (q, v) = Subject::formula(&[THETA, PHI], formula).states(40);
    let (a, b) = (terms(&outside, &q, &v), terms(&inside, &q, &v));
    for (x, y) in [
        (&a.lagrangian, &b.lagrangian),
        (&a.momentum, &b.momentum),
        (&a.dl_dq, &b.dl_dq),
        (&a.mass_matrix, &b.mass_matrix),
        (&a.coriolis, &b.coriolis),
        (&a.acceleration, &b.acceleration),
        (&a.energy, &b.energy),
    ] {
        assert!(x.len() == y.len() && x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-12), "{x:?} {y:?}");
    }
}

#[test]
fn the_metric_takes_the_factor() {
    let sphere = configure::<f64>("sphere-geodesic", &[("R", "3")]).build().unwrap();
    let canonical = Canonical::at(sphere, &[1.0, 0.0], &[0.0, 0.0]).unwrap();
    // s g of s R^2 sin(1) = 1 has the curvature 2/(s R^2).
    let found = Geometry::of(&canonical, &[0.7, 0.1], &[0.0; 2]).unwrap().remove(0).unwrap();
    assert!((found.curvature.scalar - 2.0 * 1.0f64.sin()).abs() < 1e-13, "{}", found.curvature.scalar);
}

#[test]
fn states_without_a_form_are_refused() {
    let flat = Subject::formula(&XY, "x_dot^2 + 2*x_dot*y_dot + y_dot^2");
    let at = |model: &dyn EulerLagrange<f64>, q: &[f64]| CanonicalForm::at(model, q, &[0.0, 0.0]).unwrap_err();
    let singular = at(flat.model.as_ref(), &[0.0, 0.0]);
    assert!(matches!(singular, SymmetryError::Base(MechanicsError::Singular { .. })), "{singular}");
    let short = at(flat.model.as_ref(), &[0.0]);
    assert!(matches!(short, SymmetryError::Base(MechanicsError::Shape { expected: 2, found: 1, .. })), "{short}");
    let hole = Subject::formula(&[radius("r"), PHI], "r_dot^2/r + phi_dot^2");
    let infinite = at(hole.model.as_ref(), &[0.0, 0.0]);
    assert!(matches!(infinite, SymmetryError::Base(MechanicsError::NotFinite { .. })), "{infinite}");
}

proptest! {
    #![proptest_config(properties(48))]

    #[test]
    fn gauge_and_factor_do_not_matter(
        (a, b, c) in (0.5..2.0f64, -0.4..0.4f64, 0.5..2.0f64),
        (d, e, k) in (0.0..1.0f64, -1.0..1.0f64, -2.0..2.0f64),
        (s, negative) in (0.1..9.0f64, any::<bool>()),
        (f, g, h) in (-2.0..2.0f64, -2.0..2.0f64, -2.0..2.0f64),
        state in prop::array::uniform8(-1.0..1.0f64),
    ) {
        let plain = format!(
            "{a}*x_dot^2/2 + {b}*x_dot*y_dot + {c}*(1 + {d}*x^2)*y_dot^2/2 + {e}*x*y_dot - {k}*x^2*y + 0.05*{d}*x_dot^4"
        );
        let s = if negative { -s } else { s };
        // F = f x y + g x^2/2 + h sin(y).
        let moved = format!("{s}*({plain}) + {f}*(x_dot*y + x*y_dot) + {g}*x*x_dot + {h}*cos(y)*y_dot + 4");
        let (q0, v0, q, v) = (&state[0..2], &state[2..4], &state[4..6], &state[6..8]);
        let form = |formula: &str| Canonical::at(Subject::formula(&XY, formula).model, q0, v0).unwrap();
        let (one, other) = (form(&plain), form(&moved));
        let close = |x: &[f64], y: &[f64]| x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-11);

        let base = [&one, &other].map(|model| terms(model, q0, v0));
        prop_assert!(base.iter().all(|at| largest(&at.lagrangian) == 0.0 && largest(&at.momentum) == 0.0));
        prop_assert!(base.iter().all(|at| largest(&at.energy) < 1e-12));
        prop_assert!(close(&base[0].mass_matrix, &base[1].mass_matrix));
        let there = [&one, &other].map(|model| terms(model, q, v));
        prop_assert!(close(&there[0].mass_matrix, &there[1].mass_matrix));
        prop_assert!(close(&there[0].energy, &there[1].energy));
        prop_assert!(close(&there[0].acceleration, &there[1].acceleration));

        // What is left is dF/dt: its momentum depends on the place alone, its value is that along the velocity, and both vanish at q0.
        let apart = |q: &[f64], v: &[f64]| {
            let [x, y] = [&one, &other].map(|model| terms(model, q, v));
            let p: Vec<f64> = x.momentum.iter().zip(&y.momentum).map(|(x, y)| x - y).collect();
            (p, x.lagrangian[0] - y.lagrangian[0])
        };
        let ((p, value), (again, _), (rest, still)) = (apart(q, v), apart(q, v0), apart(q0, v));
        prop_assert!(close(&p, &again) && close(&rest, &[0.0, 0.0]) && still.abs() < 1e-11);
        // Values agree up to the constant that the base state fixes.
        prop_assert!((value - (p[0] * v[0] + p[1] * v[1])).abs() < 1e-11);
    }
}

//! Random Lagrangians, with a symmetry that is known and without one.

use super::{Subject, line};
use crate::common::properties;
use proptest::prelude::*;

proptest! {
    #![proptest_config(properties(24))]

    #[test]
    fn round_potentials_have_the_rotation(
        (a, b, c) in (0.1..2.0f64, -1.0..1.0f64, -0.5..0.5f64),
        mass in 0.5..3.0f64,
        field in -1.0..1.0f64,
    ) {
        let formula = format!(
            "{mass}*(x_dot^2 + y_dot^2)/2 + {field}*(x*y_dot - y*x_dot) - {a}*(x^2 + y^2) - {b}*(x^2 + y^2)^2 + {c}*cos(x^2 + y^2)"
        );
        let found = Subject::formula(&[line("x"), line("y")], &formula).symmetries(None);
        prop_assert_eq!(found.separation.count, Some(1));
        prop_assert_eq!(found.fields[0].text(&found.basis), "-y d_x + x d_y");
    }

    #[test]
    fn rough_potentials_have_nothing(
        waves in prop::collection::vec((0.3..1.5f64, 0.3..1.5f64, 0.0..6.0f64), 3),
        size in 0.05..1.0f64,
    ) {
        let potential: String =
            waves.iter().map(|(u, w, phase)| format!(" + {size}*cos({u}*x + {w}*y*x + {phase})")).collect();
        let formula = format!("(x_dot^2 + y_dot^2)/2 - x^2 - 2*y^2 {potential}");
        let found = Subject::formula(&[line("x"), line("y")], &formula).symmetries(None);
        prop_assert_eq!(found.separation.count, Some(0));
    }
}

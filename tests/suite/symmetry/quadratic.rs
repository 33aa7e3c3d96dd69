//! Conserved quantities of second degree in the momenta.

use super::{Coordinate, PHI, Subject, THETA, degrees, line, radius};
use lnn::lagrangian::{Request, Terms};
use lnn::rollout::{Integrator, RolloutOptions, rollout};
use lnn::symmetry::{Chart, Degrees, Quadratic, Symmetries};

fn found(subject: &Subject, basis: Option<Degrees>) -> Quadratic {
    let known = subject.symmetries(basis);
    let (q, v) = subject.states(700);
    Quadratic::find(subject.model.as_ref(), &known.basis, &known.fields, (&q, &v), Some(Symmetries::EXACT)).unwrap()
}

/// The quantities stay the same along a motion.
fn keeps(subject: &Subject, quadratic: &Quadratic, q: &[f64], v: &[f64]) {
    let options = RolloutOptions::new(3.0, 0.5).method(Integrator::Dop853).tolerances(1e-12, 1e-14);
    let motion = rollout(subject.model.as_ref(), q, v, &options).complete().unwrap();
    let mut terms = Terms::default();
    subject.model.terms(&motion.q, &motion.v, Request::ENERGY, &mut terms).unwrap();
    let n = q.len();
    for quantity in &quadratic.conserved {
        let at = |k: usize| quantity.value(motion.state(k).0, &terms.momentum[k * n..(k + 1) * n], terms.energy[k]);
        let values: Vec<f64> = (0..motion.len()).map(at).collect();
        let size = values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(size > 1e-3 && values.iter().all(|x| (x - values[0]).abs() < 1e-7 * size.max(1.0)), "{values:?}");
    }
}

#[test]
fn the_kepler_problem_has_the_vector_of_runge_and_lenz() {
    let plane = Subject::system("kepler", &[line("x"), line("y")]);
    let vector = found(&plane, None);
    assert_eq!(vector.conserved.len(), 2, "{:?}", vector.separation);
    keeps(&plane, &vector, &[1.0, 0.2], &[-0.1, 0.9]);
    let xyz: Vec<Coordinate> = ["x", "y", "z"].map(line).to_vec();
    let space = Subject::formula(&xyz, "(x_dot^2 + y_dot^2 + z_dot^2)/2 + 1/sqrt(x^2 + y^2 + z^2)");
    assert_eq!(space.symmetries(None).algebra.unwrap().name.as_deref(), Some("so(3)"));
    let vector = found(&space, None);
    assert_eq!(vector.conserved.len(), 3, "{:?}", vector.separation);
    keeps(&space, &vector, &[1.0, 0.2, 0.1], &[-0.1, 0.9, 0.3]);
    // In polar coordinates by the harmonics of the azimuth.
    let polar = Subject::formula(&[radius("r"), PHI], "(r_dot^2 + r^2*phi_dot^2)/2 + 1/r");
    let vector = found(&polar, None);
    assert_eq!(vector.conserved.len(), 2, "{:?}", vector.separation);
    keeps(&polar, &vector, &[1.0, 0.2], &[-0.1, 0.9]);
}

#[test]
fn an_oscillator_has_a_tensor() {
    let oscillator = Subject::formula(&[line("x"), line("y")], "(x_dot^2 + y_dot^2 - x^2 - y^2)/2");
    let tensor = found(&oscillator, None);
    let texts: Vec<String> = tensor.conserved.iter().map(|quantity| quantity.text()).collect();
    assert_eq!(texts, ["p_x*p_y + x*y", "p_y^2 + y^2"]);
}

#[test]
fn a_spinning_black_hole_has_the_constant_of_carter() {
    // Kerr's metric with M = 1, a = 1/2.
    let (sigma, delta) = ("(r^2 + 0.25*cos(theta)^2)", "(r^2 - 2*r + 0.25)");
    let drag = format!("(r*sin(theta)^2/{sigma})");
    let formula = format!(
        "(-(1 - 2*r/{sigma})*t_dot^2 - 2*{drag}*t_dot*phi_dot + {sigma}/{delta}*r_dot^2 + {sigma}*theta_dot^2
         + (r^2 + 0.25 + {drag}/2)*sin(theta)^2*phi_dot^2)/2"
    );
    let coordinates = [line("t"), ("r", Chart::HalfLine, [4.0, 12.0]), THETA, PHI];
    let mut kerr = Subject::formula(&coordinates, &formula.replace('\n', " "));
    kerr.region.velocity = vec![[0.8, 1.2], [-0.3, 0.3], [-0.1, 0.1], [-0.1, 0.1]];
    let known = kerr.symmetries(degrees(1, 1));
    assert_eq!(known.algebra.unwrap().name.as_deref(), Some("R^2"));
    let carter = found(&kerr, degrees(1, 2));
    let [constant] = carter.conserved.as_slice() else { panic!("{:?}", carter.separation) };
    let text = constant.text();
    for term in ["p_theta^2", "cot(theta)^2*p_phi^2", "cos(2*theta)*p_t^2", "cos(2*theta)*E"] {
        assert!(text.contains(term), "{text}");
    }
    assert!(text.len() < 120, "{text}");
    keeps(&kerr, &carter, &[0.0, 8.0, 1.2, 0.0], &[1.2, -0.1, 0.03, 0.04]);
}

#[test]
fn products_of_charges_are_not_new() {
    let sphere = Subject::system("sphere-geodesic", &[THETA, PHI]);
    assert_eq!(found(&sphere, None).conserved.len(), 0);
    let henon = Subject::formula(&[line("x"), line("y")], "(x_dot^2 + y_dot^2 - x^2 - y^2)/2 - x^2*y + y^3/3");
    let found = found(&henon, None);
    assert_eq!((found.separation.count, found.conserved.len()), (Some(1), 0));
}

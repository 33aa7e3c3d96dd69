//! Numbers, fields and algebras of symmetries.

use super::{Coordinate, PHI, Subject, THETA, degrees, line, radius};
use lnn::symmetry::{Chart, Degrees};

/// Number, algebra and signature of the Killing form, with a gap that leaves no doubt; the fields as formulas.
fn found(subject: &Subject, basis: Option<Degrees>, count: usize, name: &str, killing: [usize; 3]) -> Vec<String> {
    let found = subject.symmetries(basis);
    assert_eq!(found.separation.count, Some(count), "{:?}", &found.singular_values);
    assert!(found.separation.gap.is_none_or(|gap| gap > 1e8), "{:?}", found.separation);
    let algebra = found.algebra.unwrap();
    assert_eq!((algebra.name.as_deref(), algebra.killing_form_signature), (Some(name), killing));
    assert!(algebra.closure < 1e-6, "{}", algebra.closure);
    found.fields.iter().map(|field| field.text(&found.basis)).collect()
}

#[test]
fn flat_spaces_have_translations_and_rotations() {
    let flat = |n: usize, time: bool| {
        let all: Vec<Coordinate> =
            ["t", "x", "y", "z"][usize::from(!time)..][..n].iter().map(|name| line(name)).collect();
        let sign = |name: &str| if name == "t" { "-" } else { "+" };
        let squares: String = all.iter().map(|c| format!("{} {}_dot^2/2 ", sign(c.0), c.0)).collect();
        Subject::formula(&all, &format!("0 {squares}"))
    };
    let fields = found(&flat(2, false), None, 3, "e(2)", [1, 0, 2]);
    assert_eq!(fields, ["d_x", "-y d_x + x d_y", "d_y"]);
    found(&flat(3, false), None, 6, "e(3)", [3, 0, 3]);
    found(&flat(2, true), None, 3, "iso(1,1)", [0, 1, 2]);
    found(&flat(4, true), None, 10, "iso(3,1)", [3, 3, 4]);
}

#[test]
fn curvilinear_coordinates_make_no_difference() {
    let plane = Subject::formula(&[radius("r"), PHI], "(r_dot^2 + r^2*phi_dot^2)/2");
    let fields = found(&plane, None, 3, "e(2)", [1, 0, 2]);
    assert!(fields.contains(&"sin(phi) d_r + cos(phi)/r d_phi".to_string()), "{fields:?}");
    let space = "(r_dot^2 + r^2*theta_dot^2 + r^2*sin(theta)^2*phi_dot^2)/2";
    found(&Subject::formula(&[radius("r"), THETA, PHI], space), degrees(1, 2), 6, "e(3)", [3, 0, 3]);
}

#[test]
fn spheres_have_rotations() {
    let fields = found(&Subject::system("sphere-geodesic", &[THETA, PHI]), None, 3, "so(3)", [3, 0, 0]);
    assert_eq!(
        fields,
        ["sin(phi) d_theta + cot(theta)*cos(phi) d_phi", "-cos(phi) d_theta + cot(theta)*sin(phi) d_phi", "d_phi"]
    );
    let chi = ("chi", Chart::Polar, [0.3, 2.8]);
    let sphere = "(chi_dot^2 + sin(chi)^2*(theta_dot^2 + sin(theta)^2*phi_dot^2))/2";
    found(&Subject::formula(&[chi, THETA, PHI], sphere), None, 6, "so(4)", [6, 0, 0]);
}

#[test]
fn spaces_of_negative_curvature_have_boosts() {
    let plane = Subject::formula(&[line("x"), radius("y")], "(x_dot^2 + y_dot^2)/(2*y^2)");
    found(&plane, None, 3, "so(2,1)", [1, 2, 0]);
    let polar = Subject::formula(&[radius("rho"), PHI], "(rho_dot^2 + sinh(rho)^2*phi_dot^2)/2");
    found(&polar, Some("trigonometric:1,hyperbolic:1".parse().unwrap()), 3, "so(2,1)", [1, 2, 0]);
    let coordinates = [line("t"), line("x"), line("y"), radius("z")];
    let fields = found(&Subject::system("ads4-geodesic", &coordinates), None, 10, "so(3,2)", [4, 6, 0]);
    assert!(fields.contains(&"t d_t + x d_x + y d_y + z d_z".to_string()), "{fields:?}");
    let few = [line("t"), line("x"), radius("z")];
    found(&Subject::system("ads3-geodesic", &few), None, 6, "so(2,2)", [2, 4, 0]);
}

#[test]
fn black_holes_keep_time_and_turns() {
    let coordinates = [line("t"), ("r", Chart::HalfLine, [4.0, 12.0]), THETA, PHI];
    let hole = Subject::system("schwarzschild-geodesic", &coordinates);
    let fields = found(&hole, degrees(1, 2), 4, "so(3)+R", [3, 0, 1]);
    assert!(fields.contains(&"d_t".to_string()) && fields.contains(&"d_phi".to_string()), "{fields:?}");
}

#[test]
fn gauge_functions_belong_to_their_fields() {
    // A charge in a uniform magnetic field, in two gauges: translations and turns are there in both.
    for (formula, gauges) in [
        ("(x_dot^2 + y_dot^2)/2 + x*y_dot - y*x_dot", ["y", "0", "-x"]),
        ("(x_dot^2 + y_dot^2)/2 + 2*x*y_dot", ["2*y", "-y^2 + x^2", "0"]),
    ] {
        let subject = Subject::formula(&[line("x"), line("y")], formula);
        assert_eq!(found(&subject, None, 3, "e(2)", [1, 0, 2]), ["d_x", "-y d_x + x d_y", "d_y"]);
        let found = subject.symmetries(None);
        let texts: Vec<String> = found.fields.iter().map(|field| field.gauge_text(&found.basis)).collect();
        assert_eq!(texts, gauges);
    }
    // A uniform pull: moving along it changes L by a constant, which is no derivative of a function of the place.
    let falling = Subject::formula(&[line("x"), line("y")], "(x_dot^2 + y_dot^2)/2 - 9.8*y");
    assert_eq!(found(&falling, None, 1, "R", [0, 0, 1]), ["d_x"]);
}

#[test]
fn functions_that_nearly_depend_on_each_other_add_no_noise() {
    // A hole with charge and cosmological constant, far from the poles: no function of r and theta of the metric is in the basis.
    let f = "(1 - 2/r + 0.25/r^2 - 0.001*r^2/3)";
    let sphere = "r^2*(theta_dot^2 + sin(theta)^2*phi_dot^2)/2";
    let between = [std::f64::consts::FRAC_PI_4, 3.0 * std::f64::consts::FRAC_PI_4];
    let far = ("r", Chart::HalfLine, [4.0, 10.0]);
    let coordinates = [line("t"), far, ("theta", Chart::Polar, between), PHI];
    let hole = Subject::formula(&coordinates, &format!("-{f}*t_dot^2/2 + r_dot^2/(2*{f}) + {sphere}"));
    let fields = found(&hole, None, 4, "so(3)+R", [3, 0, 1]);
    let turns = ["sin(phi) d_theta + cot(theta)*cos(phi) d_phi", "-cos(phi) d_theta + cot(theta)*sin(phi) d_phi"];
    assert_eq!(fields, ["d_t", turns[0], turns[1], "d_phi"]);
    // Gauge functions as well: a charge in a uniform field, in polar coordinates.
    let plane = Subject::formula(&[far, PHI], "(r_dot^2 + r^2*phi_dot^2)/2 + r^2*phi_dot");
    let fields = found(&plane, None, 3, "e(2)", [1, 0, 2]);
    assert_eq!(fields, ["sin(phi) d_r + cos(phi)/r d_phi", "-cos(phi) d_r + sin(phi)/r d_phi", "d_phi"]);
    let found = plane.symmetries(None);
    let gauges: Vec<String> = found.fields.iter().map(|field| field.gauge_text(&found.basis)).collect();
    assert_eq!(gauges, ["-r*cos(phi)", "-r*sin(phi)", "0"]);
}

#[test]
fn fields_of_a_degenerate_lagrangian_have_no_algebra() {
    let xyz = ["x", "y", "z"].map(line);
    for (formula, basis, closes) in [
        // A function times d_x - d_y is a symmetry, whatever the function; products of two are not in the basis.
        ("(x_dot + y_dot)^2/2 + z_dot^2/2", None, false),
        ("z_dot^2/2 - z^2", None, false),
        ("(x_dot + y_dot)^2/2 + z_dot^2/2", degrees(0, 0), true),
        ("z_dot^2/2 - z^2", degrees(0, 0), true),
    ] {
        let found = Subject::formula(&xyz, formula).symmetries(basis);
        assert_eq!(found.singular_states, found.states, "{formula}");
        let algebra = found.algebra.unwrap();
        assert_eq!((algebra.name.as_deref(), algebra.closes), (None, closes), "{formula}: {}", algebra.closure);
        assert_eq!(algebra.closure > 0.1, !closes, "{formula}: {}", algebra.closure);
    }
    let plane = Subject::formula(&xyz[..2], "(x_dot^2 + y_dot^2)/2").symmetries(None);
    assert_eq!((plane.singular_states, plane.algebra.unwrap().closes), (0, true));
}

#[test]
fn units_do_not_decide_whether_fields_are_an_algebra() {
    for size in [1e-9, 1e9] {
        let range = [-2.0 * size, 2.0 * size];
        let coordinates = ["x", "y"].map(|name| (name, Chart::Line, range));
        let mut plane = Subject::formula(&coordinates, "(x_dot^2 + y_dot^2)/2");
        plane.region.velocity = vec![range; 2];
        assert_eq!(found(&plane, None, 3, "e(2)", [1, 0, 2]), ["d_x", "-y d_x + x d_y", "d_y"]);
    }
}

#[test]
fn systems_without_symmetries_have_none() {
    let angles = ["theta1", "theta2", "theta3"].map(|name| (name, Chart::Circle, [0.0, 6.3]));
    let xy = [line("x"), line("y")];
    let henon = "(x_dot^2 + y_dot^2 - x^2 - y^2)/2 - x^2*y + y^3/3";
    let bent =
        "(1 + 0.01*cos(phi)*sin(theta))*theta_dot^2/2 + sin(theta)^2*(1 + 0.02*sin(2*phi)*cos(theta))*phi_dot^2/2";
    let rough = "(1 + 0.1*x*y^2)*x_dot^2/2 + (1 + 0.05*x^3)*y_dot^2/2 + 0.03*y^2*x*x_dot*y_dot";
    for (name, subject) in [
        ("double pendulum", Subject::system("double-pendulum", &angles[..2])),
        ("triple pendulum", Subject::system("triple-pendulum", &angles)),
        ("Henon-Heiles", Subject::formula(&xy, henon)),
        ("bent sphere", Subject::formula(&[THETA, PHI], bent)),
        ("rough plane", Subject::formula(&xy, rough)),
    ] {
        let found = subject.symmetries(None);
        assert_eq!(found.separation.count, Some(0), "{name}: {:?}", found.singular_values);
        assert!(found.singular_values[0] > 1e-3 && found.algebra.is_none(), "{name}: {:?}", found.singular_values);
    }
}

#[test]
fn wrong_questions_are_refused() {
    use lnn::symmetry::{Symmetries, SymmetryError};
    let plane = Subject::formula(&[line("x"), line("y")], "(x_dot^2 + y_dot^2)/2");
    let (q, v) = plane.states(10);
    let ask = |basis, q: &[f64], v: &[f64]| {
        Symmetries::find(plane.model.as_ref(), basis, (q, v), Some(Symmetries::EXACT)).unwrap_err()
    };
    let basis = plane.basis(None);
    assert_eq!(ask(&basis, &q, &v), SymmetryError::TooFew { unknowns: 18, states: 10 });
    assert_eq!(ask(&basis, &q, &v[1..]), SymmetryError::Shape { coordinates: 2, q: 20, v: 19 });
    let many = plane.basis("polynomial:12".parse().ok());
    assert!(Symmetries::find(plane.model.as_ref(), &many, (&q, &v), None).is_err());
    let all = Subject::formula(&["a", "b", "c", "d", "e"].map(line), "a_dot*b_dot + c_dot*d_dot + e_dot^2");
    let (q5, v5) = all.states(5);
    let many = all.basis("polynomial:7".parse().ok());
    let refused = Symmetries::find(all.model.as_ref(), &many, (&q5, &v5), None).unwrap_err();
    assert_eq!(refused, SymmetryError::TooMany { unknowns: 4752, most: 4000 });
    let [least, most] = [f64::EPSILON, 0.1];
    for found in [1e308, 0.11, 1e-300, 0.0, -1.0] {
        let refused = Symmetries::find(plane.model.as_ref(), &basis, (&q, &v), Some(found)).unwrap_err();
        assert_eq!(refused, SymmetryError::Tolerance { found, least, most });
    }
    assert!(matches!(
        Symmetries::find(plane.model.as_ref(), &basis, (&q, &v), Some(f64::NAN)),
        Err(SymmetryError::Tolerance { .. })
    ));
    // 32 million numbers are 1.8 million states of 18 unknown coefficients.
    let many = vec![0.5; 2 * 1_777_778];
    assert_eq!(
        ask(&basis, &many, &many),
        SymmetryError::TooManyStates { states: 1_777_778, unknowns: 18, most: 1_777_777 }
    );
    // A square that overflows.
    let far = vec![1e200; 100];
    assert!(matches!(ask(&basis, &far, &vec![0.1; 100]), SymmetryError::NotFinite { .. }));
    let other = Subject::formula(&[line("x")], "x_dot^2/2").basis(None);
    assert_eq!(ask(&other, &q, &v), SymmetryError::Basis { expected: 2, found: 1 });
    assert_eq!(ask(&basis, &[f64::NAN; 20], &v), SymmetryError::States { states: 10, found: 0 });
}

use super::*;
use crate::lagrangian::configure;

fn given(list: &[(&str, &str)]) -> Vec<(String, String)> {
    list.iter().map(|&(s, t)| (s.into(), t.into())).collect()
}

#[test]
fn every_entry_is_complete() {
    for system in systems() {
        let n = system.size.default();
        let configured = configure::<f64>(&system.name, &[]).unwrap();
        assert_eq!(configured.build().unwrap().coordinates(), n);
        assert_eq!(system.coordinates(n).len(), n);
        assert_eq!((system.columns(n).len(), system.units(n).len()), (2 * n, 2 * n));
        let start = system.trajectory(n).start;
        assert_eq!((start.positions.len(), start.velocities.len()), (n, n));
        assert!(start.positions.iter().chain(&start.velocities).all(|b| b.0 <= b.1));
        let fixed = configured.constrained_coordinate();
        for bounds in [system.training(n), system.validation(n)] {
            assert_eq!((bounds.positions.len(), bounds.velocities.len()), (n, n));
            assert!(bounds.positions.iter().all(|b| b.0 < b.1), "{}", system.name);
            assert!(bounds.velocities.iter().enumerate().all(|(i, b)| b.0 < b.1 || fixed == Some(i)));
        }
        let mut v: Vec<f64> = (0..n).map(|i| 0.1 * i as f64).collect();
        let q: Vec<f64> = start.positions.iter().map(|b| 0.4 * b.0 + 0.6 * b.1).collect();
        let before = v.clone();
        configured.impose_constraint(&q, &mut v).unwrap();
        match fixed {
            None => assert_eq!((v, system.constraint), (before, None)),
            Some(i) => {
                assert!(v[i] > 0.0 && (0..n).all(|k| k == i || v[k] == before[k]));
                assert!(system.constraint.unwrap().starts_with(&format!("{} = ", system.columns(n)[n + i])));
            }
        }
        let middle: Vec<f64> = system.training(n).positions.iter().map(|b| 0.4 * b.0 + 0.6 * b.1).collect();
        assert_eq!(configured.check_domain(&middle), Ok(()));
    }
    let pendulum = find("double-pendulum").unwrap();
    assert_eq!(pendulum.columns(2), ["theta1", "theta2", "theta1_dot", "theta2_dot"]);
    assert_eq!(pendulum.labels(2)[1..3], ["theta2 [rad]", "theta1_dot [rad/s]"]);
    assert_eq!(find("sphere-geodesic").unwrap().columns(2), ["theta", "phi", "theta_dot", "phi_dot"]);
    assert!(configure::<f64>("spring-pendulum", &[]).unwrap().check_domain(&[0.0, 1.0]).is_err());
    assert!(configure::<f64>("sphere-geodesic", &[]).unwrap().check_domain(&[0.0, 1.0]).is_err());
    assert!(configure::<f64>("kepler", &[]).unwrap().check_domain(&[0.0, 0.0]).is_err());
    assert!(configure::<f64>("ads2-geodesic", &[]).unwrap().check_domain(&[1.0, -1.0]).is_err());
    // The horizon moves with the mass.
    let hole = |mass: &str| configure::<f64>("schwarzschild-geodesic", &given(&[("M", mass)])).unwrap();
    assert_eq!(hole("1").check_domain(&[0.0, 3.0, 1.0, 0.0]), Ok(()));
    assert!(hole("1.5").check_domain(&[0.0, 3.0, 1.0, 0.0]).is_err());
    assert!(hole("1").check_domain(&[0.0, 3.0, 0.0, 0.0]).is_err());
    assert!(hole("1").impose_constraint(&[0.0, 3.0, 1.0], &mut [0.0; 4]).is_err());
}

#[test]
fn systems_are_where_they_should_be() {
    let place = |name: &str, list: &[(&str, &str)], q: &[f64]| {
        configure::<f64>(name, &given(list)).unwrap().position_in_plane(q).unwrap()
    };
    let near = |(x, y): (f64, f64), (a, b): (f64, f64), size: f64| {
        // Sine and cosine to half a unit in the last place, angles as near as pi is.
        assert!((x - a).abs().max((y - b).abs()) <= 4.0 * f64::EPSILON * size, "({x}, {y}) for ({a}, {b})");
    };
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6, PI};
    let root = 0.75f64.sqrt();
    // One rod to the right, one up; then hanging; then three, the last up at an angle.
    near(place("double-pendulum", &[("l1", "2"), ("l2", "0.5")], &[FRAC_PI_2, PI]), (2.0, 0.5), 2.5);
    near(place("double-pendulum", &[], &[0.0, 0.0]), (0.0, -2.0), 2.0);
    let rods = [("l1", "1"), ("l2", "2"), ("l3", "4")];
    near(place("triple-pendulum", &rods, &[0.0, FRAC_PI_2, PI - FRAC_PI_6]), (4.0, 4.0 * root - 1.0), 7.0);
    near(place("n-pendulum", &[("n", "5"), ("l", "2")], &[FRAC_PI_6; 5]), (5.0, -10.0 * root), 10.0);
    near(place("n-pendulum", &[("n", "1")], &[-FRAC_PI_2]), (-1.0, 0.0), 1.0);
    near(place("spring-pendulum", &[], &[3.0, FRAC_PI_3]), (3.0 * root, -1.5), 3.0);
    near(place("sphere-geodesic", &[("R", "2")], &[FRAC_PI_3, PI]), (-2.0 * root, 1.0), 2.0);
    near(place("schwarzschild-geodesic", &[], &[7.0, 4.0, 1.0, FRAC_PI_6]), (4.0 * root, 2.0), 4.0);
    near(place("kerr-geodesic", &[], &[7.0, 4.0, 1.0, FRAC_PI_6]), (4.0 * root, 2.0), 4.0);
    assert_eq!(place("kerr-cartesian", &[], &[7.0, 4.0, 1.0, 2.0]), (4.0, 1.0));
    assert_eq!(place("kepler", &[], &[1.5, -2.0]), (1.5, -2.0));
    assert_eq!(place("henon-heiles", &[], &[0.25, 0.5]), (0.25, 0.5));
    assert_eq!(place("charged-particle", &[], &[1.0, 2.0, 3.0]), (1.0, 2.0));
    assert_eq!(place("ads2-geodesic", &[], &[1.0, 2.0]), (1.0, 2.0));
    assert_eq!(place("ads3-geodesic", &[], &[1.0, 2.0, 3.0]), (2.0, 3.0));
    assert_eq!(place("ads4-geodesic", &[], &[1.0, 2.0, 3.0, 4.0]), (2.0, 4.0));
    assert_eq!(configure::<f64>("kepler", &[]).unwrap().position_in_plane(&[1.0]), None);
}

#[test]
fn places_are_finite_and_no_larger_than_the_system() {
    for system in systems() {
        let n = system.size.default();
        let configured = configure::<f64>(&system.name, &[]).unwrap();
        let bounds = system.training(n).positions;
        let Some(plane) = system.plane else {
            assert_eq!((n, configured.position_in_plane(&[0.5])), (1, None), "{}", system.name);
            continue;
        };
        assert!(plane.labels.iter().all(|label| label.ends_with(" [m]")), "{}", system.name);
        let size = match system.name.as_ref() {
            "sphere-geodesic" => 1.0,
            "double-pendulum" | "triple-pendulum" | "n-pendulum" => n as f64,
            _ => f64::INFINITY,
        };
        for k in 0..1000 {
            // A different fraction of each coordinate's range in every state.
            let part = |i: usize| (0.618_034 * f64::from(k) * (1.0 + i as f64).sqrt()).fract();
            let q: Vec<f64> = bounds.iter().enumerate().map(|(i, b)| b.0 + (b.1 - b.0) * part(i)).collect();
            let (x, y) = configured.position_in_plane(&q).unwrap();
            assert!(x.is_finite() && y.is_finite() && x.hypot(y) <= size * (1.0 + 1e-15 * n as f64), "{q:?}");
        }
    }
}

#[test]
fn parameters_are_read_and_refused() {
    let configured = configure::<Dd>("double-pendulum", &given(&[("l2", " 0.5 "), ("g", "0")])).unwrap();
    let expected: Vec<Dd> = ["1", "1", "1", "0.5", "0"].iter().map(|t| Dd::parse(t).unwrap()).collect();
    assert_eq!(configured.parameters, expected);
    assert_eq!(configure::<f32>("n-pendulum", &given(&[("n", "7")])).unwrap().coordinates, 7);
    let error = |name: &str, list: &[(&str, &str)]| configure::<f64>(name, &given(list)).unwrap_err();
    let text = error("duble-pendulum", &[]).to_string();
    assert_eq!(text, "unknown system \"duble-pendulum\", did you mean \"double-pendulum\"?");
    let text = error("spring-pendulum", &[("L0", "1")]).to_string();
    assert_eq!(text, "spring-pendulum: unknown parameter \"L0\", did you mean \"l0\"?");
    assert!(matches!(error("n-pendulum", &[("N", "3")]), SystemError::UnknownParameter { .. }));
    assert!(matches!(error("double-pendulum", &[("g", "1"), ("g", "2")]), SystemError::Repeated { .. }));
    for bad in ["0", "-1", "nan", "inf", "1e999", "one", ""] {
        assert!(
            matches!(error("double-pendulum", &[("m1", bad)]), SystemError::Value { symbol, .. } if symbol == "m1")
        );
    }
    for bad in ["0", "21", "-1", "2.5", "18446744073709551616"] {
        assert!(matches!(error("n-pendulum", &[("n", bad)]), SystemError::Value { symbol, .. } if symbol == "n"));
    }
    assert!(matches!(
        configure::<f64>("double-pendulum", &[]).unwrap().exact_acceleration(&[1.0], &[1.0, 2.0]),
        Err(SystemError::State { expected: 2, found: 1, .. })
    ));
}

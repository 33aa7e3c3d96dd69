//! Systems described in text: their numbers against the catalogue's closed forms, and what is wrong in a description.

use crate::common::accuracy::{cast, configure, input_conditions, largest, outputs, random_state, recast};
use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Request, SystemInstance, Terms};
use lnn::linalg::{self, Workspace};
use lnn::network::Structure;
use lnn::pipeline::parse_system;
use lnn::presets::Preset;
use lnn::rollout::{RolloutOptions, rollout};
use lnn::scalar::{Dd, Scalar};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::borrow::Cow;

const PENDULUM: &str = include_str!("../../../examples/systems/pendulum.toml");
const TWO_PENDULA: &str = include_str!("../../../examples/systems/two_pendula.toml");
const BLACK_HOLE: &str = include_str!("../../../examples/systems/black_hole.toml");
const CARTESIAN: &str = include_str!("../../../examples/systems/black_hole_cartesian.toml");
const KERR: &str = include_str!("../../../examples/systems/kerr.toml");

fn described<S: Scalar>(text: &str, given: &[(&str, &str)]) -> SystemInstance<S> {
    let given: Vec<(String, String)> = given.iter().map(|&(s, t)| (s.into(), t.into())).collect();
    SystemInstance::new(Cow::Owned(parse_system(text).unwrap()), &given).unwrap()
}

/// Outputs of a described system against those of the catalogue's in double-double, its acceleration against the closed
/// form as well, in units of rounding and condition.
fn agree<S: Scalar>(text: &str, name: &str, given: &[(&str, &str)], rng: &mut ChaCha8Rng) -> f64 {
    let (written, catalogue) = (described::<S>(text, given), configure::<S>(name, given));
    let wide: SystemInstance<Dd> = recast(&catalogue);
    let (built, judge, n) = (written.build().unwrap(), wide.build().unwrap(), catalogue.coordinates);
    let mut worst = 0f64;
    for _ in 0..20 {
        let (q, v) = random_state(&written, &catalogue.system.validation(n), rng);
        let found = outputs(&*built, &q, &v);
        let closed = catalogue.exact_acceleration(&q, &v).unwrap();
        let single = written.exact_acceleration(&q, &v).unwrap();
        let (q, v): (Vec<Dd>, Vec<Dd>) = (cast(&q), cast(&v));
        let exact = outputs(&*judge, &q, &v);
        let conditions = input_conditions(&wide, &q, &v, &exact);
        let kappa = linalg::condition_number(n, &exact[3].1, &mut Workspace::new()).unwrap();
        for (((name, a), (_, b)), condition) in found.iter().zip(&exact).zip(conditions) {
            let solved = if *name == "acceleration" { kappa } else { 1.0 };
            let condition = condition.iter().fold(0f64, |m, &c| m.max(c));
            let unit = S::epsilon().to_f64() * (condition + solved * largest(b)).max(f64::MIN_POSITIVE);
            let difference =
                |a: &[S], b: &[Dd]| largest(&a.iter().zip(b).map(|(&a, &b)| a.cast::<Dd>() - b).collect::<Vec<_>>());
            worst = worst.max(difference(a, b) / unit);
            if *name == "acceleration" {
                worst = worst.max(difference(a, &cast(&closed)) / unit).max(difference(&single, &cast(&closed)) / unit);
            }
        }
    }
    worst
}

#[test]
fn written_systems_are_the_catalogues() {
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    /// A file, the catalogue's name of the same system, its parameters.
    type Case<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)]);
    let cases: [Case<'_>; 5] = [
        (TWO_PENDULA, "double-pendulum", &[]),
        (TWO_PENDULA, "double-pendulum", &[("m1", "0.1"), ("l2", "2.3"), ("g", "9.81")]),
        (BLACK_HOLE, "schwarzschild-geodesic", &[]),
        (BLACK_HOLE, "schwarzschild-geodesic", &[("M", "0.3")]),
        (CARTESIAN, "schwarzschild-cartesian", &[]),
    ];
    for (text, name, given) in cases {
        let worst = [
            agree::<Dd>(text, name, given, &mut rng),
            agree::<f64>(text, name, given, &mut rng),
            agree::<f32>(text, name, given, &mut rng),
        ];
        println!("{name} {given:?}: R = {worst:.2?}");
        assert!(worst.iter().all(|r| *r < 30.0), "{name}: {worst:?}");
    }
}

#[test]
fn numbers_of_a_file_are_read_in_the_working_precision() {
    let text = PENDULUM
        .replace("default = 9.8", "default = \"9.80665000000000000000000000001\"")
        .replace("theta_dot^2/2", "theta_dot^2*0.7");
    let system = described::<Dd>(&text, &[]);
    let expected = Dd::parse("9.80665000000000000000000000001").unwrap();
    assert!(system.parameters.contains(&expected) && expected != Dd::of_f64(9.80665));
    let mut terms = Terms::default();
    system.build().unwrap().terms(&[Dd::of_f64(0.0)], &[Dd::of_f64(1.0)], Request::ALL, &mut terms).unwrap();
    assert_eq!(terms.mass_matrix[0], Dd::parse("0.7").unwrap() + Dd::parse("0.7").unwrap());
}

#[test]
fn a_spinning_hole_keeps_its_shell_and_what_its_symmetries_promise() {
    let mut rng = ChaCha8Rng::seed_from_u64(32);
    // Without spin it is the hole of Schwarzschild.
    let (still, plain) = (described::<f64>(KERR, &[("a", "0")]), described::<f64>(BLACK_HOLE, &[]));
    let (q, v) = random_state(&still, &still.system.validation(4), &mut rng);
    for ((name, a), (_, b)) in
        outputs(&*still.build().unwrap(), &q, &v).iter().zip(outputs(&*plain.build().unwrap(), &q, &v))
    {
        let size = b.iter().fold(1.0, |m: f64, b| m.max(b.abs()));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-13 * size), "{name}: {a:?} {b:?}");
    }
    let kerr = described::<f64>(KERR, &[("a", "0.9")]);
    assert_eq!(kerr.constrained_coordinate(), Some(0));
    let built = kerr.build().unwrap();
    for (q, v) in (0..20).map(|_| random_state(&kerr, &kerr.system.trajectory(4).start, &mut rng)) {
        let run = rollout(built.as_ref(), &q, &v, &RolloutOptions::reference(5.0, 0.5));
        assert!(run.stop.is_none(), "{:?}", run.stop);
        let mut terms = Terms::default();
        built.terms(&run.trajectory.q, &run.trajectory.v, Request::LAGRANGIAN | Request::MOMENTUM, &mut terms).unwrap();
        for (l, p) in terms.lagrangian.iter().zip(terms.momentum.chunks(4)) {
            assert!((2.0 * l + 1.0).abs() < 1e-10, "{l}");
            // Energy and angular momentum along the axis.
            assert!(
                (p[0] - terms.momentum[0]).abs() < 1e-10
                    && (p[3] - terms.momentum[3]).abs() < 1e-10 * (1.0 + p[3].abs())
            );
        }
        assert!(v[0] > 0.0);
    }
}

#[test]
fn batches_and_single_states_agree() {
    let mut rng = ChaCha8Rng::seed_from_u64(33);
    for text in [PENDULUM, TWO_PENDULA, BLACK_HOLE, KERR] {
        let system = described::<f64>(text, &[]);
        let (n, built) = (system.coordinates, system.build().unwrap());
        let states: Vec<_> = (0..100).map(|_| random_state(&system, &system.system.validation(n), &mut rng)).collect();
        let (q, v): (Vec<Vec<f64>>, Vec<Vec<f64>>) = states.iter().cloned().unzip();
        let (mut batch, mut single) = (Terms::default(), Terms::default());
        built.terms(&q.concat(), &v.concat(), Request::ALL, &mut batch).unwrap();
        for (k, (q, v)) in states.iter().enumerate() {
            built.terms(q, v, Request::ALL, &mut single).unwrap();
            let size = single.acceleration.iter().fold(1.0, |m: f64, a| m.max(a.abs()));
            for (a, b) in batch.acceleration[k * n..].iter().zip(&single.acceleration) {
                assert!((a - b).abs() <= 1e-12 * size, "{a} {b}");
            }
        }
    }
}

#[test]
fn a_formula_alone_is_a_lagrangian() {
    let error = ExpressionLagrangian::new(&["x"], &["k"], "x_dot^2/2 - K*x^2/2").unwrap_err();
    assert_eq!(error.to_string(), "column 13: unknown name \"K\", did you mean \"k\"?");
    let oscillator = ExpressionLagrangian::new(&["x"], &["k"], "x_dot^2/2 - k*x^2/2").unwrap();
    let oscillator = lnn::lagrangian::Mechanics::new(oscillator, vec![3.0]);
    let mut terms = Terms::default();
    oscillator.terms(&[2.0], &[0.5], Request::ALL, &mut terms).unwrap();
    assert_eq!((terms.acceleration[0], terms.energy[0]), (-6.0, 6.125));
}

/// What is said about a file after a change.
#[track_caller]
fn refused(text: &str, old: &str, new: &str, message: &str) {
    assert!(text.contains(old), "{old}");
    let (line, problem) = parse_system(&text.replacen(old, new, 1)).map(|_| ()).unwrap_err();
    assert_eq!(format!("{line}: {problem}"), message);
}

/// What the reader of the file refuses, by line and key, and a name in the message.
fn placed(text: &str, old: &str, new: &str, place: &str, part: &str) {
    assert!(text.contains(old));
    let (line, problem) = parse_system(&text.replacen(old, new, 1)).map(|_| ()).unwrap_err();
    let said = format!("{line}: {problem}");
    assert!(said.starts_with(place) && said.contains(part), "{said}");
}

#[test]
fn a_mistake_is_placed_by_line_key_and_column() {
    let formula = "m*l^2*theta_dot^2/2 + m*g*l*cos(theta)";
    refused(
        PENDULUM,
        formula,
        "m*l^2*thta_dot^2/2",
        "5: lagrangian: column 7: unknown name \"thta_dot\", did you mean \"theta_dot\"?",
    );
    refused(
        PENDULUM,
        formula,
        "m*l^2*theta_dot^2/2 +",
        "5: lagrangian: column 22: expected a number, a name or a parenthesis, found the end",
    );
    refused(
        PENDULUM,
        formula,
        "m*g*l*cos(theta)",
        "5: lagrangian: expected theta_dot in it: without a kinetic energy theta has no acceleration; motion of first order, as of tanks and circuits, has no \
         Lagrangian here",
    );
    refused(PENDULUM, formula, "", "5: lagrangian: column 1: expected a formula, found nothing");
    placed(PENDULUM, "lagrangian =", "lagrangain =", "5: lagrangain: ", "lagrangian");
    placed(PENDULUM, "periodic =", "periodc =", "10: coordinates[0].periodc: ", "periodic");
    placed(PENDULUM, "unit = \"kg\"", "units = \"kg\"", "14: parameters.m.units: ", "unit");
    placed(PENDULUM, "\"positive\"", "\"positiv\"", "14: parameters.m.range: ", "positive");
    refused(
        PENDULUM,
        "default = 1,",
        "default = 0,",
        "14: parameters.m.default: expected a decimal number, finite and above 0, found \"0\"",
    );
    refused(
        PENDULUM,
        "default = 9.8",
        "default = \"9,8\"",
        "16: parameters.g.default: expected a decimal number, finite, found \"9,8\"",
    );
    refused(
        PENDULUM,
        "[-10, 10]",
        "[10, -10]",
        "11: coordinates[0].velocity_bounds: expected [low, high], finite and in this order, found [10, -10]",
    );
    refused(PENDULUM, "periodic = true", "periodic = false", "7: coordinates[0]: missing key \"bounds\"");
    refused(
        PENDULUM,
        "name = \"pendulum\"",
        "name = \"double-pendulum\"",
        "2: name: double-pendulum is a system of the catalogue, expected another name",
    );
    refused(
        PENDULUM,
        "name = \"pendulum\"",
        "name = \"../x\"",
        "2: name: expected a name of 1 to 64 letters, digits, `-` and `_`",
    );
    // Names that mean something else.
    refused(PENDULUM, "\nm = {", "\nsin = {", "14: parameters.sin: `sin` is a function or constant of formulas");
    refused(PENDULUM, "\nm = {", "\ntheta_dot = {", "14: parameters.theta_dot: the name `theta_dot` is taken");
    refused(
        PENDULUM,
        "name = \"theta\"",
        "name = \"2theta\"",
        "8: coordinates[0].name: \"2theta\" is not a valid name: expected a letter or _, then letters, digits and _, 64 at most",
    );
    refused(
        TWO_PENDULA,
        "name = \"theta2\"",
        "name = \"theta1\"",
        "14: coordinates[1].name: the name `theta1` is taken",
    );
    // Definitions.
    refused(
        TWO_PENDULA,
        "\"l1*theta1_dot\"",
        "\"u2*kinetic\"",
        "29: definitions.kinetic: it depends on itself: kinetic -> u1 -> kinetic",
    )
}

#[test]
fn metrics_and_definitions_are_checked() {
    refused(
        BLACK_HOLE,
        "\"r^2\"",
        "\"r^2*t_dot\"",
        "37: metric.theta,theta: column 5: expected only coordinates and parameters, but `t_dot` is or contains a velocity",
    );
    refused(
        BLACK_HOLE,
        "\"theta,theta\"",
        "\"thta,theta\"",
        "37: metric.thta,theta: unknown coordinate \"thta\", did you mean \"theta\"?",
    );
    refused(
        BLACK_HOLE,
        "\"theta,theta\"",
        "\"theta\"",
        "37: metric.theta: expected two coordinates with a comma between them, such as \"t,t\"",
    );
    refused(
        BLACK_HOLE,
        "\"theta,theta\"",
        "\"r, r\"",
        "36: metric.r,r: this entry is given twice: the metric is symmetric",
    );
    refused(
        BLACK_HOLE,
        "\"theta,theta\" = \"r^2\"\n",
        "",
        "34: metric: expected an entry of theta, such as \"theta,theta\"",
    );
    refused(
        BLACK_HOLE,
        "[metric]",
        "[metric]\n\"t,r\" = \"0\"\n\"r,t\" = \"0\"",
        "35: metric.t,r: this entry is given twice: the metric is symmetric",
    );
    refused(
        BLACK_HOLE,
        "time_unit = \"m\"",
        "time_unit = \"m\"\nlagrangian = \"t_dot\"",
        "35: metric: expected `lagrangian` or `[metric]`, found both",
    );
    refused(
        PENDULUM,
        "lagrangian = \"m*l^2*theta_dot^2/2 + m*g*l*cos(theta)\"",
        "",
        "1: expected `lagrangian = \"..\"`, or a table `[metric]` of its coefficients, found neither",
    );
    refused(
        BLACK_HOLE,
        "unit = \"rad\"\nperiodic",
        "unit = \"rad\"\ntime_like = true\nperiodic",
        "28: coordinates[3].time_like: there is a time-like one before",
    );
    refused(
        BLACK_HOLE,
        "\"0.1*pi\"",
        "\"0.1*pie\"",
        "22: coordinates[2].bounds[0]: column 5: unknown name \"pie\", did you mean \"pi\"?",
    );
    refused(BLACK_HOLE, "t_end = 5", "t_end = -5", "41: trajectory.t_end: expected a finite number above 0, found -5");
    refused(BLACK_HOLE, "dt = 0.05", "dt = 1e-9", "42: trajectory.dt: expected at least a millionth of t_end = 5");
    refused(
        TWO_PENDULA,
        "theta2_dot = [-0.1",
        "thta2_dot = [-0.1",
        "35: trajectory.start.thta2_dot: unknown key \"thta2_dot\", did you mean \"theta2_dot\"?",
    );
}

#[test]
fn hostile_files_are_refused_and_large_ones_are_not() {
    let with = |formula: &str| PENDULUM.replace("cos(theta)", formula);
    assert!(parse_system(&with(&format!("{}theta{}", "(".repeat(50_000 / 2), ")".repeat(50_000 / 2)))).is_err());
    assert!(parse_system("").is_err() && parse_system("\u{feff}").is_err());
    assert!(parse_system(&with(&vec!["theta"; 8000].join(" - "))).is_ok());
    // A thousandfold square of a square is shared, not written out.
    let chain: String = (1..200).map(|k| format!("d{k} = \"d{}*d{}\"\n", k - 1, k - 1)).collect();
    let text = format!("{}\n[definitions]\nd0 = \"cos(theta)\"\n{chain}", with("d199"));
    let system = parse_system(&text).unwrap();
    assert_eq!(system.parameters.len(), 3);
    let circle: String = (0..200).map(|k| format!("d{k} = \"d{}\"\n", (k + 1) % 200)).collect();
    let (_, problem) = parse_system(&format!("{}\n[definitions]\n{circle}", with("d0"))).map(|_| ()).unwrap_err();
    assert!(
        problem.starts_with("definitions.d0: it depends on itself: d0 -> d1 -> d2") && problem.ends_with(".."),
        "{problem}"
    );
    let many: String = (0..300).map(|k| format!("p{k} = 1\n")).collect();
    let (_, problem) = parse_system(&format!("{PENDULUM}{many}")).map(|_| ()).unwrap_err();
    assert_eq!(problem, "parameters: expected at most 256 names, found 303");
}

#[test]
fn what_is_to_be_learned_is_kept() {
    let system = parse_system(&PENDULUM.replace("g = { default = 9.8,", "g = { default = 9.8, learn = true,")).unwrap();
    let names: Vec<&str> = system.parameters.iter().map(|p| p.symbol.as_ref()).collect();
    assert_eq!(
        (names, system.parameters.iter().map(|parameter| parameter.learn).collect::<Vec<_>>()),
        (vec!["g", "l", "m"], vec![true, false, false])
    );
    // A number alone is a parameter.
    let short = PENDULUM.replace("{ default = 9.8, unit = \"m/s^2\" }", "9.8");
    assert_eq!(parse_system(&short).unwrap().parameters[0].default, "9.8");
}

#[test]
fn a_shell_says_where_training_states_lie_and_is_checked() {
    let hole = described::<f64>(CARTESIAN, &[]);
    let config = Preset::Quick.config(&hole).unwrap();
    assert_eq!((config.data.shell_radius, config.data.rapidity), (Some([1.2, 110.0]), Some(1.2)));
    assert_eq!(
        (config.data.shell.as_slice(), config.network.radial.len()),
        (["x", "y", "z"].map(String::from).as_slice(), 1)
    );
    assert_eq!(
        (config.network.structure, config.network.cyclic.as_slice()),
        (Structure::Metric, ["t".to_string()].as_slice())
    );
    // It is what the catalogue's hole learns from, but for the name of the system.
    let catalogue = Preset::Quick.config(&configure::<f64>("schwarzschild-cartesian", &[])).unwrap();
    assert_eq!((&config.data, &config.phases), (&catalogue.data, &catalogue.phases));
    for (old, new, message) in [
        ("[\"x\", \"y\", \"z\"]", "[\"x\", \"u\"]", "shell.coordinates: unknown coordinate \"u\""),
        ("[\"x\", \"y\", \"z\"]", "[\"x\", \"x\"]", "expected coordinates of space, each once, found \"x\""),
        ("[\"x\", \"y\", \"z\"]", "[\"t\"]", "expected coordinates of space, each once, found \"t\""),
        ("[\"x\", \"y\", \"z\"]", "[]", "shell.coordinates: expected one name at least"),
        ("radius = [1.2, 110]", "radius = [0, 110]", "shell.radius: expected distances above 0"),
        ("rapidity = 1.2", "rapidity = -1", "shell.rapidity: expected a finite number, at least 0"),
        ("time_like = true", "time_like = false", "coordinates[0]: missing key \"velocity_bounds\""),
    ] {
        assert!(CARTESIAN.contains(old), "{old}");
        let (line, problem) = parse_system(&CARTESIAN.replacen(old, new, 1)).map(|_| ()).unwrap_err();
        assert!(problem.to_string().contains(message) && line > 1, "{line}: {problem}");
    }
}

/// A pendulum with a friction in its joint, its strength a parameter.
fn damped() -> String {
    let l = "lagrangian = \"m*l^2*theta_dot^2/2 + m*g*l*cos(theta)\"";
    let d = format!("{l}\ndissipation = \"b*theta_dot^2/2\"");
    assert!(PENDULUM.contains(l));
    PENDULUM.replace(l, &d).replace("[parameters]", "[parameters]\nb = { default = 0.3, range = \"at least 0\" }")
}

#[test]
fn a_described_dissipation_is_a_force_of_every_use() {
    let text = damped();
    // m = l = 1: a = -g sin(theta) - b v.
    fn of<S: Scalar>(text: &str) -> ([f64; 2], f64) {
        let system = described::<S>(text, &[("b", "0.5")]);
        let (q, v) = ([S::of_f64(0.4)], [S::of_f64(2.0)]);
        let mut terms = Terms::default();
        let model = system.build().unwrap();
        assert!(!model.conserves_energy());
        model.terms(&q, &v, Request::ALL, &mut terms).unwrap();
        let single = system.exact_acceleration(&q, &v).unwrap();
        ([terms.acceleration[0].to_f64(), single[0].to_f64()], terms.dissipation[0].to_f64())
    }
    let exact = -9.8 * 0.4f64.sin() - 0.5 * 2.0;
    for (accelerations, power) in [of::<f32>(&text), of::<f64>(&text), of::<Dd>(&text)] {
        assert!(accelerations.iter().all(|a| (a - exact).abs() < 1e-5), "{accelerations:?}");
        assert!((power - 0.5 * 4.0).abs() < 1e-6);
    }
    // Networks learn such a system with a friction of their own.
    let [with, without] =
        [text.as_str(), PENDULUM].map(|text| Preset::Quick.config(&described::<f64>(text, &[])).unwrap());
    assert!(with.network.dissipation.is_some() && without.network.dissipation.is_none());
    // What cannot be a dissipation.
    for wrong in ["3*theta^2", "b*thta_dot^2"] {
        let error = parse_system(&text.replace("b*theta_dot^2/2", wrong)).unwrap_err().1;
        assert!(error.to_string().contains("dissipation"), "{error:?}");
    }
}

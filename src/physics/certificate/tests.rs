//! Enclosures of mass matrices against exact ones, certificates against systems whose signature is known.

use super::interval::Interval;
use super::interval_tests::holds;
use super::spectrum::{Enclose, Source, mass_matrix_enclosure};
use super::*;
use crate::lagrangian::{EulerLagrange, Request, Terms};
use crate::linalg::{Inertia, inertia};
use crate::network::{ActivationChoice, Architecture, Form, Initialization, InputLayer, NetworkLagrangian, Structure};
use crate::scalar::{Dd, Real};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mass matrix of a state in double-double numbers.
fn exact_matrix(model: &dyn EulerLagrange<Dd>, q: &[f64], v: &[f64]) -> Vec<Dd> {
    let wide = |x: &[f64]| x.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<_>>();
    let mut terms = Terms::default();
    model.terms(&wide(q), &wide(v), Request::MASS_MATRIX, &mut terms).unwrap();
    terms.mass_matrix
}

/// A box within bounds, of a side as a share of theirs, and states in it.
fn boxed(random: &mut ChaCha8Rng, bounds: &[(f64, f64)], side: f64) -> (Vec<(f64, f64)>, Vec<Vec<f64>>) {
    let part = |&(low, high): &(f64, f64)| {
        let start = low + (1.0 - side) * random.random_range(0.0..=1.0) * (high - low);
        (start, start + side * (high - low))
    };
    let found: Vec<(f64, f64)> = bounds.iter().map(part).collect();
    let mut state = || {
        found
            .iter()
            .map(|&(low, high)| (low + random.random_range(0.0..=1.0) * (high - low)).clamp(low, high))
            .collect()
    };
    let states = (0..6).map(|_| state()).collect();
    (found, states)
}

/// Checks that boxes of several sizes enclose the mass matrices of states in them, and that enclosures shrink with the boxes.
fn check_enclosures<L: Lagrangian>(
    name: &str,
    lagrangian: &L,
    parameters: &[f64],
    exact: &dyn EulerLagrange<Dd>,
    bounds: &Bounds,
) {
    let n = lagrangian.coordinates();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let all = [bounds.positions.as_slice(), &bounds.velocities].concat();
    for side in [0.3, 0.03, 1e-3, 1e-6, 0.0] {
        let mut widest = 0.0_f64;
        for _ in 0..12 {
            let (place, states) = boxed(&mut random, &all, side);
            let found = mass_matrix_enclosure(lagrangian, parameters, &place[..n], &place[n..]);
            for state in states {
                let matrix = exact_matrix(exact, &state[..n], &state[n..]);
                for (found, exact) in found.iter().zip(matrix) {
                    let slack = 1e-22 * (1.0 + exact.to_f64().abs());
                    let near = Interval { low: found.low - slack, high: found.high + slack };
                    assert!(holds(near, exact), "{name}: {found:?} without {exact} in {place:?}");
                    widest = widest.max((found.high - found.low) / (1.0 + exact.to_f64().abs()));
                }
            }
        }
        if side <= 1e-6 {
            assert!(widest < if side == 0.0 { 1e-10 } else { 1e-2 }, "{name}: {widest} for sides of {side}");
        }
    }
}

/// A visitor that checks the enclosures of a system.
struct Check<'a>(&'a SystemInstance<f64>);

impl LagrangianVisitor for Check<'_> {
    type Output = ();
    fn visit<L: Lagrangian>(self, lagrangian: &L) {
        let SystemInstance { system, coordinates, parameters } = self.0;
        let wide = SystemInstance {
            system: system.clone(),
            coordinates: *coordinates,
            parameters: parameters.iter().map(|&x| Dd::of_f64(x)).collect::<Vec<_>>(),
        };
        let exact = wide.build().unwrap();
        check_enclosures(&system.name, lagrangian, parameters, &*exact, &system.training(*coordinates));
    }
}

#[test]
fn systems_are_enclosed() {
    for system in crate::lagrangian::System::unconstrained() {
        let configured = crate::lagrangian::SystemInstance::<f64>::named(&system.name, &[]).unwrap();
        configured.visit(Check(&configured)).unwrap();
    }
}

/// A network of two coordinates, the first an angle.
fn architecture(activation: ActivationChoice, structure: Structure) -> Architecture {
    Architecture {
        coordinates: 2,
        hidden: vec![8, 6],
        activation,
        alpha: if structure == Structure::BlackBox { 0.5 } else { 0.0 },
        time_like: None,
        scale: vec![1.5, 0.7],
        periodic: vec![true, false],
        embed_periodic: true,
        input_layer: InputLayer::None,
        dissipation: None,
        form: Form { structure, ..Form::default() },
    }
}

fn network(architecture: Architecture, seed: u64) -> NetworkLagrangian<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let weights = architecture.initial_weights(Initialization::VariancePreserving, &mut random);
    NetworkLagrangian::new(architecture, weights).unwrap()
}

#[test]
fn networks_are_enclosed() {
    let bounds = Bounds { positions: vec![(0.0, 6.2), (-1.0, 1.0)], velocities: vec![(-2.0, 2.0), (-1.0, 1.5)] };
    for (seed, activation) in (4..).zip(ActivationChoice::ALL) {
        for structure in Structure::ALL {
            let mut shape = architecture(activation, structure);
            match structure {
                Structure::BlackBox => shape.form.even_in_v = seed % 2 == 0,
                Structure::Mechanical | Structure::ConstantMass => shape.input_layer = InputLayer::Dyt,
                _ => (shape.time_like, shape.embed_periodic) = (Some(1), false),
            }
            let model = network(shape, seed);
            let exact = model.cast::<Dd>();
            let name = format!("{activation} {}", structure.name());
            check_enclosures(&name, model.architecture(), model.weights(), &exact, &bounds);
        }
    }
}

/// `L` by a formula over `x` and `y`.
pub(super) fn formula(text: &str) -> crate::lagrangian::ExpressionLagrangian {
    crate::lagrangian::ExpressionLagrangian::new(&["x", "y"], &[], text).unwrap()
}

pub(super) fn limited(signature: Signature, boxes: usize) -> CertificateOptions<'static> {
    CertificateOptions { boxes, seconds: 1e9, ..CertificateOptions::new(signature) }
}

const DEFINITE: Signature = Signature { positive: 2, negative: 0 };

#[test]
fn the_double_pendulum_is_certified_everywhere() {
    let configured = crate::lagrangian::SystemInstance::<f64>::named("double-pendulum", &[]).unwrap();
    let region = Bounds::uniform(2, (-3.2, 3.2), (-9.0, 9.0));
    let found = Certificate::of_system(&configured, &region, &limited(DEFINITE, 20_000)).unwrap();
    assert_eq!((found.certified, found.refuted, found.open, found.witness.clone()), (1.0, 0.0, 0.0, None));
    // M = [[2, c], [c, 1]], c = cos(theta1 - theta2): the largest condition number is at c = 1, (3 + sqrt 5) / (3 - sqrt 5) = 6.854.
    let largest = (3.0 + 5f64.sqrt()) / (3.0 - 5f64.sqrt());
    assert!(found.condition.unwrap() >= largest);
    assert!(matches!(found.verdict(&[0.1, 3.0], &[1.0, -8.0]), Verdict::Certified { condition } if condition > 2.0));
    assert_eq!(found.verdict(&[4.0, 3.0], &[1.0, -8.0]), Verdict::Open);
    assert_eq!(found.verdict(&[0.1], &[1.0]), Verdict::Open);
    let bounded = |condition| {
        let options = CertificateOptions { condition: Some(condition), ..limited(DEFINITE, 20_000) };
        Certificate::of_system(&configured, &region, &options).unwrap()
    };
    let within = bounded(6.9);
    assert_eq!(within.certified, 1.0);
    assert!((largest..=6.9).contains(&within.condition.unwrap()));
    // sqrt((1 + 4 c^2)): eigenvalues (3 +- sqrt(1 + 4 c^2)) / 2, the ratio is above 5 where sqrt(1 + 4 c^2) > 2.
    let above = bounded(5.0);
    let share = 2.0 / std::f64::consts::PI * 0.75f64.sqrt().acos();
    assert!(above.refuted > 0.8 * share && above.refuted + above.open > 0.99 * share, "{above:?}");
    let witness = above.witness.unwrap();
    assert!((witness.q[0] - witness.q[1]).cos().abs() > 0.75f64.sqrt());
    assert!(witness.eigenvalues[1] / witness.eigenvalues[0] > 5.0);
}

#[test]
fn a_change_of_sign_is_found_where_it_is() {
    // M = diag(x, 1) is definite for x > 0, two thirds of the region.
    let lagrangian = formula("x*x_dot^2/2 + y_dot^2/2 + sin(y)*x");
    let region = Bounds { positions: vec![(-1.0, 2.0), (-1.0, 1.0)], velocities: vec![(-1.0, 1.0); 2] };
    let found = Certificate::of::<_, f64>(&lagrangian, &[], &region, &limited(DEFINITE, 60)).unwrap();
    assert!(found.open < 1e-4 && found.open > 0.0, "{found:?}");
    assert!((found.certified - 2.0 / 3.0).abs() <= found.open && (found.refuted - 1.0 / 3.0).abs() <= found.open);
    let witness = found.witness.as_ref().unwrap();
    assert!(witness.q[0] < 0.0 && witness.eigenvalues == [witness.q[0], 1.0], "{witness:?}");
    assert_eq!(found.verdict(&[-0.5, 0.0], &[0.0, 0.0]), Verdict::Refuted);
    assert!(matches!(found.verdict(&[0.5, 0.0], &[0.0, 0.0]), Verdict::Certified { .. }));
    // The other way round.
    let indefinite = Signature { positive: 1, negative: 1 };
    let turned = Certificate::of::<_, f64>(&lagrangian, &[], &region, &limited(indefinite, 60)).unwrap();
    assert_eq!((turned.certified, turned.refuted), (found.refuted, found.certified));
    // A singular matrix everywhere: nothing is proven.
    let singular = formula("(x_dot + y_dot)^2/2");
    let nothing = Certificate::of::<_, f64>(&singular, &[], &region, &limited(DEFINITE, 60)).unwrap();
    assert_eq!((nothing.open, nothing.witness), (1.0, None));
}

#[test]
fn what_is_not_decided_stays_open() {
    let region = Bounds { positions: vec![(-1.0, 1.0); 2], velocities: vec![(-1.0, 1.0); 2] };
    let open = |text: &str| Certificate::of::<_, f64>(&formula(text), &[], &region, &limited(DEFINITE, 400)).unwrap();
    // Kinks of L: |x_dot| has no second derivative at 0, whatever it is elsewhere.
    let kink = open("x_dot^2 + y_dot^2 + abs(x_dot)");
    assert!(kink.certified > 0.9 && kink.open > 0.0 && kink.refuted == 0.0, "{kink:?}");
    assert_eq!(kink.verdict(&[0.3, 0.2], &[0.0, 0.2]), Verdict::Open);
    // A region where L is undefined.
    let undefined = open("x_dot^2*exp(sqrt(x)) + y_dot^2");
    assert!(undefined.certified < 0.5 && undefined.certified > 0.4 && undefined.refuted == 0.0, "{undefined:?}");
    let potential = open("x_dot^2 + y_dot^2 - ln(y)");
    assert!(potential.certified < 0.5 && potential.certified > 0.49 && potential.refuted == 0.0, "{potential:?}");
    struct Reader;
    impl Lagrangian for Reader {
        fn coordinates(&self) -> usize {
            2
        }
        fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
            let zero = R::Scalar::of_f64(0.0);
            if q[0].primal() >= zero { v[0] * v[0] + v[1] * v[1] } else { v[0] * v[1] }
        }
    }
    let read = Certificate::of::<_, f64>(&Reader, &[], &region, &limited(DEFINITE, 100)).unwrap();
    assert_eq!(read.open, 1.0);
}

#[test]
fn no_certified_box_of_a_network_holds_a_violation() {
    let mut shape = architecture(ActivationChoice::Gelu, Structure::BlackBox);
    shape.alpha = 0.15;
    let model = network(shape, 17);
    let region = Bounds { positions: vec![(0.5, 2.0), (-1.0, 0.0)], velocities: vec![(-1.0, 0.5), (-0.5, 1.0)] };
    let found = Certificate::of_network(&model, &region, &limited(DEFINITE, 40_000)).unwrap();
    assert!(found.certified > 0.05 && found.refuted > 0.05, "{found:?}");
    assert!((found.certified + found.refuted + found.open - 1.0).abs() < 1e-12);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let (mut certified, mut refuted) = (0, 0);
    let exact = model.cast::<Dd>();
    for _ in 0..4000 {
        let mut draw =
            |bounds: &[(f64, f64)]| bounds.iter().map(|b| random.random_range(b.0..b.1)).collect::<Vec<f64>>();
        let (q, v) = (draw(&region.positions), draw(&region.velocities));
        let matrix = exact_matrix(&exact, &q, &v);
        let Inertia { positive, .. } = inertia(2, &matrix, &mut [<Dd as Real>::zero(); 4]).unwrap();
        match found.verdict(&q, &v) {
            Verdict::Certified { condition } => {
                let (mut values, mut workspace) = ([0.0; 2], crate::linalg::Workspace::new());
                let matrix: Vec<f64> = matrix.iter().map(|x| x.to_f64()).collect();
                crate::linalg::eigenvalues(2, &matrix, &mut values, &mut workspace).unwrap();
                assert!(positive == 2 && values[1] / values[0] <= condition * (1.0 + 1e-9), "{q:?} {v:?} {values:?}");
                certified += 1;
            }
            Verdict::Refuted => {
                assert!(positive < 2, "{q:?} {v:?}");
                refuted += 1;
            }
            Verdict::Open => {}
        }
    }
    assert!((f64::from(certified) / 4000.0 - found.certified).abs() < 0.05);
    assert!((f64::from(refuted) / 4000.0 - found.refuted).abs() < 0.05);
    let witness = found.witness.unwrap();
    let matrix = exact_matrix(&exact, &witness.q, &witness.v);
    assert!(inertia(2, &matrix, &mut [<Dd as Real>::zero(); 4]).unwrap().positive < 2);
}

/// Largest distance from a polynomial of an element of the mass matrix, over a cube about a state.
fn distance(model: &NetworkLagrangian<f64>, state: &[f64], side: f64) -> f64 {
    let place: Vec<(f64, f64)> = state.iter().map(|x| (x - 0.5 * side, x + 0.5 * side)).collect();
    let mut found = 0.0_f64;
    Source::new(model.architecture(), model.weights()).each(&[&place], &mut |_, matrix| {
        let distances = matrix.forms.iter().skip(matrix.basis.count()).step_by(matrix.basis.stride());
        found = distances.fold(0.0, |largest, [r]| largest.max(*r));
        true
    });
    found
}

#[test]
fn distances_shrink_with_a_high_power_of_the_sides() {
    // Two coordinates have polynomials of the third degree, four of the second.
    let two = network(architecture(ActivationChoice::Gelu, Structure::BlackBox), 20);
    let mut shape = architecture(ActivationChoice::Gelu, Structure::BlackBox);
    (shape.coordinates, shape.scale, shape.periodic) = (4, vec![1.0; 4], vec![false; 4]);
    let four = network(shape, 20);
    for (model, power) in [(&two, 4), (&four, 3)] {
        let state: Vec<f64> = (0..2 * model.coordinates()).map(|k| 0.3 * (k as f64 + 1.0).sin()).collect();
        let halved = distance(model, &state, 0.04) / distance(model, &state, 0.02);
        let expected = 2f64.powi(power);
        assert!((0.9 * expected..1.3 * expected).contains(&halved), "{halved} for a power of {power}");
    }
}

#[test]
fn a_raised_flag_ends_a_search_with_what_it_has() {
    let model = network(architecture(ActivationChoice::Gelu, Structure::BlackBox), 17);
    let region = Bounds::uniform(2, (0.0, 6.2), (-2.0, 2.0));
    let stop = AtomicBool::new(true);
    let options = CertificateOptions { stop: Some(&stop), threads: 2, ..limited(DEFINITE, usize::MAX) };
    let found = Certificate::of_network(&model, &region, &options).unwrap();
    assert!(found.boxes <= 2 && found.open > 0.0, "{found:?}");
    assert!((found.certified + found.refuted + found.open - 1.0).abs() < 1e-12);
}

#[test]
fn structures_are_certified_by_construction() {
    let region = Bounds { positions: vec![(0.0, 6.2), (-1.0, 1.0)], velocities: vec![(-1.0, 1.0); 2] };
    let indefinite = Signature { positive: 1, negative: 1 };
    for (structure, time_like, signature) in [
        (Structure::Mechanical, None, DEFINITE),
        (Structure::ConstantMass, None, DEFINITE),
        (Structure::Metric, None, DEFINITE),
        (Structure::Metric, Some(0), indefinite),
    ] {
        let shape = Architecture { time_like, ..architecture(ActivationChoice::Softplus, structure) };
        let model = network(shape, 18);
        let found = Certificate::of_network(&model, &region, &limited(signature, 100)).unwrap();
        assert_eq!((found.certified, found.open, found.boxes, found.by_construction), (1.0, 0.0, 0, true));
        assert!(matches!(found.verdict(&[1.0, 0.0], &[0.0, 0.0]), Verdict::Certified { .. }));
        // A condition number has to be enclosed.
        let options = CertificateOptions { condition: Some(1e4), ..limited(signature, 4000) };
        let bounded = Certificate::of_network(&model, &region, &options).unwrap();
        assert!(bounded.by_construction && bounded.boxes > 0 && bounded.certified > 0.9, "{bounded:?}");
        assert!(bounded.condition.unwrap() <= 1e4);
        // A known part may spoil the signature, and another signature is not that of the structure.
        let other = if signature == DEFINITE { indefinite } else { DEFINITE };
        let wrong = Certificate::of_network(&model, &region, &limited(other, 400)).unwrap();
        assert!(!wrong.by_construction && wrong.certified == 0.0 && wrong.refuted > 0.0);
    }
}

#[test]
fn threads_and_turns_change_nothing() {
    let mut shape = architecture(ActivationChoice::XTanh, Structure::BlackBox);
    shape.embed_periodic = false;
    let model = network(shape, 19);
    let certified = |positions: (f64, f64), threads: usize| {
        let region = Bounds { positions: vec![positions, (-0.2, 0.2)], velocities: vec![(-0.2, 0.2); 2] };
        Certificate::of_network(&model, &region, &CertificateOptions { threads, ..limited(DEFINITE, 3000) }).unwrap()
    };
    // No more threads are started than there are boxes.
    let many = certified((1.0, 2.0), usize::MAX);
    let (one, three) = (certified((1.0, 2.0), 1), certified((1.0, 2.0), 3));
    assert_eq!((one.certified, one.refuted, one.boxes), (many.certified, many.refuted, many.boxes));
    assert_eq!((one.certified, one.refuted, one.boxes), (three.certified, three.refuted, three.boxes));
    assert_eq!((one.witness, one.condition), (three.witness, three.condition));
    // The network knows an angle up to turns; a region over the end of a turn has two parts.
    let turn = std::f64::consts::TAU;
    let moved = certified((1.0 - 3.0 * turn, 2.0 - 3.0 * turn), 1);
    assert!((moved.certified - one.certified).abs() < 0.02 && (moved.refuted - one.refuted).abs() < 0.02);
    let both = certified((-0.5, 0.25), 1);
    let parts = (certified((turn - 0.5, turn), 1), certified((0.0, 0.25), 1));
    let expected = (2.0 * parts.0.certified + parts.1.certified) / 3.0;
    assert!((both.certified - expected).abs() < 0.05, "{} {expected}", both.certified);
    for (angle, part) in [(-0.3, &parts.0), (turn - 0.3, &parts.0), (0.1, &parts.1), (turn + 0.1, &parts.1)] {
        let state = ([angle, 0.01], [0.01, 0.02]);
        let kind = |verdict: Verdict| std::mem::discriminant(&verdict);
        assert_eq!(kind(both.verdict(&state.0, &state.1)), kind(part.verdict(&state.0, &state.1)), "{angle}");
    }
}

#[test]
fn what_does_not_fit_is_refused() {
    let lagrangian = formula("x_dot^2 + y_dot^2");
    let region = Bounds::uniform(2, (-1.0, 1.0), (-1.0, 1.0));
    let error = |region: &Bounds, options: CertificateOptions| {
        Certificate::of::<_, f64>(&lagrangian, &[], region, &options).unwrap_err()
    };
    let options = CertificateOptions::new(DEFINITE);
    let short = Bounds { velocities: vec![(0.0, 1.0)], ..region.clone() };
    assert_eq!(error(&short, options).to_string(), "expected bounds of 2 velocities, found 1");
    for bad in [(1.0, -1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
        let wrong = Bounds { positions: vec![(0.0, 1.0), bad], ..region.clone() };
        assert!(matches!(error(&wrong, options), CertificateError::Bounds { what: "coordinate", index: 1, .. }));
    }
    let three = CertificateOptions::new(Signature { positive: 2, negative: 1 });
    assert!(matches!(error(&region, three), CertificateError::Signature { expected: 2, .. }));
    for bad in [0.5, f64::NAN] {
        assert!(matches!(
            error(&region, CertificateOptions { condition: Some(bad), ..options }),
            CertificateError::Condition(_)
        ));
    }
    // A point is a region.
    let point = Bounds::uniform(2, (0.5, 0.5), (0.0, 0.0));
    assert_eq!(Certificate::of::<_, f64>(&lagrangian, &[], &point, &options).unwrap().certified, 1.0);
}

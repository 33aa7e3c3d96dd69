//! Relativistic systems: mass shell, signature, the ends of their charts; energy of every system along its motion.

use crate::common::accuracy::{cast, configure, input_conditions, outputs, random_state, recast};
use lnn::lagrangian::{
    self, Bounds, EulerLagrange, Lagrangian, Mechanics, MechanicsError, Request, System, SystemInstance, Terms,
};
use lnn::linalg::{self, Inertia};
use lnn::rollout::{RolloutOptions, rollout};
use lnn::scalar::{Dd, Real, Scalar};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Worst R over every component of every output of a state, and the condition of the acceleration: the largest relative
/// change of a component per relative change of the inputs.
fn hard_point<S: Scalar>(system: &SystemInstance<S>, q: &[S], v: &[S]) -> (f64, f64) {
    let wide: SystemInstance<Dd> = recast(system);
    let found = outputs(&*system.build().unwrap(), q, v);
    let closed = system.exact_acceleration(q, v).unwrap();
    let (q, v): (Vec<Dd>, Vec<Dd>) = (cast(q), cast(v));
    let exact = outputs(&*wide.build().unwrap(), &q, &v);
    let conditions = input_conditions(&wide, &q, &v, &exact);
    let (mut worst, mut condition) = (0f64, 0f64);
    for (((name, a), (_, b)), change) in found.iter().zip(&exact).zip(&conditions) {
        let both = [a, if *name == "acceleration" { &closed } else { a }];
        for (i, (&b, &change)) in b.iter().zip(change).enumerate() {
            let size = b.to_f64().abs();
            for a in both {
                let error = (a[i].cast::<Dd>() - b).to_f64().abs();
                let r = error / (S::epsilon().to_f64() * (change + size)).max(f64::MIN_POSITIVE);
                assert!(
                    r < 30.0,
                    "{} {} {name} {i} at {q:?} {v:?}: R = {r}, condition {}",
                    system.system.name,
                    S::NAME,
                    change / size
                );
                worst = worst.max(r);
            }
            if *name == "acceleration" && size > 0.0 {
                condition = condition.max(change / size);
            }
        }
    }
    (worst, condition)
}

/// Hard points `2^-k`, `k` up to `most`: prints R with the condition and demands `R < 3`.
fn approach<S: Scalar>(name: &str, what: &str, most: i32, state: impl Fn(f64) -> (Vec<f64>, Vec<f64>)) {
    let system = configure::<S>(name, &[]);
    let (mut worst, mut last) = (0f64, 0.0);
    for k in 1..=most {
        let (q, v) = state(2f64.powi(-k));
        let (q, mut v): (Vec<S>, Vec<S>) = (cast(&q), cast(&v));
        system.impose_constraint(&q, &mut v).unwrap();
        let (r, condition) = hard_point(&system, &q, &v);
        (worst, last) = (worst.max(r), condition);
    }
    println!("{name} {} {what} to 2^-{most}: R = {worst:.2}, condition {last:.1e} in the end", S::NAME);
    assert!(worst < 3.0, "{name} {what}: R = {worst}");
}

#[test]
fn the_loss_is_graceful_where_charts_end() {
    // The condition at the horizon grows as 4^k: r'' stays finite, a difference of parts 1/f that change as 1/f^2. Towards
    // the poles, z = 0 and the centre it does not grow at all.
    let horizon = |h: f64| (vec![0.5, 2.0 + h, 1.25, 0.75], vec![0.0, -0.25, 0.03125, 0.0625]);
    approach::<f64>("schwarzschild-geodesic", "horizon", 40, horizon);
    approach::<f32>("schwarzschild-geodesic", "horizon", 18, horizon);
    let pole = |h: f64| (vec![0.5, 7.0, h, 0.75], vec![0.0, -0.25, 0.03125, 0.0625]);
    approach::<f64>("schwarzschild-geodesic", "pole", 200, pole);
    approach::<f32>("schwarzschild-geodesic", "pole", 40, pole);
    let pole = |h: f64| (vec![h, 0.75], vec![0.25, 3.0]);
    approach::<f64>("sphere-geodesic", "pole", 200, pole);
    approach::<f32>("sphere-geodesic", "pole", 40, pole);
    for name in ["ads2-geodesic", "ads3-geodesic", "ads4-geodesic"] {
        let n = configure::<f64>(name, &[]).coordinates;
        let boundary = |h: f64| {
            let (mut q, mut v) = (vec![0.5; n], vec![0.375; n]);
            (q[n - 1], v[n - 1]) = (h, -0.625);
            (q, v)
        };
        approach::<f64>(name, "z = 0", 200, boundary);
        approach::<f32>(name, "z = 0", 30, boundary);
    }
    let centre = |h: f64| (vec![0.75 * h, -0.3125 * h], vec![0.5, 1.25]);
    approach::<f64>("kepler", "centre", 200, centre);
    approach::<f32>("kepler", "centre", 30, centre);
}

#[test]
fn the_loss_is_graceful_towards_the_speed_of_light_and_towards_rest() {
    let place = || vec![0.5, -0.75, 1.25];
    // gamma^2 is the condition.
    for direction in 0..3 {
        let along = |h: f64| {
            let mut v = vec![0.0; 3];
            v[direction] = 1.0 - h;
            (place(), v)
        };
        approach::<f64>("charged-particle", "v -> c along an axis", 40, along);
        approach::<f32>("charged-particle", "v -> c along an axis", 18, along);
    }
    // (2, 3, 6) / 7
    let oblique = |h: f64| (place(), [2.0, 3.0, 6.0].iter().map(|x| (1.0 - h) * x / 7.0).collect());
    approach::<f64>("charged-particle", "v -> c obliquely", 40, oblique);
    approach::<f32>("charged-particle", "v -> c obliquely", 18, oblique);
    let slow = |h: f64| (place(), vec![h, -0.5 * h, 0.75 * h]);
    approach::<f64>("charged-particle", "v -> 0", 100, slow);
    approach::<f32>("charged-particle", "v -> 0", 40, slow);
}

fn speeds_of_light_are_refused_by<S: Scalar>() {
    let system = configure::<S>("charged-particle", &[]).build().unwrap();
    let beyond: [[f64; 3]; 8] = [
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.75, 0.75, 0.0],
        [0.0, 2.0, 0.0],
        [1e18, 0.0, -1e18],
        [f64::INFINITY, 0.0, 0.0],
        [0.0, 0.0, f64::NAN],
    ];
    let q: Vec<S> = cast(&[0.5, -0.75, 1.25]);
    let fine: Vec<S> = cast(&[0.5, 0.25, -0.125]);
    let mut alone = Terms::default();
    system.terms(&q, &fine, Request::ALL, &mut alone).unwrap();
    for v in beyond {
        let v: Vec<S> = cast(&v);
        let mut terms = Terms::default();
        let error = system.terms(&q, &v, Request::ALL, &mut terms).unwrap_err();
        assert!(matches!(error, MechanicsError::NotFinite { row: 0, .. }), "{v:?}: {error}");
        assert!(terms.acceleration.iter().all(|a| a.is_nan()), "{v:?}");
        assert!(
            lagrangian::SystemInstance::named("charged-particle", &[])
                .unwrap()
                .exact_acceleration(&q, &v)
                .unwrap()
                .iter()
                .all(|a| a.is_nan()),
            "{v:?}"
        );
        // In a batch that is replayed it is one row that fails.
        let mut batch = vec![fine.clone(); 40];
        batch[7] = v;
        let error = system.terms(&vec![q.clone(); 40].concat(), &batch.concat(), Request::ALL, &mut terms);
        assert!(matches!(error, Err(MechanicsError::NotFinite { row: 7, .. })), "{error:?}");
        for (row, a) in terms.acceleration.chunks(3).enumerate() {
            let close = |(a, b): (&S, &S)| (*a - *b).to_f64().abs() <= 16.0 * S::epsilon().to_f64();
            assert!(if row == 7 { a.iter().all(|a| a.is_nan()) } else { a.iter().zip(&alone.acceleration).all(close) });
        }
    }
}

#[test]
fn speeds_of_light_are_refused() {
    speeds_of_light_are_refused_by::<f64>();
    speeds_of_light_are_refused_by::<f32>();
    speeds_of_light_are_refused_by::<Dd>();
}

#[test]
fn a_horizon_is_an_error_and_its_inside_is_not() {
    let system = configure::<f64>("schwarzschild-geodesic", &[]);
    let built = system.build().unwrap();
    let (at, v) = ([0.0, 2.0, 1.0, 0.5], [1.0, -0.5, 0.1, 0.2]);
    let mut terms = Terms::default();
    assert!(matches!(built.terms(&at, &v, Request::ALL, &mut terms), Err(MechanicsError::NotFinite { row: 0, .. })));
    assert!(terms.acceleration.iter().all(|a| a.is_nan()));
    let inside = [0.0, 1.5, 1.0, 0.5];
    assert!(system.check_domain(&inside).is_err());
    let (r, _) = hard_point(&system, &inside, &v);
    assert!(r < 3.0, "{r}");
    // No future-directed unit velocity of t exists there for a fall this slow.
    let mut shell = v;
    system.impose_constraint(&inside, &mut shell).unwrap();
    assert!(shell[0].is_nan());
    shell[1] = -2.0;
    system.impose_constraint(&inside, &mut shell).unwrap();
    assert!(shell[0] > 0.0);
}

/// Systems with a mass shell.
fn relativistic() -> impl Iterator<Item = &'static System> {
    lagrangian::System::unconstrained().iter().filter(|s| s.constraint.is_some())
}

fn signatures<S: Scalar>(rng: &mut ChaCha8Rng) {
    for system in lagrangian::System::unconstrained() {
        let configured = configure::<S>(&system.name, &[]);
        let n = configured.coordinates;
        let built = configured.build().unwrap();
        for _ in 0..50 {
            let (q, v) = random_state(&configured, &system.validation(n), rng);
            let mut terms = Terms::default();
            built.terms(&q, &v, Request::MASS_MATRIX | Request::LAGRANGIAN | Request::MOMENTUM, &mut terms).unwrap();
            let mut scratch = vec![S::of_f64(0.0); n * n];
            let negative = usize::from(system.time_like.is_some());
            let expected = Inertia { positive: n - negative, zero: 0, negative };
            assert_eq!(linalg::inertia(n, &terms.mass_matrix, &mut scratch).unwrap(), expected, "{}", system.name);
            if let Some(t) = system.time_like {
                assert!(terms.mass_matrix[t * n + t] < S::of_f64(0.0));
                // On the mass shell 2 L = g(v, v) = -1, a sum of the terms p_i v_i.
                let size: f64 = terms.momentum.iter().zip(&v).map(|(&p, &v)| (p * v).to_f64().abs()).sum();
                let shell = (terms.lagrangian[0] + S::of_f64(0.5)).to_f64().abs();
                assert!(shell <= 8.0 * S::epsilon().to_f64() * size, "{} {}: {shell:e}", system.name, S::NAME);
            }
        }
    }
}

#[test]
fn signatures_are_exact_and_sampled_states_on_the_mass_shell() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    signatures::<f64>(&mut rng);
    signatures::<f32>(&mut rng);
    signatures::<Dd>(&mut rng);
    assert_eq!(relativistic().count(), 8);
}

#[test]
fn energy_and_mass_shell_are_kept_along_the_motion() {
    let mut rng = ChaCha8Rng::seed_from_u64(22);
    for system in lagrangian::System::unconstrained() {
        let configured = configure::<f64>(&system.name, &[]);
        let n = configured.coordinates;
        let test = system.trajectory(n);
        let options = RolloutOptions::reference(test.t_end.min(5.0), test.dt);
        let built = configured.build().unwrap();
        for _ in 0..3 {
            let (q, v) = random_state(&configured, &test.start, &mut rng);
            let run = rollout(&*built, &q, &v, &options);
            assert_eq!(run.stop, None, "{}", system.name);
            let path = &run.trajectory;
            let mut terms = Terms::default();
            built.terms(&path.q, &path.v, Request::ALL, &mut terms).unwrap();
            // Every step leaves the solution by its tolerance: rtol |y| + atol in each component, at most.
            let steps = run.statistics.accepted as f64;
            let tolerance = |k: usize| {
                let part = |x: &[f64]| x[k * n..(k + 1) * n].to_vec();
                let (q, v, p, g) = (part(&path.q), part(&path.v), part(&terms.momentum), part(&terms.dl_dq));
                let mass = &terms.mass_matrix[k * n * n..(k + 1) * n * n];
                let coriolis = part(&terms.coriolis);
                // dE/dv = M v, dE/dq = (d2L/dq dv) v - g, of the size of c and g.
                let slope: f64 = (0..n)
                    .map(|i| {
                        let row: f64 = (0..n).map(|j| (mass[i * n + j] * v[j]).abs()).sum();
                        row * (1.0 + v[i].abs()) + (g[i].abs() + coriolis[i].abs()) * (1.0 + q[i].abs()) + p[i].abs()
                    })
                    .sum();
                steps * options.rtol * slope
            };
            let worst = (0..path.len()).map(tolerance).fold(1e-13, f64::max);
            for (k, &energy) in terms.energy.iter().enumerate() {
                assert!((energy - terms.energy[0]).abs() <= worst, "{} {k}: {energy} {worst:e}", system.name);
                let (q, v) = path.state(k);
                let mut shell = v.to_vec();
                configured.impose_constraint(q, &mut shell).unwrap();
                // d(g(v, v)/2) = p_t dt'.
                let change = shell.iter().zip(v).zip(&terms.momentum[k * n..]).map(|((a, b), p)| ((a - b) * p).abs());
                assert!(change.sum::<f64>() <= worst, "{} {k}: {shell:?} {v:?}", system.name);
            }
        }
    }
}

/// The Kepler problem in polar coordinates.
struct Polar;

impl Lagrangian for Polar {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, parameters: &[R], q: &[R], v: &[R]) -> R {
        R::half() * (v[0].sqr() + (q[0] * v[1]).sqr()) + parameters[0] / q[0]
    }
}

#[test]
fn kepler_moves_alike_in_both_charts() {
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let polar = Mechanics::new(Polar, vec![2.5]);
    let cartesian = configure::<f64>("kepler", &[("mu", "2.5")]).build().unwrap();
    for _ in 0..200 {
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        let (r, angle, r_dot, angle_dot) = (draw(0.1, 3.0), draw(-3.0, 3.0), draw(-2.0, 2.0), draw(-2.0, 2.0));
        let (sin, cos) = angle.sin_cos();
        let turn = |radial: f64, across: f64| [radial * cos - across * sin, radial * sin + across * cos];
        let (q, v) = (turn(r, 0.0), turn(r_dot, r * angle_dot));
        let (mut a, mut b) = (Terms::default(), Terms::default());
        polar.terms(&[r, angle], &[r_dot, angle_dot], Request::ALL, &mut a).unwrap();
        cartesian.terms(&q, &v, Request::ALL, &mut b).unwrap();
        let [a_r, a_angle] = a.acceleration[..] else { panic!("two accelerations") };
        let moved = turn(a_r - r * angle_dot * angle_dot, 2.0 * r_dot * angle_dot + r * a_angle);
        // The terms of the change of chart, and the condition 2 of mu/r^2.
        let size = a_r.abs() + r * angle_dot.powi(2) + (4.0 * r_dot * angle_dot).abs() + (2.0 * r * a_angle).abs();
        for (x, y) in moved.iter().zip(&b.acceleration) {
            assert!((x - y).abs() <= 8.0 * f64::EPSILON * size, "{x} {y} {size}");
        }
        let size = v[0].powi(2) + v[1].powi(2) + 2.5 / r;
        assert!((a.energy[0] - b.energy[0]).abs() <= 8.0 * f64::EPSILON * size);
    }
}

#[test]
fn geodesics_of_anti_de_sitter_space_are_circles() {
    // (t, z) of a start at rest in space: z^2 - t^2 = z0^2, with z = z0 / cos tau and t = z0 tan tau for L = 1.
    let system = configure::<f64>("ads2-geodesic", &[]);
    let q = [0.0, 0.75];
    let mut v = [0.0, 0.0];
    system.impose_constraint(&q, &mut v).unwrap();
    assert_eq!(v, [0.75, 0.0]);
    let options = RolloutOptions::reference(1.25, 0.125);
    let run = rollout(&*system.build().unwrap(), &q, &v, &options);
    assert_eq!((run.stop, run.trajectory.len()), (None, 11));
    for (k, tau) in run.trajectory.t.iter().enumerate() {
        let (q, _) = run.trajectory.state(k);
        // tau -> pi/2 is infinitely far: the condition of both is 1/cos^2 tau.
        let unit = 1e-12 * (run.statistics.accepted as f64) / tau.cos().powi(2);
        assert!((q[0] - 0.75 * tau.tan()).abs() <= unit && (q[1] - 0.75 / tau.cos()).abs() <= unit, "{tau}: {q:?}");
    }
}

#[test]
fn circular_orbits_around_a_black_hole() {
    // phi' = sqrt(M / (r^2 (r - 3 M))), t' = sqrt(r / (r - 3 M)); nothing else moves.
    for r in [6.0, 10.0, 64.0] {
        let system = configure::<f64>("schwarzschild-geodesic", &[]);
        let q = [0.0, r, std::f64::consts::FRAC_PI_2, 0.0];
        let mut v = [0.0, 0.0, 0.0, (1.0 / (r * r * (r - 3.0))).sqrt()];
        system.impose_constraint(&q, &mut v).unwrap();
        assert!((v[0] - (r / (r - 3.0)).sqrt()).abs() < 4.0 * f64::EPSILON * v[0]);
        let a = system.exact_acceleration(&q, &v).unwrap();
        let pull = 1.0 / (r * r);
        assert!(a.iter().all(|a| a.abs() < 8.0 * f64::EPSILON * pull), "{a:?}");
    }
}

#[test]
fn boxes_of_random_states_lie_in_the_domain() {
    let mut rng = ChaCha8Rng::seed_from_u64(24);
    for system in lagrangian::System::unconstrained() {
        let configured = configure::<f64>(&system.name, &[]);
        let n = configured.coordinates;
        for bounds in [system.training(n), system.validation(n), system.trajectory(n).start] {
            let inside = |bounds: &Bounds, rng: &mut ChaCha8Rng| {
                let (q, v) = random_state(&configured, bounds, rng);
                configured.check_domain(&q).is_ok()
                    && configured.exact_acceleration(&q, &v).unwrap().iter().all(|a| a.is_finite())
            };
            assert!((0..200).all(|_| inside(&bounds, &mut rng)), "{}", system.name);
        }
    }
}

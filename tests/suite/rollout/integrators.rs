//! Structure-preserving integrators: order, reversibility, invariants, energy over long times, and how they fail.

use lnn::lagrangian::systems::{DoublePendulum, SpringPendulum};
use lnn::lagrangian::{EulerLagrange, ExpressionLagrangian, Lagrangian, Mechanics, Request, SystemInstance, Terms};
use lnn::rollout::{Domain, Integrator, Rollout, RolloutError, RolloutOptions, rollout, rollout_fixed};
use lnn::scalar::{Dd, Real, Scalar};

const METHODS: [(Integrator, f64); 4] =
    [(Integrator::Midpoint, 2.0), (Integrator::Variational, 2.0), (Integrator::Gauss4, 4.0), (Integrator::Gauss6, 6.0)];

/// `v^2/2 + cos q`.
struct Pendulum;
impl Lagrangian for Pendulum {
    fn coordinates(&self) -> usize {
        1
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        R::half() * v[0].sqr() + q[0].cos()
    }
}

/// `v^2/2 + 1/|q|`.
struct Kepler;
impl Lagrangian for Kepler {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        R::half() * (v[0].sqr() + v[1].sqr()) + (q[0].sqr() + q[1].sqr()).sqrt().recip()
    }
}

/// Henon and Heiles (1964).
struct HenonHeiles;
impl Lagrangian for HenonHeiles {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let (x, y) = (q[0], q[1]);
        let squares = v[0].sqr() + v[1].sqr() - x.sqr() - y.sqr();
        R::half() * squares - x.sqr() * y + y * y.sqr() * R::ratio(1, 3)
    }
}

/// Two unlike bodies on a line, joined by a spring that hardens.
struct Pair;
impl Lagrangian for Pair {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let d = (q[0] - q[1]).sqr();
        R::half() * (v[0].sqr() + R::of(3.0) * v[1].sqr()) - R::half() * d - R::ratio(1, 4) * d.sqr()
    }
}

/// A velocity coupled to both coordinates by a magnetic field and a mass that depends on the place.
struct Magnetic;
impl Lagrangian for Magnetic {
    fn coordinates(&self) -> usize {
        2
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let mass = R::one() + R::half() * q[0].sqr();
        let field = q[0] * v[1] - q[1] * v[0] + q[0].sqr() * v[1];
        R::half() * mass * (v[0].sqr() + v[1].sqr()) + field - R::half() * (q[0].sqr() + q[1].sqr().sqr())
    }
}

fn plain<S: Scalar, L: Lagrangian>(system: L) -> Mechanics<L, S> {
    Mechanics::new(system, Vec::new())
}

fn double_pendulum<S: Scalar>() -> Mechanics<DoublePendulum, S> {
    Mechanics::new(DoublePendulum, SystemInstance::named("double-pendulum", &[]).unwrap().parameters)
}

fn spring_pendulum<S: Scalar>() -> Mechanics<SpringPendulum, S> {
    Mechanics::new(SpringPendulum, SystemInstance::named("spring-pendulum", &[]).unwrap().parameters)
}

fn fixed<S: Scalar>(method: Integrator, t_end: f64, dt: f64, step: f64) -> RolloutOptions<S> {
    let [t_end, dt, step] = [t_end, dt, step].map(S::of_f64);
    RolloutOptions::new(t_end, dt).method(method).step(step).max_steps(usize::MAX)
}

fn done<S: Scalar>(rolled: Rollout<S>) -> Rollout<S> {
    assert_eq!(rolled.stop, None);
    rolled
}

fn end<S: Scalar>(rolled: &Rollout<S>) -> Vec<S> {
    let (q, v) = rolled.trajectory.state(rolled.trajectory.len() - 1);
    [q, v].concat()
}

fn distance<S: Scalar>(a: &[S], b: &[S]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| (a - b).abs().to_f64()).fold(0.0, f64::max)
}

/// What should be zero at `(q, v, t)`.
type Invariant = dyn Fn(&[f64], &[f64], f64) -> f64;
/// Slope of the straight line closest to the points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let products: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    products / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// Largest error of the energy relative to the first, over the whole run and over its last tenth against its first.
fn energy_errors<S: Scalar>(rolled: &Rollout<S>) -> (f64, f64) {
    let energy = rolled.trajectory.energy.as_ref().unwrap();
    let errors: Vec<f64> = energy.iter().map(|&e| (e - energy[0]).abs().to_f64()).collect();
    let most = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    let tenth = errors.len() / 10;
    (most(&errors), most(&errors[errors.len() - tenth..]) / most(&errors[..tenth]))
}

type Boxed<S> = Box<dyn EulerLagrange<S>>;

fn system<S: Scalar>(name: &str) -> Boxed<S> {
    match name {
        "pendulum" => Box::new(plain::<S, _>(Pendulum)),
        "Kepler" => Box::new(plain::<S, _>(Kepler)),
        "magnetic" => Box::new(plain::<S, _>(Magnetic)),
        "double pendulum" => Box::new(double_pendulum::<S>()),
        _ => Box::new(spring_pendulum::<S>()),
    }
}

/// In double-double, where order 6 has room for three decades; the reference is checked by Dop853 at 1e-12.
#[test]
fn measured_orders_are_the_theoretical_ones() {
    let systems: [(&str, &[f64], f64); 5] = [
        ("pendulum", &[1.0, 0.5], 1.0),
        ("Kepler", &[1.0, 0.0, 0.0, 1.1], 1.0),
        ("magnetic", &[0.5, -0.3, 0.2, 0.7], 1.0),
        ("double pendulum", &[0.5, 0.3, 0.2, -0.1], 0.5),
        ("spring pendulum", &[1.2, 0.5, 0.1, 0.4], 0.5),
    ];
    for (name, start, scale) in systems {
        let t_end = 2.0 * scale;
        let n = start.len() / 2;
        let model = system::<Dd>(name);
        let wide: Vec<Dd> = start.iter().map(|&x| Dd::of_f64(x)).collect();
        let run =
            |method, h| end(&done(rollout_fixed(&*model, &wide[..n], &wide[n..], &fixed(method, t_end, t_end, h))));
        let exact = run(Integrator::Gauss6, 0.1 * scale / 32.0);
        let reference = RolloutOptions::reference(t_end, t_end);
        let independent = end(&done(rollout(&*system::<f64>(name), &start[..n], &start[n..], &reference)));
        let narrow: Vec<f64> = exact.iter().map(|x| x.to_f64()).collect();
        assert!(distance(&narrow, &independent) < 1e-10, "{name}: {:e}", distance(&narrow, &independent));
        for (method, order) in METHODS {
            let (first, halvings) = match order as u32 {
                2 => (0.02, 5),
                4 => (0.05, 3),
                _ => (0.1, 2),
            };
            let points: Vec<(f64, f64)> = (0..=halvings)
                .map(|k| {
                    let h = first * scale / f64::from(1 << k);
                    (h.ln(), distance(&run(method, h), &exact).ln())
                })
                .collect();
            let measured = slope(&points);
            let least = points[points.len() - 1].1;
            let decades = (points[0].1 - least) / 10f64.ln();
            println!("{name} {method:?}: {measured:.3} over {decades:.1} decades to {:.1e}", least.exp());
            assert!((measured - order).abs() < 0.1, "{name} {method:?}: {measured}");
            assert!(decades > 2.9, "{name} {method:?}: {decades}");
        }
    }
}

#[test]
fn reversible_to_rounding() {
    let model = double_pendulum::<f64>();
    for (method, _) in METHODS {
        let (q, v) = ([0.5, -0.4], [0.3, 0.8]);
        let there = end(&done(rollout(&model, &q, &v, &fixed(method, 10.0, 1.0, 0.01))));
        let back = fixed(method, 0.0, 1.0, 0.01).t0(10.0);
        let start = end(&done(rollout(&model, &there[..2], &there[2..], &back)));
        let error = distance(&start, &[q, v].concat());
        assert!(error < 1e-12, "{method:?}: {error:e}");
    }
}

#[test]
fn the_variational_integrator_is_the_midpoint_rule() {
    let model = plain::<f64, _>(Magnetic);
    let run = |method| done(rollout(&model, &[0.5, -0.3], &[0.2, 0.7], &fixed(method, 50.0, 1.0, 0.05)));
    let (one, other) = (run(Integrator::Midpoint), run(Integrator::Variational));
    assert!(distance(&one.trajectory.q, &other.trajectory.q) < 1e-12);
    assert!(distance(&one.trajectory.v, &other.trajectory.v) < 1e-12);
}

#[test]
fn linear_and_quadratic_invariants_are_kept() {
    for (method, _) in METHODS {
        let pair = plain::<f64, _>(Pair);
        let rolled = done(rollout(&pair, &[0.7, -0.2], &[0.4, 0.1], &fixed(method, 1000.0, 1.0, 0.05)));
        let worst = |f: &Invariant, rolled: &Rollout<f64>| {
            let states = (0..rolled.trajectory.len()).map(|k| {
                let (q, v) = rolled.trajectory.state(k);
                f(q, v, rolled.trajectory.t[k])
            });
            states.map(f64::abs).fold(0.0, f64::max)
        };
        // Momentum 0.7, centre of mass 0.1 / 4 + 0.7 t / 4; a compensated sum leaves rounding of the state alone.
        let momentum = worst(&|_, v, _| v[0] + 3.0 * v[1] - 0.7, &rolled);
        assert!(momentum < 20.0 * f64::EPSILON, "{method:?}: {momentum:e}");
        let centre = worst(&|q, _, t| (q[0] + 3.0 * q[1] - 0.1 - 0.7 * t) / (1.0 + t), &rolled);
        assert!(centre < 20.0 * f64::EPSILON, "{method:?}: {centre:e}");

        let kepler = plain::<f64, _>(Kepler);
        let rolled = done(rollout(&kepler, &[1.0, 0.0], &[0.0, 1.1], &fixed(method, 1000.0, 1.0, 0.05)));
        let angular = worst(&|q, v, _| q[0] * v[1] - q[1] * v[0] - 1.1, &rolled);
        assert!(angular < 100.0 * f64::EPSILON, "{method:?}: {angular:e}");
    }
}

/// Classical Runge-Kutta steps: the largest energy error in the first and the last tenth.
fn runge_kutta(model: &dyn EulerLagrange<f64>, start: &[f64], h: f64, steps: usize) -> (f64, f64) {
    let n = start.len() / 2;
    let mut terms = Terms::default();
    let slope = |y: &[f64], terms: &mut Terms<f64>| {
        model.terms(&y[..n], &y[n..], Request::ACCELERATION, terms).unwrap();
        [&y[n..], &terms.acceleration].concat()
    };
    let energy = |y: &[f64], terms: &mut Terms<f64>| {
        model.terms(&y[..n], &y[n..], Request::ENERGY, terms).unwrap();
        terms.energy[0]
    };
    let shifted = |y: &[f64], d: &[f64], h: f64| y.iter().zip(d).map(|(y, d)| y + h * d).collect::<Vec<f64>>();
    let mut y = start.to_vec();
    let begun = energy(&y, &mut terms);
    let (mut first, mut last) = (0.0_f64, 0.0_f64);
    for step in 0..steps {
        let k1 = slope(&y, &mut terms);
        let k2 = slope(&shifted(&y, &k1, 0.5 * h), &mut terms);
        let k3 = slope(&shifted(&y, &k2, 0.5 * h), &mut terms);
        let k4 = slope(&shifted(&y, &k3, h), &mut terms);
        for (i, y) in y.iter_mut().enumerate() {
            *y += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
        let error = (energy(&y, &mut terms) - begun).abs();
        if step < steps / 10 {
            first = first.max(error);
        } else if step >= steps - steps / 10 {
            last = last.max(error);
        }
    }
    (first, last)
}

/// Gauss collocation with two stages on `(q, v)`, to show why the library works in `(q, p)`.
fn gauss4_on_velocities(model: &dyn EulerLagrange<f64>, start: &[f64], h: f64, steps: usize) -> (f64, f64) {
    let n = start.len() / 2;
    let x = 3f64.sqrt() / 6.0;
    let a = [[0.25, 0.25 - x], [0.25 + x, 0.25]];
    let mut terms = Terms::default();
    let mut y = start.to_vec();
    let mut slopes = vec![vec![0.0; 2 * n]; 2];
    let energy = |y: &[f64], terms: &mut Terms<f64>| {
        model.terms(&y[..n], &y[n..], Request::ENERGY, terms).unwrap();
        terms.energy[0]
    };
    let begun = energy(&y, &mut terms);
    let (mut first, mut last) = (0.0_f64, 0.0_f64);
    for step in 0..steps {
        for _ in 0..40 {
            let before = slopes.clone();
            for i in 0..2 {
                let stage: Vec<f64> =
                    (0..2 * n).map(|k| y[k] + h * (a[i][0] * before[0][k] + a[i][1] * before[1][k])).collect();
                model.terms(&stage[..n], &stage[n..], Request::ACCELERATION, &mut terms).unwrap();
                slopes[i] = [&stage[n..], &terms.acceleration].concat();
            }
            if distance(&before.concat(), &slopes.concat()) < 1e-13 {
                break;
            }
        }
        for k in 0..2 * n {
            y[k] += 0.5 * h * (slopes[0][k] + slopes[1][k]);
        }
        let error = (energy(&y, &mut terms) - begun).abs();
        if step < steps / 10 {
            first = first.max(error);
        } else if step >= steps - steps / 10 {
            last = last.max(error);
        }
    }
    (first, last)
}

const REGULAR: [f64; 4] = [0.5, 0.3, 0.0, 0.0];
const CHAOTIC: [f64; 4] = [2.0, 2.5, 0.0, 0.0];

#[test]
fn energy_error_is_bounded_where_runge_kutta_drifts() {
    let model = double_pendulum::<f64>();
    // 10^5 steps each.
    let (first, last) = runge_kutta(&model, &REGULAR, 0.02, 100_000);
    assert!(last > 5.0 * first, "{first:e} {last:e}");
    for (method, bound) in [
        (Integrator::Midpoint, 1e-2),
        (Integrator::Variational, 1e-2),
        (Integrator::Gauss4, 1e-5),
        (Integrator::Gauss6, 1e-8),
    ] {
        let rolled = done(rollout(&model, &REGULAR[..2], &REGULAR[2..], &fixed(method, 2000.0, 0.1, 0.02)));
        assert_eq!(rolled.statistics.accepted, 100_000);
        let (worst, growth) = energy_errors(&rolled);
        println!("{method:?}: {worst:e}, last tenth over first {growth}; {:?}", rolled.statistics);
        assert!(worst < bound, "{method:?}: {worst:e}");
        assert!(growth < 1.5, "{method:?}: {growth}");
    }
    let chaotic = done(rollout(&model, &CHAOTIC[..2], &CHAOTIC[2..], &fixed(Integrator::Gauss4, 500.0, 0.1, 0.005)));
    let (worst, growth) = energy_errors(&chaotic);
    assert!(worst < 1e-4 && growth < 5.0, "{worst:e} {growth}");
}

/// Root mean square over `starts` of the energy error at growing times, and the exponent of its growth.
fn trend(h: f64, steps: usize, starts: usize) -> (Vec<(f64, f64)>, f64) {
    let model = plain::<f64, _>(HenonHeiles);
    let t_end = h * steps as f64;
    let mut squares: Vec<f64> = Vec::new();
    let mut times = Vec::new();
    for k in 0..starts {
        let y = 0.1 + 0.013 * k as f64;
        let rolled =
            done(rollout(&model, &[0.0, y], &[0.2, 0.03], &fixed(Integrator::Gauss6, t_end, t_end / 1024.0, h)));
        // In double-double, so that rounding the energy itself does not count.
        let energy = rolled.trajectory.cast::<Dd>().energy_by(&plain::<Dd, _>(HenonHeiles));
        squares.resize(energy.len(), 0.0);
        squares.iter_mut().zip(&energy).for_each(|(s, &e)| *s += ((e - energy[0]) / energy[0]).to_f64().powi(2));
        times.clone_from(&rolled.trajectory.t);
    }
    let mut points = Vec::new();
    let mut from = 8;
    while from < 1024 {
        // Mean over an octave of time.
        let octave = from..2 * from;
        let mean = squares[octave.clone()].iter().sum::<f64>() / (octave.len() * starts) as f64;
        points.push((times[from] * 1.5, mean.sqrt()));
        from *= 2;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|p| (p.0.ln(), p.1.ln())).collect();
    (points, slope(&logs))
}

#[test]
fn rounding_errors_of_the_energy_walk_at_random() {
    let (points, exponent) = trend(0.0125, 100_000, 8);
    println!("{points:?} {exponent}");
    assert!(exponent < 0.7, "{exponent} {points:?}");
    assert!(points.last().unwrap().1 < 1e-13, "{points:?}");
}

#[test]
#[ignore = "ten million steps"]
fn rounding_errors_of_the_energy_over_a_million_steps() {
    let (points, exponent) = trend(0.0125, 1_000_000, 10);
    println!("Henon-Heiles, gauss6, h = 0.0125, 10^6 steps, 10 starts: exponent {exponent:.3}");
    points.iter().for_each(|(t, error)| println!("{t:10.1} {error:.2e}"));
    assert!(exponent < 0.7, "{exponent}");
}

#[test]
fn every_precision() {
    fn error<S: Scalar>(method: Integrator, h: f64) -> f64 {
        let start = [S::of_f64(1.0), S::of_f64(0.5)];
        let model = plain::<S, _>(Pendulum);
        energy_errors(&done(rollout_fixed(&model, &start[..1], &start[1..], &fixed(method, 20.0, 1.0, h)))).0
    }
    for (method, _) in METHODS {
        assert!(error::<f32>(method, 0.0625) < 1e-3, "{method:?}");
    }
    assert!(error::<f32>(Integrator::Gauss6, 0.0625) < 1e-6);
    // Order 6 below the rounding of f64: two halvings bring 4096.
    let (coarse, fine) = (error::<Dd>(Integrator::Gauss6, 1.0 / 64.0), error::<Dd>(Integrator::Gauss6, 1.0 / 256.0));
    assert!((coarse / fine).log2() > 11.5 && fine < 1e-17, "{coarse:e} {fine:e}");
    let adaptive = rollout_fixed(
        &plain::<Dd, _>(Pendulum),
        &[Dd::of_f64(1.0)],
        &[Dd::of_f64(0.0)],
        &RolloutOptions::new(Dd::of_f64(1.0), Dd::of_f64(0.5)),
    );
    assert!(matches!(adaptive.stop, Some(RolloutError::Invalid { what: "method", .. })));
}

#[test]
fn failures_are_typed_and_keep_what_was_reached() {
    for (method, _) in METHODS {
        let model = double_pendulum::<f64>();
        let far = rollout(&model, &CHAOTIC[..2], &[9.0, -9.0], &fixed(method, 1e5, 1e3, 1e3));
        let Some(RolloutError::NotConverged { t, .. }) = far.stop else { panic!("{method:?} {:?}", far.stop) };
        assert_eq!(far.trajectory.len(), 1 + (t / 1e3) as usize);

        let kepler = plain::<f64, _>(Kepler);
        let domain = Some(Domain::new(vec![Some((-0.5, 2.0)), None, None, None]));
        let options = fixed(method, 10.0, 0.1, 0.01).domain(domain);
        let left = rollout(&kepler, &[1.0, 0.0], &[0.0, 1.0], &options);
        let Some(RolloutError::LeftDomain { t, component: 0, .. }) = left.stop else { panic!("{:?}", left.stop) };
        assert!((t - (2.0 * std::f64::consts::PI / 3.0)).abs() < 0.011, "{t}");
        assert!((*left.trajectory.t.last().unwrap() - 2.0).abs() < 1e-12);

        let few = rollout(&kepler, &[1.0, 0.0], &[0.0, 1.0], &fixed(method, 10.0, 0.1, 0.01).max_steps(25));
        // Known before the first.
        assert!(matches!(few.stop, Some(RolloutError::Invalid { what: "step", .. })), "{:?}", few.stop);
        assert_eq!((few.trajectory.len(), few.statistics.accepted), (0, 0));

        // Head-on into the singularity.
        let fall = rollout(&kepler, &[1.0, 0.0], &[0.0, 0.0], &fixed(method, 10.0, 0.1, 0.01));
        assert!(fall.trajectory.q.iter().all(|x| x.is_finite()));

        // Velocity appears linearly: no mass.
        struct Massless;
        impl Lagrangian for Massless {
            fn coordinates(&self) -> usize {
                1
            }
            fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
                v[0] - q[0].sqr() + v[0].sqr() * R::zero()
            }
        }
        let massless = rollout(&plain::<f64, _>(Massless), &[1.0], &[0.0], &fixed(method, 1.0, 0.1, 0.1));
        assert!(massless.stop.is_some(), "{method:?}");
    }
}

/// The figures of the head of `gauss.rs`, over a tenth of their time.
#[test]
fn collocation_on_momenta_is_no_worse_than_on_velocities() {
    let models: [(Boxed<f64>, [f64; 4], f64); 2] =
        [(system("double pendulum"), [0.5, 0.3, 1.0, -0.4], 2.0), (system("magnetic"), [0.5, -0.3, 0.2, 0.7], 1.0)];
    for (model, start, ratio) in models {
        let h = 0.05;
        let (first, last) = gauss4_on_velocities(&*model, &start, h, (1000.0 / h) as usize);
        let rolled = done(rollout(&*model, &start[..2], &start[2..], &fixed(Integrator::Gauss4, 1000.0, h, h)));
        let energy = rolled.trajectory.energy.as_ref().unwrap();
        let most = |part: &[f64]| part.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max);
        let tenth = energy.len() / 10;
        let (early, late) = (most(&energy[..tenth]), most(&energy[energy.len() - tenth..]));
        assert!(late < 1.2 * early && last < 1.2 * first, "{early:e} {late:e} {first:e} {last:e}");
        assert!(late < ratio * last, "{late:e} {last:e}");
    }
}

/// Two masses on a spring that is a million times as stiff as what holds them: its force is the rounding of their places times its constant.
#[test]
fn stiff_springs_end_the_iteration_at_the_rounding_of_places() {
    let formula = "(x_dot^2 + y_dot^2)/2 - k*(x - y)^2/2 - x^2/2";
    let lagrangian = |k: f64| Mechanics::new(ExpressionLagrangian::new(&["x", "y"], &["k"], formula).unwrap(), [k]);
    // Both move as one of twice the mass, but for a millionth.
    let exact = |t: f64| (t / 2f64.sqrt()).cos();
    for (method, order) in METHODS {
        for step in [0.01, 0.05, 0.2, 1.0] {
            for k in [1e4, 1e6, 1e8] {
                let options = RolloutOptions::new(10.0, step).method(method);
                let motion = rollout(&lagrangian(k), &[1.0, 1.0], &[0.0, 0.0], &options);
                assert!(motion.stop.is_none(), "{method:?} {step} {k}: {:?}", motion.stop);
                let x = motion.trajectory.q[2 * motion.trajectory.len() - 2];
                let error = (x - exact(10.0)).abs();
                assert!(error < 10.0 * step.powf(order) * 0.1 + 2e-4, "{method:?} {step} {k}: {error}");
            }
        }
    }
    let options = RolloutOptions::new(10.0, 0.01).method(Integrator::Gauss6);
    let motion = rollout(&lagrangian(1e6), &[1.0, 1.0], &[0.0, 0.0], &options).complete().unwrap();
    assert!((motion.q[2000] - 0.705_347_906_3).abs() < 1e-6, "{}", motion.q[2000]);
}

/// `max(0, -y)^1.5` has an infinite second derivative where it does not act, which no acceleration asks for.
#[test]
fn second_derivatives_that_nothing_needs_are_not_taken() {
    let formula = "(y_dot^2 + x_dot^2)/2 - 9.81*y - 1000*max(0, -y)^1.5";
    let soft = Mechanics::<_, f64>::new(ExpressionLagrangian::new(&["x", "y"], &[], formula).unwrap(), []);
    for method in Integrator::ALL {
        let options = RolloutOptions::new(0.3, 0.01).method(method);
        let motion = rollout(&soft, &[0.0, 1.0], &[0.0, 0.0], &options).complete().unwrap();
        let y = motion.q[2 * 30 + 1];
        assert!((y - (1.0 - 9.81 * 0.3 * 0.3 / 2.0)).abs() < 1e-6, "{method:?}: {y}");
    }
    // It bounces, and many states at once are evaluated as one is.
    let options = RolloutOptions::reference(1.0, 0.01);
    let motion = rollout(&soft, &[0.0, 1.0], &[0.0, 0.0], &options).complete().unwrap();
    assert!(motion.q.iter().skip(1).step_by(2).any(|y| *y < -0.01));
    let (mut all, mut one) = (Terms::default(), Terms::default());
    soft.terms(&motion.q, &motion.v, Request::ALL, &mut all).unwrap();
    for (k, (q, v)) in motion.q.chunks(2).zip(motion.v.chunks(2)).enumerate() {
        soft.terms(q, v, Request::ALL, &mut one).unwrap();
        assert!((one.acceleration[1] - all.acceleration[2 * k + 1]).abs() < 1e-9, "{k}");
    }
    // More coordinates than forward numbers serve.
    let names = ["a", "b", "c", "d", "y"];
    let formula = "(a_dot^2 + b_dot^2 + c_dot^2 + d_dot^2 + y_dot^2)/2 - 9.81*y - 1000*max(0, -y)^1.5";
    let many = Mechanics::<_, f64>::new(ExpressionLagrangian::new(&names, &[], formula).unwrap(), []);
    let mut terms = Terms::default();
    many.terms(&[0.0, 0.0, 0.0, 0.0, 1.0], &[1.0; 5], Request::ALL, &mut terms).unwrap();
    assert_eq!(terms.acceleration[4], -9.81);
}

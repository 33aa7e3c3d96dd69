//! Motion under constraints, judged by generalized coordinates and closed forms.

use lnn::forward::{Dual, HyperDual};
use lnn::lagrangian::{
    Constrained, ConstraintError, Constraints, EulerLagrange, ExpressionConstraints, ExpressionLagrangian, Lagrangian,
    LeastNorm, ManifoldRows, Mechanics, MechanicsError, ReducedMass, Request, SystemInstance, Terms, WithForces,
    constrained_systems, project,
};
use lnn::scalar::{Dd, Real, Scalar};

/// Cartesian coordinates as functions of generalized ones.
trait Embedding: Copy + Send + Sync {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R>;
}

/// The Lagrangian of Cartesian coordinates as one of the generalized coordinates.
struct Pulled<E> {
    embedding: E,
    free: usize,
    cartesian: ExpressionLagrangian,
}

impl<E: Embedding> Lagrangian for Pulled<E> {
    fn coordinates(&self) -> usize {
        self.free
    }
    fn lagrangian<R: Real>(&self, p: &[R], q: &[R], v: &[R]) -> R {
        let q: Vec<Dual<R>> = q.iter().zip(v).map(|(&q, &v)| Dual::new(q, v)).collect();
        let moved = self.embedding.place(&q);
        let [x, u] = [moved.iter().map(|x| x.value).collect::<Vec<_>>(), moved.iter().map(|x| x.tangent).collect()];
        self.cartesian.lagrangian(p, &x, &u)
    }
}

/// The Lagrangian of a system of the catalogue without its constraints.
fn free_lagrangian<S: Scalar>(system: &SystemInstance<S>) -> ExpressionLagrangian {
    let names = system.system.coordinates(system.coordinates);
    let names: Vec<&str> = names.iter().map(|c| c.name.as_ref()).collect();
    let symbols: Vec<&str> = system.system.parameters.iter().map(|p| p.symbol.as_ref()).collect();
    let text = system.system.description().unwrap().lagrangian.clone().unwrap();
    ExpressionLagrangian::new(&names, &symbols, &text).unwrap()
}

fn cast<S: Scalar>(x: &[f64]) -> Vec<S> {
    x.iter().map(|&x| S::of_f64(x)).collect()
}

/// Acceleration in Cartesian coordinates by the constraints, and by the generalized coordinates.
fn both<S: Scalar, E: Embedding>(name: &str, embedding: E, q: &[f64], v: &[f64]) -> [Vec<S>; 2] {
    let system = SystemInstance::<S>::named(name, &[]).unwrap();
    let (q, v): (Vec<S>, Vec<S>) = (cast(q), cast(v));
    let cartesian = free_lagrangian(&system);
    let generalized = Mechanics::new(Pulled { embedding, free: q.len(), cartesian }, system.parameters.clone());
    let a = generalized.acceleration(&q, &v).unwrap();
    let zero = <S as Real>::zero();
    let along: Vec<HyperDual<S>> = (0..q.len()).map(|i| HyperDual::new(q[i], v[i], v[i], a[i])).collect();
    // x(q(t)): velocity x' v, acceleration x''[v, v] + x' a.
    let moved = embedding.place(&along);
    let x: Vec<S> = moved.iter().map(|x| x.value).collect();
    let u: Vec<S> = moved.iter().map(|x| x.s).collect();
    let expected: Vec<S> = moved.iter().map(|x| x.st).collect();
    let model = system.build().unwrap();
    let mut terms = Terms::default();
    model.terms(&x, &u, Request::ALL, &mut terms).unwrap();
    // M a = g - c + A^T lambda.
    let n = x.len();
    for i in 0..n {
        let inertia = (0..n).fold(zero, |sum, j| sum + terms.mass_matrix[i * n + j] * terms.acceleration[j]);
        let force = terms.dl_dq[i] - terms.coriolis[i] + terms.constraint_force[i];
        let size = largest(&terms.constraint_force) + largest(&terms.dl_dq);
        assert!((inertia - force).abs() <= S::epsilon() * S::of_f64(1e4) * size, "{name}: {inertia} {force}");
    }
    [terms.acceleration, expected]
}

fn largest<S: Scalar>(x: &[S]) -> S {
    x.iter().fold(<S as Real>::zero(), |most, x| Real::max(most, x.abs()))
}

/// In double-double, double and single precision, to so many roundings.
fn judge<E: Embedding>(name: &str, embedding: E, q: &[f64], v: &[f64]) {
    fn off<S: Scalar, E: Embedding>(name: &str, embedding: E, q: &[f64], v: &[f64]) -> f64 {
        let [a, b] = both::<S, E>(name, embedding, q, v);
        let difference: Vec<S> = a.iter().zip(&b).map(|(&a, &b)| a - b).collect();
        (largest(&difference) / (largest(&b) * S::epsilon())).to_f64()
    }
    let found = [
        off::<f32, E>(name, embedding, q, v),
        off::<f64, E>(name, embedding, q, v),
        off::<Dd, E>(name, embedding, q, v),
    ];
    assert!(found.iter().all(|off| *off < 2e4), "{name}: {found:?} roundings");
}

#[derive(Clone, Copy)]
struct Chain;
impl Embedding for Chain {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R> {
        let (mut x, mut y, mut places) = (R::zero(), R::zero(), Vec::new());
        for q in q {
            (x, y) = (x + q.sin(), y - q.cos());
            places.extend([x, y]);
        }
        places
    }
}

#[derive(Clone, Copy)]
struct Ball([f64; 3]);
impl Embedding for Ball {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R> {
        let [a, b, c] = self.0.map(R::of);
        vec![a * q[0].sin() * q[1].cos(), b * q[0].sin() * q[1].sin(), c * q[0].cos()]
    }
}

#[derive(Clone, Copy)]
struct Ellipse;
impl Embedding for Ellipse {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R> {
        vec![R::two() * q[0].cos(), q[0].sin()]
    }
}

#[derive(Clone, Copy)]
struct Torus;
impl Embedding for Torus {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R> {
        // The default of the tube, as the decimal it is.
        let tube = R::constant(R::Scalar::parse("0.4").unwrap());
        let ring = R::one() + tube * q[1].cos();
        vec![ring * q[0].cos(), ring * q[0].sin(), tube * q[1].sin()]
    }
}

/// Euler's angles.
#[derive(Clone, Copy)]
struct Turned;
impl Embedding for Turned {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R> {
        let [(sf, cf), (st, ct), (sp, cp)] = [q[0].sin_cos(), q[1].sin_cos(), q[2].sin_cos()];
        vec![
            cf * cp - sf * ct * sp,
            -cf * sp - sf * ct * cp,
            sf * st,
            sf * cp + cf * ct * sp,
            -sf * sp + cf * ct * cp,
            -cf * st,
            st * sp,
            st * cp,
            ct,
        ]
    }
}

/// The linkage by the angle of its crank: the rocker's joint is where two circles meet.
#[derive(Clone, Copy)]
struct Crank;
impl Embedding for Crank {
    fn place<R: Real>(&self, q: &[R]) -> Vec<R> {
        let [b, c, d] = [2.5, 2.0, 3.0].map(R::of);
        let (x, y) = (q[0].cos(), q[0].sin());
        let (dx, dy) = (d - x, -y);
        let square = dx.sqr() + dy.sqr();
        let along = (square + b.sqr() - c.sqr()) / (R::two() * square);
        let across = (b.sqr() / square - along.sqr()).sqrt();
        vec![x, y, x + along * dx - across * dy, y + along * dy + across * dx]
    }
}

#[test]
fn motion_is_that_of_generalized_coordinates() {
    judge("cartesian-chain-1", Chain, &[0.7], &[1.3]);
    judge("cartesian-chain-3", Chain, &[0.7, -1.1, 2.9], &[1.3, -0.4, 2.0]);
    let angles: Vec<f64> = (0..20).map(|k| f64::from(k * k % 7) - 3.0).collect();
    judge("cartesian-chain-20", Chain, &angles, &angles);
    judge("particle-on-sphere", Ball([1.0; 3]), &[1.1, 0.4], &[0.7, -1.2]);
    judge("particle-on-ellipse", Ellipse, &[0.9], &[1.7]);
    judge("particle-on-torus", Torus, &[0.9, 2.0], &[1.7, -0.6]);
    judge("rigid-body", Turned, &[0.3, 1.1, -0.8], &[1.0, 0.5, -2.0]);
    judge("heavy-top", Turned, &[0.3, 1.1, -0.8], &[1.0, 0.5, -2.0]);
    judge("four-bar-linkage", Crank, &[1.9], &[1.4]);
    // Axes that every precision has.
    struct Ellipsoid;
    impl Constraints for Ellipsoid {
        fn coordinates(&self) -> usize {
            3
        }
        fn names(&self) -> Vec<String> {
            vec!["surface".into()]
        }
        fn is_holonomic(&self, _: usize) -> bool {
            true
        }
        fn values<R: Real>(&self, _: &[R], q: &[R], _: &[R], values: &mut [R]) {
            values[0] = q[0].sqr() + (q[1] * R::two()).sqr() + (q[2] * R::of(4.0)).sqr() - R::one();
        }
    }
    let free =
        || ExpressionLagrangian::new(&["x", "y", "z"], &[], "(x_dot^2 + y_dot^2 + z_dot^2)/2 + x*y - z").unwrap();
    let model = Constrained::new(Mechanics::new(free(), []), Ellipsoid, []).unwrap();
    let embedding = Ball([1.0, 0.5, 0.25]);
    let (q, v) = ([1.1, 0.4], [0.7, -1.2]);
    let pulled = Mechanics::<_, f64>::new(Pulled { embedding, free: 2, cartesian: free() }, []);
    let a = pulled.acceleration(&q, &v).unwrap();
    let moved = embedding.place(&[0, 1].map(|i| HyperDual::new(q[i], v[i], v[i], a[i])));
    let part = |of: fn(&HyperDual<f64>) -> f64| moved.iter().map(of).collect::<Vec<_>>();
    let found = model.acceleration(&part(|x| x.value), &part(|x| x.s)).unwrap();
    let off = found.iter().zip(part(|x| x.st)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-13, "{off:e}");
}

#[test]
fn wheels_and_blades_move_as_their_closed_forms() {
    // The sleigh: u' = a w^2, w' = -m a u w / (I + m a^2).
    let model = SystemInstance::<f64>::named("chaplygin-sleigh", &[]).unwrap().build().unwrap();
    let (theta, u, w) = (0.8f64, 1.7, -1.1);
    let (a, m, i) = (0.3, 1.0, 0.2);
    let (s, c) = theta.sin_cos();
    let found = model.acceleration(&[0.5, -0.2, theta], &[u * c, u * s, w]).unwrap();
    let (du, dw) = (a * w * w, -m * a * u * w / (i + m * a * a));
    for (found, exact) in found.iter().zip([du * c - u * w * s, du * s + u * w * c, dw]) {
        assert!((found - exact).abs() < 1e-14, "{found} {exact}");
    }
    // The disk: rates of heading and rolling stay, the centre runs on a circle.
    let model = SystemInstance::<f64>::named("rolling-disk", &[]).unwrap().build().unwrap();
    let (turn, roll, r) = (0.9, 2.3, 0.5);
    let found = model.acceleration(&[0.1, 0.2, theta, 0.3], &[r * roll * c, r * roll * s, turn, roll]).unwrap();
    for (found, exact) in found.iter().zip([-r * roll * turn * s, r * roll * turn * c, 0.0, 0.0]) {
        assert!((found - exact).abs() < 1e-14, "{found} {exact}");
    }
}

/// `d2x/dt2 = (x'' - x' t''/t') / t'^2` of a geodesic by its proper time; the mass matrix by the clock is singular without the clock.
#[test]
fn geodesics_by_a_clock_are_those_by_proper_time() {
    for (clock, proper, q, v) in [
        ("schwarzschild-by-clock", "schwarzschild-geodesic", [0.3, 7.0, 1.2, 0.4], [1.0, 0.1, 0.02, -0.03]),
        ("ads4-by-clock", "ads4-geodesic", [0.3, 0.5, -0.2, 1.4], [1.0, 0.1, 0.3, -0.2]),
    ] {
        let system = SystemInstance::<f64>::named(clock, &[]).unwrap();
        let found = system.build().unwrap().acceleration(&q, &v).unwrap();
        let geodesic = SystemInstance::<f64>::named(proper, &[]).unwrap();
        // Proportional to (1, dx/dt) on the mass shell, g(v, v) = 2 L = -1.
        let metric = geodesic.build().unwrap();
        let mut terms = Terms::default();
        metric.terms(&q, &v, Request::LAGRANGIAN, &mut terms).unwrap();
        let scale = (-2.0 * terms.lagrangian[0]).sqrt().recip();
        let u = v.map(|v| v * scale);
        let a = geodesic.exact_acceleration(&q, &u).unwrap();
        for i in 0..4 {
            let exact = (a[i] - v[i] * a[0]) / (u[0] * u[0]);
            assert!((found[i] - exact).abs() < 1e-13, "{clock} {i}: {} {exact}", found[i]);
        }
        let free = Mechanics::new(free_lagrangian(&system), system.parameters.clone());
        free.terms(&q, &v, Request::MASS_MATRIX, &mut terms).unwrap();
        let whole = ReducedMass::of(4, &terms.mass_matrix, &[]).unwrap();
        let null = whole.null_directions();
        assert_eq!(null.len(), 1);
        // The one that is open is along the velocity.
        let (along, size) = (null[0], v.iter().map(|v| v * v).sum::<f64>().sqrt());
        let cosine: f64 = along.iter().zip(v).map(|(a, v)| a * v).sum::<f64>() / size;
        assert!((cosine.abs() - 1.0).abs() < 1e-12);
        assert_eq!(ReducedMass::of(4, &terms.mass_matrix, &[1.0, 0.0, 0.0, 0.0]).unwrap().null_directions().len(), 0);
    }
}

#[test]
fn batches_and_forces_are_those_of_single_states() {
    let system = SystemInstance::<f64>::named("cartesian-chain-2", &[]).unwrap();
    let model = system.build().unwrap();
    let angles = [[0.3, 1.0, -0.4, 2.0], [2.0, -1.0, 1.0, 0.5], [0.0, 0.1, -2.0, 0.3]];
    let (mut q, mut v) = (vec![], vec![]);
    for [a, b, da, db] in angles {
        let moved = Chain.place(&[Dual::new(a, da), Dual::new(b, db)]);
        q.extend(moved.iter().map(|x| x.value));
        v.extend(moved.iter().map(|x| x.tangent));
    }
    let drag = |_: &[f64], v: &[f64], force: &mut [f64]| force.iter_mut().zip(v).for_each(|(f, v)| *f = -0.7 * v);
    let (mut all, mut one) = (Terms::default(), Terms::default());
    let damped = WithForces::new(system.build().unwrap(), drag);
    damped.terms(&q, &v, Request::ALL, &mut all).unwrap();
    for row in 0..3 {
        let (q, v) = (&q[4 * row..4 * row + 4], &v[4 * row..4 * row + 4]);
        damped.terms(q, v, Request::ALL, &mut one).unwrap();
        assert_eq!(one.acceleration, all.acceleration[4 * row..4 * row + 4]);
        assert_eq!(one.multipliers, all.multipliers[2 * row..2 * row + 2]);
        // The drag does not pull the bobs off their rods: A a = -gamma with it and without.
        let mut rows = ManifoldRows::default();
        damped.manifold().unwrap().rows(q, v, &mut rows);
        model.terms(q, v, Request::ACCELERATION, &mut one).unwrap();
        let free = one.acceleration.clone();
        for (c, drift) in rows.drift.iter().enumerate() {
            for a in [&free, &all.acceleration[4 * row..4 * row + 4].to_vec()] {
                let along: f64 = (0..4).map(|i| rows.matrix[4 * c + i] * a[i]).sum();
                assert!((along + drift).abs() < 1e-12 * (1.0 + drift.abs()), "{along} {drift}");
            }
        }
        assert!(free.iter().zip(&all.acceleration[4 * row..]).any(|(a, b)| (a - b).abs() > 0.1));
    }
}

/// Five bars of a parallelogram with a third crank between two: a row more than there is rank.
#[test]
fn a_row_that_follows_from_others_is_left_out_by_name() {
    let free = || {
        let formula = "(x1_dot^2 + y1_dot^2 + x2_dot^2 + y2_dot^2 + x3_dot^2 + y3_dot^2)/2 - y1 - y2 - y3";
        let names = ["x1", "y1", "x2", "y2", "x3", "y3"];
        Mechanics::<_, f64>::new(ExpressionLagrangian::new(&names, &[], formula).unwrap(), [])
    };
    let names = ["x1", "y1", "x2", "y2", "x3", "y3"];
    let bars = [
        ("1 left", "x1^2 + y1^2 - 1"),
        ("2 right", "(x2 - 2)^2 + y2^2 - 1"),
        ("3 coupler", "(x2 - x1)^2 + (y2 - y1)^2 - 4"),
        ("4 middle x", "x3 - (x1 + x2)/2"),
        ("5 middle y", "y3 - (y1 + y2)/2"),
        ("6 third", "(x3 - 1)^2 + y3^2 - 1"),
    ];
    let start = [(0.4f64, 0.9), (2.5, 0.8), (1.4, 0.9)];
    let q: Vec<f64> = start.iter().flat_map(|&(x, y)| [x, y]).collect();
    let constraints = ExpressionConstraints::new(&names, &[], &bars).unwrap();
    let model = Constrained::new(free(), constraints, []).unwrap().independent(&q, &[0.0; 6]).unwrap();
    let manifold = model.manifold().unwrap();
    assert_eq!((manifold.redundant(), manifold.names().len()), (["6 third".to_string()].as_slice(), 5));
    // As the crank alone: 3 bobs of the same motion, theta'' = -cos theta.
    let theta = 0.7f64;
    let (s, c) = theta.sin_cos();
    let state = [c, s, 2.0 + c, s, 1.0 + c, s];
    let a = model.acceleration(&state, &[0.0; 6]).unwrap();
    assert!((a[0] - s * c).abs() < 1e-13 && (a[3] + c * c).abs() < 1e-13 && (a[4] - s * c).abs() < 1e-13);
    // The row is there, and nothing can be solved for, if all are kept.
    let all = Constrained::new(free(), ExpressionConstraints::new(&names, &[], &bars).unwrap(), []).unwrap();
    let failed = all.acceleration(&state, &[0.0; 6]).unwrap_err();
    assert!(matches!(failed, MechanicsError::Dependent { row: 0, .. }), "{failed:?}");
    // Flat, the cranks along the coupler, the others depend on each other too.
    let flat = model.acceleration(&[1.0, 0.0, 3.0, 0.0, 2.0, 0.0], &[0.0; 6]).unwrap_err();
    assert!(matches!(flat, MechanicsError::Dependent { row: 0, .. }), "{flat:?}");
}

#[test]
fn constraints_that_leave_no_motion_are_refused() {
    let bead =
        || Mechanics::<_, f64>::new(ExpressionLagrangian::new(&["x", "y"], &[], "(x_dot^2 + y_dot^2)/2").unwrap(), []);
    let under = |formulas: &[(&str, &str)]| {
        let constraints = ExpressionConstraints::new(&["x", "y"], &[], formulas).unwrap();
        let states = [0.9, 0.3, -0.5, 0.6, 0.2, -1.0];
        Constrained::new(bead(), constraints, []).unwrap().independent(&states, &[0.1; 6]).map(|_| ())
    };
    let circles = [("inner", "x^2 + y^2 - 1"), ("outer", "x^2 + y^2 - 2")];
    assert!(matches!(under(&circles), Err(ConstraintError::Contradiction { .. })), "{:?}", under(&circles));
    let clocks = [("one", "x_dot - 1"), ("two", "x_dot - 2")];
    assert!(matches!(under(&clocks), Err(ConstraintError::Contradiction { .. })));
    let point = [("circle", "x^2 + y^2 - 1"), ("line", "x - y")];
    assert_eq!(under(&point), Err(ConstraintError::TooMany { independent: 2, coordinates: 2 }));
    assert_eq!(under(&circles[..1]), Ok(()));
    // Not linear in the velocities, nothing of the state, no such name.
    for formula in ["x_dot^2 - 1", "x_dot*y_dot", "sin(x_dot)", "3", "z"] {
        let (name, _) = ExpressionConstraints::new(&["x", "y"], &[], &[("row", formula)]).unwrap_err();
        assert_eq!(name, "row");
    }
    let shape = Constrained::new(bead(), ExpressionConstraints::new(&["x"], &[], &[("a", "x")]).unwrap(), []);
    assert!(matches!(shape, Err(ConstraintError::Shape { expected: 2, found: 1, .. })));
}

/// A degenerate Lagrangian: only `x - y` has inertia and only it is pulled.
#[test]
fn the_least_motion_is_found_where_nothing_tells_it() {
    let lagrangian =
        |text: &str| Mechanics::<_, f64>::new(ExpressionLagrangian::new(&["x", "y", "z"], &[], text).unwrap(), []);
    let degenerate = lagrangian("(x_dot - y_dot)^2/2 + z_dot^2/2 - (x - y)^2/2 - z");
    let state = ([1.0, 0.25, 0.0], [0.0; 3]);
    assert!(matches!(degenerate.acceleration(&state.0, &state.1), Err(MechanicsError::Singular { row: 0, .. })));
    let chosen = LeastNorm(degenerate).acceleration(&state.0, &state.1).unwrap();
    for (found, exact) in chosen.iter().zip([-0.375, 0.375, -1.0]) {
        assert!((found - exact).abs() < 1e-14, "{chosen:?}");
    }
    // A force along the open direction has no answer.
    let pushed = LeastNorm(lagrangian("(x_dot - y_dot)^2/2 + z_dot^2/2 - (x + y)^2/2"));
    assert!(matches!(pushed.acceleration(&state.0, &state.1), Err(MechanicsError::Singular { row: 0, .. })));
    // Under a constraint that leaves the direction open, and one that closes it.
    let line = |formula: &str| ExpressionConstraints::new(&["x", "y", "z"], &[], &[("line", formula)]).unwrap();
    let free = || lagrangian("(x_dot - y_dot)^2/2 + z_dot^2/2 - (x - y)^2/2 - z");
    let open = LeastNorm(Constrained::new(free(), line("z"), []).unwrap());
    let mut terms = Terms::default();
    open.terms(&state.0, &state.1, Request::ACCELERATION, &mut terms).unwrap();
    assert!(terms.acceleration[2].abs() < 1e-15 && (terms.constraint_force[2] - 1.0).abs() < 1e-14);
    let closed = Constrained::new(free(), line("x + y"), []).unwrap();
    assert!((closed.acceleration(&[0.5, -0.5, 0.0], &[0.0; 3]).unwrap()[0] + 0.5).abs() < 1e-14);
}

#[test]
fn states_are_brought_to_the_constraints_by_the_shortest_way() {
    let model = SystemInstance::<f64>::named("particle-on-sphere", &[]).unwrap().build().unwrap();
    let (mut q, mut v) = ([0.0, 0.0, 1.001], [0.3, 0.0, 0.1]);
    let moved = project(model.manifold().unwrap(), &mut q, &mut v).unwrap();
    assert!((moved[0] - 0.001).abs() < 1e-12 && (moved[1] - 0.1).abs() < 1e-12, "{moved:?}");
    assert_eq!((q, v), ([0.0, 0.0, 1.0], [0.3, 0.0, 0.0]));
    // The middle of the sphere has no nearest point.
    assert!(project(model.manifold().unwrap(), &mut [0.0; 3], &mut [0.0; 3]).is_err());
}

#[test]
fn the_catalogue_is_whole() {
    assert_eq!(constrained_systems().len(), 31);
    for system in constrained_systems() {
        let n = system.size.default();
        let model = SystemInstance::<f64>::named(&system.name, &[]).unwrap().build().unwrap();
        let manifold = model.manifold().unwrap();
        assert!(manifold.redundant().is_empty() && manifold.names().len() < n, "{}", system.name);
        assert!(model.metric_jets(&vec![0.5; n], &vec![0.0; n]).is_err());
    }
}

//! Rays, shadows and pictures against closed forms.

use super::camera::Tetrad;
use super::orbits::{norm, product, scaled};
use super::rays::{RayOutcome, trace};
use super::*;
use crate::lagrangian::{EulerLagrange, Interruptible, Lagrangian, Mechanics, MechanicsError, SystemInstance};
use crate::scalar::Real;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::atomic::{AtomicBool, Ordering};

/// Flat space-time with a sign of every square.
struct Flat([i8; 4]);

impl Lagrangian for Flat {
    fn coordinates(&self) -> usize {
        4
    }
    fn lagrangian<R: Real>(&self, _: &[R], _: &[R], v: &[R]) -> R {
        let signed = |sum: R, (v, sign): (&R, &i8)| if *sign > 0 { sum + v.sqr() } else { sum - v.sqr() };
        v.iter().zip(&self.0).fold(R::zero(), signed) * R::half()
    }
}

fn flat(signs: [i8; 4]) -> Mechanics<Flat, f64> {
    Mechanics::new(Flat(signs), Vec::new())
}

fn hole(name: &str, parameters: &[(&str, &str)]) -> Box<dyn EulerLagrange<f64>> {
    let given: Vec<_> = parameters.iter().map(|(s, x)| (s.to_string(), x.to_string())).collect();
    SystemInstance::named(name, &given).unwrap().build().unwrap()
}

fn small(distance: f64, inclination: f64) -> Camera {
    Camera { width: 30, height: 20, ..Camera::new(distance, inclination) }
}

#[test]
fn rays_of_flat_space_are_straight() {
    // Another order of the coordinates and the other convention of signs give the same picture.
    let camera = Camera { azimuth: 0.4, ..small(7.0, 1.0) };
    let other = Camera { chart: Chart { time: 3, space: [1, 2, 0] }, ..camera };
    let [right, up, forward] = camera.axes();
    for (model, camera) in [(flat([-1, 1, 1, 1]), camera), (flat([-1, -1, -1, 1]), other)] {
        let seen = Shadow::of(&model, &camera, &Tracing::of(&camera), &|_| ()).unwrap();
        for (pixel, ray) in seen.rays.iter().enumerate() {
            let part = camera.direction((pixel % 30) as f64 + 0.5, (pixel / 30) as f64 + 0.5);
            let RayOutcome::Escaped(found) = ray.fate else { panic!("{ray:?}") };
            for i in 0..3 {
                let exact = part[0] * right[i] + part[1] * up[i] + part[2] * forward[i];
                assert!((found[i] - exact).abs() < 1e-12);
            }
            // Few steps, as nothing bends the ray.
            assert!(ray.steps < 20 && ray.drift < 1e-14, "{ray:?}");
        }
        assert_eq!((seen.share(), seen.unfinished()), (0.0, 0));
        assert_eq!(Outline::of(&model, &camera, &Tracing::of(&camera), 4), Ok(None));
        let tetrad = Tetrad::new(&model, &camera).unwrap();
        let [x, y] = tetrad.celestial(tetrad.ray(camera.direction(30.0, 0.0)));
        let exact = camera.direction(30.0, 0.0);
        assert!((x - 7.0 * exact[0]).abs() + (y - 7.0 * exact[1]).abs() < 1e-14);
    }
}

#[test]
fn frames_are_orthonormal() {
    let kerr = hole("kerr-cartesian", &[("a", "0.9")]);
    for (observer, distance, inclination) in [
        (Observer::Rest, 3.0, 1.2),
        (Observer::Normal, 3.0, 0.0),
        (Observer::Normal, 1.2, 2.5),
        (Observer::Rest, 50.0, PI),
    ] {
        let camera = Camera { observer, azimuth: 1.0, ..small(distance, inclination) };
        let Tetrad { event, legs, .. } = Tetrad::new(&*kerr, &camera).unwrap();
        let mut terms = crate::lagrangian::Terms::default();
        kerr.terms(&event, &[0.0; 4], crate::lagrangian::Request::MASS_MATRIX, &mut terms).unwrap();
        for (i, a) in legs.iter().enumerate() {
            for (j, b) in legs.iter().enumerate() {
                let exact = if i != j {
                    0.0
                } else if i == 0 {
                    -1.0
                } else {
                    1.0
                };
                assert!((product(&terms.mass_matrix, *a, *b) - exact).abs() < 1e-12, "{observer:?} {i} {j}");
            }
        }
    }
}

/// Synge, Mon. Not. R. Astron. Soc. 131, 463 (1966): `sin(angle) = sqrt(27) M/r sqrt(1 - 2 M/r)` for a camera at rest.
#[test]
fn the_shadow_of_schwarzschild_has_its_angle() {
    let model = hole("schwarzschild-cartesian", &[]);
    for (distance, inclination) in [(20.0, 1.2), (5.0, 0.0), (2.5, FRAC_PI_2)] {
        let camera = small(distance, inclination);
        let tracing = Tracing { far: 60.0, ..Tracing::of(&camera) };
        let found = Outline::of(&*model, &camera, &tracing, 12).unwrap().unwrap();
        let sine = 27f64.sqrt() / distance * (1.0 - 2.0 / distance).sqrt();
        // Within the orbit of light the shadow fills more than half of the sky.
        let exact = if distance < 3.0 { PI - sine.asin() } else { sine.asin() };
        for edge in &found.edges {
            assert!((edge.angle - exact).abs() < 1e-6, "{distance}: {} for {exact}", edge.angle);
            assert!((norm(edge.celestial) - 27f64.sqrt()).abs() < 2e-6, "{distance}: {:?}", edge.celestial);
        }
        assert!((found.area - 27.0 * PI).abs() < 1e-4, "{}", found.area);
    }
    // A camera that falls sees the same rays at other angles.
    let falling = Camera { observer: Observer::Normal, ..small(5.0, 1.0) };
    let tracing = Tracing { far: 60.0, ..Tracing::of(&falling) };
    let found = Outline::of(&*model, &falling, &tracing, 4).unwrap().unwrap();
    for edge in &found.edges {
        assert!((norm(edge.celestial) - 27f64.sqrt()).abs() < 2e-6);
        assert!(edge.angle < (27f64.sqrt() / 5.0 * 0.6f64.sqrt()).asin() - 0.05);
    }
}

/// Bardeen 1973: on the equator the edges are the orbits of light with and against the spin, `|L/E|` of Bardeen, Press and Teukolsky 1972.
#[test]
fn the_shadow_of_kerr_has_its_edges() {
    for spin in [0.9, 0.5] {
        let model = hole("kerr-cartesian", &[("a", &spin.to_string())]);
        let camera = small(20.0, FRAC_PI_2);
        let found = Outline::of(&*model, &camera, &Tracing::of(&camera), 16).unwrap().unwrap();
        let impact = |a: f64| {
            let light: f64 = 2.0 * (1.0 + (2.0 / 3.0 * (-a).acos()).cos());
            a + light.powf(1.5)
        };
        // Light from the left co-rotates with the spin.
        let (left, right) = (found.left().celestial, found.right().celestial);
        assert!((left[0] + impact(spin)).abs() < 1e-5, "{left:?} for {}", impact(spin));
        assert!((right[0] - impact(-spin)).abs() < 1e-5, "{right:?} for {}", impact(-spin));
        assert!(found.left().angle < found.right().angle);
        // Symmetric above and below.
        let (top, bottom) = (found.top().celestial, found.bottom().celestial);
        assert!((top[1] + bottom[1]).abs() < 1e-6 && (top[0] - bottom[0]).abs() < 1e-6, "{top:?} {bottom:?}");
    }
}

#[test]
fn no_result_depends_on_the_number_of_threads() {
    let model = hole("kerr-cartesian", &[("a", "0.9")]);
    let camera = Camera { width: 48, height: 36, ..Camera::new(15.0, 1.4) };
    let of = |threads: usize| {
        let done = std::sync::atomic::AtomicUsize::new(0);
        let count = |pixels: usize| _ = done.fetch_add(pixels, std::sync::atomic::Ordering::Relaxed);
        let seen = Shadow::of(&*model, &camera, &Tracing { threads, ..Tracing::of(&camera) }, &count).unwrap();
        assert_eq!(done.into_inner(), 48 * 36);
        seen
    };
    let one = of(1);
    assert_eq!(one, of(3));
    assert_eq!(one.unfinished(), 0);
    // About the share of a disc with the angle without spin, 18.8 degrees, in a picture of 70.
    assert!((one.share() - 0.24).abs() < 0.02, "{}", one.share());
    let difference = one.difference(&one).unwrap();
    assert_eq!((difference.shadow, difference.median, difference.most), (0.0, 0.0, 0.0));
}

#[test]
fn light_stays_light() {
    let model = hole("kerr-cartesian", &[("a", "0.9")]);
    let camera = small(20.0, 1.4);
    for (tolerance, most) in [(1e-6, 1e-3), (1e-8, 1e-5), (1e-10, 1e-7)] {
        let seen = Shadow::of(&*model, &camera, &Tracing { tolerance, ..Tracing::of(&camera) }, &|_| ()).unwrap();
        assert!(seen.drift() < most, "{tolerance}: {}", seen.drift());
    }
}

/// A sky at twice the distance of the camera is that at infinity but for percentage of a degree.
#[test]
fn the_sky_is_far_enough() {
    let model = hole("kerr-cartesian", &[("a", "0.9")]);
    let camera = small(20.0, 1.4);
    let [near, far] = [40.0, 1e5].map(|far| {
        let tracing = Tracing { far, tolerance: 1e-9, ..Tracing::of(&camera) };
        Shadow::of(&*model, &camera, &tracing, &|_| ()).unwrap()
    });
    let difference = near.difference(&far).unwrap();
    assert_eq!(difference.shadow, 0.0);
    assert!(difference.median.to_degrees() < 0.03 && difference.most.to_degrees() < 0.06);
}

/// The deflection of light that passes far away is `4 M/b`, with the second order `15 pi M^2/(4 b^2)` (Epstein and Shapiro 1980).
#[test]
fn light_far_from_the_hole_is_deflected_as_it_should_be() {
    let model = hole("schwarzschild-cartesian", &[]);
    let (impact, far) = (200.0, 2e5);
    let camera = small(far, FRAC_PI_2);
    let tetrad = Tetrad::new(&*model, &camera).unwrap();
    let sine = impact / far * (1.0 - 2.0 / far).sqrt();
    let direction = [sine, 0.0, (1.0 - sine * sine).sqrt()];
    let tracing = Tracing { tolerance: 1e-11, far, ..Tracing::of(&camera) };
    let ray = trace(&*model, &camera.chart, &[(tetrad.event, tetrad.ray(direction))], &tracing, &|_| ()).unwrap()[0];
    let RayOutcome::Escaped(found) = ray.fate else { panic!("{ray:?}") };
    let [right, _, forward] = camera.axes();
    let start: [f64; 3] = std::array::from_fn(|i| direction[0] * right[i] + direction[2] * forward[i]);
    let bent = (start[0] * found[1] - start[1] * found[0]).asin().abs();
    let exact = 4.0 / impact + 15.0 * PI / (4.0 * impact * impact) + 128.0 / (3.0 * impact.powi(3));
    assert!((bent / exact - 1.0).abs() < 2e-4, "{bent} for {exact}");
}

#[test]
fn mistakes_are_named() {
    let camera = small(10.0, 1.0);
    let traced = |model: &dyn EulerLagrange<f64>, camera: Camera, tracing: Tracing| {
        Shadow::of(model, &camera, &tracing, &|_| ()).unwrap_err().to_string()
    };
    let model = hole("schwarzschild-cartesian", &[]);
    let usual = Tracing::of(&camera);
    let near = Camera { distance: 1.9, ..camera };
    assert!(traced(&*model, near, usual).contains("no camera can be at rest"));
    assert!(traced(&flat([1; 4]), camera, usual).contains("0 negative and 4 positive"));
    assert!(traced(&*hole("kepler", &[]), camera, usual).contains("found 2 coordinates"));
    let twice = Chart { time: 1, ..Chart::default() };
    assert!(traced(&*model, Camera { chart: twice, ..camera }, usual).contains("four different coordinates"));
    assert!(traced(&*model, Camera { field_of_view: 4.0, ..camera }, usual).starts_with("field of view"));
    assert!(traced(&*model, camera, Tracing { tolerance: 0.0, ..usual }).starts_with("tolerance"));
    assert!(traced(&*model, camera, Tracing { growth: 1.0, ..usual }).starts_with("growth"));
    assert!(Outline::of(&*model, &camera, &usual, 0).unwrap_err().to_string().starts_with("directions"));
}

#[test]
fn rays_that_do_not_end_are_unfinished() {
    let model = hole("schwarzschild-cartesian", &[]);
    let camera = small(10.0, 1.0);
    let seen = Shadow::of(&*model, &camera, &Tracing { most_steps: 2, ..Tracing::of(&camera) }, &|_| ()).unwrap();
    assert_eq!((seen.unfinished(), seen.share()), (600, 0.0));
    // The metric is invalid at the origin of the coordinates.
    let start = ([0.0; 4], scaled(2.0, [0.0, 1.0, 0.0, 0.0]));
    let tracing = Tracing::of(&camera);
    let rays =
        trace(&*model, &camera.chart, &[start, ([0.0, 30.0, 0.0, 0.0], [-1.0, 1.0, 0.0, 0.0])], &tracing, &|_| ());
    let rays = rays.unwrap();
    assert_eq!((rays[0].fate, rays[1].fate), (RayOutcome::Unfinished, RayOutcome::Escaped([1.0, 0.0, 0.0])));
}

/// The rays of blocks that were followed before a flag was raised have their ends, the others none.
#[test]
fn an_interrupted_picture_has_the_rays_that_were_followed() {
    let model = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap().build().unwrap();
    let flag = AtomicBool::new(false);
    let hole = Interruptible::new(&*model, &flag);
    let camera = Camera { width: 20, height: 20, ..Camera::new(20.0, 1.4) };
    let tracing = Tracing::of(&camera);
    let whole = Shadow::of(&hole, &camera, &tracing, &|_| ()).unwrap();
    let part = Shadow::of(&hole, &camera, &tracing, &|_| flag.store(true, Ordering::Relaxed)).unwrap();
    assert_eq!((whole.finished(), part.rays.len()), (400, 400));
    assert!((1..400).contains(&part.finished()), "{}", part.finished());
    for (a, b) in part.rays.iter().zip(&whole.rays).filter(|(a, _)| a.fate != RayOutcome::Unfinished) {
        assert_eq!((a.fate, a.steps), (b.fate, b.steps));
    }
    assert_eq!(Outline::of(&hole, &camera, &tracing, 4), Err(RelativityError::Mechanics(MechanicsError::Interrupted)));
}

/// At both ends of the tolerances every ray comes to an end; beyond them nothing is traced.
#[test]
fn tolerances_have_ends() {
    let model = SystemInstance::<f64>::named("schwarzschild-cartesian", &[]).unwrap().build().unwrap();
    let camera = Camera { width: 6, height: 6, ..Camera::new(20.0, 1.4) };
    let of = |tolerance: f64| Shadow::of(&*model, &camera, &Tracing { tolerance, ..Tracing::of(&camera) }, &|_| ());
    let (fine, coarse) = (of(TOLERANCES.0).unwrap(), of(TOLERANCES.1).unwrap());
    assert_eq!((fine.unfinished(), coarse.unfinished(), fine.share()), (0, 0, coarse.share()));
    for wrong in [1e-30, 1e-13, 0.02, 1.0, f64::NAN] {
        assert!(matches!(of(wrong), Err(RelativityError::Invalid { what: "tolerance", .. })), "{wrong}");
    }
}

/// A wormhole of a throat of radius `b`, with a lapse at it: `-N dt^2 + dl^2 + A (dtheta^2 + sin^2 theta dphi^2)`, `A = b^2 + l^2`,
/// `N = 1 - lapse/(A + 1)`. Without a lapse it is that of Ellis.
pub(super) struct Wormhole(pub f64, pub f64);

impl Lagrangian for Wormhole {
    fn coordinates(&self) -> usize {
        4
    }
    fn lagrangian<R: Real>(&self, _: &[R], q: &[R], v: &[R]) -> R {
        let area = q[1].sqr() + R::of(self.0 * self.0);
        let lapse = R::one() - R::of(self.1) / (area + R::one());
        let sphere = v[2].sqr() + (q[2].sin() * v[3]).sqr();
        (v[1].sqr() + area * sphere - lapse * v[0].sqr()) * R::half()
    }
}

/// A camera at rest at `l` sees the throat within `sin(angle) = b/sqrt(b^2 + l^2)`, by light of the impact parameter `b`.
#[test]
fn a_wormhole_shows_its_other_side() {
    let (throat, far) = (1.5, 4e3);
    for (radius, inclination) in [(6.0, 1.2), (0.5, FRAC_PI_2), (30.0, 0.0)] {
        let model = TwoSided::new(Mechanics::new(Wormhole(throat, 0.0), vec![]), 0, [1, 2, 3], radius, far).unwrap();
        let exact = (throat / throat.hypot(radius)).asin();
        let field_of_view = (6.0 * exact).min(2.0);
        let camera = Camera { field_of_view, ..small(model.distance(radius), inclination) };
        let [far, second] = [far, -far].map(|l| model.distance(l));
        let tracing = Tracing { far, second, tolerance: 1e-7, ..Tracing::of(&camera) };
        let found = Outline::of(&model, &camera, &tracing, 4).unwrap().unwrap();
        for edge in &found.edges {
            assert!((edge.angle - exact).abs() < 1e-6, "{radius}: {} for {exact}", edge.angle);
            assert!((norm(edge.celestial) - throat).abs() < 1e-5, "{radius}: {:?}", edge.celestial);
        }
        assert!((found.radius() - exact).abs() < 1e-6);
        let seen = Shadow::of(&model, &camera, &tracing, &|_| ()).unwrap();
        assert_eq!((seen.share(), seen.unfinished()), (0.0, 0));
        for (pixel, ray) in seen.rays.iter().enumerate() {
            let direction = camera.direction((pixel % 30) as f64 + 0.5, (pixel / 30) as f64 + 0.5);
            let within = norm([direction[0], direction[1]]).atan2(direction[2]) < exact;
            assert_eq!(matches!(ray.fate, RayOutcome::Crossed(_)), within, "{radius} {pixel}: {ray:?}");
        }
        assert!(seen.crossed() > 0.0 && seen.drift() < 1e-4);
    }
}

/// Light straight through the throat comes from the point behind it; other light turns about the throat by the integral along its path.
#[test]
fn places_in_the_second_region_have_their_angles() {
    let model = TwoSided::new(Mechanics::new(Wormhole(1.0, 0.0), vec![]), 0, [1, 2, 3], 5.0, 1e6).unwrap();
    let camera = Camera { azimuth: 0.7, ..small(model.distance(5.0), 1.1) };
    let [far, second] = [1e6, -1e6].map(|l| model.distance(l));
    let tracing = Tracing { far, second, tolerance: 1e-10, ..Tracing::of(&camera) };
    let tetrad = Tetrad::new(&model, &camera).unwrap();
    let sine = 0.4 / 26f64.sqrt();
    let start = |direction| (tetrad.event, tetrad.ray(direction));
    let starts = [start([0.0, 0.0, 1.0]), start([sine, 0.0, (1.0 - sine * sine).sqrt()])];
    let rays = trace(&model, &camera.chart, &starts, &tracing, &|_| ()).unwrap();
    let [right, _, forward] = camera.axes();
    let RayOutcome::Crossed(straight) = rays[0].fate else { panic!("{rays:?}") };
    (0..3).for_each(|i| assert!((straight[i] + forward[i]).abs() < 1e-6, "{straight:?}"));
    // The impact parameter 0.4: the angle that the ray turns about the throat, by the midpoint rule in l = tan(u).
    let RayOutcome::Crossed(bent) = rays[1].fate else { panic!("{rays:?}") };
    let (low, high, steps) = (-FRAC_PI_2, 5f64.atan(), 100_000);
    let width = (high - low) / f64::from(steps);
    let turned: f64 = (0..steps)
        .map(|k| {
            let cosine = (low + (f64::from(k) + 0.5) * width).cos();
            width * 0.4 / (1.0 - (0.4 * cosine).powi(2)).sqrt()
        })
        .sum();
    for i in 0..3 {
        let exact = turned.sin() * right[i] - turned.cos() * forward[i];
        assert!((bent[i] - exact).abs() < 1e-5, "{bent:?} {turned}");
    }
}

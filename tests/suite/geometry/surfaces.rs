//! Horizons, ergosurfaces and signatures of black holes.

use super::spaces::{SPACES, Space, dd};
use crate::common::accuracy::configure;
use lnn::geometry::{Change, Geometry, GeometryError, Metric, Surface, characters, grid};
use lnn::linalg::Inertia;
use lnn::scalar::{Dd, Real, Scalar};

fn space(name: &str) -> &'static Space {
    SPACES.iter().find(|space| space.name == name).unwrap()
}

#[test]
fn kerrs_horizons_and_ergosurfaces_are_found() {
    let kerr = space("kerr").model::<Dd>();
    let (theta, a) = (0.75, dd(0.5));
    let line = |r: f64| [0.0, r, theta, 0.0].map(dd);
    let radii = |block: &[usize]| -> Vec<Dd> {
        let found = Surface::find(&*kerr, block, (&line(0.01), &line(5.0)), &[dd(0.0); 4], 97).unwrap();
        assert!(found.iter().all(|surface| surface.change == Change::Zero));
        found.iter().map(|surface| surface.point[1]).collect()
    };
    // r = M +- sqrt(M^2 - a^2 cos^2 theta), and without the cosine.
    for (block, x) in [(&[0usize][..], a * dd(theta).cos()), (&[0, 3], a)] {
        let root = (dd(1.0) - x.sqr()).sqrt();
        let found = radii(block);
        assert_eq!(found.len(), 2, "{found:?}");
        for (found, exact) in found.into_iter().zip([dd(1.0) - root, dd(1.0) + root]) {
            assert!((found - exact).abs().to_f64() < 1e-29, "{found} {exact}");
        }
    }
    let poles = Surface::find(&*kerr, &[1], (&line(0.01), &line(5.0)), &[dd(0.0); 4], 97).unwrap();
    assert!(poles.len() == 2 && poles.iter().all(|surface| surface.change == Change::Pole), "{poles:?}");
}

#[test]
fn the_character_of_a_black_hole_changes_at_its_horizon() {
    let hole = configure::<f64>("schwarzschild-geodesic", &[]).build().unwrap();
    let points = grid(&[0.0, 0.0, 1.0, 0.0], &[(1, vec![1.0, 3.0]), (2, vec![0.5, 1.0]), (9, vec![1.0; 5])]);
    assert_eq!(points.len(), 16);
    assert_eq!(points[4..8], [0.0, 1.0, 1.0, 0.0]);
    let found = characters(&*hole, &points, &[0.0; 4]).unwrap();
    for (character, q) in found.iter().zip(points.chunks(4)) {
        assert_eq!(character.signature, Some(Inertia { negative: 1, zero: 0, positive: 3 }));
        assert!((character.determinant / (q[1].powi(4) * q[2].sin().powi(2)) + 1.0).abs() < 1e-14);
    }
    let none = characters(&*hole, &[0.0, 2.0, 1.0, 0.0], &[0.0; 4]).unwrap();
    assert!(none[0].signature.is_none() && none[0].determinant.is_nan());
    let ends = ([0.0, 1.0, 1.0, 0.0], [0.0, 4.0, 1.0, 0.0]);
    let found = Surface::find(&*hole, &[0], (&ends.0, &ends.1), &[0.0; 4], 7).unwrap();
    assert!(found.len() == 1 && (found[0].point[1] - 2.0).abs() < 1e-15);
    // Metrics are held in pieces of 1024; one of these pieces ends on the horizon, where there is no metric, one beside it.
    for steps in [3 * 1024, 2 * 1024 - 1, 3 * 1023, 5000] {
        let found = Surface::find(&*hole, &[0], (&ends.0, &ends.1), &[0.0; 4], steps).unwrap();
        assert!(found.len() == 1 && (found[0].point[1] - 2.0).abs() < 1e-15, "{steps}: {found:?}");
    }
    // The signature is the same on both sides.
    assert!(Surface::find(&*hole, &[0, 1, 2, 3], (&ends.0, &ends.1), &[0.0; 4], 7).unwrap().is_empty());
    for block in [&[][..], &[4]] {
        let refused = Surface::find(&*hole, block, (&ends.0, &ends.1), &[0.0; 4], 7);
        assert!(matches!(refused, Err(GeometryError::Shape { what: "block of the metric", .. })));
    }
}

#[test]
fn degenerate_metrics_are_errors() {
    assert_eq!(Metric::new(2, &[1.0, 2.0, 2.0, 4.0]), Err(GeometryError::Degenerate { condition: f64::INFINITY }));
    let fine = Metric::new(2, &[1e-30, 0.0, 0.0, -1e30]).unwrap();
    assert_eq!((fine.determinant, fine.signature.negative, fine.signature.positive), (-1.0, 1, 1));
    let again = fine.lower(&fine.raise(&[3.0, 4.0]));
    assert!((again[0] - 3.0).abs() < 1e-15 && (again[1] - 4.0).abs() < 1e-15, "{again:?}");
    assert!(matches!(Metric::new(1, &[f64::NAN]), Err(GeometryError::NotFinite { .. })));
    assert!(matches!(Metric::new(2, &[1.0]), Err(GeometryError::Shape { .. })));
    let sphere = configure::<f64>("sphere-geodesic", &[]).build().unwrap();
    let found = Geometry::of(&*sphere, &[0.0, 0.0, 1.0, 0.0], &[0.0; 2]).unwrap();
    assert!(matches!(found[0], Err(GeometryError::Degenerate { .. })) && found[1].is_ok());
}

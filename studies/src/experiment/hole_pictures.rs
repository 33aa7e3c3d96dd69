//! Pictures of a learned black hole beside the exact one: orbits, shadow and sky.

use lnn::relativity::{Camera, CentralCoordinates, Image, LearnedHole, Shadow, Sky, Tracing, difference_image, orbits};
use lnn::report::{OrbitPlot, Picture, Series, orbit_picture, png};

/// Distance of the camera over the mass, and its angle from the axis.
const CAMERA: (f64, f64) = (20.0, 1.4);
/// White columns between pictures.
const GAP: usize = 8;

/// Orbits of the exact metric, wide, and of the learned one over them; none where there is nothing to show.
pub fn orbit_figure(pair: &LearnedHole<'_>, mass: f64) -> Option<Picture> {
    let origin = pair.around.origin();
    let range = (1.2 * mass, 20.0 * mass);
    let hole = pair.around.equator(pair.exact, &origin).horizon(range).ok().flatten();
    let inner = pair.range.0.max(1.2 * mass);
    let found = orbits(pair.exact, pair.around, mass, inner).ok()?;
    let series = |name: &str, points, over| Series { name: name.to_string(), points, over };
    let panels = found.iter().map(|orbit| {
        let exact = series("exact", orbit.path(pair.exact, pair.around), false);
        let learned = series("learned", orbit.path(pair.learned, pair.around), true);
        (orbit.title.to_string(), vec![exact, learned])
    });
    let coordinates = pair.system.system.coordinates(pair.system.coordinates);
    // The radius, or a coordinate of space.
    let distance = match pair.around {
        CentralCoordinates::Cartesian(chart) => Some(chart.space[0]),
        CentralCoordinates::Spherical { radius, .. } => Some(radius),
        _ => None,
    };
    let unit = distance.map_or_else(String::new, |at| format!(" [{}]", coordinates[at].unit));
    let [x_label, y_label] = ["x", "y"].map(|axis| format!("{axis}{unit}"));
    let plot = OrbitPlot { x_label, y_label, hole, panels: panels.collect() };
    orbit_picture(&plot).ok()
}

/// Shadow and sky through the exact metric, through the learned one, and their difference, as PNG of so many pixels along
/// an edge; `None` for coordinates that are not Cartesian, where nothing rests at the place of the camera, and when
/// `interrupted` says so.
pub fn sky_picture(
    pair: &LearnedHole<'_>,
    mass: f64,
    (pixels, threads): (usize, usize),
    interrupted: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<u8>> {
    let CentralCoordinates::Cartesian(chart) = pair.around else { return None };
    let camera = Camera { chart, width: pixels, height: pixels, ..Camera::new(CAMERA.0 * mass, CAMERA.1) };
    let tracing = Tracing { threads, ..Tracing::of(&camera) };
    let mut views = Vec::new();
    for model in [pair.exact, pair.learned] {
        if interrupted() {
            return None;
        }
        views.push(Shadow::of(model, &camera, &tracing, &|_| ()).ok()?);
    }
    let sky = Sky::around(&camera);
    let mut images: Vec<Image> = views.iter().map(|view| sky.image(view)).collect();
    if let [exact, learned] = views.as_slice() {
        images.extend(difference_image(exact, learned).ok());
    }
    Some(png(&Image::beside(&images, GAP)))
}

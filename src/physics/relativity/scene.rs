//! Metrics before a camera: what is computed for a picture, whether of one metric or of two side by side.

use super::coordinates::time_moves_alone;
use super::report::images;
use super::thresholds::PIXEL_BYTES;
use super::{
    Camera, Chart, Image, Outline, RelativityError, Shadow, ShadowSummary, Tracing, TwoSided, View, difference_image,
};
use crate::lagrangian::{EulerLagrange, Interruptible};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// White columns between pictures.
const GAP: usize = 8;

/// A metric that belongs to a scene, with its name, `exact` or `learned`.
type OwnMetric<'a> = (&'static str, Box<dyn EulerLagrange<f64> + 'a>);

/// Metrics of the same coordinates before a camera, with the settings of their rays.
///
/// ```
/// use lnn::lagrangian::SystemInstance;
/// use lnn::relativity::{Camera, Scene, Tracing};
/// use std::sync::atomic::AtomicBool;
///
/// let hole = SystemInstance::<f64>::named("schwarzschild-cartesian", &[])?.build()?;
/// let camera = Camera { width: 12, height: 12, ..Camera::new(20.0, 1.4) };
/// let scene = Scene::new(vec![("exact", hole)], &[], camera, Tracing::of(&camera), None)?;
/// let views = scene.views(0, &AtomicBool::new(false), &|_| (), &|_| ())?;
/// assert!(scene.summary(("hole", Some("m")), &views)?.views["exact"].share > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Scene<'a> {
    metrics: Vec<OwnMetric<'a>>,
    camera: Camera,
    tracing: Tracing,
    /// Radial coordinates of the camera and of the sky.
    distance: f64,
    far: f64,
}

impl<'a> Scene<'a> {
    /// Metrics with their names, `exact` or `learned`; `angles` tells for each coordinate whether it is a periodic angle, and is empty
    /// if that is not known. `far` is the distance of the sky in the unit of the coordinates, by default that of an
    /// [exact](Camera::sky_of_exact) metric, with a learned one that of a [learned](Camera::sky_of_learned) metric; it replaces that of
    /// `tracing`.
    ///
    /// If the last spatial coordinate is an angle, the metrics are those of wormholes, and become [two-sided](TwoSided); `space` of the
    /// camera's chart then names the radial coordinate, the angle from the axis, and the angle about it.
    ///
    /// # Errors
    /// [`RelativityError::OneSided`] for other metrics whose last spatial coordinate is an angle; [`RelativityError::Coordinates`] and
    /// [`RelativityError::Chart`] for those without the coordinates of the chart.
    pub fn new(
        metrics: Vec<(&'static str, Box<dyn EulerLagrange<f64> + 'a>)>,
        angles: &[bool],
        camera: Camera,
        tracing: Tracing,
        far: Option<f64>,
    ) -> Result<Self, RelativityError> {
        let is_learned = metrics.iter().any(|(name, _)| *name == "learned");
        let usual = if is_learned { camera.sky_of_learned() } else { camera.sky_of_exact() };
        let (distance, far) = (camera.distance, far.unwrap_or(usual));
        let scene = Self { metrics, camera, tracing: Tracing { far, ..tracing }, distance, far };
        if angles.get(camera.chart.space[2]) == Some(&true) { scene.two_sided() } else { Ok(scene) }
    }

    /// Transforms the metrics, the camera and the distances to Cartesian coordinates of two sides.
    fn two_sided(self) -> Result<Self, RelativityError> {
        let Self { camera, distance, far, .. } = self;
        let (mut places, mut metrics) = ([0.0; 3], Vec::new());
        for (name, model) in self.metrics {
            let sided = TwoSided::new(model, camera.chart.time, camera.chart.space, distance, far)?;
            places = [distance, far, -far].map(|radius| sided.distance(radius));
            metrics.push((name, Box::new(sided) as Box<dyn EulerLagrange<f64> + 'a>));
        }
        let [here, sky, second] = places;
        let camera = Camera { chart: Chart::default(), distance: here, ..camera };
        Ok(Self { metrics, camera, tracing: Tracing { far: sky, second, ..self.tracing }, distance, far })
    }

    /// Number of rays: one for every pixel and metric.
    pub fn rays(&self) -> usize {
        self.camera.width.saturating_mul(self.camera.height).saturating_mul(self.metrics.len())
    }

    /// Approximate memory of the rays in bytes; `None` if it cannot be counted.
    pub fn bytes(&self) -> Option<u64> {
        (self.rays() as u64).checked_mul(PIXEL_BYTES)
    }

    /// Renders the metrics, one after the other, until a flag is raised, and finds the edges of the shadows in a number of directions, none if
    /// `edges` is 0.
    ///
    /// `begin` receives the name of a metric before its rays are followed, `advance` the number of pixels of every finished block.
    ///
    /// # Errors
    /// [`RelativityError`].
    pub fn views(
        &self,
        edges: usize,
        stop: &AtomicBool,
        begin: &dyn Fn(&str),
        advance: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<View>, RelativityError> {
        let (camera, tracing) = (&self.camera, &self.tracing);
        let mut views = Vec::new();
        for (name, model) in &self.metrics {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            begin(name);
            let began = Instant::now();
            let model = Interruptible::new(&**model, stop);
            let shadow = Shadow::of(&model, camera, tracing, advance)?;
            let seconds = began.elapsed().as_secs_f64();
            let edge = if edges == 0 { Ok(None) } else { Outline::of(&model, camera, tracing, edges) };
            // An edge between rays that were not followed does not count.
            let outline = if stop.load(Ordering::Relaxed) { None } else { edge? };
            views.push(View { name, shadow, outline, seconds });
        }
        Ok(views)
    }

    /// The pictures of the views side by side; two views also get a picture of their difference.
    ///
    /// # Errors
    /// Views of different sizes.
    pub fn picture(&self, views: &[View]) -> Result<Image, RelativityError> {
        let mut images = images(&self.camera, views);
        if let [exact, learned] = views {
            images.push(difference_image(&exact.shadow, &learned.shadow)?);
        }
        Ok(Image::beside(&images, GAP))
    }

    /// The figures of the views, with the name of the system and the unit of its coordinates, if that is known. Distances are radial
    /// coordinates.
    ///
    /// # Errors
    /// Views of different sizes.
    pub fn summary(&self, about: (&str, Option<&str>), views: &[View]) -> Result<ShadowSummary, RelativityError> {
        let alone = |model: &dyn EulerLagrange<f64>| time_moves_alone(model, self.camera.chart, self.camera.distance);
        let is_learned = self.metrics.iter().any(|(name, _)| *name == "learned");
        let free_factor = is_learned && self.metrics.iter().any(|(_, model)| alone(&**model));
        let summary = ShadowSummary::of(about, (&self.camera, &self.tracing), views, free_factor)?;
        Ok(ShadowSummary { distance: self.distance, far: self.far, ..summary })
    }
}

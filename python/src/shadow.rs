//! The shadow of a black hole before the sky, through a metric written down or learned.

use crate::attend::whole;
use crate::errors::{choice, value};
use crate::readings::shown;
use crate::subject::Subject;
use lnn::lagrangian::EulerLagrange;
use lnn::pipeline::{Event, require_memory};
use lnn::relativity::{Camera, Chart, Observer, Scene, Tracing};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The camera and its rays; angles in degrees.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Choices {
    time: String,
    space: Vec<String>,
    distance: f64,
    inclination: f64,
    azimuth: f64,
    observer: String,
    field_of_view: f64,
    width: usize,
    height: usize,
    far: Option<f64>,
    tolerance: f64,
    edges: usize,
    threads: usize,
}

impl Choices {
    fn chart(&self, coordinates: &[String]) -> PyResult<Chart> {
        let place = |what: &str, name: &String| {
            let found = coordinates.iter().position(|coordinate| coordinate == name);
            found.ok_or_else(|| value(format_args!("{what}: no coordinate {name:?} among {coordinates:?}")))
        };
        let usual = Chart::usual_space(coordinates, &self.time);
        let space = if self.space.is_empty() { &usual } else { &self.space };
        let [x, y, z] = space.as_slice() else {
            return Err(value(format_args!("space: expected three names, found {}", space.len())));
        };
        Ok(Chart {
            time: place("time", &self.time)?,
            space: [place("space", x)?, place("space", y)?, place("space", z)?],
        })
    }

    fn camera(&self, chart: Chart) -> PyResult<Camera> {
        Ok(Camera {
            chart,
            azimuth: self.azimuth.to_radians(),
            observer: choice("observer", &self.observer, &Observer::ALL, Observer::name)?,
            field_of_view: self.field_of_view.to_radians(),
            width: self.width,
            height: self.height,
            ..Camera::new(self.distance, self.inclination.to_radians())
        })
    }
}

/// A picture through metrics, the exact one, a learned one or both: figures as JSON, pixels of red, green and blue, rows and columns.
#[pyfunction]
pub fn shadow<'py>(
    py: Python<'py>,
    exact: Option<&Subject>,
    learned: Option<&Subject>,
    choices: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Bound<'py, PyBytes>, (usize, usize))> {
    let choices: Choices = serde_json::from_str(choices).map_err(value)?;
    let subjects: Vec<(&'static str, &Subject)> =
        [("exact", exact), ("learned", learned)].into_iter().filter_map(|(name, one)| Some((name, one?))).collect();
    let Some((_, last)) = subjects.last() else { return Err(value("expected a system, a model, or both")) };
    subjects.iter().try_for_each(|(_, subject)| subject.require_free())?;
    if let Some((_, other)) = subjects.iter().find(|(_, subject)| subject.columns != last.columns) {
        return Err(value(format_args!(
            "expected metrics of the same columns, found {:?} and {:?}",
            other.columns, last.columns
        )));
    }
    let camera = choices.camera(choices.chart(&last.columns[..last.columns.len() / 2])?)?;
    let tracing = Tracing { tolerance: choices.tolerance, threads: choices.threads, ..Tracing::of(&camera) };
    let pixels = camera.width.saturating_mul(camera.height);
    let most = Camera::MOST_PIXELS;
    if !(1..=most).contains(&pixels) {
        return Err(value(format_args!("width, height: expected 1 to {most} pixels together, found {pixels}")));
    }
    let unit = exact.or(learned).and_then(Subject::time_unit);
    let metrics: Vec<(&str, Box<dyn EulerLagrange<f64> + '_>)> =
        subjects.iter().map(|(name, subject)| (*name, Box::new(subject.moving()) as _)).collect();
    let scene = Scene::new(metrics, &last.periodic(), camera, tracing, choices.far).map_err(value)?;
    require_memory("the picture", scene.bytes()).map_err(value)?;
    let (total, done) = (scene.rays(), AtomicUsize::new(0));
    let (json, image) = whole(py, progress.as_ref(), |watch| {
        let advance = |rays: usize| {
            let done = done.fetch_add(rays, Ordering::Relaxed) + rays;
            if let Some(events) = &watch.events {
                events(Event::Step { done, total });
            }
        };
        let views = scene.views(choices.edges, &watch.interrupt, &|_| (), &advance).map_err(value)?;
        let summary = scene.summary((last.name(), unit.as_deref()), &views).map_err(value)?;
        Ok::<_, PyErr>((shown(&summary, &summary.findings(None))?, scene.picture(&views).map_err(value)?))
    })??;
    Ok((json, PyBytes::new(py, image.pixels.as_flattened()), (image.height, image.width)))
}

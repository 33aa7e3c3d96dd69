//! Views through metrics, and their report.

use super::{Camera, Image, Outline, RelativityError, Shadow, Tracing};
use crate::findings::Findings;
use crate::names::{percentage, pluralize, rounded};
use crate::relativity::Sky;
use serde::Serialize;
use std::collections::BTreeMap;

/// Rays through a metric, and the edge of its shadow.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// `exact` or `learned`.
    pub name: &'static str,
    /// Its rays.
    pub shadow: Shadow,
    /// The edge of the shadow, if it was requested and there is one around the centre.
    pub outline: Option<Outline>,
    /// Seconds that the picture took.
    pub seconds: f64,
}

/// The picture of each view.
pub(super) fn images(camera: &Camera, views: &[View]) -> Vec<Image> {
    let sky = Sky::around(camera);
    views.iter().map(|view| sky.image(&view.shadow)).collect()
}

/// Figures of a view.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewSummary {
    /// Share of the pixels in the shadow.
    pub share: f64,
    /// Area of the shadow in impact parameters.
    pub area: Option<f64>,
    /// Impact parameters of its edge.
    pub left: Option<f64>,
    /// To the right.
    pub right: Option<f64>,
    /// Below.
    pub bottom: Option<f64>,
    /// Above.
    pub top: Option<f64>,
    /// Rays that were neither captured nor came from the sky.
    pub unfinished: usize,
    /// Largest `g(k, k)` at the end of a ray, relative.
    pub drift: f64,
    /// Steps of all rays.
    pub steps: usize,
    /// Seconds.
    pub seconds: f64,
    /// Rays per second.
    pub rays_per_second: f64,
    /// Share of the pixels that show the second region; none for a metric with one region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_share: Option<f64>,
    /// Angular radius of the image of the second region, in degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub throat_radius: Option<f64>,
}

/// Differences of two views.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewDifference {
    /// Fraction of the pixels whose colours differ.
    pub pixels: f64,
    /// Fraction of the pixels in the shadow of only one picture.
    pub shadow: f64,
    /// Median of the angles between places on the sky, in degrees.
    pub median_angle: f64,
    /// 99 % of the angles are smaller, in degrees.
    pub angle_99: f64,
}

/// Figures of views of one camera; angles in degrees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShadowSummary {
    /// Name of the system.
    pub system: String,
    /// Unit of the coordinates, if it is known.
    pub unit: Option<String>,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Distance of the camera from the centre.
    pub distance: f64,
    /// Angle of the camera from the axis.
    pub inclination: f64,
    /// Angle about the axis.
    pub azimuth: f64,
    /// Angle between the left and the right end of the picture.
    pub field_of_view: f64,
    /// Distance of the sky.
    pub far: f64,
    /// Relative error of a step.
    pub tolerance: f64,
    /// Threads.
    pub threads: usize,
    /// The exact metric, the learned one, or both.
    #[serde(flatten)]
    pub views: BTreeMap<&'static str, ViewSummary>,
    /// `true` if a metric was learned whose time and places do not act on each other: its impact parameters are known up to a factor.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub free_factor: bool,
    /// Difference of two views.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<ViewDifference>,
}

impl From<&View> for ViewSummary {
    fn from(view: &View) -> Self {
        let View { shadow, outline, seconds, .. } = view;
        let edge = |of: fn(&Outline) -> super::Edge| outline.as_ref().map(|outline| of(outline).celestial);
        Self {
            share: shadow.share(),
            area: outline.as_ref().map(|outline| outline.area),
            left: edge(Outline::left).map(|[x, _]| x),
            right: edge(Outline::right).map(|[x, _]| x),
            bottom: edge(Outline::bottom).map(|[_, y]| y),
            top: edge(Outline::top).map(|[_, y]| y),
            unfinished: shadow.unfinished(),
            drift: shadow.drift(),
            steps: shadow.steps(),
            seconds: *seconds,
            rays_per_second: shadow.rays.len() as f64 / seconds,
            second_share: None,
            throat_radius: None,
        }
    }
}

impl ShadowSummary {
    /// The summary of the views of a camera.
    ///
    /// # Errors
    /// Views of different sizes.
    pub(super) fn of(
        (system, unit): (&str, Option<&str>),
        (camera, tracing): (&Camera, &Tracing),
        views: &[View],
        free_factor: bool,
    ) -> Result<Self, RelativityError> {
        let difference = match (views, images(camera, views).as_slice()) {
            ([a, b], [first, second]) => {
                let differ = first.pixels.iter().zip(&second.pixels).filter(|(a, b)| a != b).count();
                let found = a.shadow.difference(&b.shadow)?;
                Some(ViewDifference {
                    pixels: differ as f64 / first.pixels.len() as f64,
                    shadow: found.shadow,
                    median_angle: found.median.to_degrees(),
                    angle_99: found.most.to_degrees(),
                })
            }
            _ => None,
        };
        let of = |view: &View| {
            let two = |figure: f64| (tracing.second > 0.0).then_some(figure);
            let throat = view.outline.as_ref().and_then(|outline| two(outline.radius().to_degrees()));
            ViewSummary { second_share: two(view.shadow.crossed()), throat_radius: throat, ..ViewSummary::from(view) }
        };
        Ok(Self {
            system: system.to_string(),
            unit: unit.map(str::to_string),
            width: camera.width,
            height: camera.height,
            distance: camera.distance,
            inclination: camera.inclination.to_degrees(),
            azimuth: camera.azimuth.to_degrees(),
            field_of_view: camera.field_of_view.to_degrees(),
            far: tracing.far,
            tolerance: tracing.tolerance,
            threads: tracing.threads,
            views: views.iter().map(|view| (view.name, of(view))).collect(),
            free_factor,
            difference,
        })
    }

    /// The camera, a table of the views, and their difference; `place` is where the picture is.
    pub fn findings(&self, place: Option<&str>) -> Findings {
        let mut findings = Findings::default();
        let unit = self.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
        let seen = format!(
            "{}, seen from {}{unit} at {} degrees from the axis{}",
            self.system,
            rounded(self.distance, 4),
            rounded(self.inclination, 4),
            place.map_or(String::new(), |place| format!(": {place}"))
        );
        findings.line(seen);
        let headers: Vec<&str> = std::iter::once("").chain(self.views.keys().copied()).collect();
        findings.gap().table(&headers, self.rows(&unit));
        if let Some(found) = &self.difference {
            let text = format!(
                "{} % of the pixels have another colour, {} % are in the shadow of one alone; places on the sky differ by {} degrees in the \
                 median, 99 % by less than {}.",
                percentage(found.pixels),
                percentage(found.shadow),
                rounded(found.median_angle, 2),
                rounded(found.angle_99, 2)
            );
            findings.gap().line(text);
        }
        if self.free_factor {
            let text = "Time and space are not coupled: motion does not determine the unit of time relative to that of space. The learned \
                        impact parameters are known up to one factor, and the area up to its square.";
            findings.line(text);
        }
        let unfinished: usize = self.views.values().map(|view| view.unfinished).sum();
        if unfinished > 0 {
            let rays = pluralize(unfinished, "ray is", "rays are");
            findings.line(format!("{rays} neither captured nor from the sky (magenta)"));
        }
        findings
    }

    /// The table of the views, a column for each.
    fn rows(&self, unit: &str) -> Vec<Vec<String>> {
        let row = |name: &str, of: &dyn Fn(&ViewSummary) -> Option<f64>, digits: usize| {
            let cells = self.views.values().map(|view| of(view).map_or("-".to_string(), |x| rounded(x, digits)));
            std::iter::once(name.to_string()).chain(cells).collect::<Vec<_>>()
        };
        let bracket = |unit: &str| if unit.is_empty() { String::new() } else { format!(" [{}]", unit.trim()) };
        let squared = if unit.is_empty() { String::new() } else { format!("{unit}^2") };
        let mut rows = vec![row("share of the picture in the shadow [%]", &|view| Some(100.0 * view.share), 4)];
        if self.views.values().any(|view| view.second_share.is_some()) {
            let share = |view: &ViewSummary| view.second_share.map(|share| 100.0 * share);
            rows.push(row("share that shows the second region [%]", &share, 4));
            rows.push(row("angular radius of the throat's image [deg]", &|view| view.throat_radius, 7));
        }
        if self.views.values().any(|view| view.area.is_some()) {
            let impact = |name: &str| format!("{name}, impact parameter{}", bracket(unit));
            rows.push(row(&impact("left edge"), &|view| view.left, 7));
            rows.push(row(&impact("right edge"), &|view| view.right, 7));
            rows.push(row(&impact("lower edge"), &|view| view.bottom, 7));
            rows.push(row(&impact("upper edge"), &|view| view.top, 7));
            rows.push(row(&format!("area in impact parameters{}", bracket(&squared)), &|view| view.area, 7));
        }
        let rays = (self.width * self.height) as f64;
        rows.push(row("largest drift of g(k, k), relative", &|view| Some(view.drift), 2));
        rows.push(row("rays unfinished", &|view| Some(view.unfinished as f64), 3));
        rows.push(row("steps of a ray", &|view| Some(view.steps as f64 / rays), 3));
        rows.push(row("seconds", &|view| Some(view.seconds), 3));
        rows.push(row("rays per second", &|view| Some(view.rays_per_second), 3));
        rows
    }
}

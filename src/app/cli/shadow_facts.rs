//! Facts of `lnn shadow`, as text or as a JSON object.

use crate::findings::text_table;
use crate::names::{percentage, pluralize, rounded};
use crate::relativity::{Camera, Difference, Image, Outline, RelativityError, Shadow, Tracing};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Rays through a metric, and the edge of its shadow.
pub struct View<'a> {
    /// `exact` or `learned`.
    pub name: &'a str,
    /// Its rays.
    pub shadow: Shadow,
    /// The edge of the shadow, if it was requested and there is one around the centre.
    pub outline: Option<Outline>,
    /// Seconds that the picture took.
    pub seconds: f64,
}

impl View<'_> {
    /// Impact parameters of the edge: left, right, below, above.
    fn extents(&self) -> [Option<f64>; 4] {
        let Some(outline) = &self.outline else { return [None; 4] };
        let [left, right] = [outline.left(), outline.right()].map(|edge| edge.celestial[0]);
        let [below, above] = [outline.bottom(), outline.top()].map(|edge| edge.celestial[1]);
        [left, right, below, above].map(Some)
    }

    /// Angular radius of the image of the second region, in degrees.
    fn throat(&self) -> Option<f64> {
        self.outline.as_ref().map(|outline| outline.radius().to_degrees())
    }

    fn rays_per_second(&self) -> f64 {
        self.shadow.rays.len() as f64 / self.seconds
    }
}

/// Views of one camera.
pub struct Facts<'a> {
    /// Name of the system.
    pub system: &'a str,
    /// Unit of the coordinates, if it is known.
    pub unit: Option<&'a str>,
    /// The camera.
    pub camera: &'a Camera,
    /// Distance of the camera from the centre, or its radial coordinate.
    pub distance: f64,
    /// Distance of the sky, or its radial coordinate.
    pub far: f64,
    /// Choices of the tracing.
    pub tracing: &'a Tracing,
    /// The exact metric, the learned one, or both.
    pub views: &'a [View<'a>],
    /// `true` if a metric was learned whose time and places do not act on each other: its impact parameters are known up to a factor.
    pub free_factor: bool,
}

impl Facts<'_> {
    /// `true` if there is a second region.
    fn is_two_sided(&self) -> bool {
        self.tracing.second > 0.0
    }

    /// Difference of the two views, if there are two, and the share of the pixels whose colours differ.
    fn difference(&self, images: &[Image]) -> Result<Option<(Difference, f64)>, RelativityError> {
        let ([a, b], [first, second, ..]) = (self.views, images) else { return Ok(None) };
        let differ = first.pixels.iter().zip(&second.pixels).filter(|(a, b)| a != b).count();
        Ok(Some((a.shadow.difference(&b.shadow)?, differ as f64 / first.pixels.len() as f64)))
    }

    /// One object, on a line.
    ///
    /// # Errors
    /// Views of different sizes.
    pub fn json(&self, images: &[Image]) -> Result<String, RelativityError> {
        let Self { system, unit, camera, tracing, views, free_factor, .. } = self;
        let mut object = Map::new();
        let mut put = |key: &str, value: Value| _ = object.insert(key.to_string(), value);
        put("system", json!(system));
        put("unit", json!(unit));
        put("width", json!(camera.width));
        put("height", json!(camera.height));
        put("distance", json!(self.distance));
        put("inclination", json!(camera.inclination.to_degrees()));
        put("azimuth", json!(camera.azimuth.to_degrees()));
        put("field_of_view", json!(camera.field_of_view.to_degrees()));
        put("far", json!(self.far));
        put("tolerance", json!(tracing.tolerance));
        put("threads", json!(tracing.threads));
        for view in *views {
            let [left, right, bottom, top] = view.extents();
            let mut value = json!({
                "share": view.shadow.share(),
                "area": view.outline.as_ref().map(|outline| outline.area),
                "left": left,
                "right": right,
                "bottom": bottom,
                "top": top,
                "unfinished": view.shadow.unfinished(),
                "drift": view.shadow.drift(),
                "steps": view.shadow.steps(),
                "seconds": view.seconds,
                "rays_per_second": view.rays_per_second(),
            });
            if self.is_two_sided() {
                value["second_share"] = json!(view.shadow.crossed());
                value["throat_radius"] = json!(view.throat());
            }
            put(view.name, value);
        }
        if *free_factor {
            put("free_factor", json!(true));
        }
        if let Some((difference, pixels)) = self.difference(images)? {
            let value = json!({
                "pixels": pixels,
                "shadow": difference.shadow,
                "median_angle": difference.median.to_degrees(),
                "angle_99": difference.most.to_degrees(),
            });
            put("difference", value);
        }
        Ok(format!("{}\n", Value::Object(object)))
    }

    /// Sentences and a table.
    ///
    /// # Errors
    /// Views of different sizes.
    pub fn text(&self, images: &[Image], out: &Path) -> Result<String, RelativityError> {
        let Self { system, unit, camera, views, .. } = self;
        let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
        let mut text = format!(
            "{}, seen from {}{unit} at {} degrees from the axis: {}\n\n",
            system,
            rounded(self.distance, 4),
            rounded(camera.inclination.to_degrees(), 4),
            out.display()
        );
        let headers: Vec<&str> = std::iter::once("").chain(views.iter().map(|view| view.name)).collect();
        let row = |name: &str, of: &dyn Fn(&View) -> Option<f64>, digits: usize| {
            let cells = views.iter().map(|view| of(view).map_or("-".to_string(), |x| rounded(x, digits)));
            std::iter::once(name.to_string()).chain(cells).collect::<Vec<_>>()
        };
        let bracket = |unit: &str| if unit.is_empty() { String::new() } else { format!(" [{}]", unit.trim()) };
        let impact = |name: &str| format!("{name}, impact parameter{}", bracket(&unit));
        let squared = if unit.is_empty() { String::new() } else { format!("{unit}^2") };
        let mut rows = vec![row("share of the picture in the shadow [%]", &|v| Some(100.0 * v.shadow.share()), 4)];
        if self.is_two_sided() {
            rows.push(row("share that shows the second region [%]", &|v| Some(100.0 * v.shadow.crossed()), 4));
            rows.push(row("angular radius of the throat's image [deg]", &|view| view.throat(), 7));
        }
        if views.iter().any(|view| view.outline.is_some()) {
            for (k, name) in ["left edge", "right edge", "lower edge", "upper edge"].into_iter().enumerate() {
                rows.push(row(&impact(name), &|view| view.extents()[k], 7));
            }
            let name = format!("area in impact parameters{}", bracket(&squared));
            rows.push(row(&name, &|view| view.outline.as_ref().map(|outline| outline.area), 7));
        }
        rows.push(row("largest drift of g(k, k), relative", &|view| Some(view.shadow.drift()), 2));
        rows.push(row("rays unfinished", &|view| Some(view.shadow.unfinished() as f64), 3));
        rows.push(row("steps of a ray", &|view| Some(view.shadow.steps() as f64 / view.shadow.rays.len() as f64), 3));
        rows.push(row("seconds", &|view| Some(view.seconds), 3));
        rows.push(row("rays per second", &|view| Some(view.rays_per_second()), 3));
        text += &text_table(&headers, &rows);
        if let Some((difference, pixels)) = self.difference(images)? {
            text += &format!(
                "\n{} % of the pixels have another colour, {} % are in the shadow of one alone; places on the sky differ by {} degrees in the \
                 median, 99 % by less than {}.\n",
                percentage(pixels),
                percentage(difference.shadow),
                rounded(difference.median.to_degrees(), 2),
                rounded(difference.most.to_degrees(), 2)
            );
            text = crate::names::wrap_text(&text, crate::names::WIDTH);
        }
        if self.free_factor {
            text += &crate::names::wrap_text(
                "Time and space are not coupled: motion does not determine the unit of time relative to that of space. The learned \
                 impact parameters are known up to one factor, and the area up to its square.\n",
                crate::names::WIDTH,
            );
        }
        let unfinished: usize = views.iter().map(|view| view.shadow.unfinished()).sum();
        if unfinished > 0 {
            text += &format!(
                "{} neither captured nor from the sky (magenta)\n",
                pluralize(unfinished, "ray is", "rays are")
            );
        }
        Ok(text)
    }
}

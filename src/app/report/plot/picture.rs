//! A picture: panels beside each other.

use super::svg::{Panel, short};
use crate::report::escape::escape;
use std::fmt::Write as _;

/// Fonts of every reader's machine.
const FONT: &str = "system-ui,-apple-system,Segoe UI,Roboto,Helvetica,Arial,sans-serif";
/// Distance of panels.
const GAP: f64 = 8.0;

/// A picture in SVG. A page lets its panels wrap, a file has them in one row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub(super) panels: Vec<Panel>,
}

impl Picture {
    /// Number of panels.
    pub fn panels(&self) -> usize {
        self.panels.len()
    }

    /// An SVG file.
    pub fn to_svg(&self) -> String {
        let height = self.panels.iter().map(|panel| panel.height).fold(0.0, f64::max);
        let (mut body, mut x) = (String::new(), 0.0);
        for panel in &self.panels {
            let (width, height) = (short(panel.width), short(panel.height));
            let _ =
                writeln!(body, "<svg x=\"{}\" width=\"{width}\" height=\"{height}\">{}</svg>", short(x), panel.body());
            x += panel.width + GAP;
        }
        let (width, height) = (short((x - GAP).max(0.0)), short(height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"{FONT}\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{body}</svg>\n"
        )
    }

    /// The panels for a page, one element each.
    pub(in crate::app::report) fn to_html(&self, description: &str) -> String {
        let description = escape(description);
        let panel = |panel: &Panel| {
            let (width, height) = (short(panel.width), short(panel.height));
            format!(
                "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" font-family=\"{FONT}\" \
                 role=\"img\" aria-label=\"{description}\">{}</svg>\n",
                panel.body()
            )
        };
        self.panels.iter().map(panel).collect()
    }
}

//! Drawing in SVG; lengths are in pixels from the upper left corner.

use super::lines::simplify;
use crate::report::html::{base64, escape};
use std::fmt::Write as _;

/// Colour of texts and axes.
pub(super) const INK: &str = "#1c2330";
/// Colour of lines behind the data.
pub(super) const GRID: &str = "#e3e7ee";
/// Distance from a path, in pixels, within which points are left out.
const TOLERANCE: f64 = 0.08;
/// Approximate width of a letter relative to its font size.
const LETTER: f64 = 0.56;

/// Position of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Approximate width of a text in pixels.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    LETTER * size * text.chars().filter(|c| !('\u{300}'..'\u{370}').contains(c)).count() as f64
}

/// The size, at most `size`, at which a text is no longer than `width`.
pub(super) fn fitting(text: &str, size: f64, width: f64) -> f64 {
    (size * width / text_width(text, size).max(1.0)).min(size)
}

/// Size of titles, and width of their bold letters relative to plain ones.
const TITLE: f64 = 14.0;
const BOLD: f64 = 1.16;
/// Font size of a legend, and length of its lines.
const ENTRY: (f64, f64) = (12.5, 22.0);

/// Width of an entry of a legend, including the space after it.
pub(super) fn entry_width(name: &str) -> f64 {
    ENTRY.1 + text_width(name, ENTRY.0) + 19.0
}

/// A drawing and its size.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Panel {
    pub width: f64,
    pub height: f64,
    body: String,
}

impl Panel {
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new() }
    }

    /// Drawing, on white.
    pub fn body(&self) -> String {
        format!("<rect width=\"{}\" height=\"{}\" fill=\"#fff\"/>{}", short(self.width), short(self.height), self.body)
    }

    pub fn text(&mut self, (x, y): (f64, f64), size: f64, anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let (x, y, size, text) = (short(x), short(y), short(size), escape(text));
        let _ =
            write!(self.body, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"{INK}\"{anchor}>{text}</text>");
    }

    /// Adds a title at the top, starting at `from` if it fits there.
    pub fn title(&mut self, from: f64, text: &str) {
        let size = fitting(text, TITLE, (self.width - 16.0) / BOLD);
        let x = from.min(self.width - 8.0 - BOLD * text_width(text, size)).max(8.0);
        let (x, y, size, text) = (short(x), short(19.0), short(size), escape(text));
        let style = "font-weight=\"600\"";
        let _ =
            write!(self.body, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"{INK}\" {style}>{text}</text>");
    }

    /// An entry of a legend: a line and its name.
    pub fn entry(&mut self, (x, y): (f64, f64), (colour, width): (&str, f64), name: &str) {
        self.segments(&[[(x, y), (x + ENTRY.1, y)]], colour, width.max(2.0));
        self.text((x + ENTRY.1 + 5.0, y + 4.0), ENTRY.0, Anchor::Start, name);
    }

    /// Adds a text that ends at a point, with a halo so that it is readable over lines.
    pub fn haloed_text(&mut self, (x, y): (f64, f64), size: f64, text: &str) {
        let (x, y, size, text) = (short(x), short(y), short(size), escape(text));
        let halo = "paint-order=\"stroke\" stroke=\"#fff\" stroke-width=\"3\" stroke-linejoin=\"round\"";
        let _ = write!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"{INK}\" text-anchor=\"end\" {halo}>{text}</text>"
        );
    }

    /// Adds a text that reads upwards, centred at the point.
    pub fn vertical_text(&mut self, (x, y): (f64, f64), size: f64, text: &str) {
        let (x, y, size, text) = (short(x), short(y), short(size), escape(text));
        let _ = write!(
            self.body,
            "<text transform=\"translate({x} {y}) rotate(-90)\" font-size=\"{size}\" fill=\"{INK}\" \
             text-anchor=\"middle\">{text}</text>"
        );
    }

    /// Segments of one colour and width.
    pub fn segments(&mut self, segments: &[[(f64, f64); 2]], colour: &str, width: f64) {
        if segments.is_empty() {
            return;
        }
        let mut d = String::new();
        for [(x, y), (u, w)] in segments {
            let _ = write!(d, "M{} {}L{} {}", short(*x), short(*y), short(*u), short(*w));
        }
        let width = short(width);
        let _ = write!(self.body, "<path d=\"{d}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>");
    }

    /// Lines through finite points, to a twelfth of a pixel.
    pub fn lines(&mut self, lines: &[Vec<(f64, f64)>], colour: &str, width: f64) {
        let mut d = String::new();
        for line in lines {
            // Tenths of a pixel, each point relative to the previous one.
            let mut points = simplify(line, TOLERANCE).into_iter();
            let tenths = |(x, y): (f64, f64)| ((10.0 * x).round() as i64, (10.0 * y).round() as i64);
            let Some(mut before) = points.next().map(tenths) else { continue };
            let _ = write!(d, "M{} {}", before.0, before.1);
            let mut sign = "l";
            for point in points.map(tenths) {
                let (dx, dy) = (point.0 - before.0, point.1 - before.1);
                if (dx, dy) != (0, 0) {
                    let _ = write!(
                        d,
                        "{}{dx}{}{dy}",
                        if sign == " " && dx < 0 { "" } else { sign },
                        if dy < 0 { "" } else { " " }
                    );
                    (before, sign) = (point, " ");
                }
            }
        }
        if d.is_empty() {
            return;
        }
        let width = short(10.0 * width);
        let _ = write!(
            self.body,
            "<path transform=\"scale(.1)\" d=\"{d}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" \
             stroke-linejoin=\"round\" stroke-linecap=\"round\"/>"
        );
    }

    /// Dots.
    pub fn dots(&mut self, points: &[(f64, f64)], colour: &str, diameter: f64) {
        if points.is_empty() {
            return;
        }
        let mut d = String::new();
        for (x, y) in points {
            let _ = write!(d, "M{} {}h0", short(*x), short(*y));
        }
        let width = short(diameter);
        let _ = write!(
            self.body,
            "<path d=\"{d}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linecap=\"round\"/>"
        );
    }

    /// Adds a stretched PNG whose pixels remain sharp squares.
    pub fn image(&mut self, png: &[u8], (x, y): (f64, f64), (width, height): (f64, f64)) {
        let _ = write!(
            self.body,
            "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:pixelated\" href=\"data:image/png;base64,{}\"/>",
            short(x),
            short(y),
            short(width),
            short(height),
            base64(png)
        );
    }

    /// Adds another drawing at a position; parts outside its size are clipped.
    pub fn inset(&mut self, (x, y): (f64, f64), inner: &Self) {
        let (x, y, width, height) = (short(x), short(y), short(inner.width), short(inner.height));
        let _ = write!(
            self.body,
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" overflow=\"hidden\">{}</svg>",
            inner.body
        );
    }
}

/// Formats a length with at most two decimals.
pub(super) fn short(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_string() } else { text.to_string() }
}

/// Colours that are distinguishable with any colour vision (Wong 2011), without yellow.
pub(super) const LINES: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#333333"];
/// Colour and width of a line under others, and the width of those.
pub(super) const UNDER: (&str, f64) = ("#93C5E8", 4.4);
pub(super) const OVER: f64 = 1.5;
/// Colour of highlights: the start of a path, a wrong sign.
pub(super) const MARK: &str = "#D55E00";
/// Colour of places without a value.
pub(super) const GAP: [u8; 3] = [0xbb, 0xbb, 0xbb];

/// Colours at equal distances, linear between them.
pub(super) type Scale = &'static [[u8; 3]];

/// Viridis of matplotlib, from dark to bright.
pub(super) const VIRIDIS: Scale = &[
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3e, 0x49, 0x89],
    [0x31, 0x68, 0x8e],
    [0x26, 0x82, 0x8e],
    [0x1f, 0x9e, 0x89],
    [0x35, 0xb7, 0x79],
    [0x6e, 0xce, 0x58],
    [0xb5, 0xde, 0x2b],
    [0xfd, 0xe7, 0x25],
];

/// Blue, white, red (ColorBrewer).
pub(super) const DIVERGING: Scale = &[
    [0x21, 0x66, 0xac],
    [0x67, 0xa9, 0xcf],
    [0xd1, 0xe5, 0xf0],
    [0xf7, 0xf7, 0xf7],
    [0xfd, 0xdb, 0xc7],
    [0xef, 0x8a, 0x62],
    [0xb2, 0x18, 0x2b],
];

/// The colour at `t` in `[0, 1]`.
pub(super) fn at(scale: Scale, t: f64) -> [u8; 3] {
    let place = t.clamp(0.0, 1.0) * (scale.len() - 1) as f64;
    let below = (place as usize).min(scale.len() - 2);
    let part = place - below as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(scale[below][i]), f64::from(scale[below + 1][i]));
        (a + part * (b - a)).round() as u8
    })
}

/// The colour in SVG notation.
pub(super) fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_written_in_tenths_and_steps() {
        let mut panel = Panel::new(10.0, 10.0);
        panel.lines(&[vec![(1.0, 2.0), (1.5, 1.0), (0.5, 3.0), (0.5, 3.01)]], "#000", 1.2);
        assert!(panel.body().contains("d=\"M10 20l5-10-10 20\"") && panel.body().contains("stroke-width=\"12\""));
        panel.vertical_text((3.0, 4.0), 12.0, "a < b");
        assert_eq!(panel.body().matches("a &lt; b").count(), 1);
        assert_eq!([short(-0.001), short(2.50), short(1e3)], ["0", "2.5", "1000"]);
        assert!(fitting("a long label", 13.0, 40.0) < 7.0 && fitting("a", 13.0, 40.0) == 13.0);
    }
}

//! Axes: positions of values, ticks with their texts, and the frame around the data.

use super::svg::{Anchor, GRID, INK, Panel, fitting, text_width};
use std::f64::consts::PI;

/// Size of tick texts.
const TICK: f64 = 12.0;
/// Size of labels.
const LABEL: f64 = 13.0;
/// Height of a title line, and of the margin above data without title.
pub(super) const TITLE_HEIGHT: f64 = 28.0;
pub(super) const TOP: f64 = 12.0;
/// Height of a row of a legend.
pub(super) const ROW: f64 = 18.0;
/// Height of the margin below the data.
pub(super) const BELOW: f64 = 44.0;
/// Largest number of decades for which every multiple of a power of ten has a tick.
const FEW_DECADES: f64 = 6.0;

/// Scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AxisScale {
    Linear,
    Logarithmic,
    /// Radians with ticks at multiples of fractions of pi.
    Angle,
}

/// One axis: from `low` to `high`, which must differ.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
    pub kind: AxisScale,
    pub label: String,
}

/// A tick and its text; minor ticks have none.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub at: f64,
    pub text: Option<String>,
}

impl Axis {
    pub fn new(low: f64, high: f64, kind: AxisScale, label: &str) -> Self {
        Self { low, high, kind, label: label.to_string() }
    }

    /// The position of a value, 0 at the lower and 1 at the upper end.
    pub fn place(&self, x: f64) -> f64 {
        match self.kind {
            AxisScale::Logarithmic => (x.ln() - self.low.ln()) / (self.high.ln() - self.low.ln()),
            _ => (x - self.low) / (self.high - self.low),
        }
    }

    /// Computes about `most` ticks, and the power of ten that their texts omit.
    pub fn ticks(&self, most: usize) -> (Vec<Tick>, i32) {
        match self.kind {
            AxisScale::Linear => self.linear(most),
            AxisScale::Logarithmic => (self.decades(most), 0),
            AxisScale::Angle => {
                let step = [0.25, 0.5, 1.0, 2.0].map(|part| part * PI);
                let step = step.into_iter().find(|step| (self.high - self.low) / step <= most.min(4) as f64 + 0.5);
                let Some(step) = step else { return self.linear(most) };
                let text = |at: f64| Some(parts_of_pi((4.0 * at / PI).round() as i64));
                (multiples(self.low, self.high, step).into_iter().map(|at| Tick { at, text: text(at) }).collect(), 0)
            }
        }
    }

    fn linear(&self, most: usize) -> (Vec<Tick>, i32) {
        let largest = self.low.abs().max(self.high.abs());
        let power = if largest > 0.0 { largest.log10().floor() as i32 } else { 0 };
        let power = if (-2..5).contains(&power) { 0 } else { power };
        // A single value gets one tick.
        let room = f64::max(self.high - self.low, f64::MIN_POSITIVE / f64::EPSILON);
        let (step, digits) = step(room / most.max(1) as f64);
        let decimals = power.saturating_sub(digits).clamp(0, 15) as usize;
        let factor = 10f64.powi(power);
        let text = |at: f64| format!("{:.decimals$}", at / factor).replace('-', "\u{2212}");
        let ticks = multiples(self.low, self.high, step).into_iter().map(|at| Tick { at, text: Some(text(at)) });
        (ticks.collect(), power)
    }

    fn decades(&self, most: usize) -> Vec<Tick> {
        let (from, to) = (self.low.log10().round() as i32, self.high.log10().round() as i32);
        let every = ((to - from) / most.max(1) as i32 + 1).max(1);
        let (few, one) = (f64::from(to - from) <= FEW_DECADES, to - from == 1);
        let mut ticks = Vec::new();
        for exponent in from..=to {
            let text = (exponent.rem_euclid(every) == 0).then(|| power_of_ten(1, exponent));
            ticks.push(Tick { at: 10f64.powi(exponent), text });
            for digit in (2..10).filter(|_| few && exponent < to) {
                let text = (one && [2, 5].contains(&digit)).then(|| power_of_ten(digit, exponent));
                ticks.push(Tick { at: f64::from(digit) * 10f64.powi(exponent), text });
            }
        }
        ticks
    }

    /// The label with the power of ten that the ticks omit.
    fn labelled(&self, power: i32) -> String {
        match power {
            0 => self.label.clone(),
            _ => format!("{} (\u{d7} {})", self.label, power_of_ten(1, power)),
        }
    }
}

/// Rounds a step up to 1, 2 or 5 times a power of ten; also returns the exponent of its last digit.
fn step(least: f64) -> (f64, i32) {
    let power = least.log10().floor() as i32;
    let unit = 10f64.powi(power);
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * unit >= least * (1.0 - 1e-9)).unwrap_or(10.0);
    if step == 10.0 { (10.0 * unit, power + 1) } else { (step * unit, power) }
}

/// Multiples of `step` within bounds.
fn multiples(low: f64, high: f64, step: f64) -> Vec<f64> {
    let (from, to) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    // The number is limited for any input.
    let count = (to - from).clamp(-1.0, 50.0) as i64;
    (0..=count).map(|k| (from + k as f64) * step + 0.0).collect()
}

/// Formats multiples of pi/4.
fn parts_of_pi(quarters: i64) -> String {
    let sign = if quarters < 0 { "\u{2212}" } else { "" };
    let (over, under) = match quarters.abs() {
        0 => return "0".to_string(),
        q if q % 4 == 0 => (q / 4, ""),
        q if q % 2 == 0 => (q / 2, "/2"),
        q => (q, "/4"),
    };
    let over = if over == 1 { String::new() } else { over.to_string() };
    format!("{sign}{over}\u{3c0}{under}")
}

/// `digit` times a power of ten, written out near 1.
fn power_of_ten(digit: i32, exponent: i32) -> String {
    if (-2..4).contains(&exponent) {
        let decimals = (-exponent).max(0) as usize;
        return format!("{:.decimals$}", f64::from(digit) * 10f64.powi(exponent));
    }
    let plain = exponent.to_string();
    let raised = plain.chars().map(|c| match c {
        '-' => '\u{207b}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        c => char::from_u32('\u{2070}' as u32 + c.to_digit(10).unwrap_or(0)).unwrap_or(c),
    });
    let factor = if digit == 1 { String::new() } else { format!("{digit}\u{b7}") };
    format!("{factor}10{}", raised.collect::<String>())
}

/// The area of the data in a panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Area {
    /// A point, relative to the upper left corner of the area.
    pub fn point(&self, (x, y): (&Axis, &Axis), (u, w): (f64, f64)) -> (f64, f64) {
        (x.place(u) * self.width, (1.0 - y.place(w)) * self.height)
    }
}

/// Computes the ticks of a vertical axis of this height.
fn upright(y: &Axis, height: f64) -> (Vec<Tick>, i32) {
    y.ticks((height / 42.0).max(2.0) as usize)
}

/// Margin left of the data for label and ticks of a vertical axis.
pub(super) fn room_left(y: &Axis, height: f64) -> f64 {
    let ticks = upright(y, height).0;
    let widest = ticks.iter().filter_map(|tick| tick.text.as_ref()).map(|text| text_width(text, TICK));
    widest.fold(0.0, f64::max) + 34.0
}

/// Draws title, axes, ticks and grid around an area; the data are drawn on top.
pub(super) fn frame(panel: &mut Panel, area: Area, axes: (&Axis, &Axis), title: &str) {
    let grid = ruled(panel, area, axes, title);
    panel.segments(&grid, GRID, 0.7);
}

/// Draws title, axes and ticks around an area; returns the lines of the grid.
pub(super) fn ruled(panel: &mut Panel, area: Area, (x, y): (&Axis, &Axis), title: &str) -> Vec<[(f64, f64); 2]> {
    let Area { left, top, width, height } = area;
    let (right, bottom) = (left + width, top + height);
    let (mut grid, mut marks) = (Vec::new(), Vec::new());
    if !title.is_empty() {
        panel.title(left, title);
    }

    // Uses as many ticks as their texts have room for.
    let fits = |most: &usize| {
        let widest =
            x.ticks(*most).0.iter().filter_map(|t| t.text.as_ref()).map(|t| text_width(t, TICK)).fold(0.0, f64::max);
        let count = x.ticks(*most).0.iter().filter(|t| t.text.is_some()).count();
        count as f64 * (widest + 14.0) <= width + widest
    };
    let most = (2..=8).rev().find(fits).unwrap_or(2);
    let (ticks, power) = x.ticks(most);
    for Tick { at, text } in &ticks {
        let place = left + x.place(*at) * width;
        if !(left - 0.5..=right + 0.5).contains(&place) {
            continue;
        }
        marks.push([(place, bottom), (place, bottom + if text.is_some() { 5.0 } else { 3.0 })]);
        if let Some(text) = text {
            grid.push([(place, top), (place, bottom)]);
            panel.text((place, bottom + 18.0), TICK, Anchor::Middle, text);
        }
    }
    let label = x.labelled(power);
    let size = fitting(&label, LABEL, panel.width - 8.0);
    let half = 0.5 * text_width(&label, size);
    let middle = (left + 0.5 * width).min(panel.width - 4.0 - half);
    panel.text((middle, bottom + 37.0), size, Anchor::Middle, &label);

    let (ticks, power) = upright(y, height);
    for Tick { at, text } in &ticks {
        let place = bottom - y.place(*at) * height;
        if !(top - 0.5..=bottom + 0.5).contains(&place) {
            continue;
        }
        marks.push([(left - if text.is_some() { 5.0 } else { 3.0 }, place), (left, place)]);
        if let Some(text) = text {
            grid.push([(left, place), (right, place)]);
            panel.text((left - 8.0, place + 4.0), TICK, Anchor::End, text);
        }
    }
    let label = y.labelled(power);
    let size = fitting(&label, LABEL, panel.height - 8.0);
    let half = 0.5 * text_width(&label, size);
    let middle =
        (top + 0.5 * height).clamp(half.min(0.5 * panel.height), (panel.height - half).max(0.5 * panel.height));
    panel.vertical_text((14.0, middle), size, &label);

    panel.segments(&marks, INK, 0.8);
    let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
    let sides: Vec<[(f64, f64); 2]> = corners.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    panel.segments(&sides, INK, 0.8);
    grid
}

/// Formats a number with four digits.
pub(super) fn number(x: f64) -> String {
    if x == 0.0 || x.abs() < 1e-300 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&x.abs()) {
        return format!("{x:.1e}").replace(".0e", "e").replace('-', "\u{2212}");
    }
    let digits = (3 - x.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{x:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(low: f64, high: f64, kind: AxisScale, most: usize) -> (Vec<String>, i32) {
        let (ticks, power) = Axis::new(low, high, kind, "").ticks(most);
        (ticks.into_iter().filter_map(|tick| tick.text).collect(), power)
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(
            texts(0.0, 10.0, AxisScale::Linear, 5),
            (["0", "2", "4", "6", "8", "10"].map(String::from).to_vec(), 0)
        );
        assert_eq!(
            texts(-0.35, 0.31, AxisScale::Linear, 4),
            (["\u{2212}0.2", "0.0", "0.2"].map(String::from).to_vec(), 0)
        );
        assert_eq!(
            texts(0.0, 2.1e6, AxisScale::Linear, 5),
            (["0.0", "0.5", "1.0", "1.5", "2.0"].map(String::from).to_vec(), 6)
        );
        assert_eq!(texts(0.0, 4e-5, AxisScale::Linear, 4), (["0", "1", "2", "3", "4"].map(String::from).to_vec(), -5));
        assert_eq!(texts(1000.0001, 1000.0003, AxisScale::Linear, 2).0, ["1000.0001", "1000.0002", "1000.0003"]);
        assert_eq!(
            texts(-PI, PI, AxisScale::Angle, 4).0,
            ["\u{2212}\u{3c0}", "\u{2212}\u{3c0}/2", "0", "\u{3c0}/2", "\u{3c0}"]
        );
        assert_eq!(texts(1e-6, 1.0, AxisScale::Logarithmic, 3).0, ["10\u{207b}\u{2076}", "10\u{207b}\u{b3}", "1"]);
        assert_eq!(texts(0.01, 0.1, AxisScale::Logarithmic, 5).0, ["0.01", "0.02", "0.05", "0.1"]);
        for (x, text) in [(0.0, "0"), (0.1 + 0.2, "0.3"), (-2.5, "\u{2212}2.5"), (1000.0, "1000"), (1e6, "1e6")] {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn no_axis_has_many_ticks() {
        for (low, high) in [(0.0, 1e-300), (-1e150, 1e150), (1.0, 1.0 + 1e-9), (5.0, 5.0), (f64::MIN_POSITIVE, 1.0)] {
            for kind in [AxisScale::Linear, AxisScale::Angle] {
                assert!(Axis::new(low, high, kind, "").ticks(6).0.len() < 60);
            }
        }
        let decades = Axis::new(1e-300, 1e150, AxisScale::Logarithmic, "").ticks(5).0;
        assert!(decades.iter().filter(|tick| tick.text.is_some()).count() <= 6);
    }
}

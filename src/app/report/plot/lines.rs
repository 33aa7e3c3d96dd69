//! Lines over a common axis.

use super::axes::{Area, Axis, BELOW, Kind, TITLE_HEIGHT, frame, room_left};
use super::colours::LINES;
use super::svg::{Anchor, INK, Panel, fitting, text_width};
use super::{LinePlot, Picture, PlotError, Series, range, stretches, values, window};

/// Size of the picture without its legend.
const SIZE: (f64, f64) = (496.0, 304.0);
/// Room right of the data.
const RIGHT: f64 = 14.0;
/// Size of the texts of a legend, height of a row of it, length of its lines.
const LEGEND: (f64, f64, f64) = (12.5, 18.0, 22.0);
/// Decades below the largest value that a logarithmic axis shows.
const DECADES: f64 = 1e-18;
/// Widths of a line, and of one that another is drawn over.
const WIDTHS: (f64, f64) = (1.1, 3.4);
/// Width of each of several lines that swing so often that they would fill the picture.
const DENSE: f64 = 0.7;
/// Points from which on a line may be one of these.
const MANY: usize = 500;
/// The colour of a line that another is drawn over.
const UNDER: &str = "#7FB8DC";

/// Draws lines.
///
/// # Errors
/// [`PlotError::Empty`] if nothing can be shown.
pub fn line_plot(plot: &LinePlot) -> Result<Picture, PlotError> {
    let empty = || PlotError::Empty(plot.title.clone());
    let mut series = plot.series.clone();
    let all_x = range(series.iter().flat_map(|s| &s.points).map(|p| p.0));
    if plot.log_y {
        let top = values(&series, |p| p.1).fold(f64::NEG_INFINITY, f64::max);
        for point in series.iter_mut().flat_map(|s| &mut s.points) {
            if point.1 <= 0.0 || point.1 < top * DECADES {
                point.1 = f64::NAN;
            }
        }
    }
    // A line that runs away does not shrink the one that it is drawn over.
    let overlaid = series.iter().any(|s| s.over);
    let y = if overlaid { window(&series, |p| p.1) } else { range(values(&series, |p| p.1)) };
    let (y, x) = (y.ok_or_else(empty)?, all_x.ok_or_else(empty)?);
    // Points without lines want room around them.
    let scattered = series.iter().all(|s| stretches(&s.points).iter().all(|stretch| stretch.len() == 1));
    let margin = if scattered { 0.04 * (x.1 - x.0) } else { 0.0 };
    let x = Axis::new(x.0 - margin, x.1 + margin, Kind::Linear, &plot.x_label);
    let y = vertical(plot, &series, y);

    let height = SIZE.1 - TITLE_HEIGHT - BELOW - 4.0;
    let left = room_left(&y, height);
    let entries = legend(&series, SIZE.0 - left);
    let rows = entries.last().map_or(0, |(row, ..)| row + 1) as f64 * LEGEND.1;
    let mut panel = Panel::new(SIZE.0, SIZE.1 + rows);
    let area = Area { left, top: TITLE_HEIGHT + rows, width: SIZE.0 - left - RIGHT, height };
    frame(&mut panel, area, (&x, &y), &plot.title);
    for (row, place, index, name) in entries {
        let (colour, width, _) = look(&series, index);
        let (at, middle) = (left + place, TITLE_HEIGHT + LEGEND.1 * row as f64 + 3.0);
        panel.segments(&[[(at, middle), (at + LEGEND.2, middle)]], colour, width.max(2.0));
        panel.text((at + LEGEND.2 + 5.0, middle + 4.0), LEGEND.0, Anchor::Start, &name);
    }

    let mut inner = Panel::new(area.width, area.height);
    // What others are drawn over comes first.
    let mut order: Vec<usize> = (0..series.len()).collect();
    order.sort_by_key(|&index| series[index].over);
    for index in order {
        let (colour, width, diameter) = look(&series, index);
        let stretches = stretches(&series[index].points).into_iter();
        let near = |(x, y): (f64, f64)| (x, y.clamp(-area.height, 2.0 * area.height));
        let stretches = stretches.map(|s| s.into_iter().map(|p| near(area.point((&x, &y), p))).collect::<Vec<_>>());
        let (dots, lines): (Vec<_>, Vec<_>) = stretches.partition(|stretch| stretch.len() == 1);
        let diameter = if scattered { 7.0 } else { diameter };
        inner.lines(&lines, colour, width);
        inner.dots(&dots.concat(), colour, diameter);
    }
    if let Some(level) = &plot.level {
        let height = area.point((&x, &y), (x.low, level.value)).1;
        inner.segments(&[[(0.0, height), (area.width, height)]], INK, 0.8);
        let size = fitting(&level.name, 11.5, area.width - 12.0);
        let below = height < 18.0;
        let text = (area.width - 6.0, if below { height + 13.0 } else { height - 4.0 });
        inner.haloed_text(text, size, &level.name);
    }
    panel.inset((area.left, area.top), &inner);
    Ok(Picture { panels: vec![panel] })
}

fn vertical(plot: &LinePlot, series: &[Series], (low, high): (f64, f64)) -> Axis {
    let level = plot.level.as_ref().map(|level| level.value);
    if plot.log_y {
        let all = || values(series, |p| p.1).chain(level);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        let (low, high) = (10f64.powf(low.log10().floor()), 10f64.powf((high.log10() - 1e-9).ceil()));
        return Axis::new(low, if high > low { high } else { low * 10.0 }, Kind::Logarithmic, &plot.y_label);
    }
    match plot.turn {
        Some(turn) => Axis::new(turn.low(), turn.high(), Kind::Angle, &plot.y_label),
        None => {
            let room = 0.05 * (high - low);
            Axis::new(low - room, high + room, Kind::Linear, &plot.y_label)
        }
    }
}

/// Colour and width of a line, diameter of its dots.
fn look(series: &[Series], index: usize) -> (&'static str, f64, f64) {
    let overlaid = series.len() > 1 && series.iter().any(|s| s.over);
    if overlaid && !series[index].over {
        return (if index == 0 { UNDER } else { LINES[index % LINES.len()] }, WIDTHS.1, WIDTHS.1);
    }
    let dense = !overlaid && series.len() > 1 && series.iter().any(|s| s.points.len() > MANY);
    (LINES[index % LINES.len()], if dense { DENSE } else { WIDTHS.0 }, 4.0)
}

/// Row, place, series and name of every entry of a legend, if there are several series.
fn legend(series: &[Series], room: f64) -> Vec<(usize, f64, usize, String)> {
    let (mut row, mut place, mut entries) = (0, 0.0, Vec::new());
    let named = series.iter().enumerate().filter(|(_, s)| series.len() > 1 && !s.name.is_empty());
    for (index, series) in named {
        let width = LEGEND.2 + 5.0 + text_width(&series.name, LEGEND.0) + 14.0;
        if place > 0.0 && place + width > room {
            (row, place) = (row + 1, 0.0);
        }
        entries.push((row, place, index, series.name.clone()));
        place += width;
    }
    entries
}

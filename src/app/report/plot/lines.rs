//! Lines over a common axis, reduced to the points that are visible.

use super::axes::{Area, Axis, AxisScale, BELOW, ROW, TOP, frame, room_left};
use super::svg::{INK, LINES, OVER, Panel, UNDER, entry_width, fitting};
use super::{LinePlot, Picture, PlotError, Series, range, stretches, values, window};

/// Size of the picture without its legend.
const SIZE: (f64, f64) = (496.0, 288.0);
/// Margin right of the data.
const RIGHT: f64 = 14.0;
/// Smallest value of a logarithmic axis relative to the largest.
const DECADES: f64 = 1e-18;
/// Width of a line.
const WIDTH: f64 = 1.3;
/// Width of lines with fast oscillations, several of which would otherwise fill the picture.
const DENSE: f64 = 0.7;
/// Fewest points of such a line.
const MANY: usize = 500;
/// Colour of lines for undetermined quantities.
const OPEN: &str = "#9aa1ad";

/// Draws lines.
///
/// # Errors
/// [`PlotError::Empty`] if nothing can be shown.
pub fn line_plot(plot: &LinePlot) -> Result<Picture, PlotError> {
    let empty = || PlotError::Empty(plot.y_label.clone());
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
    // A diverging line must not shrink the line that it is compared with.
    let overlaid = series.iter().any(|s| s.over);
    let y = if overlaid { window(&series, |p| p.1) } else { range(values(&series, |p| p.1)) };
    let (y, x) = (y.ok_or_else(empty)?, all_x.ok_or_else(empty)?);
    let blank = values(&series, |p| p.1).all(|y| y == 0.0);
    // Isolated points need a margin around them.
    let scattered = series.iter().all(|s| stretches(&s.points).iter().all(|stretch| stretch.len() == 1));
    let margin = if scattered { 0.04 * (x.1 - x.0) } else { 0.0 };
    let x = Axis::new(x.0 - margin, x.1 + margin, AxisScale::Linear, &plot.x_label);
    let y = vertical(plot, &series, y);

    let height = SIZE.1 - TOP - BELOW - 4.0;
    let left = room_left(&y, height);
    let entries = legend(&series, SIZE.0 - left);
    let rows = entries.last().map_or(0, |(row, ..)| row + 1) as f64 * ROW;
    let mut panel = Panel::new(SIZE.0, SIZE.1 + rows);
    let area = Area { left, top: TOP + rows, width: SIZE.0 - left - RIGHT, height };
    frame(&mut panel, area, (&x, &y), "");
    for (row, place, index, name) in entries {
        let (colour, width, _) = look(plot, index);
        panel.entry((left + place, TOP + ROW * row as f64 + 3.0), (colour, width), &name);
    }

    let mut inner = Panel::new(area.width, area.height);
    // Lines that are drawn over others come last.
    let mut order: Vec<usize> = (0..series.len()).collect();
    order.sort_by_key(|&index| series[index].over);
    for index in order {
        let (colour, width, diameter) = look(plot, index);
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
    Ok(Picture { panels: vec![panel], blank })
}

fn vertical(plot: &LinePlot, series: &[Series], (low, high): (f64, f64)) -> Axis {
    let level = plot.level.as_ref().map(|level| level.value);
    if plot.log_y {
        let all = || values(series, |p| p.1).chain(level);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        let (low, high) = (10f64.powf(low.log10().floor()), 10f64.powf((high.log10() - 1e-9).ceil()));
        return Axis::new(low, if high > low { high } else { low * 10.0 }, AxisScale::Logarithmic, &plot.y_label);
    }
    match plot.turn {
        Some(turn) => Axis::new(turn.low(), turn.high(), AxisScale::Angle, &plot.y_label),
        None => {
            let room = 0.05 * (high - low);
            Axis::new(low - room, high + room, AxisScale::Linear, &plot.y_label)
        }
    }
}

/// Colour and width of a line, diameter of its dots.
fn look(plot: &LinePlot, index: usize) -> (&'static str, f64, f64) {
    let series = &plot.series;
    let overlaid = series.len() > 1 && series.iter().any(|s| s.over);
    if overlaid && !series[index].over {
        return (if index == 0 { UNDER.0 } else { LINES[index % LINES.len()] }, UNDER.1, UNDER.1);
    }
    let dense = !overlaid && series.len() > 1 && series.iter().any(|s| s.points.len() > MANY);
    let width = if overlaid { OVER } else { WIDTH };
    (if plot.open { OPEN } else { LINES[index % LINES.len()] }, if dense { DENSE } else { width }, 4.0)
}

/// Row, position, series and name of every legend entry, if there are several series.
fn legend(series: &[Series], room: f64) -> Vec<(usize, f64, usize, String)> {
    let (mut row, mut place, mut entries) = (0, 0.0, Vec::new());
    let named = series.iter().enumerate().filter(|(_, s)| series.len() > 1 && !s.name.is_empty());
    for (index, series) in named {
        let width = entry_width(&series.name);
        if place > 0.0 && place + width > room {
            (row, place) = (row + 1, 0.0);
        }
        entries.push((row, place, index, series.name.clone()));
        place += width;
    }
    entries
}

/// Number of points per piece of a path that is simplified: in the worst case, the work grows with the square of that number.
const PIECE: usize = 400;

/// Number of points per pixel up to which all points are kept.
const FEW: usize = 8;

/// A path that runs from left to right, without most points of crowded pixels: each pixel keeps the first, last, lowest and highest. Any
/// other path is unchanged.
fn columns(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.windows(2).any(|pair| pair[1].0 < pair[0].0) {
        return points.to_vec();
    }
    let mut kept = Vec::new();
    for column in points.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        if column.len() <= FEW {
            kept.extend(column);
            continue;
        }
        let last = column.len() - 1;
        let by = |better: fn(f64, f64) -> bool| {
            (0..=last).fold(0, |best, k| if better(column[k].1, column[best].1) { k } else { best })
        };
        let mut places = [0, by(|a, b| a < b), by(|a, b| a > b), last];
        places.sort_unstable();
        kept.extend(places.chunk_by(|a, b| a == b).map(|same| column[same[0]]));
    }
    kept
}

/// The points of a path without those that lie within `tolerance` of the simplified path (Douglas and Peucker 1973); its ends stay.
/// Oscillations within a pixel keep their extremes.
pub(super) fn simplify(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    let mut start = 0;
    while start + 1 < points.len() {
        // Pieces share their ends.
        let end = (start + PIECE).min(points.len() - 1);
        kept.push(points[start]);
        piece(&points[start..=end], tolerance, &mut kept);
        start = end;
    }
    kept.extend(points.last());
    columns(&kept)
}

/// The points to keep between the ends of a piece.
fn piece(points: &[(f64, f64)], tolerance: f64, kept: &mut Vec<(f64, f64)>) {
    let mut stay = vec![false; points.len()];
    let mut open = vec![(0, points.len() - 1)];
    while let Some((from, to)) = open.pop() {
        let distances = (from + 1..to).map(|k| (k, distance(points[k], points[from], points[to])));
        let Some((far, distance)) = distances.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if distance > tolerance {
            stay[far] = true;
            open.extend([(from, far), (far, to)]);
        }
    }
    kept.extend(points.iter().zip(stay).filter(|(_, stay)| *stay).map(|(point, _)| *point));
}

/// Distance of a point from the segment between two others.
fn distance(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (u, w) = ((b.0 - a.0, b.1 - a.1), (p.0 - a.0, p.1 - a.1));
    let square = u.0 * u.0 + u.1 * u.1;
    let along = if square > 0.0 { ((u.0 * w.0 + u.1 * w.1) / square).clamp(0.0, 1.0) } else { 0.0 };
    (w.0 - along * u.0).hypot(w.1 - along * u.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simplified_paths_stay_close_and_keep_their_ends() {
        let wave: Vec<(f64, f64)> =
            (0..=5000).map(|k| (0.1 * f64::from(k), 80.0 * (0.02 * f64::from(k)).sin())).collect();
        let few = simplify(&wave, 0.1);
        assert!(few.len() < 800, "{}", few.len());
        assert_eq!((few.first(), few.last()), (wave.first(), wave.last()));
        for &point in &wave {
            let near = few.windows(2).map(|pair| distance(point, pair[0], pair[1])).fold(f64::INFINITY, f64::min);
            assert!(near <= 0.1 + 1e-12, "{near}");
        }
        // Oscillations within a pixel keep their extremes.
        let noise: Vec<(f64, f64)> = (0..9000).map(|k| (0.01 * f64::from(k), f64::from(k % 7))).collect();
        let few = simplify(&noise, 0.1);
        assert!(
            few.len() < 8 * 91 && few.iter().any(|p| p.1 == 6.0) && few.iter().any(|p| p.1 == 0.0),
            "{}",
            few.len()
        );
        assert_eq!(simplify(&wave[..1], 0.1), &wave[..1]);
        assert!(simplify(&[], 0.1).is_empty());
        // A path there and back is not a segment.
        assert_eq!(simplify(&[(0.0, 0.0), (9.0, 0.0), (0.0, 0.0)], 0.1).len(), 3);
    }
}

//! Grids as colours, side by side.

use super::axes::{Area, Axis, AxisScale, BELOW, TITLE_HEIGHT, Tick, number, room_left, ruled};
use super::png::indexed;
use super::svg::{Anchor, DIVERGING, GAP, INK, MARK, Panel, VIRIDIS, at, text_width};
use super::{HeatMap, Picture, PlotError, extremes, fine};

/// Size of a panel.
const SIZE: (f64, f64) = (332.0, 286.0);
/// Width of a colour bar, and the margin left of it.
const BAR: (f64, f64) = (11.0, 10.0);
/// Font size of its texts.
const TEXT: f64 = 12.0;
/// Number of colours in a map, and in a map with greyed-out points, which need a second set; one more colour marks gaps.
const SHADES: (usize, usize) = (255, 127);
/// Share of a colour that remains if it is greyed out.
const LEFT: f64 = 0.18;

/// Draws grids side by side, each with its colour bar; gaps are grey.
///
/// # Errors
/// [`PlotError::Empty`] if a grid has no finite value or fewer than two values per axis.
pub fn heat_maps(maps: &[HeatMap]) -> Result<Picture, PlotError> {
    let panels = maps.iter().map(panel).collect::<Result<Vec<Panel>, PlotError>>()?;
    let blank = maps.iter().flat_map(|map| &map.grid.values).all(|z| *z == 0.0 || !fine(*z));
    if panels.is_empty() { Err(PlotError::Empty(String::new())) } else { Ok(Picture { panels, blank }) }
}

fn panel(map: &HeatMap) -> Result<Panel, PlotError> {
    let empty = || PlotError::Empty(map.title.clone());
    let grid = &map.grid;
    let (columns, rows) = (grid.x.len(), grid.y.len());
    let (low, high) = extremes(grid.values.iter().copied()).ok_or_else(empty)?;
    if columns < 2 || rows < 2 || grid.values.len() != columns * rows {
        return Err(empty());
    }
    // Each point is the centre of its cell.
    let edges = |axis: &[f64]| {
        let half = 0.5 * (axis[axis.len() - 1] - axis[0]) / (axis.len() - 1) as f64;
        (axis[0] - half, axis[axis.len() - 1] + half)
    };
    let kind = |label: &str, (low, high): (f64, f64)| {
        if label.ends_with("[rad]") && high - low > 3.0 { AxisScale::Angle } else { AxisScale::Linear }
    };
    let axis = |values: &[f64], label: &str| {
        let ends = edges(values);
        Axis::new(ends.0, ends.1, kind(label, ends), label)
    };
    let axes = (&axis(&grid.x, &map.x_label), &axis(&grid.y, &map.y_label));

    let (mut from, mut to) = map.range.unwrap_or((low, high));
    if map.diverging {
        let largest = from.abs().max(to.abs());
        (from, to) = (-largest, largest);
    }
    let constant = from >= to;
    let scale = if map.diverging { DIVERGING } else { VIRIDIS };
    let is_open = |k: usize| map.open.get(k).copied().unwrap_or(false);
    let shades = if map.open.contains(&true) { SHADES.1 } else { SHADES.0 };
    let mut palette: Vec<[u8; 3]> = (0..shades).map(|k| at(scale, k as f64 / (shades - 1) as f64)).collect();
    if shades == SHADES.1 {
        palette.extend(palette.clone().into_iter().map(greyed));
    }
    palette.push(GAP);
    let shade = |(k, &z): (usize, &f64)| {
        let colour = match (z - from) / (to - from) {
            _ if !fine(z) => return (palette.len() - 1) as u8,
            _ if constant => shades / 2,
            part => (part.clamp(0.0, 1.0) * (shades - 1) as f64).round() as usize,
        };
        (if is_open(k) { colour + shades } else { colour }) as u8
    };
    let image: Vec<u8> = grid.values.iter().enumerate().map(shade).collect();
    let image: Vec<Vec<u8>> = image.chunks_exact(columns).rev().map(<[u8]>::to_vec).collect();

    let texts = if constant { vec![] } else { bar_ticks(from, to) };
    let bar_room = texts.iter().map(|(_, text)| text_width(text, TEXT)).fold(0.0, f64::max) + BAR.0 + BAR.1 + 16.0;
    let height = SIZE.1 - TITLE_HEIGHT - BELOW;
    let left = room_left(axes.1, height);
    let area = Area { left, top: TITLE_HEIGHT, width: SIZE.0 - left - bar_room, height };
    let mut panel = Panel::new(SIZE.0, SIZE.1);
    panel.image(&indexed(&image, &palette), (area.left, area.top), (area.width, area.height));
    let mut inner = Panel::new(area.width, area.height);
    let marks: Vec<(f64, f64)> = map.marks.iter().map(|&p| area.point(axes, p)).collect();
    inner.dots(&marks, MARK, 1.6);
    panel.inset((area.left, area.top), &inner);
    let title = if constant { format!("{} = {}", map.title, number(low)) } else { map.title.clone() };
    // Grid lines over the map could be mistaken for data, so they are not drawn.
    let _ = ruled(&mut panel, area, axes, &title);
    if !constant {
        let bar: Vec<Vec<u8>> = (0..shades as u8).rev().map(|k| vec![k]).collect();
        let place = area.left + area.width + BAR.1;
        panel.image(&indexed(&bar, &palette), (place, area.top), (BAR.0, area.height));
        for (z, text) in texts {
            let y = area.top + (1.0 - (z - from) / (to - from)) * area.height;
            panel.segments(&[[(place + BAR.0, y), (place + BAR.0 + 4.0, y)]], INK, 0.8);
            panel.text((place + BAR.0 + 7.0, y + 4.0), TEXT, Anchor::Start, &text);
        }
    }
    Ok(panel)
}

/// Ticks of a colour bar; their texts include the power of ten.
fn bar_ticks(from: f64, to: f64) -> Vec<(f64, String)> {
    let (ticks, power) = Axis::new(from, to, AxisScale::Linear, "").ticks(5);
    let text = |tick: Tick| (tick.at, tick.text.filter(|_| power == 0).unwrap_or_else(|| number(tick.at)));
    ticks.into_iter().map(text).collect()
}

/// Mixes a colour with grey to mark undetermined values.
fn greyed(colour: [u8; 3]) -> [u8; 3] {
    std::array::from_fn(|i| (LEFT * f64::from(colour[i]) + (1.0 - LEFT) * f64::from(GAP[i])).round() as u8)
}

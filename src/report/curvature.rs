//! Map of the curvature scalar.

use super::{Figure, HeatMap, heat_maps, kept};
use crate::analysis::{Grid, Spread};
use crate::names::rounded;

/// Curvature scalars over two coordinates.
#[derive(Clone, Debug)]
pub(crate) struct CurvatureMap {
    /// Label of the horizontal axis, with unit.
    pub x_label: String,
    /// Label of the vertical axis, with unit.
    pub y_label: String,
    /// Of the model.
    pub learned: Grid,
    /// Of the system, if it is known.
    pub exact: Option<Grid>,
    /// Coordinates that are fixed, in words; may be empty.
    pub fixed: String,
}

/// Learned map, the exact one unless it is constant, and the difference; none if there is nothing finite to show. Colours leave
/// out the lowest and the highest hundredth of the values.
pub(crate) fn curvature_figure(map: &CurvatureMap) -> Option<Figure> {
    let panel = |title: &str, grid: &Grid, range, diverging| HeatMap {
        title: title.to_string(),
        x_label: map.x_label.clone(),
        y_label: map.y_label.clone(),
        grid: grid.clone(),
        range,
        diverging,
        marks: Vec::new(),
    };
    let all = |grid: &Grid| Spread::of(&grid.values);
    let (learned, exact) = (all(&map.learned), map.exact.as_ref().map(all));
    let constant = exact.filter(|exact| exact.high - exact.low <= 1e-9 * exact.median.abs());
    let (mut low, mut high) = (learned.low, learned.high);
    if let Some(exact) = &exact {
        (low, high) = (low.min(exact.low), high.max(exact.high));
    }
    let range = Some((low, high));
    let mut panels = vec![panel("R learned", &map.learned, range, false)];
    if let Some(exact) = &map.exact {
        if constant.is_none() {
            panels.insert(0, panel("R exact", exact, range, false));
        }
        let difference = map.learned.minus(exact)?;
        let Spread { low, high, .. } = all(&difference);
        panels.push(panel("learned \u{2212} exact", &difference, Some((low, high)), true));
    }
    let fixed = if map.fixed.is_empty() { String::new() } else { format!(" at {}", map.fixed) };
    let beside = match (constant, &map.exact) {
        (Some(exact), _) => format!("; the exact one is {} everywhere", rounded(exact.median, 6)),
        (None, Some(_)) => ", exact and learned".to_string(),
        (None, None) => String::new(),
    };
    let caption = format!("Curvature scalar R of the metric{fixed}{beside}.");
    kept("curvature_scalar.svg", heat_maps(&panels), caption)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_pictures::save;

    #[test]
    fn a_constant_needs_no_panel() {
        let axis = |count: u32| (0..count).map(f64::from).collect::<Vec<f64>>();
        let grid =
            |f: &dyn Fn(f64) -> f64| Grid { x: axis(5), y: axis(4), values: axis(20).into_iter().map(f).collect() };
        let map = |exact| CurvatureMap {
            x_label: "theta [rad]".into(),
            y_label: "phi [rad]".into(),
            learned: grid(&|k| 2.0 + 0.01 * k),
            exact,
            fixed: "r = 4".into(),
        };
        let panels = |exact| {
            let figure = curvature_figure(&map(exact)).unwrap();
            let found = (figure.picture.panels(), figure.caption.clone());
            save(&[figure]);
            found
        };
        let alone = "Curvature scalar R of the metric at r = 4.".to_string();
        assert_eq!(panels(None), (1, alone));
        let constant = "Curvature scalar R of the metric at r = 4; the exact one is 2.00000 everywhere.".to_string();
        assert_eq!(panels(Some(grid(&|_| 2.0))), (2, constant));
        assert_eq!(panels(Some(grid(&|k| k))).0, 3);
        let nothing = CurvatureMap { learned: grid(&|_| f64::NAN), ..map(None) };
        assert!(curvature_figure(&nothing).is_none());
    }
}

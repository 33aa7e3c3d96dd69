//! Map of one quantity of a model over two coordinates, beside the exact one if that is known.

use super::{Figure, HeatMap, figure, file_part, heat_maps};
use crate::analysis::{Grid, Spread};
use crate::names::rounded;

/// A quantity over two coordinates.
#[derive(Clone, Debug)]
pub(crate) struct QuantityMap {
    /// Symbol, such as `R`.
    pub quantity: String,
    /// Heading of the picture, such as `Curvature scalar R of the metric`.
    pub about: String,
    /// Beginning of the file name, made fit for one.
    pub file: String,
    /// Labels of the horizontal and of the vertical axis, with units.
    pub labels: [String; 2],
    /// Of the model.
    pub learned: Grid,
    /// Of the system, if it is known.
    pub exact: Option<Grid>,
    /// Coordinates that are fixed, in words; may be empty.
    pub fixed: String,
    /// Further sentences of the caption; may be empty.
    pub remark: String,
    /// Points to mark in the learned map.
    pub marks: Vec<(f64, f64)>,
}

/// One panel of a picture, without marks and with the colours of its own extremes.
pub(super) fn panel(title: impl Into<String>, [x_label, y_label]: &[String; 2], grid: &Grid) -> HeatMap {
    HeatMap {
        title: title.into(),
        x_label: x_label.clone(),
        y_label: y_label.clone(),
        grid: grid.clone(),
        range: None,
        diverging: false,
        marks: Vec::new(),
    }
}

/// The panel of a difference.
pub(super) fn difference_panel(labels: &[String; 2], grid: &Grid) -> HeatMap {
    HeatMap { diverging: true, ..panel("learned \u{2212} exact", labels, grid) }
}

/// Learned map, the exact one unless it is constant, and the difference; none if there is nothing finite to show. Colours leave
/// out the lowest and the highest hundredth of the values.
pub(crate) fn quantity_figure(map: &QuantityMap) -> Option<Figure> {
    let all = |grid: &Grid| Spread::of(&grid.values);
    let (learned, exact) = (all(&map.learned), map.exact.as_ref().map(all));
    let constant = exact.filter(|exact| exact.high - exact.low <= 1e-9 * exact.median.abs());
    let (mut low, mut high) = (learned.low, learned.high);
    if let Some(exact) = &exact {
        (low, high) = (low.min(exact.low), high.max(exact.high));
    }
    let same = |what: &str, grid: &Grid| HeatMap {
        range: Some((low, high)),
        ..panel(format!("{} {what}", map.quantity), &map.labels, grid)
    };
    let mut panels = vec![HeatMap { marks: map.marks.clone(), ..same("learned", &map.learned) }];
    if let Some(exact) = &map.exact {
        if constant.is_none() {
            panels.insert(0, same("exact", exact));
        }
        let difference = map.learned.minus(exact)?;
        let Spread { low, high, .. } = all(&difference);
        panels.push(HeatMap { range: Some((low, high)), ..difference_panel(&map.labels, &difference) });
    }
    let fixed = if map.fixed.is_empty() { String::new() } else { format!("At {}.", map.fixed) };
    let beside = match (constant, &map.exact) {
        (Some(exact), _) => format!("The exact one is {} everywhere.", rounded(exact.median, 6)),
        (None, Some(_)) => "Exact, learned, and the difference.".to_string(),
        (None, None) => String::new(),
    };
    let sentences = [&beside, &fixed, &map.remark].into_iter().filter(|text| !text.is_empty()).cloned();
    let caption = sentences.collect::<Vec<_>>().join(" ");
    figure(&format!("{}.svg", file_part(&map.file)), map.about.as_str(), heat_maps(&panels), caption)
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
        let map = |exact| QuantityMap {
            quantity: "R".into(),
            about: "Curvature scalar R of the metric".into(),
            file: "curvature scalar".into(),
            labels: ["theta [rad]", "phi [rad]"].map(String::from),
            learned: grid(&|k| 2.0 + 0.01 * k),
            exact,
            fixed: "r = 4".into(),
            remark: String::new(),
            marks: Vec::new(),
        };
        let panels = |exact| {
            let figure = quantity_figure(&map(exact)).unwrap();
            assert_eq!(figure.file, "curvature_scalar.svg");
            let found = (figure.picture.panels(), figure.caption.clone());
            save(&[figure]);
            found
        };
        let alone = "At r = 4.".to_string();
        assert_eq!(panels(None), (1, alone));
        let constant = "The exact one is 2.00000 everywhere. At r = 4.".to_string();
        assert_eq!(panels(Some(grid(&|_| 2.0))), (2, constant));
        assert_eq!(panels(Some(grid(&|k| k))).0, 3);
        let nothing = QuantityMap { learned: grid(&|_| f64::NAN), ..map(None) };
        assert!(quantity_figure(&nothing).is_none());
    }
}

//! Plots, tables and the HTML report.

mod constraints;
mod evaluation;
mod experiment;
mod grids;
mod html;
mod identification;
mod motion;
mod page;
mod plane;
mod plot;
mod systems;
mod table;
mod thresholds;

pub use constraints::found_constraint_figures;
pub(crate) use evaluation::{HistoryRow, evaluation_figures, training_figures, units};
pub use experiment::groups;
pub use experiment::{experiment_table, experiment_view, loss_figures};
pub use grids::{Fit, GridComparison, grid_figures};
pub use grids::{QuantityMap, Turn, quantity_figure};
pub use html::Report;
pub use identification::{formula_figures, identification_figures};
pub use motion::{EventTable, Leaving, MotionRecord, MotionSummary, MotionTexts};
pub use page::{PageError, page};
pub use plane::Polar;
pub use plot::{
    HeatMap, Level, LinePlot, OrbitPlot, Picture, PlotError, Series, Trace, heat_maps, line_plot, orbit_picture, png,
    trace_plot,
};
pub use systems::SystemEntry;
pub use table::DataTable;

/// One picture of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// File name ending in `.svg`, without directory.
    pub file: String,
    /// Title of the picture; may be empty.
    pub heading: String,
    /// The drawing.
    pub picture: Picture,
    /// How to read it, in sentences below it.
    pub caption: String,
}

impl Figure {
    /// The picture as a file, under its heading.
    pub fn to_svg(&self) -> String {
        self.picture.to_svg(&self.heading)
    }
}

/// Creates a figure with a heading; `None` if there is nothing to show, or only zeros.
pub fn figure(
    file: &str,
    heading: impl Into<String>,
    drawn: Result<Picture, PlotError>,
    caption: impl Into<String>,
) -> Option<Figure> {
    let picture = drawn.ok().filter(|picture| !picture.is_blank())?;
    Some(Figure { file: file.to_string(), heading: heading.into(), picture, caption: caption.into() })
}

/// Formats a quantity with its unit, if it has one.
pub fn with_unit(quantity: &str, unit: &str) -> String {
    if ["", "1"].contains(&unit) { quantity.to_string() } else { format!("{quantity} [{unit}]") }
}

/// Groups indices by unit, in order of first appearance.
pub fn by_unit(units: &[String]) -> Vec<(String, Vec<usize>)> {
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    for (i, unit) in units.iter().enumerate() {
        match groups.iter_mut().find(|(known, _)| known == unit) {
            Some((_, members)) => members.push(i),
            None => groups.push((unit.clone(), vec![i])),
        }
    }
    groups
}

/// The index of the median of errors, with `NaN` as the largest. None without errors.
pub(crate) fn median_of(errors: &[f64]) -> Option<usize> {
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|&a, &b| errors[a].total_cmp(&errors[b]));
    order.get(errors.len().saturating_sub(1) / 2).copied()
}

/// Makes a name usable in a file name.
pub(crate) fn file_part(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect()
}

/// Saves pictures for inspection in the directory that `LNN_TEST_PICTURES` names.
#[cfg(test)]
pub(crate) fn save_pictures(figures: &[Figure]) {
    if let Ok(directory) = std::env::var("LNN_TEST_PICTURES") {
        for figure in figures {
            std::fs::write(std::path::Path::new(&directory).join(&figure.file), figure.to_svg()).unwrap();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle_of_what_is_a_number() {
        assert_eq!(median_of(&[3.0, 1.0, 2.0]), Some(2));
        assert_eq!(median_of(&[f64::NAN, 5.0, f64::INFINITY, 1.0]), Some(1));
        assert_eq!((median_of(&[7.0]), median_of(&[])), (Some(0), None));
    }
}

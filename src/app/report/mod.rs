//! Plots, tables and the HTML report.

mod constraints;
mod evaluation;
mod experiment;
mod grids;
mod html;
mod identification;
mod page;
mod plot;
mod table;

pub(crate) use constraints::found_constraint_figures;
pub(crate) use evaluation::{HistoryRow, evaluation_figures, training_figures, units, with_unit};
pub use experiment::groups;
pub(crate) use experiment::{experiment_table, experiment_view, loss_figures};
pub use grids::{Fit, GridComparison, grid_figures};
pub(crate) use grids::{QuantityMap, Turn, quantity_figure};
pub use html::Report;
pub(crate) use identification::{formula_figures, identification_figures};
pub use page::{PageError, page};
pub use plot::{
    HeatMap, Level, LinePlot, OrbitPlot, Picture, PlotError, Series, Trace, heat_maps, line_plot, orbit_picture, png,
    trace_plot,
};
pub use table::DataTable;

/// One picture of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// File name without directory, with `.svg`.
    pub file: String,
    /// Title of the picture; may be empty.
    pub heading: String,
    /// The drawing.
    pub picture: Picture,
    /// How to read it, in sentences below it.
    pub caption: String,
}

/// A figure of what was drawn, under a heading; none where there was nothing to show.
pub fn figure(
    file: &str,
    heading: impl Into<String>,
    drawn: Result<Picture, PlotError>,
    caption: impl Into<String>,
) -> Option<Figure> {
    let picture = drawn.ok()?;
    Some(Figure { file: file.to_string(), heading: heading.into(), picture, caption: caption.into() })
}

/// A name as part of a file name.
pub(crate) fn file_part(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect()
}

/// Keeps pictures to look at in the directory that `LNN_TEST_PICTURES` names.
#[cfg(test)]
pub(crate) fn save_pictures(figures: &[Figure]) {
    if let Ok(directory) = std::env::var("LNN_TEST_PICTURES") {
        for figure in figures {
            std::fs::write(std::path::Path::new(&directory).join(&figure.file), figure.picture.to_svg()).unwrap();
        }
    }
}

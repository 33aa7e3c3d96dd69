//! Plots, tables and the HTML report.

mod base64;
mod data_table;
mod escape;
mod evaluation;
mod experiment;
mod grids;
mod html;
mod page;
mod plot;
mod quantity_map;
mod readings;
mod table;
#[cfg(test)]
mod test_pictures;
mod training;
mod turn;

pub use data_table::DataTable;
pub(crate) use evaluation::{evaluation_figures, units};
pub use experiment::Curve;
pub(crate) use experiment::{
    REDUCTION_HEADER, experiment_curves, experiment_figures, experiment_table, experiment_view, reduction_table,
};
pub use grids::{Fit, GridComparison, grid_figures};
pub use html::Report;
pub use page::{PageError, page};
pub use plot::{
    HeatMap, Level, LinePlot, OrbitPlot, Picture, PlotError, Series, Trace, heat_maps, line_plot, orbit_picture, png,
    trace_plot,
};
pub(crate) use quantity_map::{QuantityMap, quantity_figure};
pub(crate) use readings::{READING_HEADER, reading_table};
pub use table::text_table;
pub(crate) use training::{HistoryRow, training_figures};
pub(crate) use turn::Turn;

/// One picture of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// File name without directory, with `.svg`.
    pub file: String,
    /// What the picture shows, in a few words above it; may be empty.
    pub heading: String,
    /// The drawing.
    pub picture: Picture,
    /// How to read it, in sentences below it.
    pub caption: String,
}

/// A figure of what was drawn, under a heading; none where there was nothing to show.
pub(crate) fn figure(
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

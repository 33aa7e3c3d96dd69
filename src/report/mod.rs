//! Plots, tables and the HTML report.

mod evaluation;
mod experiment;
mod grids;
mod html;
mod plot;
mod table;
#[cfg(test)]
mod test_pictures;
mod training;

pub use evaluation::evaluation_figures;
pub use experiment::{
    Curve, EXPERIMENT_HEADER, REDUCTION_HEADER, experiment_curves, experiment_figures, experiment_table,
    experiment_view, reduction_table,
};
pub use grids::{Fit, GridComparison, grid_figures};
pub use html::Report;
pub use plot::{HeatMap, LinePlot, PlotError, Series, Trace, heat_maps_png, line_png, trace_png};
pub use table::text_table;
pub use training::{HistoryRow, training_figures};

/// One picture of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// File name without directory, with `.png`.
    pub file: String,
    /// PNG bytes.
    pub png: Vec<u8>,
    /// Description of what the picture shows.
    pub caption: String,
}

//! Whole runs: pages, pipelines from configuration to report, and the command line.
//!
//! | module | contents |
//! |---|---|
//! | [`experiments`] | sets of runs as data: records, rows of tables, sweeps |
//! | [`report`] | plots in SVG, tables, HTML |
//! | [`pipeline`] | trainings, fits, evaluations and experiments from configuration to report |

#[cfg(feature = "training")]
pub mod experiments;
#[cfg(feature = "pipeline")]
pub mod pipeline;
#[cfg(feature = "plot")]
pub mod report;

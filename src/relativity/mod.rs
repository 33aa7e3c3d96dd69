//! Black holes: orbits, falls and surfaces of a metric, learned or written down.

mod around;
mod drift;
mod event;
mod infall;
mod parameters;
mod periastron;
mod readings;
mod shells;
mod spheroidal;

pub use around::Around;
pub(crate) use drift::conserved_drift;
pub use infall::{Infall, infall};
pub use parameters::nearest_parameters;
pub use periastron::{RadialPeriod, radial_period};
pub use readings::{Pair, Reading};
pub use shells::{MetricDeviation, metric_deviation};

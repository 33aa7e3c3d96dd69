//! The report of a roll-out: a record of its samples, a summary, pictures, events.

mod events;
mod pictures;
mod record;
mod summary;

pub use events::EventTable;
pub use pictures::MotionTexts;
pub use record::{Leaving, MotionRecord};
pub use summary::MotionSummary;

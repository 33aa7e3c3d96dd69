//! The tape: record, replay, reverse sweep.

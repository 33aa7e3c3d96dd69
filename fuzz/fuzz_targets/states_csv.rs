//! Any bytes as a CSV of states: refused with an error, or finite numbers for every column.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lnn::cli::parse_states;

fuzz_target!(|bytes: &[u8]| {
    let columns = ["theta1", "theta2", "theta1_dot", "theta2_dot"].map(String::from);
    if let Ok(states) = parse_states::<f64>(bytes, &columns) {
        assert_eq!(states.q.len(), 2 * states.rows.len());
        assert_eq!(states.v.len(), states.q.len());
        assert!(states.q.iter().chain(&states.v).all(|x| x.is_finite()));
    }
});

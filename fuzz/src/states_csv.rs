//! Any bytes as a CSV of states: refused with an error of one line, or finite numbers for every column, which their
//! own text gives again.

use lnn::scalar::{Dd, Scalar};
use lnn_cli::{States, parse_states};

/// Reads the bytes in every precision.
pub fn run(bytes: &[u8]) {
    read::<f32>(bytes);
    read::<f64>(bytes);
    read::<Dd>(bytes);
}

fn read<S: Scalar>(bytes: &[u8]) {
    let columns = ["theta1", "theta2", "theta1_dot", "theta2_dot"].map(String::from);
    let states: States<S> = match parse_states(bytes, &columns) {
        Ok(states) => states,
        Err(error) => return assert_eq!(error.to_string().lines().count(), 1, "{error:?}"),
    };
    assert_eq!((states.q.len(), states.v.len()), (2 * states.rows.len(), 2 * states.rows.len()));
    assert!(states.q.iter().chain(&states.v).all(|x| x.is_finite()));
    assert!(states.rows.is_sorted_by(|a, b| a < b));

    let mut text = columns.join(",");
    for (q, v) in states.q.chunks(2).zip(states.v.chunks(2)) {
        let row: Vec<String> = q.iter().chain(v).map(|x| x.to_text()).collect();
        text += &format!("\n{}", row.join(","));
    }
    let again: States<S> = parse_states(text.as_bytes(), &columns).expect("what was read can be read again");
    assert_eq!((again.q, again.v), (states.q, states.v));
}

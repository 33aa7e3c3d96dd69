//! Any bytes as a CSV of states: refused with an error of one line, or finite numbers for every column, which their
//! own text gives again.

use lnn::recording::NumberTable;
use lnn::scalar::{Dd, Scalar};

/// Reads the bytes in every precision.
pub fn run(bytes: &[u8]) {
    read::<f32>(bytes);
    read::<f64>(bytes);
    read::<Dd>(bytes);
}

fn read<S: Scalar>(bytes: &[u8]) {
    let columns = ["theta1", "theta2", "theta1_dot", "theta2_dot"].map(String::from);
    let states = match NumberTable::<S>::read(bytes, &columns) {
        Ok(states) => states,
        Err(error) => return assert_eq!(error.to_string().lines().count(), 1, "{error:?}"),
    };
    assert_eq!(states.values.len(), 4 * states.rows.len());
    assert!(states.values.iter().all(|x| x.is_finite()));
    assert!(states.rows.is_sorted_by(|a, b| a < b));

    let mut text = columns.join(",");
    for row in states.values.chunks(4) {
        let row: Vec<String> = row.iter().map(|x| x.to_text()).collect();
        text += &format!("\n{}", row.join(","));
    }
    let again = NumberTable::<S>::read(text.as_bytes(), &columns).expect("what was read can be read again");
    assert_eq!(again.values, states.values);
}

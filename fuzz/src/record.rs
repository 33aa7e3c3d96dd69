//! Any text as the record of a run of a sweep or an experiment: refused, or written back as the same record.

use lnn::experiments::Record;

/// Reads the bytes.
pub fn run(bytes: &[u8]) {
    let Ok(record) = serde_json::from_slice::<Record>(bytes) else { return };
    let written = serde_json::to_string(&record).expect("a record that was read can be written");
    // A number that JSON does not hold is none.
    if let Ok(again) = serde_json::from_str::<Record>(&written) {
        assert_eq!(serde_json::to_string(&again).expect("and written again"), written);
        assert_eq!(again, record);
    }
}

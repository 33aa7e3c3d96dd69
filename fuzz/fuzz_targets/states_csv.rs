//! See `lnn_fuzz::states_csv`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::states_csv::run(bytes));

//! See `lnn_fuzz::robot_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::robot_file::run(bytes));

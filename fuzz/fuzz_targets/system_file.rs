//! See `lnn_fuzz::system_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::system_file::run(bytes));

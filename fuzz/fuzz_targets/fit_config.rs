//! See `lnn_fuzz::fit_config`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::fit_config::run(bytes));

//! libFuzzer on [`proprio_fuzz::dynamics`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| proprio_fuzz::dynamics::dynamics(bytes));

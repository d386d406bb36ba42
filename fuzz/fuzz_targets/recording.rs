//! libFuzzer on [`proprio_fuzz::recording`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| proprio_fuzz::recording(bytes));

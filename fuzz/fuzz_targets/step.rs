//! libFuzzer on [`proprio_fuzz::step`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| proprio_fuzz::step(bytes));

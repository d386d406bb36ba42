//! libFuzzer on [`proprio_fuzz::log`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| proprio_fuzz::log(bytes));

//! libFuzzer on [`proprio_fuzz::bus`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| proprio_fuzz::bus(bytes));

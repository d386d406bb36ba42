//! libFuzzer on [`proprio_fuzz::wire`].
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| proprio_fuzz::wire(bytes));

//! Placeholder story; see the modules.
#![no_std]
#![forbid(unsafe_code)]

pub mod bus;

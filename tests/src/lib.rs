//! Shared helpers of the cross-crate tests.
#![forbid(unsafe_code)]

pub mod battery;
pub mod command;
pub mod motion;
pub mod oracle;

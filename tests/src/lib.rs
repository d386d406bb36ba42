//! Shared helpers of the cross-crate tests.
#![forbid(unsafe_code)]

pub mod motion;
pub mod oracle;

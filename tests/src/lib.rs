//! Shared helpers of the cross-crate tests.
#![forbid(unsafe_code)]

pub mod battery;
pub mod browser;
pub mod changing;
pub mod command;
pub mod cost;
pub mod device_fit;
pub mod emulator;
pub mod motion;
pub mod oracle;
pub mod prior_reach;
pub mod recorder;
pub mod report_example;
pub mod rows;
pub mod schema;
pub mod walks;
pub mod zeros;

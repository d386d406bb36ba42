//! Logs, model files, commands, simulator: the desktop side of proprio.

pub mod criticism;
pub mod device;
pub mod estimate;
pub mod identifiability;
pub mod identification;
pub mod log;
pub mod model;
mod nearest;
pub mod output;
pub mod parameter;
pub mod report;
pub mod simulator;
pub mod table;

//! Logs, model files, commands, simulator: the desktop side of proprio.

pub mod device;

//! Boards: what differs between them, and nothing else. A feature of the package picks one.

#[cfg(feature = "mps2-an500")]
pub mod mps2_an500;
#[cfg(feature = "nucleo-h743zi2")]
pub mod nucleo_h743zi2;

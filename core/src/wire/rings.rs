//! The memory through which an emulated board hears its motor buses where hours are played.
//!
//! The emulator takes some 8 µs for each byte of a UART. Its host instead shares the board's PSRAM with it and puts each bus's bytes into a ring
//! there; [`Advance`](super::Advance) says how many are to be taken.

/// Where the buses' rings are, bytes from the PSRAM's beginning: one after the other in the order of the legs.
pub const OFFSET: usize = 8 << 20;
/// Bytes of a bus's ring.
pub const LENGTH: usize = 64 * 1024;
/// The bytes before [`OFFSET`] where rings are in use; else the buses come through UARTs.
pub const IN_USE: [u8; 4] = *b"RING";

//! Boards: what differs between them, and nothing else.

pub mod mps2_an500;

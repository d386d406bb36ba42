//! Studies of minutes to days whose tables are committed: `README.md` lists each with its command.
#![forbid(unsafe_code)]

pub mod battery;
pub mod excitation;
pub mod information;
pub mod ladder;

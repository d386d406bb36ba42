//! The tables of the labelled battery, whose cases and judgement the tests share ([`proprio_tests::battery`]).
//!
//! 1. [`table`]: the figures of all cases, `battery/table.md`.
//! 2. [`mujoco`]: the same judgement on logs that MuJoCo made.
//! 3. [`logged_table`]: counts of judgements of logs in files by effect, by size and by noise, with their targets: `battery/mujoco_table.md`.

pub mod logged_table;
pub mod mujoco;
pub mod table;

use std::path::PathBuf;

/// Where the tables are.
pub fn folder() -> PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("battery")
}

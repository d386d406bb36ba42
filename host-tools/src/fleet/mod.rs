//! Many robots, many logs: blocks of time as factors in a table, and the questions that only such a table answers.
//!
//! A factor is a sufficient statistic, so a fleet's data are its factors: some kilobytes for ten minutes of a robot, in any order, from
//! logs and from devices. They stay blocks and are never merged into one: how a value differs from block to block is what its ± is made of.
//!
//! 1. `columns`: what the numbers of a factor belong to, and the hash by which two factors are known to be of the same.
//! 2. `block`: a row of the table: one joint of one limb in one block of time.
//! 3. `make`: from logs to blocks.
//! 4. `table`: blocks in Parquet, schema `proprio.blocks/1`.
//! 5. `gate`: which blocks count, and why the others do not.
//! 6. `partial`: from blocks, in any order and any parts, to what is kept of each robot's limb.
//! 7. `solve`: a limb's bodies over all its blocks, and its joints' effects block by block.
//! 8. `memory`: how many independent blocks a series is worth. `values`: a robot's values, ± by that. `drift`, `drifting`: whether they change, when and by how much.
//! 9. `population`: what robots have in common. `outliers`: which one differs in what. `missing`: which effect the fleet's model lacks, held out by robot.
//! 10. `answers`: all of it, of what [`partial()`] keeps. `prior`: the model file that a new robot begins with.

pub mod answers;
pub mod block;
pub mod columns;
pub mod drift;
mod drifting;
pub mod gate;
pub mod make;
pub mod memory;
pub mod missing;
mod outliers;
pub mod partial;
pub mod population;
pub mod prior;
pub mod solve;
pub mod table;
mod values;

pub use answers::{Answers, answers_of, final_answers, solved};
pub use block::Block;
pub use columns::{BlockColumns, KeptColumn, place_in_model};
pub use gate::{Fault, Gate, admit_all};
pub use make::{Origin, blocks_of_log};
pub use partial::{Kept, merge, partial};
pub use prior::prior_model;
pub use table::{TableError, read, robots_in, write};

#[cfg(all(test, feature = "parquet"))]
mod gate_tests;
#[cfg(test)]
mod study;

//! The rules of a diagnosis and all their constants, as functions of plain data ([`super::candidate`]); `table` tests each at both sides of
//! its threshold.
//!
//! 1. [`statistics`]: how unlikely a fall of the error is, how sure a value.
//! 2. [`presence`]: what is there beyond chance, worth a place, at one joint or at all that are alike.
//! 3. [`feasible`]: what a robot can have.
//! 4. [`choice`]: which candidate is next, which simpler one explains the same, what it cannot be told from.
//! 5. [`step`]: which model stays, by data that it has not seen; what is refused, and what a model does without.

pub(crate) mod choice;
pub(crate) mod feasible;
pub(crate) mod presence;
pub(crate) mod statistics;
pub(crate) mod step;
#[cfg(test)]
mod table;

pub(crate) use presence::{RESOLUTION, STRUCTURE};
pub(crate) use statistics::{LEAST_Z, NOISE_MEMORY, Squared, least_z, sum_and_error};
pub(crate) use step::LEAST_VALUE;

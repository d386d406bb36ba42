//! Which effects a model lacks: candidates, criteria and the search.
//!
//! 1. [`criteria`]: the rules and their constants.
//! 2. [`screen`]: what each effect would add to a limb, on data that are held out.
//! 3. [`candidate`]: the same over limbs: an effect at one joint, a *family* (the effect at all like joints), a cause that all joints
//!    share.
//!    `placed`: loads as candidates where they are. `possible`: whether a robot can have what a candidate says.
//! 4. `drift`: parameters that change with time.
//! 5. `ranking`: which candidate is the best, and what it cannot be told from.
//! 6. [`state`]: a model of all limbs, and how it predicts what it has not seen.
//! 7. [`search`]: forward. `looseness` and `limits`: what columns do not show, springs and plays between motor and link and drives at
//!    their limits. `backward`: what the model does without again. `again`: beside the four plain effects of every drive, and with one
//!    cause for two. `headline`: what is named.

mod again;
mod backward;
pub(crate) mod candidate;
pub(crate) mod criteria;
pub(crate) mod drift;
mod headline;
mod limits;
mod looseness;
mod placed;
mod possible;
mod promise;
pub(crate) mod ranking;
pub(crate) mod screen;
pub(crate) mod search;
pub(crate) mod state;
mod take;

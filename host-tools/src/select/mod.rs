//! Which effects a model lacks: candidates, criteria and the search.
//!
//! The procedure, in its order:
//!
//! 1. [`score_test`]: what each effect would add to a limb's model, by columns that are derivatives of the prediction, on data that are held
//!    out fold by fold: [`trial_factors`], of whatever source of rows. `payload_placement`: payloads as candidates where they are. `gain_bound`: what a spring or a play may take away at
//!    most, without a fit.
//! 2. `enumerate`: the same over limbs: an effect at one joint, a *family* (the effect at all like joints), a cause that all joints share.
//!    [`candidate`]: one of them as plain data. `look`: all of them beside the model as it is.
//! 3. [`criteria`]: the rules and their constants, as functions of plain data: what is there beyond chance, what a robot can have, which one is
//!    next, which step stays. [`ranking`]: the verdict on each.
//! 4. [`search`]: a state machine that asks a [`source`] of rows for models ([`fitted`]: how one predicts what it has not seen). [`limbs`]: those of a
//!    base that is held, whose model is [`state`]. Its phases are
//!    - `limits`: drives at their limits, before and after the rest is known;
//!    - forward: the best candidate is fitted, and stays if it keeps what it promised (`accept`); `compliance_scan`: what lies between motor and
//!      link is found by trying; `refused`: what was tried in vain is not tried again;
//!    - `backward`: what has become nothing, or resembled what came later, is taken out again.
//!
//!    `restart`: other models to begin with, which one search alone would not reach.
//! 5. [`formula_screen`]: which torque outside the catalogue a joint's residual asks for; `formulas`: it as a step.
//! 6. `headline`: what is named first, with its value at the end and what it cannot be told from. [`drift`]: parameters that change with time.
//!    What no feasible value explains is outside the catalogue.

mod accept;
mod backward;
pub(crate) mod candidate;
mod compliance_scan;
pub(crate) mod criteria;
pub(crate) mod drift;
pub(crate) mod enumerate;
pub(crate) mod fitted;
pub(crate) mod formula_screen;
pub(crate) mod formulas;
mod gain_bound;
mod headline;
pub(crate) mod limbs;
mod limits;
mod look;
mod payload_placement;
pub(crate) mod ranking;
pub(crate) mod refused;
mod restart;
pub(crate) mod score_test;
pub(crate) mod search;
pub(crate) mod source;
pub(crate) mod state;
pub(crate) mod trial_factors;

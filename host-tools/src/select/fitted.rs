//! A model fitted to the rows of a source, as a search compares it with others.

use std::sync::Weak;

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Member};
use super::criteria::step::HeldOut;

/// A model fitted to the rows of a source, and how it predicts what it has not seen.
pub(crate) trait Fitted: Clone {
    /// What of it is fitted by itself: a limb, or the whole robot.
    type Fit;
    /// Held-out sums of squares.
    type Errors: Clone;

    fn errors(&self) -> &Self::Errors;

    /// Of all rows, (N m)².
    fn total(errors: &Self::Errors) -> f64;

    /// How it predicts what it has not seen, in units of the noise under `noise`'s model.
    fn held_out(&self, noise: &Self) -> HeldOut;

    /// The fits of a candidate's limbs.
    fn fits_of(&self, candidate: &Candidate) -> Vec<Weak<Self::Fit>>;

    /// Whether it has an effect.
    fn has(&self, member: &Member) -> bool;

    /// An effect's parameters and their standard deviations.
    fn parameters(&self, member: &Member) -> Vec<(f64, f64)>;

    /// The largest of an effect's parameters in units of its standard deviation.
    fn size(&self, member: &Member) -> f64;
}

/// One step of a search.
#[derive(Debug, Clone)]
pub(crate) struct Step<M: Fitted> {
    pub(crate) effect: EffectKind,
    pub(crate) members: Vec<Member>,
    /// How the model after it predicts what it has not seen.
    pub(crate) errors: M::Errors,
    pub(crate) removed: bool,
}

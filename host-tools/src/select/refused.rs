//! Candidates that were tried and not taken: what was refused beside the same fits, or promises no more than it did then, would be again.

use std::sync::Weak;

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Member};
use super::criteria::step::promises_no_more;
use super::fitted::Fitted;

/// All that a search has refused.
pub(crate) struct Refused<M: Fitted> {
    all: Vec<Refusal<M>>,
}

impl<M: Fitted> Default for Refused<M> {
    fn default() -> Self {
        Self { all: Vec::new() }
    }
}

/// A candidate that was not taken, what it promised, and the fits of its limbs that it was tried beside, which are told apart and not kept:
/// each has its data as factors.
struct Refusal<M: Fitted> {
    effect: EffectKind,
    members: Vec<Member>,
    /// In units of the joints' noise.
    promise: f64,
    beside: Vec<Weak<M::Fit>>,
}

impl<M: Fitted> Refused<M> {
    /// Remembers a candidate that was refused beside this model.
    pub(super) fn add(&mut self, candidate: &Candidate, model: &M) {
        self.all.push(Refusal {
            effect: candidate.effect,
            members: candidate.members.clone(),
            promise: candidate.gain().0,
            beside: model.fits_of(candidate),
        });
    }

    /// Whether a candidate was refused beside the same fits of its limbs.
    pub(super) fn has(&self, candidate: &Candidate, model: &M) -> bool {
        let beside = model.fits_of(candidate);
        let same = |a: &[Weak<M::Fit>]| {
            a.len() == beside.len() && a.iter().zip(&beside).all(|(a, b)| Weak::ptr_eq(a, b))
        };
        self.of(candidate).any(|refusal| same(&refusal.beside))
    }

    /// Whether a candidate was refused when it promised about as much, whatever the fits.
    pub(super) fn promises_no_more(&self, candidate: &Candidate) -> bool {
        let promise = candidate.gain().0;
        self.of(candidate)
            .any(|refusal| promises_no_more(promise, refusal.promise))
    }

    fn of(&self, candidate: &Candidate) -> impl Iterator<Item = &Refusal<M>> {
        (self.all.iter()).filter(|refusal| {
            refusal.effect == candidate.effect && refusal.members == candidate.members
        })
    }
}

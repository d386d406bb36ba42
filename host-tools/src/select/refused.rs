//! Candidates that were tried and not taken: what was refused beside the same fits, or promises no more than it did then, would be again.

use std::sync::{Arc, Weak};

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Member};
use super::criteria::step::promises_no_more;
use super::state::State;
use crate::estimate::fit::LimbFit;

/// All that a search has refused.
#[derive(Default)]
pub(super) struct Refused<'a> {
    all: Vec<Refusal<'a>>,
}

/// A candidate that was not taken, what it promised, and the fits of its limbs that it was tried beside, which are told apart and not kept:
/// each has its data as factors.
struct Refusal<'a> {
    effect: EffectKind,
    members: Vec<Member>,
    /// In units of the joints' noise.
    promise: f64,
    beside: Vec<Weak<LimbFit<'a>>>,
}

impl<'a> Refused<'a> {
    /// Remembers a candidate that was refused beside this model.
    pub(super) fn add(&mut self, candidate: &Candidate, model: &State<'a>) {
        self.all.push(Refusal {
            effect: candidate.effect,
            members: candidate.members.clone(),
            promise: candidate.gain().0,
            beside: beside(candidate, model),
        });
    }

    /// Whether a candidate was refused beside the same fits of its limbs.
    pub(super) fn has(&self, candidate: &Candidate, model: &State<'a>) -> bool {
        let beside = beside(candidate, model);
        let same = |a: &[Weak<LimbFit>]| {
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

    fn of(&self, candidate: &Candidate) -> impl Iterator<Item = &Refusal<'a>> {
        (self.all.iter()).filter(|refusal| {
            refusal.effect == candidate.effect && refusal.members == candidate.members
        })
    }
}

/// The fits of a candidate's limbs.
fn beside<'a>(candidate: &Candidate, model: &State<'a>) -> Vec<Weak<LimbFit<'a>>> {
    let limbs = candidate.trials.iter();
    limbs
        .map(|(limb, _)| Arc::downgrade(&model.fits[*limb]))
        .collect()
}

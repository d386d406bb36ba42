//! What a search asks of a source of rows: limbs of a base that is held ([`super::limbs`]), or a base that moves ([`crate::diagnose`]'s walks).

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Member};
use super::criteria::choice::Look;
use super::fitted::Fitted;
use super::refused::Refused;
use crate::estimate::limit::Limit;

/// A candidate, and the model with it if one could be fitted.
pub(crate) type Tried<'c, M> = (&'c Candidate, Option<M>);

/// A source of rows, with what it has seen at its last look at a model.
pub(crate) trait Source: Sized {
    type Model: Fitted;

    /// The model as it was given.
    fn start(&self) -> Option<Self::Model>;

    /// The same source, of which nothing was asked.
    fn anew(&self) -> Self;

    /// How many limbs are fitted each by itself.
    fn limbs(&self) -> usize;

    /// Joints of a limb.
    fn joints(&self, limb: usize) -> usize;

    /// The largest sampling period of the logs, s.
    fn period(&self) -> f64;

    /// All that a model may lack and was not given, by score tests. The model's own nonlinear parameters may be found anew.
    fn look(&mut self, model: &mut Self::Model) -> Vec<Candidate>;

    /// How many windows the candidates are judged by.
    fn windows(&self) -> f64;

    /// What a candidate adds to the model with another one in it.
    fn beside(&self, candidate: &Candidate, other: &Candidate) -> Option<Candidate>;

    /// The held-out error of the model that was looked at, as its columns have it, in units of the noise.
    fn error(&self) -> f64;

    /// The candidate to be taken next of those that are open.
    fn best<'o>(&self, look: &Look, open: &[&'o Candidate]) -> Option<&'o Candidate> {
        look.best(open)
    }

    /// The model with effects in it, fitted from nothing.
    fn begun(&self, model: &Self::Model, members: &[Member]) -> Option<Self::Model>;

    /// The model with a candidate in it, fitted from the model as it is.
    fn with(&self, model: &Self::Model, candidate: &Candidate) -> Option<Self::Model>;

    /// The model without some of its effects.
    fn without(&self, model: &Self::Model, members: &[Member]) -> Option<Self::Model>;

    /// The best candidate, or what it only resembles, and the model with it; and what was tried in vain. The `first` look tells what the best one
    /// would be, taken or not.
    fn try_best<'c>(
        &self,
        model: &Self::Model,
        _refused: &Refused<Self::Model>,
        best: &'c Candidate,
        _all: &'c [Candidate],
        _is_first: bool,
    ) -> (Tried<'c, Self::Model>, Vec<&'c Candidate>) {
        ((best, self.with(model, best)), Vec::new())
    }

    /// The model `after` a candidate was fitted, as it is to be kept; none if it does not keep what the candidate promised.
    fn accepted(
        &self,
        model: &Self::Model,
        candidate: &Candidate,
        after: Self::Model,
    ) -> Option<Self::Model>;

    /// What no column shows, found by trying: a candidate, the model with it, and whether it is sure.
    fn unseen<'c>(
        &self,
        _model: &Self::Model,
        _refused: &Refused<Self::Model>,
        _all: &'c [Candidate],
    ) -> Option<(&'c Candidate, Self::Model, bool)> {
        None
    }

    /// Whether a limb's model leaves much more of a joint than its noise. Where that is not known, it does not.
    fn leaves_much(&self, _model: &Self::Model, _limb: usize) -> bool {
        false
    }

    /// Whether what a model has and the one `without` it has not takes a part of something else at every joint where it takes much.
    fn is_stand_in(&self, _model: &Self::Model, _without: &Self::Model) -> bool {
        false
    }

    /// The model as it is kept: with all that trials held at its value fitted anew, unless it would move by less than so many standard deviations.
    fn settled(&self, model: Self::Model, _steady: f64) -> Self::Model {
        model
    }

    /// Drives at their limits that a model's fits tell and were not asked before.
    fn limits(&mut self, _model: &Self::Model) -> Vec<(Member, Limit)> {
        Vec::new()
    }

    /// The model with a limit, if it is worth a step.
    fn with_limit(&self, _model: &Self::Model, _limit: &(Member, Limit)) -> Option<Self::Model> {
        None
    }

    /// Of each effect that every drive has the joints where a model lacks it.
    fn lacking_of_drive(&self, model: &Self::Model) -> Vec<Vec<Member>> {
        let all = |effect: EffectKind| -> Vec<Member> {
            (0..self.limbs())
                .flat_map(|limb| (0..self.joints(limb)).map(move |j| (limb, (effect, j))))
                .filter(|member| !model.has(member))
                .collect()
        };
        let lacking = EffectKind::PLAIN.map(all).into_iter();
        lacking.filter(|members| !members.is_empty()).collect()
    }

    /// The model with effects in it of which nothing is known yet, fitted from the model as it is.
    fn with_members(&self, model: &Self::Model, members: &[Member]) -> Option<Self::Model>;

    /// Sum of squares of all torques that were measured, (N m)².
    fn torque(&self) -> f64;
}

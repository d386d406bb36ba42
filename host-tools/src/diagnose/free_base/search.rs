//! Walks, as a search asks them ([`crate::select::source`]).

use std::sync::{Arc, Weak};

use proprio_core::effect::{EffectKind, Form, Input, Varies};

use super::is_load;
use super::model::WalkModel;
use super::screen::{WalkScreen, possible};
use crate::catalogue;
use crate::equation::values::{Place, is_shared};
use crate::free_base::Walks;
use crate::free_base::data::Data;
use crate::free_base::fit::Fit;
use crate::free_base::structure::ModelStructure;
use crate::model::Model;
use crate::select::candidate::{Candidate, Member};
use crate::select::criteria::choice::{Look, RIVAL};
use crate::select::criteria::step::{are_most, is_held, is_worth_a_step};
use crate::select::criteria::{LEAST_VALUE, Squared, least_z, sum_and_error};
use crate::select::enumerate::of_joints;
use crate::select::fitted::Fitted;
use crate::select::source::Source;
use crate::select::trial_factors::ScoreTest;

/// What a load has: a mass, its place, and one more for its size.
const LOAD_FREEDOM: f64 = 5.0;

/// The square of what the transmitted torque of a joint is wrong by, as a share of it: 0.23 at the calves of MuJoCo's trot, 0.14 and 0.19 at the others
/// (`free_base::transmitted`). What follows the load leaves as much of its square, and that is no other effect's.
const LOAD_OPEN: f64 = 0.05;

/// Walks, a model of the robot, and what was seen at the last look.
pub(super) struct WalkSource<'a> {
    walks: &'a Walks,
    model: &'a Model,
    given: &'a ModelStructure,
    data: Arc<Data>,
    seen: Option<Seen<'a>>,
}

struct Seen<'a> {
    /// The fit that was looked at.
    fit: Weak<Fit>,
    screen: WalkScreen<'a>,
    possible: Vec<Place>,
}

impl<'a> WalkSource<'a> {
    pub(super) fn new(
        walks: &'a Walks,
        model: &'a Model,
        given: &'a ModelStructure,
        data: Arc<Data>,
    ) -> Self {
        Self {
            walks,
            model,
            given,
            data,
            seen: None,
        }
    }

    /// What a look at a model shows that is not the last one; none if numbers overflow.
    fn seen(&self, now: &mut WalkModel) -> Option<Seen<'a>> {
        if let Some(better) = now.with_better_shapes(self.walks) {
            *now = better;
        }
        let of = (now.data.clone(), self.model);
        Some(Seen {
            screen: WalkScreen::of(self.walks, of, &now.structure, &now.fit)?,
            fit: Arc::downgrade(&now.fit),
            possible: possible(self.walks, self.model, &now.structure),
        })
    }

    /// Whether a load keeps what it promised: what a body has beyond what the model's uncertainty leaves open, by how much the cost falls once that
    /// no longer binds.
    fn is_load_there(
        &self,
        (before, after): (&WalkModel, &WalkModel),
        candidate: &Candidate,
    ) -> Option<bool> {
        let free = |model: &WalkModel| {
            let data = &model.data;
            data.fit_with_free_bodies(&model.structure, &after.fit)
        };
        let (without, with) = (free(before)?, free(after)?);
        let cost = |fit: &Fit| fit.cost(&after.data, without.noise);
        let size = Squared {
            size: cost(&without) - cost(&with),
            freedom: LOAD_FREEDOM,
            tried: 1.0,
        };
        let (mass, std) = after.parameters(&candidate.members[0])[0];
        // A body whose mass is elsewhere carries no load.
        Some(mass > 0.0 && mass > LEAST_VALUE * std && size.z() >= least_z(candidate.tried))
    }
}

impl WalkSource<'_> {
    /// Whether a candidate takes no more than what a stance leaves open of the load at its joint, where an effect that follows the load is there already.
    fn is_of_the_load(
        &self,
        (model, after): (&WalkModel, &WalkModel),
        candidate: &Candidate,
    ) -> bool {
        let follows = |effect: &EffectKind| effect.description().input == Input::TransmittedTorque;
        let loads = || catalogue::effects().filter(follows);
        let own = candidate
            .members
            .iter()
            .flat_map(|(limb, (_, joint))| loads().map(move |effect| (*limb, (effect, *joint))));
        let taken = |with: &WalkModel, without: &WalkModel| sum_and_error(&with.gains(without)).0;
        own.filter(|member| model.has(member)).any(|member| {
            let bare = self.without(model, &[member]);
            bare.is_some_and(|bare| taken(after, model) < LOAD_OPEN * taken(model, &bare))
        })
    }
}

impl Source for WalkSource<'_> {
    type Model = WalkModel;

    fn start(&self) -> Option<WalkModel> {
        WalkModel::of(&self.data, self.given)
    }

    fn anew(&self) -> Self {
        Self::new(self.walks, self.model, self.given, self.data.clone())
    }

    fn limbs(&self) -> usize {
        1
    }

    /// Trunk and legs are one limb.
    fn joints(&self, _limb: usize) -> usize {
        self.given.robot.joints()
    }

    fn period(&self) -> f64 {
        self.walks.period()
    }

    fn look(&mut self, now: &mut WalkModel) -> Vec<Candidate> {
        let fit = Arc::downgrade(&now.fit);
        let known = self
            .seen
            .take()
            .filter(|seen| Weak::ptr_eq(&seen.fit, &fit));
        self.seen = known.or_else(|| self.seen(now));
        let Some(Seen {
            screen, possible, ..
        }) = &self.seen
        else {
            return Vec::new();
        };
        // Trunk and legs are one limb; the trunk is like no joint.
        let robot = &self.given.robot;
        let kind = |joint: usize| match is_shared(joint) {
            true => robot.joints(),
            false => robot.kind(joint),
        };
        let trial = |_: usize, places: &[Place]| screen.trial(places);
        let (mut candidates, _) = of_joints(&trial, std::slice::from_ref(possible), &kind);
        // Gains at many joints are another mass of the robot: all torques times one factor are those of bodies so many times as heavy.
        candidates.retain(|c| c.effect.description().form != Form::Scale || c.members.len() == 1);
        candidates
    }

    fn windows(&self) -> f64 {
        let seen = self.seen.as_ref();
        seen.map_or(1.0, |seen| seen.screen.equations())
    }

    fn beside(&self, candidate: &Candidate, other: &Candidate) -> Option<Candidate> {
        let screen = &self.seen.as_ref()?.screen;
        candidate.beside(other, &|_, places, others| {
            screen.trial_beside(places, others)
        })
    }

    fn error(&self) -> f64 {
        let seen = self.seen.as_ref();
        seen.map_or(0.0, |seen| seen.screen.error())
    }

    /// The best, but what every drive has before what looks like it at the speeds of a gait (drag like viscous friction). A constant torque is not
    /// before a load.
    fn best<'o>(&self, look: &Look, open: &[&'o Candidate]) -> Option<&'o Candidate> {
        let best = look.best(open)?;
        let plain = open.iter().copied().filter(|c| {
            let facts = c.effect.description();
            facts.is_plain()
                && facts.varies == Varies::Fast
                && c.torque_error_taken() >= RIVAL * best.torque_error_taken()
        });
        Some(look.best(&plain.collect::<Vec<_>>()).unwrap_or(best))
    }

    fn begun(&self, model: &WalkModel, members: &[Member]) -> Option<WalkModel> {
        WalkModel::of(&model.data, &model.structure_with(self.model, members))
    }

    fn with(&self, model: &WalkModel, candidate: &Candidate) -> Option<WalkModel> {
        self.with_members(model, &candidate.members)
    }

    fn with_members(&self, model: &WalkModel, members: &[Member]) -> Option<WalkModel> {
        let structure = model.structure_with(self.model, members);
        model.refitted(model.data.clone(), structure)
    }

    fn without(&self, model: &WalkModel, members: &[Member]) -> Option<WalkModel> {
        // Trunk and legs are one limb: what all of it shares is one member.
        let [(_, place)] = *members else {
            return None;
        };
        model.refitted(model.data.clone(), model.structure_without(place))
    }

    fn accepted(
        &self,
        model: &WalkModel,
        candidate: &Candidate,
        after: WalkModel,
    ) -> Option<WalkModel> {
        let (gain, error) = sum_and_error(&after.gains(model));
        if gain <= error || !is_worth_a_step(&after.held_out(model), &model.held_out(model)) {
            return None;
        }
        if self.is_of_the_load((model, &after), candidate) {
            return None;
        }
        let members = &candidate.members;
        let holds = match is_load(candidate.effect) && members.len() == 1 {
            true => self.is_load_there((model, &after), candidate)?,
            false => {
                let there = members.iter().filter(|member| is_held(after.size(member)));
                are_most(there.count(), members.len())
            }
        };
        holds.then_some(after)
    }

    fn torque(&self) -> f64 {
        let seen = self.seen.as_ref();
        seen.map_or(0.0, |seen| seen.screen.torque())
    }
}

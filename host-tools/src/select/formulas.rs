//! A formula found as a step of a search: fitted with the whole model, and kept by the rule of every step.

use super::candidate::Member;
use super::criteria::step::{
    Leaves, bears_a_drive, does_as_well, does_without, is_held, is_worth_a_step,
};
use super::fitted::{Fitted, Step};
use super::limbs::Limbs;
use super::search::Found;
use super::source::Source;
use super::state::{State, held_out_with_shape, how_with};
use crate::equation::values::Values;
use crate::estimate::fit::LimbFit;
use crate::estimate::limb_data::LimbData;

/// An effect as a screen has found it: where, and the values of its parameters by their number.
pub(crate) type Asked = (Member, Vec<(usize, f64)>);

impl<'a> Found<Limbs<'a>> {
    /// Adds what a screen of the model at the end asks for; whether the model with it predicts what it has not seen better by what a step is
    /// worth. With it comes what the drives of other joints have, which this joint's could not show before it: beside that, too, it has its worth.
    pub(crate) fn take(&mut self, data: &'a [LimbData<'a>], asked: &Asked) -> bool {
        let (limb, place) = asked.0;
        let drive = self.drive_at(limb, place.1);
        let Some(after) = with(data, &self.end, asked, &drive) else {
            return false;
        };
        let told = after.held_out(&self.end);
        let beside = self.with_drive(&drive);
        let is_worth = |beside: &State| is_worth_a_step(&told, &beside.held_out(&self.end));
        if !beside.as_ref().is_none_or(is_worth) {
            return false;
        }
        for member in [asked.0].into_iter().chain(drive) {
            self.put(member, after.clone(), false);
        }
        true
    }

    /// Adds what the drives of other joints have to a joint's where the model predicts no worse with it: of a constant torque that the model lacks much
    /// that changes with time has a part.
    pub(crate) fn complete_drive(&mut self, limb: usize, joint: usize) {
        let drive = self.drive_at(limb, joint);
        let Some(after) = self.with_drive(&drive) else {
            return;
        };
        let [told, before] = [&after, &self.end].map(|of| of.held_out(&self.end));
        if bears_a_drive(&told, &before) {
            for member in drive {
                self.put(member, after.clone(), false);
            }
        }
    }

    /// The model with these; none where they are none.
    fn with_drive(&self, drive: &[Member]) -> Option<State<'a>> {
        let some = (!drive.is_empty()).then_some(drive)?;
        self.source.with_members(&self.end, some)
    }

    /// Plain effects that the model has at other joints and lacks at this one.
    fn drive_at(&self, limb: usize, joint: usize) -> Vec<Member> {
        let joints: usize = (0..self.source.limbs())
            .map(|limb| self.source.joints(limb))
            .sum();
        let lacking = self.source.lacking_of_drive(&self.end).into_iter();
        let some_have = lacking.filter(|members| members.len() < joints);
        let own = some_have
            .flatten()
            .filter(|(l, place)| (*l, place.1) == (limb, joint));
        own.collect()
    }

    /// The model at the end as it is, and how many steps led to it.
    pub(crate) fn clone_end(&self) -> (State<'a>, usize) {
        (self.end.clone(), self.steps.len())
    }

    /// Goes back to a model that it was.
    pub(crate) fn undo(&mut self, (before, steps): (State<'a>, usize)) {
        self.end = before;
        self.steps.truncate(steps);
    }

    /// Takes one effect for all that the search has added at a joint beyond what every drive has, where the model does as well with the one that a screen
    /// of the model without them asks for; where they are one, which has a name, where it does better by what a step is worth.
    pub(crate) fn exchange(
        &mut self,
        data: &'a [LimbData<'a>],
        (limb, joint): (usize, usize),
        screen: &dyn Fn(&LimbFit) -> Option<Asked>,
    ) -> Option<Member> {
        let without = |end: &State<'a>, several: &[Member]| {
            let mut places = end.places();
            places[limb].retain(|place| !several.contains(&(limb, *place)));
            end.with(data, &places, &end.values(), &[])
        };
        self.exchange_by((limb, joint), without, |without| {
            let asked = screen(&without.fits[limb])?;
            Some((asked.0, with(data, without, &asked, &[])?))
        })
    }

    /// Takes out what only resembled an effect that has come since at the same joint.
    pub(crate) fn take_out_beside(&mut self, data: &'a [LimbData<'a>], one: Member) {
        self.take_out_resembling(one, |end, member| {
            let mut places = end.places();
            places[member.0].retain(|own| *own != member.1);
            end.with(data, &places, &end.values(), &[])
        });
    }

    /// Looks at the model at the end again: what it leaves, and what of it changes with time.
    pub(crate) fn look_again(&mut self) {
        self.source.look(&mut self.end);
    }
}

impl<S: Source> Found<S> {
    /// Takes one effect for all that the search has added at a joint beyond what every drive has, as a limb's search does: `without` is a model without
    /// some members, and `with` what it asks for, with that.
    pub(crate) fn exchange_by(
        &mut self,
        (limb, joint): (usize, usize),
        without: impl Fn(&S::Model, &[Member]) -> Option<S::Model>,
        with: impl FnOnce(&S::Model) -> Option<(Member, S::Model)>,
    ) -> Option<Member> {
        let several = self.added_at(limb, joint);
        if several.is_empty() {
            return None;
        }
        let without = without(&self.end, &several)?;
        let (asked, after) = with(&without)?;
        let [one, own] = [&after, &self.end].map(|of| of.held_out(&self.end));
        let stands = match several.len() {
            1 => is_worth_a_step(&one, &own),
            _ => does_as_well(one.weighted, own.weighted),
        };
        if !stands {
            return None;
        }
        for member in several {
            self.put(member, without.clone(), true);
        }
        self.put(asked, after, false);
        Some(asked)
    }

    /// Takes out what only resembled an effect that has come since at the same joint; `without` is a model without a member.
    pub(crate) fn take_out_resembling(
        &mut self,
        one: Member,
        without: impl Fn(&S::Model, Member) -> Option<S::Model>,
    ) {
        let (limb, place) = one;
        for member in self.added_at(limb, place.1).into_iter().rev() {
            if member == one {
                continue;
            }
            let Some(after) = without(&self.end, member) else {
                continue;
            };
            let [now, before] = [&after, &self.end].map(|of| of.held_out(&self.end));
            if does_without(&now, &before, Leaves::Resembles) {
                self.put(member, after, true);
            }
        }
    }

    /// The effects beyond those of every drive that the search has added at a joint and the model has.
    pub(crate) fn added_at(&self, limb: usize, joint: usize) -> Vec<Member> {
        let added = self.steps.iter().filter(|step| !step.removed);
        let mut own: Vec<Member> = Vec::new();
        for member in added.flat_map(|step| &step.members) {
            let is_there = member.0 == limb && member.1.1 == joint && self.end.has(member);
            if is_there && !member.1.0.description().is_plain() && !own.contains(member) {
                own.push(*member);
            }
        }
        own
    }

    /// Puts a member in, or takes it out: the model is the one `after` that.
    pub(crate) fn put(&mut self, member: Member, after: S::Model, removed: bool) {
        self.end = after;
        self.steps.push(Step {
            effect: member.1.0,
            members: vec![member],
            errors: self.end.errors().clone(),
            removed,
        });
    }
}

/// A model with an effect and others `beside` it, if it predicts what it has not seen better by what a step is worth, and the effect is more than nothing.
fn with<'a>(
    data: &'a [LimbData<'a>],
    model: &State<'a>,
    ((limb, place), values): &Asked,
    beside: &[Member],
) -> Option<State<'a>> {
    let mut start: Vec<Values> = model.values();
    let new: Vec<Member> = beside.iter().copied().chain([(*limb, *place)]).collect();
    for (limb, place) in &new {
        start[*limb].insert(*place);
    }
    for (n, value) in values {
        let bounds = &place.0.description().parameters[*n];
        start[*limb].set(*place, *n, value.clamp(bounds.lower, bounds.upper));
    }
    let places = model.places_with(&new);
    let mut after =
        model.with_worthwhile(data, &places, &start, &how_with(&[*place]), &|_| true)?;
    if place.0.description().has_shape() {
        // A nonlinear parameter that all data have chosen is no surprise to the fold that is held out.
        let (before, fit) = (&model.fits[*limb], &after.fits[*limb]);
        after.squares[*limb] = held_out_with_shape(before, fit, *place)?;
    }
    let [now, before] = [&after, model].map(|of| of.held_out(model));
    (is_worth_a_step(&now, &before) && is_held(after.size(&(*limb, *place)))).then_some(after)
}

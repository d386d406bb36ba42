//! A formula found as a step of a search: fitted with the whole model, and kept by the rule of every step.

use super::candidate::Member;
use super::criteria::step::{Leaves, does_as_well, does_without, is_held, is_worth_a_step};
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
    /// worth.
    pub(crate) fn take(&mut self, data: &'a [LimbData<'a>], asked: &Asked) -> bool {
        let Some(after) = with(data, &self.end, asked) else {
            return false;
        };
        self.put(asked.0, after, false);
        true
    }

    /// The model at the end as it is.
    pub(crate) fn clone_end(&self) -> State<'a> {
        self.end.clone()
    }

    /// Goes back to the model before the last step.
    pub(crate) fn undo(&mut self, before: State<'a>) {
        self.end = before;
        self.steps.pop();
    }

    /// Takes one effect for all that the search has added at a joint beyond what every drive has, where these are several and the model does as
    /// well with the one that a screen of the model without them asks for.
    pub(crate) fn exchange(
        &mut self,
        data: &'a [LimbData<'a>],
        (limb, joint): (usize, usize),
        screen: &dyn Fn(&LimbFit) -> Option<Asked>,
    ) -> Option<Member> {
        let several = self.added_at(limb, joint);
        if several.len() < 2 {
            return None;
        }
        let mut places = self.end.places();
        places[limb].retain(|place| !several.contains(&(limb, *place)));
        let without = self.end.with(data, &places, &self.end.values(), &[])?;
        let asked = screen(&without.fits[limb])?;
        let after = with(data, &without, &asked)?;
        let [one, two] = [&after, &self.end].map(|of| of.held_out(&self.end).weighted);
        if !does_as_well(one, two) {
            return None;
        }
        for member in several {
            self.put(member, without.clone(), true);
        }
        self.put(asked.0, after, false);
        Some(asked.0)
    }

    /// Takes out what only resembled an effect that has come since at the same joint.
    pub(crate) fn take_out_beside(&mut self, data: &'a [LimbData<'a>], one: Member) {
        let (limb, place) = one;
        for member in self.added_at(limb, place.1).into_iter().rev() {
            if member == one {
                continue;
            }
            let mut places = self.end.places();
            places[limb].retain(|own| *own != member.1);
            let values = self.end.values();
            let Some(after) = self.end.with(data, &places, &values, &[]) else {
                continue;
            };
            let [now, before] = [&after, &self.end].map(|of| of.held_out(&self.end));
            if does_without(&now, &before, Leaves::Resembles) {
                self.put(member, after, true);
            }
        }
    }

    /// Looks at the model at the end again: what it leaves, and what of it changes with time.
    pub(crate) fn look_again(&mut self) {
        self.source.look(&mut self.end);
    }

    /// The effects beyond those of every drive that the search has added at a joint and the model has.
    fn added_at(&self, limb: usize, joint: usize) -> Vec<Member> {
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

    fn put(&mut self, member: Member, after: State<'a>, removed: bool) {
        self.end = after;
        self.steps.push(Step {
            effect: member.1.0,
            members: vec![member],
            errors: self.end.errors().clone(),
            removed,
        });
    }
}

/// A model with an effect more, if it predicts what it has not seen better by what a step is worth, and the effect is more than nothing.
fn with<'a>(
    data: &'a [LimbData<'a>],
    model: &State<'a>,
    ((limb, place), values): &Asked,
) -> Option<State<'a>> {
    let mut start: Vec<Values> = model.values();
    start[*limb].insert(*place);
    for (n, value) in values {
        let bounds = &place.0.description().parameters[*n];
        start[*limb].set(*place, *n, value.clamp(bounds.lower, bounds.upper));
    }
    let places = model.places_with(&[(*limb, *place)]);
    let mut after =
        model.with_worthwhile(data, &places, &start, &how_with(&[*place]), &|_| true)?;
    if place.0.description().shape().is_some() {
        // A nonlinear parameter that all data have chosen is no surprise to the fold that is held out.
        let (before, fit) = (&model.fits[*limb], &after.fits[*limb]);
        after.squares[*limb] = held_out_with_shape(before, fit, *place)?;
    }
    let [now, before] = [&after, model].map(|of| of.held_out(model));
    (is_worth_a_step(&now, &before) && is_held(after.size(&(*limb, *place)))).then_some(after)
}

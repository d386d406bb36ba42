//! From a model as it is given to one that lacks nothing the data can tell: forward and backward selection, whatever the source of rows.
//!
//! A step is judged on the user's path: the model with it is fitted to all folds but one, by the estimator that writes model files,
//! and predicts that one by the predictor that scores them. A step stays if the held-out error falls, no log's rises, and its values
//! are physical and not nothing.
//!
//! A search is a state machine: a [`Phase`] says which edits of the model are looked for, the other files of this room make them, and
//! [`Search::apply`] alone changes the model.

use super::candidate::{Candidate, Member};
use super::criteria::choice::{Look, are_one_column};
use super::criteria::feasible::is_feasible;
use super::criteria::presence::is_structure;
use super::criteria::step::{
    LEAST_SHARE, Leaves, bears_a_drive, begins_below, does_as_well, does_without, goes_on,
    may_take_away,
};
use super::fitted::{Fitted, Step};
use super::ranking::{Judged, judge, judged};
use super::refused::Refused;
use super::source::{Source, Tried};
use super::{backward, headline, restart};
use proprio_core::effect::EffectKind;

use crate::equation::values::is_shared;
use crate::estimate::fit::STEADY;
use crate::model::BASE;

/// Standard deviations within which a value that all limbs share stays between steps: one takes half a unit of the logarithm of the likelihood, and
/// a step is worth several. Moved, it is fitted anew in all limbs, and all of them are screened anew.
const BETWEEN_STEPS: f64 = 1.0;

/// What a search has found.
pub(crate) struct Found<S: Source> {
    /// The source, after a look at the model at the end.
    pub(crate) source: S,
    /// What each candidate would add to the model as it was given: the best first, if one is there.
    pub(crate) first: Vec<Judged>,
    /// How the model as it was given predicts what it has not seen.
    pub(crate) start: Errors<S>,
    pub(crate) steps: Vec<Step<S::Model>>,
    /// The model at the end.
    pub(crate) end: S::Model,
    /// What the catalogue might still take away at the end, its values impossible.
    pub(crate) unphysical: Vec<Judged>,
}

type Errors<S> = <<S as Source>::Model as Fitted>::Errors;

/// Searches from the model as the source was given it.
///
/// One search alone may end above a model that it would not take step by step: it begins again with what every drive has, with one cause where
/// it took two, and with one joint where it took all and undid others; and with the `causes` that all joints share and that a reading of the log has shown.
pub(crate) fn search<S: Source>(source: S, causes: &[EffectKind]) -> Option<Found<S>> {
    let start = source.start()?;
    let mut search = Search::new(source, start).run(Phase::Limits);
    if let Some(other) = search.with_drive() {
        search = other;
    }
    if let Some(other) = search.with_one_cause() {
        search = other;
    }
    if let Some(other) = search.with_one_joint() {
        search = other;
    }
    for cause in causes {
        if let Some(other) = search.with_shared(*cause) {
            search = other;
        }
    }
    Some(search.finish())
}

/// What a search looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Drives at their limits, `again` once the rest of the model is known.
    Limits,
    LimitsAgain,
    /// The next effect that the model lacks.
    Forward,
    ForwardAgain,
    /// What the model does without.
    Backward,
    End,
}

impl Phase {
    /// What is looked for next, by whether the model has `changed`.
    fn next(self, changed: bool) -> Self {
        match (self, changed) {
            (Self::Limits, _) | (Self::Forward, true) => Self::Forward,
            // What effects have explained of the torque may have hidden a limit.
            (Self::Forward, false) => Self::LimitsAgain,
            (Self::LimitsAgain | Self::ForwardAgain, true) => Self::ForwardAgain,
            (Self::LimitsAgain | Self::ForwardAgain, false) => Self::Backward,
            (Self::Backward | Self::End, _) => Self::End,
        }
    }
}

/// A change of the model.
struct Edit<M> {
    members: Vec<Member>,
    /// Whether they are taken out.
    removed: bool,
    after: M,
}

/// A search on its way.
struct Search<S: Source> {
    source: S,
    start: Errors<S>,
    model: S::Model,
    steps: Vec<Step<S::Model>>,
    first: Vec<Judged>,
    refused: Refused<S::Model>,
}

impl<S: Source> Search<S> {
    fn new(source: S, model: S::Model) -> Self {
        Self {
            source,
            start: model.errors().clone(),
            model,
            steps: Vec::new(),
            first: Vec::new(),
            refused: Refused::default(),
        }
    }

    /// From a phase to the end.
    fn run(mut self, mut phase: Phase) -> Self {
        while phase != Phase::End {
            let changed = match phase {
                Phase::Limits | Phase::LimitsAgain => self.take_limits(),
                Phase::Forward | Phase::ForwardAgain => self.take_next(),
                Phase::Backward => self.take_out(),
                Phase::End => false,
            };
            phase = phase.next(changed);
        }
        self
    }

    /// Changes the model: the only place that does.
    fn apply(&mut self, edit: Edit<S::Model>) {
        self.model = self.source.settled(edit.after, BETWEEN_STEPS);
        self.steps.push(Step {
            effect: edit.members[0].1.0,
            members: edit.members,
            errors: self.model.errors().clone(),
            removed: edit.removed,
        });
    }

    fn add(&mut self, members: &[Member], after: S::Model) {
        self.apply(Edit {
            members: members.to_vec(),
            removed: false,
            after,
        });
    }

    fn look(&mut self) -> Vec<Candidate> {
        self.source.look(&mut self.model)
    }

    /// What a look has shown, for the rules.
    fn with_look<T>(&self, all: &[Candidate], rule: impl FnOnce(&Look) -> T) -> T {
        rule(&Look {
            all,
            windows: self.source.windows(),
            beside: &|candidate, other| self.source.beside(candidate, other),
        })
    }

    /// Takes limits of torques into the model that the data tell.
    fn take_limits(&mut self) -> bool {
        let mut taken = false;
        for found in self.source.limits(&self.model) {
            let Some(after) = self.source.with_limit(&self.model, &found) else {
                continue;
            };
            let (member, limit) = found;
            if self.steps.is_empty() {
                let candidates = self.look();
                let own = candidates.iter().find(|c| c.members == [member]);
                self.first = self.with_look(&candidates, |look| judge(look, own));
                if own.is_some() {
                    self.first =
                        headline::with_values(std::mem::take(&mut self.first), &after, true);
                    self.first[0].parameters[0][0] = (limit.torque, limit.std);
                }
            }
            self.add(&[member], after);
            taken = true;
        }
        taken
    }

    /// Takes the next effect into the model, if one is there and helps; with it what every drive has, where that was missing.
    fn take_next(&mut self) -> bool {
        if !goes_on(self.steps.len(), 0) {
            return false;
        }
        let candidates = self.look();
        let taken = self.take_best(&candidates) || self.take_unseen(&candidates);
        if taken && restart::lacks_a_drive(&self.steps) {
            self.complete_drive();
        }
        taken
    }

    /// Takes the best candidate that is not refused.
    fn take_best(&mut self, candidates: &[Candidate]) -> bool {
        let base = self.source.error();
        let mut open: Vec<&Candidate> = (candidates.iter())
            .filter(|c| may_take_away(c.gain().0, LEAST_SHARE, base))
            .filter(|c| !self.refused.has(c, &self.model))
            .collect();
        let mut known = match self.first.is_empty() {
            true => self.look_first(candidates),
            false => None,
        };
        let mut refused = 0;
        while goes_on(self.steps.len(), refused) {
            refused += 1;
            let best = self.with_look(candidates, |look| self.source.best(look, &open));
            let Some(mut next) = best else {
                return false;
            };
            if !self.refused.promises_no_more(next) {
                let (told, after) = match known.take() {
                    Some((of, tried)) if of.is_same(next) => tried,
                    _ => self.try_best(next, candidates, false),
                };
                next = told;
                let accepted =
                    after.and_then(|after| self.source.accepted(&self.model, next, after));
                if let Some(after) = accepted {
                    self.add(&next.members, after);
                    return true;
                }
                self.refused.add(next, &self.model);
            }
            open.retain(|c| !c.is_same(next));
        }
        false
    }

    /// Judges what each candidate would add to the model as it was given: the best of them by trying it, which is returned with what was
    /// told of it.
    fn look_first<'c>(
        &mut self,
        candidates: &'c [Candidate],
    ) -> Option<(&'c Candidate, Tried<'c, S::Model>)> {
        let all: Vec<&Candidate> = candidates.iter().collect();
        let best = self.with_look(candidates, |look| self.source.best(look, &all));
        let Some(best) = best else {
            self.first = self.with_look(candidates, |look| judge(look, None));
            return None;
        };
        let (told, after) = self.try_best(best, candidates, true);
        self.first = self.with_look(candidates, |look| judge(look, Some(told)));
        if let Some(after) = &after {
            let first = std::mem::take(&mut self.first);
            self.first = headline::with_values(first, after, !told.is_same(best));
        }
        Some((best, (told, after)))
    }

    /// The best candidate, or what it only resembles, and the model with it.
    fn try_best<'c>(
        &mut self,
        best: &'c Candidate,
        all: &'c [Candidate],
        is_first: bool,
    ) -> Tried<'c, S::Model> {
        let (told, useless) =
            (self.source).try_best(&self.model, &self.refused, best, all, is_first);
        for candidate in useless {
            self.refused.add(candidate, &self.model);
        }
        match told {
            (told, Some(after)) => self.best_of_one_column((told, after), all),
            untried => untried,
        }
    }

    /// Of a candidate that was fitted, and those of the same column, the one whose fit leaves least: no first order tells which it is.
    fn best_of_one_column<'c>(
        &self,
        (told, after): (&'c Candidate, S::Model),
        all: &'c [Candidate],
    ) -> Tried<'c, S::Model> {
        let is_alike = |c: &&Candidate| {
            !c.is_same(told) && are_one_column(c, told) && !self.refused.has(c, &self.model)
        };
        let others = all.iter().filter(is_alike);
        let others = others.filter_map(|c| Some((c, self.source.with(&self.model, c)?)));
        let error = |after: &S::Model| after.held_out(&self.model).weighted;
        let best = std::iter::once((told, after))
            .chain(others)
            .min_by(|a, b| error(&a.1).total_cmp(&error(&b.1)));
        best.map_or((told, None), |(told, after)| (told, Some(after)))
    }

    /// Takes what no column shows, where none shows anything that helps.
    fn take_unseen(&mut self, all: &[Candidate]) -> bool {
        let found = self.source.unseen(&self.model, &self.refused, all);
        let Some((candidate, told, is_sure)) = found else {
            return false;
        };
        let accepted = is_sure
            .then(|| self.source.accepted(&self.model, candidate, told.clone()))
            .flatten();
        let Some(after) = accepted else {
            self.refused.add(candidate, &self.model);
            return false;
        };
        if self.steps.is_empty() {
            let first = self.with_look(all, |look| judge(look, Some(candidate)));
            self.first = headline::with_values(first, &told, true);
        }
        self.add(&candidate.members, after);
        true
    }

    /// Where two plain effects were missing at many joints, the others are there too and at all joints, whether or not this log moves
    /// fast enough to tell: a model without them fails on one that does.
    fn complete_drive(&mut self) {
        for members in self.source.lacking_of_drive(&self.model) {
            let Some(after) = self.source.with_members(&self.model, &members) else {
                continue;
            };
            let before = self.model.held_out(&self.model);
            if bears_a_drive(&after.held_out(&self.model), &before) {
                self.add(&members, after);
            }
        }
    }

    /// Takes out again what has become nothing, or what the others do without.
    fn take_out(&mut self) -> bool {
        let drive = restart::lacks_a_drive(&self.steps);
        let by_error = |why: Leaves| {
            move |search: &Self, after: &S::Model| {
                let before = search.model.held_out(&search.model);
                does_without(&after.held_out(&search.model), &before, why)
            }
        };
        for member in backward::nothing(&self.model, &self.steps, drive) {
            self.do_without(member, by_error(Leaves::Nothing));
        }
        for member in backward::unresolved(&self.model, &self.steps, self.source.period()) {
            self.do_without(member, by_error(Leaves::Infeasible));
        }
        for member in backward::superseded(&self.steps) {
            self.do_without(member, by_error(Leaves::Resembles));
        }
        true
    }

    /// Takes out what explains little where much is left: with what the catalogue lacks it goes by the name of that, and is none.
    fn take_out_stand_ins(&mut self) {
        for member in backward::beyond_drives(&self.steps) {
            if self.source.leaves_much(&self.model, member.0) {
                self.do_without(member, |search, after| {
                    search.source.is_stand_in(&search.model, after)
                });
            }
        }
    }

    fn do_without(&mut self, member: Member, may: impl Fn(&Self, &S::Model) -> bool) {
        // What is nothing may be superseded too.
        if !self.model.has(&member) {
            return;
        }
        // What all limbs share goes from all of them.
        let members: Vec<Member> = match is_shared(member.1.1) {
            true => (0..self.source.limbs())
                .map(|limb| (limb, member.1))
                .collect(),
            false => vec![member],
        };
        let Some(after) = self.source.without(&self.model, &members) else {
            return;
        };
        if may(self, &after) {
            self.apply(Edit {
                members,
                removed: true,
                after,
            });
        }
    }

    /// A search that begins with the four plain effects at all joints, if this one ends above them.
    fn with_drive(&self) -> Option<Self> {
        if self.steps.is_empty() {
            return None;
        }
        let lacks = |search: &Self| self.source.lacking_of_drive(&search.model);
        if lacks(self).is_empty() {
            return None;
        }
        let mut other = self.anew()?;
        for members in lacks(&other) {
            other.begin_with(&members)?;
        }
        let [begin, end] = [&other, self].map(|search| S::Model::total(search.model.errors()));
        if !begins_below(begin, end, self.source.torque()) {
            return None;
        }
        other.take_limits();
        Some(other.run(Phase::ForwardAgain))
    }

    /// A search that begins with one cause where this one has found two, if it does as well: one cause before two.
    fn with_one_cause(&self) -> Option<Self> {
        let causes = restart::one_cause(&self.steps);
        if causes.is_empty() {
            return None;
        }
        self.anew_with(&causes)
    }

    /// A search that begins with an effect at one joint where this one has it at all and undoes it at some, if it does as well in fewer steps.
    fn with_one_joint(&self) -> Option<Self> {
        let added = self.steps.iter().filter(|step| !step.removed);
        let added: Vec<_> = added.map(|s| (s.effect, &s.members[..])).collect();
        let first = self.first.iter().map(|judged| &judged.candidate);
        let member = restart::one_joint(&added, first)?;
        let other = self.anew_with(&[vec![member]])?;
        (other.steps.len() < self.steps.len()).then_some(other)
    }

    /// A search that begins with effects, untried, if it does as well as this one.
    fn anew_with(&self, causes: &[Vec<Member>]) -> Option<Self> {
        let mut other = self.anew()?;
        for members in causes {
            other.begin_with(members)?;
        }
        let other = other.run(Phase::ForwardAgain);
        let error = |search: &Self| search.model.held_out(&self.model).weighted;
        does_as_well(error(&other), error(self)).then_some(other)
    }

    /// A search that begins with a cause that all joints share, if this one has not found it and that one does as well.
    fn with_shared(&self, cause: EffectKind) -> Option<Self> {
        let limbs = 0..self.source.limbs();
        let mut members: Vec<Member> = limbs.map(|limb| (limb, (cause, BASE))).collect();
        members.retain(|member| !self.model.has(member));
        if members.is_empty() {
            return None;
        }
        let mut other = self.anew()?;
        other.first.clear();
        other.begin_with(&members)?;
        let other = other.run(Phase::Forward);
        let error = |search: &Self| search.model.held_out(&self.model).weighted;
        let (with, without) = (error(&other), error(self));
        // One cause for all has to stand for others, or to predict better: as well beside them is none.
        let is_worth = other.steps.len() < self.steps.len() || !does_as_well(without, with);
        (is_worth && does_as_well(with, without)).then_some(other)
    }

    /// A search that has taken nothing yet, its headline known.
    fn anew(&self) -> Option<Self> {
        let source = self.source.anew();
        let start = source.start()?;
        let mut other = Self::new(source, start);
        other.first.clone_from(&self.first);
        Some(other)
    }

    /// Takes effects into the model untried.
    fn begin_with(&mut self, members: &[Member]) -> Option<()> {
        let after = self.source.begun(&self.model, members)?;
        self.add(members, after);
        Some(())
    }

    fn finish(mut self) -> Found<S> {
        self.take_out_stand_ins();
        self.model = self.source.settled(self.model, STEADY);
        if let Some(last) = self.steps.last_mut() {
            last.errors.clone_from(self.model.errors());
        }
        let candidates = self.look();
        let mut unphysical: Vec<Judged> = Vec::new();
        for c in candidates.iter().filter(|c| c.members.len() == 1) {
            let known = unphysical.iter().any(|j| j.candidate.meets(c));
            if !known && is_structure(c) && !is_feasible(c) {
                unphysical.push(judged(c));
            }
        }
        Found {
            first: headline::kept(self.first, &self.start, &self.steps, &self.model),
            source: self.source,
            unphysical,
            start: self.start,
            steps: self.steps,
            end: self.model,
        }
    }
}

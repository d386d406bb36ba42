//! A candidate fitted, and accepted if the model with it keeps what the candidate promised.

use super::candidate::{Candidate, Member};
use super::criteria::step::{
    HeldOut, LEAST_SHARE, are_most, is_better, is_by_noise, is_held, is_of_most_folds,
    is_worth_a_step, may_take_away,
};
use super::fitted::Fitted;
use super::score_test::Screen;
use super::state::{State, held_out_with_shape, how_near, how_with};
use crate::equation::values::{Place, Values};
use crate::estimate::fit::How;
use crate::estimate::limb_data::LimbData;

/// What a step works from: the data, the model as it is, and the score tests of each of its limbs.
#[derive(Clone, Copy)]
pub(super) struct Context<'s, 'a> {
    pub(super) data: &'a [LimbData<'a>],
    pub(super) model: &'s State<'a>,
    pub(super) screens: &'s [Screen<'a>],
}

impl<'a> Context<'_, 'a> {
    /// The held-out error of the model as it is, in units of the joints' noise.
    pub(super) fn now(&self) -> f64 {
        self.model.weighted(self.model)
    }

    /// The held-out error of another model, in units of the joints' noise under this one.
    pub(super) fn held_out(&self, model: &State) -> HeldOut {
        model.held_out(self.model)
    }

    /// The model with a candidate in it, fitted.
    pub(super) fn with(&self, candidate: &Candidate) -> Option<State<'a>> {
        self.with_worthwhile(candidate, &|_| true)
    }

    /// The same where `is_worth` says so of the fit. A play or a spring that promises something is sought near what it promises.
    pub(super) fn with_worthwhile(
        &self,
        candidate: &Candidate,
        is_worth: &dyn Fn(&State) -> bool,
    ) -> Option<State<'a>> {
        let near = match candidate.members[..] {
            [(limb, place)] => self
                .screens
                .get(limb)
                .and_then(|screen| screen.most_of_one(place))
                .filter(|(fall, _)| may_take_away(*fall, LEAST_SHARE, self.now()))
                .map(|(_, size)| (limb, place, size)),
            _ => None,
        };
        let Some((limb, place, size)) = near else {
            return self.with_all_sought(candidate, is_worth);
        };
        let mut start = self.start_with(candidate);
        start[limb].set(place, 0, size);
        self.fitted(candidate, &start, &how_near(place), is_worth)
    }

    /// The same with its nonlinear parameters sought wherever they may be.
    fn with_all_sought(
        &self,
        candidate: &Candidate,
        is_worth: &dyn Fn(&State) -> bool,
    ) -> Option<State<'a>> {
        let places: Vec<Place> = candidate.members.iter().map(|(_, place)| *place).collect();
        let start = self.start_with(candidate);
        self.fitted(candidate, &start, &how_with(&places), is_worth)
    }

    fn fitted(
        &self,
        candidate: &Candidate,
        start: &[Values],
        how: &How,
        is_worth: &dyn Fn(&State) -> bool,
    ) -> Option<State<'a>> {
        let places = self.model.places_with(&candidate.members);
        (self.model).with_worthwhile(self.data, &places, start, how, is_worth)
    }

    /// The limbs' values with a candidate at what it was found to be.
    fn start_with(&self, candidate: &Candidate) -> Vec<Values> {
        let mut values = self.model.values();
        for (limb, trial) in &candidate.trials {
            values[*limb] = self.screens[*limb].with(trial);
        }
        values
    }

    /// The model `after` a candidate was fitted, as it is to be kept; none if it does not keep what the candidate promised.
    pub(super) fn accepted(
        &self,
        candidate: &Candidate,
        mut after: State<'a>,
    ) -> Option<State<'a>> {
        let members = &candidate.members;
        let before = self.held_out(self.model);
        if let [(_, place)] = members[..]
            && place.0.description().is_compliant()
            && is_worth_a_step(&self.held_out(&after), &before)
        {
            // It was tried near what it promised and in few passes: what stays is told as well as it can be.
            after = self.with_all_sought(candidate, &|_| true)?;
        }
        if let [(limb, place)] = members[..]
            && place.0.description().has_shape()
            && is_better(&self.held_out(&after), &before)
        {
            // A nonlinear parameter that all data have chosen is no surprise to the fold that is held out.
            let (before, fit) = (&self.model.fits[limb], &after.fits[limb]);
            after.squares[limb] = held_out_with_shape(before, fit, place)?;
        }
        if !is_worth_a_step(&self.held_out(&after), &before) {
            return None;
        }
        // How surely values are known is expensive: of what is refused anyhow it is not asked.
        // A value that is sought by trying no column has judged: a gear that gives way by degrees under each N m is a stand-in.
        let is_there =
            |m: &&Member| is_held(after.size(m)) && after.tells_shape(m) && after.is_likely(m);
        let held = members.iter().filter(is_there).count();
        let is_there = are_most(held, members.len())
            && (!candidate.effect.description().is_compliant()
                || self.is_of_most_folds(members, &after) && !self.is_by_noise(members, &after));
        is_there.then_some(after)
    }

    /// Whether most folds tell what a model `after` a step takes away: no column has judged a spring or a play that is sought by trying, and what few
    /// moments ask for it gives way to.
    fn is_of_most_folds(&self, members: &[Member], after: &State) -> bool {
        let is_own = |limb: usize| members.iter().any(|member| member.0 == limb);
        let limbs: Vec<usize> = (0..self.data.len()).filter(|limb| is_own(*limb)).collect();
        let error = |model: &State, fold: usize| -> f64 {
            let own = limbs.iter().filter_map(|&limb| {
                let joints = model.squares[limb].cells.get(fold)?.iter();
                let noise = &self.model.fits[limb].noise;
                let weighted = joints
                    .zip(noise)
                    .map(|(square, noise)| square / noise.powi(2));
                Some(weighted.sum::<f64>())
            });
            own.sum()
        };
        let folds = limbs.iter().map(|&limb| after.squares[limb].cells.len());
        let folds = 0..folds.max().unwrap_or(0);
        let errors = folds.map(|fold| (error(self.model, fold), error(after, fold)));
        is_of_most_folds(&errors.collect::<Vec<_>>())
    }

    /// Whether noise of the motion makes what springs or plays of a limb take away `after` they were fitted: they take as much of what a model without them
    /// would have left of the same motion, measured once more.
    fn is_by_noise(&self, members: &[Member], after: &State) -> bool {
        let limb = members[0].0;
        if members.iter().any(|member| member.0 != limb) {
            return false;
        }
        let before = &self.model.fits[limb];
        let data = [before.data.as_if_complete(&before.values).0];
        let places: Vec<Place> = before.values.places().collect();
        let new: Vec<Place> = members.iter().map(|member| member.1).collect();
        let with = [&places[..], &new].concat();
        let start = [after.fits[limb].values.clone()];
        let Some(complete) = State::of(&data, &[places]) else {
            return false;
        };
        let Some(fitted) = complete.with(&data, &[with], &start, &new) else {
            return false;
        };
        let left = |model: &State, limb: usize| model.squares[limb].weighted(&before.noise);
        is_by_noise(
            left(&complete, 0) - left(&fitted, 0),
            left(self.model, limb) - left(after, limb),
        )
    }
}

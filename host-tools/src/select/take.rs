//! A candidate fitted, and taken into the model if it keeps what it promised.

use super::candidate::{Candidate, Member};
use super::criteria;
use super::screen::Screen;
use super::search::Search;
use super::state::{State, held_out_with_shape, how_near, how_with};
use crate::equation::motion::LOOSE;
use crate::equation::values::{Place, Values};
use crate::estimate::fit::How;

impl<'a> Search<'a> {
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
            [(limb, place)] => self.promised(limb, place).map(|size| (limb, place, size)),
            _ => None,
        };
        let Some((limb, place, size)) = near else {
            return self.with_all_sought(candidate, is_worth);
        };
        let mut start = start_with(&self.screens, candidate);
        start[limb].set(place, 0, size);
        self.fitted(candidate, &start, &how_near(place), is_worth)
    }

    /// The same with its shapes sought wherever they may be.
    fn with_all_sought(
        &self,
        candidate: &Candidate,
        is_worth: &dyn Fn(&State) -> bool,
    ) -> Option<State<'a>> {
        let places: Vec<Place> = candidate.members.iter().map(|(_, place)| *place).collect();
        let start = start_with(&self.screens, candidate);
        self.fitted(candidate, &start, &how_with(&places), is_worth)
    }

    fn fitted(
        &self,
        candidate: &Candidate,
        start: &[Values],
        how: &How,
        is_worth: &dyn Fn(&State) -> bool,
    ) -> Option<State<'a>> {
        let mut places = self.state.places();
        for (limb, place) in &candidate.members {
            places[*limb].push(*place);
        }
        (self.state).with_worthwhile(self.data, &places, start, how, is_worth)
    }

    /// Takes an effect into the model if it keeps what it promised: `after` is the model with it.
    pub(super) fn take(&mut self, candidate: &Candidate, mut after: State<'a>) -> bool {
        let members = &candidate.members;
        if let [(_, place)] = members[..]
            && LOOSE.contains(&place.0)
            && self.is_worth(&after)
        {
            // It was tried near what it promised and in few passes: what stays is told as well as it can be.
            let Some(again) = self.with_all_sought(candidate, &|_| true) else {
                return false;
            };
            after = again;
        }
        if let [(limb, place)] = members[..]
            && place.0.description().shape().is_some()
            && after.is_better_than(&self.state)
        {
            let squares = held_out_with_shape(&self.state.fits[limb], &after.fits[limb], place);
            let Some(squares) = squares else { return false };
            after.squares[limb] = squares;
        }
        // How surely values are known is dear: of what is refused anyhow it is not asked.
        let is_held = |m: &&Member| after.size(m) >= criteria::LEAST_VALUE && after.tells_shape(m);
        if !self.is_worth(&after) || 2 * members.iter().filter(is_held).count() <= members.len() {
            return false;
        }
        self.state = after;
        self.push(members, false);
        true
    }

    /// Whether a model takes away what a step is worth, and makes no log worse.
    fn is_worth(&self, after: &State) -> bool {
        let before = self.state.weighted(&self.state);
        after.weighted(&self.state) < (1.0 - criteria::LEAST_SHARE) * before
            && after.is_better_than(&self.state)
    }
}

/// The limbs' values with a candidate at what it was found to be.
fn start_with(screens: &[Screen], candidate: &Candidate) -> Vec<Values> {
    let mut values: Vec<Values> = screens
        .iter()
        .map(|screen| screen.fit.values.clone())
        .collect();
    for (limb, trial) in &candidate.trials {
        values[*limb] = screens[*limb].with(trial);
    }
    values
}

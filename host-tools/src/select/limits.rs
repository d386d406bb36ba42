//! Drives at their limits, told by the windows below them ([`crate::estimate::limit`]).

use std::sync::Arc;

use proprio_core::effect::EffectKind;

use super::candidate::Member;
use super::criteria;
use super::ranking::judge;
use super::search::Search;
use super::state::State;
use crate::estimate::limit::Limit;

impl Search<'_> {
    /// Takes limits of torques into the model that the data tell. Of what is asked for beyond a limit the motion shows nothing: no fold's
    /// error falls by much for knowing it, but that of all windows below it does.
    pub(super) fn limits(&mut self) -> bool {
        let mut taken = false;
        for limb in 0..self.data.len() {
            let fit = self.state.fits[limb].clone();
            // Where nothing has changed since, nothing is found.
            if self
                .limits_sought
                .iter()
                .any(|known| Arc::ptr_eq(known, &fit))
            {
                continue;
            }
            let predicted = fit.predicted();
            for joint in 0..self.data[limb].joints() {
                let place = (EffectKind::Saturation, joint);
                let sought = !fit.values.has(place);
                let limit = sought.then(|| Limit::of(&fit, &predicted, joint)).flatten();
                taken |= limit.is_some_and(|limit| self.take_limit((limb, place), &limit));
            }
            self.limits_sought.push(fit);
        }
        taken
    }

    fn take_limit(&mut self, member: Member, limit: &Limit) -> bool {
        let (limb, place) = member;
        let mut places = self.state.places();
        places[limb].push(place);
        let mut start = self.state.values();
        start[limb].clone_from(&limit.values);
        let Some(after) = self.state.with(self.data, &places, &start, &[]) else {
            return false;
        };
        let below = |state: &State| state.weighted_below(&self.state, limb, &after.fits[limb]);
        if below(&after) > (1.0 - criteria::LEAST_SHARE) * below(&self.state) {
            return false;
        }
        if self.steps.is_empty() {
            let candidates = self.look();
            let own = candidates.iter().find(|c| c.members == [member]);
            self.first = judge(&self.screens, &candidates, own);
            if let Some(first) = self.first.first_mut().filter(|_| own.is_some()) {
                (first.significant, first.possible) = (true, true);
                first.parameters = vec![after.parameters(&member)];
                first.parameters[0][0] = (limit.torque, limit.std);
            }
        }
        self.state = after;
        self.push(&[member], false);
        true
    }
}

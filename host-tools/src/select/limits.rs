//! Drives at their limits, told by the windows below them ([`crate::estimate::limit`]).

use std::sync::Arc;

use proprio_core::effect::EffectKind;
use rayon::prelude::*;

use super::candidate::Member;
use super::criteria;
use super::ranking::judge;
use super::search::Search;
use super::state::State;
use crate::estimate::fit::LimbFit;
use crate::estimate::limit::Limit;
use crate::estimate::robot::side_by_side;

impl Search<'_> {
    /// Takes limits of torques into the model that the data tell. Of what is asked for beyond a limit the motion shows nothing: no fold's
    /// error falls by much for knowing it, but that of all windows below it does.
    pub(super) fn limits(&mut self) -> bool {
        // Where nothing has changed since, nothing is found.
        let is_known = |fit: &Arc<LimbFit>| {
            let mut known = self.limits_sought.iter();
            known.any(|known| known.ptr_eq(&Arc::downgrade(fit)))
        };
        let fits = self.state.fits.iter().cloned().enumerate();
        let sought: Vec<_> = fits.filter(|(_, fit)| !is_known(fit)).collect();
        let found = side_by_side(&sought, |(limb, fit)| {
            let predicted = fit.predicted();
            let limit = |joint: usize| {
                let place = (EffectKind::Saturation, joint);
                let sought = !fit.values.has(place);
                let limit = sought
                    .then(|| Limit::of(fit, &predicted, joint))
                    .flatten()?;
                Some(((*limb, place), limit))
            };
            let joints = (0..fit.data.joints()).into_par_iter();
            joints.filter_map(limit).collect::<Vec<_>>()
        });
        (self.limits_sought).extend(sought.iter().map(|(_, fit)| Arc::downgrade(fit)));
        drop(sought);
        let mut taken = false;
        for (member, limit) in found.into_iter().flatten() {
            taken |= self.take_limit(member, &limit);
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

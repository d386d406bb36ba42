//! What lies between motor and link, told by trying: of a soft spring or a wide play a column says little, and other effects look like
//! them to first order.

use proprio_core::effect::EffectKind;

use super::candidate::Candidate;
use super::criteria;
use super::ranking::{PLAIN, judge};
use super::search::Search;
use super::state::State;
use crate::equation::motion::LOOSE;

impl<'a> Search<'a> {
    /// A candidate that takes a sure part of a joint's error, and the model with it; or a spring or a play there with which the model
    /// predicts better. One that its column does not show has to do so by what a step is worth.
    pub(super) fn best_by_trying<'c>(
        &mut self,
        best: &'c Candidate,
        all: &'c [Candidate],
    ) -> (&'c Candidate, Option<State<'a>>) {
        // The first look tells what the best one would be, taken or not.
        let is_first = self.first.is_empty();
        let is_tried = is_first || self.may_take_away(best, criteria::LEAST_SHARE);
        let first = (best, is_tried.then(|| self.with(best)).flatten());
        let now = self.state.weighted(&self.state);
        let is_loose = LOOSE.contains(&best.effect);
        let is_sure = best.members.len() == 1 && best.held_out_gain().0 > criteria::SURE_GAIN;
        // What a joint's own columns show and no fit keeps is no spring either; and springs are dear to try.
        let keeps = (first.1.as_ref())
            .is_some_and(|after| after.weighted(&self.state) < (1.0 - criteria::LEAST_SHARE) * now);
        let may_be_loose = is_sure && keeps && !best.is_shared() && !PLAIN.contains(&best.effect);
        if !is_loose && !may_be_loose {
            return first;
        }
        let penalty = |c: &Candidate| {
            let shown = std::ptr::eq(c, best) || c.is_there() && c.is_possible(&self.screens);
            // One soft joint looks like several to a column.
            let more = (c.members.len() - 1) as f64 + if shown { 0.0 } else { 1.0 };
            criteria::LEAST_SHARE * more
        };
        let error = |(c, after): &(&Candidate, Option<State>)| {
            let error = (after.as_ref()).map_or(f64::INFINITY, |after| after.weighted(&self.state));
            error + penalty(c) * now
        };
        // What several promise together may be of one, which alone, the others rigid, promises less: its column is believed.
        let one_of_several = is_loose && is_tried && best.members.len() > 1;
        let gained = 1.0 - error(&first) / now;
        let (mut kept, mut useless) = (Vec::new(), Vec::new());
        for c in self.loose_at(best, all) {
            if !one_of_several && !self.may_take_away(c, criteria::LEAST_SHARE + penalty(c)) {
                useless.push(c);
                continue;
            }
            // One that the first leaves behind need not be known.
            if !one_of_several && !self.may_take_away(c, gained + penalty(c)) {
                continue;
            }
            // One that is found to be nothing need not be judged.
            let is_something = |after: &State| after.size(&c.members[0]) >= criteria::LEAST_VALUE;
            let tried = (c, self.with_worthwhile(c, &is_something));
            if error(&tried) < (1.0 - criteria::LEAST_SHARE) * now {
                kept.push(tried);
            } else {
                useless.push(c);
            }
        }
        let told = (kept.into_iter().chain([first]))
            .min_by(|a, b| error(a).total_cmp(&error(b)))
            .unwrap_or((best, None));
        useless.into_iter().for_each(|c| self.refuse(c));
        told
    }

    /// Springs and plays at the joint of a candidate; of several joints at the one where most is gained.
    fn loose_at<'c>(&self, best: &Candidate, all: &'c [Candidate]) -> Vec<&'c Candidate> {
        let is_one = |c: &&Candidate| {
            c.members.len() == 1
                && LOOSE.contains(&c.effect)
                && c.is_within(best)
                && !(c.effect == best.effect && c.members == best.members)
                && !self.was_refused(c)
        };
        let mut found: Vec<&Candidate> = all.iter().filter(is_one).collect();
        if best.members.len() > 1 {
            found.retain(|c| c.effect == best.effect);
            found.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
            found.truncate(1);
        }
        found
    }

    /// Takes a spring or a play at the joint with the largest error, where no column shows anything that helps: it has to take away a share
    /// of that joint's error that no sampling makes.
    pub(super) fn take_looseness(&mut self, all: &[Candidate]) -> bool {
        let joints = (self.state.squares.iter().enumerate()).flat_map(|(limb, squares)| {
            let joints = squares.by_joint().into_iter().enumerate();
            joints.map(move |(joint, square)| (limb, joint, square))
        });
        let Some((limb, joint, square)) = joints.max_by(|a, b| a.2.total_cmp(&b.2)) else {
            return false;
        };
        let data = &self.data[limb];
        let torque = data.squares(&vec![0.0; data.torque.len()]).by_joint()[joint];
        if square < criteria::RESOLUTION.powi(2) * torque {
            return false;
        }
        let is_here = |effect: EffectKind| {
            (all.iter()).find(|c| c.members == [(limb, (effect, joint))] && !self.was_refused(c))
        };
        let tried = LOOSE.into_iter().filter_map(is_here);
        let tried = tried.filter(|c| self.may_take_away(c, criteria::LEAST_SHARE));
        let tried = tried.filter_map(|c| Some((c, self.with(c)?)));
        let best = tried.min_by(|a, b| {
            let error = |after: &State| after.weighted(&self.state);
            error(&a.1).total_cmp(&error(&b.1))
        });
        let Some((candidate, after)) = best else {
            return false;
        };
        if self.state.total() - after.total() < criteria::STRUCTURE * square {
            self.refuse(candidate);
            return false;
        }
        let is_first = self.steps.is_empty();
        let told = after.clone();
        if !self.take(candidate, after) {
            self.refuse(candidate);
            return false;
        }
        if is_first {
            self.first = judge(&self.screens, all, Some(candidate));
            self.tell_first(candidate, &told, true);
        }
        true
    }
}

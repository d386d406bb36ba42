//! What a diagnosis names first.

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Member};
use super::ranking::Judged;
use super::search::{Search, Step};
use super::state::State;
use crate::estimate::limb_data::Squares;

impl<'a> Search<'a> {
    /// What is told of the first candidate is of the fit with it: what a column says of a value is true to first order, and of what was found
    /// by trying not even that it is there.
    pub(super) fn tell_first(&mut self, candidate: &Candidate, after: &State<'a>, by_trying: bool) {
        let Some(first) = self.first.first_mut() else {
            return;
        };
        let own = candidate
            .members
            .iter()
            .map(|member| after.parameters(member));
        first.parameters = own.collect();
        if by_trying {
            (first.significant, first.possible) = (true, true);
        }
    }

    /// What the model has in the end is told with its value there; but a limit, which the rest of the model does not tell, as it was found.
    pub(super) fn tell_what_is_kept(&mut self) {
        let there = self.state.places();
        let stays = |(limb, place): &Member| {
            place.0 != EffectKind::Saturation && there[*limb].contains(place)
        };
        for told in &mut self.first {
            let members = &told.candidate.members;
            if members.iter().all(stays) {
                let own = members.iter().map(|member| self.state.parameters(member));
                told.parameters = own.collect();
            }
        }
    }

    /// The headline is what takes most torque error away of what the model has in the end: a candidate that was refused or taken out again
    /// only resembled that. Where nothing was taken nothing is named.
    pub(super) fn keep_headline(&mut self) {
        let there = self.state.places();
        let stays = |(limb, place): &Member| there[*limb].contains(place);
        let total = |squares: &[Squares]| squares.iter().map(Squares::total).sum::<f64>();
        let is_it = |j: &Judged, step: &Step| {
            (j.candidate.effect, &j.candidate.members) == (step.effect, &step.members)
        };
        let before = [&self.start]
            .into_iter()
            .chain(self.steps.iter().map(|step| &step.squares));
        let kept: Vec<(f64, &Step)> = before
            .zip(&self.steps)
            .filter(|(_, step)| !step.removed && step.members.iter().any(stays))
            .map(|(before, step)| (total(before) - total(&step.squares), step))
            .collect();
        if kept.is_empty() {
            self.first.iter_mut().for_each(|j| j.significant = false);
            return;
        }
        let told = kept.into_iter().filter_map(|(fall, step)| {
            let at = self.first.iter().position(|j| is_it(j, step))?;
            Some((fall, at))
        });
        let most = told.max_by(|a, b| a.0.total_cmp(&b.0));
        let (Some((_, at)), Some(old)) = (most, self.first.first()) else {
            return;
        };
        if at == 0 && old.significant {
            return;
        }
        let old = old.candidate.clone();
        self.first[..=at].rotate_right(1);
        let first = &mut self.first[0];
        (first.significant, first.possible) = (true, true);
        let own = first.candidate.members.iter();
        first.parameters = own.map(|member| self.state.parameters(member)).collect();
        first.alternatives = Vec::new();
        if old.meets(&first.candidate) && !old.members.iter().any(stays) {
            first.alternatives.push((old.effect, old.members));
        }
    }
}

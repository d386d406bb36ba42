//! The way back: what a model does without again.

use proprio_core::effect::EffectKind;

use super::candidate::Member;
use super::criteria;
use super::ranking::PLAIN;
use super::search::{Search, Step};

impl Search<'_> {
    /// Takes out again what has become nothing, or what the others do without.
    pub(super) fn backward(&mut self) {
        let added: Vec<Member> = self
            .steps
            .iter()
            .flat_map(|step| step.members.clone())
            .collect();
        let drive = self.lacks_a_drive();
        let mut small: Vec<(f64, Member)> = (added.into_iter())
            .filter(|(_, place)| !(drive && PLAIN.contains(&place.0)))
            // What is asked for beyond a limit is anything: how much of it on average may be nothing.
            .filter(|(_, place)| place.0 != EffectKind::Saturation)
            .map(|member| (self.state.size(&member), member))
            .filter(|(size, _)| *size < criteria::LEAST_VALUE)
            .collect();
        small.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, member) in small {
            let mut places = self.state.places();
            places[member.0].retain(|place| *place != member.1);
            let Some(without) = self
                .state
                .with(self.data, &places, &self.state.values(), &[])
            else {
                continue;
            };
            let logs = without.by_log().into_iter().zip(self.state.by_log());
            let same = logs
                .into_iter()
                .all(|(after, before)| after <= criteria::SAME * before)
                && without.weighted(&self.state)
                    <= criteria::SAME * self.state.weighted(&self.state);
            if same {
                self.state = without;
                self.push(&[member], true);
            }
        }
        self.take_out_superseded();
    }

    /// Takes out what a later step at the same joint does as well without: it only resembled that.
    fn take_out_superseded(&mut self) {
        let own = |step: &Step| match step.members[..] {
            [member] if !step.removed && !PLAIN.contains(&step.effect) => Some(member),
            _ => None,
        };
        let is_superseded = |(n, member): &(usize, Member)| {
            (self.steps[n + 1..].iter())
                .filter_map(own)
                .any(|later| (later.0, later.1.1) == (member.0, member.1.1))
        };
        let members = self.steps.iter().enumerate();
        let members: Vec<Member> = members
            .filter_map(|(n, step)| Some((n, own(step)?)))
            .filter(is_superseded)
            .map(|(_, member)| member)
            .filter(|member| member.1.0 != EffectKind::Saturation)
            .collect();
        for member in members {
            let mut places = self.state.places();
            places[member.0].retain(|place| *place != member.1);
            let values = self.state.values();
            let Some(without) = self.state.with(self.data, &places, &values, &[]) else {
                continue;
            };
            let most = 1.0 + criteria::LEAST_SHARE;
            let mut logs = without.by_log().into_iter().zip(self.state.by_log());
            if logs.all(|(after, before)| after <= most * before)
                && without.weighted(&self.state) <= most * self.state.weighted(&self.state)
            {
                self.state = without;
                self.push(&[member], true);
            }
        }
    }
}

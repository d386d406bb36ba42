//! Searches that begin again with what one search alone would not find first.

use proprio_core::effect::EffectKind;

use super::candidate::Member;
use super::criteria;
use super::search::Search;
use super::state::State;

impl Search<'_> {
    /// A search that starts with the four plain effects at all joints, if this one ends above them.
    pub(super) fn with_plain(&self) -> Option<Self> {
        if self.steps.is_empty() || self.plain_that_lack().is_empty() {
            return None;
        }
        let mut other = self.anew()?;
        for members in other.plain_that_lack() {
            other.begin_with(&members)?;
        }
        let torque: f64 = (self.data.iter())
            .map(|data| data.squares(&vec![0.0; data.torque.len()]).total())
            .sum();
        let less = self.state.total() - other.state.total();
        if less < criteria::LEAST_SHARE * self.state.total()
            || less < criteria::LEAST_EFFECT.powi(2) * torque
        {
            return None;
        }
        other.limits();
        other.forward();
        other.backward();
        Some(other)
    }

    /// A search that starts with friction that differs with the direction where this one has found Coulomb friction and a constant torque
    /// at a single joint, if it does as well: one cause before two.
    pub(super) fn with_one_cause(&self) -> Option<Self> {
        let found = |effect: EffectKind, joint: (usize, usize)| {
            (self.steps.iter()).any(|step| {
                let [(limb, place)] = step.members[..] else {
                    return false;
                };
                !step.removed && place.0 == effect && (limb, place.1) == joint
            })
        };
        let joints = (self.data.iter().enumerate())
            .flat_map(|(limb, data)| (0..data.joints()).map(move |joint| (limb, joint)));
        let both: Vec<(usize, usize)> = joints
            .filter(|&at| found(EffectKind::Coulomb, at) && found(EffectKind::Bias, at))
            .collect();
        if both.is_empty() {
            return None;
        }
        let mut other = self.anew()?;
        for (limb, joint) in both {
            other.begin_with(&[(limb, (EffectKind::AsymmetricCoulomb, joint))])?;
        }
        other.forward();
        other.backward();
        let error = |search: &Self| search.state.weighted(&self.state);
        (error(&other) <= criteria::SAME * error(self)).then_some(other)
    }

    /// A search that has taken nothing yet, its headline known.
    fn anew(&self) -> Option<Self> {
        let start = State::of(self.data, &self.given)?;
        let mut other = Self::new(self.data, &self.given, start);
        other.first.clone_from(&self.first);
        Some(other)
    }

    /// Takes effects into the model untried.
    fn begin_with(&mut self, members: &[Member]) -> Option<()> {
        let mut places = self.state.places();
        for (limb, place) in members {
            places[*limb].push(*place);
        }
        self.state = State::of(self.data, &places)?;
        self.push(members, false);
        Some(())
    }
}

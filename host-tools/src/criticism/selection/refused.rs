//! What a walk does not try again.

use super::super::limb::Place;

/// Effects that did not keep what they promised.
///
/// What an effect adds may show only beside another one: friction of a joint beside the torque gain of the one that it carries.
/// So each has a second chance, after another effect has been kept, and no more, that the walk ends.
#[derive(Default)]
pub(super) struct Refused {
    for_good: Vec<Place>,
    once: Vec<Place>,
    /// Those of them that nothing has been kept after.
    now: Vec<Place>,
}

impl Refused {
    /// Whether an effect is not to be tried.
    pub(super) fn has(&self, place: Place) -> bool {
        self.for_good.contains(&place) || self.now.contains(&place)
    }

    /// Refuses an effect whatever comes.
    pub(super) fn for_good(&mut self, place: Place) {
        self.for_good.push(place);
    }

    /// Refuses an effect until another is kept; the second time for good.
    pub(super) fn until_another_is_kept(&mut self, place: Place) {
        if self.once.contains(&place) {
            self.for_good(place);
        } else {
            self.once.push(place);
            self.now.push(place);
        }
    }

    /// Gives what has been refused once its second chance.
    pub(super) fn another_is_kept(&mut self) {
        self.now.clear();
    }
}

#[cfg(test)]
mod tests {
    use proprio_core::effect::EffectKind;

    use super::*;

    #[test]
    fn an_effect_has_a_second_chance_after_another_is_kept_and_no_third() {
        let (coulomb, play) = ((EffectKind::Coulomb, 1), (EffectKind::Backlash, 2));
        let mut refused = Refused::default();
        refused.until_another_is_kept(coulomb);
        refused.for_good(play);
        assert!(refused.has(coulomb) && refused.has(play));
        assert!(!refused.has((EffectKind::Coulomb, 2)));
        refused.another_is_kept();
        assert!(!refused.has(coulomb) && refused.has(play));
        refused.until_another_is_kept(coulomb);
        assert!(refused.has(coulomb));
        refused.another_is_kept();
        assert!(refused.has(coulomb));
    }
}

//! What a diagnosis makes of a model.

use super::Diagnosis;
use crate::catalogue;
use crate::model::Model;

impl Diagnosis {
    /// Adds to a model what the path has added.
    pub fn apply(&self, model: &mut Model) {
        let (mut added, mut removed) = (Vec::new(), Vec::new());
        for step in &self.path {
            let Some(effect) = catalogue::effect_named(step.effect) else {
                continue;
            };
            for name in &step.joints {
                // The names come from this robot.
                for place in model.robot().place(effect, Some(name)).unwrap_or_default() {
                    let place = (effect, place);
                    let (to, from) = if step.removed {
                        (&mut removed, &mut added)
                    } else {
                        (&mut added, &mut removed)
                    };
                    from.retain(|other| *other != place);
                    to.push(place);
                }
            }
        }
        for (effect, joint) in removed {
            model.remove_effect(effect, joint);
        }
        model.add_last(&added);
    }
}

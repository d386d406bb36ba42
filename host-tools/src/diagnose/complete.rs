//! What a diagnosis makes of a model.

use super::{Diagnosis, FoundFrame};
use crate::catalogue;
use crate::model::{Model, Witness};

impl FoundFrame {
    /// Puts the joint's frame where the data have it.
    fn apply(&self, model: &mut Model) {
        // The name comes from this robot.
        let Ok(joint) = model.robot().joint(&self.joint) else {
            return;
        };
        for own in &self.corrections {
            let known = model.joint_quantity(joint, own.quantity);
            let value = known.map_or(0.0, |known| known.value) + own.value;
            // Numbers of a fit are finite, as the model asks.
            let _ = model.set_joint_quantity(joint, own.quantity, Witness::Motion, value, own.std);
        }
    }
}

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
        for frame in &self.kinematics {
            frame.apply(model);
        }
    }
}

//! Every model that leaves effects out, or has more of the simple ones: the factors from which a report's page fits them.

use proprio_core::effect::EffectKind;

use super::{From, predictions};
use crate::catalogue;
use crate::detect::bodies;
use crate::detect::contact::leave_out_contact;
use crate::estimate::limb_data::LimbData;
use crate::estimate::nested::{Nested, can_be_put_in};
use crate::estimate::robot;
use crate::identify::model_fit::places_of;
use crate::model::Model;
use crate::recording::Recording;

/// What can be chosen, and the data to judge it by.
#[derive(Debug, Clone, Default)]
pub struct Choices {
    /// The limbs, in the order of the numbers.
    pub limbs: Vec<ChoiceLimb>,
    /// [`proprio_solve::nested::NestedLimb::write`] of each limb.
    pub numbers: Vec<f64>,
    /// Of each limb, joint and drawn window: position (rad), velocity (rad/s), torque of the bodies (N m), fold, measured torque (N m),
    /// and the joint's columns.
    pub drawn: Vec<f32>,
}

/// A limb.
#[derive(Debug, Clone)]
pub struct ChoiceLimb {
    /// The joints' names.
    pub joints: Vec<String>,
    /// Windows in which each joint is judged.
    pub windows: Vec<usize>,
    /// Windows of each joint that are drawn.
    pub drawn: Vec<usize>,
    /// Of each joint and entry of θ, its column.
    pub places: Vec<Vec<Option<usize>>>,
    /// How many folds of time there are.
    pub folds: usize,
    /// The effects that can be ticked, in the limb's own order.
    pub effects: Vec<Choice>,
    /// Those that are in the model whatever is ticked: the torque is not linear in them.
    pub fixed: Vec<Choice>,
    /// Those that the model lacks and that no factor can put in: a nonlinear parameter is searched, which takes the data.
    pub searched: Vec<&'static str>,
}

/// An effect at a joint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joint: String,
    /// Whether the model has it.
    pub there: bool,
}

/// Which effects of `model`, and of the catalogue those that need no search, can be ticked, and the factors to judge every choice
/// by. None if the model cannot be fitted to the recording.
pub fn choices(recording: &Recording, model: &Model) -> Option<Choices> {
    let (data, _) = leave_out_contact(robot::data(recording, model));
    if data.is_empty() || data.iter().any(|limb| !limb.blocks.can_hold_out()) {
        return None;
    }
    let mut choices = Choices::default();
    for (data, prediction) in data.iter().zip(predictions(&data, From::HeldOut)) {
        let fit = prediction.fit?;
        let at_floor = bodies::at_floor(data).unwrap_or(0.0);
        let nested = Nested::of(&fit, &candidates(data), at_floor);
        let choice = |&(effect, joint): &(EffectKind, usize)| Choice {
            effect: effect.name(),
            joint: data.model.joint_name(data.body_of(joint)).to_owned(),
            there: fit.places.contains(&(effect, joint)),
        };
        let fixed = (fit.values.places()).filter(|place| !nested.effects.contains(place));
        choices.limbs.push(ChoiceLimb {
            joints: data.joint_names(),
            windows: data.windows().iter().map(|&n| n as usize).collect(),
            drawn: nested.drawn.iter().map(Vec::len).collect(),
            places: nested
                .limb
                .joints
                .iter()
                .map(|j| j.places.clone())
                .collect(),
            folds: nested.limb.folds(),
            effects: nested.effects.iter().map(choice).collect(),
            fixed: fixed.map(|place| choice(&place)).collect(),
            searched: searched(data),
        });
        nested.limb.write(&mut choices.numbers);
        for drawn in nested.drawn.iter().flatten() {
            let head = [
                drawn.q,
                drawn.dq,
                drawn.load,
                drawn.fold as f64,
                drawn.torque,
            ];
            let numbers = head.iter().chain(&drawn.row);
            choices.drawn.extend(numbers.map(|&x| x as f32));
        }
    }
    Some(choices)
}

/// The effects that a joint of the model lacks and whose parameters the torque has to be searched for.
fn searched(data: &LimbData) -> Vec<&'static str> {
    let there = places_of(data);
    let lacks = |&effect: &EffectKind| {
        (0..data.joints())
            .map(|joint| (effect, joint))
            .any(|place| data.can_tell(place) && !can_be_put_in(&place) && !there.contains(&place))
    };
    let searched = catalogue::effects().filter(lacks);
    searched.map(|effect| effect.name()).collect()
}

/// The effects that the model lacks and that need no search.
fn candidates(data: &LimbData) -> Vec<(EffectKind, usize)> {
    let there = places_of(data);
    let all = catalogue::effects();
    let all = all.flat_map(|effect| (0..data.joints()).map(move |joint| (effect, joint)));
    all.filter(|place| data.can_tell(*place) && can_be_put_in(place) && !there.contains(place))
        .collect()
}

//! Names and units of parameters: what a result file, a truth file and a table have in common.

use proprio_core::effect::EffectKind;
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::{JointId, Leg};

/// Inertial parameters of a body.
pub const INERTIAL: usize = 10;
/// Names and units of a body's inertial parameters, in the order of [`proprio_core::inertia`].
pub const INERTIAL_NAMES: [(&str, &str); INERTIAL] = [
    ("m", "kg"),
    ("hx", "kg m"),
    ("hy", "kg m"),
    ("hz", "kg m"),
    ("Ixx", "kg m^2"),
    ("Ixy", "kg m^2"),
    ("Ixz", "kg m^2"),
    ("Iyy", "kg m^2"),
    ("Iyz", "kg m^2"),
    ("Izz", "kg m^2"),
];

/// A parameter's name: `m:FR_hip`, `coulomb:FR_hip`.
pub fn name(what: &str, joint: JointId) -> String {
    name_at(what, joint.name())
}

/// [`name`] for a joint that is known by its name.
pub fn name_at(what: &str, joint: &str) -> String {
    format!("{what}:{joint}")
}

/// The name of parameter `n` of an effect at a joint: `coulomb:FR_hip`, and beyond the first `stribeck.vs:FR_hip`.
pub fn of_effect(effect: EffectKind, n: usize, joint: &str) -> String {
    match n {
        0 => name_at(effect.name(), joint),
        n => name_at(
            &format!(
                "{}.{}",
                effect.name(),
                effect.description().parameters[n].symbol
            ),
            joint,
        ),
    }
}

/// Names and units of one leg's parameters in the order of the estimator's θ.
pub fn names_of_leg(leg: Leg) -> Vec<(String, &'static str)> {
    let joints = JointId::of(leg);
    let inertial = joints.iter().flat_map(|&joint| {
        INERTIAL_NAMES
            .iter()
            .map(move |&(what, unit)| (name(what, joint), unit))
    });
    let effects = joints.iter().flat_map(|&joint| {
        EFFECTS
            .iter()
            .map(move |&effect| (name(effect.name(), joint), unit(effect)))
    });
    inertial.chain(effects).collect()
}

/// Unit of an effect's parameter.
pub fn unit(effect: EffectKind) -> &'static str {
    effect.description().parameters[0].unit
}

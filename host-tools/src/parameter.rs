//! Names and units of parameters: what a result file, a truth file and a table have in common.

use proprio_core::effect::{EffectKind, Reach};
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::{JointId, Leg};

use crate::table::with_std;

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

/// Unit of an effect's parameter at a joint that turns.
pub fn unit(effect: EffectKind) -> &'static str {
    effect.description().parameters[0].unit
}

/// Unit of parameter `n` of an effect at a joint that slides: metres for radians and newtons for newton metres, of the catalogue's units. What is of a
/// body or of the whole robot, and effects of one's own, have theirs.
pub fn unit_of_slide(effect: EffectKind, n: usize) -> &'static str {
    let description = effect.description();
    let unit = description.parameters[n].unit;
    let is_own = matches!(effect, EffectKind::Own(_));
    if is_own || matches!(description.reach, Reach::Body | Reach::Robot) {
        return unit;
    }
    match unit {
        "N m" => "N",
        "N m/rad" => "N/m",
        "N m s/rad" => "N s/m",
        "N m s^2/rad^2" => "N s^2/m^2",
        "N m s/(rad °C)" => "N s/(m °C)",
        "rad/(N m)" => "m/N",
        "rad" => "m",
        "rad/s" => "m/s",
        "1/rad" => "1/m",
        "kg m^2" => "kg",
        same => same,
    }
}

/// A value with its standard deviation, and its unit, as told: a compliance as the stiffness that it is of, for that is what data sheets have and
/// has digits to read; of one within two standard deviations of nothing the least stiffness.
pub fn told(value: f64, std: f64, unit: &str) -> [String; 2] {
    let stiffness = match unit {
        "rad/(N m)" => "N m/rad",
        "m/N" => "N/m",
        _ => return [with_std(value, std), unit.to_owned()],
    };
    let told = match value > 2.0 * std {
        true => with_std(1.0 / value, std / (value * value)),
        false => format!("> {}", three_digits(1.0 / (value.max(0.0) + 2.0 * std))),
    };
    [told, stiffness.to_owned()]
}

/// Three digits, without an exponent where there are no more than nine.
fn three_digits(x: f64) -> String {
    let size = x.abs().log10().floor();
    if !(-4.0..9.0).contains(&size) {
        return format!("{x:.2e}");
    }
    let unit = 10f64.powf(size - 2.0);
    let decimals = (2.0 - size).max(0.0) as usize;
    format!("{:.decimals$}", (x / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue;

    #[test]
    fn no_effect_of_a_joint_that_slides_has_an_angle() {
        for effect in catalogue::effects() {
            let description = effect.description();
            if matches!(description.reach, Reach::Body | Reach::Robot) {
                continue;
            }
            for n in 0..description.parameters.len() {
                let unit = unit_of_slide(effect, n);
                assert!(!unit.contains("rad") && !unit.contains("N m"), "{unit}");
            }
        }
    }

    #[test]
    fn a_compliance_is_told_as_a_stiffness() {
        let told = |value, std| told(value, std, "rad/(N m)").join(" ");
        assert_eq!(told(4e-4, 4e-6), "2500 ±25 N m/rad");
        assert_eq!(told(1e-6, 1e-6), "> 333000 N m/rad");
        assert_eq!(told(0.0, 0.0101), "> 49.5 N m/rad");
        assert_eq!(super::told(0.002, 1e-5, "m/N").join(" "), "500.0 ±2.5 N/m");
        assert_eq!(super::told(1.0, 0.5, "N m").join(" "), "1.00 ±0.50 N m");
    }
}

//! Patterns in words: what they look like, never more.

use super::pattern::Where;
use super::shape::{Changing, Shape, Variable, Variables};
use crate::robust;

/// What is said of a joint that turns, of one that slides: none of these sentences has the letters of these units in a word.
fn of_slide(sentence: &str) -> String {
    let force = sentence.replace("torque", "force").replace("N m", "N");
    force.replace("rad", "m")
}

/// One sentence for a real pattern.
pub(super) fn sentence(joint: &str, pattern: &Where, variables: &Variables) -> String {
    let said = match (pattern.shape, pattern.size) {
        (Some(shape), Some(size)) => {
            let told = described(shape, size, variables);
            format!("predicted torque {told}{}", alternatives(pattern))
        }
        _ => unnamed(pattern),
    };
    of_joint(joint, &said, variables.slides())
}

fn of_joint(joint: &str, said: &str, slides: bool) -> String {
    match slides {
        true => format!("{joint}: {}", of_slide(said)),
        false => format!("{joint}: {said}"),
    }
}

/// The same without what it looks like: for errors of which a cause is known that no pattern tells.
pub(super) fn observation(joint: &str, pattern: &Where, variables: &Variables) -> String {
    let (Some(shape), Some(size)) = (pattern.shape, pattern.size) else {
        return sentence(joint, pattern, variables);
    };
    let told = described(shape, size, variables);
    // The cause comes after the last colon.
    let seen = told.rsplit_once(": ").map_or(&*told, |(seen, _)| seen);
    of_joint(
        joint,
        &format!("predicted torque {seen}"),
        variables.slides(),
    )
}

/// The shapes that fit almost as well, in brackets.
fn alternatives(pattern: &Where) -> String {
    let others: Vec<&str> = pattern
        .alternatives
        .iter()
        .map(|&shape| name(shape))
        .collect();
    match others.as_slice() {
        [] => String::new(),
        others => format!(" ({} would fit almost as well)", others.join(" or ")),
    }
}

/// `0.42 ± 0.05 N m`
fn amount(size: f64, std: f64, unit: &str) -> String {
    let decimals = if std > 0.0 {
        (1.0 - std.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        4
    };
    format!("{:.decimals$} ± {std:.decimals$} {unit}", size.abs())
}

/// A positive residual: the model predicts too little.
fn side(size: f64) -> &'static str {
    if size > 0.0 { "too small" } else { "too large" }
}

/// What a pattern is called.
fn name(shape: Shape) -> &'static str {
    match shape {
        Shape::Offset => "a constant",
        Shape::Step => "a step at zero velocity",
        Shape::Viscous => "a term proportional to velocity",
        Shape::Drag => "a term as the square of the velocity",
        Shape::Even => "a term in the magnitude of the velocity",
        Shape::Inertial => "a term proportional to acceleration",
        Shape::Spring => "a term proportional to position",
        Shape::Periodic { .. } => "a term periodic in position",
        Shape::Gain => "a term proportional to torque",
        Shape::Load => "a term in the magnitude of the torque",
        Shape::LoadFriction => "friction that grows with the torque",
        Shape::Warmth => "a term proportional to temperature",
        Shape::WarmFriction => "friction that changes with temperature",
        Shape::Drift => "a drift in time",
        Shape::Change { .. } => "a change at one moment",
        Shape::Contact => "a step at touch-down",
    }
}

/// A pattern in words; those of velocity here.
fn described(shape: Shape, [size, std]: [f64; 2], variables: &Variables) -> String {
    let too = side(size);
    let other = side(-size);
    let per = |unit| amount(size, std, unit);
    let up_to = reach(shape, size, variables);
    let friction = if size > 0.0 {
        "looks like more friction against the motion than the model has"
    } else {
        "looks like less friction than the model has"
    };
    match shape {
        Shape::Step => format!(
            "is {} {too} while it moves in the positive direction and as much {other} in the negative: {}",
            per("N m"),
            friction
        ),
        Shape::Viscous => format!(
            "is {too} in proportion to velocity, by {} ({up_to}): {}",
            per("N m per rad/s"),
            friction
        ),
        Shape::Drag => format!(
            "is {too} as the square of the velocity, with its sign, by {} ({up_to}): looks like {}",
            per("N m per (rad/s)²"),
            if size > 0.0 {
                "drag that the model lacks"
            } else {
                "friction that levels off at speed"
            }
        ),
        Shape::Even => format!(
            "is {too} by {} of speed, the same in both directions ({up_to}): no friction does that; perhaps friction that differs \
             between directions, or a velocity-dependent load",
            per("N m per rad/s")
        ),
        _ => described_otherwise(shape, [size, std], variables),
    }
}

/// A pattern that is not one of velocity.
fn described_otherwise(shape: Shape, [size, std]: [f64; 2], variables: &Variables) -> String {
    let too = side(size);
    let other = side(-size);
    let per = |unit| amount(size, std, unit);
    let up_to = reach(shape, size, variables);
    match shape {
        Shape::Offset => format!("is {} {too} throughout", per("N m")),
        Shape::Inertial => format!(
            "is {too} in proportion to acceleration, by {} ({up_to}): looks like {} inertia than the model has",
            per("N m per rad/s²"),
            if size > 0.0 { "more" } else { "less" }
        ),
        Shape::Spring => format!(
            "is {too} towards larger positions, by {} ({up_to}): looks like a spring, a cable or gravity that the model has wrong",
            per("N m per rad")
        ),
        Shape::Periodic { per_radian, .. } => format!(
            "is wrong by up to {} periodically in position, {per_radian:.1} periods per rad: looks like cogging or gear teeth",
            per("N m")
        ),
        Shape::Gain if size > 1.0 => format!(
            "is far too small: the measured one is {} times it ({up_to}): looks like something large that the model lacks",
            amount(1.0 + size, std, "").trim_end()
        ),
        Shape::Gain => format!(
            "is {too} by {} of itself ({up_to}): looks like a torque scale or a mass that the model has wrong",
            amount(100.0 * size, 100.0 * std, "%")
        ),
        Shape::Load => format!(
            "is {too} the larger the torque, by {} ({up_to})",
            per("N m per N m")
        ),
        Shape::LoadFriction => format!(
            "is {too} in the direction of motion and {other} against it, the more the larger the torque, by {} ({up_to}): \
             looks like friction that grows with the load",
            per("N m per N m")
        ),
        Shape::Warmth => format!(
            "is {too} the warmer the motor, by {} ({up_to})",
            per("N m per °C")
        ),
        Shape::WarmFriction => format!(
            "is wrong in proportion to velocity, and the more so the further the motor's temperature is from its mean, by {}: looks like \
             friction that changes with temperature",
            per("N m per rad/s and °C")
        ),
        Shape::Drift => format!(
            "drifts: it becomes {too} by {} ({up_to}): warming up, or something else that changed meanwhile",
            per("N m per s")
        ),
        Shape::Change { of, at } => {
            let (how, unit, looks) = match of {
                Changing::Offset => ("", "N m", "a constant torque"),
                Changing::Friction => (" in the direction of motion", "N m", "friction"),
                Changing::Viscous => (
                    " in proportion to velocity",
                    "N m per rad/s",
                    "viscous friction",
                ),
                Changing::Inertia => (
                    " in proportion to acceleration",
                    "N m per rad/s²",
                    "inertia",
                ),
                Changing::Gain => (
                    " in proportion to itself",
                    "N m per N m",
                    "the torque's scale",
                ),
            };
            format!(
                "is another from t = {at:.1} s on: {} {too}{how}, compared with before: looks like {looks} that changed",
                per(unit)
            )
        }
        Shape::Contact => format!(
            "is {} {too} with the foot on the ground, against in the air: looks like a contact force the model does not know",
            per("N m")
        ),
        Shape::Step | Shape::Viscous | Shape::Drag | Shape::Even => {
            described(shape, [size, std], variables)
        }
    }
}

/// What a slope amounts to over the log: from the least to the greatest value, outliers left out.
fn reach(shape: Shape, size: f64, variables: &Variables) -> String {
    let pattern = variables.pattern(shape);
    let finite = || pattern.iter().copied().filter(|x| x.is_finite());
    let at = |share: f64| robust::quantile(finite(), share).unwrap_or(0.0);
    let range = (at(0.95) - at(0.05)) * size.abs();
    format!("{range:.2} N m from end to end")
}

/// A pattern that no named shape describes: where it is worst.
fn unnamed(pattern: &Where) -> String {
    let (variable, unit) = match pattern.variable {
        Variable::Constant => ("nothing", ""),
        Variable::Velocity => ("velocity", "rad/s"),
        Variable::Speed => ("speed", "rad/s"),
        Variable::Acceleration => ("acceleration", "rad/s²"),
        Variable::Position => ("position", "rad"),
        Variable::Load => ("load", "N m"),
        Variable::Temperature => ("temperature", "°C"),
        Variable::Time => ("time", "s"),
        Variable::Contact => ("contact", ""),
    };
    let sure = |bin: &&super::Bin| bin.std_error.is_some_and(|std| bin.mean.abs() > 2.0 * std);
    let worst = pattern.bins.iter().filter(sure);
    let Some(bin) = worst.max_by(|a, b| a.mean.abs().total_cmp(&b.mean.abs())) else {
        return format!("predicted torque errs with {variable} in a way that has no simple shape");
    };
    format!(
        "predicted torque errs with {variable} in a way that has no simple shape; worst between {:.2} and {:.2} {unit}, \
         where it is {} {}",
        bin.from,
        bin.to,
        amount(bin.mean, bin.std_error.unwrap_or(0.0), "N m"),
        side(bin.mean)
    )
}

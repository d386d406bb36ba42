//! What is wrong between a log and the model, in words.

use std::fmt;

use super::{Mismatch, MismatchKind};

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(log) = &self.log {
            write!(f, "{}: ", log.display())?;
        }
        self.kind.fmt(f)
    }
}

impl fmt::Display for MismatchKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |joints: &[String]| match joints {
            [] => "all joints".to_owned(),
            some => some.join(", "),
        };
        let exchanged = |pairs: &[[String; 2]]| -> String {
            let told = pairs
                .iter()
                .map(|[as_, is]| format!("{as_}'s columns are {is}'s"));
            told.collect::<Vec<_>>().join(", ")
        };
        match self {
            Self::NoTorque(joints) => write!(
                f,
                "the torque of {} is zero: record the motors' estimate (tau_est), not a command or a placeholder",
                of(joints)
            ),
            Self::Sign(joints) => write!(
                f,
                "the torque of {} has the other sign: it is positive where it turns the joint to greater q",
                of(joints)
            ),
            Self::Unit(factor) => write!(
                f,
                "the torque is {factor:.3} times the model's at all joints: it is to be in N m at the joint, behind the gear"
            ),
            Self::Limbs(pairs) => write!(
                f,
                "limbs look exchanged, the log fits far better if {}: name the columns by the joints' names",
                exchanged(pairs)
            ),
            Self::Joints(pairs) => write!(
                f,
                "joints look exchanged in each limb, the log fits far better if {}: name the columns by the joints' names",
                exchanged(pairs)
            ),
            Self::Late(seconds) => write!(
                f,
                "the torque of all joints is {:.0} ms {} their motion: take both from one message, as it was measured",
                1e3 * seconds.abs(),
                if *seconds > 0.0 {
                    "later than"
                } else {
                    "ahead of"
                }
            ),
            Self::NoBetterThanNothing(left) => write!(
                f,
                "what the model gives, with whatever friction, leaves {:.0} % of the torque's square or more at half of the joints: another robot, another mounting of its \
                 base, or a robot that stands or walks",
                100.0 * left
            ),
            Self::Commanded(log) => write!(
                f,
                "the torque of {log} is what was commanded, kp (q_des - q) - kd dq, to the last digit: record what the motors report (tau_est)"
            ),
            Self::Twice([a, b]) => write!(f, "{a} and {b} are the same log: give it once"),
        }
    }
}

//! What is wrong between a log and the model, in words.

use std::f64::consts::PI;
use std::fmt;

use super::{Mismatch, MismatchKind};
use crate::model::significant;

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
            Self::ConstantTorque(joints) => {
                let each: Vec<String> = (joints.iter())
                    .map(|(joint, torque)| format!("{joint} is {} N m", significant(*torque, 3)))
                    .collect();
                write!(
                    f,
                    "the torque of {} whenever the joint moves: record the motors' estimate (tau_est), not a command or a placeholder",
                    each.join(", of ")
                )
            }
            Self::Velocity { joints, times } => {
                let is = |unit: f64| (times / unit - 1.0).abs() < 0.05;
                let units = [
                    (-1.0, "it has the other sign"),
                    (180.0 / PI, "it is in °/s; multiply it by π/180"),
                    (30.0 / PI, "it is in rpm; multiply it by π/30"),
                ];
                let known = units.iter().find(|(unit, _)| is(*unit));
                let what = known.map_or(
                    "it is to be in rad/s (m/s), at the joint, behind the gear",
                    |(_, what)| what,
                );
                write!(
                    f,
                    "the velocity of {} is {} times that of the positions: {what}",
                    of(joints),
                    significant(*times, 3)
                )
            }
            Self::Sign(joints) => write!(
                f,
                "the torque of {} has the other sign: it is positive where it turns the joint to greater q",
                of(joints)
            ),
            Self::Unit(factor) => write!(
                f,
                "the torque is {factor:.3} times the model's at all joints: it is to be in N m at the joint, behind the gear"
            ),
            Self::Units(factors) => {
                let of = |(joint, factor): &(String, Option<f64>)| match factor {
                    Some(factor) => format!("{joint} {factor:.4}"),
                    None => format!("{joint} not known"),
                };
                let each: Vec<String> = factors.iter().map(of).collect();
                write!(
                    f,
                    "the torque is in a unit of each joint's own, a motor's current in A perhaps: it is so many times the model's: {}; divide each \
                     `tau/` column by its number, or use the drive's N m per A",
                    each.join(", ")
                )
            }
            Self::ModelUnits {
                times,
                joints,
                bodies,
            } => {
                write!(
                    f,
                    "the model's torque is {:.0e} times the log's at {}: units; the log's torque is to be in N m, the URDF in kg, m and kg m²",
                    times,
                    of(joints)
                )?;
                for (body, [mass, radius]) in bodies {
                    write!(
                        f,
                        "; the inertia of `{body}` is that of its {} kg at {} m",
                        significant(*mass, 3),
                        significant(*radius, 2)
                    )?;
                }
                Ok(())
            }
            Self::NoGravity { joints, coriolis } => {
                let both = if *coriolis {
                    " and Coriolis forces"
                } else {
                    ""
                };
                write!(f, "the torque lacks gravity{both} at {}: ", of(joints))?;
                match joints.is_empty() {
                    true => f.write_str("the driver takes it out; record the torque of the motors, or add what the driver computes"),
                    false => f.write_str("the driver takes it out there, or a counterbalance carries the link"),
                }
            }
            Self::Orientation { angle, rpy } => {
                // To 0.1 mrad: no mounting is known better.
                let [roll, pitch, yaw] = rpy.map(|x| (1e4 * x).round() / 1e4 + 0.0);
                write!(
                    f,
                    "the base is mounted otherwise: gravity is {:.1}° from where the model has it; in the model file: [base], \
                     rpy = [{roll}, {pitch}, {yaw}] (yaw is not identifiable){}",
                    angle.to_degrees(),
                    if self.refuses() {
                        ""
                    } else {
                        ", or the effect base_tilt"
                    }
                )
            }
            Self::Body { link, mass, times } => write!(
                f,
                "{link}: {} kg by the torque, the URDF says {} kg: a load, or a wrong URDF",
                significant(mass * times, 3),
                significant(*mass, 3)
            ),
            Self::OtherWay(joints) => write!(
                f,
                "{} {} the other way, position, velocity and torque: multiply the three columns by -1, or turn the axis in the URDF",
                joints.join(", "),
                if joints.len() == 1 { "counts" } else { "count" }
            ),
            Self::Exchanged(pairs) => {
                let each: Vec<String> = pairs.iter().map(|[a, b]| format!("{a} and {b}")).collect();
                write!(
                    f,
                    "columns look exchanged, the log fits far better with those of {} exchanged: name the columns by the joints' names",
                    each.join(", ")
                )
            }
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
                "the torque of all joints is {:.0} ms {} their motion: {}",
                1e3 * seconds.abs(),
                if *seconds > 0.0 {
                    "later than"
                } else {
                    "ahead of"
                },
                match self.refuses() {
                    true => "take both from one message, as it was measured",
                    false => "the effect delay has it, or take both from one message",
                }
            ),
            Self::NoBetterThanNothing(left) => write!(
                f,
                "what the model gives, with whatever friction, leaves {:.0} % of the torque's square or more at half of the joints, and so does every \
                 other sign, unit, order and time of its columns: another robot, or a robot that stands or walks",
                100.0 * left
            ),
            Self::Elastic(joints) => {
                let each = joints.iter().map(|(joint, f)| format!("{joint} {f:.1} Hz"));
                write!(
                    f,
                    "an elastic robot, excited beyond the antiresonances of its springs ({}): the model does not predict its torque there; use `proprio frf`",
                    each.collect::<Vec<_>>().join(", ")
                )
            }
            Self::Commanded(log) => write!(
                f,
                "the torque of {log} is what was commanded, kp (q_des - q) - kd dq, to the last digit: record what the motors report (tau_est)"
            ),
            Self::Twice([a, b]) => write!(f, "{a} and {b} are the same log: give it once"),
        }
    }
}

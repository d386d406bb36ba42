//! What was recorded at motors, as what joints do.
//!
//! A motor's angle is its gear ratio times the joint's, or times a sum of several joints' where the transmission couples them:
//! q_m = G q, G diagonal without couplings. Power is the same on both sides, so that τ = Gᵀ τ_m.

use nalgebra::DMatrix;

use super::channel::Channel;
use super::error::Problem;
use super::slots::Slots;
use crate::model::Robot;

/// Which joints' channels are recorded at the motor.
#[derive(Debug, Clone)]
pub(super) struct MotorSide {
    /// Of each of [`Channel::MOTION`], of each joint.
    recorded: [Vec<bool>; 3],
}

impl MotorSide {
    pub(super) fn none(joints: usize) -> Self {
        Self {
            recorded: std::array::from_fn(|_| vec![false; joints]),
        }
    }

    /// The channel at `slot` is the motor's.
    pub(super) fn set(&mut self, slots: Slots, slot: usize) {
        for (channel, recorded) in Channel::MOTION.into_iter().zip(&mut self.recorded) {
            let all = slots.all(channel);
            if all.contains(&slot) {
                recorded[slot - all.start] = true;
            }
        }
    }
}

/// Sums that turn motors' numbers into joints'.
#[derive(Debug, Clone)]
pub(super) struct Motors {
    /// Slot of a joint's number, and the motors' slots and factors that it is the sum of.
    sums: Vec<(usize, Vec<(usize, f64)>)>,
}

impl Motors {
    /// Of the robot's transmission; none where nothing is recorded at a motor.
    pub(super) fn new(
        robot: &Robot,
        slots: Slots,
        side: &MotorSide,
    ) -> Result<Option<Self>, Problem> {
        let mut sums = Vec::new();
        for (channel, recorded) in Channel::MOTION.into_iter().zip(&side.recorded) {
            if recorded.contains(&true) {
                let matrix = transmission(robot, recorded)?;
                let by_motors = match channel {
                    Channel::Tau => matrix.transpose(),
                    _ => matrix.try_inverse().ok_or(Problem::Transmission)?,
                };
                sums.extend(rows(&by_motors, slots, channel, recorded));
            }
        }
        Ok((!sums.is_empty()).then_some(Self { sums }))
    }

    /// Turns a row's numbers, in place.
    pub(super) fn apply(&self, values: &mut [f64]) {
        let sum = |terms: &[(usize, f64)]| {
            terms
                .iter()
                .map(|(slot, factor)| factor * values[*slot])
                .sum()
        };
        let turned: Vec<f64> = self.sums.iter().map(|(_, terms)| sum(terms)).collect();
        for ((slot, _), value) in self.sums.iter().zip(turned) {
            values[*slot] = value;
        }
    }
}

/// Motors' turns per turn of joints; 1 on the diagonal of those that are not recorded at the motor.
fn transmission(robot: &Robot, recorded: &[bool]) -> Result<DMatrix<f64>, Problem> {
    let name = |joint: usize| robot.bodies()[joint].name.clone();
    let n = recorded.len();
    let mut matrix = DMatrix::identity(n, n);
    for motor in (0..n).filter(|joint| recorded[*joint]) {
        let own = robot.bodies()[motor].motor.map(|m| vec![(motor, m.gear)]);
        let stated = robot.conventions().transmission_of(motor);
        let Some(ratios) = stated.map(<[_]>::to_vec).or(own) else {
            return Err(Problem::NoGear { joint: name(motor) });
        };
        matrix[(motor, motor)] = 0.0;
        for (joint, ratio) in ratios {
            if !recorded[joint] {
                return Err(Problem::CoupledInPart {
                    joint: name(motor),
                    other: name(joint),
                });
            }
            matrix[(motor, joint)] = ratio;
        }
    }
    Ok(matrix)
}

fn rows<'a>(
    by_motors: &'a DMatrix<f64>,
    slots: Slots,
    channel: Channel,
    recorded: &'a [bool],
) -> impl Iterator<Item = (usize, Vec<(usize, f64)>)> + 'a {
    let joints = (0..by_motors.nrows()).filter(|joint| recorded[*joint]);
    joints.map(move |joint| {
        let terms = (0..by_motors.ncols()).map(|motor| (motor, by_motors[(joint, motor)]));
        let terms = terms.filter(|(_, factor)| *factor != 0.0);
        let terms = terms.map(|(motor, factor)| (slots.of(channel, motor), factor));
        (slots.of(channel, joint), terms.collect())
    })
}

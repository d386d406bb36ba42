//! What each cell of a file is: by the names of the format, or by those that other recorders give.

use std::collections::HashMap;

use proprio_core::go2::Leg;

use super::Columns;
use crate::log::channel::Channel;
use crate::log::error::Problem;
use crate::log::names::{self, Meaning, Sensor, Which};
use crate::log::slots::TIME;
use crate::log::source::Empty;
use crate::name::UnknownName;

/// Cells, and what they are.
type Targets = Vec<(usize, Target)>;

/// What is wrong, and with which cell.
type Fault = (Option<usize>, Problem);

/// What a cell is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Target {
    pub(super) slot: usize,
    /// What its number is multiplied by.
    pub(super) scale: f64,
    /// The channel's place among those of a motor, if it is the motor's.
    pub(super) motor: bool,
}

impl Columns {
    /// What each cell is, of those that are something; and what to do where one is empty.
    ///
    /// Names of the format come first. Where they name no joint, the names that other recorders give count.
    pub(super) fn targets(&self) -> Result<(Targets, Empty), Fault> {
        let known = self.known();
        let own: Targets = (0..self.names.len())
            .filter_map(|cell| Some((cell, *known.get(self.names[cell].as_str())?)))
            .collect();
        let joints = self.slots.of(Channel::Q, 0)..self.slots.quat();
        let is_joint = |(_, target): &(usize, Target)| joints.contains(&target.slot);
        let has_joints = own.iter().any(is_joint);
        let is_misspelt = |cell: usize| {
            Some((
                Some(cell),
                self.misspelt(&self.names[cell], &known, has_joints)?,
            ))
        };
        if let Some(fault) = (0..self.names.len()).find_map(is_misspelt) {
            return Err(fault);
        }
        if has_joints {
            return Ok((self.with_time(own), Empty::Refuse));
        }
        let others = self.others()?;
        Ok((self.with_time([own, others].concat()), Empty::Skip))
    }

    /// Every column name of the format, and what it is.
    fn known(&self) -> HashMap<String, Target> {
        let slots = self.slots;
        let plain = |slot| Target {
            slot,
            scale: 1.0,
            motor: false,
        };
        let mut known = HashMap::from([("t".to_owned(), plain(TIME))]);
        for (joint, body) in self.robot.bodies().iter().enumerate() {
            for channel in Channel::ALL {
                let target = plain(slots.of(channel, joint));
                for name in [&body.joint_name, &body.name] {
                    known.insert(channel.column(name), target);
                    if Channel::MOTION.contains(&channel) {
                        let motor = true;
                        known.insert(channel.motor_column(name), Target { motor, ..target });
                    }
                }
            }
        }
        for (prefix, first, axes) in slots.groups() {
            for (i, axis) in axes.iter().enumerate() {
                known.insert(format!("{prefix}/{axis}"), plain(first + i));
            }
        }
        for (limb, slot) in self.limbs.iter().zip(slots.feet()) {
            known.insert(format!("foot/{}", limb.name), plain(slot));
        }
        self.joint_suffix(&mut known);
        self.lerobot_suffix(&mut known);
        known
    }

    /// The same joints with `_joint` behind their names, or without it: a URDF and a recorder often differ by that. Names that are a joint's own
    /// come first.
    fn joint_suffix(&self, known: &mut HashMap<String, Target>) {
        for body in self.robot.bodies() {
            let name = &body.name;
            let other = match name.strip_suffix("_joint") {
                Some(short) if !short.is_empty() => short.to_owned(),
                _ => format!("{name}_joint"),
            };
            for channel in Channel::ALL {
                for column in [Channel::column, Channel::motor_column] {
                    if let Some(target) = known.get(&column(channel, name)).copied() {
                        known.entry(column(channel, &other)).or_insert(target);
                    }
                }
            }
        }
    }

    /// The same joints as LeRobot lists them: `q/elbow.pos`, `dq/elbow.pos` where one list names all arrays.
    fn lerobot_suffix(&self, known: &mut HashMap<String, Target>) {
        for name in &self.names {
            let bare = names::without_suffix(name);
            if bare != name
                && let Some(target) = known.get(bare).copied()
            {
                known.entry(name.clone()).or_insert(target);
            }
        }
    }

    /// What other recorders' names mean.
    fn others(&self) -> Result<Targets, Fault> {
        let order = self.robot.motor_order();
        let mut found = Vec::new();
        let (mut unknown, mut any) = (None, false);
        for (cell, name) in self.names.iter().enumerate() {
            let slot = match names::meaning(name) {
                None | Some(Meaning::Time(_)) => continue,
                Some(Meaning::Joint(channel, Which::Name(joint))) => {
                    let known = |name| self.robot.joint_as_recorded(name);
                    let bare = || known(names::without_suffix(joint));
                    let Some(joint) = known(joint).or_else(bare) else {
                        unknown.get_or_insert((cell, joint.to_owned()));
                        continue;
                    };
                    self.slots.of(channel, joint)
                }
                Some(Meaning::Joint(channel, Which::Motor(motor))) => {
                    let Some(order) = &order else {
                        let robot = self.robot.name().to_owned();
                        return Err((Some(cell), Problem::MotorOrder { robot }));
                    };
                    let Some(joint) = order.get(motor).copied().flatten() else {
                        continue;
                    };
                    self.slots.of(channel, joint)
                }
                Some(Meaning::Imu(sensor, axis)) => match self.imu(sensor, axis) {
                    Some(slot) => slot,
                    None => continue,
                },
                Some(Meaning::Foot(foot)) => match self.foot(foot) {
                    Some(slot) => slot,
                    None => continue,
                },
            };
            any |= slot < self.slots.quat();
            found.push((cell, self.other_target(slot)));
        }
        match unknown {
            Some((cell, name)) if !any => Err((Some(cell), self.other_robot(name))),
            _ => Ok(found),
        }
    }

    /// A slot as messages fill it: at the motor, if the model says so.
    fn other_target(&self, slot: usize) -> Target {
        let at_motor = |channel: &Channel| {
            self.slots.all(*channel).contains(&slot)
                && self.robot.conventions().at_motor[*channel as usize]
        };
        Target {
            slot,
            scale: 1.0,
            motor: Channel::MOTION.iter().any(at_motor),
        }
    }

    fn imu(&self, sensor: Sensor, axis: usize) -> Option<usize> {
        let (first, axes) = match sensor {
            Sensor::Quaternion => (self.slots.quat(), 4),
            Sensor::Gyroscope => (self.slots.gyro(), 3),
            Sensor::Accelerometer => (self.slots.acc(), 3),
        };
        (axis < axes).then_some(first + axis)
    }

    /// The slot of a Go2's foot by its number in messages, FR FL RR RL; other robots' messages have none.
    fn foot(&self, number: usize) -> Option<usize> {
        let name = Leg::ALL.get(number)?.name();
        let limb = self.limbs.iter().position(|limb| limb.name == name)?;
        self.slots.feet().nth(limb)
    }

    /// The cells found, and that of the time: `t`, or as another recorder calls it.
    fn with_time(&self, mut found: Targets) -> Targets {
        if found.iter().any(|(_, target)| target.slot == TIME) {
            return found;
        }
        let time = (0..self.names.len()).find_map(|cell| match names::meaning(&self.names[cell]) {
            Some(Meaning::Time(scale)) => Some((cell, scale)),
            _ => None,
        });
        if let Some((cell, scale)) = time {
            let target = Target {
                slot: TIME,
                scale,
                motor: false,
            };
            found.push((cell, target));
        }
        found
    }

    /// A column that begins like one of the format but names no joint or limb of the robot is a mistake, not a column to
    /// ignore.
    fn misspelt(
        &self,
        name: &str,
        known: &HashMap<String, Target>,
        has_joints: bool,
    ) -> Option<Problem> {
        if known.contains_key(name) {
            return None;
        }
        let (prefix, rest) = name.split_once('/')?;
        let robot = || self.robot.name().to_owned();
        if self.robot.held().iter().any(|(joint, _)| joint == rest) {
            return None;
        }
        let channel = prefix.strip_suffix("_motor").unwrap_or(prefix);
        let unknown = if Channel::ALL.iter().any(|c| c.prefix() == channel) {
            if !has_joints {
                return Some(self.other_robot(rest.to_owned()));
            }
            self.robot.joint(rest).err()?
        } else if prefix == "foot" {
            UnknownName::new(
                "limb",
                rest,
                self.limbs.iter().map(|limb| limb.name.as_str()),
            )
        } else {
            return None;
        };
        Some(Problem::UnknownName {
            nearest: format!("{prefix}/{}", unknown.nearest()?),
            name: unknown.name,
            robot: robot(),
        })
    }

    fn other_robot(&self, name: String) -> Problem {
        Problem::OtherRobot {
            name,
            robot: self.robot.name().to_owned(),
            joints: self.joint_names(),
        }
    }
}

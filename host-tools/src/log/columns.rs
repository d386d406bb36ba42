//! From a header to the place of each channel in a row.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use csv::ByteRecord;
use proprio_core::go2::Leg;

use super::error::{LogError, Problem};
use super::joint::leg_named;
use super::slots::{Slots, TIME};
use crate::model::{Limb, Robot, UnknownName};

/// A signal that each joint has of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Position, rad (of a prismatic joint m; and so below).
    Q,
    /// Velocity, rad/s.
    Dq,
    /// Torque, N m.
    Tau,
    /// Motor temperature, degrees Celsius.
    Temp,
    /// Commanded position, rad.
    QDes,
}

impl Channel {
    /// The channels every recorded joint must have.
    pub const MOTION: [Self; 3] = [Self::Q, Self::Dq, Self::Tau];
    const ALL: [Self; 5] = [Self::Q, Self::Dq, Self::Tau, Self::Temp, Self::QDes];

    /// The part of the column's name before the slash.
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::Q => "q",
            Self::Dq => "dq",
            Self::Tau => "tau",
            Self::Temp => "temp",
            Self::QDes => "q_des",
        }
    }

    /// The column's name in a header, such as `dq/FR_hip`.
    pub fn column(self, joint: impl fmt::Display) -> String {
        format!("{}/{joint}", self.prefix())
    }
}

/// Which part of a log to read; columns outside it are not even parsed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Selection {
    /// Time, positions, velocities and torques.
    Motion,
    /// All that the format knows.
    Everything,
}

/// Where each channel of a robot's log is.
#[derive(Debug, Clone)]
pub struct Columns {
    robot: Robot,
    limbs: Vec<Limb>,
    /// Where they are in a row.
    pub(super) slots: Slots,
    /// Header, for messages.
    pub(super) names: Vec<String>,
    /// (cell in the row, slot in the flat array), in the order of the cells.
    pub(super) wanted: Vec<(usize, usize)>,
    /// Cell of each slot.
    pub(super) cell: Vec<Option<usize>>,
}

impl Columns {
    /// Reads the header of the log of `robot` at `path`.
    pub(super) fn new(
        path: &Path,
        line: u64,
        header: &ByteRecord,
        selection: Selection,
        robot: &Robot,
    ) -> Result<Self, LogError> {
        let error = |problem| LogError::new(path, problem).at_line(line);
        let names: Vec<String> = header
            .iter()
            .map(|name| String::from_utf8_lossy(name).trim().to_owned())
            .collect();
        check_header(&names).map_err(error)?;
        let limbs = robot.limbs();
        let slots = Slots::new(robot.bodies().len(), limbs.len());
        let mut columns = Self {
            robot: robot.clone(),
            limbs,
            slots,
            names,
            wanted: Vec::new(),
            cell: vec![None; slots.count()],
        };
        let known = columns.known();
        for (index, name) in columns.names.iter().enumerate() {
            if let Some(&slot) = known.get(name) {
                if let Some(first) = columns.cell[slot].replace(index) {
                    let problem = Problem::DuplicateColumn { first: first + 1 };
                    return Err(error(problem).at_column(index, name));
                }
            } else if let Some(problem) = columns.misspelt(name, &known) {
                return Err(error(problem).at_column(index, name));
            }
        }
        columns.check_complete(path, line)?;
        Ok(columns.select(selection))
    }

    /// The robot whose log it is.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The joints recorded, by their numbers among the robot's.
    pub fn joints(&self) -> impl Iterator<Item = usize> {
        (0..self.slots.joints()).filter(|&joint| self.has(Channel::Q, joint))
    }

    /// The limbs recorded; each with all its joints.
    pub fn limbs(&self) -> impl Iterator<Item = &Limb> {
        let recorded = |limb: &&Limb| self.has(Channel::Q, limb.bodies.start);
        self.limbs.iter().filter(recorded)
    }

    /// The legs of a Go2 recorded; each with all its joints.
    pub fn legs(&self) -> impl Iterator<Item = Leg> {
        self.limbs().filter_map(|limb| leg_named(&limb.name).ok())
    }

    /// Whether the log has this channel of this joint.
    pub fn has(&self, channel: Channel, joint: usize) -> bool {
        self.has_slot(self.slots.of(channel, joint))
    }

    /// Whether the log has what belongs at `slot`.
    pub(super) fn has_slot(&self, slot: usize) -> bool {
        self.cell[slot].is_some()
    }

    /// A joint's name.
    pub(super) fn name(&self, joint: usize) -> &str {
        &self.robot.bodies()[joint].name
    }

    /// Every column name of the format and its slot.
    fn known(&self) -> HashMap<String, usize> {
        let slots = self.slots;
        let per_joint = Channel::ALL.into_iter().flat_map(|channel| {
            let column = move |joint| (channel.column(self.name(joint)), slots.of(channel, joint));
            (0..slots.joints()).map(column)
        });
        let grouped = slots
            .groups()
            .into_iter()
            .flat_map(|(prefix, first, axes)| {
                let axes = axes.iter().enumerate();
                axes.map(move |(i, axis)| (format!("{prefix}/{axis}"), first + i))
            });
        let feet = self.limbs.iter().zip(slots.feet());
        let feet = feet.map(|(limb, slot)| (format!("foot/{}", limb.name), slot));
        per_joint
            .chain(grouped)
            .chain(feet)
            .chain([("t".to_owned(), TIME)])
            .collect()
    }

    /// A column that begins like one of the format but names no joint or limb of the robot is a mistake, not a column to
    /// ignore.
    fn misspelt(&self, name: &str, known: &HashMap<String, usize>) -> Option<Problem> {
        let (prefix, rest) = name.split_once('/')?;
        let robot = || self.robot.name().to_owned();
        let unknown = if Channel::ALL.iter().any(|c| c.prefix() == prefix) {
            let joints = self.slots.of(Channel::Q, 0)..self.slots.quat();
            let is_joint = |name: &String| known.get(name).is_some_and(|s| joints.contains(s));
            if !self.names.iter().any(is_joint) {
                return Some(Problem::OtherRobot {
                    name: rest.to_owned(),
                    robot: robot(),
                    joints: self.joint_names(),
                });
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

    fn joint_names(&self) -> Vec<String> {
        let bodies = self.robot.bodies().iter();
        bodies.map(|body| body.name.clone()).collect()
    }

    fn check_complete(&self, path: &Path, line: u64) -> Result<(), LogError> {
        let error = |problem| LogError::new(path, problem).at_line(line);
        if !self.has_slot(TIME) {
            let name = "t".to_owned();
            return Err(error(Problem::MissingColumn { name }));
        }
        let joints = (0..self.slots.joints()).find_map(|joint| self.missing_channel(joint));
        let limbs = || self.limbs.iter().find_map(|limb| self.missing_joint(limb));
        if let Some((problem, slot)) = joints.or_else(limbs) {
            return Err(self.at(slot, error(problem)));
        }
        if self.joints().next().is_none() {
            let joints = self.joint_names();
            return Err(error(Problem::NoJoints { joints }));
        }
        match self.missing_axis() {
            Some((problem, slot)) => Err(self.at(slot, error(problem))),
            None => Ok(()),
        }
    }

    /// What is incomplete is told at a column that it has.
    fn at(&self, slot: usize, error: LogError) -> LogError {
        match self.cell[slot] {
            Some(cell) => error.at_column(cell, &self.names[cell]),
            None => error,
        }
    }

    /// A joint recorded in part, and the slot of what it has.
    fn missing_channel(&self, joint: usize) -> Option<(Problem, usize)> {
        let has = |channel: &Channel| self.has(*channel, joint);
        let present = Channel::MOTION.into_iter().find(has)?;
        let absent = Channel::MOTION.into_iter().find(|c| !has(c))?;
        let joint_name = self.name(joint);
        let problem = Problem::MissingChannel {
            joint: joint_name.to_owned(),
            missing: absent.column(joint_name),
        };
        Some((problem, self.slots.of(present, joint)))
    }

    /// A limb recorded in part, and the slot of what it has.
    fn missing_joint(&self, limb: &Limb) -> Option<(Problem, usize)> {
        let recorded = |joint: &usize| self.has(Channel::Q, *joint);
        let present = limb.bodies.clone().find(recorded)?;
        let absent = limb.bodies.clone().find(|joint| !recorded(joint))?;
        let problem = Problem::IncompleteLimb {
            limb: limb.name.clone(),
            present: self.name(present).to_owned(),
            missing: self.name(absent).to_owned(),
        };
        Some((problem, self.slots.of(Channel::Q, present)))
    }

    /// A group recorded in part, and the slot of what it has.
    fn missing_axis(&self) -> Option<(Problem, usize)> {
        self.slots
            .groups()
            .into_iter()
            .find_map(|(prefix, first, axes)| {
                let has = |i: &usize| self.has_slot(first + i);
                let present = (0..axes.len()).find(has)?;
                let absent = (0..axes.len()).find(|i| !has(i))?;
                let name = format!("{prefix}/{}", axes[absent]);
                Some((Problem::MissingColumn { name }, first + present))
            })
    }

    fn select(mut self, selection: Selection) -> Self {
        let end = match selection {
            Selection::Motion => self.slots.of(Channel::Temp, 0),
            Selection::Everything => self.slots.count(),
        };
        self.cell[end..].fill(None);
        let slots = self.cell.iter().enumerate();
        self.wanted = slots.filter_map(|(s, cell)| Some(((*cell)?, s))).collect();
        self.wanted.sort_unstable();
        self
    }
}

/// A header has names, and commas between them.
fn check_header(names: &[String]) -> Result<(), Problem> {
    let is_number = |name: &String| fast_float2::parse::<f64, _>(name).is_ok();
    if names.iter().all(is_number) {
        return Err(Problem::NoHeader);
    }
    if let [only] = names
        && let Some(separator) = only.chars().find(|c| [';', '\t', ' ', '|'].contains(c))
    {
        return Err(Problem::Separator(separator));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(header: &[&str], selection: Selection) -> Columns {
        let header = ByteRecord::from(header.to_vec());
        Columns::new(Path::new("log.csv"), 1, &header, selection, &Robot::go2()).unwrap()
    }

    const FL: [&str; 10] = [
        "tau/FL_calf",
        "t",
        "q/FL_hip",
        "q/FL_thigh",
        "q/FL_calf",
        "dq/FL_hip",
        "dq/FL_thigh",
        "dq/FL_calf",
        "tau/FL_hip",
        "tau/FL_thigh",
    ];

    /// A limb is found whatever the order of its columns, and only that limb.
    #[test]
    fn a_limb_is_found_by_the_names_of_its_joints() {
        let columns = columns(&FL, Selection::Motion);
        assert_eq!(columns.joints().collect::<Vec<_>>(), [3, 4, 5]);
        assert_eq!(columns.legs().collect::<Vec<_>>(), [Leg::FL]);
        assert_eq!(columns.wanted[0], (0, columns.slots.of(Channel::Tau, 5)));
        assert_eq!(columns.wanted.len(), FL.len());
    }

    /// One foot's sensor does not need the others'.
    #[test]
    fn a_foot_is_recorded_on_its_own() {
        let header = [&FL[..], &["foot/FL"]].concat();
        let columns = columns(&header, Selection::Everything);
        let feet = columns.slots.feet().map(|slot| columns.has_slot(slot));
        assert_eq!(feet.collect::<Vec<_>>(), [false, true, false, false]);
    }
}

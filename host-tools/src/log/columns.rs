//! From the names of a file's cells to the place of each channel in a row.

mod targets;

use std::path::Path;

use proprio_core::go2::Leg;

use super::channel::Channel;
use super::error::{LogError, Place, Problem};
use super::motors::{MotorSide, Motors};
use super::slots::{Slots, TIME};
use super::source::{Empty, Wanted};
use crate::model::{Limb, Robot};

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
    /// Names of the file's cells, for messages.
    pub(super) names: Vec<String>,
    /// What is read of a row, in the order of the cells.
    pub(super) wanted: Vec<Wanted>,
    /// Cell of each slot.
    pub(super) cell: Vec<Option<usize>>,
    /// What is recorded at motors and not at joints.
    pub(super) motors: Option<Motors>,
}

impl Columns {
    /// Finds the channels of `robot` among the cells of the log at `path`; errors of the names are told at `place`.
    pub(super) fn new(
        path: &Path,
        place: Option<Place>,
        names: Vec<String>,
        selection: Selection,
        robot: &Robot,
    ) -> Result<Self, LogError> {
        let error = |problem| LogError::new(path, problem).at(place);
        let limbs = robot.limbs();
        let slots = Slots::new(robot.bodies().len(), limbs.len());
        let mut columns = Self {
            robot: robot.clone(),
            limbs,
            slots,
            names,
            wanted: Vec::new(),
            cell: vec![None; slots.count()],
            motors: None,
        };
        let (targets, empty) = columns.targets().map_err(|(cell, problem)| {
            let error = error(problem);
            match cell {
                Some(cell) => error.at_column(cell, &columns.names[cell]),
                None => error,
            }
        })?;
        let mut at_motor = MotorSide::none(slots.joints());
        for (index, target) in targets {
            if let Some(first) = columns.cell[target.slot].replace(index) {
                let problem = Problem::DuplicateColumn { first: first + 1 };
                return Err(error(problem).at_column(index, &columns.names[index]));
            }
            if target.motor {
                at_motor.set(slots, target.slot);
            }
            columns.wanted.push(Wanted {
                cell: index,
                slot: target.slot,
                scale: target.scale,
                empty,
            });
        }
        columns.check_complete(&error)?;
        columns.motors = Motors::new(robot, slots, &at_motor).map_err(error)?;
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

    /// All limbs of the robot.
    pub(super) fn all_limbs(&self) -> &[Limb] {
        &self.limbs
    }

    /// The legs of a Go2 recorded; each with all its joints.
    pub fn legs(&self) -> impl Iterator<Item = Leg> {
        self.limbs().filter_map(|limb| Leg::from_name(&limb.name))
    }

    /// Whether the log has this channel of this joint.
    pub fn has(&self, channel: Channel, joint: usize) -> bool {
        self.has_slot(self.slots.of(channel, joint))
    }

    /// Whether the log has a gyro.
    pub fn has_gyro(&self) -> bool {
        self.has_slot(self.slots.gyro())
    }

    /// Whether the log has an accelerometer.
    pub fn has_acc(&self) -> bool {
        self.has_slot(self.slots.acc())
    }

    /// Whether the log has any foot's sensor.
    pub fn has_feet(&self) -> bool {
        self.slots.feet().any(|slot| self.has_slot(slot))
    }

    /// What the log has beside the joints' motion, by the names before the slash: `temp`, `gyro`, `foot`.
    #[cfg(any(feature = "mcap", test))]
    pub fn beyond_motion(&self) -> Vec<&'static str> {
        let joints = Channel::ALL[Channel::MOTION.len()..].iter();
        let joints = joints.map(|channel| (channel.prefix(), self.slots.all(*channel)));
        let groups = self.slots.groups().into_iter();
        let groups = groups.map(|(name, first, axes)| (name, first..first + axes.len()));
        let feet = [("foot", self.slots.feet())];
        let all = joints.chain(groups).chain(feet);
        all.filter(|(_, slots)| slots.clone().any(|slot| self.has_slot(slot)))
            .map(|(name, _)| name)
            .collect()
    }

    /// Whether the log has what belongs at `slot`.
    pub(super) fn has_slot(&self, slot: usize) -> bool {
        self.cell[slot].is_some()
    }

    /// What the file calls a cell.
    pub(super) fn column_name(&self, cell: usize) -> &str {
        self.names.get(cell).map_or("", String::as_str)
    }

    /// A joint's name.
    pub(super) fn name(&self, joint: usize) -> &str {
        &self.robot.bodies()[joint].name
    }

    fn joint_names(&self) -> Vec<String> {
        let bodies = self.robot.bodies().iter();
        bodies.map(|body| body.name.clone()).collect()
    }

    fn check_complete(&self, error: &impl Fn(Problem) -> LogError) -> Result<(), LogError> {
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
        let cell = &self.cell;
        self.wanted.retain(|wanted| cell[wanted.slot].is_some());
        // Beyond the motion nothing needs a value in every row: a temperature comes more slowly.
        let motion = self.slots.of(Channel::Temp, 0);
        let others = self
            .wanted
            .iter_mut()
            .filter(|wanted| wanted.slot >= motion);
        others.for_each(|wanted| wanted.empty = Empty::Nan);
        self.wanted.sort_unstable_by_key(|wanted| wanted.cell);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(header: &[&str], selection: Selection) -> Columns {
        let names = header.iter().map(|name| (*name).to_owned()).collect();
        Columns::new(Path::new("log.csv"), None, names, selection, &Robot::go2()).unwrap()
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
        let first = columns.wanted[0];
        assert_eq!(
            (first.cell, first.slot),
            (0, columns.slots.of(Channel::Tau, 5))
        );
        assert_eq!(columns.wanted.len(), FL.len());
    }

    /// A URDF's `lift_joint` is `lift` to many a recorder, and a Go2's `FL_hip` `FL_hip_joint`.
    #[test]
    fn joints_are_found_with_their_suffix_and_without() {
        let folder = tempfile::tempdir().unwrap();
        let urdf = folder.path().join("lift.urdf");
        let text = r#"<robot name="lift"><link name="base"/><link name="fork"><inertial><mass value="1"/>
            <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
            <joint name="lift_joint" type="prismatic"><parent link="base"/><child link="fork"/><axis xyz="0 0 1"/>
            <limit lower="0" upper="1" effort="10" velocity="1"/></joint></robot>"#;
        std::fs::write(&urdf, text).unwrap();
        let lift = Robot::from_urdf(&urdf).unwrap();
        for name in ["lift", "lift_joint"] {
            let header = ["t".to_owned()]
                .into_iter()
                .chain(["q", "dq", "tau"].map(|channel| format!("{channel}/{name}")));
            let columns = Columns::new(
                Path::new("log.csv"),
                None,
                header.collect(),
                Selection::Motion,
                &lift,
            );
            assert_eq!(columns.unwrap().joints().collect::<Vec<_>>(), [0], "{name}");
        }
        let long = FL.map(|name| match name {
            "t" => name.to_owned(),
            _ => format!("{name}_joint"),
        });
        let columns = columns(&long.each_ref().map(String::as_str), Selection::Motion);
        assert_eq!(columns.joints().collect::<Vec<_>>(), [3, 4, 5]);
    }

    /// One foot's sensor does not need the others'.
    #[test]
    fn a_foot_is_recorded_on_its_own() {
        let header = [&FL[..], &["foot/FL"]].concat();
        let columns = columns(&header, Selection::Everything);
        let feet = columns.slots.feet().map(|slot| columns.has_slot(slot));
        assert_eq!(feet.collect::<Vec<_>>(), [false, true, false, false]);
        assert_eq!(columns.beyond_motion(), ["foot"]);
    }

    #[test]
    fn what_is_no_motion_is_named_in_the_order_of_a_row() {
        let more = ["q_des/FL_hip", "acc/x", "acc/y", "acc/z", "temp/FL_calf"];
        let header = [&FL[..], &more].concat();
        let of = |selection| columns(&header, selection).beyond_motion();
        assert_eq!(of(Selection::Everything), ["temp", "q_des", "acc"]);
        assert!(of(Selection::Motion).is_empty());
    }
}

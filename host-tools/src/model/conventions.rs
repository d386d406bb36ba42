//! How a robot's logs speak of its joints, where their columns do not say so themselves.

use proprio_core::go2::JOINT_NAMES;

use super::robot::{Body, Robot};

/// Order of the motors of Unitree's G1 in `unitree_hg/LowState`, its joints without `_joint` (unitree_sdk2, `G1JointIndex`).
const G1: [&str; 29] = [
    "left_hip_pitch",
    "left_hip_roll",
    "left_hip_yaw",
    "left_knee",
    "left_ankle_pitch",
    "left_ankle_roll",
    "right_hip_pitch",
    "right_hip_roll",
    "right_hip_yaw",
    "right_knee",
    "right_ankle_pitch",
    "right_ankle_roll",
    "waist_yaw",
    "waist_roll",
    "waist_pitch",
    "left_shoulder_pitch",
    "left_shoulder_roll",
    "left_shoulder_yaw",
    "left_elbow",
    "left_wrist_roll",
    "left_wrist_pitch",
    "left_wrist_yaw",
    "right_shoulder_pitch",
    "right_shoulder_roll",
    "right_shoulder_yaw",
    "right_elbow",
    "right_wrist_roll",
    "right_wrist_pitch",
    "right_wrist_yaw",
];

impl Robot {
    /// The joint of each motor of a message that numbers them: as the model file states, or as the maker of a robot that is
    /// known documents it (a Go2 and its kin, a G1). `None` for another robot, whose order is not to be guessed.
    pub fn motor_order(&self) -> Option<Vec<Option<usize>>> {
        let stated = self.conventions().motors.as_ref();
        if let Some(motors) = stated {
            return Some(motors.iter().map(|joint| Some(*joint)).collect());
        }
        let find = |names: &[&str]| -> Vec<Option<usize>> {
            names
                .iter()
                .map(|name| self.joint_as_recorded(name))
                .collect()
        };
        let go2 = find(&JOINT_NAMES);
        if go2.iter().all(Option::is_some) {
            return Some(go2);
        }
        // Others of its kin have joints of the same names in another order.
        let g1 = find(&G1);
        let is_g1 = self.name().starts_with("g1") && g1[..12].iter().all(Option::is_some);
        is_g1.then_some(g1)
    }

    /// The joint that a log calls `name`: by its name, its name in the URDF, either with or without `_joint`.
    pub fn joint_as_recorded(&self, name: &str) -> Option<usize> {
        let short = |name: &str| name.strip_suffix("_joint").unwrap_or(name).to_owned();
        let exact = |body: &Body| body.name == name || body.joint_name == name;
        let bodies = self.bodies();
        let found = bodies.iter().position(exact);
        found.or_else(|| {
            bodies
                .iter()
                .position(|body| short(&body.joint_name) == short(name))
        })
    }
}

//! Poses in which some joints' angles are known without an encoder: against their stops.
//!
//! The stops are the URDF's position limits. How near a real robot's plastic is to them is not published; a zero that is off by
//! some hundredths of a radian is what the effect `encoder_offset` finds.

use proprio_core::go2::{BEYOND_STOPS, JOINTS_PER_LEG, JointId, Leg, position_limits};

/// A named pose.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// Its name on the command line.
    pub name: &'static str,
    /// How to bring a robot into it.
    pub words: &'static str,
    /// The joint that it places, of each leg.
    place: usize,
    stop: Stop,
}

/// Which of a joint's stops.
#[derive(Debug, Clone, Copy)]
enum Stop {
    Lower,
    Upper,
    /// Of a hip, the one at which its leg is away from the trunk: positive turns are to the left.
    Outer,
}

/// Those known.
pub const POSES: [Pose; 4] = [
    Pose {
        name: "hips-out",
        words: "each hip turned outward to its stop",
        place: 0,
        stop: Stop::Outer,
    },
    Pose {
        name: "thighs-back",
        words: "each thigh turned back and up to its stop",
        place: 1,
        stop: Stop::Upper,
    },
    Pose {
        name: "thighs-forward",
        words: "each thigh turned forward and up to its stop",
        place: 1,
        stop: Stop::Lower,
    },
    Pose {
        name: "calves-folded",
        words: "each calf folded against its thigh to its stop",
        place: 2,
        stop: Stop::Lower,
    },
];

impl Pose {
    /// The pose of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        POSES.into_iter().find(|pose| pose.name == name)
    }

    /// Each joint that it places, and its angle, rad.
    pub fn angles(self, legs: &[Leg]) -> Vec<(JointId, f64)> {
        let of_leg = |leg: &Leg| {
            let joint = JointId::of(*leg)[self.place];
            let [lower, upper] = position_limits(*leg)[self.place];
            let angle = match self.stop {
                Stop::Lower => lower,
                Stop::Upper => upper,
                Stop::Outer if matches!(leg, Leg::FL | Leg::RL) => upper,
                Stop::Outer => lower,
            };
            (joint, angle)
        };
        legs.iter().map(of_leg).collect()
    }
}

/// Whether a joint can be at this angle (rad), its stops' inaccuracy included.
pub fn can_be(joint: JointId, angle: f64) -> bool {
    let [lower, upper] = position_limits(joint.leg())[joint.place()];
    (lower - BEYOND_STOPS..=upper + BEYOND_STOPS).contains(&angle)
}

const _: () = assert!(JOINTS_PER_LEG == 3);

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of stops: by hand from the URDF's limits and axes (go2.md).
    #[test]
    #[allow(clippy::approx_constant)] // the URDF's rounding, not ours
    fn each_pose_is_at_the_stops_that_its_words_say() {
        for (name, joint, angle) in [
            ("hips-out", "FR_hip", -1.0472),
            ("hips-out", "FL_hip", 1.0472),
            ("hips-out", "RR_hip", -1.0472),
            ("hips-out", "RL_hip", 1.0472),
            ("thighs-back", "FR_thigh", 3.4907),
            ("thighs-back", "RL_thigh", 4.5379),
            ("thighs-forward", "FL_thigh", -1.5708),
            ("thighs-forward", "RR_thigh", -0.5236),
            ("calves-folded", "FR_calf", -2.7227),
            ("calves-folded", "RL_calf", -2.7227),
        ] {
            let angles = Pose::from_name(name).unwrap().angles(&Leg::ALL);
            let told = angles.iter().find(|(id, _)| id.name() == joint).unwrap();
            assert_eq!(told.1, angle, "{name} {joint}");
            assert!(can_be(told.0, told.1) && angles.len() == 4);
        }
    }

    /// An outward hip takes its foot away from the middle, a thigh turned back takes it back: by the tree.
    #[test]
    fn words_and_kinematics_agree() {
        use nalgebra::SVector;
        use proprio_core::spatial::Transform;
        for leg in Leg::ALL {
            let tree = proprio_core::go2::leg::<f64>(leg);
            let knee = |q: [f64; 3]| {
                let placements = tree.placements(&Transform::identity(), &SVector::from(q));
                let [hip, thigh, calf] = placements.from_parent;
                hip.compose(&thigh).compose(&calf).translation
            };
            let angle = |name: &str| Pose::from_name(name).unwrap().angles(&[leg])[0].1;
            let hanging = knee([0.0; 3]);
            let out = knee([angle("hips-out"), 0.0, 0.0]);
            assert!(out.y.abs() > hanging.y.abs(), "{leg:?}");
            // A little of the way, as a stop may be beyond straight up.
            let back = knee([0.0, 0.1 * angle("thighs-back").signum(), 0.0]);
            assert!(back.x < hanging.x, "{leg:?}");
            let forward = knee([0.0, 0.1 * angle("thighs-forward").signum(), 0.0]);
            assert!(forward.x > hanging.x, "{leg:?}");
        }
    }
}

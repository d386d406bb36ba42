//! What calibration knows of a robot: where the measuring system and the targets are, and by how much joint frames and transmissions differ
//! from the description.
//!
//! Values are corrections: the description stays as it is, and `proprio export --urdf` adds them to its origins. Dynamics are of the corrected frames
//! ([`Model::placement`]). Elasticity and backlash of a
//! joint are effects of the model like any other ([`Model::effect`]), because motion logs estimate the same numbers. Bends of links are measured by
//! frequency responses too, which add what damps springs and bends.

use nalgebra::{Rotation3, Vector3};
use proprio_core::effect::EffectKind;
use proprio_core::spatial::Transform;

use super::{Body, Estimate, Impossible, Model, Witness, possible};
use crate::catalogue;

/// What corrections of joint frames are called, where effects have their name.
pub(crate) const LINK_GEOMETRY: &str = "link_geometry";
/// What bends of links are called, where effects have their name.
pub(crate) const LINK_ELASTICITY: &str = "link_elasticity";

/// A number that calibration estimates at a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum JointQuantity {
    /// The frame is displaced along its own x, y or z (0, 1, 2), m.
    Shift(usize),
    /// The frame is turned about its own x, y or z, rad.
    Turn(usize),
    /// The joint moves by this share more than is read.
    Ratio,
    /// The joint moves by this much per rad (or m) of the joint that carries it.
    Coupling,
    /// The joint's error is this times the sine of its position, rad.
    Sine,
    /// The same with the cosine.
    Cosine,
    /// The link turns about the first axis across the joint's by this much per N m, rad/(N m).
    BendFirst,
    /// The same about the second.
    BendSecond,
    /// The joint yields by this much per N m of its load, rad/(N m), or m/N.
    Elasticity,
    /// Play between motor and link, rad.
    Backlash,
}

impl JointQuantity {
    /// All of them, in the order of model files.
    pub const ALL: [Self; 14] = [
        Self::Shift(0),
        Self::Shift(1),
        Self::Shift(2),
        Self::Turn(0),
        Self::Turn(1),
        Self::Turn(2),
        Self::Ratio,
        Self::Coupling,
        Self::Sine,
        Self::Cosine,
        Self::BendFirst,
        Self::BendSecond,
        Self::Elasticity,
        Self::Backlash,
    ];

    /// Its place in [`ALL`](Self::ALL).
    pub fn index(self) -> usize {
        Self::ALL.iter().position(|q| *q == self).unwrap_or(0)
    }

    /// Its key in `[kinematics.JOINT]` and in JSON.
    pub fn key(self) -> &'static str {
        const KEYS: [&str; 14] = [
            "dx", "dy", "dz", "rx", "ry", "rz", "ratio", "coupling", "sin", "cos", "bend_1",
            "bend_2", "1/k", "gap",
        ];
        KEYS[self.index()]
    }

    /// Its SI unit at a joint that turns or slides.
    pub fn unit(self, slides: bool) -> &'static str {
        match self {
            Self::Shift(_) => "m",
            Self::Turn(_) => "rad",
            Self::Ratio | Self::Coupling => "1",
            Self::Sine | Self::Cosine | Self::Backlash if slides => "m",
            Self::Sine | Self::Cosine | Self::Backlash => "rad",
            Self::Elasticity if slides => "m/N",
            Self::BendFirst | Self::BendSecond | Self::Elasticity => "rad/(N m)",
        }
    }

    /// The key of what damps it in `[kinematics.JOINT]`, N m s/rad, if it is a spring.
    pub fn damping_key(self) -> Option<&'static str> {
        match self {
            Self::Elasticity => Some("d"),
            Self::BendFirst => Some("bend_1_d"),
            Self::BendSecond => Some("bend_2_d"),
            _ => None,
        }
    }

    /// Whether others than poses measure it.
    pub(crate) fn has_witnesses(self) -> bool {
        self.is_bend() || self.effect().is_some()
    }

    /// Whether it is of a link or bearing that bends.
    pub(crate) fn is_bend(self) -> bool {
        matches!(self, Self::BendFirst | Self::BendSecond)
    }

    /// The effect of the catalogue that has this number, where one has.
    pub(crate) fn effect(self) -> Option<EffectKind> {
        match self {
            Self::Elasticity => catalogue::effect_named("elasticity"),
            Self::Backlash => catalogue::effect_named("backlash"),
            _ => None,
        }
    }
}

/// Where something is fixed: a place and a rotation, each with standard deviations if known.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Place, m.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw, rad.
    pub rpy: [f64; 3],
    /// Standard deviations of the place, m.
    pub xyz_std: Option<[f64; 3]>,
    /// Standard deviations about the fixture's own axes, rad.
    pub rpy_std: Option<[f64; 3]>,
}

impl Fixture {
    /// As a transform: its frame in that of what carries it.
    pub fn transform(&self) -> Transform<f64> {
        let [r, p, y] = self.rpy;
        Transform {
            rotation: *Rotation3::from_euler_angles(r, p, y).matrix(),
            translation: Vector3::from(self.xyz),
        }
    }

    /// Of a transform.
    pub fn new(at: &Transform<f64>, xyz_std: Option<[f64; 3]>, rpy_std: Option<[f64; 3]>) -> Self {
        let (r, p, y) = Rotation3::from_matrix_unchecked(at.rotation).euler_angles();
        let rounded = |x: [f64; 3]| x.map(super::rounded);
        Self {
            xyz: rounded(at.translation.into()),
            rpy: rounded([r, p, y]),
            xyz_std: xyz_std.map(rounded),
            rpy_std: rpy_std.map(rounded),
        }
    }

    /// Whether all numbers are finite and deviations not negative.
    pub(super) fn is_possible(&self) -> bool {
        let stds = self.xyz_std.iter().chain(&self.rpy_std).flatten();
        self.xyz.iter().chain(&self.rpy).all(|x| x.is_finite())
            && stds.into_iter().all(|x| x.is_finite() && *x >= 0.0)
    }
}

/// A measured target that is fixed to a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// Its name in pose files: `x/NAME`.
    pub name: String,
    /// The link that carries it.
    pub link: String,
    /// Where, in the link's frame; of a target whose orientation is not measured the rotation is zero.
    pub fixture: Fixture,
}

/// What calibration knows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Kinematics {
    /// The robot's base in the measuring system's frame.
    pub mount: Option<Fixture>,
    /// Targets.
    pub tools: Vec<Tool>,
    /// Corrections, by joint.
    pub(super) corrections: Vec<Correction>,
    /// What damps springs and bends, N m s/rad, by joint and spring.
    pub(super) dampers: Vec<(usize, JointQuantity, Estimate)>,
}

/// A number of a joint that is no effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Correction {
    pub(super) joint: usize,
    pub(super) quantity: JointQuantity,
    pub(super) estimate: Estimate,
    /// What each of [`Witness::ALL`] measured of it, where it was not poses alone.
    pub(super) witnesses: [Option<Estimate>; 3],
}

impl Model {
    /// What calibration knows of the robot.
    pub fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// States where the measuring system and the targets are.
    pub fn set_fixtures(&mut self, mount: Option<Fixture>, tools: Vec<Tool>) {
        self.kinematics.mount = mount;
        self.kinematics.tools = tools;
    }

    /// What is known of a quantity at a joint.
    pub fn joint_quantity(&self, joint: usize, quantity: JointQuantity) -> Option<Estimate> {
        if let Some(effect) = quantity.effect() {
            return self.effect(effect, joint)?.estimate();
        }
        Some(self.correction(joint, quantity)?.estimate)
    }

    /// The entry of a quantity that is no effect.
    pub(super) fn correction(&self, joint: usize, quantity: JointQuantity) -> Option<&Correction> {
        let mut all = self.kinematics.corrections.iter();
        all.find(|own| (own.joint, own.quantity) == (joint, quantity))
    }

    /// States what a witness measured of a quantity at a joint, rounded as identified values are; of springs and gaps it is combined with what others
    /// measured.
    ///
    /// # Errors
    /// [`Impossible`] if it is not finite or beyond an effect's bounds; then nothing changes.
    pub fn set_joint_quantity(
        &mut self,
        joint: usize,
        quantity: JointQuantity,
        by: Witness,
        value: f64,
        std: f64,
    ) -> Result<(), Impossible> {
        if let Some(effect) = quantity.effect() {
            return self.set_measured(effect, joint, by, value, std);
        }
        if quantity.is_bend() {
            return self.set_measured_bend((joint, quantity), by, value, std);
        }
        self.place_joint_quantity(joint, quantity, rounded(value, std), [None; 3])
    }

    /// [`set_joint_quantity`](Self::set_joint_quantity) of what is no effect, to the last digit, and what each witness measured of it.
    pub(super) fn place_joint_quantity(
        &mut self,
        joint: usize,
        quantity: JointQuantity,
        estimate: Estimate,
        witnesses: [Option<Estimate>; 3],
    ) -> Result<(), Impossible> {
        possible::finite(quantity.key(), estimate.value)?;
        estimate.std.map(possible::deviation).transpose()?;
        self.place_correction(Correction {
            joint,
            quantity,
            estimate,
            witnesses,
        });
        Ok(())
    }

    /// Puts an entry in place of the one of the same quantity.
    pub(super) fn place_correction(&mut self, correction: Correction) {
        let place = |own: &Correction| (own.joint, own.quantity);
        let all = &mut self.kinematics.corrections;
        all.retain(|own| place(own) != place(&correction));
        all.push(correction);
        all.sort_by_key(place);
    }

    /// The model with a joint's frame moved along these quantities (m, rad) from where it is, to the last digit.
    pub(crate) fn with_frame_moved(&self, joint: usize, by: [(JointQuantity, f64); 3]) -> Self {
        let mut moved = self.clone();
        for (quantity, by) in by.into_iter().filter(|(_, by)| *by != 0.0) {
            let known = self.correction(joint, quantity);
            let value = known.map_or(0.0, |known| known.estimate.value) + by;
            moved.place_correction(Correction {
                joint,
                quantity,
                estimate: Estimate { value, std: None },
                witnesses: [None; 3],
            });
        }
        moved
    }

    /// What damps a spring or bend of a joint, N m s/rad, if responses have measured it.
    pub fn spring_damping(&self, joint: usize, spring: JointQuantity) -> Option<Estimate> {
        let mut all = self.kinematics.dampers.iter();
        let found = all.find(|(j, q, _)| (*j, *q) == (joint, spring));
        found.map(|(_, _, estimate)| *estimate)
    }

    /// States what damps a spring or bend of a joint, N m s/rad, rounded as identified values are.
    ///
    /// # Errors
    /// [`Impossible`] if it is negative or not finite; then nothing changes.
    pub fn set_spring_damping(
        &mut self,
        joint: usize,
        spring: JointQuantity,
        value: f64,
        std: f64,
    ) -> Result<(), Impossible> {
        self.place_spring_damping(joint, spring, rounded(value, std))
    }

    /// [`set_spring_damping`](Self::set_spring_damping) to the last digit.
    pub(super) fn place_spring_damping(
        &mut self,
        joint: usize,
        spring: JointQuantity,
        estimate: Estimate,
    ) -> Result<(), Impossible> {
        let symbol = spring.damping_key().unwrap_or("d");
        possible::not_negative(symbol, estimate.value)?;
        estimate.std.map(possible::deviation).transpose()?;
        let all = &mut self.kinematics.dampers;
        all.retain(|(j, q, _)| (*j, *q) != (joint, spring));
        all.push((joint, spring, estimate));
        all.sort_by_key(|(joint, spring, _)| (*joint, *spring));
        Ok(())
    }

    /// Forgets what an earlier calibration found, but not what others than poses measure too.
    pub fn clear_kinematics(&mut self) {
        let own = std::mem::take(&mut self.kinematics);
        self.kinematics.dampers = own.dampers;
        for correction in own.corrections {
            self.keep_others(correction, Witness::Poses);
        }
    }

    /// The names of the joints whose frames are corrected.
    pub(crate) fn corrected_joints(&self) -> Vec<String> {
        let joints = 0..self.robot.bodies().len();
        joints
            .filter(|&joint| self.frame_correction(joint).is_some())
            .map(|joint| self.joint_name(joint).to_owned())
            .collect()
    }

    /// Where a joint's frame is in its parent's: where the description has it, times what is known of its correction.
    pub fn placement(&self, joint: usize) -> Transform<f64> {
        let described = self.robot.bodies()[joint].placement;
        match self.frame_correction(joint) {
            Some(correction) => described.compose(&correction),
            None => described,
        }
    }

    /// The description's bodies, each where [`placement`](Self::placement) has it.
    pub(crate) fn placed_bodies(&self) -> Vec<Body> {
        let placed = |(joint, body): (usize, &Body)| Body {
            placement: self.placement(joint),
            ..body.clone()
        };
        self.robot.bodies().iter().enumerate().map(placed).collect()
    }

    /// The correction of a joint's frame, in the frame itself: its placement is the description's times this. None where there is none.
    pub fn frame_correction(&self, joint: usize) -> Option<Transform<f64>> {
        let value = |quantity| self.joint_quantity(joint, quantity).map(|e| e.value);
        let three = |of: fn(usize) -> JointQuantity| [0, 1, 2].map(|k| value(of(k)));
        let (shift, turn) = (three(JointQuantity::Shift), three(JointQuantity::Turn));
        let any = shift.iter().chain(&turn).any(Option::is_some);
        let vector = |x: [Option<f64>; 3]| Vector3::from(x.map(Option::unwrap_or_default));
        any.then(|| Transform {
            rotation: *Rotation3::new(vector(turn)).matrix(),
            translation: vector(shift),
        })
    }
}

/// A value and its standard deviation to the digits of identified values.
pub(super) fn rounded(value: f64, std: f64) -> Estimate {
    Estimate {
        value: super::rounded(value),
        std: Some(super::rounded(std)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Robot;

    /// A link that is held turned falls where its corrected frame has it, and one that is not corrected where the description does.
    #[test]
    fn dynamics_are_of_the_corrected_frames() {
        let quantities = [0, 1, 2].map(JointQuantity::Turn);
        let by = quantities.into_iter().zip([0.1, 0.0, -0.2]);
        let by: Vec<_> = by.collect();
        let model = Model::new(Robot::go2()).with_frame_moved(1, by.try_into().unwrap());
        let limb = &model.robot().limbs()[0];
        let placements = model
            .limb_tree::<3>(limb)
            .unwrap()
            .bodies()
            .map(|b| b.placement);
        for (b, placement) in placements.iter().enumerate() {
            let described = model.robot().bodies()[b].placement;
            let turn = match b {
                1 => *Rotation3::new(Vector3::new(0.1, 0.0, -0.2)).matrix(),
                _ => nalgebra::Matrix3::identity(),
            };
            assert_eq!(placement.rotation, described.rotation * turn, "{b}");
            assert_eq!(placement.translation, described.translation, "{b}");
        }
        // Moved once more, it is where both together have it.
        let more = model.with_frame_moved(1, [0, 1, 2].map(|k| (JointQuantity::Turn(k), 0.1)));
        let value = |k| {
            more.joint_quantity(1, JointQuantity::Turn(k))
                .unwrap()
                .value
        };
        assert!((value(0) - 0.2).abs() < 1e-15 && (value(2) + 0.1).abs() < 1e-15);
    }
}

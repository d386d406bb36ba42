//! A robot that walks, as its equations need it: bodies on a free base, feet, IMU; and what is known in units of its own size and weight.
//!
//! Thresholds are those of the board ([`proprio_core::walk::stance`]), which were chosen on a Go2. Of another robot they are so many times as
//! large as it is heavier (forces), has longer legs (heights), or both (torques): 9 % of the weight at a foot worked from 2.5 to 90 kg.

use std::sync::Arc;

use nalgebra::{Matrix4, Vector3};
use proprio_core::effect::EffectKind;
use proprio_core::go2::JOINTS_PER_LEG;
use proprio_core::spatial::Transform;
use proprio_core::tree::GRAVITY;
use proprio_core::walk::stance::{FORCE, HEIGHT};

use super::columns::SENSORS;
use super::error::FreeBaseError;
use super::sensors;
use crate::equation::free_tree::{FreeTree, OF_BASE, Pose};
use crate::model::{Foot, ImuMount, Limb, Model, Robot};

/// What a Go2's equations are multiplied by, so that their noise is alike: moments on the base (1), forces on it (m); joints' torques are as they are.
pub(crate) const SCALE_OF_BASE: [f64; 2] = [0.3, 0.06];
/// The noise of an equation of a Go2 before a fit tells it, N m.
pub(crate) const FIRST_NOISE: f64 = 0.1;
/// Standard deviations of what a Go2's trunk may carry beyond its CAD: mass, kg; first moment about the trunk's centre of mass, kg m; inertia, kg m². A
/// third of the trunk, on its back or under it, a box as large as the trunk.
const LOAD_ON_TRUNK: [f64; 5] = [2.0, 0.3, 0.3, 0.3, 0.05];
/// Damping of the force that a Go2's leg's torques tell, m²: a straight leg's tell nothing of a force along it, and are not asked.
const DAMPING: f64 = 1e-4;
/// The pose in which a Go2's centre of mass is told: as it stands, rad.
const STANDING: [f64; JOINTS_PER_LEG] = [0.0, 0.8, -1.6];

/// A sphere that touches the ground, or a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    /// Its body, counted from the base.
    pub(crate) body: usize,
    /// Its centre in the body's frame, m.
    pub(crate) centre: Vector3<f64>,
    /// m.
    pub(crate) radius: f64,
}

impl Point {
    /// The centre in the base, m.
    pub(super) fn place(&self, pose: &Pose) -> Vector3<f64> {
        let placed = &pose.in_base[self.body];
        placed.rotation * self.centre + placed.translation
    }
}

/// What of a limb touches the ground.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LeggedFoot {
    pub(crate) name: String,
    pub(crate) points: Vec<Point>,
    /// The limb that it is of.
    pub(crate) limb: usize,
    /// Whether its limb's `foot/` column is to be believed.
    pub(crate) sensor: bool,
}

/// Speeds, positions and torques that readings cannot have: 1 rad beyond the stops, twice the rated speed and torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    pub(super) position: [f64; 2],
    pub(super) speed: f64,
    pub(super) torque: f64,
}

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Legged {
    /// The joints'.
    pub(crate) names: Vec<String>,
    /// The joint that carries each, if none but the base does.
    pub(crate) parents: Vec<Option<usize>>,
    pub(crate) limbs: Vec<Limb>,
    /// Of the CAD.
    pub(crate) tree: FreeTree,
    pub(crate) feet: Vec<LeggedFoot>,
    /// The IMU in the base.
    pub(crate) imu: Transform<f64>,
    /// Standard deviations of what sensors get wrong, before any data, as they are stated, and as far as the data do not refute them.
    pub(super) stated_std: [f64; SENSORS],
    pub(crate) sensor_std: [f64; SENSORS],
    /// What the equations are multiplied by.
    pub(crate) scale: Vec<f64>,
    /// Of the CAD, N.
    pub(super) weight: f64,
    /// The least force at a foot that torques tell from friction and the CAD's errors, N.
    pub(super) least_force: f64,
    /// A foot that is so much higher than those that carry a force is in the air, m.
    pub(super) least_height: f64,
    /// m².
    pub(super) damping: f64,
    /// N m.
    pub(crate) first_noise: f64,
    pub(super) load_on_trunk: [f64; 5],
    /// Rotors' inertias at the joints, as they are expected, kg m².
    pub(super) armature: Vec<f64>,
    pub(super) limits: Vec<Limits>,
    /// Motor turns per joint turn; one of a motor that is not known.
    pub(crate) gears: Vec<f64>,
    /// Rad or m: where the whole robot's centre of mass is told.
    pub(crate) standing: Vec<f64>,
    /// What a user should know about what was not stated.
    pub(super) notes: Vec<String>,
    pub(crate) is_go2: bool,
}

impl Legged {
    /// The robot of a model, its bodies as the CAD has them.
    ///
    /// # Errors
    /// [`FreeBaseError::NoFeet`], [`FreeBaseError::Facts`].
    pub(crate) fn of(model: &Model) -> Result<Arc<Self>, FreeBaseError> {
        let robot = model.robot();
        let limbs = robot.limbs();
        let feet = model.feet();
        if feet.is_empty() {
            return Err(FreeBaseError::NoFeet {
                robot: robot.name().to_owned(),
            });
        }
        let imu = model.imu();
        let of = |foot: &Foot| placed(robot, &limbs, foot);
        let placed: Vec<LeggedFoot> = feet.iter().map(of).collect::<Result<_, _>>()?;
        let tree = FreeTree::new(*robot.base_inertia(), &model.placed_bodies());
        let known = Robot::go2();
        let known_tree = FreeTree::new(*known.base_inertia(), known.bodies());
        let known_limbs = known.limbs();
        let known_feet: Vec<LeggedFoot> = (Model::default().feet().iter())
            .filter_map(|foot| self::placed(&known, &known_limbs, foot).ok())
            .collect();
        let heavier = tree.mass() / known_tree.mass();
        let longer = reach(&tree, &placed) / reach(&known_tree, &known_feet);
        let is_go2 = robot.is_go2();
        let joints = robot.bodies().len();
        let [moment, force] = SCALE_OF_BASE;
        let scale = |c: usize| match c {
            0..3 => moment,
            3..OF_BASE => force * longer,
            _ => 1.0,
        };
        let mut sensor_std = sensors::STD;
        sensor_std[sensors::MOUNTING..][..3].fill(imu.turn_std);
        sensor_std[sensors::PLACE..][..3].fill(imu.place_std);
        sensor_std[sensors::RADIUS] = feet.iter().map(|foot| foot.radius_std).fold(0.0, f64::max);
        let armature = |joint: usize| {
            let own = model.effect(EffectKind::Armature, joint);
            let stated = own.and_then(|own| own.estimate()).map(|own| own.value);
            let motor = robot.bodies()[joint].motor;
            let of_motor = motor.map(|motor| motor.gear * motor.gear * motor.rotor_inertia);
            stated.or(of_motor).unwrap_or(0.0)
        };
        let limits = robot.bodies().iter().map(|body| Limits {
            position: [body.limits[0] - 1.0, body.limits[1] + 1.0],
            speed: 2.0 * body.velocity,
            torque: 2.0 * body.effort,
        });
        let standing = |joint: usize| match is_go2 {
            true => STANDING[place_in_limb(&limbs, joint) % JOINTS_PER_LEG],
            false => {
                let [lower, upper] = robot.bodies()[joint].limits;
                0f64.max(lower).min(upper)
            }
        };
        let [m, h, inertia] = [heavier, heavier * longer, heavier * longer * longer];
        let load = [m, h, h, h, inertia];
        Ok(Arc::new(Self {
            names: robot
                .bodies()
                .iter()
                .map(|body| body.name.clone())
                .collect(),
            parents: robot.bodies().iter().map(|body| body.parent).collect(),
            imu: in_base(robot, &imu)?,
            scale: (0..OF_BASE + joints).map(scale).collect(),
            weight: GRAVITY * tree.mass(),
            least_force: FORCE * heavier,
            least_height: HEIGHT * longer,
            damping: DAMPING * longer * longer,
            first_noise: FIRST_NOISE * heavier * longer,
            load_on_trunk: std::array::from_fn(|n| LOAD_ON_TRUNK[n] * load[n]),
            armature: (0..joints).map(armature).collect(),
            limits: limits.collect(),
            gears: (robot.bodies().iter())
                .map(|body| body.motor.map_or(1.0, |motor| motor.gear))
                .collect(),
            standing: (0..joints).map(standing).collect(),
            notes: notes(model, &feet, &imu, is_go2),
            feet: placed,
            tree,
            limbs,
            stated_std: sensor_std,
            sensor_std,
            is_go2,
        }))
    }

    /// How many joints there are.
    pub(crate) fn joints(&self) -> usize {
        self.names.len()
    }

    /// How many bodies, the base's among them.
    pub(crate) fn bodies(&self) -> usize {
        self.names.len() + 1
    }

    /// How many velocity coordinates.
    pub(crate) fn coordinates(&self) -> usize {
        self.scale.len()
    }

    /// The limb that a joint is of.
    pub(crate) fn limb_of(&self, joint: usize) -> usize {
        let own = self
            .limbs
            .iter()
            .position(|limb| limb.bodies.contains(&joint));
        own.unwrap_or(0)
    }

    /// A number that joints have in common which are at one place of limbs of one length; less than there are joints.
    pub(crate) fn kind(&self, joint: usize) -> usize {
        let own = &self.limbs[self.limb_of(joint)].bodies;
        let alike = self.limbs.iter().map(|limb| &limb.bodies);
        let first = alike.into_iter().find(|other| other.len() == own.len());
        first.map_or(joint, |first| first.start + joint - own.start)
    }

    /// Whether a joint moves what another one does, and is that one or carries it.
    pub(crate) fn carries(&self, joint: usize, other: usize) -> bool {
        self.tree.subtree(joint + 1).contains(&(other + 1))
    }

    /// Whether any foot of a joint's limb is among the loaded ones.
    pub(crate) fn limb_is_loaded(&self, joint: usize, loaded: &[bool]) -> bool {
        let limb = self.limb_of(joint);
        let own = self.feet.iter().zip(loaded);
        own.into_iter()
            .any(|(foot, loaded)| *loaded && foot.limb == limb)
    }

    /// By body, what its mass and first moment about its own origin are of the whole robot's about the base's, as it stands.
    pub(crate) fn shares_of_total(&self) -> Vec<Matrix4<f64>> {
        let mut pose = Pose::default();
        self.tree.place(&self.standing, &mut pose);
        let share = |placed: &Transform<f64>| {
            let mut share = Matrix4::identity();
            share
                .fixed_view_mut::<3, 1>(1, 0)
                .copy_from(&placed.translation);
            share
                .fixed_view_mut::<3, 3>(1, 1)
                .copy_from(&placed.rotation);
            share
        };
        pose.in_base.iter().map(share).collect()
    }

    /// A joint's name; `base` of what is none.
    pub(crate) fn name(&self, joint: usize) -> &str {
        self.names.get(joint).map_or("base", String::as_str)
    }

    /// What equations are multiplied by: nothing where a joint may rest.
    pub(super) fn scale_beside(&self, resting: &[bool]) -> Vec<f64> {
        let mut scale = self.scale.clone();
        for (own, _) in scale[OF_BASE..]
            .iter_mut()
            .zip(resting)
            .filter(|(_, r)| **r)
        {
            *own = 0.0;
        }
        scale
    }

    /// What touches the ground of the feet that may carry a force, with spheres so much larger, m.
    pub(super) fn points(&self, loaded: &[bool], larger: f64) -> Vec<Point> {
        let own = self.feet.iter().zip(loaded).filter(|(_, loaded)| **loaded);
        let all = own.flat_map(|(foot, _)| &foot.points);
        all.map(|point| Point {
            radius: point.radius + larger,
            ..*point
        })
        .collect()
    }
}

fn place_in_limb(limbs: &[Limb], joint: usize) -> usize {
    let own = limbs.iter().find(|limb| limb.bodies.contains(&joint));
    own.map_or(joint, |limb| joint - limb.bodies.start)
}

/// How far the farthest foot is along its leg from the leg's first joint, m.
fn reach(tree: &FreeTree, feet: &[LeggedFoot]) -> f64 {
    let along = |foot: &LeggedFoot| {
        let first = foot.points.first()?;
        let mut length = first.centre.norm();
        let mut body = first.body;
        // What hangs on the base is placed by the trunk's size, not by the leg's.
        while let Some(parent) = tree.bodies()[body].parent.filter(|parent| *parent > 0) {
            length += tree.bodies()[body].placement.translation.norm();
            body = parent;
        }
        Some(length)
    };
    feet.iter()
        .filter_map(along)
        .fold(f64::MIN_POSITIVE, f64::max)
}

fn placed(robot: &Robot, limbs: &[Limb], foot: &Foot) -> Result<LeggedFoot, FreeBaseError> {
    let frame = robot.frame(&foot.link).map_err(FreeBaseError::Facts)?;
    let limb = |body: usize| limbs.iter().position(|limb| limb.bodies.contains(&body));
    let own = frame.body.and_then(|body| Some((body, limb(body)?)));
    let Some((body, limb)) = own else {
        return Err(FreeBaseError::FootOnBase {
            foot: foot.name.clone(),
        });
    };
    let point = |place: &[f64; 3]| Point {
        body: body + 1,
        centre: frame.placement.rotation * Vector3::from(*place) + frame.placement.translation,
        radius: foot.radius,
    };
    Ok(LeggedFoot {
        name: foot.name.clone(),
        points: foot.points.iter().map(point).collect(),
        limb,
        sensor: foot.sensor,
    })
}

fn in_base(robot: &Robot, imu: &ImuMount) -> Result<Transform<f64>, FreeBaseError> {
    let own = || imu.placement();
    // A description without links that are fixed has none of the base's either.
    if robot.frames().is_empty() {
        return Ok(own());
    }
    let frame = robot.frame(&imu.link).map_err(FreeBaseError::Facts)?;
    Ok(frame.placement.compose(&own()))
}

/// What was taken where nothing is stated.
fn notes(model: &Model, feet: &[Foot], imu: &ImuMount, is_go2: bool) -> Vec<String> {
    let mut notes = Vec::new();
    if is_go2 {
        return notes;
    }
    if model.stated_feet().is_empty() {
        let names: Vec<&str> = feet.iter().map(|foot| foot.name.as_str()).collect();
        notes.push(format!(
            "the model states no [[foot]]: {} with a radius of {:.1} ± {:.1} mm are taken from the description",
            names.join(", "),
            1e3 * feet.iter().map(|foot| foot.radius).fold(0.0, f64::max),
            1e3 * feet.iter().map(|foot| foot.radius_std).fold(0.0, f64::max),
        ));
    }
    if model.stated_imu().is_none() {
        notes.push(format!(
            "the model states no [imu]: it is taken to be at the link {}, in its axes, ± {:.0} mm",
            imu.link,
            1e3 * imu.place_std
        ));
    }
    notes
}

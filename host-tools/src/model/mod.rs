//! What is taken to be true of a robot: its bodies, its effects, how sure that is, and where it comes from.
//!
//! A [`Model`] is a [`Robot`] plus what identification found. It lives in one TOML file that is
//! read, reviewed and compared as text, and [`export`] writes it into the files that simulators read.
//!
//! # The file
//!
//! ```toml
//! format = 1
//!
//! [robot]
//! builtin = "go2"                 # or urdf = "robot.urdf", relative to this file
//!
//! [base]
//! mount = "fixed"                 # or "suspended": it recoils from its limbs, by the effect `base_recoil`
//! rpy = [0.0, 0.0, 0.0]           # or quaternion = [w, x, y, z]: the base in the world
//!
//! [held]                          # joints that do not move, with a URDF: rad or m
//! finger = 0.02
//!
//! [log]                           # what messages leave open; columns with names of their own need none of it
//! motors = ["FR_hip"]             # … the joint of motor 0, 1, …
//! at_motor = ["q", "dq", "tau"]   # these are the motor's, before the gear
//!
//! [log.transmission]              # a motor's turns per turn of joints; without, the gear of [motor]
//! FR_thigh = { FR_thigh = 6.333, FR_calf = 0.5 }
//!
//! [prior]
//! cad_uncertainty = 0.1           # relative standard deviation of the CAD's inertias
//! body = { FR_calf = 0.3 }        # the same for one body
//!
//! [prior.effect.coulomb]          # at all joints
//! mean = 0.3
//! std = 1.0
//!
//! [motor.FR_hip]                  # what a URDF cannot state
//! gear = 6.333
//! rotor_inertia = 0.000111842
//!
//! [[foot]]                        # of a robot that walks, where the description does not tell them
//! name = "FR"
//! link = "FR_foot"
//! place = [-0.002, 0.0, 0.0]      # the sphere's centre in the link, m; or points = [[…], …], a flat foot's corners
//! radius = 0.022
//! radius_std = 0.001
//! sensor = true                   # whether `foot/FR` is to be believed
//!
//! [imu]
//! link = "imu"
//! place = [0.0, 0.0, 0.0]         # in the link, m
//! rpy = [0.0, 0.0, 0.0]
//! place_std = 0.01                # m
//! turn_std = 0.05                 # rad
//!
//! [[effect]]
//! name = "coulomb"
//! joint = "FR_hip"
//! value = 0.1461                  # absent until identified, and so is std
//! std = 0.004
//! prior = { mean = 0.15, std = 0.1 }
//!
//! [[mount]]                       # of `proprio calibrate`: the base in the measuring system's frame, m and rad
//! xyz = [1.2, 0.1, 0.4]
//! rpy = [0.0, 0.0, 1.57]
//! xyz_std = [1e-5, 1e-5, 1e-5]    # … and rpy_std; absent where they are not known
//!
//! [[tool]]                        # a measured target
//! name = "ball"                   # `x/ball` in pose files
//! link = "flange"
//! xyz = [0.0, 0.0, 0.12]          # in the link, m; rpy where its orientation is measured
//!
//! [kinematics.A2]                 # corrections of the joint's frame, in the frame itself, and of what moves it
//! dx = { value = 0.0004, std = 0.0001 }   # dy, dz (m), rx, ry, rz (rad), ratio, coupling, sin, cos, bend_1, bend_2
//! d = { value = 4.1, std = 0.1 }  # what damps the joint's spring, N m s/rad; bend_1_d, bend_2_d of links that bend
//!
//! [[effect]]                      # a torque of your own ([`formula`](crate::formula))
//! name = "cable"
//! joint = "FR_calf"
//! torque = "c*(q - q0)*abs(q - q0)"
//! kind = "conservative"           # or dissipative, motor, free
//! c = { unit = "N m/rad^2", prior = [0.0, 5.0], min = 0.0, value = 1.2, std = 0.1 }
//! q0 = { value = 0.3, held = true }   # not identified; without `held` it is sought
//!
//! [body.FR_hip]                   # about the joint frame's origin; a body not listed is the CAD's
//! m = 0.767
//! # … hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz; [body.base] is the base, about its own origin
//! std = { m = 0.01 }              # … all ten
//!
//! [total]                         # all bodies together, of a robot that walks: its scales know that better than each body
//! std = { m = 0.004, x = 2e-4, y = 1e-4, z = 3e-4 }   # mass, kg, and centre of mass as it stands, m
//!
//! [provenance]
//! version = "0.1.0"
//! command = "proprio identify leg.csv"
//!
//! [[provenance.log]]
//! path = "leg.csv"
//! sha256 = "…"
//! ```
//!
//! Files beside:
//!
//! - `asked`: effects as users ask for them, a formula among them
//! - `bends`: the same robot with joints that no motor drives, where links bend
//! - `conventions`: how a robot's logs speak of its joints, where their columns do not say so themselves
//! - `error`: why a model file, or a robot's description, is refused
//! - `kinematics`: what calibration knows: the measuring system, the targets, corrections of joint frames
//! - `legged`: feet and IMU of a robot that walks
//! - `limb`: a limb of a model as the core takes it: tree, columns, prior, parameters
//! - `physical`: which inertial parameters a body can have, and what is wrong with those it cannot
//! - `possible`: values that a model may hold
//! - `priors`: what an effect's parameters are taken to be before any data, at a joint of any robot: zero, within what the joint's limits
//!   and the robot's own size leave room for
//! - `rounding`: numbers to so many significant digits
//! - `witness`: one number by poses, by frequency responses and by motion: combined, or contradicting each other

mod asked;
mod bends;
mod conventions;
mod effects;
mod error;
pub mod export;
mod file;
mod kinematics;
mod legged;
mod limb;
mod physical;
mod possible;
mod priors;
mod provenance;
mod robot;
mod rounding;
mod urdf;
mod witness;

use std::path::{Path, PathBuf};

use nalgebra::{Quaternion, Rotation3, UnitQuaternion, Vector3};
use proprio_core::effect::{EffectKind, Prior};
use proprio_core::estimator::CAD_UNCERTAINTY;
use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::spatial::Transform;

pub use crate::name::UnknownName;
use crate::parameter;
pub use asked::{AskedError, asked_texts};
pub(crate) use bends::across;
pub use effects::{BASE, ModelEffect};
pub use error::{ModelError, ModelProblem, RobotError, RobotProblem};
pub use kinematics::{Fixture, JointQuantity, Kinematics, Tool};
pub(crate) use kinematics::{LINK_ELASTICITY, LINK_GEOMETRY};
pub use legged::{Foot, ImuMount};
pub use limb::ModelParameter;
pub(crate) use physical::other_unit;
pub use physical::{Unphysical, about_com};
pub use possible::Impossible;
use possible::{deviation, positive};
pub use provenance::{LogRecord, Provenance};
pub use robot::{Body, Frame, JointKind, Limb, LogConventions, Motor, Robot, Source};
use rounding::rounded;
pub(crate) use rounding::significant;
pub use witness::{Measured, Witness, Witnessed};

use crate::output::{self, WriteError};

/// A robot and what is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    robot: Robot,
    mounting: Mounting,
    effects: Vec<ModelEffect>,
    bodies: Vec<ModelBody>,
    base_body: ModelBody,
    total_std: Option<[f64; 4]>,
    cad_uncertainty: f64,
    effect_priors: Vec<(EffectKind, Prior)>,
    motors: Vec<Option<Motor>>,
    feet: Vec<Foot>,
    imu: Option<ImuMount>,
    kinematics: Kinematics,
    provenance: Option<Provenance>,
}

/// How the base frame is turned in the world, whose z axis points up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mounting {
    /// Roll, pitch, yaw about the world's x, y, z axes, rad.
    Rpy([f64; 3]),
    /// Unit quaternion w, x, y, z.
    Quaternion([f64; 4]),
}

/// A value with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard deviation, if known.
    pub std: Option<f64>,
}

/// What the model knows of a body beyond the CAD.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct ModelBody {
    inertia: Option<(InertialParameters<f64>, Option<[f64; INERTIAL]>)>,
    cad_uncertainty: Option<f64>,
}

impl Default for Model {
    /// The Go2's rigid body, pinned and level, and no effect.
    fn default() -> Self {
        Self::new(Robot::go2())
    }
}

impl Model {
    /// A robot's CAD, pinned and level, and no effect.
    pub fn new(robot: Robot) -> Self {
        let bodies = robot.bodies().len();
        Self {
            robot,
            mounting: Mounting::Rpy([0.0; 3]),
            effects: Vec::new(),
            bodies: vec![ModelBody::default(); bodies],
            base_body: ModelBody::default(),
            total_std: None,
            cad_uncertainty: CAD_UNCERTAINTY,
            effect_priors: Vec::new(),
            motors: vec![None; bodies],
            feet: Vec::new(),
            imu: None,
            kinematics: Kinematics::default(),
            provenance: None,
        }
    }

    /// The same robot, with the feet and the IMU that are stated of it, as its CAD has it: no effect, no value.
    pub fn bare(&self) -> Self {
        Self {
            feet: self.feet.clone(),
            imu: self.imu.clone(),
            ..Self::new(self.robot.clone())
        }
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// [`ModelError`] with file, line and what is wrong, in this file or in the URDF it names.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        file::load(path)
    }

    /// Writes the model file, whole or not at all. The same model gives the same bytes.
    ///
    /// # Errors
    /// If it cannot be written; then what was there stays.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        output::write(path, &file::text(self, path))
    }

    /// The model that [`load`](Self::load) gets from what [`save`](Self::save) writes to `path`, also where that is a stream, which
    /// nobody reads twice.
    ///
    /// # Errors
    /// As [`load`](Self::load)'s.
    pub fn read_back(&self, path: &Path) -> Result<Self, ModelError> {
        file::read(&file::text(self, path), path)
    }

    /// The robot as its CAD has it.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Placement of the base in the world, as [`Tree::kinematics`](proprio_core::tree::Tree::kinematics) takes it.
    pub fn base(&self) -> Transform<f64> {
        let rotation = match self.mounting {
            Mounting::Rpy([r, p, y]) => Rotation3::from_euler_angles(r, p, y),
            Mounting::Quaternion([w, x, y, z]) => {
                UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix()
            }
        };
        Transform {
            rotation: *rotation.matrix(),
            translation: Vector3::zeros(),
        }
    }

    /// How the base is mounted.
    pub fn mounting(&self) -> Mounting {
        self.mounting
    }

    /// Mounts the base.
    pub fn set_mounting(&mut self, mounting: Mounting) {
        self.mounting = mounting;
    }

    /// The same, its base mounted as another model's.
    pub fn mounted_as(mut self, other: &Self) -> Self {
        self.mounting = other.mounting;
        self
    }

    /// Name of a joint; `base` for [`BASE`].
    pub fn joint_name(&self, joint: usize) -> &str {
        self.robot
            .bodies()
            .get(joint)
            .map_or("base", |body| &body.name)
    }

    /// The unit of parameter `n` of an effect at a joint, by whether it turns or slides.
    pub(crate) fn unit(&self, effect: EffectKind, joint: usize, n: usize) -> &'static str {
        let body = self.robot.bodies().get(joint);
        match body.is_some_and(|body| body.kind == JointKind::Prismatic) {
            true => parameter::unit_of_slide(effect, n),
            false => effect.description().parameters[n].unit,
        }
    }

    /// What the model has of a body, [`BASE`] or one that a joint moves.
    fn body(&self, body: usize) -> &ModelBody {
        match body {
            BASE => &self.base_body,
            _ => &self.bodies[body],
        }
    }

    /// A body's inertial parameters about its joint frame's origin, or those of the base ([`BASE`]) about its own: identified, or
    /// else the CAD's.
    pub fn inertia(&self, body: usize) -> &InertialParameters<f64> {
        match (&self.body(body).inertia, body) {
            (Some((phi, _)), _) => phi,
            (None, BASE) => self.robot.base_inertia(),
            (None, _) => &self.robot.bodies()[body].inertia,
        }
    }

    /// Whether a body's inertial parameters are the model's own and not the CAD's.
    pub fn is_identified(&self, body: usize) -> bool {
        self.body(body).inertia.is_some()
    }

    /// Whether anything of the model, an effect or a body, has a value of its own.
    pub fn has_values(&self) -> bool {
        self.effects.iter().any(|e| e.estimate().is_some())
            || (0..self.robot.bodies().len()).any(|body| self.is_identified(body))
    }

    /// Standard deviations of a body's inertial parameters, once identified.
    pub fn inertia_std(&self, body: usize) -> Option<&[f64; INERTIAL]> {
        self.body(body)
            .inertia
            .as_ref()
            .and_then(|(_, std)| std.as_ref())
    }

    /// Sets a body's identified inertial parameters, rounded to twelve significant digits: the file is for reading, and
    /// predicts what was fitted.
    ///
    /// # Errors
    /// [`Impossible`] if no body has them; then nothing changes.
    pub fn set_body(
        &mut self,
        body: usize,
        phi: &InertialParameters<f64>,
        std: Option<&[f64; INERTIAL]>,
    ) -> Result<(), Impossible> {
        let phi = InertialParameters(phi.0.map(rounded));
        self.place_body(body, phi, std.map(|std| std.map(rounded)))?;
        // Another body makes another total, of which nothing is known.
        self.total_std = None;
        Ok(())
    }

    /// Standard deviations of the whole robot's mass, kg, and of its centre of mass as it stands (x, y, z in the base, m), once it has walked: of the sum,
    /// which is known better than its bodies are.
    pub fn total_std(&self) -> Option<&[f64; 4]> {
        self.total_std.as_ref()
    }

    /// States them of the bodies as they are; a body that is set later takes them away.
    ///
    /// # Errors
    /// [`Impossible`] if one is negative or not finite; then nothing changes.
    pub fn set_total_std(&mut self, std: [f64; 4]) -> Result<(), Impossible> {
        std.iter().try_for_each(|&x| deviation(x).map(drop))?;
        self.total_std = Some(std.map(rounded));
        Ok(())
    }

    /// [`set_body`](Self::set_body) to the last digit.
    fn place_body(
        &mut self,
        body: usize,
        phi: InertialParameters<f64>,
        std: Option<[f64; INERTIAL]>,
    ) -> Result<(), Impossible> {
        if let Some(fault) = Unphysical::of(&phi) {
            return Err(fault.into());
        }
        std.iter()
            .flatten()
            .try_for_each(|&x| deviation(x).map(drop))?;
        let own = match body {
            BASE => &mut self.base_body,
            _ => &mut self.bodies[body],
        };
        own.inertia = Some((phi, std));
        Ok(())
    }

    /// Relative standard deviation of a body's CAD inertia, as [`InertialParameters::prior`] takes it.
    pub fn cad_uncertainty(&self, body: usize) -> f64 {
        self.bodies[body]
            .cad_uncertainty
            .unwrap_or(self.cad_uncertainty)
    }

    /// Sets the relative standard deviation of one body's CAD inertia, or (`None`) of all bodies'.
    ///
    /// # Errors
    /// [`Impossible`] if it is not positive.
    pub fn set_cad_uncertainty(
        &mut self,
        body: Option<usize>,
        relative: f64,
    ) -> Result<(), Impossible> {
        positive(relative)?;
        match body {
            Some(body) => self.bodies[body].cad_uncertainty = Some(relative),
            None => self.cad_uncertainty = relative,
        }
        Ok(())
    }

    /// States a joint's motor, from which the prior of its armature follows.
    pub fn set_motor(&mut self, joint: usize, motor: Motor) {
        self.motors[joint] = Some(motor);
        self.robot.set_motor(joint, Some(motor));
    }

    /// Whether its values are those of these very logs (by what is in them, SHA-256), judged under the same conditions `only`; no where one
    /// cannot be read.
    pub fn is_of(&self, logs: &[PathBuf], only: &[String]) -> bool {
        let own = |provenance: &Provenance| provenance.is_of(logs, only).unwrap_or(false);
        self.provenance().is_some_and(own)
    }

    /// Where the values come from, if they were identified.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.provenance.as_ref()
    }

    /// States where the values come from.
    pub fn set_provenance(&mut self, provenance: Provenance) {
        self.provenance = Some(provenance);
    }
}

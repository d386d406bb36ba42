//! What a robot that walks has beside bodies and joints: feet and an IMU, each fixed to a link.
//!
//! A model file states them (`[[foot]]`, `[imu]`). What it does not state the description tells: a foot is a link of that name fixed to a
//! limb's last body, its sphere that of its collision; the IMU is a link of that name fixed to the base.

use nalgebra::{Rotation3, Vector3};
use proprio_core::go2;
use proprio_core::spatial::Transform;

use super::robot::{Frame, Robot};
use super::{Impossible, Model, UnknownName};

/// Radius of a foot of which nothing is stated, m, and its standard deviation: from a Solo12's 16 mm to an ANYmal's 31.
const ANY_RADIUS: [f64; 2] = [0.022, 0.01];
/// Rubber and ground give way by a millimetre or two, and the force acts in between, m.
const RADIUS_STD: f64 = 0.001;
/// Where drawings have an IMU, m: its chip lies somewhere in its case.
const PLACE_STD: f64 = 0.01;
/// The same of a Go2, m: the maker's URDF states the chip's place to a hundredth of a millimetre, and what senses lies within half a one of its middle.
const GO2_PLACE_STD: f64 = 5e-4;
/// A board is mounted by hand within three degrees, rad.
const TURN_STD: f64 = 0.05;
/// How far an IMU of which nothing is stated may be from the base's origin, m: somewhere in a trunk.
const ANY_PLACE_STD: f64 = 0.1;

/// A foot: what of a link touches the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct Foot {
    /// Its name in results.
    pub name: String,
    /// The link that it is fixed to.
    pub link: String,
    /// Centres of the spheres that touch the ground, in the link's frame, m: one, or the corners of a flat foot.
    pub points: Vec<[f64; 3]>,
    /// Radius of the spheres, m; zero of corners.
    pub radius: f64,
    /// Its standard deviation before any data, m.
    pub radius_std: f64,
    /// Whether logs' `foot/` column of its limb is to be believed.
    pub sensor: bool,
}

/// An IMU.
#[derive(Debug, Clone, PartialEq)]
pub struct ImuMount {
    /// The link that it is fixed to, itself fixed to the base.
    pub link: String,
    /// Where it is in the link's frame, m.
    pub place: [f64; 3],
    /// How its axes are turned there: roll, pitch, yaw about the link's x, y, z axes, rad.
    pub rpy: [f64; 3],
    /// Standard deviation of each coordinate of the place before any data, m.
    pub place_std: f64,
    /// Standard deviation of the turn about each axis, rad.
    pub turn_std: f64,
}

impl Foot {
    /// A foot on a link, with what is usual: its origin alone touches the ground.
    pub fn on(name: &str, link: &str) -> Self {
        Self {
            name: name.to_owned(),
            link: link.to_owned(),
            points: vec![[0.0; 3]],
            radius: 0.0,
            radius_std: RADIUS_STD,
            sensor: true,
        }
    }

    fn check(&self) -> Result<(), Impossible> {
        let bounded = |symbol, value: f64, lower: f64, upper: f64| {
            if value.is_finite() && value >= lower && value <= upper {
                Ok(())
            } else {
                Err(Impossible::Bounds {
                    symbol,
                    value,
                    lower,
                    upper,
                })
            }
        };
        bounded("radius", self.radius, 0.0, f64::INFINITY)?;
        bounded(
            "radius_std",
            self.radius_std,
            f64::MIN_POSITIVE,
            f64::INFINITY,
        )?;
        bounded("points", self.points.len() as f64, 1.0, f64::INFINITY)?;
        let numbers = self.points.iter().flatten();
        numbers
            .copied()
            .try_for_each(|x| bounded("points", x, f64::MIN, f64::MAX))
    }
}

impl ImuMount {
    /// An IMU at the origin of a link, in its axes.
    pub fn on(link: &str) -> Self {
        Self {
            link: link.to_owned(),
            place: [0.0; 3],
            rpy: [0.0; 3],
            place_std: PLACE_STD,
            turn_std: TURN_STD,
        }
    }

    /// In the link.
    pub fn placement(&self) -> Transform<f64> {
        let [r, p, y] = self.rpy;
        Transform {
            rotation: *Rotation3::from_euler_angles(r, p, y).matrix(),
            translation: Vector3::from(self.place),
        }
    }
}

impl Model {
    /// The feet that the file states.
    pub fn stated_feet(&self) -> &[Foot] {
        &self.feet
    }

    /// The IMU that the file states.
    pub fn stated_imu(&self) -> Option<&ImuMount> {
        self.imu.as_ref()
    }

    /// States a foot.
    ///
    /// # Errors
    /// [`Impossible`] if its numbers cannot be.
    pub fn add_foot(&mut self, foot: Foot) -> Result<(), Impossible> {
        foot.check()?;
        self.feet.push(foot);
        Ok(())
    }

    /// States the IMU.
    pub fn set_imu(&mut self, imu: ImuMount) {
        self.imu = Some(imu);
    }

    /// The feet, stated or as the description has them.
    pub fn feet(&self) -> Vec<Foot> {
        match self.feet.as_slice() {
            [] => self.robot.own_feet(),
            stated => stated.to_vec(),
        }
    }

    /// The IMU, stated or as the description has it.
    pub fn imu(&self) -> ImuMount {
        self.imu.clone().unwrap_or_else(|| self.robot.own_imu())
    }
}

impl Robot {
    /// A link's place: the body that it is or is fixed to, and where in it.
    ///
    /// # Errors
    /// If no link has this name.
    pub fn frame(&self, link: &str) -> Result<&Frame, UnknownName> {
        let frames = self.frames();
        let found = frames.iter().find(|frame| frame.link == link);
        found.ok_or_else(|| {
            UnknownName::new("link", link, frames.iter().map(|frame| frame.link.as_str()))
        })
    }

    /// A limb's name is its foot's.
    fn own_feet(&self) -> Vec<Foot> {
        let last = |limb: &super::Limb| limb.bodies.end - 1;
        let of = |limb: &super::Limb| {
            let called = |frame: &&Frame| {
                frame.body == Some(last(limb)) && frame.link.to_lowercase().contains("foot")
            };
            let frame = self.frames().iter().rfind(called)?;
            let plain = Foot::on(&limb.name, &frame.link);
            Some(match frame.sphere {
                Some((centre, radius)) => Foot {
                    points: vec![centre.into()],
                    radius,
                    ..plain
                },
                None if self.is_go2() => {
                    let (centre, radius) = go2::FOOT_SPHERE;
                    Foot {
                        points: vec![(Vector3::from(centre) - Vector3::from(go2::FOOT)).into()],
                        radius,
                        ..plain
                    }
                }
                None => Foot {
                    radius: ANY_RADIUS[0],
                    radius_std: ANY_RADIUS[1],
                    ..plain
                },
            })
        };
        self.limbs().iter().filter_map(of).collect()
    }

    fn own_imu(&self) -> ImuMount {
        let called =
            |frame: &&Frame| frame.body.is_none() && frame.link.to_lowercase().contains("imu");
        match self.frames().iter().find(called) {
            Some(frame) if self.is_go2() => ImuMount {
                place_std: GO2_PLACE_STD,
                ..ImuMount::on(&frame.link)
            },
            Some(frame) => ImuMount::on(&frame.link),
            None if self.is_go2() => ImuMount {
                place: go2::IMU,
                place_std: GO2_PLACE_STD,
                ..ImuMount::on(self.base_link())
            },
            None => ImuMount {
                place_std: ANY_PLACE_STD,
                ..ImuMount::on(self.base_link())
            },
        }
    }
}

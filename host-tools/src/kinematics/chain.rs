//! Where everything is: forward kinematics of the whole tree with corrected frames, and what gravity does at each joint.
//!
//! Joint frame j stands in its parent's at P_j T(δ_j): the description's placement, then the correction, six numbers in the joint frame
//! itself (Hollerbach, Khalil & Gautier 2016, *Model Identification*, Springer Handbook of Robotics ch. 6; six numbers have no singular
//! arrangement, unlike Denavit-Hartenberg's four where axes are parallel: Mooring, Roth & Driels 1991, *Fundamentals of Manipulator
//! Calibration*). What gravity does deflects joints and links in proportion to its moment (Zimmermann & Moberg; elastostatics of
//! Khalil & Besnard 2002): a first pass finds the moments, a second one adds the deflections.

use nalgebra::{Rotation3, Vector3};
use proprio_core::spatial::Transform;
use proprio_core::tree::GRAVITY;

use super::poses::Pose;
use crate::model::{Fixture, JointKind, JointQuantity, Model, Witness, across};

/// How many numbers calibration knows of a joint.
pub(super) const QUANTITIES: usize = JointQuantity::ALL.len();

/// A link and the joint that moves it.
#[derive(Debug, Clone)]
struct Link {
    parent: Option<usize>,
    placement: Transform<f64>,
    axis: Vector3<f64>,
    /// Unit vectors across the axis.
    across: [Vector3<f64>; 2],
    slides: bool,
    mass: f64,
    /// First moment about the joint frame's origin, kg m.
    moment: Vector3<f64>,
}

/// The robot as calibration sees it.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    links: Vec<Link>,
    /// Gravity in the base's frame, m/s².
    gravity: Vector3<f64>,
}

/// A target: the body that carries it, and where it is there.
#[derive(Debug, Clone)]
pub(super) struct Target {
    /// None is the base.
    pub(super) body: Option<usize>,
    /// In the body's joint frame.
    pub(super) placement: Transform<f64>,
}

/// All that calibration estimates.
#[derive(Debug, Clone)]
pub(super) struct State {
    /// The base in the measuring system's frame.
    pub(super) mount: Transform<f64>,
    /// The targets.
    pub(super) targets: Vec<Target>,
    /// By joint and [`JointQuantity::index`].
    pub(super) joints: Vec<[f64; QUANTITIES]>,
}

/// Where everything is at a pose, in the base's frame.
#[derive(Debug, Clone)]
pub(super) struct Frames {
    /// Joint frames before the joint turns.
    pub(super) joint: Vec<Transform<f64>>,
    /// Links.
    pub(super) link: Vec<Transform<f64>>,
    /// Moment (N m) that gravity makes about the joint frame's origin on all that the joint carries; of a sliding joint the force (N).
    pub(super) load: Vec<Vector3<f64>>,
}

/// A small rotation vector and displacement as a transform.
pub(super) fn small(shift: Vector3<f64>, turn: Vector3<f64>) -> Transform<f64> {
    Transform {
        rotation: *Rotation3::new(turn).matrix(),
        translation: shift,
    }
}

/// Where a child's frame sees its parent.
pub(super) fn inverse(t: &Transform<f64>) -> Transform<f64> {
    Transform {
        rotation: t.rotation.transpose(),
        translation: -t.rotation.tr_mul(&t.translation),
    }
}

/// Where a point of the child is in the parent.
pub(super) fn point(t: &Transform<f64>, p: &Vector3<f64>) -> Vector3<f64> {
    t.rotation * p + t.translation
}

impl Chain {
    /// The model's robot: its description's frames, its own masses, its base's attitude.
    pub(super) fn new(model: &Model) -> Self {
        let bodies = model.robot().bodies().iter().enumerate();
        let links = bodies.map(|(b, body)| {
            let phi = model.inertia(b).0;
            Link {
                parent: body.parent,
                placement: body.placement,
                axis: body.axis,
                across: across(&body.axis),
                slides: body.kind == JointKind::Prismatic,
                mass: phi[0],
                moment: Vector3::new(phi[1], phi[2], phi[3]),
            }
        });
        Self {
            links: links.collect(),
            gravity: model
                .base()
                .rotation
                .tr_mul(&Vector3::new(0.0, 0.0, -GRAVITY)),
        }
    }

    /// How many joints there are.
    pub(super) fn joints(&self) -> usize {
        self.links.len()
    }

    /// Whether a joint slides.
    pub(super) fn slides(&self, joint: usize) -> bool {
        self.links[joint].slides
    }

    /// The lengths of all links between the base and a body, m: how far its frame can be from the base without what slides.
    pub(super) fn reach(&self, body: Option<usize>) -> f64 {
        let path = self.path(body).into_iter();
        path.map(|joint| self.links[joint].placement.translation.norm())
            .sum()
    }

    /// The joint that carries another.
    pub(super) fn parent(&self, joint: usize) -> Option<usize> {
        self.links[joint].parent
    }

    /// A joint's axis and the two across it, in its own frame.
    pub(super) fn directions(&self, joint: usize) -> [Vector3<f64>; 3] {
        let link = &self.links[joint];
        [link.axis, link.across[0], link.across[1]]
    }

    /// The joints between the base and a body, nearest the base first.
    pub(super) fn path(&self, body: Option<usize>) -> Vec<usize> {
        let mut path: Vec<usize> =
            std::iter::successors(body, |&joint| self.links[joint].parent).collect();
        path.reverse();
        path
    }

    /// Where everything is.
    pub(super) fn frames(&self, state: &State, pose: &Pose) -> Frames {
        let elastic = [
            JointQuantity::Elasticity,
            JointQuantity::BendFirst,
            JointQuantity::BendSecond,
        ];
        let mut frames = self.placed(state, pose, None);
        frames.load = self.loads(state, pose, &frames);
        let deflects =
            |values: &[f64; QUANTITIES]| elastic.iter().any(|q| values[q.index()] != 0.0);
        if state.joints.iter().any(deflects) {
            let load = std::mem::take(&mut frames.load);
            frames = self.placed(state, pose, Some(&load));
            frames.load = load;
        }
        frames
    }

    /// Frames, deflected by these loads.
    fn placed(&self, state: &State, pose: &Pose, loads: Option<&[Vector3<f64>]>) -> Frames {
        let count = self.links.len();
        let mut frames = Frames {
            joint: Vec::with_capacity(count),
            link: Vec::with_capacity(count),
            load: Vec::new(),
        };
        for (j, link) in self.links.iter().enumerate() {
            let values = &state.joints[j];
            let value = |quantity: JointQuantity| values[quantity.index()];
            let mut frame = match link.parent {
                Some(parent) => frames.link[parent].compose(&link.placement),
                None => link.placement,
            };
            if values[..6].iter().any(|x| *x != 0.0) {
                let shift = Vector3::new(values[0], values[1], values[2]);
                let turn = Vector3::new(values[3], values[4], values[5]);
                frame = frame.compose(&small(shift, turn));
            }
            let q = pose.q[j];
            let carried = link.parent.map_or(0.0, |parent| pose.q[parent]);
            let mut moved = q * (1.0 + value(JointQuantity::Ratio))
                + value(JointQuantity::Coupling) * carried
                + value(JointQuantity::Sine) * q.sin()
                + value(JointQuantity::Cosine) * q.cos()
                + value(JointQuantity::Backlash) / 2.0 * pose.side[j];
            if let Some(load) = loads.map(|loads| loads[j]) {
                moved += value(JointQuantity::Elasticity) * load.dot(&link.axis);
                let bend = [JointQuantity::BendFirst, JointQuantity::BendSecond].map(value);
                if !link.slides && bend != [0.0; 2] {
                    let [a, b] = link.across;
                    let turn = a * (bend[0] * load.dot(&a)) + b * (bend[1] * load.dot(&b));
                    frame = frame.compose(&small(Vector3::zeros(), turn));
                }
            }
            let motion = if link.slides {
                Transform::from_translation(link.axis * moved)
            } else {
                small(Vector3::zeros(), link.axis * moved)
            };
            frames.link.push(frame.compose(&motion));
            frames.joint.push(frame);
        }
        frames
    }

    /// What gravity does at each joint, in the joint's frame. A payload hangs at the first target.
    fn loads(&self, state: &State, pose: &Pose, frames: &Frames) -> Vec<Vector3<f64>> {
        let count = self.links.len();
        // Mass and first moment about the base's origin of all that each joint carries.
        let mut carried: Vec<(f64, Vector3<f64>)> = (self.links.iter().zip(&frames.link))
            .map(|(link, at)| {
                (
                    link.mass,
                    at.rotation * link.moment + at.translation * link.mass,
                )
            })
            .collect();
        if let Some((target, body)) = state.targets.first().and_then(|t| Some((t, t.body?))) {
            let place = point(&frames.link[body], &target.placement.translation);
            carried[body].0 += pose.payload;
            carried[body].1 += place * pose.payload;
        }
        for j in (0..count).rev() {
            if let Some(parent) = self.links[j].parent {
                let (mass, moment) = carried[j];
                carried[parent].0 += mass;
                carried[parent].1 += moment;
            }
        }
        let load = |j: usize| {
            let (mass, moment) = carried[j];
            let frame = &frames.joint[j];
            let in_base = if self.links[j].slides {
                self.gravity * mass
            } else {
                (moment - frame.translation * mass).cross(&self.gravity)
            };
            frame.rotation.tr_mul(&in_base)
        };
        (0..count).map(load).collect()
    }
}

impl State {
    /// Frames as described, springs and gaps as the model file has them, bends as others than poses have, the base at the measuring system's origin, these
    /// targets.
    pub(super) fn nominal(model: &Model, targets: Vec<Target>) -> Self {
        Self::with(model, targets, |joint, quantity| match quantity.is_bend() {
            true => Some(model.others(joint, quantity, Witness::Poses)?.value),
            false => quantity
                .effect()
                .and_then(|_| Some(model.joint_quantity(joint, quantity)?.value)),
        })
    }

    /// All that a model file says.
    pub(super) fn of_model(model: &Model, targets: Vec<Target>) -> Self {
        Self::with(model, targets, |joint, quantity| {
            Some(model.joint_quantity(joint, quantity)?.value)
        })
    }

    fn with(
        model: &Model,
        targets: Vec<Target>,
        known: impl Fn(usize, JointQuantity) -> Option<f64>,
    ) -> Self {
        let mut joints = vec![[0.0; QUANTITIES]; model.robot().bodies().len()];
        for (j, values) in joints.iter_mut().enumerate() {
            for quantity in JointQuantity::ALL {
                values[quantity.index()] = known(j, quantity).unwrap_or(0.0);
            }
        }
        let mount = model.kinematics().mount.as_ref();
        Self {
            mount: mount.map_or_else(Transform::identity, Fixture::transform),
            targets,
            joints,
        }
    }
}

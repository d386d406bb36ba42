//! A kinematic tree of rigid bodies, on a fixed or a free base, and its motion at one instant.
//!
//! Bodies are numbered from the root so that a parent comes before its children and a subtree is a contiguous range
//! (depth first), as in Featherstone ch. 4. A tree on a fixed base consists of moving bodies only; a tree on a free base
//! starts with the base itself, whose joint is [`Joint::Free`]. Then nothing else in the crate needs to know which it is.
//!
//! The velocity of a free joint is the body's twist in its own coordinates, angular part first; its acceleration is the
//! derivative of those six numbers (as in Pinocchio's free-flyer, except for the order).
//!
//! # Example
//!
//! Two rods of 1 kg and 0.4 m, one hung from the other, that turn about y:
//!
//! ```
//! use nalgebra::{Matrix3, Vector2, Vector3};
//! use proprio_core::inertia::InertialParameters;
//! use proprio_core::spatial::Transform;
//! use proprio_core::tree::{Body, Joint, Tree, TreeError};
//!
//! let about_com = Matrix3::from_diagonal(&Vector3::new(0.0133, 0.0133, 1e-4));
//! let rod = |parent, z| Body {
//!     parent,
//!     placement: Transform::from_translation(Vector3::new(0.0, 0.0, z)),
//!     joint: Joint::Revolute(Vector3::y()),
//!     inertia: InertialParameters::from_com(1.0, Vector3::new(0.0, 0.0, -0.2), about_com),
//! };
//! let arm: Tree<f64, 2, 2> = Tree::new([rod(None, 0.0), rod(Some(0), -0.4)])?;
//!
//! // Stretched out level, and at rest: the motors carry the rods, 0.2 m and 0.6 m away from the first joint.
//! let q = Vector2::new(core::f64::consts::FRAC_PI_2, 0.0);
//! let level = arm.kinematics(&Transform::identity(), &q, &Vector2::zeros());
//! let torque = arm.gravity_torque(&level);
//! assert!((torque[0].abs() - 9.81 * (0.2 + 0.6)).abs() < 1e-9);
//! assert!((torque[1].abs() - 9.81 * 0.2).abs() < 1e-9);
//! # Ok::<(), TreeError>(())
//! ```

use crate::inertia::InertialParameters;
use crate::spatial::Transform;
use crate::{Real, scalar};
use joint_frame::JointKind;
use nalgebra::{Matrix3, SVector, Vector3};

pub(crate) mod joint_frame;
mod kinematics;

pub use kinematics::{Jacobians, Kinematics, Placements};

/// Standard gravity as robots' models round it, m/s²: 9.78 at the equator and 9.83 at the poles (GRS 80).
pub const GRAVITY: f64 = 9.81;

/// How a body moves in its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Joint<T: Real> {
    /// Six degrees of freedom; only for the root. Its placement is the argument `base` of [`Tree::kinematics`].
    Free,
    /// Rotation about a unit axis, rad.
    Revolute(Vector3<T>),
    /// Translation along a unit axis, m.
    Prismatic(Vector3<T>),
}

/// One body of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Body<T: Real> {
    /// Index of the body that carries this one; `None` for a child of the (fixed) world.
    pub parent: Option<usize>,
    /// Placement of the joint frame in the parent's frame at zero joint position.
    pub placement: Transform<T>,
    /// How the body moves.
    pub joint: Joint<T>,
    /// Inertial parameters about the joint frame's origin.
    pub inertia: InertialParameters<T>,
}

/// Why bodies do not make a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TreeError {
    /// The parent of this body does not come before it.
    ParentAfterChild(usize),
    /// The subtree below this body is not a contiguous range: number the bodies depth first.
    NotDepthFirst(usize),
    /// This body has a free joint but is not the root.
    FreeJointBelowRoot(usize),
    /// The joints have this many degrees of freedom, not the tree's `V`.
    DegreesOfFreedom(usize),
}

impl core::fmt::Display for TreeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::ParentAfterChild(b) => {
                write!(f, "the parent of body {b} does not come before it")
            }
            Self::NotDepthFirst(b) => write!(f, "body {b} is not numbered depth first"),
            Self::FreeJointBelowRoot(b) => {
                write!(f, "body {b} has a free joint but is not the root")
            }
            Self::DegreesOfFreedom(n) => write!(f, "the joints have {n} degrees of freedom"),
        }
    }
}

impl core::error::Error for TreeError {}

/// A tree of `B` bodies with `V` velocity coordinates.
///
/// A quadruped is a `Tree<T, 3, 3>` (one pinned leg), a `Tree<T, 12, 12>` (pinned) or a `Tree<T, 13, 18>` (free).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tree<T: Real, const B: usize, const V: usize> {
    bodies: [Body<T>; B],
    turning: [Turning<T>; B],
    kinds: [JointKind; B],
    first_coordinate: [usize; B],
    subtree_end: [usize; B],
    gravity: Vector3<T>,
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// A tree under standard gravity, [`GRAVITY`] along −z of the world.
    ///
    /// # Errors
    /// [`TreeError`] names the body that breaks the numbering.
    pub fn new(bodies: [Body<T>; B]) -> Result<Self, TreeError> {
        let mut subtree_end = [0; B];
        let mut coordinates = 0;
        for b in 0..B {
            coordinates += if bodies[b].joint == Joint::Free { 6 } else { 1 };
            subtree_end[b] = b + 1;
            match bodies[b].parent {
                Some(parent) if parent >= b => return Err(TreeError::ParentAfterChild(b)),
                _ if b > 0 && bodies[b].joint == Joint::Free => {
                    return Err(TreeError::FreeJointBelowRoot(b));
                }
                _ => {}
            }
            let mut ancestor = bodies[b].parent;
            while let Some(a) = ancestor {
                if subtree_end[a] != b {
                    return Err(TreeError::NotDepthFirst(b));
                }
                subtree_end[a] = b + 1;
                ancestor = bodies[a].parent;
            }
        }
        if coordinates != V {
            return Err(TreeError::DegreesOfFreedom(coordinates));
        }
        Ok(Self::numbered(bodies))
    }

    /// [`new`](Self::new) of bodies whose numbering is known to be right.
    pub(crate) fn numbered(bodies: [Body<T>; B]) -> Self {
        let mut first_coordinate = [0; B];
        let mut subtree_end = core::array::from_fn(|b| b + 1);
        let mut coordinates = 0;
        for (b, body) in bodies.iter().enumerate() {
            if let Some(first) = first_coordinate.get_mut(b) {
                *first = coordinates;
            }
            coordinates += if body.joint == Joint::Free { 6 } else { 1 };
            let mut ancestor = body.parent;
            // A parent comes before its child, so that this ends, and no sooner than it has to.
            for _ in 0..B {
                let Some(a) = ancestor else { break };
                if let Some(end) = subtree_end.get_mut(a) {
                    *end = b + 1;
                }
                ancestor = bodies.get(a).and_then(|body| body.parent);
            }
        }
        Self {
            turning: bodies.each_ref().map(Turning::new),
            kinds: bodies.each_ref().map(JointKind::of),
            bodies,
            first_coordinate,
            subtree_end,
            gravity: Vector3::new(T::zero(), T::zero(), scalar::real(-GRAVITY)),
        }
    }

    /// The bodies, root first.
    pub fn bodies(&self) -> &[Body<T>; B] {
        &self.bodies
    }

    /// The same tree with other inertial parameters.
    pub fn with_inertia(mut self, inertia: &[InertialParameters<T>; B]) -> Self {
        for (body, phi) in self.bodies.iter_mut().zip(inertia) {
            body.inertia = *phi;
        }
        self
    }

    /// All inertial parameters, body after body: θ of the rigid part. `P` is 10 `B`.
    pub fn parameters<const P: usize>(&self) -> SVector<T, P> {
        const { assert!(P == 10 * B) }
        SVector::from_fn(|k, _| self.bodies[k / 10].inertia.0[k % 10])
    }

    /// The velocity coordinates of a body's joint: one number, or six.
    pub fn coordinates(&self, body: usize) -> core::ops::Range<usize> {
        let first = self.first_coordinate(body);
        let free = self.kind(body) == JointKind::Free;
        first..first + if free { 6 } else { 1 }
    }

    fn first_coordinate(&self, body: usize) -> usize {
        self.first_coordinate.get(body).copied().unwrap_or(0)
    }

    /// The bodies that a body's joint moves: the body itself and all it carries.
    pub fn subtree(&self, body: usize) -> core::ops::Range<usize> {
        body..self.subtree_end.get(body).copied().unwrap_or(body).min(B)
    }

    /// Gravity in world coordinates, m/s².
    pub fn gravity(&self) -> Vector3<T> {
        self.gravity
    }

    /// How a body's joint carries vectors.
    pub(crate) fn kind(&self, body: usize) -> JointKind {
        self.kinds.get(body).copied().unwrap_or(JointKind::Free)
    }
}

/// A revolute joint's placement as A + B sin q + C cos q: Rodrigues' formula multiplied out once.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turning<T: Real> {
    constant: Matrix3<T>,
    sine: Matrix3<T>,
    cosine: Matrix3<T>,
}

impl<T: Real> Turning<T> {
    fn new(body: &Body<T>) -> Self {
        let cross = match body.joint {
            Joint::Revolute(axis) => axis.cross_matrix(),
            Joint::Free | Joint::Prismatic(_) => Matrix3::zeros(),
        };
        let placed = body.placement.rotation;
        let square = placed * cross * cross;
        Self {
            constant: placed + square,
            sine: placed * cross,
            cosine: -square,
        }
    }

    fn rotation(&self, (sin, cos): (T, T)) -> Matrix3<T> {
        self.constant + self.sine * sin + self.cosine * cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(parent: Option<usize>, joint: Joint<f64>) -> Body<f64> {
        Body {
            parent,
            placement: Transform::identity(),
            joint,
            inertia: InertialParameters::zero(),
        }
    }

    #[test]
    fn bad_trees_are_refused_by_name() {
        let turn = Joint::Revolute(Vector3::x());
        let tree = |bodies: [Body<f64>; 3]| Tree::<f64, 3, 3>::new(bodies).unwrap_err();
        let root = body(None, turn);
        assert_eq!(
            tree([root, body(Some(1), turn), body(Some(0), turn)]),
            TreeError::ParentAfterChild(1)
        );
        assert_eq!(
            tree([root, body(None, turn), body(Some(0), turn)]),
            TreeError::NotDepthFirst(2)
        );
        assert_eq!(
            tree([root, body(Some(0), Joint::Free), root]),
            TreeError::FreeJointBelowRoot(1)
        );
        assert_eq!(
            tree([
                body(None, Joint::Free),
                body(Some(0), turn),
                body(Some(1), turn)
            ]),
            TreeError::DegreesOfFreedom(8)
        );
    }

    #[test]
    fn a_subtree_is_the_body_and_all_it_carries() {
        let turn = Joint::Revolute(Vector3::x());
        let bodies = [
            body(None, turn),
            body(Some(0), turn),
            body(Some(1), turn),
            body(Some(0), turn),
        ];
        let tree = Tree::<f64, 4, 4>::new(bodies).unwrap();
        assert_eq!(tree.subtree(0), 0..4);
        assert_eq!(tree.subtree(1), 1..3);
        assert_eq!(tree.subtree(3), 3..4);
    }
}

//! Where a limb's foot is, and what a force at it does to the joints.

use nalgebra::{Matrix3xX, Rotation3, Vector3};
use proprio_core::spatial::Transform;

use crate::model::{Body, JointKind, Limb, Model};

/// The end of a limb that touches the ground.
pub(crate) struct Foot<'a> {
    model: &'a Model,
    /// The limb's bodies.
    bodies: &'a [Body],
    /// Index of the first of them in the robot.
    first: usize,
    /// Place in the last body's joint frame, m.
    point: Vector3<f64>,
    /// Whether the robot's description has a foot; otherwise the last body's centre of mass stands for it.
    pub(crate) described: bool,
}

impl<'a> Foot<'a> {
    /// The foot of the limb's last body.
    pub(crate) fn of(model: &'a Model, limb: &Limb) -> Option<Self> {
        let bodies = &model.robot().bodies()[limb.bodies.clone()];
        let last = bodies.last()?;
        let com = last.inertia.first_moment() / last.inertia.mass();
        Some(Self {
            model,
            bodies,
            first: limb.bodies.start,
            point: last.foot.unwrap_or(com),
            described: last.foot.is_some(),
        })
    }

    /// J, 3 × n: the foot's velocity in the world (m/s) per velocity of each joint (rad/s or m/s), at positions `q`. The motors
    /// feel −Jᵀλ of a force λ (N) of the ground on the foot.
    pub(crate) fn jacobian(&self, base: &Transform<f64>, q: &[f64]) -> Matrix3xX<f64> {
        let mut frames: Vec<Transform<f64>> = Vec::with_capacity(self.bodies.len());
        for (b, (body, &q)) in (self.first..).zip(self.bodies.iter().zip(q)) {
            let parent = body
                .parent
                .map_or(*base, |parent| frames[parent - self.first]);
            let joint = match body.kind {
                JointKind::Prismatic => Transform::from_translation(body.axis * q),
                JointKind::Revolute | JointKind::Continuous => Transform {
                    rotation: *Rotation3::new(body.axis * q).matrix(),
                    translation: Vector3::zeros(),
                },
            };
            frames.push(parent.compose(&self.model.placement(b)).compose(&joint));
        }
        let mut jacobian = Matrix3xX::zeros(self.bodies.len());
        let mut next = self.bodies.len().checked_sub(1);
        let foot = frames.last().map_or(Vector3::zeros(), |last| {
            last.rotation * self.point + last.translation
        });
        while let Some(j) = next {
            let (body, frame) = (&self.bodies[j], &frames[j]);
            let axis = frame.rotation * body.axis;
            let column = match body.kind {
                JointKind::Prismatic => axis,
                JointKind::Revolute | JointKind::Continuous => {
                    axis.cross(&(foot - frame.translation))
                }
            };
            jacobian.set_column(j, &column);
            next = body.parent.map(|parent| parent - self.first);
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column is what the foot's place changes by: straight legs on level ground, in closed form.
    #[test]
    fn a_straight_leg_has_the_jacobian_of_its_lengths() {
        let model = Model::new(crate::model::Robot::go2());
        let limb = &model.robot().limbs()[0];
        let foot = Foot::of(&model, limb).unwrap();
        assert!(foot.described);
        let jacobian = foot.jacobian(&Transform::identity(), &[0.0; 3]);
        let expected = Matrix3xX::from_columns(&[
            Vector3::new(0.0, 0.426, -0.0955),
            Vector3::new(-0.426, 0.0, 0.0),
            Vector3::new(-0.213, 0.0, 0.0),
        ]);
        assert!((jacobian - expected).norm() < 1e-12);
    }
}

//! A limb's rigid body under a model: its loads, its base, the inertia that a joint moves.

use nalgebra::Vector3;
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;

use super::rigid_body::{self, RigidBody};
use super::rows::turned;
use super::trajectory::Trajectory;
use super::values::Values;
use crate::model::{Limb, Model};

/// What of a limb no parameter changes.
pub(crate) struct LimbBody<'a> {
    model: &'a Model,
    rigid: Box<dyn RigidBody>,
    /// The CAD's centres of mass, m in the joint frames: where loads are until it is known better.
    pub(crate) coms: Vec<Vector3<f64>>,
}

impl<'a> LimbBody<'a> {
    /// A limb of a model's robot; `None` if it is too large.
    pub(crate) fn of(model: &'a Model, limb: &Limb) -> Option<Self> {
        let rigid = rigid_body::of_limb(model, limb)?;
        let com = |b: usize| {
            let phi: &InertialParameters<f64> = &model.robot().bodies()[b].inertia;
            phi.first_moment() / phi.mass()
        };
        Some(Self {
            model,
            rigid,
            coms: limb.bodies.clone().map(com).collect(),
        })
    }

    /// The rigid body with a model's bodies and loads.
    pub(crate) fn loaded(&self, values: &Values) -> Box<dyn RigidBody> {
        self.rigid.with_inertia(&values.loaded(&self.coms))
    }

    /// The base in the world, turned as far as the model says that gravity is not where it is taken to be.
    pub(crate) fn base(&self, values: &Values) -> Transform<f64> {
        let [roll, pitch] = values.tilt();
        let rolled = turned(&self.model.base(), &Vector3::new(roll, 0.0, 0.0));
        turned(&rolled, &Vector3::new(0.0, pitch, 0.0))
    }

    /// The inertia that a joint turns with the others at rest, in the middle of what they do, kg m².
    pub(crate) fn moved_inertia(
        &self,
        rigid: &dyn RigidBody,
        base: &Transform<f64>,
        joints: &[Trajectory],
        joint: usize,
    ) -> f64 {
        let n = joints.len();
        let mean = |joint: &Trajectory| {
            let sum: f64 = joint.state.iter().map(|state| state[0]).sum();
            sum / joint.state.len().max(1) as f64
        };
        let q: Vec<f64> = joints.iter().map(mean).collect();
        let torque = |acceleration: f64| {
            let (mut ddq, mut torque) = (vec![0.0; n], vec![0.0; n]);
            ddq[joint] = acceleration;
            rigid.inverse_dynamics(base, [&q, &vec![0.0; n], &ddq], &mut torque);
            torque[joint]
        };
        (torque(1.0) - torque(0.0)).max(1e-4)
    }
}

//! A limb's rigid body under a model: its loads, its base, the inertia that a joint moves.

use nalgebra::{Rotation3, Vector3};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;

use super::rigid_body::{self, RigidBody};
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
}

/// A base turned about its own axes by a small rotation vector, rad.
fn turned(base: &Transform<f64>, by: &Vector3<f64>) -> Transform<f64> {
    Transform {
        rotation: base.rotation * Rotation3::new(*by).matrix(),
        translation: base.translation,
    }
}

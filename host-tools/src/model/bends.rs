//! The same robot with joints that no motor drives: links and bearings that bend.

use nalgebra::Vector3;
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;

use super::robot::{Body, JointKind, Robot};
use super::{JointQuantity, Model};

/// Two unit vectors across an axis: the frame's own where the axis is one of them.
pub(crate) fn across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let least = axis.iamin();
    let seed = Vector3::from_fn(|row, _| f64::from(u8::from(row == least)));
    let first = (seed - axis * axis.dot(&seed)).normalize();
    [first, axis.cross(&first)]
}

impl Model {
    /// The name of the joint that stands for a bend in [`with_bends`](Self::with_bends): `bend_1:elbow`.
    pub(crate) fn bend_name(&self, (joint, quantity): (usize, JointQuantity)) -> String {
        format!("{}:{}", quantity.key(), self.joint_name(joint))
    }

    /// The same bodies, and for each of these bends a joint without mass in front of the one that it is stated of: it turns about the first or the second
    /// axis across that joint's, where both have their origin, before the joint moves. So has `calibrate`'s chain it. What is no bend is left out.
    ///
    /// What effects the model has stays at the joints that have it.
    pub(crate) fn with_bends(&self, bends: &[(usize, JointQuantity)]) -> Self {
        let own = self.robot();
        let mut bodies: Vec<Body> = Vec::new();
        // Where each body of this model is among the new ones.
        let mut places = Vec::new();
        for (b, body) in own.bodies().iter().enumerate() {
            let mut next = body.clone();
            next.parent = body.parent.map(|parent| places[parent]);
            for (n, quantity) in [JointQuantity::BendFirst, JointQuantity::BendSecond]
                .into_iter()
                .enumerate()
            {
                if !bends.contains(&(b, quantity)) {
                    continue;
                }
                let name = self.bend_name((b, quantity));
                bodies.push(Body {
                    joint_name: name.clone(),
                    link_name: name.clone(),
                    name,
                    kind: JointKind::Revolute,
                    axis: across(&body.axis)[n],
                    limits: [f64::NEG_INFINITY, f64::INFINITY],
                    inertia: InertialParameters::zero(),
                    motor: None,
                    foot: None,
                    ..next.clone()
                });
                next.parent = Some(bodies.len() - 1);
                next.placement = Transform::identity();
            }
            places.push(bodies.len());
            bodies.push(next);
        }
        let robot = Robot::new(
            own.name(),
            own.source().clone(),
            own.base_link(),
            *own.base_inertia(),
            bodies,
        );
        let mut model = Self::new(robot).mounted_as(self);
        model.cad_uncertainty = self.cad_uncertainty;
        model.effect_priors.clone_from(&self.effect_priors);
        model.base_body = self.base_body;
        for (b, place) in places.iter().enumerate() {
            model.bodies[*place] = self.bodies[b];
        }
        model.effects.clone_from(&self.effects);
        for effect in &mut model.effects {
            // The base's effects stay the base's.
            effect.joint = places.get(effect.joint).copied().unwrap_or(effect.joint);
        }
        model
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Dynamics;

    /// At rest a bend's generalised force is gravity's moment about its axis, and joints see nothing of it.
    #[test]
    fn bends_that_stand_still_change_nothing() {
        let model = Model::default();
        let bends = [
            (1, JointQuantity::BendFirst),
            (2, JointQuantity::BendSecond),
        ];
        let bent = model.with_bends(&bends);
        assert_eq!(
            bent.robot().bodies().len(),
            model.robot().bodies().len() + 2
        );
        let [rigid, elastic] = [&model, &bent].map(|m| Dynamics::new(m, None).unwrap());
        let places: Vec<usize> = (rigid.joints().iter())
            .map(|name| elastic.joints().iter().position(|own| own == name).unwrap())
            .collect();
        let motion = [0.7, 1.3, 2.9].map(|x| {
            let of = |j: usize| (x * (j as f64 + 1.0)).sin();
            (0..places.len()).map(of).collect::<Vec<f64>>()
        });
        let wide = motion.clone().map(|x| {
            let mut all = vec![0.0; x.len() + bends.len()];
            places.iter().zip(x).for_each(|(place, x)| all[*place] = x);
            all
        });
        let [mut own, mut all] = [&motion, &wide].map(|x| vec![0.0; x[0].len()]);
        rigid
            .inverse_dynamics([&motion[0], &motion[1], &motion[2]], &mut own)
            .unwrap();
        elastic
            .inverse_dynamics([&wide[0], &wide[1], &wide[2]], &mut all)
            .unwrap();
        for (place, own) in places.iter().zip(own) {
            assert!((all[*place] - own).abs() < 1e-12, "{} {own}", all[*place]);
        }
        assert!(all.iter().all(|torque| torque.abs() > 1e-6), "{all:?}");
    }
}

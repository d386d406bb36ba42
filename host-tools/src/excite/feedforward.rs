//! The torque that a model foresees for a motion: what it states, and nothing that is only expected.

use super::limb::{self, Instant, Limb};
use super::problem::Known;
use crate::model::{self, Model};

/// A limb of a model as a feed-forward controller sees it.
pub struct Feedforward {
    limb: Box<dyn Limb>,
    theta: Vec<f64>,
    stated: Vec<Known>,
}

impl Feedforward {
    /// Of a limb; `None` if it has too many joints.
    pub fn new(model: &Model, limb: &model::Limb) -> Option<Self> {
        let bodies = limb.bodies.clone();
        Some(Self {
            limb: limb::of(model, limb)?,
            theta: bodies
                .flat_map(|b| model.inertia(b).0.iter().copied().collect::<Vec<_>>())
                .collect(),
            stated: super::setup::stated(model, limb),
        })
    }

    /// Torque of each joint, N m, at a position (rad), velocity (rad/s) and acceleration (rad/s²).
    pub fn torque(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let at = Instant {
            q: q.to_vec(),
            dq: dq.to_vec(),
            ddq: ddq.to_vec(),
        };
        let p = self.theta.len();
        let mut w = vec![0.0; q.len() * p];
        self.limb.regressor(&at, &mut w);
        let rigid = w
            .chunks(p)
            .map(|row| row.iter().zip(&self.theta).map(|(w, t)| w * t).sum::<f64>());
        let mut torque: Vec<f64> = rigid.collect();
        let alone = torque.clone();
        for (column, value) in &self.stated {
            let j = column.joint;
            torque[j] += value * column.term([q[j], dq[j], ddq[j]], alone[j]).value;
        }
        torque
    }
}

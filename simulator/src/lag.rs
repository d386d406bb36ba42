//! Motors whose torque follows what is asked for with a lag of first order.

use crate::effect::Effect;

/// The torques of motors.
pub(super) struct LaggingMotors {
    /// Time constant of each, s.
    lag: Vec<f64>,
    /// At the end of the last hold, N m; none before the first.
    now: Option<Vec<f64>>,
}

impl LaggingMotors {
    /// Of joints with these effects.
    pub(super) fn new<'a>(joints: impl Iterator<Item = &'a Vec<Box<dyn Effect>>>) -> Self {
        Self {
            lag: joints
                .map(|own| own.iter().map(|e| e.lag()).sum())
                .collect(),
            now: None,
        }
    }

    /// Makes the mean torques over a hold of `period` seconds of those that are asked for in it. They begin as what is asked for first.
    pub(super) fn follow(&mut self, period: f64, torques: &mut [f64]) {
        let now = self.now.get_or_insert_with(|| torques.to_vec());
        for ((torque, before), &lag) in torques.iter_mut().zip(now).zip(&self.lag) {
            let asked = *torque;
            let left = if lag > 0.0 {
                (-period / lag).exp()
            } else {
                0.0
            };
            *torque = asked + (*before - asked) * (1.0 - left) * lag / period;
            *before = asked + (*before - asked) * left;
        }
    }
}

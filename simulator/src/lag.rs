//! Motors whose torque follows what is asked for with a lag of first order.

use nalgebra::SVector;

use crate::effect::Effect;

/// The torques of `J` motors.
pub(super) struct LaggingMotors<const J: usize> {
    /// Time constant of each, s.
    lag: [f64; J],
    /// At the end of the last hold, N m; none before the first.
    now: Option<SVector<f64, J>>,
}

impl<const J: usize> LaggingMotors<J> {
    /// Of joints with these effects.
    pub(super) fn new<'a>(effects: impl Fn(usize) -> &'a [Box<dyn Effect>]) -> Self {
        Self {
            lag: std::array::from_fn(|j| effects(j).iter().map(|e| e.lag()).sum()),
            now: None,
        }
    }

    /// The mean torques over a hold of `period` seconds in which `asked` is asked for. They begin as what is asked for first.
    pub(super) fn follow(&mut self, period: f64, asked: &SVector<f64, J>) -> SVector<f64, J> {
        let before = self.now.unwrap_or(*asked);
        let left = |j: usize| match self.lag[j] > 0.0 {
            true => (-period / self.lag[j]).exp(),
            false => 0.0,
        };
        self.now = Some(SVector::from_fn(|j, _| {
            asked[j] + (before[j] - asked[j]) * left(j)
        }));
        SVector::from_fn(|j, _| {
            asked[j] + (before[j] - asked[j]) * (1.0 - left(j)) * self.lag[j] / period
        })
    }
}

//! What a host says of effects' parameters before any data.

use super::{COLUMNS, DEVICE_COLUMNS, EffectPrior, effect_prior};
use crate::effect::Prior;
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::robot::Actuator;

/// What is believed of each effect's parameter at a leg's joints, in place of the catalogue's prior. All zeros at first: nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beliefs([[Belief; DEVICE_COLUMNS]; JOINTS_PER_LEG]);

/// Mean beyond the parameter's neutral value, and standard deviation; of zero, where the catalogue's prior holds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Belief {
    mean: f32,
    std: f32,
}

impl Beliefs {
    /// The catalogue's priors.
    pub const NONE: Self = Self(
        [[Belief {
            mean: 0.0,
            std: 0.0,
        }; DEVICE_COLUMNS]; JOINTS_PER_LEG],
    );

    /// Believes that the parameter of effect n of [`COLUMNS`](super::COLUMNS) at a joint is `mean` beyond its neutral value, within a
    /// standard deviation `std`, SI.
    ///
    /// False, and nothing is changed, if there is no such effect or joint, `std` is not positive and finite, or `mean` is beyond the
    /// parameter's bounds.
    pub fn set(&mut self, joint: usize, n: usize, mean: f32, std: f32) -> bool {
        let Some(belief) = self.0.get_mut(joint).and_then(|of| of.get_mut(n)) else {
            return false;
        };
        let (lower, upper) = bounds(n);
        let (wide, within) = (std.is_normal() && std > 0.0, f64::from(mean));
        let possible = mean.is_finite() && lower <= within && within <= upper;
        if wide && possible {
            *belief = Belief { mean, std };
        }
        wide && possible
    }

    /// How many numbers [`number`](Self::number) has.
    pub(crate) const NUMBERS: usize = 2 * DEVICE_COLUMNS * JOINTS_PER_LEG;

    /// The n-th of the numbers that say all that is believed.
    pub(crate) fn number(&self, n: usize) -> Option<f32> {
        let (joint, rest) = (n / (2 * DEVICE_COLUMNS), n % (2 * DEVICE_COLUMNS));
        let belief = self.0.get(joint)?.get(rest / 2)?;
        Some(if rest % 2 == 0 {
            belief.mean
        } else {
            belief.std
        })
    }

    /// Takes the n-th of these numbers.
    pub(crate) fn set_number(&mut self, n: usize, number: f32) {
        let (joint, rest) = (n / (2 * DEVICE_COLUMNS), n % (2 * DEVICE_COLUMNS));
        if let Some(belief) = self.0.get_mut(joint).and_then(|of| of.get_mut(rest / 2)) {
            let place = match rest % 2 {
                0 => &mut belief.mean,
                _ => &mut belief.std,
            };
            *place = number;
        }
    }

    /// What is known of effect n at a joint that `actuator` drives before any data, and its bounds; of the parameter beyond its neutral value.
    pub(crate) fn prior(&self, joint: usize, n: usize, actuator: &Actuator) -> EffectPrior {
        let catalogue = effect_prior(actuator, n);
        let belief = self.0.get(joint).and_then(|of| of.get(n));
        match belief {
            Some(belief) if belief.std > 0.0 => EffectPrior {
                prior: Prior {
                    mean: belief.mean.into(),
                    std: belief.std.into(),
                },
                ..catalogue
            },
            _ => catalogue,
        }
    }
}

/// The bounds of effect n's parameter beyond its neutral value, whatever drives the joint.
fn bounds(n: usize) -> (f64, f64) {
    EffectPrior::bounds(COLUMNS[n % DEVICE_COLUMNS])
}

//! What a second encoder, at the link, shows of a gear: how far link and motor turn against each other under the torque between them.
//!
//! The link's own encoder gives its motion, so that the rigid body needs no spring to follow it; and the twist x = q_motor − q_link, with
//! the torque L that the bodies need at that motion, tells the gear directly, better than any motor's torque:
//!
//! ```text
//! L = k (x − x₀) + d ẋ                a spring that damps
//! L = k (x − x₀) + d ẋ + f z(x; w)    and friction inside it (`equation::hysteresis`)
//! x = x₀ + gap/2 sgn L + L/k          or a play, and a spring on either side of it
//! ```
//!
//! [`windows`] takes means of both over the windows of the fit; [`gear_model`] fits each of the three and asks folds of time that the
//! fit has not seen what it leaves there. The richer gear is believed where it leaves less of them, beyond the spread over them.

mod gear_model;
mod windows;

use proprio_core::effect::EffectKind;

use crate::equation::values::{Place, Values};
use crate::estimate::limb_data::LimbData;
use gear_model::{Fitted, GearModel, LEAST_Z};
use windows::Windows;

/// A gear whose twist tells less than this share of the torque has none that is its own: an encoder's runout is as large.
const LEAST_TOLD: f64 = 0.5;

/// A gear as its two encoders show it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Twist {
    /// The joint, counted from the limb's first.
    pub(crate) joint: usize,
    /// How far link and motor turn against each other, root mean square, rad.
    pub(crate) rms: f64,
    /// Share of the variance of the torque (of a play: of the twist) that the gear tells, on folds that its fit has not seen, and its
    /// standard error.
    pub(crate) told: [f64; 2],
    /// Stiffness, N m/rad, and its standard deviation.
    pub(crate) stiffness: [f64; 2],
    /// What it has beside a spring.
    pub(crate) beside: Option<Beside>,
}

/// What a gear has beside a spring: values and standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beside {
    /// Friction f (N m) and the displacement w (rad) over which it builds up.
    Hysteresis {
        friction: [f64; 2],
        displacement: [f64; 2],
    },
    /// A gap, rad.
    Backlash { gap: [f64; 2] },
}

impl Twist {
    /// What a joint's gear is like under a model; `None` without a second encoder, or if its twist does not follow the torque.
    pub(crate) fn of(data: &LimbData, values: &Values, joint: usize) -> Option<Self> {
        let windows = Windows::of(data, values, joint)?;
        let play = windows.fit(GearModel::Backlash)?;
        let straight = windows.fit(GearModel::Straight)?;
        let mut twist = if play.is_better_than(&straight) {
            Self::play(&windows, &play, joint)?
        } else {
            let spring = windows.fit(GearModel::Spring)?;
            let hysteresis = windows.fit(GearModel::Hysteresis)?;
            let best = match hysteresis.is_better_than(&spring) {
                true => hysteresis,
                false => spring,
            };
            Self::spring(&windows, &best, joint)?
        };
        // The torque is the bodies': what they have wrong is wrong in all of it.
        let share = bodies_known(data, joint);
        let and_bodies = |[value, std]: &mut [f64; 2]| *std = std.hypot(share * *value);
        and_bodies(&mut twist.stiffness);
        if let Some(Beside::Hysteresis { friction, .. }) = &mut twist.beside {
            and_bodies(friction);
        }
        Some(twist)
    }

    /// A spring, with or without friction inside, if it is stiff beyond chance.
    fn spring(windows: &Windows, fitted: &Fitted, joint: usize) -> Option<Self> {
        let told = windows.told(fitted, &windows.torque, &|_| true)?;
        let [stiffness, friction, displacement] = fitted.numbers;
        let beside = Beside::Hysteresis {
            friction,
            displacement,
        };
        let is_sure = stiffness[0] > LEAST_Z * stiffness[1];
        is_sure.then(|| Self {
            joint,
            rms: windows.rms(),
            told,
            stiffness,
            beside: (fitted.model == GearModel::Hysteresis).then_some(beside),
        })
    }

    /// A play, and the spring on either side of it, which may be too stiff to tell.
    fn play(windows: &Windows, fitted: &Fitted, joint: usize) -> Option<Self> {
        let told = windows.told(fitted, &windows.twist, &|w| windows.is_pressed(w))?;
        let [compliance, std] = fitted.numbers[0];
        let gap = windows.gap();
        Some(Self {
            joint,
            rms: windows.rms(),
            told,
            stiffness: [1.0 / compliance, std / (compliance * compliance)],
            beside: Some(Beside::Backlash { gap }),
        })
    }

    /// The effects of the catalogue that it is: each parameter's value and standard deviation.
    pub(crate) fn effects(&self) -> Vec<(Place, Vec<[f64; 2]>)> {
        let [k, std] = self.stiffness;
        let gives = k.is_finite() && k > LEAST_Z * std;
        let spring = gives.then(|| (EffectKind::Elasticity, vec![[1.0 / k, std / (k * k)]]));
        let beside = self.beside.map(|beside| match beside {
            Beside::Hysteresis {
                friction,
                displacement,
            } => (EffectKind::ElasticHysteresis, vec![friction, displacement]),
            Beside::Backlash { gap } => (EffectKind::Backlash, vec![gap]),
        });
        let all = spring.into_iter().chain(beside);
        all.map(|(effect, values)| ((effect, self.joint), values))
            .collect()
    }
}

/// Values and standard deviations of an effect's parameters as two encoders tell them; `None` if they do not.
pub(crate) fn told_by_encoders(
    data: &LimbData,
    values: &Values,
    place: Place,
) -> Option<Vec<[f64; 2]>> {
    let effects = Twist::of(data, values, place.1)?.effects();
    let own = effects.into_iter().find(|(shown, _)| *shown == place);
    own.map(|(_, values)| values)
}

/// How well the bodies are known that a joint moves: the relative deviation of the first one's mass.
fn bodies_known(data: &LimbData, joint: usize) -> f64 {
    let body = data.body_of(joint);
    let mass = data.model.inertia(body).mass();
    let identified = data.model.inertia_std(body).map(|std| std[0] / mass);
    identified.unwrap_or_else(|| data.model.cad_uncertainty(body))
}

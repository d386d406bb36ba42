//! The detent as physics has it: the slope of a well of energy.

use proprio_simulator::{Description, EffectParameter, Instant, OwnHidden, Scope};

use crate::detent::PLACE;

/// The well E = −c s √e exp(−½ ((q − q₀)/s)²) and, by a difference of it, the torque that the motor has to give.
pub(crate) static TWIN: OwnHidden = OwnHidden {
    description: Description {
        name: "detent",
        words: "a magnet that pulls to one place",
        scope: Scope::Joint,
        parameters: &[
            EffectParameter::positive("c", "N m", 0.0),
            EffectParameter::within("s", "rad", 0.1, 1e-3, 1.0),
        ],
        in_catalogue: false,
    },
    torque: &|values, &Instant { q, .. }| {
        let [c, s] = [values[0], values[1]];
        let energy = |q: f64| -c * s * 0.5f64.exp() * (-0.5 * ((q - PLACE) / s).powi(2)).exp();
        let h = 1e-4 * s;
        (energy(q + h) - energy(q - h)) / (2.0 * h)
    },
    coupled: None,
};

//! A magnetic detent: a torque that pulls a joint to one place from nearby, and from nowhere else. The catalogue has nothing like it.

use proprio_core::effect::{Description, Grid, Parameter, Prior, Term};
use proprio_host::catalogue::OwnEffect;

/// Where it pulls to, rad.
pub(crate) const PLACE: f64 = 0.8;

/// τ = c x exp(½ (1 − x²)) with x = (q − q₀)/s: c is the greatest torque, s (a shape) how far from the place that is.
pub(crate) const DETENT: OwnEffect = OwnEffect {
    description: Description {
        name: "detent",
        torque: "c x exp((1 − x²)/2) with x = (q − q0)/s",
        parameters: &[
            Parameter::new("c", "N m", 0.0, f64::INFINITY),
            Parameter::new("s", "rad", 0.01, 1.0).shape(Grid::Values {
                least: 0.02,
                most: 0.5,
                count: 12,
            }),
        ],
        words: "a magnet that pulls the joint to one place",
        look_alikes: &["spring", "cogging"],
        separated_by: "slow motion through the place and far beyond it",
        ..Description::TORQUE
    },
    priors: &[
        Prior {
            mean: 0.0,
            std: 1.0,
        },
        Prior {
            mean: 0.1,
            std: 0.1,
        },
    ],
    others: &[],
    terms: &|joints, at, [s, _]| {
        let x = (joints[at].q - PLACE) / s;
        [Term::rate(x * (0.5 * (1.0 - x * x)).exp()), Term::zero()]
    },
    coupled: None,
};

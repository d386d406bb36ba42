//! Typical sizes of every effect: what batteries of tests are made of.

use proprio_core::go2::{JOINTS_PER_LEG, JointId};

use super::effect::{HiddenKind, Scope};
use super::hidden::{HiddenEffect, HiddenError};

/// Typical sizes of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// Which effect.
    pub kind: HiddenKind,
    /// A small, a medium and a large value of its first parameter at a hip or thigh.
    pub values: [f64; 3],
    /// The same at a calf, whose gear is longer and whose friction is larger.
    pub calf: [f64; 3],
    /// Values of other parameters, where the defaults are not typical.
    pub others: &'static [(&'static str, f64)],
}

impl Sizes {
    /// The sizes of an effect.
    pub fn of(kind: HiddenKind) -> &'static Self {
        SIZES
            .iter()
            .find(|sizes| sizes.kind == kind)
            .unwrap_or(&SIZES[0])
    }

    /// The effect in size `n` (0 small, 1 medium, 2 large) at `joint`; at the base or at the joint's foot if it belongs there.
    ///
    /// # Errors
    /// [`HiddenError`], if a size is out of bounds.
    pub fn at(&self, n: usize, joint: JointId) -> Result<HiddenEffect, HiddenError> {
        let is_calf = joint.place() + 1 == JOINTS_PER_LEG;
        let values = if is_calf { self.calf } else { self.values };
        let place = match self.kind.description().scope {
            Scope::Joint => Some(joint),
            // The first joint of a leg has none before it.
            Scope::Pair => JointId::of(joint.leg()).get(joint.place().max(1)).copied(),
            Scope::Foot => JointId::of(joint.leg()).last().copied(),
            Scope::Base => None,
        };
        let effect = HiddenEffect::new(self.kind, place, values[n.min(2)])?;
        let mut others = self.others.iter();
        others.try_fold(effect, |effect, (name, value)| effect.with(name, *value))
    }
}

const fn sizes(kind: HiddenKind, values: [f64; 3], calf: [f64; 3]) -> Sizes {
    with(kind, values, calf, &[])
}

const fn with(
    kind: HiddenKind,
    values: [f64; 3],
    calf: [f64; 3],
    others: &'static [(&'static str, f64)],
) -> Sizes {
    Sizes {
        kind,
        values,
        calf,
        others,
    }
}

/// Typical sizes of every effect, from the plausible ranges of go2.md where it has one: a table for test batteries.
///
/// Sizes are whole effects, not additions to [`typical`](crate::hidden::typical).
pub const SIZES: &[Sizes] = {
    use HiddenKind as K;
    &[
        sizes(K::Viscous, [0.02, 0.1, 0.4], [0.02, 0.1, 0.4]),
        sizes(K::Coulomb, [0.1, 0.3, 0.6], [0.2, 0.6, 1.5]),
        sizes(K::Armature, [0.003, 0.006, 0.012], [0.010, 0.016, 0.025]),
        sizes(K::Bias, [0.05, 0.15, 0.4], [0.05, 0.15, 0.4]),
        with(
            K::AsymmetricCoulomb,
            [0.2, 0.4, 0.8],
            [0.4, 0.8, 1.5],
            &[("F_minus", 0.1)],
        ),
        with(
            K::Stribeck,
            [0.1, 0.3, 0.6],
            [0.2, 0.5, 1.0],
            &[("vs", 0.15)],
        ),
        sizes(K::LoadFriction, [0.05, 0.1, 0.25], [0.05, 0.1, 0.25]),
        sizes(K::QuadraticDrag, [0.01, 0.03, 0.1], [0.01, 0.03, 0.1]),
        with(
            K::SaturatingViscous,
            [0.1, 0.3, 0.6],
            [0.2, 0.5, 1.0],
            &[("vs", 1.5)],
        ),
        sizes(
            K::ThermalViscous,
            [0.002, 0.005, 0.01],
            [0.003, 0.008, 0.02],
        ),
        sizes(
            K::CoupledArmature,
            [0.001, 0.003, 0.008],
            [0.001, 0.003, 0.008],
        ),
        sizes(K::CoupledViscous, [0.02, 0.06, 0.2], [0.02, 0.06, 0.2]),
        sizes(K::CoupledCoulomb, [0.1, 0.3, 0.6], [0.1, 0.3, 0.6]),
        with(K::Spring, [0.3, 1.0, 3.0], [0.3, 1.0, 3.0], &[("q0", 0.2)]),
        with(
            K::Cogging,
            [0.05, 0.15, 0.4],
            [0.1, 0.3, 0.8],
            &[("psi", 0.7)],
        ),
        sizes(K::TorqueGain, [1.08, 0.85, 1.3], [1.08, 0.85, 1.3]),
        sizes(K::VelocityGain, [1.03, 1.09, 0.85], [1.03, 1.09, 0.85]),
        sizes(K::EncoderOffset, [0.02, 0.05, 0.15], [0.02, 0.05, 0.15]),
        // e/r of a disc that is read at 10 mm and off its axis by 0.1, 0.2 and 0.4 mm.
        with(
            K::Eccentricity,
            [0.01, 0.02, 0.04],
            [0.01, 0.02, 0.04],
            &[("c", 0.01)],
        ),
        sizes(K::Delay, [0.0013, 0.0035, 0.0083], [0.0013, 0.0035, 0.0083]),
        sizes(
            K::CurrentLag,
            [0.0013, 0.0035, 0.0083],
            [0.0013, 0.0035, 0.0083],
        ),
        with(
            K::BaseTilt,
            [0.02, 0.05, 0.15],
            [0.02, 0.05, 0.15],
            &[("pitch", -0.03)],
        ),
        with(
            K::Payload,
            [0.05, 0.15, 0.4],
            [0.03, 0.08, 0.2],
            &[("x", 0.02), ("z", -0.1)],
        ),
        with(
            K::Contact,
            [3.0, 10.0, 30.0],
            [3.0, 10.0, 30.0],
            &[("x", 2.0)],
        ),
        sizes(K::Elasticity, [300.0, 100.0, 40.0], [300.0, 100.0, 40.0]),
        sizes(K::Backlash, [0.005, 0.015, 0.04], [0.005, 0.015, 0.04]),
        sizes(K::Saturation, [4.0, 2.5, 1.5], [4.0, 2.5, 1.5]),
        sizes(K::DeadBand, [0.1, 0.3, 0.6], [0.2, 0.5, 1.0]),
        sizes(K::PositionCoulomb, [0.1, 0.3, 0.6], [0.2, 0.5, 1.0]),
        sizes(K::Presliding, [0.1, 0.3, 0.6], [0.2, 0.6, 1.5]),
        sizes(K::PeriodicTorque, [0.1, 0.3, 0.8], [0.1, 0.3, 0.8]),
        sizes(
            K::TorqueConstantDrift,
            [0.002, 0.005, 0.012],
            [0.002, 0.005, 0.012],
        ),
        sizes(K::Hysteresis, [0.1, 0.3, 0.8], [0.1, 0.3, 0.8]),
        sizes(K::FrictionStep, [0.1, 0.3, 0.6], [0.2, 0.5, 1.0]),
        sizes(K::CableSnag, [0.2, 0.6, 1.5], [0.2, 0.6, 1.5]),
        sizes(K::AsymmetricViscous, [0.01, 0.03, 0.08], [0.01, 0.03, 0.08]),
        sizes(K::BaseRecoil, [0.3, 0.6, 1.0], [0.3, 0.6, 1.0]),
    ]
};

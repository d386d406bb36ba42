//! What is taken to be true of a limb before any data.

use crate::Real;
use crate::effect::{EffectKind, Prior};
use crate::factor::{Factor, packed_len};
use crate::inertia::barrier::{Expansion, Root};
use crate::inertia::{BodyFactor, INERTIAL, InertialParameters};
use crate::robot::Actuator;
use crate::scalar::real;

/// An effect parameter's prior and bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EffectPrior {
    /// Expected value and standard deviation.
    pub prior: Prior,
    /// Least physical value.
    pub lower: f64,
    /// Greatest physical value.
    pub upper: f64,
}

impl EffectPrior {
    /// What the catalogue says of an effect's first parameter at a joint driven by `actuator`; of the parameter beyond its neutral value.
    pub fn of(effect: EffectKind, actuator: &Actuator) -> Self {
        let parameter = effect.description().parameters.first();
        let neutral = parameter.map_or(0.0, |p| p.neutral);
        let (lower, upper) = Self::bounds(effect);
        let prior = effect.prior(actuator);
        Self {
            prior: Prior {
                mean: prior.mean - neutral,
                std: prior.std,
            },
            lower,
            upper,
        }
    }

    /// Least and greatest physical value of an effect's first parameter beyond its neutral value, whatever drives the joint.
    pub(crate) fn bounds(effect: EffectKind) -> (f64, f64) {
        let parameter = effect.description().parameters.first();
        parameter.map_or((f64::NEG_INFINITY, f64::INFINITY), |p| {
            (p.lower - p.neutral, p.upper - p.neutral)
        })
    }
}

/// A limb's bodies as the CAD has them within a relative uncertainty, and its effects' priors, `E` in the order of θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimbPrior<T: Real, E, const B: usize> {
    cad: [InertialParameters<T>; B],
    uncertainty: [T; B],
    bodies: [BodyFactor<T>; B],
    effects: E,
}

impl<T: Real, E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>, const B: usize> LimbPrior<T, E, B> {
    /// The CAD's bodies, each within `uncertainty` (relative, see [`InertialParameters::prior`]).
    ///
    /// A body that is not physical has no distance to others: nothing is then known of it.
    pub fn new(cad: [InertialParameters<T>; B], uncertainty: [T; B], effects: E) -> Self {
        let bodies = core::array::from_fn(|b| {
            cad[b]
                .prior(uncertainty[b])
                .unwrap_or(BodyFactor::new::<INERTIAL>())
        });
        Self {
            cad,
            uncertainty,
            bodies,
            effects,
        }
    }

    /// The CAD's bodies.
    pub fn cad(&self) -> &[InertialParameters<T>; B] {
        &self.cad
    }

    /// The effects' priors, in the order of θ.
    pub fn effects(&self) -> &[EffectPrior] {
        self.effects.as_ref()
    }

    /// The same bodies with other effects.
    pub(crate) fn set_effects(&mut self, effects: E) {
        self.effects = effects;
    }

    /// How well each body is known, relative to the CAD's.
    pub(crate) fn uncertainty(&self) -> &[T; B] {
        &self.uncertainty
    }

    /// Takes a body to be within `uncertainty` (positive) of the CAD's from now on; nothing, where there is no such body.
    ///
    /// The prior's rows are in units of the uncertainty: to multiply them is a fiftieth of the work of making them anew, which with a
    /// fold would be more than a step may do.
    pub(crate) fn set_uncertainty(&mut self, b: usize, uncertainty: T) {
        if let (Some(before), Some(body)) = (self.uncertainty.get_mut(b), self.bodies.get_mut(b)) {
            body.scale(*before / uncertainty);
            *before = uncertainty;
        }
    }

    /// The same, if that is less than was known before.
    pub(crate) fn loosen(&mut self, b: usize, uncertainty: T) {
        if self
            .uncertainty
            .get(b)
            .is_some_and(|before| *before < uncertainty)
        {
            self.set_uncertainty(b, uncertainty);
        }
    }

    /// The prior of body b as a triangle of ten rows.
    pub(crate) fn body(&self, b: usize) -> Option<&BodyFactor<T>> {
        self.bodies.get(b)
    }

    /// The prior of the n-th effect parameter as a triangle of one row.
    pub(crate) fn effect(&self, n: usize) -> Factor<T, [T; packed_len(1)]> {
        self.effects().get(n).map_or(Factor::new::<1>(), |effect| {
            known(real(effect.prior.mean), real(effect.prior.std))
        })
    }

    /// The n-th effect parameter held at `value`: known ten thousand times as well as before.
    pub(crate) fn pin(&self, n: usize, value: T) -> Factor<T, [T; packed_len(1)]> {
        self.effects().get(n).map_or(Factor::new::<1>(), |effect| {
            known(value, real(effect.prior.std * 1e-4))
        })
    }

    /// Body b's weighted divergence from the CAD's; without meaning if `root`, the body's, is not of a physical one.
    pub(crate) fn body_cost(&self, b: usize, root: &Root<T>) -> T {
        match (self.cad.get(b), self.uncertainty.get(b)) {
            (Some(cad), Some(s)) => root.divergence(&Root::of(cad)) * real(2.0) / (*s * *s),
            _ => T::zero(),
        }
    }

    /// Body b's prior expanded about `body`: see [`InertialParameters::divergence_near`].
    pub(crate) fn near(&self, b: usize, body: &InertialParameters<T>) -> Option<Expansion<T>> {
        let (cad, s) = (self.cad.get(b)?, self.uncertainty.get(b)?);
        Some(Root::of(body).expansion(body, &Root::of(cad), *s))
    }
}

/// One parameter that is known so well.
fn known<T: Real>(mean: T, std: T) -> Factor<T, [T; packed_len(1)]> {
    let mut row = Factor::<T, [T; packed_len(1)]>::new::<1>();
    // One finite number; a standard deviation of zero would be refused, and then nothing is known.
    let _ = row.add_prior(0, mean, std, &mut [T::zero(); 2]);
    row
}

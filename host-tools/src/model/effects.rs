//! The effects of a model: which, where, what is known of them.

use proprio_core::effect::{EffectKind, MAX_PARAMETERS, Prior};
use proprio_core::estimator::EffectPrior;

use super::possible::{Impossible, deviation, in_bounds, possible};
use super::rounding::rounded;
use super::{Estimate, Model};
use crate::catalogue;
use crate::parameter::of_effect;

/// An effect that the model has at one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelEffect {
    /// Which effect.
    pub effect: EffectKind,
    /// Index of the joint; [`BASE`] for an effect of the base.
    pub joint: usize,
    /// Its parameters in the order of the catalogue, once identified.
    pub estimates: [Option<Estimate>; MAX_PARAMETERS],
    /// What its first parameter is taken to be before any data, if not what the catalogue says.
    pub prior: Option<Prior>,
    /// What each of [`Witness::ALL`](super::Witness::ALL) measured of the first parameter, where it was not motion alone.
    pub(super) witnesses: [Option<Estimate>; 3],
    /// Whether it is what was added last: `compare` shows the error before and after it.
    pub just_added: bool,
}

impl ModelEffect {
    /// The first parameter, once identified.
    pub fn estimate(&self) -> Option<Estimate> {
        self.estimates[0]
    }
}

/// Stands for a joint where an effect is the base's: `base` in files.
pub const BASE: usize = usize::MAX;

impl Model {
    /// All effects of the model: by joint, in the order of the catalogue.
    pub fn effects(&self) -> &[ModelEffect] {
        &self.effects
    }

    /// The effects at one joint, in the order of the catalogue.
    pub fn effects_of(&self, joint: usize) -> Vec<&ModelEffect> {
        self.effects.iter().filter(|e| e.joint == joint).collect()
    }

    /// Takes out the effects whose torque a parameter of another one at the same joint multiplies too: no motion can tell the two apart,
    /// so that only the other has a value. Says of each, in words, for what it went.
    pub fn take_out_repeated(&mut self) -> Vec<String> {
        let mut taken = Vec::new();
        for e in self.effects.clone() {
            for (n, parameter) in e.effect.description().parameters.iter().enumerate() {
                if let Some(same) = parameter.same_as
                    && self.remove_effect(same, e.joint)
                {
                    let joint = self.joint_name(e.joint);
                    let [gone, stays] =
                        [(same, 0), (e.effect, n)].map(|(effect, n)| of_effect(effect, n, joint));
                    taken.push(format!("{gone} is the same torque as {stays}: it leaves the model, and {stays} has the value"));
                }
            }
        }
        taken
    }

    /// The effect at a joint, if the model has it.
    pub fn effect(&self, effect: EffectKind, joint: usize) -> Option<&ModelEffect> {
        let found = |e: &&ModelEffect| e.effect == effect && e.joint == joint;
        self.effects.iter().find(found)
    }

    /// Adds an effect without a value. False if the model has it already; then nothing changes.
    pub fn add_effect(&mut self, effect: EffectKind, joint: usize) -> bool {
        if self.effect(effect, joint).is_some() {
            return false;
        }
        self.effects.push(ModelEffect {
            effect,
            joint,
            estimates: [None; MAX_PARAMETERS],
            prior: None,
            witnesses: [None; 3],
            just_added: false,
        });
        self.effects
            .sort_by_key(|e| (e.joint, catalogue::order(e.effect)));
        true
    }

    /// Adds effects, and says of these alone that they were added last. Returns those that the model did not have; if it had
    /// all, nothing changes.
    pub fn add_last(&mut self, places: &[(EffectKind, usize)]) -> Vec<(EffectKind, usize)> {
        let mut added = Vec::new();
        for &(effect, joint) in places {
            if self.add_effect(effect, joint) {
                added.push((effect, joint));
            }
        }
        if !added.is_empty() {
            for e in &mut self.effects {
                e.just_added = added.contains(&(e.effect, e.joint));
            }
        }
        added
    }

    /// Puts effects back as they were taken out, values and all, where the model has none of their kind.
    pub fn put_back(&mut self, effects: &[ModelEffect]) {
        for e in effects {
            if self.add_effect(e.effect, e.joint) {
                *self.entry(e.effect, e.joint) = *e;
            }
        }
    }

    /// No effect is what was added last any more.
    pub fn forget_last_added(&mut self) {
        for e in &mut self.effects {
            e.just_added = false;
        }
    }

    /// Sets an effect's identified value (rounded as [`set_body`](Self::set_body) does), adding the effect if necessary.
    ///
    /// # Errors
    /// [`Impossible`] if the value is out of the effect's bounds; then nothing changes.
    pub fn set_effect(
        &mut self,
        effect: EffectKind,
        joint: usize,
        value: f64,
        std: Option<f64>,
    ) -> Result<(), Impossible> {
        self.set_parameter(effect, joint, 0, value, std)
    }

    /// Sets one parameter of an effect, by its place in the catalogue's description, as [`set_effect`](Self::set_effect)
    /// does the first.
    ///
    /// # Errors
    /// [`Impossible`] if the value is out of the parameter's bounds; then nothing changes.
    pub fn set_parameter(
        &mut self,
        effect: EffectKind,
        joint: usize,
        parameter: usize,
        value: f64,
        std: Option<f64>,
    ) -> Result<(), Impossible> {
        let (value, std) = (rounded(value), std.map(rounded));
        self.place_parameter(effect, joint, parameter, value, std)
    }

    /// [`set_parameter`](Self::set_parameter) to the last digit.
    pub(super) fn place_parameter(
        &mut self,
        effect: EffectKind,
        joint: usize,
        parameter: usize,
        value: f64,
        std: Option<f64>,
    ) -> Result<(), Impossible> {
        in_bounds(effect, parameter, value)?;
        let std = std.map(deviation).transpose()?;
        self.entry(effect, joint).estimates[parameter] = Some(Estimate { value, std });
        Ok(())
    }

    /// Sets what an effect at a joint is taken to be before any data, adding the effect if necessary.
    ///
    /// # Errors
    /// [`Impossible`] if the mean is out of the effect's bounds or the standard deviation is not positive.
    pub fn set_effect_prior(
        &mut self,
        effect: EffectKind,
        joint: usize,
        prior: Prior,
    ) -> Result<(), Impossible> {
        let prior = possible(effect, prior)?;
        self.entry(effect, joint).prior = Some(prior);
        Ok(())
    }

    /// Sets what an effect is taken to be before any data at all joints that do not say otherwise.
    ///
    /// # Errors
    /// As [`set_effect_prior`](Self::set_effect_prior).
    pub fn set_general_prior(
        &mut self,
        effect: EffectKind,
        prior: Prior,
    ) -> Result<(), Impossible> {
        let prior = possible(effect, prior)?;
        self.effect_priors.retain(|(kind, _)| *kind != effect);
        self.effect_priors.push((effect, prior));
        self.effect_priors
            .sort_by_key(|(kind, _)| catalogue::order(*kind));
        Ok(())
    }

    /// Takes an effect away; false if the model does not have it.
    pub fn remove_effect(&mut self, effect: EffectKind, joint: usize) -> bool {
        let before = self.effects.len();
        self.effects
            .retain(|e| (e.effect, e.joint) != (effect, joint));
        self.effects.len() < before
    }

    /// What an effect is taken to be at a joint before any data: what the file says of this joint, of all joints, or the
    /// catalogue for the joint's motor.
    pub fn effect_prior(&self, effect: EffectKind, joint: usize) -> EffectPrior {
        self.effect_prior_at(effect, joint, joint)
    }

    /// The same at a `site`, which is a joint or the [`BASE`]: there the catalogue's is that for the motor of `joint`.
    pub(crate) fn effect_prior_at(
        &self,
        effect: EffectKind,
        site: usize,
        joint: usize,
    ) -> EffectPrior {
        let own = self.effect(effect, site).and_then(|e| e.prior);
        let general = self.effect_priors.iter().find(|(kind, _)| *kind == effect);
        let prior = own
            .or(general.map(|(_, prior)| *prior))
            .unwrap_or_else(|| self.robot.effect_prior(effect, joint));
        let parameter = &effect.description().parameters[0];
        EffectPrior {
            prior,
            lower: parameter.lower,
            upper: parameter.upper,
        }
    }

    pub(super) fn entry(&mut self, effect: EffectKind, joint: usize) -> &mut ModelEffect {
        self.add_effect(effect, joint);
        let found = |e: &ModelEffect| e.effect == effect && e.joint == joint;
        let index = self.effects.iter().position(found).unwrap_or_default();
        &mut self.effects[index]
    }
}

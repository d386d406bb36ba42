//! A limb of a model as the core takes it: tree, columns, prior, parameters.

use proprio_core::effect::EffectKind;
use proprio_core::estimator::{EffectPrior, Layout, LimbPrior};
use proprio_core::inertia::{INERTIAL, NAMES, UNITS};
use proprio_core::tree::Tree;

use super::{Limb, Model};

/// One entry of a limb's θ.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelParameter {
    /// `m:FR_hip`, `coulomb:FR_hip`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// The model's value; zero for an effect that the model does not have, or that has no value yet.
    pub value: f64,
    /// Its standard deviation, once identified.
    pub std: Option<f64>,
}

impl Model {
    /// A limb as the core's tree, with the model's inertial parameters; `None` if the limb does not have `B` bodies.
    pub fn limb_tree<const B: usize>(&self, limb: &Limb) -> Option<Tree<f64, B, B>> {
        self.robot
            .limb_tree(limb, |b| (self.placement(b), *self.inertia(b)))
    }

    /// The same, filled up to `B` bodies by some without mass that hang on the last one; `None` for a limb of more.
    pub(crate) fn filled_limb_tree<const B: usize>(&self, limb: &Limb) -> Option<Tree<f64, B, B>> {
        self.robot
            .filled_limb_tree(limb, |b| (self.placement(b), *self.inertia(b)))
    }

    /// The effects that the model has at a limb's joints, in the order of the core's θ.
    pub fn limb_effects(&self, limb: &Limb) -> Vec<(usize, EffectKind)> {
        let of_limb = self
            .effects
            .iter()
            .filter(|e| limb.bodies.contains(&e.joint));
        of_limb.map(|e| (e.joint, e.effect)).collect()
    }

    /// The core's columns for a limb with `effects`, joint by joint; `None` if the limb does not have `B` bodies.
    pub fn layout<const B: usize>(
        &self,
        limb: &Limb,
        effects: &[(usize, EffectKind)],
    ) -> Option<Layout<B>> {
        let first = limb.bodies.start;
        let ends: Vec<usize> = limb
            .bodies
            .clone()
            .map(|b| self.robot.subtree(b).end - first)
            .collect();
        let at = |joint: usize| effects.iter().filter(|(j, _)| *j == joint).count();
        let counts: Vec<usize> = limb.bodies.clone().map(at).collect();
        Layout::new(B, ends.try_into().ok()?, counts.try_into().ok()?)
    }

    /// What is taken to be true of a limb with `effects`, joint by joint, before any data: the CAD's bodies and the effects'
    /// priors. `None` if the limb does not have `B` bodies.
    pub fn prior<const B: usize>(
        &self,
        limb: &Limb,
        effects: &[(usize, EffectKind)],
    ) -> Option<LimbPrior<f64, Vec<EffectPrior>, B>> {
        let bodies = || limb.bodies.clone();
        let cad: Vec<_> = bodies().map(|b| self.robot.bodies()[b].inertia).collect();
        let uncertainty: Vec<_> = bodies().map(|b| self.cad_uncertainty(b)).collect();
        let effects = effects.iter();
        let effects = effects.map(|&(joint, effect)| self.effect_prior(effect, joint));
        Some(LimbPrior::new(
            cad.try_into().ok()?,
            uncertainty.try_into().ok()?,
            effects.collect(),
        ))
    }

    /// A limb's parameters in the order of the core's θ: ten per body, then `effects`, joint by joint.
    pub fn parameters(&self, limb: &Limb, effects: &[(usize, EffectKind)]) -> Vec<ModelParameter> {
        let inertial = limb.bodies.clone().flat_map(|b| {
            (0..INERTIAL).map(move |k| ModelParameter {
                name: format!("{}:{}", NAMES[k], self.robot.bodies()[b].name),
                unit: UNITS[k],
                value: self.inertia(b).0[k],
                std: self.inertia_std(b).map(|std| std[k]),
            })
        });
        let added = effects.iter().map(|&(joint, effect)| {
            let estimate = self.effect(effect, joint).and_then(|e| e.estimate());
            ModelParameter {
                name: format!("{}:{}", effect.name(), self.robot.bodies()[joint].name),
                unit: self.unit(effect, joint, 0),
                value: estimate.map_or(0.0, |e| e.value),
                std: estimate.and_then(|e| e.std),
            }
        });
        inertial.chain(added).collect()
    }
}

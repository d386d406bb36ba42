//! What a limb's parameters are before data, which of them there are, and what becomes of their values when the data are gone
//! over again.

use proprio_core::effect::{EffectKind, Form};
use proprio_core::inertia::INERTIAL;

use super::super::column::{BASE, Columns, Entry, columns_of};
use super::super::dot::dot;
use super::super::motion::{Corrections, MotorSide};
use super::gap::STEP;
use super::{LimbCriticism, Place};

/// A load lighter than this is nowhere in particular, kg.
pub(super) const LEAST_LOAD: f64 = 0.01;

impl LimbCriticism<'_> {
    /// The value of an effect's shape parameter at a joint; one where it has none.
    pub(crate) fn shape(&self, place: Place) -> f64 {
        if let Some((_, shape)) = self.shapes.iter().find(|(known, _)| *known == place) {
            return *shape;
        }
        let shape = place.0.description().shape();
        shape.map_or(1.0, |n| self.catalogue_prior(place, n).0)
    }

    /// Whether the model file gives the shape.
    pub(crate) fn is_shape_given(&self, (effect, joint): Place) -> bool {
        let Some(n) = effect.description().shape() else {
            return true;
        };
        let model = self.model.effect(effect, self.limb.bodies.start + joint);
        model.is_some_and(|e| e.estimates[n].is_some())
    }

    /// A joint's gear ratio; one where the motor is not known.
    pub(crate) fn gear(&self, joint: usize) -> f64 {
        let body = &self.model.robot().bodies()[self.limb.bodies.start + joint];
        body.motor.map_or(1.0, |motor| motor.gear)
    }

    pub(crate) fn set_shape(&mut self, place: Place, shape: f64) {
        self.shapes.retain(|(known, _)| *known != place);
        self.shapes.push((place, shape));
    }

    /// Mean and standard deviation of a parameter before any data.
    pub(super) fn catalogue_prior(&self, (effect, joint): Place, parameter: usize) -> (f64, f64) {
        let body = if joint == BASE {
            self.limb.bodies.start
        } else {
            self.limb.bodies.start + joint
        };
        let prior = match parameter {
            0 => self.model.effect_prior(effect, body).prior,
            n => self.model.robot().parameter_prior(effect, body, n),
        };
        (prior.mean, prior.std)
    }

    /// Whether the recording can tell an effect at all.
    fn observable(&self, effect: EffectKind) -> bool {
        match effect {
            EffectKind::ThermalViscous => self.recording.temperature.iter().all(|t| t.is_finite()),
            // Positions tell the velocity's gain: see `super::velocity`.
            EffectKind::VelocityGain => false,
            _ => effect.description().form != Form::Force,
        }
    }

    /// Every effect that the model does not have, where it could be.
    pub(super) fn possible(&self) -> Vec<Place> {
        if !self.with_candidates {
            return Vec::new();
        }
        let joints = self.recording.joints;
        let all = EffectKind::ALL
            .iter()
            .filter(|e| self.observable(**e))
            .flat_map(|&effect| {
                let places = if effect.description().form == Form::Gravity {
                    BASE..=BASE
                } else {
                    0..=joints - 1
                };
                places.map(move |joint| (effect, joint))
            });
        // Beside Coulomb friction it is a bias but at rest, with one parameter more.
        let twice = |(effect, joint): &Place| {
            *effect == EffectKind::AsymmetricCoulomb
                && self.active.contains(&(EffectKind::Coulomb, *joint))
        };
        all.filter(|place| !self.active.contains(place) && !twice(place))
            .collect()
    }

    pub(super) fn entries_of(&self, place: Place, candidate: bool) -> Vec<Entry> {
        let (effect, joint) = place;
        if effect == EffectKind::VelocityGain {
            // Known from positions and taken out of the data.
            return Vec::new();
        }
        let parameters = effect.description().parameters;
        columns_of(effect, joint, self.shape(place))
            .into_iter()
            .map(|(parameter, column)| {
                let (mean, std) = self.catalogue_prior(place, parameter);
                let neutral = parameters[parameter].neutral;
                let none = Corrections::none(self.recording.joints);
                let correction = self.corrections.get(effect, joint, parameter)
                    - none.get(effect, joint, parameter);
                let (mean, std) = if effect == EffectKind::Backlash && correction > 0.0 {
                    // Found by trying: the column is true near it only.
                    (0.0, STEP * correction)
                } else if candidate {
                    (0.0, std.max((mean - neutral).abs()))
                } else {
                    (mean - neutral - correction, std)
                };
                Entry {
                    effect: Some(effect),
                    joint,
                    parameter,
                    mean,
                    std,
                    column,
                }
            })
            .collect()
    }

    /// The present θ in the order of other columns; before there is one, the CAD.
    pub(super) fn carried(&self, columns: &Columns) -> Vec<f64> {
        let same = |a: &Entry, b: &Entry| {
            (a.effect, a.joint, a.parameter) == (b.effect, b.joint, b.parameter)
        };
        let value = |entry: &Entry| {
            let known = self.columns.entries.iter().position(|old| same(old, entry));
            match (known.and_then(|k| self.fit.theta.get(k)), entry.effect) {
                (Some(value), _) => *value,
                (None, None) => {
                    self.model.inertia(self.limb.bodies.start + entry.joint).0[entry.parameter]
                }
                (None, Some(_)) => 0.0,
            }
        };
        columns.entries.iter().map(value).collect()
    }

    /// Moves what the fit says of corrections into them.
    pub(super) fn absorb(&mut self) {
        for k in 0..self.fit.theta.len() {
            let entry = &self.columns.entries[k];
            let Some(effect) = entry.effect else { continue };
            if effect == EffectKind::Backlash {
                // Another gap is another motion of the link, not one a little farther.
                continue;
            }
            if let Some(correction) = self
                .corrections
                .get_mut(effect, entry.joint, entry.parameter)
            {
                *correction += std::mem::take(&mut self.fit.theta[k]);
            }
        }
        for body in 0..self.loads.len() {
            if self.active.contains(&(EffectKind::Payload, body)) {
                self.move_load(body);
            }
        }
    }

    /// Takes a load to be where the fit has its centre: from there on its first moment is zero.
    fn move_load(&mut self, body: usize) {
        let entries = self.columns.of_effect(EffectKind::Payload, body);
        let [mass, moment @ ..] = &entries[..] else {
            return;
        };
        let mass = self.fit.theta[*mass];
        if mass < LEAST_LOAD {
            return;
        }
        for (axis, entry) in moment.iter().enumerate().take(3) {
            self.loads[body][axis] += std::mem::take(&mut self.fit.theta[*entry]) / mass;
        }
    }

    /// What the motors take up, as far as the model knows: as fitted, and before there is a fit as the catalogue expects it.
    pub(super) fn motors(&self) -> Vec<MotorSide> {
        let value = |effect: EffectKind, joint: usize| {
            if !self.active.contains(&(effect, joint)) {
                return 0.0;
            }
            let (mean, _) = self.catalogue_prior((effect, joint), 0);
            let fitted = self.columns.of_effect(effect, joint);
            let fitted = fitted.first().and_then(|&k| self.fit.theta.get(k));
            match fitted {
                Some(value) if !self.fit.noise.is_empty() => *value,
                _ => mean,
            }
        };
        let of = |joint: usize| MotorSide {
            armature: value(EffectKind::Armature, joint),
            viscous: value(EffectKind::Viscous, joint),
            coulomb: value(EffectKind::Coulomb, joint),
            bias: value(EffectKind::Bias, joint),
            link: self.inertia_at(joint),
        };
        (0..self.recording.joints).map(of).collect()
    }

    /// The inertia that a joint turns with the others at rest, in the middle of its range in this recording, kg m².
    fn inertia_at(&self, joint: usize) -> f64 {
        let n = self.recording.joints;
        let count = self.recording.len().max(1) as f64;
        let mean = |j: usize| self.recording.q.iter().skip(j).step_by(n).sum::<f64>() / count;
        let q: Vec<f64> = (0..n).map(mean).collect();
        let torque = |acceleration: f64| -> f64 {
            let mut ddq = vec![0.0; n];
            ddq[joint] = acceleration;
            let width = INERTIAL * n;
            let mut rows = vec![0.0; n * width];
            self.body
                .torque_regressor(&self.base, [&q, &vec![0.0; n], &ddq], &mut rows);
            dot(
                &rows[joint * width..(joint + 1) * width],
                &self.fit.theta[..width],
            )
        };
        (torque(1.0) - torque(0.0)).max(1e-4)
    }

    /// θ as the model file gives it: the CAD where it gives no body, zero where an effect has no value.
    pub(crate) fn given(&self) -> Vec<f64> {
        let first = self.limb.bodies.start;
        let value = |entry: &Entry| {
            let Some(effect) = entry.effect else {
                return self.model.inertia(first + entry.joint).0[entry.parameter];
            };
            let joint = if entry.joint == BASE {
                BASE
            } else {
                first + entry.joint
            };
            let estimate = self
                .model
                .effect(effect, joint)
                .and_then(|e| e.estimates[entry.parameter]);
            let is_column = self
                .corrections
                .clone()
                .get_mut(effect, entry.joint, entry.parameter)
                .is_none();
            match estimate {
                // The load is where its first moment is zero.
                _ if effect == EffectKind::Payload && (1..=3).contains(&entry.parameter) => 0.0,
                Some(estimate) if is_column => {
                    estimate.value - effect.description().parameters[entry.parameter].neutral
                }
                // A correction has been taken out of the data.
                _ => 0.0,
            }
        };
        self.columns.entries.iter().map(value).collect()
    }
}

//! One number, several witnesses: what poses, frequency responses and motion logs each measured of an effect, and what follows of them together.
//!
//! A joint's spring sags under gravity (`calibrate`), swings (`frf`) and lags (`identify`): the same 1/k. The file keeps what each witness measured,
//! so that a witness that measures again replaces its own number and no data count twice. Numbers that agree are combined by their standard
//! deviations; of numbers that do not, the last one holds, and the disagreement is reported.

use proprio_core::effect::EffectKind;
use serde::Serialize;

use super::kinematics::{Correction, LINK_ELASTICITY, rounded};
use super::{Estimate, Impossible, JointQuantity, Model, ModelEffect, possible};
use crate::parameter::{name_at, of_effect};

/// Chi² of one and of two degrees of freedom that one set in a thousand exceeds by chance: beyond it witnesses contradict each other.
const CONTRADICTS: [f64; 2] = [10.83, 13.82];

/// Who measured a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Witness {
    /// Motion logs; a number that a file states without its witness counts as theirs.
    Motion,
    /// Measured poses under gravity.
    Poses,
    /// Frequency responses.
    Responses,
}

impl Witness {
    /// All of them, in the order of files.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Poses, Self::Responses];

    /// Its key in files and JSON.
    pub fn key(self) -> &'static str {
        ["motion", "poses", "responses"][self as usize]
    }
}

/// What one witness measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Measured {
    /// Who.
    pub by: Witness,
    /// Value, in the parameter's unit.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

impl Measured {
    /// Whether another witness's number may be of the same quantity.
    pub(crate) fn agrees_with(&self, other: &Self) -> bool {
        let both = [*self, *other];
        agree(&both, combined(&both).2)
    }
}

/// A number that several witnesses measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Witnessed {
    /// `elasticity:A2`.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// What each measured.
    pub measured: Vec<Measured>,
    /// Weighted squares of their differences from their mean: chi² of one degree of freedom less than there are witnesses.
    pub chi_squared: f64,
    /// Whether they agree; then the model has their combination.
    pub agree: bool,
    /// What the model has.
    pub value: f64,
    /// Its standard deviation.
    pub std: Option<f64>,
}

impl std::fmt::Display for Witnessed {
    /// `elasticity:A2: motion 8.00e-7 ± 1.0e-8, poses 4.02e-7 ± 2.1e-9 rad/(N m) contradict each other (chi² 1520.0)`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let each = self.measured.iter();
        let each = each.map(|m| format!("{} {:.3e} ± {:.1e}", m.by.key(), m.value, m.std));
        let verdict = if self.agree {
            "agree"
        } else {
            "contradict each other"
        };
        write!(
            f,
            "{}: {} {} {verdict} (chi² {:.1})",
            self.name,
            each.collect::<Vec<_>>().join(", "),
            self.unit,
            self.chi_squared
        )
    }
}

/// The mean of independent numbers weighted by their standard deviations, its own, and chi² about it.
fn combined(of: &[Measured]) -> (f64, f64, f64) {
    let weight = |m: &Measured| m.std.powi(-2);
    let sum: f64 = of.iter().map(weight).sum();
    let mean = of.iter().map(|m| weight(m) * m.value).sum::<f64>() / sum;
    let chi_squared = of.iter().map(|m| weight(m) * (m.value - mean).powi(2));
    (mean, sum.sqrt().recip(), chi_squared.sum())
}

/// Whether numbers with this chi² are of one quantity.
fn agree(of: &[Measured], chi_squared: f64) -> bool {
    let limit = of.len().checked_sub(2).and_then(|n| CONTRADICTS.get(n));
    limit.is_none_or(|limit| chi_squared <= *limit)
}

/// What each witness measured of a number; one that the file states alone is of `usual`.
fn by_witness(
    witnesses: [Option<Estimate>; 3],
    stated: Option<Estimate>,
    usual: Witness,
) -> Vec<Measured> {
    let slots = Witness::ALL.iter().zip(witnesses);
    let mut all: Vec<Measured> = slots.filter_map(|(by, own)| known(*by, own?)).collect();
    if all.is_empty() {
        all.extend(stated.and_then(|own| known(usual, own)));
    }
    all
}

/// The entries of a file for what each witness measured.
fn slots(of: &[Measured]) -> [Option<Estimate>; 3] {
    Witness::ALL.map(|by| {
        let own = of.iter().find(|m| m.by == by)?;
        Some(Estimate {
            value: own.value,
            std: Some(own.std),
        })
    })
}

/// The combination of several numbers that agree.
fn agreed(of: &[Measured]) -> Option<(f64, f64)> {
    let (mean, std, chi_squared) = combined(of);
    (of.len() > 1 && agree(of, chi_squared)).then_some((mean, std))
}

/// What the others than `by` say together, if there are any and they agree.
fn others(mut all: Vec<Measured>, by: Witness) -> Option<Measured> {
    all.retain(|m| m.by != by);
    let first = *all.first()?;
    let (value, std, chi_squared) = combined(&all);
    agree(&all, chi_squared).then_some(Measured {
        value,
        std,
        ..first
    })
}

impl ModelEffect {
    /// What witnesses measured of the first parameter; one that the file states alone is of [`Witness::Motion`].
    fn measured(&self) -> Vec<Measured> {
        by_witness(self.witnesses, self.estimate(), Witness::Motion)
    }
}

impl Correction {
    /// What witnesses measured of it; what the file states alone is of [`Witness::Poses`].
    fn measured(&self) -> Vec<Measured> {
        by_witness(self.witnesses, Some(self.estimate), Witness::Poses)
    }
}

/// A number whose standard deviation says how much it weighs.
fn known(by: Witness, Estimate { value, std }: Estimate) -> Option<Measured> {
    let std = std.filter(|std| *std > 0.0)?;
    Some(Measured { by, value, std })
}

impl Model {
    /// What the other witnesses say together of a spring, a bend or a gap, if there are any and they agree.
    pub(crate) fn others(
        &self,
        joint: usize,
        quantity: JointQuantity,
        by: Witness,
    ) -> Option<Measured> {
        let all = match quantity.effect() {
            Some(effect) => self.effect(effect, joint)?.measured(),
            None => self.correction(joint, quantity)?.measured(),
        };
        others(all, by)
    }

    /// Takes in what a witness measured of an effect's first parameter, in place of what it measured before: combined with what the others say,
    /// or, where they contradict it, as it is. Adds the effect if necessary.
    ///
    /// # Errors
    /// [`Impossible`] if the value is out of the effect's bounds; then nothing changes.
    pub fn set_measured(
        &mut self,
        effect: EffectKind,
        joint: usize,
        by: Witness,
        value: f64,
        std: f64,
    ) -> Result<(), Impossible> {
        let before = self.effect(effect, joint);
        let mut all = before.map_or_else(Vec::new, ModelEffect::measured);
        all.retain(|m| m.by != by);
        self.set_effect(effect, joint, value, Some(std))?;
        // The number alone says all.
        if all.is_empty() && by == Witness::Motion {
            return Ok(());
        }
        let own = self.effect(effect, joint).and_then(ModelEffect::estimate);
        all.extend(own.and_then(|own| known(by, own)));
        self.entry(effect, joint).witnesses = slots(&all);
        if let Some((mean, spread)) = agreed(&all) {
            self.set_effect(effect, joint, mean, Some(spread))?;
        }
        Ok(())
    }

    /// The same of a bend.
    ///
    /// # Errors
    /// [`Impossible`] if the value is not finite; then nothing changes.
    pub(super) fn set_measured_bend(
        &mut self,
        (joint, quantity): (usize, JointQuantity),
        by: Witness,
        value: f64,
        std: f64,
    ) -> Result<(), Impossible> {
        possible::finite(quantity.key(), value)?;
        possible::deviation(std)?;
        let before = self.correction(joint, quantity);
        let mut all = before.map_or_else(Vec::new, Correction::measured);
        all.retain(|m| m.by != by);
        let is_alone = all.is_empty() && by == Witness::Poses;
        let own = rounded(value, std);
        all.extend(known(by, own));
        let estimate = agreed(&all).map_or(own, |(mean, std)| rounded(mean, std));
        self.place_correction(Correction {
            joint,
            quantity,
            estimate,
            witnesses: if is_alone { [None; 3] } else { slots(&all) },
        });
        Ok(())
    }

    /// Puts a correction back without what one witness measured, if anything is left of it.
    pub(super) fn keep_others(&mut self, correction: Correction, by: Witness) {
        let all = correction.measured();
        if let Some(rest) = others(all.clone(), by) {
            let left: Vec<Measured> = all.into_iter().filter(|m| m.by != by).collect();
            self.place_correction(Correction {
                estimate: rounded(rest.value, rest.std),
                witnesses: slots(&left),
                ..correction
            });
        }
    }

    /// Takes the values that effects have as measured by motion, where other witnesses have measured them too; whether there are any.
    pub fn take_as_measured_by_motion(&mut self) -> bool {
        let has_others = |e: &&ModelEffect| e.witnesses[1..].iter().any(Option::is_some);
        let own: Vec<ModelEffect> = self.effects().iter().filter(has_others).copied().collect();
        let mut any = false;
        for e in &own {
            if let Some(Estimate {
                value,
                std: Some(std),
            }) = e.estimate()
            {
                // The model has the value already, so that it is possible.
                let set = self.set_measured(e.effect, e.joint, Witness::Motion, value, std);
                any |= set.is_ok();
            }
        }
        any
    }

    /// Every number that more than one witness measured.
    pub fn witnessed(&self) -> Vec<Witnessed> {
        let of = |measured: Vec<Measured>, own: Estimate, name: String, unit| {
            let (.., chi_squared) = combined(&measured);
            (measured.len() > 1).then(|| Witnessed {
                name,
                unit,
                agree: agree(&measured, chi_squared),
                chi_squared,
                measured,
                value: own.value,
                std: own.std,
            })
        };
        let effects = self.effects().iter().filter_map(|e| {
            let name = of_effect(e.effect, 0, self.joint_name(e.joint));
            let unit = self.unit(e.effect, e.joint, 0);
            of(e.measured(), e.estimate()?, name, unit)
        });
        let bends = self.kinematics().corrections.iter().filter_map(|own| {
            let name = self.bend_parameter((own.joint, own.quantity));
            of(own.measured(), own.estimate, name, own.quantity.unit(false))
        });
        effects.chain(bends).collect()
    }

    /// What a bend is called among parameters: `bend_1:link_elasticity:elbow`.
    pub(crate) fn bend_parameter(&self, (joint, quantity): (usize, JointQuantity)) -> String {
        let effect = name_at(LINK_ELASTICITY, self.joint_name(joint));
        name_at(quantity.key(), &effect)
    }

    /// What [`witnessed`](Self::witnessed) numbers contradict each other, in words.
    pub fn contradictions(&self) -> impl Iterator<Item = String> {
        let all = self.witnessed().into_iter().filter(|one| !one.agree);
        all.map(|one| {
            let surest = one.measured.iter().min_by(|a, b| a.std.total_cmp(&b.std));
            let surest = surest.map_or("", |m| m.by.key());
            format!("{one}: the model has the last one measured; the surest is by {surest}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRING: EffectKind = EffectKind::Elasticity;

    fn has(model: &Model) -> (f64, f64) {
        let own = model.effect(SPRING, 2).unwrap().estimate().unwrap();
        (own.value, own.std.unwrap())
    }

    #[test]
    fn witnesses_that_agree_are_combined_and_none_counts_twice() {
        let mut model = Model::default();
        model.set_effect(SPRING, 2, 1.0e-3, Some(1e-4)).unwrap();
        model
            .set_measured(SPRING, 2, Witness::Responses, 1.1e-3, 1e-4)
            .unwrap();
        let (value, std) = has(&model);
        assert!((value - 1.05e-3).abs() < 1e-12, "{value}");
        assert!((std - 1e-4 / 2.0_f64.sqrt()).abs() < 1e-12, "{std}");
        // The same witness again: its number is replaced.
        model
            .set_measured(SPRING, 2, Witness::Responses, 1.1e-3, 1e-4)
            .unwrap();
        assert_eq!(has(&model), (value, std));
        // A third one.
        model
            .set_measured(SPRING, 2, Witness::Poses, 1.05e-3, 1e-4)
            .unwrap();
        assert!((has(&model).1 - 1e-4 / 3.0_f64.sqrt()).abs() < 1e-12);
        let all = model.witnessed();
        assert_eq!(all[0].measured.len(), 3);
        assert!(all[0].agree && (all[0].chi_squared - 0.5).abs() < 1e-9);
        assert_eq!(model.contradictions().count(), 0);
        // Motion measures again: a fit sets the value, which is then the third number.
        model.set_effect(SPRING, 2, 1.2e-3, Some(1e-4)).unwrap();
        assert!(model.take_as_measured_by_motion());
        assert!((has(&model).0 - (1.2e-3 + 1.1e-3 + 1.05e-3) / 3.0).abs() < 1e-12);
    }

    #[test]
    fn witnesses_that_contradict_are_not_combined_and_both_are_named() {
        let mut model = Model::default();
        model.set_effect(SPRING, 2, 2.0e-3, Some(1e-5)).unwrap();
        model
            .set_measured(SPRING, 2, Witness::Poses, 1.0e-3, 1e-5)
            .unwrap();
        assert_eq!(has(&model), (1.0e-3, 1e-5));
        let words: Vec<String> = model.contradictions().collect();
        assert_eq!(words.len(), 1);
        for part in [
            "elasticity:FR_calf",
            "motion 2.000e-3",
            "poses 1.000e-3",
            "chi² 5000.0",
        ] {
            assert!(words[0].contains(part), "{part}: {}", words[0]);
        }
        assert_eq!(
            model
                .others(2, JointQuantity::Elasticity, Witness::Poses)
                .unwrap()
                .value,
            2.0e-3
        );
    }

    /// Bends follow the same rule; a new calibration forgets what poses measured, not what responses did.
    #[test]
    fn a_bend_by_poses_and_responses_is_combined_and_outlives_a_calibration() {
        let mut model = Model::default();
        let place = (2, JointQuantity::BendSecond);
        let set = |model: &mut Model, by, value| {
            model
                .set_joint_quantity(place.0, place.1, by, value, 1e-6)
                .unwrap();
        };
        let has = |model: &Model| model.joint_quantity(place.0, place.1).map(|e| e.value);
        set(&mut model, Witness::Poses, 1.0e-5);
        assert_eq!(
            model.correction(place.0, place.1).unwrap().witnesses,
            [None; 3]
        );
        set(&mut model, Witness::Responses, 1.1e-5);
        assert!((has(&model).unwrap() - 1.05e-5).abs() < 1e-12);
        let all = model.witnessed();
        assert_eq!(all[0].name, "bend_2:link_elasticity:FR_calf");
        assert!(all[0].agree && all[0].measured.len() == 2);
        model.clear_kinematics();
        assert_eq!(has(&model), Some(1.1e-5));
        set(&mut model, Witness::Poses, 3.0e-5);
        assert_eq!(has(&model), Some(3.0e-5));
        assert_eq!(model.contradictions().count(), 1);
    }

    #[test]
    fn a_number_of_one_witness_has_no_table_of_its_own() {
        let mut model = Model::default();
        model
            .set_measured(SPRING, 2, Witness::Motion, 1e-3, 1e-4)
            .unwrap();
        assert_eq!(model.effect(SPRING, 2).unwrap().witnesses, [None; 3]);
        assert!(model.witnessed().is_empty());
        assert!(!model.take_as_measured_by_motion());
    }
}

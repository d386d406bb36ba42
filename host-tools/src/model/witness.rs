//! One number, several witnesses: what poses, frequency responses and motion logs each measured of an effect, and what follows of them together.
//!
//! A joint's spring sags under gravity (`calibrate`), swings (`frf`) and lags (`identify`): the same 1/k. The file keeps what each witness measured,
//! so that a witness that measures again replaces its own number and no data count twice. Numbers that agree are combined by their standard
//! deviations; of numbers that do not, the last one holds, and the disagreement is reported.

use proprio_core::effect::EffectKind;
use serde::Serialize;

use super::{Estimate, Impossible, Model, ModelEffect};
use crate::parameter::of_effect;

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

impl ModelEffect {
    /// What witnesses measured of the first parameter; one that the file states alone is of [`Witness::Motion`].
    fn measured(&self) -> Vec<Measured> {
        let slots = Witness::ALL.iter().zip(self.witnesses);
        let mut all: Vec<Measured> = slots.filter_map(|(by, own)| known(*by, own?)).collect();
        if all.is_empty() {
            all.extend(self.estimate().and_then(|own| known(Witness::Motion, own)));
        }
        all
    }
}

/// A number whose standard deviation says how much it weighs.
fn known(by: Witness, Estimate { value, std }: Estimate) -> Option<Measured> {
    let std = std.filter(|std| *std > 0.0)?;
    Some(Measured { by, value, std })
}

impl Model {
    /// What the other witnesses say together of an effect's first parameter, if there are any and they agree.
    pub(crate) fn others(&self, effect: EffectKind, joint: usize, by: Witness) -> Option<Measured> {
        let mut others = self.effect(effect, joint)?.measured();
        others.retain(|m| m.by != by);
        let first = *others.first()?;
        let (value, std, chi_squared) = combined(&others);
        agree(&others, chi_squared).then_some(Measured {
            value,
            std,
            ..first
        })
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
        for (slot, by) in self
            .entry(effect, joint)
            .witnesses
            .iter_mut()
            .zip(Witness::ALL)
        {
            let own = all.iter().find(|m| m.by == by);
            *slot = own.map(|m| Estimate {
                value: m.value,
                std: Some(m.std),
            });
        }
        let (mean, spread, chi_squared) = combined(&all);
        if all.len() > 1 && agree(&all, chi_squared) {
            self.set_effect(effect, joint, mean, Some(spread))?;
        }
        Ok(())
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
        let of = |e: &ModelEffect| {
            let measured = e.measured();
            let own = e.estimate().filter(|_| measured.len() > 1)?;
            let (.., chi_squared) = combined(&measured);
            Some(Witnessed {
                name: of_effect(e.effect, 0, self.joint_name(e.joint)),
                unit: self.unit(e.effect, e.joint, 0),
                agree: agree(&measured, chi_squared),
                chi_squared,
                measured,
                value: own.value,
                std: own.std,
            })
        };
        self.effects().iter().filter_map(of).collect()
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
            model.others(SPRING, 2, Witness::Poses).unwrap().value,
            2.0e-3
        );
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

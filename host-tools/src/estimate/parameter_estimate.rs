//! Estimates of parameters, wherever they were made: their errors, their standing against the prior, their table.

use proprio_core::consistent::body;
use proprio_core::effect::EffectKind;
use proprio_core::estimator::{
    CAD_UNCERTAINTY, LEG_INERTIAL, LegFactors, LegPrior, LegSolver, LegVector,
};
use proprio_core::factor::FactorError;
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG, JointId, Leg};
use serde::Serialize;

use crate::parameter;
use crate::table::Table;

/// A parameter and what is known of it.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterEstimate {
    /// `m:FR_hip`, `coulomb:FR_hip`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Estimate.
    pub value: f64,
    /// Standard deviation of the estimate under independent residuals.
    pub std: f64,
    /// Value taken to be true before the data.
    pub prior: f64,
    /// Standard deviation of that.
    pub prior_std: f64,
    /// Where the value comes from.
    pub status: Status,
    /// The data would have it beyond what is physical: it is held at the bound, or, in a free fit, lies more than two standard deviations
    /// beyond it.
    pub at_bound: bool,
}

/// Where a parameter's value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The data: they leave at most half of the prior's standard deviation, and an effect that is there by two of its own.
    Identified,
    /// The prior more than the data, or a bound; or an effect that may as well be absent.
    Prior,
    /// The prior alone: the motion does not show the parameter.
    Unexcited,
}

impl Status {
    /// Of a parameter whose prior looks the same from everywhere, if residuals are independent.
    pub(crate) fn of(std: f64, prior_std: f64) -> Self {
        Self::there(std, prior_std, std, prior_std)
    }

    /// The rule: the motion shows a parameter if it takes something off what the prior alone would leave, and the data tell it
    /// if no more than half of that is left.
    ///
    /// The prior may look different from the estimate than from the CAD (`there`), and residuals may remember. Whether the
    /// motion shows anything is asked `there` and of `independent` residuals, else a body that comes out light would be known
    /// by the prior's narrowness alone; how well it is known is asked of what is stated.
    pub(crate) fn there(std: f64, prior_std: f64, independent: f64, there: f64) -> Self {
        match [independent / there, std / prior_std] {
            [seen, left] if seen <= 0.99 && left <= 0.5 => Self::Identified,
            [seen, _] if seen <= 0.99 => Self::Prior,
            _ => Self::Unexcited,
        }
    }
}

/// Whether a fit may take values that no body and no friction can have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Constraint {
    /// It may: what the device streams. An unphysical value tells that the model lacks something.
    #[default]
    Free,
    /// Every body could exist, every friction and rotor inertia is at least zero.
    Physical,
}

/// Values and standard deviations of a leg's parameters before any data.
fn without_data(prior: &LegPrior<f64>) -> Result<[LegVector<f64>; 2], FactorError> {
    let mut solver = LegSolver::default();
    solver.start(prior, &LegFactors::default());
    while !solver.advance()? {}
    let own = |numbers: &[f64]| std::array::from_fn(|k| numbers[k]);
    Ok([own(solver.values()), own(solver.std())])
}

/// The prior as it looks from physical `values`: a body twice as heavy is known half as well.
fn seen_from(prior: &LegPrior<f64>, values: &[f64]) -> LegPrior<f64> {
    let effects = std::array::from_fn(|n| prior.effects()[n]);
    let bodies = std::array::from_fn(|b| body(values, b));
    LegPrior::new(bodies, [CAD_UNCERTAINTY; JOINTS_PER_LEG], effects)
}

/// A leg's parameters as a device tells them: the inertial ones, then the effects that it says it has. `constraint`: which solution it is.
///
/// # Errors
/// [`FactorError`] if the leg has no prior; the Go2's have.
pub fn of_device(
    leg: Leg,
    effects: &[(JointId, EffectKind)],
    values: &[f64],
    std: &[f64],
    constraint: Constraint,
) -> Result<Vec<ParameterEstimate>, FactorError> {
    let number = |from: &[f64], k: usize| from.get(k).copied().unwrap_or(f64::NAN);
    let physical = constraint == Constraint::Physical;
    let known = LegPrior::of(leg);
    let [prior, prior_std] = without_data(&known)?;
    let there = match physical {
        false => prior_std,
        true => without_data(&seen_from(&known, values))?[1],
    };
    let inertial = parameter::names_of_leg(leg)
        .into_iter()
        .take(LEG_INERTIAL)
        .enumerate()
        .map(|(k, (name, unit))| (name, unit, [prior[k], prior_std[k], there[k]], None));
    let effects = effects.iter().map(|&(joint, effect)| {
        let prior = effect.prior(&ACTUATORS[joint.place()]);
        let name = parameter::name(effect.name(), joint);
        let known = [prior.mean, prior.std, prior.std];
        (name, parameter::unit(effect), known, Some(effect))
    });
    let all = inertial.chain(effects).enumerate();
    let estimates = all.map(|(k, (name, unit, [prior, prior_std, there], effect))| {
        let (value, std) = (number(values, k), number(std, k));
        let lower = effect.map(|effect| effect.description().parameters[0].lower);
        let estimate = ParameterEstimate {
            name,
            unit,
            value,
            std,
            prior,
            prior_std,
            status: Status::there(std, prior_std, std, there),
            at_bound: lower.is_some_and(|lower| match physical {
                true => value == lower,
                false => value + 2.0 * std < lower,
            }),
        };
        match effect {
            Some(effect) => estimate.unless_absent(effect, 0),
            None => estimate,
        }
    });
    Ok(estimates.collect())
}

/// The parameter of that name among `parameters`.
pub fn find<'a>(parameters: &'a [ParameterEstimate], name: &str) -> Option<&'a ParameterEstimate> {
    parameters.iter().find(|parameter| parameter.name == name)
}

impl ParameterEstimate {
    /// Whether it is a body's, not an effect's.
    pub fn is_inertial(&self) -> bool {
        let what = self.name.split(':').next();
        parameter::INERTIAL_NAMES
            .iter()
            .any(|(name, _)| Some(*name) == what)
    }

    /// The same of parameter `n` of an effect: at a bound, or within two standard deviations of the value at which the effect is absent,
    /// the data show no more than how large it is at most, and that is not called identified.
    pub(crate) fn unless_absent(self, effect: EffectKind, n: usize) -> Self {
        let parameter = &effect.description().parameters[n];
        // A search that ends at a bound was not held there.
        let at_bound = self.value <= parameter.lower || self.value >= parameter.upper;
        match (at_bound, parameter.shape) {
            (true, _) => self.not_identified(),
            (false, true) => self.unless_at_bound(),
            (false, false) => self.unless_nothing(parameter.neutral),
        }
    }

    /// The same of what is absent at `neutral`.
    pub(crate) fn unless_nothing(self, neutral: f64) -> Self {
        match (self.value - neutral).abs() < 2.0 * self.std {
            true => self.not_identified(),
            false => self.unless_at_bound(),
        }
    }

    /// The same of what is never absent, such as a body.
    pub(crate) fn unless_at_bound(self) -> Self {
        match self.at_bound {
            true => self.not_identified(),
            false => self,
        }
    }

    fn not_identified(mut self) -> Self {
        if self.status == Status::Identified {
            self.status = Status::Prior;
        }
        self
    }

    /// Its value with its standard deviation, and its unit, in words.
    pub(crate) fn told(&self) -> [String; 2] {
        parameter::told(self.value, self.std, self.unit)
    }

    pub(crate) fn cell(&self) -> String {
        let mark = match self.status {
            _ if self.at_bound => "(b)",
            Status::Identified => "   ",
            Status::Prior => "(p)",
            Status::Unexcited => "(u)",
        };
        format!("{} {mark}", self.told()[0])
    }
}

/// What [`effect_table`]'s marks mean.
pub const LEGEND: &str = "± one standard deviation if residuals are independent; (p) prior-dominated, or within 2σ of an absent effect,\n\
                          (u) unexcited: the prior alone, (b) at a bound or beyond it, not identified: the data's own value is unphysical.";

/// A table of what every drive has, joint by joint, with further columns of which the headings, units and cells are given. `find` gives the
/// estimate of that name; an effect that no joint has is left out.
pub fn effect_table<'a, const N: usize>(
    find: impl Fn(&str) -> Option<&'a ParameterEstimate>,
    headings: [[&str; 2]; N],
    rows: &[(String, [String; N])],
) -> Table {
    let of = |effect: EffectKind, joint: &str| find(&parameter::name_at(effect.name(), joint));
    let has = |effect: &EffectKind| rows.iter().any(|(joint, _)| of(*effect, joint).is_some());
    let effects: Vec<EffectKind> = EffectKind::PLAIN.into_iter().filter(has).collect();
    let mut table = Table::default();
    let mut line = |first: &str, effect: &dyn Fn(EffectKind) -> String, further: [String; N]| {
        let cells = effects.iter().map(|&kind| effect(kind));
        table.row([first.to_owned()].into_iter().chain(cells).chain(further));
    };
    let [names, units] = [0, 1].map(|n| headings.map(|heading| heading[n].to_owned()));
    line("joint", &|effect| effect.name().to_owned(), names);
    // Of joints that turn, if any does.
    let unit = |effect: EffectKind| {
        let estimates = rows.iter().filter_map(|(joint, _)| of(effect, joint));
        let units = estimates.map(|estimate| estimate.unit);
        units.max_by_key(|unit| *unit == parameter::unit(effect))
    };
    line(
        "",
        &|effect| unit(effect).unwrap_or_default().to_owned(),
        units,
    );
    for (joint, further) in rows {
        let cell = |effect| of(effect, joint).map_or_else(String::new, ParameterEstimate::cell);
        line(joint, &cell, further.clone());
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A calf half as heavy as the CAD's: the prior there is tighter, residuals that remember make the error larger than it.
    #[test]
    fn what_the_data_moved_is_not_unexcited() {
        assert_eq!(Status::of(0.3, 0.25), Status::Unexcited);
        assert_eq!(Status::there(0.3, 0.5, 0.1, 0.25), Status::Prior);
        assert_eq!(Status::there(0.5, 0.5, 0.25, 0.25), Status::Unexcited);
        assert_eq!(Status::there(0.2, 0.5, 0.1, 0.25), Status::Identified);
        assert_eq!(Status::there(0.2, 0.5, 0.2, 0.2), Status::Unexcited);
    }

    /// What the data know well, by where it lies.
    #[test]
    fn what_is_nothing_or_at_a_bound_is_not_identified() {
        use EffectKind::{Armature, Coulomb, Delay, Stribeck, TorqueGain, Viscous};
        use Status::{Identified, Prior, Unexcited};
        let table = [
            // Within two ± of nothing, and beyond; of a gain nothing is 1.
            (Coulomb, 0, 0.0, 0.23, false, Identified, Prior),
            (Coulomb, 0, 0.019, 0.01, false, Identified, Prior),
            (Coulomb, 0, 0.021, 0.01, false, Identified, Identified),
            (Delay, 0, -0.001, 0.0006, false, Identified, Prior),
            (
                TorqueGain,
                0,
                TorqueGain.description().parameters[0].neutral,
                0.01,
                false,
                Identified,
                Prior,
            ),
            // At its bound, though it is known to a hair; held there at another value.
            (Armature, 0, 0.0, 0.0, false, Identified, Prior),
            (Viscous, 0, 0.2, 0.01, true, Identified, Prior),
            // A shape is never absent, but has bounds.
            (Stribeck, 1, 0.1, 0.2, false, Identified, Identified),
            (
                Stribeck,
                1,
                Stribeck.description().parameters[1].lower,
                0.01,
                false,
                Identified,
                Prior,
            ),
            // What no motion shows stays unexcited wherever it is.
            (Armature, 0, 0.0, 0.1, true, Unexcited, Unexcited),
            (Coulomb, 0, 0.0, 0.1, false, Prior, Prior),
        ];
        for (effect, n, value, std, at_bound, status, expected) in table {
            let estimate = ParameterEstimate {
                name: String::new(),
                unit: "",
                value,
                std,
                prior: 0.0,
                prior_std: 1.0,
                status,
                at_bound,
            };
            let status = estimate.unless_absent(effect, n).status;
            assert_eq!(status, expected, "{} {n}: {value} ± {std}", effect.name());
        }
    }

    /// A device's friction and rotor inertia may come out negative: within two deviations that is none, beyond it is no value.
    #[test]
    fn a_free_value_beyond_its_bound_is_marked() {
        let joint = JointId::of(Leg::FR)[0];
        let effects = [(joint, EffectKind::Armature)];
        for (value, at_bound) in [(-0.0056, true), (-0.0003, false), (0.005, false)] {
            let mut values = vec![0.0; LEG_INERTIAL];
            let mut std = vec![0.0; LEG_INERTIAL];
            values.push(value);
            std.push(0.0005);
            let all = of_device(Leg::FR, &effects, &values, &std, Constraint::Free).unwrap();
            let own = all.last().unwrap();
            assert_eq!(own.at_bound, at_bound, "{value}");
            assert_eq!(own.cell().ends_with("(b)"), at_bound, "{}", own.cell());
        }
    }

    /// A fit that ends at bodies of a third of the CAD's mass without any data to say so.
    #[test]
    fn what_no_motion_shows_is_not_identified_by_a_light_body() {
        let prior = LegPrior::<f64>::of(Leg::FR);
        let [cad, cad_std] = without_data(&prior).unwrap();
        let mut light = cad;
        light[..LEG_INERTIAL].iter_mut().for_each(|x| *x /= 3.0);
        let [_, light_std] = without_data(&seen_from(&prior, &light)).unwrap();
        assert!(light_std[0] < 0.4 * cad_std[0]);
        let joints = JointId::of(Leg::FR).into_iter();
        let effects: Vec<_> = joints
            .flat_map(|joint| EffectKind::PLAIN.map(|effect| (joint, effect)))
            .collect();
        for (values, std) in [(cad, cad_std), (light, light_std)] {
            let of = of_device(Leg::FR, &effects, &values, &std, Constraint::Physical).unwrap();
            assert!(of.iter().all(|p| p.status == Status::Unexcited));
        }
    }
}

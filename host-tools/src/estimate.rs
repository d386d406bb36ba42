//! Estimates of parameters, wherever they were made: their errors, their standing against the prior, their table.

use proprio_core::consistent::{Held, LegConsistentSolver};
use proprio_core::effect::EffectKind;
use proprio_core::estimator::{
    LEG_INERTIAL, LEG_PARAMETERS, LegFactors, LegPrior, LegSolver, LegVector,
};
use proprio_core::factor::FactorError;
use proprio_core::go2::{ACTUATORS, Leg};
use serde::Serialize;

use crate::log::JointId;
use crate::parameter;
use crate::table::{Table, with_std};

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
    /// The data would have it beyond what is physical; it is held at the bound.
    pub at_bound: bool,
}

/// Where a parameter's value comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The data: they leave at most half of the prior's standard deviation.
    Identified,
    /// The prior, more than the data.
    Prior,
    /// The prior alone: the motion does not show the parameter.
    Unexcited,
}

impl Status {
    pub(crate) fn of(std: f64, prior_std: f64) -> Self {
        match std / prior_std {
            ratio if ratio <= 0.5 => Self::Identified,
            ratio if ratio <= 0.99 => Self::Prior,
            _ => Self::Unexcited,
        }
    }

    /// The same where the prior looks different from the estimate than from the CAD (`there`) and residuals remember: what
    /// independent residuals would add to the prior there tells whether the motion shows the parameter at all.
    pub(crate) fn there(std: f64, prior_std: f64, independent: f64, there: f64) -> Self {
        match (Self::of(std, prior_std), Self::of(independent, there)) {
            (Self::Identified, _) => Self::Identified,
            (_, Self::Unexcited) => Self::Unexcited,
            _ => Self::Prior,
        }
    }
}

/// A leg's θ and standard deviations.
#[derive(Debug, Clone, Copy)]
pub struct Fit {
    /// θ.
    pub values: LegVector<f64>,
    /// Standard deviations.
    pub std: LegVector<f64>,
    /// The effects held at a bound.
    pub held: Held,
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

/// The fit to `data` on top of `prior`; without data it is the prior.
///
/// # Errors
/// As the core's solvers'.
pub fn solve(
    prior: &LegPrior<f64>,
    data: &LegFactors<f64>,
    constraint: Constraint,
) -> Result<Fit, FactorError> {
    let own = |numbers: &[f64]| std::array::from_fn(|k| numbers[k]);
    let mut solver = LegSolver::default();
    match constraint {
        Constraint::Free => {
            solver.start(prior, data);
            while !solver.advance()? {}
            let held = Held::default();
            Ok(Fit {
                values: own(solver.values()),
                std: own(solver.std()),
                held,
            })
        }
        Constraint::Physical => {
            let mut solver = LegConsistentSolver::new(prior, solver, [0.0; LEG_PARAMETERS]);
            solver.solve(data)?;
            let held = solver.held();
            Ok(Fit {
                values: own(solver.values()),
                std: own(solver.std()),
                held,
            })
        }
    }
}

/// A leg's parameters from its fit, in the estimator's order.
///
/// # Errors
/// [`FactorError`] if the leg has no prior; the Go2's have.
pub fn of_leg(leg: Leg, fit: &Fit) -> Result<Vec<ParameterEstimate>, FactorError> {
    let prior = solve(&LegPrior::of(leg), &LegFactors::default(), Constraint::Free)?;
    let named = parameter::names_of_leg(leg).into_iter().enumerate();
    let estimates = named.map(|(k, (name, unit))| ParameterEstimate {
        name,
        unit,
        value: fit.values[k],
        std: fit.std[k],
        prior: prior.values[k],
        prior_std: prior.std[k],
        status: Status::of(fit.std[k], prior.std[k]),
        at_bound: k
            .checked_sub(LEG_INERTIAL)
            .is_some_and(|n| fit.held.contains(n)),
    });
    Ok(estimates.collect())
}

/// A leg's parameters as a device tells them: the inertial ones, then the effects that it says it has.
///
/// # Errors
/// As [`of_leg`].
pub fn of_device(
    leg: Leg,
    effects: &[(JointId, EffectKind)],
    values: &[f32],
    std: &[f32],
) -> Result<Vec<ParameterEstimate>, FactorError> {
    let number = |from: &[f32], k: usize| from.get(k).map_or(f64::NAN, |&v| f64::from(v));
    let prior = solve(&LegPrior::of(leg), &LegFactors::default(), Constraint::Free)?;
    let inertial = parameter::names_of_leg(leg)
        .into_iter()
        .take(LEG_INERTIAL)
        .enumerate()
        .map(|(k, (name, unit))| (name, unit, prior.values[k], prior.std[k]));
    let effects = effects.iter().map(|&(joint, effect)| {
        let prior = effect.prior(&ACTUATORS[joint.place()]);
        let name = parameter::name(effect.name(), joint);
        (name, parameter::unit(effect), prior.mean, prior.std)
    });
    let all = inertial.chain(effects).enumerate();
    let estimates = all.map(|(k, (name, unit, prior, prior_std))| ParameterEstimate {
        name,
        unit,
        value: number(values, k),
        std: number(std, k),
        prior,
        prior_std,
        status: Status::of(number(std, k), prior_std),
        at_bound: false,
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

    pub(crate) fn cell(&self) -> String {
        let mark = match self.status {
            _ if self.at_bound => "(b)",
            Status::Identified => "   ",
            Status::Prior => "(p)",
            Status::Unexcited => "(u)",
        };
        format!("{} {mark}", with_std(self.value, self.std))
    }
}

/// What [`effect_table`]'s marks mean.
pub const LEGEND: &str = "± one standard deviation if residuals are independent; (p) held by the prior, (u) unexcited: \
                          the prior alone,\n(b) at its bound: the data would have it unphysical.";

/// A table of the joints' effects, with further columns of which the headings, units and cells are given.
pub fn effect_table<const N: usize>(
    parameters: &[ParameterEstimate],
    headings: [[&str; 2]; N],
    rows: impl IntoIterator<Item = (JointId, [String; N])>,
) -> Table {
    let effects = [
        EffectKind::Coulomb,
        EffectKind::Viscous,
        EffectKind::Armature,
        EffectKind::Bias,
    ];
    let line = |first: &str, effects: [String; 4], further: [String; N]| {
        [first.to_owned()].into_iter().chain(effects).chain(further)
    };
    let mut table = Table::default();
    let names = effects.map(|effect| effect.name().to_owned());
    table.row(line(
        "joint",
        names,
        headings.map(|[name, _]| name.to_owned()),
    ));
    let units = effects.map(|effect| parameter::unit(effect).to_owned());
    table.row(line("", units, headings.map(|[_, unit]| unit.to_owned())));
    for (joint, further) in rows {
        let cells = effects.map(|effect| {
            let estimate = find(parameters, &parameter::name(effect.name(), joint));
            estimate.map_or_else(String::new, ParameterEstimate::cell)
        });
        table.row(line(joint.name(), cells, further));
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
    }
}

//! Estimates of parameters, wherever they were made: their errors, their standing against the prior, their table.

use proprio_core::consistent::{Held, LegConsistentSolver, body};
use proprio_core::effect::EffectKind;
use proprio_core::estimator::{
    CAD_UNCERTAINTY, LEG_INERTIAL, LEG_PARAMETERS, LegFactors, LegPrior, LegSolver, LegVector,
};
use proprio_core::factor::{FactorError, packed_len};
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG, JointId, Leg};
use serde::Serialize;

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
            let bodies = [0.0; packed_len(LEG_INERTIAL)];
            let mut solver = LegConsistentSolver::new(prior, solver, [0.0; LEG_PARAMETERS], bodies);
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
pub fn of_leg(
    leg: Leg,
    fit: &Fit,
    constraint: Constraint,
) -> Result<Vec<ParameterEstimate>, FactorError> {
    let known = LegPrior::of(leg);
    let prior = solve(&known, &LegFactors::default(), Constraint::Free)?;
    let there = match constraint {
        Constraint::Free => prior.std,
        Constraint::Physical => {
            solve(
                &seen_from(&known, &fit.values),
                &LegFactors::default(),
                Constraint::Free,
            )?
            .std
        }
    };
    let named = parameter::names_of_leg(leg).into_iter().enumerate();
    let estimates = named.map(|(k, (name, unit))| ParameterEstimate {
        name,
        unit,
        value: fit.values[k],
        std: fit.std[k],
        prior: prior.values[k],
        prior_std: prior.std[k],
        status: Status::there(fit.std[k], prior.std[k], fit.std[k], there[k]),
        at_bound: k
            .checked_sub(LEG_INERTIAL)
            .is_some_and(|n| fit.held.contains(n)),
    });
    Ok(estimates.collect())
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
/// As [`of_leg`].
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
    let prior = solve(&known, &LegFactors::default(), Constraint::Free)?;
    let there = match physical {
        false => prior.std,
        true => {
            let near = seen_from(&known, values);
            solve(&near, &LegFactors::default(), Constraint::Free)?.std
        }
    };
    let inertial = parameter::names_of_leg(leg)
        .into_iter()
        .take(LEG_INERTIAL)
        .enumerate()
        .map(|(k, (name, unit))| (name, unit, [prior.values[k], prior.std[k], there[k]], None));
    let effects = effects.iter().map(|&(joint, effect)| {
        let prior = effect.prior(&ACTUATORS[joint.place()]);
        let name = parameter::name(effect.name(), joint);
        let lower = effect.description().parameters.first().map(|p| p.lower);
        let known = [prior.mean, prior.std, prior.std];
        (name, parameter::unit(effect), known, lower)
    });
    let all = inertial.chain(effects).enumerate();
    let estimates = all.map(|(k, (name, unit, [prior, prior_std, there], lower))| {
        let (value, std) = (number(values, k), number(std, k));
        ParameterEstimate {
            name,
            unit,
            value,
            std,
            prior,
            prior_std,
            status: Status::there(std, prior_std, std, there),
            at_bound: physical && lower == Some(value),
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
        assert_eq!(Status::there(0.2, 0.5, 0.2, 0.2), Status::Unexcited);
    }

    /// A fit that ends at bodies of a third of the CAD's mass without any data to say so.
    #[test]
    fn what_no_motion_shows_is_not_identified_by_a_light_body() {
        let prior = LegPrior::<f64>::of(Leg::FR);
        let nothing = LegFactors::default();
        let cad = solve(&prior, &nothing, Constraint::Physical).unwrap();
        let mut light = cad;
        light.values[..LEG_INERTIAL]
            .iter_mut()
            .for_each(|x| *x /= 3.0);
        light.std = solve(
            &seen_from(&prior, &light.values),
            &nothing,
            Constraint::Free,
        )
        .unwrap()
        .std;
        assert!(light.std[0] < 0.4 * cad.std[0]);
        for fit in [cad, light] {
            let told = of_leg(Leg::FR, &fit, Constraint::Physical).unwrap();
            assert!(told.iter().all(|p| p.status == Status::Unexcited));
        }
    }
}

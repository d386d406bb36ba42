//! What other witnesses measured of springs, bends and gaps beside what poses do: numbers that agree go into the fit together, so that frames are those of
//! the springs that the file has in the end.

use super::columns::{Column, Unknown};
use super::facts::EFFECTS;
use super::fit::{Fit, Problem};
use super::reported::HARDLY;
use super::search::effect_columns;
use crate::model::{JointQuantity as Q, Measured, Model, Witness};

/// A fit with the numbers of all witnesses.
pub(super) struct Witnessed {
    pub(super) fit: Fit,
    /// Springs, bends and gaps by these poses alone: value and standard deviation.
    pub(super) own: Vec<(Column, f64, f64)>,
}

/// Fits once more with what the model file has of springs, bends and gaps by other witnesses, where it has any.
pub(super) fn witnessed(problem: &Problem, model: &Model, fit: &Fit) -> Witnessed {
    let shared = || Q::ALL.into_iter().filter(|q| q.has_witnesses());
    let places = (0..problem.chain.joints()).flat_map(|j| shared().map(move |q| (j, q)));
    let others: Vec<(Unknown, Measured)> = places
        .filter_map(|(joint, quantity)| {
            let others = model.others(joint, quantity, Witness::Poses)?;
            Some((Unknown::Joint(joint, quantity), others))
        })
        .collect();
    let alone = with_stated(problem, fit, &others);
    let own: Vec<(Column, f64, f64)> = alone
        .values(problem.chain)
        .into_iter()
        .filter(|(column, ..)| matches!(column.unknown, Unknown::Joint(_, q) if q.has_witnesses()))
        .collect();
    let mut columns = alone.columns.clone();
    let mut any = false;
    for (column, value, std) in &own {
        let of_others = others
            .iter()
            .find(|(unknown, _)| *unknown == column.unknown);
        let Some((_, of_others)) = of_others else {
            continue;
        };
        let poses = Measured {
            by: Witness::Poses,
            value: *value,
            std: *std,
        };
        let fitted = columns.iter_mut().find(|c| c.unknown == column.unknown);
        if let (Some(fitted), true) = (fitted, poses.agrees_with(of_others)) {
            (fitted.mean, fitted.prior) = (of_others.value, of_others.std);
            any = true;
        }
    }
    let fit = match any {
        true => problem.fit(columns, &alone.state, alone.noise),
        false => alone,
    };
    Witnessed { fit, own }
}

/// The fit with those of these unknowns that it lacks and the poses measure. The others stay as the file has them.
fn with_stated(problem: &Problem, fit: &Fit, stated: &[(Unknown, Measured)]) -> Fit {
    let lacks = |unknown: Unknown| fit.columns.iter().all(|c| c.unknown != unknown);
    let mut more: Vec<Column> = Vec::new();
    for (unknown, _) in stated.iter().filter(|(unknown, _)| lacks(*unknown)) {
        let Unknown::Joint(joint, quantity) = *unknown else {
            continue;
        };
        let fact = EFFECTS.iter().find(|f| f.quantities.contains(&quantity));
        let can_be = |fact: &&super::facts::Fact| {
            fact.can_be_at(problem.chain, joint) && (problem.poses.has_sides || !fact.needs_sides)
        };
        if let Some(fact) = fact.filter(can_be) {
            more.extend(effect_columns(problem, &fit.state, fact, &[joint]));
        }
    }
    // Each round takes at least one column away.
    for _ in 0..=more.len() {
        if more.is_empty() {
            break;
        }
        let whole = [&fit.columns[..], &more].concat();
        let with = problem.fit(whole, &fit.state, fit.noise);
        let measured = |column: &Column| {
            let values = with.values(problem.chain);
            let own = values.iter().find(|(c, ..)| c.unknown == column.unknown);
            own.is_some_and(|(c, value, std)| *value > 0.0 && *std < HARDLY * c.prior)
        };
        let count = more.len();
        more.retain(measured);
        if more.len() == count {
            return with;
        }
    }
    fit.clone()
}

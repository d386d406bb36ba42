//! Effects of a model file that are a formula.

use std::collections::BTreeMap;

use super::tables::{EffectTable, SymbolTable};
use super::{Fault, impossible, joint};
use crate::formula::{FormulaError, Kind, Stated};
use crate::model::{AskedError, Model, ModelProblem};

/// Reads an effect whose `torque` is a formula.
pub(super) fn read(model: &mut Model, at: usize, table: &EffectTable) -> Result<(), Fault> {
    let fault = |problem: ModelProblem| (Some(at), problem);
    let asked = |error: AskedError| fault(ModelProblem::Asked(error));
    let wrong = |error: FormulaError| asked(AskedError::Formula(error));
    let place = joint(model, &table.joint, at)?;
    let kind = table.kind.as_deref().map_or(Ok(Kind::Free), Kind::named);
    let kind = kind.map_err(wrong)?;
    let mut symbols: BTreeMap<&str, SymbolTable> = BTreeMap::new();
    for (name, value) in &table.symbols {
        let read = value.clone().try_into();
        let read = read.map_err(|e: toml::de::Error| {
            fault(ModelProblem::Syntax(format!("{name}: {}", e.message())))
        })?;
        symbols.insert(name, read);
    }
    let stated = |symbol: &SymbolTable| Stated {
        unit: symbol.unit.clone(),
        prior: symbol.prior,
        min: symbol.min,
        max: symbol.max,
        held: symbol.value.filter(|_| symbol.held),
    };
    let stated: BTreeMap<String, Stated> = symbols
        .iter()
        .map(|(name, symbol)| ((*name).to_owned(), stated(symbol)))
        .collect();
    let text = table.torque.as_deref().unwrap_or_default();
    let effect = model
        .robot
        .formula(&table.name, text, (kind, &stated), place);
    let effect = effect.map_err(asked)?;
    if !model.add_effect(effect, place) {
        return Err(fault(ModelProblem::Twice {
            effect: effect.name(),
            joint: table.joint.clone(),
        }));
    }
    model.entry(effect, place).just_added = table.just_added;
    for (n, parameter) in effect.description().parameters.iter().enumerate() {
        let Some(symbol) = symbols.get(parameter.symbol) else {
            continue;
        };
        let what = format!("{} of {}:{}", parameter.symbol, effect.name(), table.joint);
        match (symbol.value, symbol.std) {
            (Some(value), std) => model
                .place_parameter(effect, place, n, value, std)
                .map_err(impossible(at, what))?,
            (None, Some(_)) => {
                return Err(fault(ModelProblem::StdAlone {
                    effect: effect.name(),
                    joint: table.joint.clone(),
                }));
            }
            (None, None) => {}
        }
    }
    Ok(())
}

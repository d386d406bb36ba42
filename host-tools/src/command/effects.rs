//! `proprio effects`: the catalogue.

use crate::catalogue;
use std::path::PathBuf;

use crate::model::{Model, UnknownName};
use clap::Args;
use proprio_core::effect::{Description, Mjcf, Parameter};
use serde::Serialize;

use super::Error;
use super::result::result;

/// List the effects that a model may lack
///
/// Each with its torque, its parameters, the effects that look like it on poor data, and the motion that separates them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio effects
  proprio effects stribeck load_friction
  proprio effects -m go2.toml
  proprio effects --json")]
pub(crate) struct Effects {
    /// Only these
    #[arg(value_name = "EFFECT")]
    effects: Vec<String>,
    /// With the formulas of this model file
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `effects` reports.
#[derive(Debug, Serialize)]
struct Report {
    effects: Vec<Entry>,
    /// Whether all are told at length.
    #[serde(skip)]
    at_length: bool,
}

#[derive(Debug, Serialize)]
struct Entry {
    name: &'static str,
    torque: &'static str,
    words: &'static str,
    parameters: Vec<ParameterEntry>,
    looks_like: &'static [&'static str],
    told_apart_by: &'static str,
    urdf: Option<&'static str>,
    mjcf: Option<&'static str>,
}

#[derive(Debug, Serialize)]
struct ParameterEntry {
    symbol: &'static str,
    unit: &'static str,
    /// Least physical value; none without a bound.
    lower: Option<f64>,
    /// Greatest physical value; none without a bound.
    upper: Option<f64>,
}

impl Effects {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = self.model.as_deref().map(Model::load).transpose()?;
        let mut chosen = Vec::new();
        for name in &self.effects {
            let unknown = || UnknownName::new("effect", name, catalogue::names());
            chosen.push(catalogue::effect_named(name).ok_or_else(unknown)?);
        }
        let at_length = !chosen.is_empty();
        if chosen.is_empty() {
            chosen.extend(catalogue::effects());
            let own = model.iter().flat_map(Model::effects).map(|e| e.effect);
            let own = own.filter(|effect| catalogue::formula_of(*effect).is_some());
            chosen.extend(own);
            chosen.dedup();
        }
        let report = Report {
            effects: chosen
                .iter()
                .map(|effect| Entry::of(effect.description()))
                .collect(),
            at_length,
        };
        Ok(if self.json {
            result("effects", &report)
        } else {
            report.to_string()
        })
    }
}

impl Entry {
    fn of(description: &Description) -> Self {
        Self {
            name: description.name,
            torque: description.torque,
            words: description.words,
            parameters: description
                .parameters
                .iter()
                .map(ParameterEntry::of)
                .collect(),
            looks_like: description.look_alikes,
            told_apart_by: description.separated_by,
            urdf: description.urdf,
            mjcf: description.mjcf.map(Mjcf::words),
        }
    }
}

impl ParameterEntry {
    fn of(parameter: &Parameter) -> Self {
        let bound = |value: f64| value.is_finite().then_some(value);
        Self {
            symbol: parameter.symbol,
            unit: parameter.unit,
            lower: bound(parameter.lower),
            upper: bound(parameter.upper),
        }
    }

    fn words(&self) -> String {
        let bounds = match (self.lower, self.upper) {
            (Some(lower), Some(upper)) => format!(", {lower} to {upper}"),
            (Some(lower), None) => format!(", at least {lower}"),
            (None, Some(upper)) => format!(", at most {upper}"),
            (None, None) => String::new(),
        };
        match self.unit {
            "" | "1" => format!("{}{bounds}", self.symbol),
            unit => format!("{} ({unit}{bounds})", self.symbol),
        }
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (n, effect) in self.effects.iter().enumerate() {
            if n > 0 {
                writeln!(f)?;
            }
            writeln!(f, "{}: {}", effect.name, effect.words)?;
            writeln!(f, "    torque         {}", effect.torque)?;
            let parameters: Vec<String> = effect
                .parameters
                .iter()
                .map(ParameterEntry::words)
                .collect();
            writeln!(f, "    parameters     {}", parameters.join("; "))?;
            if !effect.looks_like.is_empty() {
                writeln!(f, "    looks like     {}", effect.looks_like.join(", "))?;
            }
            writeln!(f, "    separated by   {}", effect.told_apart_by)?;
            let spelling = [("URDF", effect.urdf), ("MJCF", effect.mjcf)];
            let spelling = spelling
                .iter()
                .filter_map(|(format, word)| Some(format!("{format} {}", (*word)?)));
            let spelling: Vec<String> = spelling.collect();
            if self.at_length && !spelling.is_empty() {
                writeln!(f, "    exported as    {}", spelling.join(", "))?;
            }
        }
        Ok(())
    }
}

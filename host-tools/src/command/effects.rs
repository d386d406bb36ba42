//! `proprio effects`: the catalogue.

use std::path::PathBuf;

use crate::catalogue;
use crate::summary::{Summary, wrapped};

use crate::model::export::urdf_attribute;
use crate::model::{Model, UnknownName};
use clap::Args;
use proprio_core::effect::{Description, EffectKind, Form, Mjcf, Moved, Parameter};
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
  proprio effects --verbose
  proprio effects -m go2.toml
  proprio effects --json")]
pub(crate) struct Effects {
    /// Only these
    #[arg(value_name = "EFFECT")]
    effects: Vec<String>,
    /// Print each: its torque, parameters, look-alikes and the motion that separates them
    #[arg(short, long)]
    verbose: bool,
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
        if !(self.json || self.verbose || at_length) {
            return Ok(by_form(&chosen));
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

/// Whether an effect is of a group.
type IsOf = fn(&Description) -> bool;

/// The names, by what they act on.
fn by_form(effects: &[EffectKind]) -> String {
    let groups: [(&str, IsOf); 5] = [
        ("Every drive", Description::is_plain),
        ("At a joint", |d| {
            matches!(d.form, Form::Columns) && !d.is_plain()
        }),
        ("Between joints", |d| matches!(d.form, Form::Coupled)),
        ("Transmission", |d| {
            matches!(d.form, Form::Motion(Moved::Link(_)))
        }),
        ("Sensors, time", |d| {
            let moved = matches!(d.form, Form::Motion(moved) if !matches!(moved, Moved::Link(_)));
            moved || matches!(d.form, Form::Scale | Form::Clock)
        }),
    ];
    let mut left: Vec<EffectKind> = effects.to_vec();
    let mut points = Vec::new();
    for (title, is_of) in groups {
        let (own, others) = left.into_iter().partition(|e| is_of(e.description()));
        left = others;
        points.push((title, own));
    }
    points.push(("Bodies, base", left));
    let names = |own: &[EffectKind]| {
        let names: Vec<&str> = own.iter().map(|e| e.name()).collect();
        names.join(", ")
    };
    let lines = points.iter().filter(|(_, own)| !own.is_empty());
    let rows = lines.flat_map(|(title, own)| {
        let text = wrapped(&names(own), &format!("  {title:<15}"), &" ".repeat(17));
        text.lines().map(str::to_owned).collect::<Vec<_>>()
    });
    let screen = Summary {
        headline: format!("{} effects that a model may lack", effects.len()),
        rows: rows.collect(),
        next: vec![format!("proprio effects {}", effects[0].name())],
        ..Summary::default()
    };
    screen.screen(
        &[],
        "--verbose (each: torque, parameters, look-alikes, separating motion)",
    )
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
            urdf: urdf_attribute(description).map(|[_, attribute]| attribute),
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
            let line = |what: &str, text: &str| {
                let first = format!("    {what:<15}");
                wrapped(text, &first, &" ".repeat(first.len()))
            };
            let text = format!("{}: {}", effect.name, effect.words);
            write!(f, "{}", wrapped(&text, "", "  "))?;
            write!(f, "{}", line("torque", effect.torque))?;
            let parameters: Vec<String> = effect
                .parameters
                .iter()
                .map(ParameterEntry::words)
                .collect();
            write!(f, "{}", line("parameters", &parameters.join("; ")))?;
            if !effect.looks_like.is_empty() {
                write!(f, "{}", line("look-alikes", &effect.looks_like.join(", ")))?;
            }
            write!(f, "{}", line("separated by", effect.told_apart_by))?;
            let spelling = [("URDF", effect.urdf), ("MJCF", effect.mjcf)];
            let spelling = spelling
                .iter()
                .filter_map(|(format, word)| Some(format!("{format} {}", (*word)?)));
            let spelling: Vec<String> = spelling.collect();
            if self.at_length && !spelling.is_empty() {
                write!(f, "{}", line("exported as", &spelling.join(", ")))?;
            }
        }
        Ok(())
    }
}

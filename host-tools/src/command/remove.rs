//! `proprio remove`: effects out of a model file.

use std::path::PathBuf;

use crate::model::{Model, ModelEffect, UnknownName};
use crate::summary::{places_in_words, wrapped};
use clap::Args;
use serde::Serialize;

use super::Error;
use super::add::joint_names;
use super::result::result;

/// Take effects out of a model file
///
/// Without JOINT an effect is taken out wherever the model has it. Values of the others stay as they are: identify again.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio remove stribeck -m go2.toml
  proprio remove coulomb:FR_calf bias:FR_hip -m go2.toml --json")]
pub(crate) struct Remove {
    /// Effects, each at one joint or wherever the model has it
    #[arg(value_name = "EFFECT[:JOINT]", required = true)]
    effects: Vec<String>,
    /// The model file
    #[arg(short, long, value_name = "MODEL")]
    model: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `remove` reports.
#[derive(Debug, Serialize)]
struct Report {
    model: PathBuf,
    /// `EFFECT:JOINT` taken out.
    removed: Vec<String>,
    /// Those that the model did not have.
    absent: Vec<String>,
    /// The robot's joints, in its order.
    #[serde(skip)]
    joints: Vec<String>,
}

impl Remove {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut model = Model::load(&self.model)?;
        let (mut removed, mut absent) = (Vec::new(), Vec::new());
        for text in &self.effects {
            let taken = take_out(&mut model, text)?;
            if taken.is_empty() {
                absent.push(text.clone());
            }
            let name =
                |e: ModelEffect| format!("{}:{}", e.effect.name(), model.joint_name(e.joint));
            removed.extend(taken.into_iter().map(name));
        }
        if !removed.is_empty() {
            model.save(&self.model)?;
        }
        let report = Report {
            model: self.model,
            removed,
            absent,
            joints: joint_names(model.robot()),
        };
        Ok(if self.json {
            result("remove", &report)
        } else {
            report.to_string()
        })
    }
}

/// Takes what `EFFECT[:JOINT]` names out of a model, at one joint or wherever the model has it; what that was.
pub(super) fn take_out(model: &mut Model, text: &str) -> Result<Vec<ModelEffect>, UnknownName> {
    let (effect, named) = model.robot().places(text)?;
    let is_named =
        |e: &ModelEffect| e.effect == effect && (!text.contains(':') || named.contains(&e.joint));
    let taken = model.effects().iter().filter(|e| is_named(e));
    let taken: Vec<ModelEffect> = taken.copied().collect();
    for e in &taken {
        model.remove_effect(e.effect, e.joint);
    }
    Ok(taken)
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.model.display();
        if !self.removed.is_empty() {
            let removed = places_in_words(&self.removed, &self.joints);
            let removed = format!("Taken out of {path}: {removed}");
            write!(f, "{}", wrapped(&removed, "", "  "))?;
        }
        if !self.absent.is_empty() {
            writeln!(f, "Not in {path}: {}", self.absent.join(", "))?;
        }
        Ok(())
    }
}

//! `proprio remove`: effects out of a model file.

use std::path::PathBuf;

use crate::model::Model;
use clap::Args;
use serde::Serialize;

use super::add::parse;
use super::{Error, json};

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
}

impl Remove {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut model = Model::load(&self.model)?;
        let (mut removed, mut absent) = (Vec::new(), Vec::new());
        for text in &self.effects {
            let (effect, named) = parse(text, model.robot())?;
            let has = model.effects().iter().filter(|e| e.effect == effect);
            let joints = match text.contains(':') {
                true => named,
                false => has.map(|e| e.joint).collect(),
            };
            let before = removed.len();
            for joint in joints {
                if model.remove_effect(effect, joint) {
                    removed.push(format!("{}:{}", effect.name(), model.joint_name(joint)));
                }
            }
            if removed.len() == before {
                absent.push(text.clone());
            }
        }
        if !removed.is_empty() {
            model.save(&self.model)?;
        }
        let report = Report {
            model: self.model,
            removed,
            absent,
        };
        Ok(if self.json {
            json(&report)
        } else {
            report.to_string()
        })
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let path = self.model.display();
        if !self.removed.is_empty() {
            writeln!(f, "Taken out of {path}: {}", self.removed.join(", "))?;
        }
        if !self.absent.is_empty() {
            writeln!(f, "Not in {path}: {}", self.absent.join(", "))?;
        }
        Ok(())
    }
}

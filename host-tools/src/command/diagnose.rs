//! `proprio diagnose`: which physical effect a model lacks.

use std::path::PathBuf;

use clap::Args;
use proprio::criticism::{Diagnosis, Recording, diagnose};
use proprio::model::Model;
use proprio_core::effect::EffectKind;

use super::{Error, json};
use crate::progress::Progress;

/// Say which physical effect is missing
///
/// Tries every effect of the catalogue at every joint: how much smaller does the error become on stretches of time that the
/// fit has not seen? Names the best with its value, error and look-alikes, and goes on until nothing gains beyond its error.
/// "Nothing is missing" is an answer.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio diagnose chirp.csv
  proprio diagnose chirp.csv --model go2.toml --json
  proprio diagnose chirp.csv --apply -m go2.toml && proprio compare chirp.csv -m go2.toml")]
pub(crate) struct Diagnose {
    /// Logs: CSV, plain or gzip-compressed
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The model [default: the Go2's rigid body and no effect]
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Show every step to a model that lacks nothing and, with --model, add its effects to the model file
    #[arg(long)]
    apply: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Diagnose {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut model = super::model_or_default(self.model.as_deref(), self.apply)?;
        let mut progress = Progress::new("Reading");
        let recording =
            Recording::read(&self.logs, &model, |done, total| progress.set(done, total))?;
        drop(progress);
        let diagnosis = diagnose(&recording, &model)?;
        for warning in &diagnosis.warnings {
            eprintln!("warning: {warning}");
        }
        if let (true, Some(path)) = (self.apply, &self.model) {
            apply(&diagnosis, &mut model);
            model.save(path)?;
        }
        Ok(match (self.json, self.apply) {
            (true, _) => json(&diagnosis),
            (false, true) => diagnosis.ladder(),
            (false, false) => diagnosis.to_string(),
        })
    }
}

/// Adds to a model what the path has added.
fn apply(diagnosis: &Diagnosis, model: &mut Model) {
    for step in &diagnosis.path {
        let Some(effect) = EffectKind::from_name(step.effect) else {
            continue;
        };
        for name in &step.joints {
            // The names come from this robot.
            for place in model.robot().place(effect, Some(name)).unwrap_or_default() {
                if step.removed {
                    model.remove_effect(effect, place);
                } else {
                    model.add_effect(effect, place);
                }
            }
        }
    }
}

//! `proprio export`: a model into the files of simulators.

use std::path::PathBuf;

use crate::model::Model;
use crate::model::export::{Exported, mjcf, urdf};
use crate::output;
use clap::{ArgGroup, Args};
use serde::Serialize;

use super::Error;
use super::result::result;

/// Write a model for simulators: URDF or MJCF
///
/// Identified inertias go into the file given, and with them damping and friction (URDF) or armature, damping and
/// frictionloss (MJCF); nothing else in it changes. Without a file a whole one is written.
#[derive(Debug, Args)]
#[command(
    group = ArgGroup::new("format").required(true).args(["urdf", "mjcf"]),
    after_help = "Examples:
  proprio export -m go2.toml --urdf -o identified.urdf
  proprio export -m go2.toml --mjcf scene/go2.xml -o scene/identified.xml"
)]
pub(crate) struct Export {
    /// The model file
    #[arg(short, long, value_name = "MODEL")]
    model: PathBuf,
    /// As URDF, written into IN [default: the URDF the model is of; a whole file for the built-in Go2]
    #[arg(long, value_name = "IN", num_args = 0..=1)]
    urdf: Option<Option<PathBuf>>,
    /// As MJCF, written into IN [default: a whole file]
    #[arg(long, value_name = "IN", num_args = 0..=1)]
    mjcf: Option<Option<PathBuf>>,
    /// Where the result goes; may be IN [default: standard output]
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `export` reports.
#[derive(Debug, Serialize)]
struct Report {
    output: Option<PathBuf>,
    /// Bodies written.
    bodies: Vec<String>,
    /// Effects written.
    effects: Vec<String>,
    /// What the format cannot state.
    notes: Vec<String>,
    /// The file's text, if it went nowhere else.
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
}

impl Export {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = Model::load(&self.model)?;
        let Exported {
            text,
            bodies,
            effects,
            notes,
        } = match (&self.urdf, &self.mjcf) {
            (Some(input), _) => urdf(&model, input.as_deref())?,
            (None, input) => mjcf(&model, input.iter().flatten().next().map(PathBuf::as_path))?,
        };
        if let Some(path) = &self.output {
            output::write(path, &text)?;
        }
        if self.json {
            let text = self.output.is_none().then_some(text);
            let output = self.output;
            return Ok(result(
                "export",
                &Report {
                    output,
                    bodies,
                    effects,
                    notes,
                    text,
                },
            ));
        }
        notes.iter().for_each(|note| eprintln!("note: {note}"));
        Ok(match self.output {
            Some(path) => format!(
                "Wrote {} bodies and {} effects to {}.\n",
                bodies.len(),
                effects.len(),
                path.display()
            ),
            None => text,
        })
    }
}

//! `proprio compare`: model against measurement.

use std::path::PathBuf;

use clap::Args;
use proprio::compare::{ValuesFrom, compare};
use proprio::recording::Recording;
use proprio::report::pages;

use super::{Error, json, unreadable};
use crate::progress::Progress;

/// Compare model and measurement: how well, where and when it fails
///
/// Data that cannot be trusted are named first. What the model file gives is taken as given. Where an effect has no value yet, as after `proprio add`, parameters are
/// fitted within their priors to every stretch of time but the one that is predicted. Time in which a foot carries a force is told
/// and left out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio compare chirp.csv
  proprio compare chirp.csv --model go2.toml
  proprio compare chirp.csv --model go2.toml --html report.html
  proprio compare chirp.csv --model go2.toml --json")]
pub(crate) struct Compare {
    /// Logs: CSV, plain or gzip-compressed
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The model; joints in the logs have its names [default: the Go2's rigid body and no effect]
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Fit the parameters to these logs, whatever the model file gives
    #[arg(long, conflicts_with = "given")]
    fit: bool,
    /// Take the model file as it is: what has no value does nothing
    #[arg(long)]
    given: bool,
    /// Tell every place and moment where the model fails, not the worst ones only
    #[arg(long)]
    all: bool,
    /// Also write a report with plots: one page, no network needed
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = super::model_or_default(self.model.as_deref(), false)?;
        let mut progress = Progress::new("Reading");
        let recording =
            Recording::read(&self.logs, &model, |done, total| progress.set(done, total))?;
        drop(progress);
        let values = match (self.fit, self.given) {
            (true, _) => ValuesFrom::Fitted,
            (false, true) => ValuesFrom::Given,
            (false, false) => ValuesFrom::Auto,
        };
        let comparison = compare(&recording, &model, values)?;
        for warning in &comparison.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = &self.html {
            pages::comparison(&comparison)
                .map_err(unreadable)?
                .write(path)?;
        }
        Ok(if self.json {
            json(&comparison)
        } else {
            comparison.text(self.all)
        })
    }
}

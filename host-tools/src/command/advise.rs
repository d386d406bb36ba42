//! `proprio advise`: what a log could not tell.

use std::path::PathBuf;

use crate::advise::advise;
use clap::Args;

use super::result::result;
use super::{Error, model_or_default};
use crate::progress::Progress;

/// Show what logs do not identify, and the motion that does
///
/// Each inertial parameter and each joint's friction, rotor inertia and offset: its standard deviation before the logs, after
/// them, and after the best of motions. Parameters that no motion of a fixed-base limb can identify are counted apart.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio advise chirp.csv
  proprio advise monday.csv tuesday.csv --legs FR --verbose
  proprio advise arm.csv --model arm.toml --json")]
pub(crate) struct Advise {
    /// Logs in any format: CSV, bags, npz, Parquet, captures (docs/logs.md)
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The robot and what is known of it [default: the Go2's CAD]
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Which legs (limbs of another robot) [default: all that the logs have]
    #[arg(long, value_name = "LEGS", value_delimiter = ',')]
    legs: Vec<String>,
    /// Print every parameter: its standard deviation before the logs, after them, and after the best motion
    #[arg(short, long, visible_alias = "all")]
    verbose: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Advise {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = model_or_default(self.model.as_deref(), false)?;
        let limbs = model.robot().limbs_named(&self.legs)?;
        let mut progress = Progress::new("Reading");
        let advised = advise(
            &model,
            self.model.as_deref(),
            &limbs,
            &self.logs,
            |done, total| progress.set(done, total),
        )?;
        drop(progress);
        Ok(match (self.json, self.verbose) {
            (true, _) => result("advise", &advised),
            (false, true) => advised.text(),
            (false, false) => advised
                .summary(self.model.as_deref(), &self.logs)
                .screen(&[], "--verbose (each parameter)"),
        })
    }
}

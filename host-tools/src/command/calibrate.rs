//! `proprio calibrate`: diagnose for kinematics.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::result::judged;
use super::{Error, unreadable};
use crate::kinematics::{Calibration, Poses, calibrate};
use crate::model::Model;
use crate::progress::Underway;
use crate::report::pages;

/// Find what is wrong with a robot's kinematics from measured poses
///
/// Each pose has joint positions and where a tracker, a camera or contacts saw one or more targets. The measuring system and the targets are
/// placed first; then zeros of joints, whole joint frames and effects are added as long as each makes the error of poses that a fit without
/// them has not used smaller. --apply writes the values ± standard deviations into the model file; `proprio export --urdf` writes them as
/// corrected origins.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio calibrate poses.csv -m arm.toml
  proprio calibrate poses.csv -m arm.toml --apply --html calibration.html
  proprio calibrate poses.csv -m arm.toml --only offsets -o offsets.toml")]
pub(crate) struct Calibrate {
    /// Poses: CSV, npz or Parquet with q/<joint> (rad), x/<target>, y/<target>, z/<target> (m), optionally qw|qx|qy|qz/<target>, std/<target>,
    /// payload, side/<joint>, t
    #[arg(value_name = "POSES", required = true)]
    logs: Vec<PathBuf>,
    /// The model of the robot
    #[arg(short, long, value_name = "MODEL")]
    model: PathBuf,
    /// Write the values into the model file
    #[arg(long)]
    apply: bool,
    /// Write them into this file instead
    #[arg(short, long, value_name = "MODEL", conflicts_with = "apply")]
    output: Option<PathBuf>,
    /// Estimate no more than this, for controllers that take no more
    #[arg(long, value_enum, value_name = "WHAT")]
    only: Option<Only>,
    /// Print every value, candidate and pose
    #[arg(short, long)]
    verbose: bool,
    /// Also write a page: errors before and after on the robot, by pose and by joint
    #[arg(long, value_name = "PAGE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What alone is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Only {
    /// Zeros of the joints
    Offsets,
}

impl Calibrate {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = Model::load(&self.model)?;
        let poses = Poses::read(&self.logs, &model)?;
        let underway = Underway::new("Calibrating");
        let calibration = calibrate(&poses, &model, self.only.is_some())?;
        drop(underway);
        for warning in &calibration.warnings {
            eprintln!("warning: {warning}");
        }
        let written = self.output.as_ref().or(self.apply.then_some(&self.model));
        if let Some(path) = written {
            let values = calibration.to_model(&poses).map_err(unreadable)?;
            values.save(path)?;
        }
        if let Some(path) = &self.html {
            pages::calibration(&calibration, &poses, Some(&self.model))
                .map_err(unreadable)?
                .write(path)?;
        }
        Ok(if self.json {
            judged("calibrate", calibration.error(), &calibration)
        } else {
            self.text(&calibration, &poses, written)
        })
    }

    fn text(&self, calibration: &Calibration, poses: &Poses, written: Option<&PathBuf>) -> String {
        let model = written.unwrap_or(&self.model);
        let summary = calibration.summary(poses, Some(model), written.is_some());
        let wrote = written.map(|path| format!("Wrote {}.", path.display()));
        let wrote: Vec<String> = wrote.into_iter().collect();
        match self.verbose {
            true => summary.screen(&wrote, "") + &calibration.details(),
            false => summary.screen(
                &wrote,
                "--verbose (values, candidates, poses), --html calibration.html",
            ),
        }
    }
}

//! `proprio frf`: diagnose for frequency responses.

use std::path::PathBuf;

use clap::Args;

use super::result::judged;
use super::{Error, unreadable};
use crate::model::Model;
use crate::output;
use crate::progress::Underway;
use crate::report::pages;
use crate::spectrum::{Frf as Responses, frf};

/// Find springs and dampers between motors and links from periodic excitation
///
/// A log has some periods of a multisine, recorded at the motors while a controller holds the robot. Periods, excited lines and transients are
/// found; the responses from torque to position come with their noise (scatter over periods) and distortion (scatter over blocks of other
/// phases). Of one joint, motor, spring and load are fitted from nothing; with -m the springs of all joints, in front of the model's links,
/// after its dry friction is subtracted, and links that bend where springs at the joints do not explain the responses. The error is held out, in log
/// magnitude: 0.01 is 1 % of a response.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio frf bench.csv
  proprio frf frf.csv -m arm.toml -o responses.csv --html frf.html
  proprio frf frf.csv -m arm.toml --apply")]
pub(crate) struct Frf {
    /// Logs: t, q/<joint>, tau/<joint> (N m) or current/<joint> (A), optionally ref/<joint> (the excitation), q_link/<joint>
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The model of the robot: masses, armature, Coulomb friction
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Experiments of each block, where they are fewer than joints: there are no responses then, and the model's are fitted to the positions
    #[arg(long, value_name = "N", requires = "model", conflicts_with_all = ["output", "html"], value_parser = clap::value_parser!(u32).range(1..1000))]
    experiments: Option<u32>,
    /// Write springs, links that bend and their dampers into the model file, as far as they are identified
    #[arg(long, requires = "model")]
    apply: bool,
    /// Write the responses: point,f,out,in,re,im,var,var_noise,dof and each point's q/<joint>
    #[arg(short, long, value_name = "FRF")]
    output: Option<PathBuf>,
    /// Print every value and point
    #[arg(short, long)]
    verbose: bool,
    /// Also write a page: magnitude and phase, measured and modelled, noise against distortion
    #[arg(long, value_name = "PAGE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Frf {
    pub(crate) fn run(self) -> Result<String, Error> {
        let model = self.model.as_deref().map(Model::load).transpose()?;
        let underway = Underway::new("Transforming");
        let found = frf(
            &self.logs,
            model.as_ref(),
            self.experiments.map(|n| n as usize),
        )?;
        drop(underway);
        for warning in &found.warnings {
            eprintln!("warning: {warning}");
        }
        if let (Some(path), Some(model), true) = (&self.model, &model, self.apply) {
            found.to_model(model)?.save(path)?;
        }
        if let Some(path) = &self.output {
            output::write(path, &found.csv())?;
        }
        if let Some(path) = &self.html {
            pages::responses(&found, &self.logs, self.model.as_deref())
                .map_err(unreadable)?
                .write(path)?;
        }
        Ok(if self.json {
            judged("frf", found.error(), &found)
        } else {
            self.text(&found)
        })
    }

    fn text(&self, found: &Responses) -> String {
        // Without a model there is nothing to apply: what can be written is written.
        let is_written = self.html.is_some() || self.output.is_some();
        let done = self.apply || (self.model.is_none() && found.joints.len() == 1 && is_written);
        let summary = found.summary(self.model.as_deref(), done);
        let model = self.model.as_ref().filter(|_| self.apply);
        let written = model.into_iter().chain(&self.output);
        let wrote: Vec<String> = written
            .map(|path| format!("Wrote {}.", path.display()))
            .collect();
        match self.verbose {
            true => summary.screen(&wrote, "") + &found.details(),
            false if self.experiments.is_some() => {
                summary.screen(&wrote, "--verbose (values, points)")
            }
            false => summary.screen(
                &wrote,
                "--verbose (values, points), --html frf.html, -o responses.csv",
            ),
        }
    }
}

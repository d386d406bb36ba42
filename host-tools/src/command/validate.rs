//! `proprio validate`: the feedback torque that a model leaves.

use std::path::PathBuf;

use crate::model::Model;
use crate::report::pages;
use crate::validate::{Candidate, Feedback, candidates, recorded, tracked};
use clap::Args;
use proprio_simulator::hidden::typical;
use proprio_simulator::{Followed, Hide, Simulation};
use serde::Serialize;

use super::Error;
use super::result::result;
use crate::progress::Progress;

/// Judge models by the feedback torque that they leave
///
/// With --motion, the simulated robot follows it with each model's torque as feed-forward, and feedback does the rest. With logs,
/// the feedback is the torque that was measured less the model's for the motion that was made. The URDF is judged besides, and of
/// each model with bodies of its own its friction alone. Take another motion than the one that identified the model.
#[derive(Debug, Args)]
#[command(
    override_usage = "proprio validate [OPTIONS] <LOG>...\n       proprio validate [OPTIONS] --motion <MOTION>",
    after_help = "Examples:
  proprio validate --motion other.csv -m fit.toml --typical --inertia-error 0.06
  proprio validate chirp_9hz.csv -m fit.toml -m consistent.toml --html feedback.html"
)]
pub(crate) struct Validate {
    /// Logs in any format: CSV, bags, npz, Parquet, captures (docs/logs.md)
    #[arg(
        value_name = "LOG",
        required_unless_present = "motion",
        conflicts_with = "motion"
    )]
    logs: Vec<PathBuf>,
    /// A motion of `proprio excite`, to be followed by a simulated Go2
    #[arg(long, value_name = "MOTION")]
    motion: Option<PathBuf>,
    /// Models, beside the URDF
    #[arg(short, long = "model", value_name = "MODEL")]
    models: Vec<PathBuf>,
    /// The simulated robot has a Go2's typical friction, rotor inertia and torque offsets
    #[arg(long, requires = "motion")]
    typical: bool,
    /// … and this effect, as `simulate --hide` takes it
    #[arg(long, value_name = "EFFECT[:JOINT]=VALUE", requires = "motion", value_parser = super::simulate::parse_hide)]
    hide: Vec<Hide>,
    /// How far its bodies are off the CAD: relative standard deviation of a mass
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = super::simulate::within(0.0, 1.0), requires = "motion")]
    inertia_error: f64,
    /// Seed of the simulated robot and of its noise
    #[arg(long, default_value_t = 1, requires = "motion")]
    seed: u64,
    /// Also write a page with the feedback torque over time
    #[arg(long, value_name = "PAGE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `validate` reports.
#[derive(Debug, Serialize)]
struct Report {
    /// Of each log (or the simulated motion), each model.
    logs: Vec<OfLog>,
}

#[derive(Debug, Serialize)]
struct OfLog {
    log: PathBuf,
    models: Vec<Feedback>,
}

impl Validate {
    pub(crate) fn run(self) -> Result<String, Error> {
        let mut models = Vec::new();
        for path in &self.models {
            models.push((path.display().to_string(), Model::load(path)?));
        }
        let urdf = models.first().map_or_else(Model::default, |(_, model)| {
            Model::new(model.robot().clone())
        });
        let candidates = candidates(&urdf, models);
        let mut logs = Vec::new();
        match &self.motion {
            Some(path) => logs.push(OfLog {
                log: path.clone(),
                models: self.simulated(&Followed::read(path)?, &candidates)?,
            }),
            None => {
                for log in &self.logs {
                    let mut progress = Progress::new("Reading");
                    let (models, warnings) = recorded(&urdf, log, &candidates, |done, total| {
                        progress.set(done, total)
                    })?;
                    drop(progress);
                    for warning in warnings {
                        eprintln!("warning: {}: {warning}", log.display());
                    }
                    logs.push(OfLog {
                        log: log.clone(),
                        models,
                    });
                }
            }
        }
        if let (Some(page), Some(first)) = (&self.html, logs.first()) {
            pages::validate::feedback(&first.models).write(page)?;
        }
        let report = Report { logs };
        Ok(if self.json {
            result("validate", &report)
        } else {
            report.to_string()
        })
    }

    fn simulated(
        &self,
        motion: &Followed,
        candidates: &[Candidate],
    ) -> Result<Vec<Feedback>, Error> {
        let mut effects = if self.typical {
            typical(motion.legs())
        } else {
            Vec::new()
        };
        for hide in &self.hide {
            effects.extend(hide.on(motion.legs()).unwrap_or_else(|error| {
                super::usage_error(
                    "validate",
                    clap::error::ErrorKind::ValueValidation,
                    error.to_string(),
                )
            }));
        }
        let robot = Simulation {
            effects,
            inertia_error: self.inertia_error,
            seed: self.seed,
            ..Simulation::new(motion.legs())
        };
        let mut progress = Progress::new("Simulating");
        Ok(tracked(&robot, motion, candidates, |done, of| {
            progress.set(done as u64, of as u64)
        })?)
    }
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for of in &self.logs {
            writeln!(f, "{}", of.log.display())?;
            writeln!(
                f,
                "{:<40} {:>12} {:>10} {:>14}",
                "feed-forward", "feedback", "share", "tracking error"
            )?;
            writeln!(
                f,
                "{:<40} {:>12} {:>10} {:>14}",
                "", "N m rms", "%", "rad rms"
            )?;
            for model in &of.models {
                let error = model
                    .tracking_rms
                    .map_or_else(|| "-".to_owned(), |error| format!("{error:.4}"));
                writeln!(
                    f,
                    "{:<40} {:>12.4} {:>10.2} {:>14}",
                    model.model, model.rms, model.share_percent, error
                )?;
            }
            writeln!(f)?;
        }
        writeln!(f, "Share: of the torque's mean square, over all joints.")
    }
}

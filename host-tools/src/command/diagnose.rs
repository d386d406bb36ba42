//! `proprio diagnose`: which physical effect a model lacks.

mod written;

use std::path::PathBuf;

use crate::advise::closing;
use crate::compare::ValuesFrom;
use crate::compare::{compare, compare_free_base};
use crate::diagnose::{Diagnosis, FreeBaseDiagnosis, Rung, Scope, diagnose_by, diagnose_free_base};
use crate::free_base::has_imu;
use crate::identify::model_fit::{FitOptions, fit_model};
use crate::model::{Model, Provenance, Robot};
use crate::recording::LogGates;
use crate::recording::{Recording, first_gate_words, gate_words};
use crate::report::pages;
use crate::spectrum::mismatches;
use crate::summary::typed;
use clap::Args;
use serde::Serialize;
use written::{Values, Written};

use super::result::judged;
use super::{Error, unreadable};
use crate::progress::{Progress, Underway};

/// What the first screen leaves to --verbose and the page.
const MORE: &str = "--verbose (candidates, steps), --html report.html (plots, tick boxes)";

/// Find which physical effect is missing
///
/// Tries every effect of the catalogue at every joint: how much does it reduce the held-out error? Names the best with its
/// value, error and look-alikes, and goes on until nothing gains beyond its error. "Nothing is missing" is an answer. Where the
/// catalogue leaves structure, formulas of physical terms are searched (docs/effects.md). From four logs on, each log is held
/// out in turn, and an effect must make none of them worse predicted by the others.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio diagnose chirp.csv
  proprio diagnose chirp_*.csv --verbose
  proprio diagnose chirp.csv --model go2.toml --html report.html
  proprio diagnose chirp.csv --model go2.toml --json
  proprio diagnose --free-base walk.csv --model go2.toml
  proprio diagnose chirp.csv --apply -m go2.toml && proprio compare chirp.csv -m go2.toml")]
pub(crate) struct Diagnose {
    /// Logs in any format: CSV, bags, npz, Parquet, captures (docs/logs.md)
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The model; joints in the logs have its names [default: the Go2's rigid body and no effect]
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Write the effects that are missing to the model file
    ///
    /// Each with the value that these logs give it, ± one standard deviation, and the bodies too; but where the file has values of other
    /// logs these stay, and effects that are new have none.
    #[arg(long)]
    apply: bool,
    /// The robot is on its feet (floating base): effects at its joints and payloads on its bodies, the trunk's too
    ///
    /// Logs have gyro/ and acc/ columns, as for `identify --free-base`. With --apply the values found are written to the model.
    #[arg(long)]
    free_base: bool,
    /// Go on where the log is not what the model says (signs, units, exchanged joints, a base that moves)
    #[arg(long)]
    anyway: bool,
    #[command(flatten)]
    part: super::Part,
    /// Look for no formula where the catalogue leaves structure
    #[arg(long)]
    catalogue_only: bool,
    /// Print every candidate and every step, and what the logs leave open
    #[arg(short, long)]
    verbose: bool,
    /// Also write a report with plots: one page, no network needed
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Diagnose {
    pub(crate) fn run(self) -> Result<String, Error> {
        if self.free_base {
            return self.run_free_base();
        }
        let mut model = super::model_or_default(self.model.as_deref(), self.apply)?;
        let mut progress = Progress::new("Reading");
        let told = |done, total| progress.set(done, total);
        let recording = Recording::read_only(&self.logs, &self.part.only, &model, told)?;
        drop(progress);
        let wrong = mismatches(&recording, &model);
        if wrong.iter().any(|wrong| wrong.kind.refuses()) && !self.anyway {
            return Err(Error::Mismatch {
                logs: typed(&self.logs, None),
                wrong,
                is_go2: *model.robot() == Robot::go2(),
                has_imu: self.logs.iter().all(|log| has_imu(log)),
            });
        }
        let underway = Underway::new("Trying the catalogue");
        let scope = Scope {
            swing: self.anyway,
            catalogue_only: self.catalogue_only,
        };
        // Whoever goes on anyway does not believe the readings.
        let readings = if self.anyway { &[][..] } else { &wrong };
        let mut diagnosis = diagnose_by(&recording, &model, readings, scope)?;
        drop(underway);
        diagnosis
            .warnings
            .extend(wrong.iter().map(ToString::to_string));
        if let Some(path) = &self.model {
            let path = path.display().to_string();
            diagnosis.next = diagnosis.next.replace("MODEL", &path);
        }
        for warning in &diagnosis.warnings {
            eprintln!("warning: {warning}");
        }
        let given = model.clone();
        diagnosis.apply(&mut model);
        if recording.is_drawn {
            let fitted = fit_model(&recording, &model, FitOptions::PHYSICAL)?;
            let filled = fitted.filled(&model)?;
            let on_feet = diagnosis.stands;
            diagnosis.every_window = super::every_window(&recording, [&given, &filled], on_feet)?;
        }
        if let Some(path) = &self.html {
            let after = compare(&recording, &model, ValuesFrom::Fitted)?;
            let page = pages::DiagnosisPage {
                diagnosis: &diagnosis,
                after: &after,
                recording: &recording,
                given: &given,
                complete: &model,
                model: self.model.as_deref(),
                written: self.apply,
            };
            page.page().map_err(unreadable)?.write(path)?;
        }
        let written = match (self.apply, &self.model) {
            (true, Some(path)) if model != given || !path.exists() => {
                let values = self.source_of_values(&recording, &diagnosis, &given)?;
                Some(Written::to(path, &recording, model.clone(), values)?)
            }
            _ => None,
        };
        if self.json {
            return Ok(printed(&recording.gates, &diagnosis, written.as_ref()));
        }
        let file = self.model.as_deref();
        let wrote = written.as_ref().map(ToString::to_string);
        if self.verbose {
            let wrote = wrote.map_or_else(String::new, |wrote| format!("\n{wrote}\n"));
            let told = format!("{diagnosis}\n{}", diagnosis.ladder());
            return Ok(gate_words(&recording.gates)
                + &told
                + &wrote
                + &closing(&model, file, &self.logs));
        }
        let mut summary = diagnosis.summary(given.robot(), file);
        let data = first_gate_words(&recording.gates);
        if let (Some(_), Some(file)) = (&written, file) {
            summary.next = vec![format!("proprio compare {}", typed(&self.logs, Some(file)))];
        }
        if diagnosis.joints.is_empty() && self.logs.iter().all(|log| has_imu(log)) {
            let logs = typed(&self.logs, file);
            summary.next = vec![format!("proprio diagnose --free-base {logs}")];
        }
        let mut summary = self.part.kept(summary);
        let every = diagnosis.every_window.as_ref();
        let every = super::every_window_words(every, &mut summary, (&self.logs, file));
        Ok(summary.screen(&[data, wrote.unwrap_or_default(), every], MORE))
    }

    /// Where the values of the written file may come from.
    fn source_of_values(
        &self,
        recording: &Recording,
        diagnosis: &Diagnosis,
        given: &Model,
    ) -> Result<Values, Error> {
        let own = match given.provenance() {
            Some(provenance) => {
                (provenance.is_of(&self.logs, &recording.only)).map_err(unreadable)?
            }
            None => !given.has_values(),
        };
        let joints: usize = recording.limbs.iter().map(|(_, limb)| limb.joints).sum();
        Ok(
            match (own, self.anyway || diagnosis.joints.len() < joints) {
                (true, false) => {
                    let own = Provenance::of(&self.logs).map_err(unreadable)?;
                    Values::OfTheseLogs(own.under(&recording.only))
                }
                (false, _) => Values::OfOtherLogs,
                (true, true) => Values::Untold,
            },
        )
    }

    /// The whole robot, moving and in contact.
    fn run_free_base(&self) -> Result<String, Error> {
        let model = super::model_or_default(self.model.as_deref(), self.apply)?;
        let underway = Underway::new("Trying friction and loads");
        let mut diagnosis = diagnose_free_base(&self.logs, &model, self.catalogue_only, |_, _| ())?;
        drop(underway);
        let told = &mut diagnosis.diagnosis;
        if let Some(path) = &self.model {
            told.next = told.next.replace("MODEL", &path.display().to_string());
        }
        for warning in &diagnosis.diagnosis.warnings {
            eprintln!("warning: {warning}");
        }
        let complete = || -> Result<Model, Error> {
            let mut complete = model.clone();
            diagnosis.apply(&mut complete)?;
            Ok(complete)
        };
        let written = match (self.apply, &self.model) {
            (true, Some(path)) => {
                complete()?.save(path)?;
                true
            }
            _ => false,
        };
        if let Some(path) = &self.html {
            let complete = complete()?;
            let after = compare_free_base(&self.logs, &complete, ValuesFrom::Fitted, |_, _| ())?;
            let summary = diagnosis.summary(model.robot(), self.model.as_deref(), written);
            let page = pages::walk_diagnosis(&diagnosis, &after, &complete, summary);
            page.map_err(unreadable)?.write(path)?;
        }
        if self.json {
            let report = WalkReport {
                diagnosis: &diagnosis,
                path: diagnosis.diagnosis.rungs(),
            };
            return Ok(judged("diagnose", diagnosis.diagnosis.error(), &report));
        }
        if self.verbose {
            let told = &diagnosis.diagnosis;
            return Ok(format!("{told}\n{}", told.ladder()));
        }
        let summary = diagnosis.summary(model.robot(), self.model.as_deref(), written);
        let wrote = match (written, &self.model) {
            (true, Some(path)) => format!("Wrote {}.", path.display()),
            _ => String::new(),
        };
        Ok(summary.screen(&[wrote], MORE))
    }
}

/// What --json prints of a robot that walks.
#[derive(Debug, Serialize)]
struct WalkReport<'a> {
    #[serde(flatten)]
    diagnosis: &'a FreeBaseDiagnosis,
    path: Vec<Rung<'a>>,
}

/// What --json prints.
pub(super) fn printed(
    data: &[LogGates],
    diagnosis: &Diagnosis,
    written: Option<&Written>,
) -> String {
    let report = Report {
        data,
        diagnosis,
        path: diagnosis.rungs(),
        written,
    };
    judged("diagnose", diagnosis.error(), &report)
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    /// What the samples of each log are worth.
    data: &'a [LogGates],
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    path: Vec<Rung<'a>>,
    /// What --apply has made of the model file.
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<&'a Written>,
}

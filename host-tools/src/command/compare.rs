//! `proprio compare`: model against measurement.

use std::path::{Path, PathBuf};

use crate::compare::{
    Comparison, Gains, ModelsComparison, Under, ValuesFrom, compare, compare_free_base_without,
    compare_without, rollout, save,
};
use crate::detect::mismatch::MismatchKind;
use crate::free_base::has_imu;
use crate::kinematics::{Poses, compare_poses, is_pose_file};
use crate::model::{AskedError, Model, ModelEffect, asked_texts};
use crate::recording::{Recording, first_gate_words};
use crate::report::pages;
use crate::spectrum::mismatches;
use crate::summary::typed;
use clap::error::ErrorKind;
use clap::{Args, ValueEnum};

use super::result::judged;
use super::{Error, remove, unreadable};
use crate::progress::{Progress, Underway};

/// What the first screen leaves to --verbose and the page.
const MORE: &str = "--verbose (each joint, where, when), --html report.html (plots, tick boxes)";

/// Compare model and measurement: how well, where and when it fails
///
/// Data that cannot be trusted are named first. Values of the model file are taken as given. Where an effect has no value yet,
/// as after `proprio add`, parameters are fitted within their priors to every block of time but the one that is predicted. The
/// same holds for values of a diagnosis of these very logs, as after `diagnose --apply`. Time in which a foot carries a force is
/// reported and excluded.
///
/// With --rollout the model runs forward instead, under the measured torque: the error is that of the position after 0.1 to 1 s. With
/// --rollout=commanded its drives follow what they were asked to do, as in a simulator: tau_des + kp (q_des - q) + kd (dq_des - dq) of the
/// simulated motion.
///
/// A file of measured poses is compared as `calibrate` reads it: the error in mm, by target and pose.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio compare chirp.csv
  proprio compare chirp.csv --model go2.toml
  proprio compare chirp.csv --model go2.toml --html report.html
  proprio compare chirp.csv -m go2.toml --without presliding,bias:FR_hip
  proprio compare chirp.csv --model go2.toml --only 'FR_calf: q > -1.5'
  proprio compare chirp.csv --model go2.toml -o torque.csv
  proprio compare chirp.csv --model go2.toml -o residuals.mcap
  proprio compare chirp.csv -m cad.toml -m fitted.toml -m mine.toml --html models.html
  proprio compare chirp.csv --model go2.toml --rollout --html rollout.html
  proprio compare chirp.csv --model go2.toml --rollout=commanded --kp 25 --kd 0.5
  proprio compare --free-base walk.csv --model go2.toml
  proprio compare poses.csv --model arm.toml
  proprio compare chirp.csv --model go2.toml --json")]
pub(crate) struct Compare {
    /// Logs in any format: CSV, bags, npz, Parquet, captures (docs/logs.md)
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The model; joints in the logs have its names; several, each with its own -m, stand side by side [default: the Go2's rigid body and no effect]
    #[arg(short, long = "model", value_name = "MODEL")]
    model: Vec<PathBuf>,
    /// Fit the parameters to these logs, whatever the model file gives
    #[arg(long, conflicts_with = "given")]
    fit: bool,
    /// Take the model file as it is: what has no value does nothing
    #[arg(long)]
    given: bool,
    /// The robot is on its feet (floating base): contact forces are eliminated; from logs with gyro/ and acc/ columns
    #[arg(long, conflicts_with_all = ["at_rest", "output"])]
    free_base: bool,
    /// Run the model forward, from the measured state anew every 0.1, 0.2, 0.5 and 1 s: the error of the position
    #[arg(long, value_name = "TORQUE", value_enum, num_args = 0..=1, require_equals = true, default_missing_value = "measured")]
    rollout: Option<RolloutTorque>,
    /// Gain of position of the drives, of --rollout=commanded, N m/rad [default: the log's kp/]
    #[arg(long, value_name = "[JOINT=]KP", value_delimiter = ',', value_parser = parse_gain)]
    kp: Vec<Gain>,
    /// Gain of velocity of the drives, of --rollout=commanded, N m s/rad [default: the log's kd/]
    #[arg(long, value_name = "[JOINT=]KD", value_delimiter = ',', value_parser = parse_gain)]
    kd: Vec<Gain>,
    /// Judge joints also while they rest, when the torque is whatever friction holds; values are those of the file
    #[arg(long, conflicts_with = "fit")]
    at_rest: bool,
    /// Compare the model that `proprio add` makes with these, or with a formula, `JOINT: FORMULA`
    #[arg(long, value_name = "EFFECT[:JOINT]")]
    with: Vec<String>,
    /// Compare the model that `proprio remove` makes without these, each at one joint or wherever the model has it
    #[arg(long, value_name = "EFFECT[:JOINT]")]
    without: Vec<String>,
    #[command(flatten)]
    part: super::Part,
    /// Print each joint's error, where and when the model fails; with --json also the tests of each joint's residual, bins and lags
    #[arg(short, long)]
    verbose: bool,
    /// Print every place and moment where the model fails, not the worst ones only
    #[arg(long)]
    all: bool,
    /// Also write a report with plots: one page, no network needed
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Also write measured and predicted torque: a CSV of each window and joint, or by its name MCAP at the log's rate, for Foxglove, PlotJuggler and Rerun
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum RolloutTorque {
    /// That the motors reported
    Measured,
    /// By the log's q_des/, dq_des/, tau_des/ and the drives' gains
    Commanded,
}

/// A gain of all drives, or of a joint's.
#[derive(Debug, Clone)]
struct Gain {
    joint: Option<String>,
    value: f64,
}

fn parse_gain(text: &str) -> Result<Gain, String> {
    let (joint, number) = match text.rsplit_once('=') {
        Some((joint, number)) => (Some(joint.trim().to_owned()), number),
        None => (None, text),
    };
    let value = number.trim().parse().ok();
    match value.filter(|gain: &f64| gain.is_finite() && *gain >= 0.0) {
        Some(value) => Ok(Gain { joint, value }),
        None => Err("not a gain: 25, or FR_calf=40".to_owned()),
    }
}

impl Compare {
    pub(crate) fn run(self) -> Result<String, Error> {
        self.check_rollout();
        if !self.free_base && self.logs.first().is_some_and(|log| is_pose_file(log)) {
            return self.run_poses();
        }
        if self.model.len() > 1 {
            return self.run_several();
        }
        if self.free_base {
            return self.run_free_base();
        }
        if let Some(torque) = self.rollout {
            return self.run_rollout(torque);
        }
        let mut model = super::model_or_default(self.file(), false)?;
        let given = model.clone();
        let left_out = self.change(&mut model)?;
        let recording = self.read(&model)?;
        let underway = Underway::new("Comparing");
        let mut comparison = compare_without(&recording, &model, &left_out, self.values())?;
        drop(underway);
        if !comparison.fitted {
            let on_feet = !comparison.contact.is_empty();
            comparison.every_window = super::every_window(&recording, [&given, &model], on_feet)?;
        }
        let wrong = mismatches(&recording, &model);
        let elastic = wrong
            .iter()
            .find(|wrong| matches!(wrong.kind, MismatchKind::Elastic(_)));
        comparison.elastic = elastic.map(ToString::to_string);
        comparison
            .warnings
            .extend(wrong.iter().map(ToString::to_string));
        for warning in &comparison.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = &self.output {
            save(&comparison, &recording, &model, path)?;
        }
        if let Some(path) = &self.html {
            pages::comparison(&comparison, &recording, &model, self.file())
                .map_err(unreadable)?
                .write(path)?;
        }
        Ok(if self.json {
            self.shorten(&mut comparison);
            judged("compare", comparison.error(), &comparison)
        } else {
            // More than one foot on the ground, or torques that no fixed base explains.
            let moves = comparison.contact.len() > 1
                || (wrong.iter())
                    .any(|wrong| matches!(wrong.kind, MismatchKind::NoBetterThanNothing(_)));
            let is_walk = moves && self.logs.iter().all(|log| has_imu(log));
            self.text(&comparison, is_walk)
        })
    }

    /// Leaves the tests of each joint's residual, bin by bin and lag by lag, to --verbose.
    fn shorten(&self, comparison: &mut Comparison) {
        if !self.verbose {
            comparison.criticism.clear();
        }
    }

    /// What a rollout is not of, in words.
    fn check_rollout(&self) {
        let other = [
            (
                self.free_base,
                "--free-base: contact forces move a robot on its feet, and no log has them; a rollout needs a fixed base",
            ),
            (self.at_rest, "--at-rest: rollouts include rest"),
            (
                self.output.is_some(),
                "-o: it is of torques; --html plots positions",
            ),
            (
                self.model.len() > 1,
                "-m more than once: run it for each model",
            ),
        ];
        if let Some((_, words)) = (other.iter()).find(|(given, _)| self.rollout.is_some() && *given)
        {
            let message = format!("--rollout does not take {words}");
            super::usage_error("compare", ErrorKind::ArgumentConflict, message);
        }
        let has_gains = !self.kp.is_empty() || !self.kd.is_empty();
        if has_gains && self.rollout != Some(RolloutTorque::Commanded) {
            let message = "--kp and --kd are of --rollout=commanded".to_owned();
            super::usage_error("compare", ErrorKind::ArgumentConflict, message);
        }
    }

    /// What moves the model in a rollout.
    fn under(&self, torque: RolloutTorque, model: &Model) -> Under {
        let of = |gains: &[Gain]| -> Vec<(Option<usize>, f64)> {
            let gains = gains.iter().map(|gain| {
                let joint = gain.joint.as_deref().map(|name| {
                    model.robot().joint(name).unwrap_or_else(|unknown| {
                        super::usage_error(
                            "compare",
                            ErrorKind::ValueValidation,
                            unknown.to_string(),
                        )
                    })
                });
                (joint, gain.value)
            });
            gains.collect()
        };
        match torque {
            RolloutTorque::Measured => Under::Measured,
            RolloutTorque::Commanded => Under::Commanded(Gains {
                position: of(&self.kp),
                velocity: of(&self.kd),
            }),
        }
    }

    /// The model run forward.
    fn run_rollout(&self, torque: RolloutTorque) -> Result<String, Error> {
        let mut model = super::model_or_default(self.file(), false)?;
        let left_out = self.change(&mut model)?;
        let under = self.under(torque, &model);
        let recording = self.read(&model)?;
        let underway = Underway::new("Running the model");
        let mut found = rollout(&recording, &model, &left_out, self.values(), &under)?;
        drop(underway);
        let wrong = mismatches(&recording, &model);
        found.warnings.extend(wrong.iter().map(ToString::to_string));
        for warning in &found.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = &self.html {
            let page = pages::rollout(&found, self.file()).map_err(unreadable)?;
            page.write(path)?;
        }
        Ok(match (self.json, self.all || self.verbose) {
            (true, _) => judged("compare", found.error(), &found),
            (false, true) => found.text(),
            (false, false) => {
                let summary = self.part.kept(found.summary(self.file()));
                let data = first_gate_words(&found.data);
                summary.screen(
                    &[data],
                    "--verbose (each joint), --html rollout.html (plots)",
                )
            }
        })
    }

    /// The logs, or the part that was asked for.
    fn read(&self, model: &Model) -> Result<Recording, Error> {
        let mut progress = Progress::new("Reading");
        let told = |done, total| progress.set(done, total);
        let read = match self.rollout {
            Some(RolloutTorque::Commanded) => Recording::read_commanded,
            _ => Recording::read_only,
        };
        Ok(read(&self.logs, &self.part.only, model, told)?)
    }

    /// Measured poses.
    fn run_poses(&self) -> Result<String, Error> {
        let asked = !self.with.is_empty() || !self.without.is_empty();
        let other = [
            (self.model.len() > 1, "-m more than once"),
            (asked, "--with and --without"),
            (self.fit, "--fit"),
            (self.given, "--given"),
            (self.at_rest, "--at-rest"),
            (self.rollout.is_some(), "--rollout"),
            (!self.part.only.is_empty(), "--only"),
            (self.html.is_some(), "--html"),
            (self.output.is_some(), "-o"),
        ];
        if let Some((_, name)) = other.iter().find(|(given, _)| *given) {
            let message =
                format!("{name}: not of poses; `proprio calibrate` fits them and writes pages");
            super::usage_error("compare", ErrorKind::ArgumentConflict, message);
        }
        let model = super::model_or_default(self.file(), false)?;
        let poses = Poses::read(&self.logs, &model)?;
        let comparison = compare_poses(&poses, &model)?;
        let summary = comparison.summary(&poses, self.file());
        Ok(match (self.json, self.all || self.verbose) {
            (true, _) => judged("compare", comparison.error(), &comparison),
            (false, true) => summary.to_string() + &comparison.details(),
            (false, false) => summary.screen(&[], "--verbose (every target and pose)"),
        })
    }

    /// The whole robot, moving and in contact.
    fn run_free_base(&self) -> Result<String, Error> {
        let mut model = super::model_or_default(self.file(), false)?;
        let left_out = self.change(&mut model)?;
        let mut progress = Progress::new("Reading");
        let told = |done, total| progress.set(done, total);
        let values = self.values();
        let mut comparison =
            compare_free_base_without(&self.logs, &model, &left_out, values, told)?;
        drop(progress);
        for warning in &comparison.comparison.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = &self.html {
            let page = pages::walk(&comparison, &model, self.file()).map_err(unreadable)?;
            page.write(path)?;
        }
        Ok(match (self.json, self.all || self.verbose) {
            (true, _) => {
                self.shorten(&mut comparison.comparison);
                judged("compare", comparison.comparison.error(), &comparison)
            }
            (false, true) => comparison.text(self.all),
            (false, false) => comparison.summary(self.file()).screen(&[], MORE),
        })
    }

    /// The model's file, where there is one.
    fn file(&self) -> Option<&Path> {
        self.model.first().map(PathBuf::as_path)
    }

    /// Several models side by side.
    fn run_several(&self) -> Result<String, Error> {
        let other = [
            ("--free-base", self.free_base),
            ("--with", !self.with.is_empty()),
            ("--without", !self.without.is_empty()),
            ("--output", self.output.is_some()),
        ];
        if let Some((flag, _)) = other.iter().find(|(_, given)| *given) {
            let words = format!("{flag} takes one model: name one -m");
            super::usage_error("compare", ErrorKind::ArgumentConflict, words);
        }
        let (mut all, mut first) = (Vec::new(), None);
        for path in &self.model {
            let model = Model::load(path)?;
            let recording = self.read(&model)?;
            let mut comparison = compare(&recording, &model, self.values())?;
            let wrong = mismatches(&recording, &model);
            let wrong = wrong
                .iter()
                .map(|wrong| format!("{}: {wrong}", path.display()));
            comparison.warnings.extend(wrong);
            all.push((path.clone(), comparison));
            first.get_or_insert(recording);
        }
        let found = first.and_then(|recording| ModelsComparison::of(&recording, &all));
        let Some(found) = found else {
            return Ok(String::new());
        };
        for warning in &found.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = &self.html {
            pages::models(&found).map_err(unreadable)?.write(path)?;
        }
        Ok(match self.json {
            true => judged("compare", found.error(), &found),
            false => {
                let more = "More: --verbose (each joint), --html models.html (plots)";
                format!("{}{more}\n", found.text(self.all || self.verbose))
            }
        })
    }

    fn values(&self) -> ValuesFrom {
        match (self.fit, self.given, self.at_rest) {
            (true, ..) => ValuesFrom::Fitted,
            (false, _, true) => ValuesFrom::GivenAlsoAtRest,
            (false, true, false) => ValuesFrom::Given,
            (false, false, false) => ValuesFrom::Auto,
        }
    }

    /// The first screen, or all of it; of a walk whose log has what a moving base needs, the next command compares it as one.
    fn text(&self, comparison: &Comparison, is_walk: bool) -> String {
        if self.all || self.verbose {
            return comparison.text(self.all);
        }
        let data = first_gate_words(&comparison.data);
        let mut summary = self.part.kept(comparison.summary(self.file()));
        let every = comparison.every_window.as_ref();
        let every = super::every_window_words(every, &mut summary, (&self.logs, self.file()));
        if is_walk {
            let logs = typed(&self.logs, self.file());
            summary.next = vec![format!("proprio compare --free-base {logs}")];
        }
        summary.screen(&[data, every], MORE)
    }

    /// Does to the model what `remove` does with the effects that --without names, and `add` with those of --with. What was removed.
    fn change(&self, model: &mut Model) -> Result<Vec<ModelEffect>, AskedError> {
        let [with, without] = [&self.with, &self.without].map(|lists| -> Vec<String> {
            let texts = lists.iter().map(|list| asked_texts(model.robot(), list));
            texts.flatten().collect()
        });
        let mut left_out = Vec::new();
        for text in without {
            left_out.extend(remove::take_out(model, &text)?);
        }
        let mut more = Vec::new();
        for text in with {
            more.extend(model.asked(&text)?);
        }
        model.add_last(&more);
        Ok(left_out)
    }
}

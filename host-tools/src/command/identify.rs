//! `proprio identify`: from logs to parameters.

mod blocks;
mod factors;

use std::path::{Path, PathBuf};

use crate::advise::closing;
use crate::compare::{ValuesFrom, compare, compare_free_base};
use crate::estimate::Constraint;
use crate::identify::{
    FitOptions, Identified, Method, check_reproduced, identify, identify_free_base,
};
use crate::model::{Model, Provenance};
use crate::output;
use crate::report::pages;
use crate::summary::POINTS;
use clap::Args;

use super::result::{judged, result};
use super::{Error, unreadable};
use crate::progress::Progress;

/// Identify the robot from its logs
///
/// Fits bodies and effects and prints each with its standard deviation, and how well they explain the torque. Without a model:
/// viscous and Coulomb friction, armature and torque offset of every joint of the recorded legs of a Go2. The base is taken to
/// be fixed and level: suspended or mounted. Several logs are taken together.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio identify chirp.csv
  proprio identify chirp.csv -o go2.toml && proprio export -m go2.toml --mjcf -o go2.xml
  proprio identify --free-base walk.csv -o go2.toml
  proprio identify --factor board.bin chirp.bin
  proprio identify --blocks monday.parquet tuesday.parquet
  proprio identify morning.csv.gz evening.csv.gz --json -o robot.json
  proprio add coulomb -m arm.toml --urdf arm.urdf && proprio identify arm.csv -m arm.toml")]
pub(crate) struct Identify {
    /// Logs in any format: CSV, bags, npz, Parquet, captures (docs/logs.md)
    #[arg(value_name = "LOG", required_unless_present_any = ["factor", "blocks"])]
    logs: Vec<PathBuf>,
    /// Instead of logs: factors that `replay --factors` or `monitor` read from devices, merged
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["logs", "output", "bus", "verbose", "physical", "free", "free_base", "html", "model", "base", "stages", "method"])]
    factor: Vec<PathBuf>,
    /// Instead of logs: blocks of one robot that `factors` made, each value ± from between blocks
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["factor", "logs", "output", "bus", "physical", "free", "free_base", "html", "model", "base", "stages", "method"])]
    blocks: Vec<PathBuf>,
    /// Also write a model file with the values; or, if the name ends in .json, what --json prints
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Round samples to what the motor bus carries, as a device receives them
    #[arg(long)]
    bus: bool,
    /// What holds without --free
    #[arg(long, hide = true)]
    physical: bool,
    /// Values may be unphysical: one that is shows that the model lacks something
    ///
    /// Without it every body could exist, and friction and rotor inertia are at least zero.
    #[arg(long, conflicts_with = "physical")]
    free: bool,
    /// The robot is on its feet (floating base): trunk and legs, from logs with gyro/ and acc/ columns
    ///
    /// Without a model that of a Go2. The model file of another robot states its feet and IMU ([[foot]], [imu]). Velocity,
    /// attitude and contact forces need not be known; foot/ columns help to detect stance.
    #[arg(long, conflicts_with_all = ["bus", "base", "stages", "method"])]
    free_base: bool,
    /// Also write a report with plots: one page, no network needed
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Fit the effects that this model file names
    ///
    /// The joints in the logs are those of the file's robot. The file's priors count, its values do not.
    #[arg(short, long, value_name = "MODEL", conflicts_with = "bus")]
    model: Option<PathBuf>,
    #[command(flatten)]
    part: super::Part,
    /// Print each value ± its standard deviation
    #[arg(short, long)]
    verbose: bool,
    /// Count the base parameters (identifiable combinations) and those that these logs identify; with --verbose each
    #[arg(long)]
    base: bool,
    /// Friction with the CAD's bodies first, then inertia, then physical inertia
    #[arg(long, conflicts_with = "free")]
    stages: bool,
    /// Which equation the parameters are fitted to
    #[arg(long, value_enum, default_value_t)]
    method: Equation,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What the first screen leaves to --verbose and the page.
const MORE: &str = "--verbose (each value ± 1σ, priors), --base, --html report.html (plots)";

/// The same of --base.
const MORE_OF_BASE: &str = "--base --verbose (each combination, and what is never identifiable)";

/// The same of a robot that moves.
const MORE_OF_A_WALK: &str = "--verbose (each value ± 1σ, stance), --html report.html (plots)";

/// Names of the equations on the command line.
#[derive(Debug, Clone, Copy, Default, clap::ValueEnum)]
enum Equation {
    /// Integrated momentum: no accelerations
    #[default]
    Momentum,
    /// Differences of energy: no accelerations, one row for all joints of a limb
    Energy,
    /// Torques at instants: accelerations by filtered differentiation
    InverseDynamics,
}

impl From<Equation> for Method {
    fn from(equation: Equation) -> Self {
        match equation {
            Equation::Momentum => Self::Momentum,
            Equation::Energy => Self::Energy,
            Equation::InverseDynamics => Self::InverseDynamics,
        }
    }
}

impl Identify {
    pub(crate) fn run(self) -> Result<String, Error> {
        if !self.factor.is_empty() {
            return factors::run(&self.factor, self.json);
        }
        if !self.blocks.is_empty() {
            return blocks::run(&self.blocks, self.verbose, self.json);
        }
        if self.free_base {
            return self.run_free_base();
        }
        let given = self.model.as_deref().map(Model::load).transpose()?;
        let options = FitOptions {
            constraint: self.constraint(),
            method: self.method.into(),
            stages: self.stages,
            bus: self.bus,
        };
        let mut progress = Progress::new("Identifying");
        let mut identified = identify(
            &self.logs,
            given.as_ref(),
            (options, &self.part.only),
            |done, total| {
                progress.set(done, total);
            },
        )?;
        drop(progress);
        let Identified {
            recording,
            model,
            fitted,
        } = &mut identified;
        for warning in &fitted.warnings {
            eprintln!("warning: {warning}");
        }
        if recording.is_drawn {
            // An unphysical fit is no model: then there is nothing to predict with.
            let cad = Model::default();
            let given = given.as_ref().unwrap_or(&cad);
            if let Ok(filled) = fitted.filled(model) {
                fitted.every_window = super::every_window(recording, [given, &filled], false)?;
            }
        }
        // An unphysical fit is no model; a JSON file alone takes it.
        let mut filled = match (self.model_file(), &self.html) {
            (None, None) => None,
            _ => {
                let mut filled = fitted.to_model(model, self.provenance()?)?;
                filled.forget_last_added();
                Some(filled)
            }
        };
        if let Some(path) = self.json_file() {
            output::write(path, &judged("identify", fitted.error(), fitted))?;
        }
        if let (Some(path), Some(filled)) = (self.model_file(), &mut filled) {
            filled.save(path)?;
            if options.method == Method::Momentum {
                check_reproduced(recording, &filled.read_back(path)?, fitted)?;
            }
            super::save_with_other_witnesses(filled, path)?;
        }
        if let (Some(path), Some(filled)) = (&self.html, &filled) {
            let comparison = compare(recording, filled, ValuesFrom::Given)?;
            let page = pages::fit(
                fitted,
                &comparison,
                filled,
                [self.model.as_deref(), self.model_file()],
            )
            .map_err(unreadable)?;
            page.write(path)?;
        }
        if self.json {
            return Ok(judged("identify", fitted.error(), fitted));
        }
        let file = self.model.as_deref();
        if self.base && self.verbose {
            let told = fitted.identifiability();
            let open = closing(model, file, &self.logs);
            return Ok(format!("{fitted}{told}{open}"));
        }
        // Steps and other equations are asked for to be looked at.
        Ok(
            match self.verbose || self.stages || options.method != Method::Momentum {
                true => fitted.to_string(),
                false => {
                    let mut summary = (self.part).kept(fitted.summary(file, self.model_file()));
                    let every = fitted.every_window.as_ref();
                    let every = super::every_window_words(every, &mut summary, (&self.logs, file));
                    let more = if self.base { MORE_OF_BASE } else { MORE };
                    if self.base {
                        summary.points.insert(0, fitted.base_words());
                        summary.points.truncate(POINTS);
                    }
                    summary.screen(&[self.wrote(), vec![every]].concat(), more)
                }
            },
        )
    }

    /// The whole robot, moving and in contact.
    fn run_free_base(&self) -> Result<String, Error> {
        let given = super::model_or_default(self.model.as_deref(), false)?;
        let mut progress = Progress::new("Identifying");
        let found = identify_free_base(&self.logs, &given, self.constraint(), |done, total| {
            progress.set(done, total);
        })?;
        drop(progress);
        for warning in &found.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = self.json_file() {
            output::write(path, &judged("identify", found.error(), &found))?;
        }
        if let Some(path) = self.model_file() {
            found.to_model(&given, self.provenance()?)?.save(path)?;
        }
        if let Some(path) = &self.html {
            let model = found.to_model(&given, self.provenance()?)?;
            let comparison = compare_free_base(&self.logs, &model, ValuesFrom::Given, |_, _| ())?;
            let page = pages::walk_identification(
                &found,
                &comparison,
                &model,
                [self.model.as_deref(), self.model_file()],
            );
            page.map_err(unreadable)?.write(path)?;
        }
        Ok(match (self.json, self.verbose) {
            (true, _) => judged("identify", found.error(), &found),
            (false, true) => found.to_string(),
            (false, false) => found
                .summary(self.model.as_deref(), self.model_file())
                .screen(&self.wrote(), MORE_OF_A_WALK),
        })
    }

    /// Which file was written, for the first screen.
    fn wrote(&self) -> Vec<String> {
        let wrote = |path: &PathBuf| format!("Wrote {}.", path.display());
        self.output.iter().map(wrote).collect()
    }

    fn constraint(&self) -> Constraint {
        match self.free {
            true => Constraint::Free,
            false => Constraint::Physical,
        }
    }

    /// `-o`, if it names what --json prints.
    fn json_file(&self) -> Option<&Path> {
        self.output.as_deref().filter(|path| is_json(path))
    }

    /// `-o`, if it names a model file.
    fn model_file(&self) -> Option<&Path> {
        self.output.as_deref().filter(|path| !is_json(path))
    }

    fn provenance(&self) -> Result<Provenance, Error> {
        let own = Provenance::of(&self.logs).map_err(unreadable)?;
        Ok(own.under(&self.part.only))
    }
}

fn is_json(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "json")
}

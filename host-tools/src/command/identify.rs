//! `proprio identify`: from logs to parameters.

mod factors;

use std::path::{Path, PathBuf};

use crate::advise::{at_the_end, closing};
use crate::compare::{ValuesFrom, compare, compare_free_base, series_of};
use crate::detect::mismatch::mismatches;
use crate::estimate::Constraint;
use crate::identify::{
    FitOptions, Method, Options, check_reproduced, fit_runs, identify, identify_free_base,
};
use crate::model::{Model, Provenance};
use crate::output;
use crate::recording::Recording;
use crate::report::pages;
use clap::Args;
use proprio_core::go2::JOINTS_PER_LEG;

use super::{Error, json, unreadable};
use crate::progress::Progress;

/// Identify the robot from its logs
///
/// Prints each joint's friction, rotor inertia and torque offset with standard deviations, and how well they explain the
/// torque. The base is taken to be pinned and level: the robot hangs or is held. Several logs are taken together.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio identify chirp.csv
  proprio identify chirp.csv --physical -o go2.toml && proprio export -m go2.toml --mjcf -o go2.xml
  proprio identify --free-base walk.csv --physical -o go2.toml
  proprio identify --factor board.bin chirp.bin
  proprio identify morning.csv.gz evening.csv.gz --json -o robot.json
  proprio add coulomb -m arm.toml --urdf arm.urdf && proprio identify arm.csv -m arm.toml")]
pub(crate) struct Identify {
    /// Logs: CSV, plain or gzip-compressed
    #[arg(value_name = "LOG", required_unless_present = "factor")]
    logs: Vec<PathBuf>,
    /// Instead of logs: factors that `replay --factors` or `monitor` read from devices, merged
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["logs", "output", "bus", "physical", "free_base", "html", "model"])]
    factor: Vec<PathBuf>,
    /// Also write a model file that `export` takes (needs --physical); or, if the name ends in .json, what --json prints
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Round samples to what the motor bus carries, as a device that hears the log does
    #[arg(long)]
    bus: bool,
    /// Only values that are physical: bodies that could exist, friction and rotor inertia of at least zero
    ///
    /// Without it values are free, as the device streams them: an unphysical one tells that the model lacks something.
    #[arg(long)]
    physical: bool,
    /// The robot walks, sways or is swung: trunk and legs of a Go2, from logs with gyro/ and acc/ columns
    ///
    /// Nothing needs to be known of velocity, attitude or contact forces; foot/ columns help to tell which feet are in the air.
    #[arg(long, conflicts_with_all = ["bus", "model"])]
    free_base: bool,
    /// Also write a report with plots: one page, no network needed
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Fit the effects that this model file names, physical unless --free
    ///
    /// The joints in the logs are those of the file's robot. The file's priors count, its values do not. With -o the values are written to a model file.
    #[arg(short, long, value_name = "MODEL", conflicts_with_all = ["bus", "physical"])]
    model: Option<PathBuf>,
    /// With --model: values may be unphysical
    #[arg(long, requires = "model")]
    free: bool,
    /// With --model: also print what motion can tell at all, and what these logs do not tell
    #[arg(long, requires = "model")]
    base: bool,
    /// With --model: friction with the CAD's bodies first, then inertia, then physical inertia
    #[arg(long, requires = "model", conflicts_with = "free")]
    stages: bool,
    /// With --model: which equation the parameters are fitted to
    #[arg(long, value_enum, default_value_t, requires = "model")]
    method: Equation,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

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
        if self.free_base {
            return self.run_free_base();
        }
        let Some(path) = &self.model else {
            return self.run_plain();
        };
        let model = Model::load(path)?;
        let options = FitOptions {
            constraint: if self.free {
                Constraint::Free
            } else {
                Constraint::Physical
            },
            method: self.method.into(),
            stages: self.stages,
        };
        let mut progress = Progress::new("Identifying");
        let recording =
            Recording::read(&self.logs, &model, |done, total| progress.set(done, total))?;
        let mut fitted = fit_runs(&recording, &model, options)?;
        let wrong = mismatches(&recording, &model);
        fitted
            .warnings
            .extend(wrong.iter().map(ToString::to_string));
        drop(progress);
        for warning in &fitted.warnings {
            eprintln!("warning: {warning}");
        }
        // An unphysical fit is no model; a JSON file alone takes it.
        let filled = match (self.model_file(), &self.html) {
            (None, None) => None,
            _ => {
                let mut filled = fitted.to_model(&model, self.provenance()?)?;
                filled.forget_last_added();
                Some(filled)
            }
        };
        if let Some(path) = self.json_file() {
            output::write(path, &json(&fitted))?;
        }
        if let (Some(path), Some(filled)) = (self.model_file(), &filled) {
            filled.save(path)?;
            if options.method == Method::Momentum {
                check_reproduced(&recording, &Model::load(path)?, &fitted)?;
            }
        }
        if let (Some(path), Some(filled)) = (&self.html, &filled) {
            let comparison = compare(&recording, filled, ValuesFrom::Given)?;
            let page = pages::fit(&fitted, &comparison).map_err(unreadable)?;
            page.write(path)?;
        }
        if self.json {
            return Ok(json(&fitted));
        }
        let told = match self.base {
            true => fitted.identifiability(),
            false => String::new(),
        };
        let file = Some(path.as_path());
        let open = match self.base {
            true => closing(&model, file, &self.logs),
            false => at_the_end(&model, file, &self.logs, recording.limbs.len()),
        };
        Ok(format!("{fitted}{told}{open}"))
    }

    /// A Go2's plain effects, by the estimator of the device.
    fn run_plain(&self) -> Result<String, Error> {
        let mut progress = Progress::new("Identifying");
        let options = Options {
            bus: self.bus,
            constraint: self.constraint(),
        };
        let mut result = identify(&self.logs, options, |done, total| progress.set(done, total))?;
        // What a bus has sent is judged by the board that sends it.
        if let Ok(recording) = Recording::read(&self.logs, &Model::default(), |_, _| ()) {
            let wrong = mismatches(&recording, &Model::default());
            let told = wrong.iter().map(|wrong| {
                format!("{wrong}; of a Go2 that walks or stands: proprio identify --free-base")
            });
            result.warnings.extend(told);
        }
        drop(progress);
        for warning in &result.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = self.json_file() {
            output::write(path, &json(&result))?;
        }
        if let Some(path) = self.model_file() {
            result.to_model(self.provenance()?)?.save(path)?;
        }
        if let Some(path) = &self.html {
            let cad = Model::default();
            let recording = Recording::read(&result.logs, &cad, |_, _| ())?;
            let found = result.to_model(self.provenance()?)?;
            let [cad, found] = [series_of(&recording, &cad)?, series_of(&recording, &found)?];
            pages::identification(&result, cad, &found)
                .map_err(unreadable)?
                .write(path)?;
        }
        if self.json {
            return Ok(json(&result));
        }
        let legs = result.joints.len() / JOINTS_PER_LEG;
        let open = at_the_end(&Model::default(), None, &self.logs, legs);
        Ok(format!("{result}{open}"))
    }

    /// The whole Go2, moving and in contact.
    fn run_free_base(&self) -> Result<String, Error> {
        let mut progress = Progress::new("Identifying");
        let result = identify_free_base(&self.logs, self.constraint(), |done, total| {
            progress.set(done, total);
        })?;
        drop(progress);
        for warning in &result.warnings {
            eprintln!("warning: {warning}");
        }
        if let Some(path) = self.json_file() {
            output::write(path, &json(&result))?;
        }
        if let Some(path) = self.model_file() {
            result.to_model(self.provenance()?)?.save(path)?;
        }
        if let Some(path) = &self.html {
            let found = result.to_model(self.provenance()?)?;
            let comparison = compare_free_base(&self.logs, &found, ValuesFrom::Given, |_, _| ())?;
            let page = pages::walk_identification(&result, &comparison);
            page.map_err(unreadable)?.write(path)?;
        }
        Ok(if self.json {
            json(&result)
        } else {
            result.to_string()
        })
    }

    fn constraint(&self) -> Constraint {
        if self.physical {
            Constraint::Physical
        } else {
            Constraint::Free
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
        Provenance::of(&self.logs).map_err(unreadable)
    }
}

fn is_json(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "json")
}

//! `proprio excite`: the motion that tells.

mod arguments;
mod frf;
mod poses;
mod report;
mod trunk;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

use crate::excite::output::{Coefficients, Gains, write_csv};
use crate::excite::shapes::Shapes;
use crate::excite::{self, Goal, Settings, Supervisor, earlier};
use crate::model::{Limb, Model};
use crate::output::{self, AtomicFile, WriteError};
use arguments::{Cost, LimitArguments, Separation, TrunkArguments, parse_pose, parse_separation};
use clap::Args;
use report::Report;

use super::experiments::ExperimentArguments;
use super::result::result;
use super::{Error, json, model_or_default};
use crate::progress::Progress;

/// Greatest feedback gain that is written, N m/rad or N m s/rad: with a tenth of it a Go2's joint is stiff.
const MOST_GAIN: f64 = 500.0;

/// Least and greatest length of a motion and of its period, s: a tenth of a second is a few waves of 30 Hz, and an hour of motion is more
/// than any joint's parameters need (its file has 1.8 million rows).
const LENGTHS: (f64, f64) = (0.1, 3600.0);

/// Most waves of a series: of the usual period of 3.3 s the fastest has 30 Hz, where a joint within 30 rad/s goes 0.16 rad to either side.
const MOST_HARMONICS: i64 = 100;

/// Most starts of a search per leg, all drawn before it begins: of three joints and most waves a start is 4.8 kB, all of them half a gigabyte.
const MOST_STARTS: i64 = 100_000;

/// Design a motion that excites what can be identified, within the robot's limits
///
/// Each joint follows a Fourier series that begins and ends at rest in one pose. Limits of position, velocity, acceleration,
/// torque and power hold at every instant, for parameters off by --uncertainty, and no shape comes nearer than --distance to
/// another. Ctrl-C ends the search with the best motion so far; a second one ends the program.
///
/// A suspended robot does not reveal its trunk's parameters. --standing designs a motion of the trunk over four planted feet,
/// for `identify --free-base`. --frf plans periodic experiments that identify springs between motors and links, for `frf`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Excite {
    /// Where the motion goes: 500 rows a second of q, dq, ddq, tau (feed-forward), kp and kd of each joint
    #[arg(short, long, value_name = "MOTION", default_value = "motion.csv")]
    output: PathBuf,
    /// Where the series' coefficients go [default: the motion's name with .json]
    #[arg(long, value_name = "FILE")]
    coefficients: Option<PathBuf>,
    /// A page with plots and the moving leg
    #[arg(long, value_name = "PAGE")]
    html: Option<PathBuf>,
    /// The robot and what is known of it [default: the Go2's CAD]
    #[arg(short, long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Which legs (limbs of another robot), such as FR,RL [default: all]
    #[arg(long, value_name = "LEGS", value_delimiter = ',')]
    legs: Vec<String>,
    /// Length, s
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = super::simulate::within(LENGTHS.0, LENGTHS.1))]
    duration: f64,
    /// Length of the period that is repeated, s; about [default: a third of the duration, 3.3 s at most; to separate a payload
    /// from armature, the duration; of --frf, 4]
    #[arg(long, value_name = "S", value_parser = super::simulate::within(LENGTHS.0, LENGTHS.1))]
    period: Option<f64>,
    /// Waves of a series: the fastest is this many in a period [default: 10; of the trunk's, 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=MOST_HARMONICS))]
    harmonics: Option<u32>,
    /// What the motion is to be good for
    #[arg(long, value_enum, default_value_t = Cost::Condition)]
    cost: Cost,
    /// Parameters to identify best, such as m:FR_calf,coulomb:FR_hip; instead of --cost
    #[arg(
        long = "for",
        value_name = "PARAMETERS",
        value_delimiter = ',',
        conflicts_with = "cost"
    )]
    parameters: Vec<String>,
    /// Two effects to separate, at a joint or at all: stribeck,quadratic_drag:FR_thigh; instead of --cost
    #[arg(long, value_name = "A,B[:JOINT]", value_parser = parse_separation, conflicts_with_all = ["cost", "parameters"])]
    separate: Option<Separation>,
    /// Logs whose information the motion completes
    #[arg(long, value_name = "LOG", num_args = 1.., conflicts_with = "separate")]
    from: Vec<PathBuf>,
    /// Where to begin and end, rad: FR_hip=0.1,FR_calf=-1.8 [default: a bent leg]
    #[arg(long, value_name = "JOINT=RAD", value_delimiter = ',', value_parser = parse_pose)]
    pose: Vec<(String, f64)>,
    #[command(flatten)]
    trunk: TrunkArguments,
    #[command(flatten)]
    limits: LimitArguments,
    /// Choose so many poses to measure for `calibrate` instead of a motion: rows of q/<joint>
    #[arg(long, value_name = "N", conflicts_with_all = ["parameters", "separate", "from", "standing", "html", "shapes"], value_parser = clap::value_parser!(u32).range(3..=200))]
    poses: Option<u32>,
    /// Plan periodic experiments for `frf` instead of a motion: multisines on a slow sine, at some points
    #[arg(long, conflicts_with_all = ["parameters", "separate", "from", "standing", "html", "poses", "pose", "coefficients", "harmonics", "duration", "cost"])]
    frf: bool,
    #[command(flatten)]
    experiments: ExperimentArguments,
    /// Samples per second of a plan of --frf, Hz
    #[arg(long, value_name = "HZ", requires = "frf", default_value_t = crate::excite::output::RATE, value_parser = super::simulate::within(10.0, 5000.0))]
    rate: f64,
    /// A file of shapes to stay clear of: capsules of the robot and around it, planes
    #[arg(long, value_name = "SHAPES")]
    shapes: Option<PathBuf>,
    /// Feedback gains written with the motion, N m/rad
    #[arg(long, value_name = "KP", default_value_t = 40.0, value_parser = super::simulate::within(0.0, MOST_GAIN))]
    kp: f64,
    /// N m s/rad
    #[arg(long, value_name = "KD", default_value_t = 1.5, value_parser = super::simulate::within(0.0, MOST_GAIN))]
    kd: f64,
    /// Starts of the search per leg, on all processors
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=MOST_STARTS))]
    starts: u32,
    /// Seed of the starts: the same gives the same motion
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Excite {
    pub(crate) fn run(self) -> Result<String, Error> {
        let begun = Instant::now();
        let model = model_or_default(self.model.as_deref(), false)?;
        if let Some(count) = self.poses {
            return poses::choose(&self, &model, count as usize, begun);
        }
        if self.frf {
            return frf::plan(&self, &model, begun);
        }
        if self.trunk.standing {
            return trunk::standing(&self, &model, begun);
        }
        let limbs = model.robot().limbs_named(&self.legs)?;
        let settings = self.settings(&model, &limbs)?;
        output::finish_search_on_interrupt();
        let designs = excite::design(&model, &limbs, &settings, &Shown::new())?;
        let coefficients = self.coefficients();
        let report = Report::new(
            &self,
            &model,
            &designs,
            coefficients.clone(),
            begun.elapsed().as_secs_f64(),
        );
        // What is not within the limits is not written: it must not be played.
        if report.violations > 0 {
            let first = report.limbs.iter().flat_map(|limb| &limb.violations).next();
            return Err(Error::NotWithinLimits(first.cloned().unwrap_or_default()));
        }
        output::end_on_interrupt();
        write_motion(&self.output, |file| {
            write_csv(file, &model, &designs, self.gains())
        })?;
        if let Some(path) = &coefficients {
            output::write(path, &json(&Coefficients::of(&model, &designs, &settings)))?;
        }
        if let Some(page) = &self.html {
            crate::report::pages::excite::motion(&model, &designs).write(page)?;
        }
        Ok(if self.json {
            result("excite", &report)
        } else {
            report.to_string()
        })
    }

    /// Where the coefficients go; nowhere of themselves where the motion goes to a stream, which nothing lies beside.
    fn coefficients(&self) -> Option<PathBuf> {
        let beside =
            || (!output::is_stream(&self.output)).then(|| self.output.with_extension("json"));
        self.coefficients.clone().or_else(beside)
    }

    fn gains(&self) -> Gains {
        Gains {
            p: self.kp,
            d: self.kd,
        }
    }

    fn settings(&self, model: &Model, limbs: &[Limb]) -> Result<Settings, Error> {
        let goal = match (&self.separate, self.parameters.is_empty(), self.cost) {
            (Some(separation), ..) => Goal::Separation {
                effects: separation.effects,
                joint: separation.joint.clone(),
            },
            (None, false, _) => Goal::Variance(self.parameters.clone()),
            // What is known already says nothing of a condition number.
            (None, true, Cost::Condition) if self.from.is_empty() => Goal::Condition,
            (None, true, Cost::ConditionSi) if self.from.is_empty() => Goal::ConditionSi,
            (None, true, _) => Goal::Determinant,
        };
        let earlier = if self.from.is_empty() {
            Vec::new()
        } else {
            let mut progress = Progress::new("Reading");
            earlier::read(model, limbs, &self.from, |done, total| {
                progress.set(done, total)
            })?
        };
        let usual_period = || goal.usual_period(self.duration);
        let period = self.period.unwrap_or_else(usual_period);
        let usual = Settings::default();
        Ok(Settings {
            earlier,
            goal,
            duration: self.duration,
            period,
            harmonics: self.harmonics.map_or(usual.harmonics, |n| n as usize),
            pose: self.pose.clone(),
            margins: self.limits.margins(),
            shapes: self.shapes.as_deref().map(Shapes::read).transpose()?,
            seed: self.seed,
            starts: self.starts as usize,
            ..usual
        })
    }
}

/// Writes a motion's file by `write`, whole or not at all.
fn write_motion(
    path: &Path,
    write: impl FnOnce(&mut AtomicFile) -> std::io::Result<()>,
) -> Result<(), Error> {
    let unwritable = |source| WriteError {
        path: path.to_owned(),
        source,
    };
    let mut file = AtomicFile::create(path)?;
    write(&mut file).map_err(unwritable)?;
    file.flush().map_err(unwritable)?;
    file.commit()?;
    Ok(())
}

/// Shows how far the search is and the best cost.
struct Shown(Mutex<Progress>);

impl Shown {
    fn new() -> Self {
        Self(Mutex::new(Progress::new("Searching")))
    }
}

impl Supervisor for Shown {
    fn stop(&self) -> bool {
        output::asked_to_finish()
    }

    fn progress(&self, done: usize, of: usize, best: Option<f64>) {
        let mut bar = self
            .0
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        bar.set(done as u64, of as u64);
        if let Some(best) = best {
            bar.say(format!("Searching, best cost {best:.3}"));
        }
    }
}

const EXAMPLES: &str = "Examples:
  proprio excite --legs FR -o fr.csv --html fr.html
  proprio excite --cost determinant --duration 20 --seed 3
  proprio excite --legs FR --for m:FR_calf,coulomb:FR_calf
  proprio excite --legs FR --separate stribeck,quadratic_drag:FR_thigh -o next.csv
  proprio excite --legs FR --from fr_log.csv -o next.csv
  proprio excite --standing -o sway.csv
  proprio excite --frf -m arm.toml -o plan.csv";

//! The subcommands, one file each: `add`, `advise`, `calibrate`, `capture`, `compare`, `completions`, `demo`, `diagnose`, `effects`, `excite`, `export`, `factors`, `flash`, `frf`,
//! `identify`, `import`, `man`, `monitor`, `ports`, `record`, `remove`, `replay`, `show`, `simulate`, `validate`, `zero`. `hint`: what the user can do about an
//! error;
//! `overwrite`: what a command would replace; `result`: what --json prints; `bus_arguments`, `robot_arguments`: what several commands ask.

mod add;
mod advise;
mod bus_arguments;
mod calibrate;
mod capture;
mod compare;
mod completions;
mod dds_arguments;
mod demo;
mod diagnose;
mod effects;
mod excite;
mod experiments;
mod export;
mod factors;
mod flash;
mod frf;
pub mod hint;
mod identify;
mod import;
mod man;
mod monitor;
mod overwrite;
mod ports;
mod record;
mod remove;
mod replay;
pub mod result;
mod robot_arguments;
mod show;
mod simulate;
mod validate;
mod zero;

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::capture::CaptureError;
use crate::detect::every_window::{self, EveryWindow};
use crate::detect::mismatch::Mismatch;
use crate::device::DeviceError;
use crate::device::replay::ReplayError;
use crate::excite::ExciteError;
use crate::excite::earlier::EarlierError;
use crate::excite::shapes::ShapesError;
use crate::factors::FactorsError;
use crate::fleet::{Fault, TableError};
use crate::formula::FormulaError;
use crate::free_base::FreeBaseError;
use crate::identify::{NotAModel, NotReproduced};
use crate::kinematics::CalibrateError;
use crate::live::{LiveError, RestError};
use crate::log::LogError;
use crate::model::export::ExportError;
use crate::model::{AskedError, Model, ModelError, RobotError, UnknownName};
use crate::monitor::web::WebError;
use crate::monitor::{FeedError, JournalError};
use crate::output::WriteError;
use crate::progress::Progress;
use crate::recording::{Recording, RecordingError};
use crate::report::pages::Unreadable;
use crate::spectrum::FrfError;
use crate::summary::{Summary, quoted, typed, word};
use crate::validate::ValidateError;
use clap::error::ErrorKind;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use proprio_simulator::walk::WalkError;
use proprio_simulator::{Diverged, FollowError};
use serde::Serialize;

/// Which part of logs is judged.
#[derive(Debug, clap::Args)]
pub(crate) struct Part {
    /// Judge only the time in which this holds: `FR_calf: q > -1.5`, `t < 31.4`; several must all hold
    ///
    /// Signals are q, dq, temp and t (s), those of another joint of the limb q.NAME, with functions as in formulas: `FR_calf: abs(dq) > 0.2`. The limbs
    /// of other joints stay whole.
    #[arg(long, value_name = "CONDITION", conflicts_with = "free_base")]
    only: Vec<String>,
}

impl Part {
    /// A first screen whose next command judges the same part, if it is of a command that takes one.
    fn kept(&self, mut summary: Summary) -> Summary {
        let takes = ["compare", "diagnose", "identify"].map(|name| format!("proprio {name} "));
        for command in &mut summary.next {
            if takes.iter().any(|name| command.starts_with(name)) {
                let only = self.only.iter();
                command.extend(only.map(|text| format!(" --only {}", quoted(text))));
            }
        }
        summary
    }
}

/// What models make of every window of logs of which `recording` is a part that was drawn, with progress: before, of `given`, and after, of `found`.
fn every_window(
    recording: &Recording,
    [given, found]: [&Model; 2],
    on_feet: bool,
) -> Result<Option<EveryWindow>, RecordingError> {
    let mut progress = Progress::new("Every window");
    let told = |done, total| progress.set(done, total);
    every_window::every_window(recording, [given, found], on_feet, told)
}

/// Adds it to a first screen, with the command that judges the worst minute alone where that stands out: what stands above the headline.
fn every_window_words(
    every: Option<&EveryWindow>,
    summary: &mut Summary,
    (logs, model): (&[PathBuf], Option<&Path>),
) -> String {
    let Some(every) = every else {
        return String::new();
    };
    if let Some(conditions) = every.stands_out() {
        let only = conditions.map(|text| format!(" --only {}", quoted(&text)));
        let logs = typed(logs, model);
        summary
            .next
            .push(format!("proprio diagnose {logs}{}", only.concat()));
    }
    every.to_string()
}

/// What your robot's body really is, and what the model of it is still missing.
///
/// proprio identifies the dynamics (masses, inertias, friction, rotor inertia) of a Unitree Go2 from its motor bus, and of any
/// robot from its URDF and a log: on a fixed base, or on its feet.
#[derive(Debug, Parser)]
#[command(
    name = "proprio",
    version,
    propagate_version = true,
    arg_required_else_help = true
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Replace files that proprio did not make
    #[arg(long, global = true)]
    force: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    Add(add::Add),
    Advise(advise::Advise),
    Calibrate(calibrate::Calibrate),
    Capture(capture::Capture),
    Compare(compare::Compare),
    Completions(completions::Completions),
    Demo(demo::Demo),
    Diagnose(diagnose::Diagnose),
    Effects(effects::Effects),
    Excite(Box<excite::Excite>),
    Export(export::Export),
    Factors(factors::MakeBlocks),
    Flash(flash::Flash),
    Frf(frf::Frf),
    Identify(identify::Identify),
    Import(import::Import),
    Man(man::Manual),
    Monitor(monitor::Monitor),
    Ports(ports::Ports),
    Record(record::Record),
    Remove(remove::Remove),
    Replay(replay::Replay),
    Show(show::Show),
    Simulate(simulate::Simulate),
    Validate(validate::Validate),
    Zero(zero::Zero),
}

/// The program: does what the command line asks. Results go to standard output; errors, each with what can be done about it, to
/// standard error, and the exit status is then 1 (2 where the command line itself is wrong).
pub fn main() -> ExitCode {
    ExitCode::from(run_words(std::env::args_os()))
}

/// [`main`] for a command line of another process, `words`, the first of which is the program: its exit status.
pub fn run_words(words: impl IntoIterator<Item = OsString>) -> u8 {
    if let Err(error) = crate::output::remove_on_interrupt() {
        eprintln!("warning: Ctrl-C may leave unfinished files behind: {error}");
    }
    let matches = Arguments::command().get_matches_from(words);
    match run(&matches) {
        Ok(text) => match std::io::stdout().write_all(text.as_bytes()) {
            Err(error) if !has_seen_enough(&error) => {
                eprintln!("error: cannot write the result: {error}");
                FAILURE
            }
            _ => SUCCESS,
        },
        Err(Error::Write(error)) if has_seen_enough(&error.source) => SUCCESS,
        Err(error) => {
            let hint = hint::of(&error).map(|hint| with_model(hint, &matches));
            if let Some(command) = as_json(&matches) {
                // What cannot be written is on standard error too.
                let refused = result::refused(command, &error, hint.clone());
                let _ = std::io::stdout().write_all(refused.as_bytes());
            }
            eprintln!("error: {error}");
            if let Some(hint) = hint {
                eprintln!("hint: {hint}");
            }
            FAILURE
        }
    }
}

/// Exit statuses: done, and the data or the files are bad.
const SUCCESS: u8 = 0;
const FAILURE: u8 = 1;

/// Whether what was written to has a reader that left (`| head`): no failure.
fn has_seen_enough(error: &std::io::Error) -> bool {
    error.kind() == std::io::ErrorKind::BrokenPipe
}

/// What goes to standard output.
fn run(matches: &ArgMatches) -> Result<String, Error> {
    // Clap has matched the same definition.
    let arguments = Arguments::from_arg_matches(matches).unwrap_or_else(|error| error.exit());
    arguments.run(matches)
}

/// A hint in which `MODEL` is the one model that the command names, so that it can be typed.
fn with_model(hint: String, matches: &ArgMatches) -> String {
    let (Some(at), Some((_, command))) = (hint.find("-m MODEL"), matches.subcommand()) else {
        return hint;
    };
    let models = command.try_get_many::<PathBuf>("model").ok().flatten();
    match models.map(Iterator::collect::<Vec<_>>).as_deref() {
        Some([model]) => format!("{}-m {}{}", &hint[..at], word(model), &hint[at + 8..]),
        _ => hint,
    }
}

/// The command that is to print JSON, if it is.
fn as_json(matches: &ArgMatches) -> Option<&str> {
    let (name, command) = matches.subcommand()?;
    let flag = command.try_get_one::<bool>("json").ok().flatten();
    flag.is_some_and(|flag| *flag).then_some(name)
}

impl Arguments {
    fn run(self, matches: &ArgMatches) -> Result<String, Error> {
        let notes = match matches.subcommand() {
            Some((_, command)) => overwrite::check(command, self.force)?,
            None => Vec::new(),
        };
        let done = self.command.run()?;
        for note in notes {
            eprintln!("{note}");
        }
        Ok(done)
    }
}

impl Command {
    fn run(self) -> Result<String, Error> {
        match self {
            Self::Add(command) => command.run(),
            Self::Advise(command) => command.run(),
            Self::Calibrate(command) => command.run(),
            Self::Capture(command) => command.run(),
            Self::Compare(command) => command.run(),
            Self::Completions(command) => command.run(),
            Self::Demo(command) => command.run(),
            Self::Diagnose(command) => command.run(),
            Self::Effects(command) => command.run(),
            Self::Excite(command) => command.run(),
            Self::Export(command) => command.run(),
            Self::Factors(command) => command.run(),
            Self::Flash(command) => command.run(),
            Self::Frf(command) => command.run(),
            Self::Identify(command) => command.run(),
            Self::Import(command) => command.run(),
            Self::Man(command) => command.run(),
            Self::Monitor(command) => command.run(),
            Self::Ports(command) => command.run(),
            Self::Record(command) => command.run(),
            Self::Remove(command) => command.run(),
            Self::Replay(command) => command.run(),
            Self::Show(command) => command.run(),
            Self::Simulate(command) => command.run(),
            Self::Validate(command) => command.run(),
            Self::Zero(command) => command.run(),
        }
    }
}

/// Why a command fails: the data or the files are bad. Wrong usage is clap's affair.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    #[error(transparent)]
    FreeBase(#[from] FreeBaseError),
    /// Logs that are not what the model says, whether it is a Go2, and whether they have an IMU's columns.
    #[error("{logs}: not what the model says: {}", told(.wrong))]
    Mismatch {
        logs: String,
        wrong: Vec<Mismatch>,
        is_go2: bool,
        has_imu: bool,
    },
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    #[error(transparent)]
    Frf(#[from] FrfError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Factors(#[from] FactorsError),
    #[error(transparent)]
    Table(#[from] TableError),
    /// Blocks that cannot be used.
    #[error("{}: {fault}", .file.display())]
    Blocks { file: PathBuf, fault: Box<Fault> },
    /// What cannot be read of a table of blocks, which names its file.
    #[error("{0}")]
    BlockTable(Box<Fault>),
    /// Files of two robots, of which one is to be identified.
    #[error("{}: blocks of robot {robot}; those of the files before are {known}'s", .file.display())]
    AnotherRobot {
        file: PathBuf,
        robot: String,
        known: String,
    },
    #[error(transparent)]
    Journal(#[from] JournalError),
    #[error(transparent)]
    Feed(#[from] FeedError),
    #[error(transparent)]
    Live(#[from] LiveError),
    #[error(transparent)]
    Web(#[from] WebError),
    #[error("the terminal: {0}")]
    Terminal(std::io::Error),
    #[error(
        "the device sent no estimate of leg {leg}: of {played} samples played {samples} arrived, {windows} windows closed"
    )]
    NoEstimate {
        leg: &'static str,
        played: u32,
        samples: u32,
        windows: u32,
    },
    /// `replay --add` of an effect that the firmware keeps no columns for.
    #[error("the device keeps no columns for {effect}; it has {kept}")]
    NotOnDevice { effect: &'static str, kept: String },
    /// `zero` of a joint that the device did not take.
    #[error("{joint}: {why}; its zero stays as it was")]
    NotPlaced {
        joint: &'static str,
        why: &'static str,
    },
    /// `zero --from` of a robot whose joints do not rest, or of a source that does not say.
    #[error(transparent)]
    Rest(#[from] RestError),
    /// `zero --from` of a source without a leg that is asked for.
    #[error("{source_name}: it says nothing of {leg}")]
    NotReported {
        source_name: String,
        leg: &'static str,
    },
    /// `zero --same-power-up` where nothing was kept, or a motor was silent since.
    #[error("the device has kept no zeros that have held since")]
    NoZeros,
    /// `zero --trust-wiring` where no leg is on trial, or only such as have a fault.
    #[error("no leg is on trial, or those that are have a fault")]
    NoTrial,
    /// A command to a device that it has not answered.
    #[error("the device answered {answers} of {wishes} commands")]
    Unanswered { answers: usize, wishes: usize },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Diverged(#[from] Diverged),
    #[error(transparent)]
    Walk(#[from] WalkError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Robot(#[from] RobotError),
    #[error(transparent)]
    UnknownName(#[from] UnknownName),
    #[error(transparent)]
    Asked(#[from] AskedError),
    #[error(transparent)]
    NotAModel(#[from] NotAModel),
    #[error(transparent)]
    NotReproduced(#[from] NotReproduced),
    #[error(transparent)]
    Follow(#[from] FollowError),
    #[error(transparent)]
    Earlier(#[from] EarlierError),
    #[error(transparent)]
    Validate(#[from] ValidateError),
    #[error(transparent)]
    Excite(#[from] ExciteError),
    #[error(transparent)]
    Shapes(#[from] ShapesError),
    /// The best motion is not proved to be within the limits.
    #[error("no motion could be proved to be within the limits: {0}")]
    NotWithinLimits(String),
    #[error("{0}: {1}")]
    Unreadable(String, std::io::Error),
    #[error(transparent)]
    Export(#[from] ExportError),
    /// `export` of a model that holds for the motion of one log.
    #[error("{effect}: {at}")]
    OverTime { effect: String, at: FormulaError },
    /// A file that would be lost.
    #[error("{}, {what}, would be replaced", .path.display())]
    WouldReplace { path: PathBuf, what: String },
    /// A log that is read would be written over.
    #[error("{}: the log would be replaced by what is found in it", .0.display())]
    WouldReplaceLog(PathBuf),
    /// `demo` in a directory of something else.
    #[error("{}: holds files that no demo made", .0.display())]
    NotADemo(PathBuf),
    /// `add --urdf` with a model file that exists.
    #[error("{}: the model has its robot already", .0.display())]
    RobotIsSet(PathBuf),
}

/// The model of a file, or the default one: also where the file does not exist and `make` says that it is to be made.
fn model_or_default(path: Option<&Path>, make: bool) -> Result<Model, Error> {
    match path {
        Some(path) if path.exists() || !make => Ok(Model::load(path)?),
        _ => Ok(Model::default()),
    }
}

/// What is wrong between a log and the model.
fn told(wrong: &[Mismatch]) -> String {
    let told: Vec<String> = wrong.iter().map(ToString::to_string).collect();
    told.join("; ")
}

/// Saves a model whose values a fit of motion has just given once more where other witnesses have measured some of them: combined, or warned of. The
/// file without that has been saved and read back as the fit's.
fn save_with_other_witnesses(model: &mut Model, path: &Path) -> Result<(), Error> {
    if model.take_as_measured_by_motion() {
        model.save(path)?;
        for contradiction in model.contradictions() {
            eprintln!("warning: {contradiction}");
        }
    }
    Ok(())
}

/// A log that was there and is no more.
fn unreadable((log, cause): Unreadable) -> Error {
    Error::Unreadable(log, cause)
}

/// One JSON object and a line end.
fn json(value: &impl Serialize) -> String {
    // Our own types: string keys, and no writer that can fail.
    serde_json::to_string_pretty(value).expect("results are plain data") + "\n"
}

/// Ends the process as clap does on wrong usage of `command`.
fn usage_error(command: &str, kind: ErrorKind, message: String) -> ! {
    let mut arguments = Arguments::command();
    arguments.build();
    match arguments.find_subcommand_mut(command) {
        Some(command) => command.error(kind, message).exit(),
        None => arguments.error(kind, message).exit(),
    }
}

//! `proprio replay`: a log played into a device as motor-bus bytes.

mod effects;
mod report;

use std::path::PathBuf;
use std::time::Instant;

use crate::device::pull::pull;
use crate::device::replay::{self, ReplayError};
use crate::device::serial::SerialDevice;
use crate::device::{BusStep, Desktop, Device, DeviceError, Qemu, Requests, RowSteps, image};
use crate::live::Adapter;
use crate::log::{LogReader, Selection};
use clap::error::ErrorKind;
use clap::{Args, ValueEnum};
use proprio_core::go2::{LEGS, Leg};
use proprio_core::wire::{self, Action, DeviceMessage, HostMessage, Positions};

use effects::{Answer, Wish};
use report::{Report, Told};

use super::Error;
use super::result::result;
use crate::progress::Progress;

/// Play a log into a device and print what comes back
///
/// The log's samples become the motor bus's bytes; the device assembles and identifies them and streams its estimates back. The
/// last ones are printed: they equal those of `proprio identify --bus`. So is the device's own diagnosis of each effect for
/// which it keeps columns: the share of the held-out squared error that the effect explains, or would.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio replay chirp.csv --to qemu
  proprio replay chirp.csv --to desktop --factors a.bin && proprio identify --factor a.bin b.bin
  proprio replay chirp.csv --to desktop --add quadratic_drag:FR_calf --drop bias
  proprio replay chirp.csv --to /dev/ttyACM0 --leg FR=/dev/ttyUSB0")]
pub(crate) struct Replay {
    /// Log in any format: CSV, bags, npz, Parquet, captures (docs/logs.md)
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// `qemu` builds and boots the firmware in an emulator, `desktop` runs its application in this process, a serial port
    /// is a board's host link
    #[arg(long, value_name = "qemu|desktop|PORT")]
    to: String,
    /// A board's bus input: the RS-485 adapter that is wired to this leg's
    #[arg(long = "leg", value_name = "LEG=PORT", value_parser = Adapter::parse)]
    adapters: Vec<Adapter>,
    /// What the emulated firmware computes with
    #[arg(long, value_enum, default_value_t = Scalar::F64)]
    scalar: Scalar,
    /// Have the device estimate this effect too; without JOINT, at every joint of the log
    #[arg(long = "add", value_name = "EFFECT[:JOINT]")]
    add: Vec<String>,
    /// Have it estimate this effect no more
    #[arg(long = "drop", value_name = "EFFECT[:JOINT]")]
    drop: Vec<String>,
    /// Also write the device's factors: what `identify --factor` merges with those of other logs and devices
    #[arg(long, value_name = "FILE")]
    factors: Option<PathBuf>,
    /// Whose log it is: a name in the factors, so that those of two robots are not merged
    #[arg(long, value_name = "ID", requires = "factors")]
    robot: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Scalar {
    /// Single precision
    F32,
    /// Double precision
    F64,
}

impl Replay {
    pub(crate) fn run(self) -> Result<String, Error> {
        // The whole log is judged before a device hears any of it.
        let mut check = LogReader::open(&self.log, Selection::Motion)?;
        while check.next_row()?.is_some() {}
        let warnings = check.finish()?;
        let legs: Vec<Leg> = check.columns().legs().collect();

        let mut wishes: Vec<Wish> = Vec::new();
        for (add, texts) in [(true, &self.add), (false, &self.drop)] {
            for text in texts {
                wishes.extend(effects::wishes(add, text, &legs)?);
            }
        }
        let mut device = self.device(&legs)?;
        let mut requests = Requests::new();
        // What a log has are angles, whatever the device hears else.
        let angles = requests.ask(Action::SetPositions(Positions::Absolute), Instant::now());
        let message = HostMessage::Request(angles);
        device.command(&message).map_err(ReplayError::from)?;
        for wish in &wishes {
            let request = requests.ask(wish.action(device.hello())?, Instant::now());
            let message = HostMessage::Request(request);
            device.command(&message).map_err(ReplayError::from)?;
        }
        let mut steps = Steps::new(LogReader::open(&self.log, Selection::Motion)?, &legs);
        let mut told = Told::default();
        let last_us = replay(&mut steps, &mut *device, &mut |message| told.hear(message))?;
        if let Some(path) = &self.factors {
            let mut hear = |message| told.hear(message);
            let factors = pull(&mut *device, &legs, last_us, &mut hear);
            let factors = factors.map_err(ReplayError::from)?;
            factors.of_robot(self.robot.clone()).write(path)?;
        }
        let answered = |answer: &wire::Answer| Some((requests.answered(answer)?, answer.outcome));
        let answers: Vec<_> = told.answers.iter().filter_map(answered).collect();
        if !requests.is_empty() {
            let (answers, wishes) = (answers.len(), wishes.len());
            return Err(Error::Unanswered { answers, wishes });
        }
        let changes = answers
            .iter()
            .filter_map(|(action, outcome)| Answer::new(action, *outcome, device.hello()))
            .collect();

        let warnings = warnings
            .iter()
            .map(|w| format!("{}: {w}", self.log.display()))
            .collect();
        let report = Report::new(
            device.hello(),
            told,
            &legs,
            steps.rows.played(),
            changes,
            warnings,
        )?;
        report
            .warnings
            .iter()
            .for_each(|warning| eprintln!("warning: {warning}"));
        Ok(if self.json {
            result("replay", &report)
        } else {
            report.to_string()
        })
    }

    fn device(&self, legs: &[Leg]) -> Result<Box<dyn Device>, Error> {
        let open = || -> Result<Box<dyn Device>, DeviceError> {
            Ok(match (self.to.as_str(), self.scalar) {
                ("qemu", Scalar::F32) => Box::new(Qemu::boot(&image::build(image::Scalar::F32)?)?),
                ("qemu", Scalar::F64) => Box::new(Qemu::boot(&image::build(image::Scalar::F64)?)?),
                ("desktop", Scalar::F32) => Box::new(Desktop::<f32>::new()),
                ("desktop", Scalar::F64) => Box::new(Desktop::<f64>::new()),
                (port, _) => Box::new(SerialDevice::open(port, self.adapters_of(legs))?),
            })
        };
        open().map_err(|error| ReplayError::from(error).into())
    }

    /// The adapter of each leg; a board needs one for every leg of the log.
    fn adapters_of(&self, legs: &[Leg]) -> [Option<&str>; LEGS] {
        let adapters = Leg::ALL.map(|leg| {
            let own = self.adapters.iter().rev().find(|own| own.leg == leg);
            own.map(|own| own.port.as_str())
        });
        if let Some(leg) = legs.iter().find(|leg| adapters[leg.index()].is_none()) {
            let name = leg.name();
            let message = format!("the log has leg {name}: add --leg {name}=PORT, its bus adapter");
            super::usage_error("replay", ErrorKind::MissingRequiredArgument, message);
        }
        adapters
    }
}

/// A log as bus steps.
struct Steps {
    reader: LogReader,
    rows: RowSteps,
    progress: Progress,
}

impl Steps {
    fn new(reader: LogReader, legs: &[Leg]) -> Self {
        Self {
            reader,
            rows: RowSteps::new(legs),
            progress: Progress::new("Playing"),
        }
    }

    /// The next step.
    fn next(&mut self) -> Result<Option<BusStep>, Error> {
        let (done, total) = self.reader.progress();
        self.progress.set(done, total);
        while let Some(row) = self.reader.next_row()? {
            if let Some(step) = self.rows.step(row)? {
                return Ok(Some(step));
            }
        }
        Ok(None)
    }
}

/// Plays all steps; the time of the last, µs.
fn replay(
    steps: &mut Steps,
    device: &mut dyn Device,
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<u64, Error> {
    let mut failed = None;
    let played = std::iter::from_fn(|| {
        steps.next().unwrap_or_else(|error| {
            failed = Some(error);
            None
        })
    });
    let last_us = replay::replay(played.map(Ok), device, told)?;
    failed.map_or(Ok(last_us), Err)
}

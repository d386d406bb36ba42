//! `proprio replay`: a log played into a device as motor-bus bytes.

mod effects;

use std::fmt;
use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::{Args, ValueEnum};
use proprio::device::replay::{self, ReplayError, bus_step};
use proprio::device::serial::SerialDevice;
use proprio::device::{BusStep, Desktop, Device, DeviceError, Qemu, image};
use proprio::estimate::{self, LEGEND, ParameterEstimate, effect_table};
use proprio::identification::IdentificationError;
use proprio::log::{JointId, LogReader, Selection, leg_named};
use proprio::table::{Table, with_std};
use proprio_core::estimator::EFFECTS;
use proprio_core::go2::{LEGS, Leg};
use proprio_core::wire::{
    Changed, Counters, DeviceMessage, Diagnosis, Estimate, Hello, LegCounters,
};
use serde::Serialize;

use effects::{Answer, Found, Wish};

use super::{Error, json};
use crate::progress::Progress;

/// Play a log into a device and print what comes back
///
/// The log's samples become the motor bus's bytes; the device assembles and identifies them and streams its estimates back.
/// The last ones are printed: they equal those of `proprio identify --bus`. So is what the device itself finds of each effect
/// that it keeps columns for: the share of the squared error on held-out data that the effect takes away, or would.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio replay chirp.csv --to qemu
  proprio replay chirp.csv --to desktop --add quadratic_drag:FR_calf --drop bias
  proprio replay chirp.csv --to /dev/ttyACM0 --leg FR=/dev/ttyUSB0")]
pub(crate) struct Replay {
    /// Log: CSV, plain or gzip-compressed
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// `qemu` builds and boots the firmware in an emulator, `desktop` runs its application in this process, a serial port
    /// is a board's host link
    #[arg(long, value_name = "qemu|desktop|PORT")]
    to: String,
    /// A board's bus input: the RS-485 adapter that is wired to this leg's
    #[arg(long = "leg", value_name = "LEG=PORT", value_parser = parse_adapter)]
    adapters: Vec<(Leg, String)>,
    /// What the emulated firmware computes with
    #[arg(long, value_enum, default_value_t = Scalar::F64)]
    scalar: Scalar,
    /// Have the device estimate this effect too; without JOINT, at every joint of the log
    #[arg(long = "add", value_name = "EFFECT[:JOINT]")]
    add: Vec<String>,
    /// Have it estimate this effect no more
    #[arg(long = "drop", value_name = "EFFECT[:JOINT]")]
    drop: Vec<String>,
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

/// What came back.
#[derive(Debug, Serialize)]
struct Report {
    board: String,
    firmware: String,
    scalar_bits: u8,
    load_unit: String,
    parameters: Vec<ParameterEstimate>,
    legs: Vec<LegReport>,
    /// What became of `--add` and `--drop`.
    changes: Vec<Answer>,
    /// What the device found of each effect at each joint, each joint's best first.
    diagnoses: Vec<Found>,
    counters: Counters,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct LegReport {
    leg: &'static str,
    /// Samples played.
    played: u32,
    windows: u32,
    /// Each joint's noise: standard deviation of a window's mean torque, N m.
    noise: [f32; 3],
}

/// The last that the device told.
#[derive(Default)]
struct Told {
    estimates: [Option<Estimate>; LEGS],
    diagnoses: Vec<Diagnosis>,
    changes: Vec<Changed>,
    counters: Counters,
}

impl Told {
    fn hear(&mut self, message: DeviceMessage) {
        match message {
            DeviceMessage::Estimate(estimate) => {
                if let Some(slot) = self.estimates.get_mut(usize::from(estimate.leg)) {
                    *slot = Some(estimate);
                }
            }
            DeviceMessage::Counters(counters) => self.counters = counters,
            DeviceMessage::Diagnosis(diagnosis) => self.diagnoses.push(diagnosis),
            DeviceMessage::Changed(changed) => self.changes.push(changed),
            DeviceMessage::Hello(_) | DeviceMessage::Advanced(_) => {}
        }
    }
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
        for wish in &wishes {
            let message = wish.message(device.hello())?;
            device.command(&message).map_err(ReplayError::from)?;
        }
        let mut steps = Steps::new(LogReader::open(&self.log, Selection::Motion)?, &legs);
        let mut told = Told::default();
        replay(&mut steps, &mut *device, &mut |message| told.hear(message))?;
        if told.changes.len() < wishes.len() {
            let (answers, wishes) = (told.changes.len(), wishes.len());
            return Err(Error::Unanswered { answers, wishes });
        }

        let warnings = warnings
            .iter()
            .map(|w| format!("{}: {w}", self.log.display()))
            .collect();
        let report = Report::new(device.hello(), told, &legs, steps.played, warnings)?;
        report
            .warnings
            .iter()
            .for_each(|warning| eprintln!("warning: {warning}"));
        Ok(if self.json {
            json(&report)
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
            let own = self.adapters.iter().rev().find(|(of, _)| *of == leg);
            own.map(|(_, port)| port.as_str())
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
struct Steps<'a> {
    reader: LogReader,
    legs: &'a [Leg],
    last_us: Option<u64>,
    played: u32,
    progress: Progress,
}

impl<'a> Steps<'a> {
    fn new(reader: LogReader, legs: &'a [Leg]) -> Self {
        let progress = Progress::new("Playing");
        Self {
            reader,
            legs,
            last_us: None,
            played: 0,
            progress,
        }
    }

    /// The next step; rows without a time of their own are left out, as every estimator leaves them out.
    fn next(&mut self) -> Result<Option<BusStep>, Error> {
        let (done, total) = self.reader.progress();
        self.progress.set(done, total);
        while let Some(row) = self.reader.next_row()? {
            if self.last_us.is_some_and(|last| row.time_us <= last) {
                continue;
            }
            self.last_us = Some(row.time_us);
            self.played += 1;
            let instant = Leg::ALL.map(|leg| self.legs.contains(&leg).then(|| row.sample(leg)));
            return Ok(Some(bus_step(row.time_us, &instant)?));
        }
        Ok(None)
    }
}

/// Plays all steps.
fn replay(
    steps: &mut Steps,
    device: &mut dyn Device,
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<(), Error> {
    let mut failed = None;
    let played = std::iter::from_fn(|| {
        steps.next().unwrap_or_else(|error| {
            failed = Some(error);
            None
        })
    });
    replay::replay(played.map(Ok), device, told)?;
    failed.map_or(Ok(()), Err)
}

impl Report {
    fn new(
        hello: &Hello,
        told: Told,
        legs: &[Leg],
        played: u32,
        mut warnings: Vec<String>,
    ) -> Result<Self, Error> {
        let mut parameters = Vec::new();
        let mut reports = Vec::new();
        for &leg in legs {
            let counters = &told.counters.legs[leg.index()];
            let name = leg.name();
            let Some(estimate) = &told.estimates[leg.index()] else {
                let (samples, windows) = (counters.samples, counters.windows);
                return Err(Error::NoEstimate {
                    leg: name,
                    played,
                    samples,
                    windows,
                });
            };
            if counters.samples != played {
                let arrived = counters.samples;
                warnings.push(format!("leg {name}: {arrived} of {played} samples arrived"));
            }
            let active = effects::of_masks(leg, &estimate.effects, hello);
            let estimates = estimate::of_device(leg, &active, &estimate.values, &estimate.std);
            parameters
                .extend(estimates.map_err(|source| IdentificationError::Solve { leg, source })?);
            let (windows, noise) = (estimate.windows, estimate.noise);
            reports.push(LegReport {
                leg: name,
                played,
                windows,
                noise,
            });
        }
        Ok(Self {
            board: hello.board.to_string(),
            firmware: hello.firmware.to_string(),
            scalar_bits: hello.capacities.scalar_bits,
            load_unit: hello.load_unit.to_string(),
            parameters,
            legs: reports,
            changes: told
                .changes
                .iter()
                .filter_map(|c| Answer::new(c, hello))
                .collect(),
            diagnoses: effects::found(&told.diagnoses, hello),
            counters: told.counters,
            warnings,
        })
    }
}

/// What one leg's counters are called and how to read them.
type Count = (&'static str, fn(&LegCounters) -> u32);
const COUNTS: [Count; 10] = [
    ("replies", |c| c.replies),
    ("bad CRC", |c| c.bad_crc),
    ("short", |c| c.short),
    ("unused", |c| c.unused_replies),
    ("samples", |c| c.samples),
    ("repeated", |c| c.repeated),
    ("late", |c| c.late),
    ("rejected", |c| c.rejected),
    ("gaps", |c| c.gaps),
    ("windows", |c| c.windows),
];

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            board,
            firmware,
            scalar_bits,
            ..
        } = self;
        writeln!(f, "{board}, firmware {firmware}, {scalar_bits}-bit:\n")?;
        let legs = || {
            self.legs
                .iter()
                .filter_map(|leg| leg_named(leg.leg).ok().map(|l| (l, leg)))
        };
        let rows = legs().flat_map(|(leg, report)| {
            let noise = report.noise.map(|noise| [format!("{noise:.4}")]);
            JointId::of(leg).into_iter().zip(noise)
        });
        writeln!(
            f,
            "{}{LEGEND}\n",
            effect_table(&self.parameters, [["noise", "N m"]], rows)
        )?;

        self.effects(f)?;
        let mut table = Table::default();
        let names = COUNTS.map(|(name, _)| name.to_owned());
        table.row(
            [String::from("leg"), String::from("played")]
                .into_iter()
                .chain(names),
        );
        for (leg, report) in legs() {
            let counters = &self.counters.legs[leg.index()];
            let counts = COUNTS.map(|(_, count)| count(counters).to_string());
            let first = [report.leg.to_owned(), report.played.to_string()];
            table.row(first.into_iter().chain(counts));
        }
        write!(f, "{table}")?;
        let load = &self.counters.load;
        if load.ticks > 0 {
            let (unit, mean) = (&self.load_unit, load.total / u64::from(load.ticks));
            let (worst, over) = (load.worst, load.over_budget);
            writeln!(
                f,
                "\n{unit} per tick: {mean} mean, {worst} worst; {over} of {} over budget",
                load.ticks
            )?;
        }
        Ok(())
    }
}

impl Report {
    /// What the device was asked, the effects it has beside the usual ones, and what it finds of all of them.
    fn effects(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.changes
            .iter()
            .try_for_each(|answer| write!(f, "{answer}"))?;
        let usual = |name: &str| EFFECTS.iter().any(|effect| name.starts_with(effect.name()));
        let added = self
            .parameters
            .iter()
            .filter(|p| !p.is_inertial() && !usual(&p.name));
        let mut table = Table::default();
        for parameter in added {
            let value = with_std(parameter.value, parameter.std);
            table.row([parameter.name.clone(), value, parameter.unit.to_owned()]);
        }
        write!(f, "{table}")?;
        if self.diagnoses.is_empty() {
            return Ok(());
        }
        let table = effects::table(&self.diagnoses);
        writeln!(
            f,
            "\nThe device finds, on data held out from the fit:\n\n{table}"
        )
    }
}

fn parse_adapter(text: &str) -> Result<(Leg, String), String> {
    let (leg, port) = text
        .split_once('=')
        .ok_or("expected LEG=PORT, such as FR=/dev/ttyUSB0")?;
    let leg = leg_named(leg).map_err(|unknown| unknown.to_string())?;
    Ok((leg, port.to_owned()))
}

//! `proprio capture`: a motor bus's raw bytes to a file, and what they say.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::capture::{
    CaptureError, CaptureReader, CaptureWriter, Captured, Explanation, Facts, MotorExplanation,
    Told, explain,
};
use crate::device::{BusStep, Device, Qemu, Robot, image};
use crate::live::{self, Address, Until};
use crate::monitor::FeedError;
use crate::name::leg_named;
use crate::output::{AtomicFile, WriteError, asked_to_finish, finish_on_interrupt};
use crate::table::Table;
use clap::Args;
use clap::error::ErrorKind;
use proprio_core::go2::Leg;
use proprio_core::wire::DeviceMessage;
use proprio_simulator::hidden::typical;
use serde::Serialize;

use super::Error;
use super::bus_arguments::BusArguments;
use super::result::result;
use crate::progress::{Progress, Underway};

/// Record a motor bus's raw bytes, or explain such a recording
///
/// An RS-485 adapter listens to one leg's bus; `sim` is a bus of a simulated robot, `qemu` the same with an emulated board on it. The bytes go to
/// the file with their times, until Ctrl-C or --seconds. --explain prints what the device would make of such a file: ids and
/// order of the motors, cycle rate, turn-around times, seeds of the checksums, errors, and the share of the replies that become
/// samples. Times are as good as the adapter's: set the latency timer of a USB adapter to 1 ms. With --at of its leg's three joints the capture is
/// a log for every command; `record` makes rows of the same bytes as they come.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio capture /dev/ttyUSB0 -o FR.cap --seconds 10
  proprio capture --explain FR.cap
  proprio capture sim -o FR.cap --seconds 5 && proprio identify FR.cap
  proprio capture qemu -o FR.cap --seconds 5 && proprio capture --explain FR.cap && proprio identify FR.cap
  proprio capture FR=/dev/ttyUSB0 -o FR.cap --at FR_hip=0.1 --at FR_thigh=0.8 --at FR_calf=lower")]
pub(crate) struct Capture {
    /// Serial port of the adapter, with its leg or without; `sim` or `qemu`
    #[arg(
        value_name = "[LEG=]PORT|sim|qemu",
        required_unless_present = "explain"
    )]
    port: Option<String>,
    /// Where the capture goes
    #[arg(short, long, value_name = "FILE", required_unless_present = "explain")]
    output: Option<PathBuf>,
    /// How long to record [default: until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = super::simulate::within(0.1, 1e9))]
    seconds: Option<f64>,
    /// The leg whose bus it is, where PORT does not begin with it
    #[arg(long, value_name = "LEG", value_parser = leg_named)]
    leg: Option<Leg>,
    #[command(flatten)]
    bus: BusArguments,
    /// Explain this capture
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "output", "seconds", "baud", "leg", "at", "reversed"])]
    explain: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What was recorded.
#[derive(Serialize)]
struct Recorded {
    output: PathBuf,
    seconds: f64,
    bytes: u64,
    records: u64,
    /// What an emulated board counted on the same bus: good commands and replies.
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<[u32; 2]>,
}

/// Silence after a capture of an emulated board, in which it tells its last counts, µs.
const SILENCE_US: u64 = 200_000;

impl Capture {
    pub(crate) fn run(self) -> Result<String, Error> {
        match (&self.explain, &self.port, &self.output) {
            (Some(path), ..) => self.explain(path),
            (None, Some(port), Some(output)) if port == "qemu" => self.record_emulated(output),
            (None, Some(port), Some(output)) => self.record(port, output),
            // Clap has seen to it.
            _ => Ok(String::new()),
        }
    }

    /// What the user says of the bus, and its port; of a simulated robot there is none.
    fn bus<'a>(&self, port: &'a str) -> (Facts, Option<&'a str>) {
        match Address::parse(&[port.to_owned()]) {
            Some(Address::Dds(_) | Address::Text) => {
                let why = format!(
                    "{port} carries no bytes of a motor bus: `proprio record {port} -o LOG` records its rows"
                );
                super::usage_error("capture", ErrorKind::ValueValidation, why);
            }
            Some(Address::Simulated) => {
                let leg = Some(self.leg.unwrap_or(Leg::FR));
                let told = Told::Angles;
                return (Facts { leg, told }, None);
            }
            Some(Address::Adapters(_)) | None => {}
        }
        let (named, port) = match port.split_once('=') {
            Some((leg, port)) => match leg_named(leg) {
                Ok(leg) => (Some(leg), port),
                Err(unknown) => {
                    super::usage_error("capture", ErrorKind::ValueValidation, unknown.to_string())
                }
            },
            None => (None, port),
        };
        let at = || self.bus.at.first().map(|(joint, _)| joint.leg());
        let leg = named.or(self.leg).or_else(at);
        let told = leg.map_or(Told::Nothing, |leg| self.bus.told("capture", leg));
        (Facts { leg, told }, Some(port))
    }

    fn record(&self, port: &str, output: &Path) -> Result<String, Error> {
        let (facts, bus) = self.bus(port);
        finish_on_interrupt();
        let limit = self.seconds.map(Duration::from_secs_f64);
        // A port may be silent; the simulated robot's time is that of its records alone.
        let until = bus.map_or_else(Until::default, |_| Until::within(limit));
        let bytes = live::bytes(bus, &facts, self.bus.baud, &until)?;
        let mut reader = CaptureReader::new(bytes, port.to_owned())?;
        let written = |source| WriteError {
            path: output.to_owned(),
            source,
        };
        let file = AtomicFile::create(output)?;
        let capture = CaptureWriter::of(file, reader.baud(), reader.facts());
        let mut capture = capture.map_err(written)?;
        let mut progress = Progress::new("Recording");
        let underway = self
            .seconds
            .is_none()
            .then(|| Underway::new("Recording until Ctrl-C"));
        let limit_us = limit.map_or(u64::MAX, |limit| limit.as_micros() as u64);
        let mut captured = Captured::default();
        while let Some(record) = reader.next_record().map_err(of_port)? {
            if record.time_us > limit_us {
                break;
            }
            capture
                .record(record.time_us, &record.bytes)
                .map_err(written)?;
            captured.bytes += record.bytes.len() as u64;
            captured.records += 1;
            captured.time_us = record.time_us;
            if limit.is_some() {
                progress.set(captured.time_us, limit_us);
            }
        }
        until.stop();
        drop(underway);
        let Captured {
            bytes,
            records,
            time_us,
        } = captured;
        capture.finish().map_err(written)?.commit()?;
        let recorded = Recorded {
            output: output.to_owned(),
            seconds: time_us as f64 * 1e-6,
            bytes,
            records,
            board: None,
        };
        if bytes == 0 {
            eprintln!("warning: nothing came: check the wiring, and that the robot is on");
        }
        Ok(match self.json {
            true => result("capture", &recorded),
            false => recorded.to_string(),
        })
    }

    /// Records what an emulated board hears on a bus of a simulated robot, on the robot's own clock.
    fn record_emulated(&self, output: &Path) -> Result<String, Error> {
        let mut device = Qemu::boot(&image::build(image::Scalar::F64)?)?;
        let leg = Leg::FR;
        let robot = Robot::new(&[leg], typical(&[leg]), 1);
        let written = |source| WriteError {
            path: output.to_owned(),
            source,
        };
        let facts = Facts {
            leg: Some(leg),
            told: Told::Angles,
        };
        let file = AtomicFile::create(output)?;
        let mut capture = CaptureWriter::of(file, self.bus.baud, &facts).map_err(written)?;
        finish_on_interrupt();
        let mut progress = Progress::new("Recording");
        let mut captured = Captured::default();
        let mut board = [0; 2];
        let mut hear = |message| {
            if let DeviceMessage::Counters(counters) = message {
                let leg = counters.legs[leg.index()];
                board = [leg.commands, leg.replies];
            }
        };
        for step in robot.steps() {
            let step = step.map_err(FeedError::from)?;
            let limit_us = self.seconds.map(|seconds| (seconds * 1e6) as u64);
            if asked_to_finish() || limit_us.is_some_and(|limit_us| step.time_us > limit_us) {
                break;
            }
            progress.set(step.time_us, limit_us.unwrap_or(u64::MAX));
            let bytes = &step.buses[leg.index()];
            capture.record(step.time_us, bytes).map_err(written)?;
            captured.bytes += bytes.len() as u64;
            captured.records += 1;
            captured.time_us = step.time_us;
            device.play(&step, &mut hear)?;
        }
        for n in 1..=SILENCE_US / 2_000 {
            let silent = BusStep {
                time_us: captured.time_us + n * 2_000,
                ..BusStep::default()
            };
            device.play(&silent, &mut hear)?;
        }
        device.settle(&mut hear)?;
        drop(progress);
        capture.finish().map_err(written)?.commit()?;
        let recorded = Recorded {
            output: output.to_owned(),
            seconds: captured.time_us as f64 * 1e-6,
            bytes: captured.bytes,
            records: captured.records,
            board: Some(board),
        };
        Ok(match self.json {
            true => result("capture", &recorded),
            false => recorded.to_string(),
        })
    }

    fn explain(&self, path: &Path) -> Result<String, Error> {
        let explanation = explain(&mut CaptureReader::open(path)?)?;
        for warning in &explanation.warnings {
            eprintln!("warning: {}: {warning}", path.display());
        }
        Ok(match self.json {
            true => result("capture", &explanation),
            false => Words(&explanation).to_string(),
        })
    }
}

impl fmt::Display for Recorded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (output, seconds, bytes) = (self.output.display(), self.seconds, self.bytes);
        writeln!(
            f,
            "{output} has {bytes} bytes of {seconds:.1} s in {} pieces",
            self.records
        )?;
        if let Some([commands, replies]) = self.board {
            writeln!(
                f,
                "The emulated board received {commands} commands and {replies} replies of them"
            )?;
        }
        writeln!(f, "Next: proprio capture --explain {output}")
    }
}

/// What ends a capture that is still being made: its port has stopped working.
fn of_port(error: CaptureError) -> CaptureError {
    match error {
        CaptureError::Read { source, .. } => CaptureError::Port(source),
        error => error,
    }
}

/// An explanation for humans.
struct Words<'a>(&'a Explanation);

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = self.0;
        writeln!(
            f,
            "{} bytes in {:.2} s at {} bit/s: the bus is busy {:.1} % of the time",
            said.bytes,
            said.seconds,
            said.baud,
            100.0 * said.busy
        )?;
        writeln!(
            f,
            "{} commands, {} replies; bad checksum {}, cut short {}, bytes in no frame {}",
            said.commands, said.replies, said.bad_crc, said.short, said.skipped_bytes
        )?;
        writeln!(f, "Seed of the commands: {}", seed(said.command_seed))?;
        match said.period_us {
            Some(period_us) => {
                let order: Vec<String> = said.order.iter().map(u8::to_string).collect();
                let rate = 1e6 / f64::from(period_us.max(1));
                writeln!(
                    f,
                    "Polled in the order {}, every {period_us} µs ({rate:.0} Hz)",
                    order.join(", ")
                )?;
            }
            None if said.grouped.is_some() => writeln!(
                f,
                "Order, rate and turn-around are unknown: the times are the adapter's, not the frames'"
            )?,
            None => writeln!(f, "Too few cycles to determine order and rate of polling")?,
        }
        writeln!(
            f,
            "{} cycles become samples: {:.2} % of the replies; {} cycles lack a motor\n",
            said.cycles,
            100.0 * said.used,
            said.incomplete_cycles
        )?;
        let mut table = Table::default();
        let header = [
            "motor",
            "joint",
            "rad",
            "limits",
            "replies",
            "seed",
            "after first µs",
            "turn-around µs",
            "°C",
            "errors",
        ];
        table.row(header.map(str::to_owned));
        said.motors.iter().for_each(|motor| table.row(row(motor)));
        write!(f, "{table}")
    }
}

fn row(motor: &MotorExplanation) -> [String; 10] {
    const ERRORS: [&str; 5] = ["", "overheat", "overcurrent", "overvoltage", "encoder"];
    let told = motor
        .errors
        .iter()
        .enumerate()
        .skip(1)
        .filter(|(_, count)| **count > 0);
    let told: Vec<String> = told
        .map(|(code, count)| match ERRORS.get(code) {
            Some(name) => format!("{name} {count}"),
            None => format!("code {code} {count}"),
        })
        .collect();
    let [coldest, hottest] = motor.temperature;
    [
        motor.id.to_string(),
        motor.joint.unwrap_or("-").to_owned(),
        motor.position.map_or("-".to_owned(), range),
        motor.limits.map_or("-".to_owned(), range),
        motor.replies.to_string(),
        seed(motor.seed),
        motor
            .offset_us
            .map_or("-".to_owned(), |offset| offset.to_string()),
        motor.turnaround.map_or("-".to_owned(), |t| {
            format!("{} ({}–{})", t.median, t.least, t.greatest)
        }),
        format!("{coldest}–{hottest}"),
        if told.is_empty() {
            "none".to_owned()
        } else {
            told.join(", ")
        },
    ]
}

/// From where to where, rad.
fn range([from, to]: [f64; 2]) -> String {
    format!("{from:.3}…{to:.3}")
}

fn seed(seed: Option<u16>) -> String {
    seed.map_or("unknown".to_owned(), |seed| format!("{seed:#06X}"))
}

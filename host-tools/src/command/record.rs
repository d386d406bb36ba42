//! `proprio record`: a live source into a log.

mod report;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

#[cfg(feature = "mcap")]
use crate::clock::unix_time;
use crate::live::{Address, Counts, Source, Until};
use crate::log::{CanonicalWriter, Columns, LiveRows, LogError, Periods, Row};
use crate::model::Robot;
use crate::output::{AtomicFile, WriteError, finish_on_interrupt};
use crate::progress::Underway;
use clap::Args;
use clap::error::ErrorKind;
use flate2::Compression;
use flate2::write::GzEncoder;

use super::Error;
use super::bus_arguments::BusArguments;
use super::dds_arguments::DdsArguments;
use super::result::result;
use super::robot_arguments::RobotArguments;
use report::Report;

/// Record a live source as a log
///
/// `dds` is the robot's own network: of the DDS domain it takes the topic of joint states that is sent there (unitree_go and unitree_hg
/// LowState, sensor_msgs JointState), over the interface IFACE. Nothing is sent to the robot but what discovery asks of every
/// participant. `-` is CSV on standard input, as its rows come. LEG=PORT is an RS-485 adapter that listens to this leg's motor bus; of several legs,
/// rows have the time of the first one's polling cycles. `sim` is a simulated robot's buses, to try it. Each message is kept once, in the order of one
/// writer; what was lost, came twice, came from another writer or in another type is counted. A board or `qemu`
/// sends estimates, which `monitor --record` keeps. Ctrl-C and --seconds leave a whole file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio record dds:eth0 -o chirp.mcap
  proprio record dds:eth0/lowstate -o chirp.csv --seconds 20
  proprio record dds:wlan0/joint_states --domain 3 -m arm.toml -o arm.csv.gz
  proprio record dds:wlan0 --qos reliable -o walk.mcap
  proprio record FR=/dev/ttyUSB0 -o FR.csv --at FR_hip=0.1 --at FR_thigh=0.8 --at FR_calf=lower
  proprio record sim -o sim.csv --seconds 5
  my_driver | proprio record - -o chirp.csv")]
pub(crate) struct Record {
    /// `dds`, with the interface that leads to the robot and the topic; adapters on motor buses; `sim`; or - for standard input
    #[arg(value_name = "dds[:IFACE][/TOPIC]|LEG=PORT...|sim|-", required = true)]
    source: Vec<String>,
    /// Where the log goes: CSV, .csv.gz, or .mcap with the messages as they came (of motor buses and of CSV: joint states)
    #[arg(short, long, value_name = "LOG")]
    output: PathBuf,
    /// How long to record [default: until Ctrl-C]
    #[arg(long, value_name = "S", value_parser = super::simulate::within(0.1, 1e9))]
    seconds: Option<f64>,
    #[command(flatten)]
    dds: DdsArguments,
    #[command(flatten)]
    buses: BusArguments,
    #[command(flatten)]
    robot: RobotArguments,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// How much longer than --seconds is waited for a sender that went silent, s.
const SLACK: f64 = 1.0;

/// Time between two words of progress.
const PROGRESS: Duration = Duration::from_secs(1);

/// The kinds of files that are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Csv,
    Gzip,
    Mcap,
}

impl Format {
    fn of(path: &Path) -> Self {
        let name = path.to_string_lossy().to_lowercase();
        match () {
            () if name.ends_with(".mcap") => Self::Mcap,
            () if name.ends_with(".gz") => Self::Gzip,
            () => Self::Csv,
        }
    }
}

impl Record {
    pub(crate) fn run(self) -> Result<String, Error> {
        let name = self.source.join(" ");
        let Some(address) = Address::parse(&self.source) else {
            let why = format!(
                "{name} is no live source: dds[:IFACE][/TOPIC], one LEG=PORT for each leg, sim or -. A board sends estimates, not samples; keep them with `{}`",
                self.of_a_device(&name)
            );
            super::usage_error("record", ErrorKind::ValueValidation, why);
        };
        let format = Format::of(&self.output);
        let robot = self.robot.robot()?;
        let facts = self.buses.facts("record");
        finish_on_interrupt();
        let counts = Counts::default();
        let limit = self.seconds.map(|s| Duration::from_secs_f64(s + SLACK));
        let until = Until::after(limit);
        let shown = show(counts.clone());
        let source = Source::open(&address, self.dds.network(), &facts, &until, &counts)?;
        let mut recording = Recording {
            counts,
            periods: Periods::default(),
            limit: self.seconds,
            first: None,
            last: None,
            recorded: 0,
            warnings: Vec::new(),
        };
        let mut report = Report::new(&name, &self.output);
        report.follows(&source);
        let file = AtomicFile::create(&self.output)?;
        let (file, failed) = match format {
            Format::Mcap => recording.messages(&name, source, &robot, file),
            Format::Csv => recording.rows(&name, source, &robot, file),
            Format::Gzip => {
                let gzip = GzEncoder::new(file, Compression::default());
                let (gzip, failed) = recording
                    .rows(&name, source, &robot, gzip)
                    .map_err(|error| error.at(&self.output))?;
                gzip.finish()
                    .map(|file| (file, failed))
                    .map_err(Failed::Write)
            }
        }
        .map_err(|error| error.at(&self.output))?;
        drop(shown);
        until.stop();
        report.ends(&recording);
        // Of a source that failed part-way, what came before is a log all the same.
        file.commit()?;
        if let Some(error) = failed {
            eprintln!("{report}");
            return Err(error.into());
        }
        report
            .warnings
            .iter()
            .for_each(|warning| eprintln!("warning: {warning}"));
        Ok(match self.json {
            true => result("record", &report),
            false => report.to_string(),
        })
    }

    /// The command that keeps what a device sends, as this one would a log.
    fn of_a_device(&self, name: &str) -> String {
        let file = self.output.with_extension("messages");
        let seconds = self.seconds.map(|seconds| format!(" --seconds {seconds}"));
        let seconds = seconds.unwrap_or_default();
        format!(
            "proprio monitor {name} --record {}{seconds}",
            file.display()
        )
    }
}

/// Shows the counts once a second until what it gives is dropped.
fn show(counts: Counts) -> impl Drop {
    struct Shown(std::sync::mpsc::Sender<()>);
    impl Drop for Shown {
        fn drop(&mut self) {
            // It may have ended.
            let _ = self.0.send(());
        }
    }
    let (end, ended) = channel();
    thread::spawn(move || {
        let underway = Underway::new("Waiting for the first message");
        let mut before = 0;
        while ended.recv_timeout(PROGRESS) == Err(RecvTimeoutError::Timeout) {
            let now = counts.now();
            if now.messages > 0 {
                underway.say(report::progress(
                    &now,
                    now.messages - before.min(now.messages),
                ));
            }
            before = now.messages;
        }
    });
    Shown(end)
}

/// Reading failed before there was anything to keep, or writing.
enum Failed {
    Read(LogError),
    Write(io::Error),
}

impl Failed {
    fn at(self, output: &Path) -> Error {
        match self {
            Self::Read(error) => error.into(),
            Self::Write(source) => WriteError {
                path: output.to_owned(),
                source,
            }
            .into(),
        }
    }
}

/// What is known of a recording while it grows.
struct Recording {
    counts: Counts,
    periods: Periods,
    /// Its length at most, s.
    limit: Option<f64>,
    /// Times of the first and last of its rows, s.
    first: Option<f64>,
    last: Option<f64>,
    recorded: u64,
    /// What the reader of rows noticed.
    warnings: Vec<String>,
}

impl Recording {
    /// Takes note of a row's time, s; false if it is beyond the limit.
    fn note(&mut self, time: f64) -> bool {
        let first = *self.first.get_or_insert(time);
        if self.limit.is_some_and(|limit| time - first > limit) {
            return false;
        }
        if let Some(last) = self.last.replace(time) {
            let silence = time - last;
            let is_gap = self.periods.is_gap(silence);
            self.counts.with(|tally| {
                tally.gaps += u64::from(is_gap);
                tally.longest_silence = tally.longest_silence.max(silence);
            });
        }
        true
    }

    fn seconds(&self) -> f64 {
        self.last.unwrap_or(0.0) - self.first.unwrap_or(0.0)
    }

    /// Writes rows as they come; beside the output, what ended them if that was not to be.
    fn rows<W: Write>(
        &mut self,
        name: &str,
        source: Source,
        robot: &Robot,
        out: W,
    ) -> Result<(W, Option<LogError>), Failed> {
        // Messages are counted where they come in.
        let counts_rows = matches!(source, Source::Text(_) | Source::Buses(_));
        let mut rows =
            LiveRows::follow(Path::new(name), source.into_input(), robot).map_err(Failed::Read)?;
        let mut writer = CanonicalWriter::new(out, rows.columns()).map_err(Failed::Write)?;
        let failed = self.follow(&mut rows, counts_rows, |_, row| writer.row(row))?;
        Ok((writer.finish().map_err(Failed::Write)?, failed))
    }

    /// Has each row written as it comes; what ended them if that was not to be.
    fn follow(
        &mut self,
        rows: &mut LiveRows,
        counts_rows: bool,
        mut write: impl FnMut(&Columns, &Row) -> io::Result<()>,
    ) -> Result<Option<LogError>, Failed> {
        let columns = rows.columns().clone();
        let failed = loop {
            match rows.next_row() {
                Ok(Some(row)) => {
                    if !self.note(row.t()) {
                        break None;
                    }
                    write(&columns, row).map_err(Failed::Write)?;
                    self.recorded += 1;
                    if counts_rows {
                        self.counts.with(|tally| tally.messages += 1);
                    }
                }
                Ok(None) => break None,
                Err(error) => break Some(error),
            }
        };
        self.warnings = rows.warnings().iter().map(ToString::to_string).collect();
        Ok(failed)
    }

    /// Writes messages as they come; rows of text and of motor buses as joint states. The first row has this machine's time, and those after it are
    /// as far from it as their own clock says.
    #[cfg(feature = "mcap")]
    fn messages<W: Write>(
        &mut self,
        name: &str,
        source: Source,
        robot: &Robot,
        out: W,
    ) -> Result<(W, Option<LogError>), Failed> {
        use crate::log::{MESSAGE_KINDS, MessageWriter};
        let (topic, kind, mut messages) = match source {
            Source::Messages {
                topic,
                kind,
                messages,
            } => (topic, kind, messages),
            Source::Text(_) | Source::Buses(_) => {
                let mut rows = LiveRows::follow(Path::new(name), source.into_input(), robot)
                    .map_err(Failed::Read)?;
                let begin_us = unix_time().as_micros() as i64;
                let mut first = None;
                let [.., kind] = MESSAGE_KINDS;
                let mut writer =
                    MessageWriter::new(out, "joint_states", kind).map_err(Failed::Write)?;
                let failed = self.follow(&mut rows, true, |columns, row| {
                    let t = row.t();
                    // Whole microseconds, to which a log's times are read.
                    let after_us = ((t - *first.get_or_insert(t)) * 1e6).round() as i64;
                    writer.row((begin_us + after_us) * 1000, columns, row)
                })?;
                let beyond = rows.columns().beyond_motion();
                if !beyond.is_empty() {
                    self.warnings.push(format!(
                        "a JointState has no field for {}: left out; a .csv keeps them",
                        beyond.join(", ")
                    ));
                }
                return Ok((writer.finish().map_err(Failed::Write)?, failed));
            }
        };
        let mut writer = MessageWriter::new(out, &topic, kind).map_err(Failed::Write)?;
        while let Some(message) = messages.next() {
            if !self.note(message.received_ns as f64 * 1e-9) {
                break;
            }
            writer.write(&message).map_err(Failed::Write)?;
            self.recorded += 1;
        }
        Ok((writer.finish().map_err(Failed::Write)?, None))
    }

    #[cfg(not(feature = "mcap"))]
    fn messages<W: Write>(
        &mut self,
        _: &str,
        _: Source,
        _: &Robot,
        _: W,
    ) -> Result<(W, Option<LogError>), Failed> {
        Err(Failed::Write(crate::output::not_built("MCAP", "mcap")))
    }
}

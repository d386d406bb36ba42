//! `proprio import`: any recording as proprio's own CSV.

use std::io::Write;
use std::path::PathBuf;

use crate::log::{CanonicalWriter, Channel, LogReader, Selection};
use crate::output::{AtomicFile, WriteError};
use clap::Args;
use serde::Serialize;

use super::Error;
use super::result::result;
use super::robot_arguments::RobotArguments;
use crate::progress::Progress;

/// Turn a recording into a CSV log
///
/// Every command reads these formats directly; what import writes can be looked at, cut, plotted and kept. Read are rosbag2
/// (MCAP or .db3, the file or its folder) with unitree_go/LowState, unitree_hg/LowState or sensor_msgs/JointState; CSV as
/// PlotJuggler and `rostopic echo -p` write it; .npz; Parquet, of a LeRobot data set or with a column per signal. Joints are
/// found by their names, or where messages number motors, in the order that the maker documents.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  proprio import rosbag2_2026_11_22/ -o chirp.csv
  proprio import lowstate.mcap -o - | proprio identify -
  proprio import arm.npz -m arm.toml -o arm.csv")]
pub(crate) struct Import {
    /// The recording: a file, a bag's folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    log: PathBuf,
    /// Where the log goes; - for standard output
    #[arg(short, long, value_name = "LOG")]
    output: PathBuf,
    #[command(flatten)]
    robot: RobotArguments,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `import` reports.
#[derive(Debug, Serialize)]
struct Report {
    log: PathBuf,
    output: PathBuf,
    samples: u64,
    /// Time from the first sample to the last, s.
    seconds: f64,
    /// One over the median sampling period, Hz.
    rate: f64,
    joints: Vec<String>,
    /// What is recorded of joints: `q`, `dq`, `tau`, …
    channels: Vec<&'static str>,
    warnings: Vec<String>,
}

impl Import {
    pub(crate) fn run(self) -> Result<String, Error> {
        let robot = self.robot.robot()?;
        let mut reader = LogReader::open_of(&self.log, Selection::Everything, &robot)?;
        let to_stdout = self.output.as_os_str() == "-";
        if to_stdout {
            let out = std::io::BufWriter::new(std::io::stdout().lock());
            copy(&mut reader, out).map_err(|failed| failed.at(&self.output))?;
        } else {
            let file = AtomicFile::create(&self.output)?;
            let file = copy(&mut reader, file).map_err(|failed| failed.at(&self.output))?;
            // Before the file appears: a log that is refused is not imported.
            reader.finish()?;
            file.commit()?;
        }
        let report = self.report(&reader)?;
        for warning in &report.warnings {
            eprintln!("warning: {warning}");
        }
        Ok(match (to_stdout, self.json) {
            (true, _) => String::new(),
            (false, true) => result("import", &report),
            (false, false) => report.to_string(),
        })
    }

    fn report(&self, reader: &LogReader) -> Result<Report, Error> {
        let columns = reader.columns();
        let robot = columns.robot();
        let channels = Channel::ALL.into_iter();
        let recorded =
            |channel: &Channel| columns.joints().any(|joint| columns.has(*channel, joint));
        let name = |joint: usize| robot.bodies()[joint].name.clone();
        Ok(Report {
            log: self.log.clone(),
            output: self.output.clone(),
            samples: reader.checks().rows(),
            seconds: reader.checks().duration(),
            rate: reader.checks().rate(),
            joints: columns.joints().map(name).collect(),
            channels: channels.filter(recorded).map(Channel::prefix).collect(),
            warnings: reader.finish()?.iter().map(ToString::to_string).collect(),
        })
    }
}

/// Reading failed, or writing.
enum Failed {
    Read(crate::log::LogError),
    Write(std::io::Error),
}

impl Failed {
    fn at(self, output: &std::path::Path) -> Error {
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

/// Copies all rows, with progress.
fn copy<W: Write>(reader: &mut LogReader, out: W) -> Result<W, Failed> {
    let mut progress = Progress::new("Importing");
    let mut writer = CanonicalWriter::new(out, reader.columns()).map_err(Failed::Write)?;
    let mut rows = 0u64;
    while let Some(row) = reader.next_row().map_err(Failed::Read)? {
        writer.row(row).map_err(Failed::Write)?;
        rows += 1;
        if rows.is_multiple_of(1024) {
            let (done, total) = reader.progress();
            progress.set(done, total);
        }
    }
    writer.finish().map_err(Failed::Write)
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(
            f,
            "{} has {} samples of {} joints over {:.1} s ({:.0} Hz): {}",
            self.output.display(),
            self.samples,
            self.joints.len(),
            self.seconds,
            self.rate,
            self.channels.join(", "),
        )?;
        writeln!(f, "Joints: {}", self.joints.join(", "))
    }
}

//! Logs of one robot.

use std::path::{Path, PathBuf};

use proprio_host::{log, recording as room};

use crate::error::{self, Error};
use crate::model::Model;

/// Logs of one robot in memory; repeated samples are left out, and of very long logs pieces are kept that are spread evenly over time.
#[derive(Debug, Clone)]
pub struct Recording {
    pub(crate) room: room::Recording,
    findings: Vec<String>,
}

impl Recording {
    /// What is wrong with the samples, a sentence each: jitter, gaps, repeats, saturation, quanta, velocities that positions contradict.
    /// Look at it before a model is blamed; empty if nothing is.
    pub fn findings(&self) -> &[String] {
        &self.findings
    }

    /// Length of all logs together, s.
    pub fn duration(&self) -> f64 {
        self.room.duration
    }

    /// The logs, in the order in which they were given.
    pub fn logs(&self) -> &[PathBuf] {
        &self.room.logs
    }
}

/// A log that a program holds in memory, in place of a file: its [`path`](AsRef) is read as a file's is, as long as this lives.
#[derive(Debug)]
pub struct MemoryLog(log::MemoryLog);

impl MemoryLog {
    /// Keeps arrays as a log, as a NumPy archive has them: each with its name, its shape and its numbers row by row; `t` (s), and `q` (rad), `dq`
    /// (rad/s), `tau` (N m) with a column per joint of `joints`, or a column of CSV each (`q/FR_hip`). [`read`] reports what is wrong with them.
    /// `name` is what messages call it.
    pub fn new(
        name: &str,
        arrays: impl IntoIterator<Item = (String, Vec<usize>, Vec<f64>)>,
        joints: &[String],
    ) -> Self {
        Self(log::MemoryLog::new(name, arrays, joints))
    }
}

impl AsRef<Path> for MemoryLog {
    fn as_ref(&self) -> &Path {
        self.0.path()
    }
}

/// Reads logs of the robot that `model` is of, joints by the model's names: CSV (plain or .gz) and, as far as the crate's features have
/// them, rosbag2 (MCAP, .db3), npz and Parquet. Several logs count together; from four on each is held out in turn.
///
/// # Errors
/// [`Error::Log`] of the first log that cannot be read, or has no whole limb of the robot.
pub fn read(logs: &[impl AsRef<Path>], model: &Model) -> Result<Recording, Error> {
    let logs: Vec<PathBuf> = logs.iter().map(|log| log.as_ref().to_owned()).collect();
    let room =
        room::Recording::read(&logs, &model.0, |_done, _total| ()).map_err(error::recording)?;
    let of_samples = room.gates.iter().flat_map(|gates| &gates.report.findings);
    let findings = of_samples.map(ToString::to_string);
    let findings = findings.chain(room.warnings.iter().cloned()).collect();
    Ok(Recording { room, findings })
}

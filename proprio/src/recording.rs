//! Logs of one robot.

use std::path::{Path, PathBuf};

use proprio_host::recording as room;

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

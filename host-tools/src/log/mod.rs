//! Logs: what was recorded of a robot.
//!
//! A log is CSV with a header, plain or gzip-compressed, one row per sample. Columns are found by name, in any order;
//! unknown ones are ignored. `t` is the time in seconds; each recorded joint has `q/<joint>`, `dq/<joint>` and
//! `tau/<joint>`, in SI units on the joint side; optional are `temp/<joint>`, `q_des/<joint>`, `quat/w|x|y|z`,
//! `gyro/x|y|z`, `acc/x|y|z` and `foot/<leg>`. Joints come by whole legs: a log of one pinned leg has nine signal
//! columns.
//!
//! [`LogReader`] streams a log of any length in constant memory and checks it on the way; [`Log`] holds a short one
//! whole; [`LogWriter`] makes one.

mod checks;
mod columns;
mod error;
mod joint;
mod reader;
mod writer;

use std::path::{Path, PathBuf};

use proprio_core::go2::Leg;

pub use checks::{Checks, GAP, LEAST_RATE, LONGEST_GAP, Warning};
pub use columns::{Channel, Columns, Selection};
pub use error::{Column, LogError, Problem};
pub use joint::{JointId, UnknownName, leg_named};
pub use reader::{LogReader, Row};
pub use writer::LogWriter;

/// A log held whole.
#[derive(Debug, Clone)]
pub struct Log {
    /// Where it was read from.
    pub path: PathBuf,
    /// Time, s, as recorded.
    pub t: Vec<f64>,
    /// The recorded joints in SDK order; whole legs.
    pub joints: Vec<JointChannel>,
    /// What the IMU measured, where recorded.
    pub imu: Imu,
    /// Foot sensors FR FL RR RL, uncalibrated.
    pub foot: Option<Vec<[f64; 4]>>,
    /// What a user should know about it.
    pub warnings: Vec<Warning>,
}

/// What a log holds of one joint; each vector as long as the log's time.
#[derive(Debug, Clone)]
pub struct JointChannel {
    /// Which joint.
    pub joint: JointId,
    /// Position, rad.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Torque, N m.
    pub tau: Vec<f64>,
    /// Motor temperature, degrees Celsius.
    pub temp: Option<Vec<f64>>,
    /// Commanded position, rad.
    pub q_des: Option<Vec<f64>>,
}

/// What a log holds of the IMU.
#[derive(Debug, Clone, Default)]
pub struct Imu {
    /// Attitude quaternion, w x y z.
    pub quat: Option<Vec<[f64; 4]>>,
    /// Angular velocity, rad/s.
    pub gyro: Option<Vec<[f64; 3]>>,
    /// Specific force, m/s².
    pub acc: Option<Vec<[f64; 3]>>,
}

impl Log {
    /// Reads all of the log at `path`.
    ///
    /// # Errors
    /// As [`LogReader`]'s.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let mut reader = LogReader::open(path, Selection::Everything)?;
        let mut log = Self::empty(path, reader.columns());
        while let Some(row) = reader.next_row()? {
            log.push(row);
        }
        log.warnings = reader.finish()?;
        Ok(log)
    }

    /// The channels of a leg: hip, thigh, calf.
    pub fn leg(&self, leg: Leg) -> Option<&[JointChannel; 3]> {
        let first = self
            .joints
            .iter()
            .position(|channel| channel.joint.leg() == leg)?;
        self.joints[first..].first_chunk()
    }

    fn empty(path: &Path, columns: &Columns) -> Self {
        let joint = |joint| JointChannel {
            joint,
            q: Vec::new(),
            dq: Vec::new(),
            tau: Vec::new(),
            temp: columns.has(Channel::Temp, joint).then(Vec::new),
            q_des: columns.has(Channel::QDes, joint).then(Vec::new),
        };
        let imu = Imu {
            quat: columns.has_group(columns::QUAT).then(Vec::new),
            gyro: columns.has_group(columns::GYRO).then(Vec::new),
            acc: columns.has_group(columns::ACC).then(Vec::new),
        };
        Self {
            path: path.to_owned(),
            t: Vec::new(),
            joints: columns.joints().map(joint).collect(),
            imu,
            foot: columns.has_group(columns::FOOT).then(Vec::new),
            warnings: Vec::new(),
        }
    }

    fn push(&mut self, row: &Row) {
        fn put<V>(column: &mut Option<Vec<V>>, value: V) {
            if let Some(column) = column {
                column.push(value);
            }
        }
        self.t.push(row.t());
        for channel in &mut self.joints {
            let index = channel.joint.index();
            channel.q.push(row.q()[index]);
            channel.dq.push(row.dq()[index]);
            channel.tau.push(row.tau()[index]);
            put(&mut channel.temp, row.temp()[index]);
            put(&mut channel.q_des, row.q_des()[index]);
        }
        put(&mut self.imu.quat, *row.quat());
        put(&mut self.imu.gyro, *row.gyro());
        put(&mut self.imu.acc, *row.acc());
        put(&mut self.foot, *row.foot());
    }
}

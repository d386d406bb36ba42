//! Logs: what was recorded of a robot.
//!
//! A log is CSV with a header, plain or gzip-compressed, one row per sample. Columns are found by name, in any order;
//! unknown ones are ignored. `t` is the time in seconds; each recorded joint has `q/<joint>`, `dq/<joint>` and
//! `tau/<joint>`, in SI units on the joint side; optional are `temp/<joint>`, `q_des/<joint>`, `dq_des/`, `tau_des/`, `kp/`, `kd/`, `quat/w|x|y|z`,
//! `gyro/x|y|z`, `acc/x|y|z` and `foot/<limb>`. Joints have the names of the robot's model and come by whole limbs: a log
//! of one leg of a pinned Go2 has nine signal columns.
//!
//! What was recorded at motors, before the gear, is called `q_motor/<joint>`, `dq_motor/<joint>`, `tau_motor/<joint>`, and
//! becomes the joint's through the model's gear ratios and couplings; `q_link/<joint>` is a second encoder at the link.
//!
//! Other formats give the same rows: rosbag2 (MCAP and .db3) with `unitree_go/LowState`, `unitree_hg/LowState` or
//! `sensor_msgs/JointState`; CSV as PlotJuggler and ROS 1 write it, separated by semicolons and with decimal commas if need
//! be; NumPy archives; Parquet, of a LeRobot data set or with a column per signal; captures of a leg's motor bus (`.cap`). `-` is
//! standard input.
//!
//! [`LogReader`] streams the log of any robot, of any length, in constant memory and checks it on the way; [`Log`] holds
//! a short one of a Go2 whole; [`LogWriter`] makes one, [`WalkWriter`] that of a robot on its feet.
//!
//! Files beside:
//!
//! - `admission`: which rows of a log are let in: the one gate that all commands read through
//! - `cdr`: messages as they are written
//! - `channel`: the signals of a joint, and what their columns are called
//! - `checks`: what can only be judged over a whole log: its rate, its gaps, its units
//! - `columns`: from the names of a file's cells to the place of each channel in a row
//! - `error`: what can be wrong with a log, and where
//! - `live`: what comes while it is read: messages, text, bytes of motor buses; as rows, before any is judged
//! - `messages`: messages into an MCAP file, as they came, with the definition of their type
//! - `motors`: what was recorded at motors, as what joints do
//! - `names`: what other recorders call the channels
//! - `provenance`: which logs a model's values come from: known by what is in them
//! - `reader`: a log as a stream of rows, in memory that does not grow with its length
//! - `row`: a row of a log in memory
//! - `samples`: what became of a log's samples
//! - `slots`: where a row in memory keeps what
//! - `source`: files of many formats as one thing: named cells, row after row
//! - `stamps`: time stamps of a recorder that falls behind, put right
//! - `table`: any file of rows as numbers by name: what is no log of samples, such as poses
//! - `temperatures`: temperatures at the end of their scale, which are none
//! - `warning`: what a user should know about a log that can still be used
//! - `writer`: writing a log

mod admission;
pub(crate) mod cdr;
mod channel;
mod checks;
mod columns;
mod error;
mod live;
#[cfg(feature = "mcap")]
mod messages;
mod motors;
mod names;
mod provenance;
mod reader;
mod row;
mod samples;
mod slots;
mod source;
mod stamps;
mod table;
mod temperatures;
mod warning;
mod writer;

use std::path::{Path, PathBuf};

use proprio_core::go2::{JointId, LEGS, Leg};

pub(crate) use admission::{MOST_ROWS, NO_MEASUREMENT, TIMES};
pub use channel::Channel;
pub(crate) use checks::TIME_UNITS;
pub use checks::{
    BRIDGED, Checks, GAP, GAP_PERIODS, LEAST_DURATION, LEAST_RATE, LONGEST_GAP, Periods,
};
pub use columns::{Columns, Selection};
pub use error::{Column, LogError, Place, Problem, Unit};
pub use live::{LiveInput, LiveRows};
#[cfg(feature = "mcap")]
pub use live::{LiveMessage, LiveMessages, MESSAGE_KINDS, can_be};
#[cfg(feature = "mcap")]
pub use messages::MessageWriter;
pub use provenance::{set_command_line, sha256};
pub use reader::LogReader;
pub use row::Row;
pub use samples::Samples;
pub use source::files;
pub use source::memory::MemoryLog;
pub(crate) use source::open_bytes;
pub use table::{Need, NumberTable, file_columns, read_numbers};
pub use warning::{Cause, Warning};
pub use writer::{CanonicalWriter, LogWriter, WalkWriter};

/// A Go2's log held whole.
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
    /// Foot sensors FR FL RR RL, uncalibrated; not a number of a foot that is not recorded.
    pub foot: Option<Vec<[f64; LEGS]>>,
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
    /// Reads all of the Go2's log at `path`.
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
        let joint = |joint: JointId| JointChannel {
            joint,
            q: Vec::new(),
            dq: Vec::new(),
            tau: Vec::new(),
            temp: columns.has(Channel::Temp, joint.index()).then(Vec::new),
            q_des: columns.has(Channel::QDes, joint.index()).then(Vec::new),
        };
        let imu = Imu {
            quat: columns.has_slot(columns.slots.quat()).then(Vec::new),
            gyro: columns.has_slot(columns.slots.gyro()).then(Vec::new),
            acc: columns.has_slot(columns.slots.acc()).then(Vec::new),
        };
        Self {
            path: path.to_owned(),
            t: Vec::new(),
            joints: JointId::all()
                .filter(|joint| columns.has(Channel::Q, joint.index()))
                .map(joint)
                .collect(),
            imu,
            foot: columns
                .slots
                .feet()
                .any(|slot| columns.has_slot(slot))
                .then(Vec::new),
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
        let feet = row.foot().first_chunk().copied();
        put(&mut self.foot, feet.unwrap_or([f64::NAN; LEGS]));
    }
}

//! From a header to the place of each channel in a row.

use std::collections::HashMap;
use std::path::Path;

use csv::ByteRecord;

use super::error::{LogError, Problem};
use super::joint::{JointId, leg_named};
use proprio_core::go2::{JOINTS, Leg};

/// A signal that each joint has of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Position, rad.
    Q,
    /// Velocity, rad/s.
    Dq,
    /// Torque, N m.
    Tau,
    /// Motor temperature, degrees Celsius.
    Temp,
    /// Commanded position, rad.
    QDes,
}

impl Channel {
    /// The channels every recorded joint must have.
    pub const MOTION: [Self; 3] = [Self::Q, Self::Dq, Self::Tau];
    const ALL: [Self; 5] = [Self::Q, Self::Dq, Self::Tau, Self::Temp, Self::QDes];

    /// The part of the column's name before the slash.
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::Q => "q",
            Self::Dq => "dq",
            Self::Tau => "tau",
            Self::Temp => "temp",
            Self::QDes => "q_des",
        }
    }

    /// The column's name in a header, such as `dq/FR_hip`.
    pub fn column(self, joint: JointId) -> String {
        format!("{}/{joint}", self.prefix())
    }
}

/// Which part of a log to read; columns outside it are not even parsed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Selection {
    /// Time, positions, velocities and torques.
    Motion,
    /// All that the format knows.
    Everything,
}

// A row is one flat array, so that parsing it is one loop over (cell, slot) pairs.
pub(super) const TIME: usize = 0;
pub(super) const fn slot(channel: Channel, joint: usize) -> usize {
    1 + channel as usize * JOINTS + joint
}
pub(super) const QUAT: usize = slot(Channel::QDes, 0) + JOINTS;
pub(super) const GYRO: usize = QUAT + 4;
pub(super) const ACC: usize = GYRO + 3;
pub(super) const FOOT: usize = ACC + 3;
pub(super) const SLOTS: usize = FOOT + 4;

/// Groups that are read whole or not at all: all of an IMU's axes, all four feet.
const GROUPS: [(&str, usize, &[&str]); 4] = [
    ("quat", QUAT, &["w", "x", "y", "z"]),
    ("gyro", GYRO, &["x", "y", "z"]),
    ("acc", ACC, &["x", "y", "z"]),
    ("foot", FOOT, &["FR", "FL", "RR", "RL"]),
];

/// Where each channel of a log is.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Header, for messages.
    pub(super) names: Vec<String>,
    /// (cell in the row, slot in the flat array), in the order of the cells.
    pub(super) wanted: Vec<(usize, usize)>,
    /// Cell of each slot.
    pub(super) cell: [Option<usize>; SLOTS],
}

impl Columns {
    /// Reads the header of the log at `path`.
    pub(super) fn new(
        path: &Path,
        line: u64,
        header: &ByteRecord,
        selection: Selection,
    ) -> Result<Self, LogError> {
        let error = |problem| LogError::new(path, problem).at_line(line);
        let names: Vec<String> = header
            .iter()
            .map(|name| String::from_utf8_lossy(name).trim().to_owned())
            .collect();
        if names
            .iter()
            .all(|name| fast_float2::parse::<f64, _>(name).is_ok())
        {
            return Err(error(Problem::NoHeader));
        }
        if let [only] = &names[..]
            && let Some(separator) = only.chars().find(|c| [';', '\t', ' ', '|'].contains(c))
        {
            return Err(error(Problem::Separator(separator)));
        }
        let slots = known_columns();
        let mut cell = [None; SLOTS];
        for (index, name) in names.iter().enumerate() {
            if let Some(&slot) = slots.get(name) {
                if let Some(first) = cell[slot].replace(index) {
                    let problem = Problem::DuplicateColumn { first: first + 1 };
                    return Err(error(problem).at_column(index, name));
                }
            } else if let Some(problem) = misspelt(name) {
                return Err(error(problem).at_column(index, name));
            }
        }
        let columns = Self {
            names,
            wanted: Vec::new(),
            cell,
        };
        columns.check_complete(path, line)?;
        Ok(columns.select(selection))
    }

    /// The joints recorded.
    pub fn joints(&self) -> impl Iterator<Item = JointId> {
        JointId::all().filter(|&joint| self.has(Channel::Q, joint))
    }

    /// The legs recorded; each with all its joints.
    pub fn legs(&self) -> impl Iterator<Item = Leg> {
        Leg::ALL
            .into_iter()
            .filter(|&leg| self.has(Channel::Q, JointId::of(leg)[0]))
    }

    /// Whether the log has this channel of this joint.
    pub fn has(&self, channel: Channel, joint: JointId) -> bool {
        self.cell[slot(channel, joint.index())].is_some()
    }

    /// Whether the log has the group that begins at `slot`.
    pub(super) fn has_group(&self, slot: usize) -> bool {
        self.cell[slot].is_some()
    }

    fn check_complete(&self, path: &Path, line: u64) -> Result<(), LogError> {
        let error = |problem| LogError::new(path, problem).at_line(line);
        let missing = |name: String| error(Problem::MissingColumn { name });
        // An incomplete group is told at a column that it has.
        let at = |error: LogError, slot: usize| match self.cell[slot] {
            Some(cell) => error.at_column(cell, &self.names[cell]),
            None => error,
        };
        if self.cell[TIME].is_none() {
            return Err(missing("t".to_owned()));
        }
        for joint in JointId::all() {
            let present = Channel::MOTION.into_iter().find(|&c| self.has(c, joint));
            let absent = Channel::MOTION.into_iter().find(|&c| !self.has(c, joint));
            if let (Some(present), Some(absent)) = (present, absent) {
                let missing = absent.column(joint);
                let error = error(Problem::MissingChannel { joint, missing });
                return Err(at(error, slot(present, joint.index())));
            }
        }
        for leg in Leg::ALL {
            let recorded = |joint: &JointId| self.has(Channel::Q, *joint);
            let present = JointId::of(leg).into_iter().find(recorded);
            let absent = JointId::of(leg).into_iter().find(|joint| !recorded(joint));
            if let (Some(present), Some(missing)) = (present, absent) {
                let error = error(Problem::IncompleteLeg { present, missing });
                return Err(at(error, slot(Channel::Q, present.index())));
            }
        }
        if self.legs().next().is_none() {
            return Err(error(Problem::NoJoints));
        }
        for (prefix, first, axes) in GROUPS {
            let has = |i: &usize| self.cell[first + i].is_some();
            let present = (0..axes.len()).find(has);
            let absent = (0..axes.len()).find(|i| !has(i));
            if let (Some(present), Some(absent)) = (present, absent) {
                return Err(at(
                    missing(format!("{prefix}/{}", axes[absent])),
                    first + present,
                ));
            }
        }
        Ok(())
    }

    fn select(mut self, selection: Selection) -> Self {
        let end = match selection {
            Selection::Motion => slot(Channel::Temp, 0),
            Selection::Everything => SLOTS,
        };
        for cell in &mut self.cell[end..] {
            *cell = None;
        }
        self.wanted = (0..SLOTS)
            .filter_map(|s| Some((self.cell[s]?, s)))
            .collect();
        self.wanted.sort_unstable();
        self
    }
}

/// Every column name of the format and its slot.
fn known_columns() -> HashMap<String, usize> {
    let per_joint = Channel::ALL.into_iter().flat_map(|channel| {
        JointId::all().map(move |joint| (channel.column(joint), slot(channel, joint.index())))
    });
    let grouped = GROUPS.into_iter().flat_map(|(prefix, first, axes)| {
        axes.iter()
            .enumerate()
            .map(move |(i, axis)| (format!("{prefix}/{axis}"), first + i))
    });
    per_joint
        .chain(grouped)
        .chain([("t".to_owned(), TIME)])
        .collect()
}

/// A column that begins like one of the format but names no joint, leg or axis of the robot is a mistake, not a
/// column to ignore.
fn misspelt(name: &str) -> Option<Problem> {
    let (prefix, rest) = name.split_once('/')?;
    let unknown = if Channel::ALL
        .iter()
        .any(|channel| channel.prefix() == prefix)
    {
        rest.parse::<JointId>().err()?
    } else if prefix == "foot" {
        leg_named(rest).err()?
    } else {
        return None;
    };
    let nearest = format!("{prefix}/{}", unknown.nearest()?);
    Some(Problem::UnknownName {
        name: rest.to_owned(),
        nearest,
    })
}

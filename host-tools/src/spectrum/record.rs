//! Logs of periodic experiments: evenly sampled columns by joint.

use std::path::{Path, PathBuf};

use super::error::FrfError;
use crate::log::{Need, NumberTable, read_numbers};
use crate::model::Model;

/// How far a distance between samples may be from the median, as a share: the sampling jitter that moves a line's phase by less than 1 % of
/// a period at a tenth of the rate.
const JITTER: f64 = 0.1;

/// What the torque column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TorqueUnit {
    /// `tau/`: N m, or N at a joint that slides.
    NewtonMetre,
    /// `current/`: A, torque up to an unknown factor.
    Ampere,
}

impl TorqueUnit {
    /// Its symbol.
    pub(super) fn symbol(self) -> &'static str {
        match self {
            Self::NewtonMetre => "N m",
            Self::Ampere => "A",
        }
    }
}

/// A log's signals by joint, evenly sampled.
#[derive(Debug, Clone)]
pub(super) struct Record {
    /// The file.
    pub(super) path: PathBuf,
    /// Sampling period, s.
    pub(super) dt: f64,
    /// The joints' names.
    pub(super) joints: Vec<String>,
    /// What the torque is in.
    pub(super) unit: TorqueUnit,
    /// Motor position, rad or m.
    pub(super) q: Vec<Vec<f64>>,
    /// Motor velocity, rad/s or m/s; empty if it is not recorded.
    pub(super) dq: Vec<Vec<f64>>,
    /// Torque, in its unit.
    pub(super) torque: Vec<Vec<f64>>,
    /// The excitation as it was asked for, in any unit, of each joint; empty if it is not recorded.
    pub(super) reference: Vec<Vec<f64>>,
    /// Second encoder at the link; empty if there is none.
    pub(super) link: Vec<Vec<f64>>,
}

/// A joint's columns.
struct JointColumns {
    joint: String,
    q: usize,
    dq: Option<usize>,
    torque: usize,
    reference: Option<usize>,
    link: Option<usize>,
}

impl Record {
    /// Reads a log; with a model its joints alone, in the model's order.
    ///
    /// # Errors
    /// If it cannot be read, lacks columns or is not evenly sampled.
    pub(super) fn read(path: &Path, model: Option<&Model>) -> Result<Self, FrfError> {
        let (mut columns, mut unit) = (Vec::new(), TorqueUnit::NewtonMetre);
        let mut table = read_numbers(path, |names| -> Result<_, FrfError> {
            (columns, unit) = joint_columns(path, names, model)?;
            let cells = [time_column(path, names)?].into_iter();
            let cells = cells.chain(columns.iter().flat_map(|c| {
                [Some(c.q), c.dq, Some(c.torque), c.reference, c.link]
                    .into_iter()
                    .flatten()
            }));
            Ok(cells.map(|cell| (cell, Need::Always)).collect())
        })?;
        let dt = even(path, &table)?;
        let columns_unfit = table.columns.iter();
        let unfit = columns_unfit.filter_map(|column| column.iter().position(|x| !x.is_finite()));
        if let Some(place) = unfit.min().and_then(|row| table.place(row)) {
            return Err(FrfError::NotFinite {
                path: path.to_owned(),
                place,
            });
        }
        // All but time, in the order of what was asked for.
        let mut signals = std::mem::take(&mut table.columns).into_iter().skip(1);
        let mut next = || signals.next().unwrap_or_default();
        let mut record = Self {
            path: path.to_owned(),
            dt,
            unit,
            joints: Vec::new(),
            q: Vec::new(),
            dq: Vec::new(),
            torque: Vec::new(),
            reference: Vec::new(),
            link: Vec::new(),
        };
        for column in columns {
            record.joints.push(column.joint);
            record.q.push(next());
            if column.dq.is_some() {
                record.dq.push(next());
            }
            record.torque.push(next());
            if column.reference.is_some() {
                record.reference.push(next());
            }
            if column.link.is_some() {
                record.link.push(next());
            }
        }
        if record.dq.len() < record.joints.len() {
            record.dq.clear();
        }
        // Of some joints alone it is no instrument for all.
        if record.reference.len() < record.joints.len() {
            record.reference.clear();
        }
        if record.link.len() < record.joints.len() {
            record.link.clear();
        }
        Ok(record)
    }
}

fn time_column(path: &Path, names: &[String]) -> Result<usize, FrfError> {
    let found = names.iter().position(|name| name == "t");
    found.ok_or_else(|| FrfError::Columns {
        path: path.to_owned(),
        what: "no time `t`".to_owned(),
    })
}

/// The columns of each joint, and what their torque is in.
fn joint_columns(
    path: &Path,
    names: &[String],
    model: Option<&Model>,
) -> Result<(Vec<JointColumns>, TorqueUnit), FrfError> {
    let missing = |what: String| FrfError::Columns {
        path: path.to_owned(),
        what,
    };
    let cell = |kind: &str, joint: &str| {
        let wanted = format!("{kind}/{joint}");
        names.iter().position(|name| *name == wanted)
    };
    let has_torque = names.iter().any(|name| name.starts_with("tau/"));
    let (kind, unit) = if has_torque {
        ("tau", TorqueUnit::NewtonMetre)
    } else {
        ("current", TorqueUnit::Ampere)
    };
    let mut found: Vec<(usize, JointColumns)> = Vec::new();
    for (q, name) in names.iter().enumerate() {
        let Some(joint) = name.strip_prefix("q/") else {
            continue;
        };
        let (order, own) = match model {
            Some(model) => {
                let index = model.robot().joint(joint)?;
                (index, model.joint_name(index).to_owned())
            }
            None => (found.len(), joint.to_owned()),
        };
        let torque = cell(kind, joint).ok_or_else(|| {
            missing(format!(
                "torque is missing: no `tau/{joint}` nor `current/{joint}`"
            ))
        })?;
        let columns = JointColumns {
            joint: own,
            q,
            dq: cell("dq", joint),
            torque,
            reference: cell("ref", joint),
            link: cell("q_link", joint),
        };
        found.push((order, columns));
    }
    if found.is_empty() {
        return Err(missing("no joint position `q/<joint>`".to_owned()));
    }
    found.sort_by_key(|(order, _)| *order);
    Ok((
        found.into_iter().map(|(_, columns)| columns).collect(),
        unit,
    ))
}

/// The sampling period, the first of the table's columns being time.
pub(crate) fn even(path: &Path, table: &NumberTable) -> Result<f64, FrfError> {
    let time = table.columns.first().map_or(&[][..], Vec::as_slice);
    let gaps = || time.windows(2).map(|two| two[1] - two[0]);
    let mut all: Vec<f64> = gaps().collect();
    let middle = all.len() / 2;
    let dt = match all.is_empty() {
        true => 0.0,
        false => *all.select_nth_unstable_by(middle, f64::total_cmp).1,
    };
    if dt.is_nan() || dt <= 0.0 {
        return Err(FrfError::Columns {
            path: path.to_owned(),
            what: "time does not advance".to_owned(),
        });
    }
    let uneven = gaps().position(|gap| gap.is_nan() || (gap - dt).abs() > JITTER * dt);
    if let Some(row) = uneven
        && let Some(place) = table.place(row + 1)
    {
        return Err(FrfError::Uneven {
            path: path.to_owned(),
            place,
            gap: time[row + 1] - time[row],
            dt,
        });
    }
    // The mean is finer than a rounded stamp.
    Ok((time[time.len() - 1] - time[0]) / (time.len() - 1) as f64)
}

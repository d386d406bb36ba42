//! Logs of periodic experiments: evenly sampled columns by joint.

use std::path::{Path, PathBuf};

use super::error::FrfError;
use crate::log::{
    MOST_ROWS, NO_MEASUREMENT, Need, NumberTable, Place, TIME_UNITS, TIMES, read_numbers,
};
use crate::model::Model;

/// How far a distance between samples may be from the median, as a share: the sampling jitter that moves a line's phase by less than 1 % of
/// a period at a tenth of the rate.
const JITTER: f64 = 0.1;

/// Rates at which controllers of robots sample, Hz: 20 Hz of slow fieldbuses to 50 kHz of drives' current loops, 1 % on either side for stamps that are
/// rounded.
const RATES: [f64; 2] = [19.8, 50.5e3];

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

    /// The column's kind.
    fn kind(self) -> &'static str {
        match self {
            Self::NewtonMetre => "tau",
            Self::Ampere => "current",
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
    /// Where the rows stand in the file; its columns are moved into the signals.
    rows: NumberTable,
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
        is_rate(path, dt)?;
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
            rows: table,
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
        record.is_possible()?;
        Ok(record)
    }

    /// Where a row stands in the file.
    pub(super) fn place(&self, row: usize) -> Option<Place> {
        self.rows.place(row)
    }

    /// Refuses values that no robot has, and torques that do not change: a period is transformed as a whole, so that no row can be left out.
    fn is_possible(&self) -> Result<(), FrfError> {
        let kind = self.unit.kind();
        let kinds = [
            ("q", &self.q),
            ("dq", &self.dq),
            (kind, &self.torque),
            ("ref", &self.reference),
            ("q_link", &self.link),
        ];
        for (kind, signals) in kinds {
            for (signal, joint) in signals.iter().zip(&self.joints) {
                if let Some((row, others)) = impossible(signal)
                    && let Some(place) = self.place(row)
                {
                    return Err(FrfError::Impossible {
                        path: self.path.clone(),
                        place,
                        column: format!("{kind}/{joint}"),
                        value: signal[row],
                        others,
                    });
                }
            }
        }
        for (signal, joint) in self.torque.iter().zip(&self.joints) {
            if let Some(&value) = signal.first()
                && signal.iter().all(|x| *x == value)
            {
                return Err(FrfError::Constant {
                    path: self.path.clone(),
                    column: format!("{kind}/{joint}"),
                    value,
                });
            }
        }
        Ok(())
    }
}

/// The row of a signal's greatest value, if no robot has it or it is [`TIMES`] the greatest of all rows but those beside; and that.
fn impossible(signal: &[f64]) -> Option<(usize, f64)> {
    let sizes = || signal.iter().map(|x| x.abs()).enumerate();
    let (row, size) = sizes().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let far = sizes().filter(|(k, _)| k.abs_diff(row) > MOST_ROWS);
    let others = far.map(|(_, size)| size).fold(0.0, f64::max);
    // Of a signal that is zero elsewhere nothing says what it can be.
    let is_alone = others > 0.0 && size > TIMES * others;
    (size > NO_MEASUREMENT || is_alone).then_some((row, others))
}

/// Refuses a sampling period that no controller has, s.
fn is_rate(path: &Path, dt: f64) -> Result<(), FrfError> {
    let is_usual = |dt: &f64| (RATES[0]..=RATES[1]).contains(&(1.0 / dt));
    if is_usual(&dt) {
        return Ok(());
    }
    // The first that gives a usual rate is named: from 20 kHz on two may.
    let unit = TIME_UNITS
        .iter()
        .find(|(_, per_second)| is_usual(&(dt / per_second)));
    Err(FrfError::TimeUnit {
        path: path.to_owned(),
        hertz: 1.0 / dt,
        unit: unit.map_or_else(String::new, |(unit, per_second)| {
            format!("; in {unit} `t` gives {:.1}", per_second / dt)
        }),
    })
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

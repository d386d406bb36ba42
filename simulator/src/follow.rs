//! A motion file as the reference: positions, velocities, feed-forward torques and gains, row by row.

use std::path::Path;

use nalgebra::Vector3;
use proprio_core::go2::{JOINTS_PER_LEG as JOINTS, JointId, Leg, position_limits};

use super::motion::Wanted;

/// The channels of a motion file, each a column per joint; the last three may be missing.
const CHANNELS: [&str; 6] = ["q", "dq", "ddq", "tau", "kp", "kd"];
/// Gains where the file has none, N m/rad and N m s/rad.
const GAINS: [f64; 2] = [40.0, 1.5];

/// A motion to follow.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    legs: Vec<Leg>,
    t: Vec<f64>,
    /// `rows[k][leg]`: the channels of a leg's joints.
    rows: Vec<Vec<[[f64; JOINTS]; 6]>>,
}

/// Why a file is no motion.
#[derive(Debug, thiserror::Error)]
pub enum FollowError {
    /// It cannot be read.
    #[error("{path}: {source}")]
    Read {
        /// The file.
        path: String,
        /// Why not.
        source: csv::Error,
    },
    /// A column that a leg needs is not there.
    #[error("{path}: no column `{column}`")]
    Column {
        /// The file.
        path: String,
        /// The column.
        column: String,
    },
    /// Not a finite number.
    #[error("{path}:{line}: `{text}` in column `{column}` is not a finite number")]
    Number {
        /// The file.
        path: String,
        /// The line.
        line: u64,
        /// The column.
        column: String,
        /// What is written.
        text: String,
    },
    /// Time that does not increase.
    #[error("{path}:{line}: the time does not increase")]
    Time {
        /// The file.
        path: String,
        /// The line.
        line: u64,
    },
    /// A column of a joint that the robot does not have.
    #[error(
        "{path}: column `{column}`: there is no joint `{joint}`; a Go2's are FR_hip, FR_thigh, FR_calf and so on for FL, RR, RL"
    )]
    Joint {
        /// The file.
        path: String,
        /// The column.
        column: String,
        /// The joint.
        joint: String,
    },
    /// A position that the joint cannot reach.
    #[error(
        "{path}:{line}: {joint} is asked to be at {asked} rad; its stops are at {} and {} rad", stops[0], stops[1]
    )]
    Stops {
        /// The file.
        path: String,
        /// The line.
        line: u64,
        /// The joint.
        joint: String,
        /// What is asked, rad.
        asked: f64,
        /// Where it can go, rad.
        stops: [f64; 2],
    },
    /// No leg or fewer than two rows.
    #[error(
        "{path}: no motion: it needs the columns `t`, `q/`, `dq/` and `ddq/` of a leg's three joints, and two rows"
    )]
    Empty {
        /// The file.
        path: String,
    },
}

/// A motion file's header: where each leg's channels are.
struct Header {
    time: usize,
    legs: Vec<Leg>,
    /// Cells of each leg's channels; of the last three none where the column is missing.
    cells: Vec<[[Option<usize>; JOINTS]; 6]>,
}

impl Header {
    fn of(names: &csv::StringRecord, path: &Path) -> Result<Self, FollowError> {
        let name = || path.display().to_string();
        let place = |column: &str| names.iter().position(|h| h.trim() == column);
        let known = |joint: &str| JointId::from_name(joint).is_some();
        for column in names.iter().map(str::trim) {
            let joint = column.split_once('/').filter(|(c, _)| CHANNELS.contains(c));
            if let Some((_, joint)) = joint.filter(|(_, joint)| !known(joint)) {
                return Err(FollowError::Joint {
                    path: name(),
                    column: column.to_owned(),
                    joint: joint.to_owned(),
                });
            }
        }
        let named = |leg: &Leg| {
            let mut joints = JointId::of(*leg).into_iter();
            joints.any(|joint| place(&format!("q/{joint}")).is_some())
        };
        let legs: Vec<Leg> = Leg::ALL.into_iter().filter(named).collect();
        let needed = |column: &str| {
            place(column).ok_or_else(|| FollowError::Column {
                path: name(),
                column: column.to_owned(),
            })
        };
        let time = needed("t")?;
        let mut cells = Vec::new();
        for &leg in &legs {
            let mut own = [[None; JOINTS]; 6];
            for (c, channel) in CHANNELS.iter().enumerate() {
                for (j, joint) in JointId::of(leg).iter().enumerate() {
                    let column = format!("{channel}/{joint}");
                    own[c][j] = if c < 3 {
                        Some(needed(&column)?)
                    } else {
                        place(&column)
                    };
                }
            }
            cells.push(own);
        }
        Ok(Self { time, legs, cells })
    }
}

impl Followed {
    /// Reads a motion file, as `excite` writes it.
    ///
    /// # Errors
    /// [`FollowError`] with file, line and column.
    pub fn read(path: &Path) -> Result<Self, FollowError> {
        let name = || path.display().to_string();
        let unreadable = |source| FollowError::Read {
            path: name(),
            source,
        };
        let mut file = csv::Reader::from_path(path).map_err(unreadable)?;
        let names = file.headers().map_err(unreadable)?.clone();
        let header = Header::of(&names, path)?;
        let (mut times, mut rows) = (Vec::new(), Vec::new());
        for record in file.records() {
            let record = record.map_err(unreadable)?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |cell: usize| {
                let text = record.get(cell).unwrap_or_default().trim();
                let value = text.parse().ok().filter(|x: &f64| x.is_finite());
                value.ok_or_else(|| FollowError::Number {
                    path: name(),
                    line,
                    column: names.get(cell).unwrap_or_default().to_owned(),
                    text: text.to_owned(),
                })
            };
            let t = number(header.time)?;
            if times.last().is_some_and(|last| t <= *last) {
                return Err(FollowError::Time { path: name(), line });
            }
            let mut row = Vec::with_capacity(header.cells.len());
            for (leg, own) in header.legs.iter().zip(&header.cells) {
                let values = values_of(own, number)?;
                if let Some(joint) = beyond_its_stops(*leg, &values[0]) {
                    return Err(FollowError::Stops {
                        path: name(),
                        line,
                        joint: JointId::of(*leg)[joint].to_string(),
                        asked: values[0][joint],
                        stops: position_limits(*leg)[joint],
                    });
                }
                row.push(values);
            }
            times.push(t);
            rows.push(row);
        }
        if header.legs.is_empty() || times.len() < 2 {
            return Err(FollowError::Empty { path: name() });
        }
        Ok(Self {
            legs: header.legs,
            t: times,
            rows,
        })
    }

    /// The legs that it moves.
    pub fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// Length, s.
    pub fn duration(&self) -> f64 {
        self.t[self.t.len() - 1] - self.t[0]
    }

    /// The same motion with another feed-forward torque, N m, from a leg's position, velocity and acceleration.
    pub fn with_torque(&self, torque: impl Fn(Leg, [&[f64; JOINTS]; 3]) -> [f64; JOINTS]) -> Self {
        let mut other = self.clone();
        for row in &mut other.rows {
            for (leg, values) in self.legs.iter().zip(row) {
                values[3] = torque(*leg, [&values[0], &values[1], &values[2]]);
            }
        }
        other
    }

    /// A leg's feed-forward torque `t` seconds after the start, N m.
    pub fn torque(&self, leg: Leg, t: f64) -> Option<[f64; JOINTS]> {
        let n = self.legs.iter().position(|own| *own == leg)?;
        let (k, share, _) = self.place(t);
        let (a, b) = (&self.rows[k][n][3], &self.rows[k + 1][n][3]);
        Some(std::array::from_fn(|j| a[j] + (b[j] - a[j]) * share))
    }

    /// The position asked of a leg `t` seconds after the start, rad.
    pub fn position(&self, leg: Leg, t: f64) -> Option<[f64; JOINTS]> {
        self.at(leg, t).map(|(wanted, ..)| wanted.q.into())
    }

    /// The row before `t` seconds after the start, the share of the way to the next, and the time between the two.
    fn place(&self, t: f64) -> (usize, f64, f64) {
        let t = t + self.t[0];
        let after = self.t.partition_point(|row| *row <= t);
        let k = after.saturating_sub(1).min(self.t.len() - 2);
        let step = self.t[k + 1] - self.t[k];
        (k, ((t - self.t[k]) / step).clamp(0.0, 1.0), step)
    }

    /// What is asked of a leg `t` seconds after the start, the feed-forward torque and the gains. Between rows the position is
    /// the cubic that has their positions and velocities; the rest is a straight line.
    pub(super) fn at(&self, leg: Leg, t: f64) -> Option<(Wanted, Vector3<f64>, [Vector3<f64>; 2])> {
        let n = self.legs.iter().position(|own| *own == leg)?;
        let (k, s, step) = self.place(t);
        let (a, b) = (&self.rows[k][n], &self.rows[k + 1][n]);
        let between = |c: usize| Vector3::from_fn(|j, _| a[c][j] + (b[c][j] - a[c][j]) * s);
        let (s2, s3) = (s * s, s * s * s);
        let cubic = |j: usize| {
            (2.0 * s3 - 3.0 * s2 + 1.0) * a[0][j]
                + (s3 - 2.0 * s2 + s) * step * a[1][j]
                + (3.0 * s2 - 2.0 * s3) * b[0][j]
                + (s3 - s2) * step * b[1][j]
        };
        let wanted = Wanted {
            q: Vector3::from_fn(|j, _| cubic(j)),
            dq: between(1),
            ddq: between(2),
        };
        Some((wanted, between(3), [between(4), between(5)]))
    }
}

/// A leg's channels in one row.
fn values_of(
    cells: &[[Option<usize>; JOINTS]; 6],
    number: impl Fn(usize) -> Result<f64, FollowError>,
) -> Result<[[f64; JOINTS]; 6], FollowError> {
    let mut values = [[0.0; JOINTS]; 6];
    values[4] = [GAINS[0]; JOINTS];
    values[5] = [GAINS[1]; JOINTS];
    for (value, cell) in values.iter_mut().flatten().zip(cells.iter().flatten()) {
        if let Some(cell) = cell {
            *value = number(*cell)?;
        }
    }
    Ok(values)
}

/// A joint that is asked to go where it cannot.
fn beyond_its_stops(leg: Leg, q: &[f64; JOINTS]) -> Option<usize> {
    let stops = position_limits(leg);
    (0..JOINTS).find(|&j| !(stops[j][0]..=stops[j][1]).contains(&q[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Followed, FollowError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Followed::read(file.path())
    }

    fn header() -> String {
        let columns = ["q", "dq", "ddq"].map(|c| format!("{c}/FR_hip,{c}/FR_thigh,{c}/FR_calf"));
        format!("t,{}\n", columns.join(","))
    }

    #[test]
    fn between_rows_the_motion_is_smooth() {
        let rows = "0,0,0,-1.7,1,1,1,0,0,0\n0.1,0.1,0.1,-1.6,1,1,1,0,0,0\n";
        let motion = read(&(header() + rows)).unwrap();
        assert_eq!((motion.legs(), motion.duration()), (&[Leg::FR][..], 0.1));
        let (wanted, tau, [kp, _]) = motion.at(Leg::FR, 0.03).unwrap();
        assert!((wanted.q.x - 0.03).abs() < 1e-12 && wanted.dq.x == 1.0);
        assert!(tau.x == 0.0 && kp.x == GAINS[0]);
        assert!(motion.at(Leg::FL, 0.0).is_none());
        // After the end it stays where it is.
        assert!((motion.at(Leg::FR, 9.0).unwrap().0.q.x - 0.1).abs() < 1e-12);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        let error = |text: String| read(&text).unwrap_err().to_string();
        assert!(error("t,q/FR_hip\n0,1\n".to_owned()).contains("no column `q/FR_thigh`"));
        assert!(
            error(header() + "0,0,0,x,0,0,0,0,0,0\n").contains(":2: `x` in column `q/FR_calf`")
        );
        assert!(
            error(header() + "0,0,0,-1.7,0,0,0,0,0,0\n0,0,0,-1.7,0,0,0,0,0,0\n")
                .contains(":3: the time")
        );
        assert!(error(header() + "0,0,0,-1.7,0,0,0,0,0,0\n").contains("no motion"));
        assert!(error("t\n0\n1\n".to_owned()).contains("no motion"));
        let knee = header().replace("ddq/FR_calf", "ddq/FR_calf,tau/FR_knee");
        assert!(error(knee).contains("there is no joint `FR_knee`"));
        let beyond = error(header() + "0,0,0,-1.7,0,0,0,0,0,0\n1,0,0,-2.8,0,0,0,0,0,0\n");
        assert!(
            beyond.contains(":3: FR_calf is asked to be at -2.8 rad"),
            "{beyond}"
        );
    }
}

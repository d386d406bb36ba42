//! Where a robot's joints rest, by what it says of them itself.

use std::path::Path;

use proprio_core::app::rest;
use proprio_core::go2::{JointId, position_limits};

use super::{LiveError, Source};
use crate::device::poses::can_be;
use crate::log::{LiveRows, LogError};
use crate::model::Robot;
use crate::robust::median;

/// How long it must rest, s of the rows' own clock.
pub const REST: f64 = 1.0;

/// Why nothing is known of where the joints rest.
#[derive(Debug, thiserror::Error)]
pub enum RestError {
    /// The source cannot be opened.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// What it gives cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// It ended too early.
    #[error("{source_name}: {rows} rows of {seconds:.2} s, but {REST} s at rest are needed")]
    Short {
        /// What the user calls it.
        source_name: String,
        /// Rows that came.
        rows: usize,
        /// From the first to the last, s.
        seconds: f64,
    },
    /// A joint moves.
    #[error("{source_name}: {joint} moves: {speed:.2} rad/s, {away:.4} rad from its median; at rest are at most {:.3} rad/s and {:.4} rad", .most[0], .most[1])]
    Moves {
        /// What the user calls it.
        source_name: String,
        /// The joint.
        joint: &'static str,
        /// Its greatest speed, rad/s.
        speed: f64,
        /// The greatest distance from its median, rad.
        away: f64,
        /// What both may be of a joint at rest.
        most: [f64; 2],
    },
    /// A joint is where it cannot be.
    #[error("{source_name}: {joint} is at {angle:.4} rad, beyond its limits {:.4} and {:.4} rad", .limits[0], .limits[1])]
    OutOfRange {
        /// What the user calls it.
        source_name: String,
        /// The joint.
        joint: &'static str,
        /// Where it is, rad.
        angle: f64,
        /// Its limits, rad.
        limits: [f64; 2],
    },
}

/// The median position (rad) over [`REST`] of each joint that `source`, a Go2's called `name`, has; all of them at rest by the rule that a device has
/// for its zeros ([`rest`]).
///
/// # Errors
/// [`RestError`].
pub fn resting_at(name: &str, source: Source) -> Result<Vec<(JointId, f64)>, RestError> {
    let robot = Robot::go2();
    let mut rows = LiveRows::follow(Path::new(name), source.into_input(), &robot)?;
    let joints: Vec<usize> = rows.columns().joints().collect();
    let mut motion: Vec<(Vec<f64>, Vec<f64>)> = vec![Default::default(); joints.len()];
    let (mut first, mut seconds, mut count) = (None, 0.0, 0);
    while seconds < REST {
        let Some(row) = rows.next_row()? else {
            return Err(RestError::Short {
                source_name: name.to_owned(),
                rows: count,
                seconds,
            });
        };
        seconds = row.t() - *first.get_or_insert(row.t());
        count += 1;
        for ((q, dq), &joint) in motion.iter_mut().zip(&joints) {
            q.push(row.q()[joint]);
            dq.push(row.dq()[joint]);
        }
    }
    let ids = joints.iter().filter_map(|&joint| JointId::all().nth(joint));
    ids.zip(&motion)
        .map(|(joint, (q, dq))| Ok((joint, rests(name, joint, q, dq)?)))
        .collect()
}

/// A joint's median, if it rests by its positions (rad) and velocities (rad/s).
fn rests(name: &str, joint: JointId, q: &[f64], dq: &[f64]) -> Result<f64, RestError> {
    let source_name = || name.to_owned();
    let angle = median(q.iter().copied()).unwrap_or(f64::NAN);
    // Of a value that is no number nothing is known to rest.
    let greatest = |x: f64, y: f64| if y.is_nan() { y } else { x.max(y) };
    let speed = dq.iter().map(|dq| dq.abs()).fold(0.0, greatest);
    let away = q.iter().map(|q| (q - angle).abs()).fold(0.0, greatest);
    let most = rest(joint.place());
    if !(speed <= most[0] && away <= most[1]) {
        return Err(RestError::Moves {
            source_name: source_name(),
            joint: joint.name(),
            speed,
            away,
            most,
        });
    }
    if !can_be(joint, angle) {
        return Err(RestError::OutOfRange {
            source_name: source_name(),
            joint: joint.name(),
            angle,
            limits: position_limits(joint.leg())[joint.place()],
        });
    }
    Ok(angle)
}

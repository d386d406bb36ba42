//! Whether a log's torque was computed from what was commanded, and not measured.
//!
//! Motors are commanded τ = k_p (q_d − q) − k_d q̇ + τ₀. What they report follows that, but not to the last digit: of real chirps at most
//! 99.1 % of a joint's variance. A torque that it explains to a ten-thousandth was written by a program.

use std::path::Path;

use super::MismatchKind;
use super::reading::least_squares;
use crate::log::{Channel, LogReader, Selection};
use crate::model::Model;
use crate::recording::Recording;

/// Share of a joint's variance that commands leave of a torque that was computed from them: quanta of torque and position.
const COMPUTED: f64 = 1e-4;
/// Most samples by which it may be late.
const MOST_LATE: usize = 10;
/// So many samples tell.
const SAMPLES: usize = 5_000;

/// A log in which all joints' torques are their commands'.
pub(super) fn commanded(recording: &Recording, model: &Model) -> Option<MismatchKind> {
    let mut logs = recording.logs.iter().filter(|log| log.as_os_str() != "-");
    let found = logs.find(|log| is_computed(log, model).unwrap_or(false))?;
    Some(MismatchKind::Commanded(found.display().to_string()))
}

/// A joint's channels: what is to be explained, and what may explain it.
#[derive(Default)]
struct Channels {
    torque: Vec<f64>,
    error: Vec<f64>,
    velocity: Vec<f64>,
}

/// None of a log without commanded positions.
fn is_computed(log: &Path, model: &Model) -> Option<bool> {
    let mut reader = LogReader::open_of(log, Selection::Everything, model.robot()).ok()?;
    let columns = reader.columns();
    let joints: Vec<usize> = columns
        .joints()
        .filter(|j| columns.has(Channel::QDes, *j))
        .collect();
    if joints.is_empty() {
        return None;
    }
    let mut channels: Vec<Channels> = joints.iter().map(|_| Channels::default()).collect();
    for _ in 0..SAMPLES {
        let Some(row) = reader.next_row().ok()? else {
            break;
        };
        for (own, &j) in channels.iter_mut().zip(&joints) {
            own.torque.push(row.tau()[j]);
            own.error.push(row.q_des()[j] - row.q()[j]);
            own.velocity.push(row.dq()[j]);
        }
    }
    Some(channels.iter().all(Channels::is_computed))
}

impl Channels {
    fn is_computed(&self) -> bool {
        let count = self.torque.len().saturating_sub(MOST_LATE);
        let left = |late: usize| {
            let torque = &self.torque[late..late + count];
            let mean = torque.iter().sum::<f64>() / count as f64;
            let about: Vec<f64> = torque.iter().map(|x| x - mean).collect();
            let total: f64 = about.iter().map(|x| x * x).sum();
            let ones = vec![1.0; count];
            let columns = [&self.error[..count], &self.velocity[..count], &ones];
            let (_, left) = least_squares(&columns, &about);
            left / total
        };
        count > 10 * MOST_LATE && (0..MOST_LATE).any(|late| left(late) < COMPUTED)
    }
}

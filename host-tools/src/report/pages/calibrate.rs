//! The page of `calibrate`.

use std::path::Path;

use super::{Unreadable, header};
use crate::kinematics::{Calibration, Poses};
use crate::report::{Header, Page, poses};

/// Errors before and after: on the robot, by pose, by joint; values; candidates.
///
/// # Errors
/// The path of a file that cannot be read any more, and why.
pub fn calibration(
    calibration: &Calibration,
    files: &Poses,
    path: Option<&Path>,
) -> Result<Page, Unreadable> {
    let summary = calibration.summary(files, path, false);
    let header = header("Kinematics by measured poses", summary.points, &files.files)?;
    Ok(Page {
        header: Header {
            headline: summary.headline,
            next: summary.next,
            ..header
        },
        sections: vec![
            poses::vectors(&calibration.by_pose),
            poses::by_pose(&calibration.by_pose),
            poses::by_joint(&calibration.by_joint),
            poses::candidates(&calibration.candidates),
            poses::values(&calibration.parameters),
        ],
    }
    .folded())
}

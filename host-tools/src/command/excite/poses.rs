//! `proprio excite --poses`: which poses to measure for a calibration.

use std::io::Write;
use std::time::Instant;

use serde::Serialize;

use super::super::Error;
use super::super::result::result;
use super::{Excite, write_motion};
use crate::kinematics::{PoseDesign, design_poses};
use crate::model::Model;
use crate::progress::Underway;

/// What is printed.
#[derive(Debug, Serialize)]
struct Output<'a> {
    output: &'a std::path::Path,
    #[serde(flatten)]
    design: &'a PoseDesign,
    violations: usize,
    seconds: f64,
}

/// Chooses poses and writes them.
pub(super) fn choose(
    command: &Excite,
    model: &Model,
    count: usize,
    begun: Instant,
) -> Result<String, Error> {
    let underway = Underway::new("Choosing");
    let design = design_poses(model, count, command.seed)?;
    drop(underway);
    let path = &command.output;
    write_motion(path, |file| {
        let names: Vec<String> = design
            .joints
            .iter()
            .map(|joint| format!("q/{joint}"))
            .collect();
        writeln!(file, "{}", names.join(","))?;
        for q in &design.positions {
            let cells: Vec<String> = q.iter().map(|x| format!("{x:.6}")).collect();
            writeln!(file, "{}", cells.join(","))?;
        }
        Ok(())
    })?;
    if command.json {
        let output = Output {
            output: path,
            design: &design,
            violations: 0,
            seconds: begun.elapsed().as_secs_f64(),
        };
        return Ok(result("excite", &output));
    }
    Ok(format!(
        "Chose {} poses: {}\n  \u{2022} Expected error at other poses {:.3} mm; {} random poses leave {:.3} mm, the\n    first {} of these as little\n  \u{2022} Joint limits hold, and lines between joints stay apart. Not checked:\n    {}\n\nMeasure x/<target>, y/<target>, z/<target> at each row, then: proprio calibrate\n",
        design.poses,
        path.display(),
        design.predicted_error,
        design.poses,
        design.random_error,
        design.enough,
        design.unchecked,
    ))
}

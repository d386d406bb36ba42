//! `proprio identify --blocks`: one robot, of the blocks that `proprio factors` made of its logs.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::result;
use crate::command::{Error, factors::admitted};
use crate::fleet::answers::{Answers, RobotValue};
use crate::fleet::{Gate, final_answers, partial};
use crate::identify::{by_effect, drive_rows};
use crate::summary::{Summary, quoted};
use crate::table::{RangeValue, Table, with_std};

/// A value so many of its standard deviations from none is one to name: two hold 95 % ([`RobotValue::std`]), so that of twenty absent ones about one is
/// named by chance, which the screen says.
const NAMED: f64 = 2.0;

/// What the first screen leaves to --verbose.
const MORE: &str = "--verbose (each value ± 1σ, between blocks, worth)";

/// What is printed.
#[derive(Serialize)]
struct Report {
    blocks: Vec<PathBuf>,
    robot: String,
    count: usize,
    values: Vec<RobotValue>,
}

/// Reads the files, refuses what does not belong together, and solves.
pub(super) fn run(files: &[PathBuf], is_verbose: bool, as_json: bool) -> Result<String, Error> {
    let mut gate = Gate::default();
    let mut all = Vec::new();
    let mut robot: Option<String> = None;
    for file in files {
        for block in admitted(file, &mut gate)? {
            let known = robot.get_or_insert_with(|| block.robot.clone());
            if *known != block.robot {
                return Err(Error::AnotherRobot {
                    file: file.clone(),
                    robot: block.robot,
                    known: known.clone(),
                });
            }
            all.push(block);
        }
    }
    let Answers { blocks, values, .. } = final_answers(partial(all));
    let report = Report {
        blocks: files.to_vec(),
        robot: robot.unwrap_or_default(),
        count: blocks,
        values,
    };
    Ok(match (as_json, is_verbose) {
        (true, _) => result("identify", &report),
        (false, true) => report.to_string(),
        (false, false) => report.summary().screen(&[], MORE),
    })
}

/// A value's effect and joint.
fn place(of: &RobotValue) -> Option<(&str, &str)> {
    of.name.split_once(':')
}

/// How many of its standard deviations a value lies from none.
fn deviations(of: &RobotValue) -> f64 {
    of.value.abs() / of.std
}

impl Report {
    /// The joints, in the table's order.
    fn joints(&self) -> Vec<String> {
        let mut joints: Vec<String> = Vec::new();
        for (_, joint) in self.values.iter().filter_map(place) {
            if !joints.iter().any(|known| known == joint) {
                joints.push(joint.to_owned());
            }
        }
        joints
    }

    /// The first screen: what every drive has, which effects beyond it the blocks show, what the standard deviations are made of.
    fn summary(&self) -> Summary {
        let joints = self.joints();
        let (drive, added): (Vec<&RobotValue>, Vec<&RobotValue>) =
            self.values.iter().partition(|of| of.in_model);
        let find = |name: &str| {
            let own = drive.iter().find(|of| of.name == name)?;
            Some(RangeValue {
                value: own.value,
                std: Some(own.std),
                at_bound: false,
            })
        };
        let mut points = Vec::new();
        let mut shown: Vec<&&RobotValue> =
            added.iter().filter(|of| deviations(of) > NAMED).collect();
        shown.sort_by(|a, b| deviations(b).total_cmp(&deviations(a)));
        points.push(match shown.is_empty() {
            true => format!(
                "None of {} values of other effects, each added alone, exceeds 2σ.",
                added.len()
            ),
            false => format!(
                "Other effects, each added alone, beyond 2σ (5 % are by chance): {}.",
                by_effect(shown.iter().filter_map(|of| place(of)), &joints)
            ),
        });
        let open: Vec<&&RobotValue> = drive.iter().filter(|of| deviations(of) <= NAMED).collect();
        if !open.is_empty() {
            points.push(format!(
                "{} of {} drive values are within 2σ of none: {}.",
                open.len(),
                drive.len(),
                by_effect(open.iter().filter_map(|of| place(of)), &joints)
            ));
        }
        points.push(match self.count {
            1 => "One block: σ is by the noise within it. Add blocks of other logs.".to_owned(),
            _ => {
                let worth = drive.iter().map(|of| of.effective);
                let least = worth.fold(f64::INFINITY, f64::min);
                format!(
                    "σ is from between blocks; they are worth {least:.1} independent ones or more."
                )
            }
        });
        let most = shown.first().and_then(|of| place(of));
        let next = most.map(|(effect, _)| format!("proprio effects {}", quoted(effect)));
        Summary {
            headline: format!(
                "{}: {} blocks, {} values of a plain drive",
                self.robot,
                self.count,
                drive.len()
            ),
            rows: drive_rows(&joints, find),
            points,
            next: next.into_iter().collect(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::default();
        table.row(
            [
                "",
                "unit",
                "value",
                "±",
                "between blocks",
                "blocks",
                "worth",
            ]
            .map(str::to_owned),
        );
        for own in &self.values {
            let mark = if own.in_model { "" } else { "+ " };
            let told = with_std(own.value, own.std);
            let (value, std) = told.split_once(" ±").unwrap_or((told.as_str(), ""));
            table.row([
                format!("{mark}{}", own.name),
                own.unit.clone(),
                value.to_owned(),
                std.to_owned(),
                with_std(own.value, own.between)
                    .split_once('±')
                    .map_or_else(String::new, |(_, between)| between.to_owned()),
                own.blocks.to_string(),
                format!("{:.1}", own.effective),
            ]);
        }
        write!(f, "{table}")?;
        writeln!(
            f,
            "{}: {} blocks. ± is one standard deviation from between blocks; `worth` is how many independent blocks they are.\n\
             A plain drive's values, and (+) those of each other kept effect added to it alone.",
            self.robot, self.count
        )
    }
}

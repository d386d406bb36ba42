//! `proprio identify --blocks`: one robot, of the blocks that `proprio factors` made of its logs.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::result;
use crate::command::{Error, factors::admitted};
use crate::fleet::answers::{Answers, RobotValue};
use crate::fleet::{Gate, final_answers, partial};
use crate::table::{Table, with_std};

/// What is printed.
#[derive(Serialize)]
struct Report {
    blocks: Vec<PathBuf>,
    robot: String,
    count: usize,
    values: Vec<RobotValue>,
}

/// Reads the files, refuses what does not belong together, and solves.
pub(super) fn run(files: &[PathBuf], as_json: bool) -> Result<String, Error> {
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
    Ok(match as_json {
        true => result("identify", &report),
        false => report.to_string(),
    })
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

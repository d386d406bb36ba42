//! Every case as a row, so that a change of behaviour shows: `tests/battery/cases.csv`.

use std::path::PathBuf;

use super::outcome::Outcome;

/// The row's columns.
const HEADER: &str =
    "case,snr,torque,detectable,named,alternatives,path,outside,at_floor,after,floor,apart";
/// How many of them are compared: from the verdict on; numbers may differ between machines.
const COMPARED: std::ops::Range<usize> = 3..9;

/// Where the rows are.
pub fn path() -> PathBuf {
    super::folder().join("cases.csv")
}

/// The rows of outcomes.
pub fn text(outcomes: &[Outcome]) -> String {
    let mut text = format!("{HEADER}\n");
    for outcome in outcomes {
        text += &row(outcome);
        text.push('\n');
    }
    text
}

fn row(outcome: &Outcome) -> String {
    let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:.4}"));
    let yes = |yes: bool| if yes { "yes" } else { "no" };
    [
        outcome.case.clone(),
        outcome
            .snr
            .map_or_else(String::new, |snr| format!("{snr:.1}")),
        number(Some(outcome.torque)),
        yes(outcome.is_detectable()).to_owned(),
        outcome.named.clone().unwrap_or_default(),
        outcome.alternatives.join(" "),
        outcome.path.join(" "),
        yes(outcome.outside).to_owned(),
        outcome.is_at_floor().map_or("", yes).to_owned(),
        number(Some(outcome.after)),
        number(outcome.floor),
        outcome
            .apart
            .map_or_else(String::new, |apart| format!("{apart:.1}")),
    ]
    .join(",")
}

/// What is not as the committed rows say, a line for each case.
pub fn differences(outcomes: &[Outcome], committed: &str) -> Vec<String> {
    let case = |row: &str| row.split(',').next().unwrap_or_default().to_owned();
    let compared = |row: &str| {
        let cells: Vec<&str> = row.split(',').collect();
        cells.get(COMPARED).map(|cells| cells.join(","))
    };
    let known: std::collections::HashMap<String, &str> =
        committed.lines().map(|row| (case(row), row)).collect();
    let mut differences = Vec::new();
    for outcome in outcomes {
        let new = row(outcome);
        match known.get(&outcome.case) {
            None => differences.push(format!("{}: not in the committed table", outcome.case)),
            Some(old) if compared(old) != compared(&new) => {
                differences.push(format!("- {old}\n+ {new}"));
            }
            Some(_) => {}
        }
    }
    differences
}

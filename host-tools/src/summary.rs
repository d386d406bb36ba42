//! What matters most, as it stands on the first screen of a terminal and of a report: one line, three points, one command.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

/// The first screen.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// How large the error is, and what is missing.
    pub headline: String,
    /// The most important findings, three at most.
    pub points: Vec<String>,
    /// What to run next, as it can be typed.
    pub next: Vec<String>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", wrapped(&self.headline, "", "  "))?;
        for point in &self.points {
            write!(f, "{}", wrapped(point, "  • ", "    "))?;
        }
        for command in &self.next {
            writeln!(f, "\n  $ {command}")?;
        }
        Ok(())
    }
}

/// How far a model is from the torque of a log, of all joints or of one, as JSON has it everywhere; none where the data are too short to say.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorRange {
    /// Of the model file as it is given; of the CAD, where there is none.
    pub before: Option<f64>,
    /// Of the result.
    pub after: Option<f64>,
    /// That no model can go below.
    pub floor: Option<f64>,
    /// Why no floor is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor_unknown: Option<&'static str>,
    /// SI unit.
    pub unit: &'static str,
}

impl ErrorRange {
    /// Of torques, N m.
    pub(crate) fn torque(
        before: impl Into<Option<f64>>,
        after: impl Into<Option<f64>>,
        floor: impl Into<Option<f64>>,
    ) -> Self {
        Self {
            before: before.into(),
            after: after.into(),
            floor: floor.into(),
            floor_unknown: None,
            unit: "N m",
        }
    }
}

/// Columns of a terminal.
const COLUMNS: usize = 80;

/// Text in lines that a terminal holds, the first of them after `first`, the others after `next`; a word that is longer has a line of its own.
pub(crate) fn wrapped(text: &str, first: &str, next: &str) -> String {
    let mut lines = String::new();
    let mut line = first.to_owned();
    let mut is_new = true;
    for word in text.split_whitespace() {
        let len = line.chars().count() + usize::from(!is_new) + word.chars().count();
        if !is_new && len > COLUMNS {
            lines += &line;
            lines.push('\n');
            line = next.to_owned();
            is_new = true;
        }
        if !is_new {
            line.push(' ');
        }
        line += word;
        is_new = false;
    }
    lines + &line + "\n"
}

/// A torque error as it is told: three digits that count, N m.
pub(crate) fn torque(rms: f64) -> String {
    let digits = if rms < 0.1 { 4 } else { 3 };
    format!("{rms:.digits$}")
}

/// Joints by what they have in common: `all joints`, `every calf`, `FR_hip, FR_thigh`, `5 joints`.
pub(crate) fn joints_in_words(joints: &[String], all: &[String]) -> String {
    let has = |name: &String| joints.contains(name);
    if all.len() > 1 && all.iter().all(has) {
        return "all joints".to_owned();
    }
    let kind = |name: &str| name.rsplit_once('_').map(|(_, kind)| kind.to_owned());
    let mut kinds: Vec<String> = joints.iter().filter_map(|name| kind(name)).collect();
    kinds.sort();
    kinds.dedup();
    let of_kinds: Vec<&String> = (all.iter())
        .filter(|name| kind(name).is_some_and(|kind| kinds.contains(&kind)))
        .collect();
    let whole = of_kinds.len() == joints.len() && of_kinds.iter().all(|name| has(name));
    if whole && joints.len() > kinds.len() {
        return format!("all {}", plural(&kinds));
    }
    match joints {
        [] => "no joint".to_owned(),
        [_] | [_, _] | [_, _, _] => joints.join(", "),
        more => format!("{} joints", more.len()),
    }
}

/// `calves and hips`
fn plural(kinds: &[String]) -> String {
    let many = |kind: &String| match kind.strip_suffix('f') {
        Some(stem) => format!("{stem}ves"),
        None => format!("{kind}s"),
    };
    let many: Vec<String> = kinds.iter().map(many).collect();
    many.join(" and ")
}

/// Logs, and the option that names the model, as they are typed.
pub fn typed(logs: &[PathBuf], model: Option<&Path>) -> String {
    let mut words: Vec<String> = logs.iter().map(|log| word(log)).collect();
    if let Some(model) = model {
        words.extend(["-m".to_owned(), word(model)]);
    }
    words.join(" ")
}

/// A path as a shell takes it.
pub(crate) fn word(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn joints_are_told_by_what_they_have_in_common() {
        let all = names("FR_hip FR_thigh FR_calf FL_hip FL_thigh FL_calf");
        let told = |joints: &str| joints_in_words(&names(joints), &all);
        assert_eq!(
            told("FL_hip FR_hip FR_thigh FR_calf FL_thigh FL_calf"),
            "all joints"
        );
        assert_eq!(told("FR_calf FL_calf"), "all calves");
        assert_eq!(told("FR_calf FL_calf FR_hip FL_hip"), "all calves and hips");
        assert_eq!(told("FR_calf"), "FR_calf");
        assert_eq!(told("FR_calf FR_hip"), "FR_calf, FR_hip");
        assert_eq!(told("FR_calf FR_hip FL_hip FL_thigh"), "4 joints");
        let arm = names("shoulder elbow");
        assert_eq!(joints_in_words(&names("elbow"), &arm), "elbow");
        assert_eq!(joints_in_words(&arm, &arm), "all joints");
        assert_eq!(
            joints_in_words(&names("FR_calf"), &names("FR_hip FR_thigh FR_calf")),
            "FR_calf"
        );
    }

    #[test]
    fn lines_fit_a_terminal() {
        let text = "word ".repeat(60) + &"x".repeat(100);
        let lines = wrapped(&text, "  • ", "    ");
        let lines: Vec<&str> = lines.lines().collect();
        let (long, short) = lines.split_last().unwrap();
        assert!(
            short
                .iter()
                .all(|line| (70..=COLUMNS).contains(&line.chars().count())
                    || *line == short[short.len() - 1])
        );
        assert_eq!(long.trim(), "x".repeat(100));
        assert!(lines[0].starts_with("  • word") && lines[1].starts_with("    word"));
    }

    #[test]
    fn a_path_stays_one_word() {
        assert_eq!(word(Path::new("a/b-1.csv")), "a/b-1.csv");
        assert_eq!(word(Path::new("it's a log.csv")), "'it'\\''s a log.csv'");
        assert_eq!(word(Path::new("$(rm).csv")), "'$(rm).csv'");
    }
}

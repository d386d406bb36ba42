//! What matters most, as it stands on the first screen of a terminal and of a report: one line, three points, one command.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::model::Witnessed;

/// The first screen.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// How large the error is, and what is missing.
    pub headline: String,
    /// Values, where the answer is a few of them: a line of text each, as it stands.
    pub rows: Vec<String>,
    /// The most important findings, three at most.
    pub points: Vec<String>,
    /// What to run next, as it can be typed.
    pub next: Vec<String>,
}

/// Points of a summary.
pub(crate) const POINTS: usize = 3;
/// Lines of a first screen: half of a terminal's 24 and what stood there before.
const LINES: usize = 15;
/// Lines of what stands above the headline, each.
const ABOVE: usize = 2;

impl Summary {
    /// The screen, of at most fifteen lines: what stands `above` (what is wrong with the samples, which file was written), headline, rows,
    /// points, the next command; `more` says how the rest is printed. Where there is not room for all of it the longest points are cut:
    /// --verbose and the page have them whole.
    pub fn screen(&self, above: &[String], more: &str) -> String {
        let above = above.iter().filter(|text| !text.is_empty());
        let mut lines: Vec<String> = above
            .flat_map(|text| cut(wrapped_lines(text, "", "  "), ABOVE))
            .collect();
        lines.extend(wrapped_lines(&self.headline, "", "  "));
        lines.extend(self.rows.iter().cloned());
        let next = self.next.iter().map(|command| format!("Next: {command}"));
        let mut end: Vec<String> = next.collect();
        if !more.is_empty() {
            end.extend(wrapped_lines(&format!("More: {more}"), "", "  "));
        }
        let mut points: Vec<Vec<String>> = (self.points.iter())
            .map(|point| wrapped_lines(point, "  • ", "    "))
            .collect();
        let room = LINES.saturating_sub(lines.len() + end.len());
        shorten(&mut points, room);
        lines.extend(points.concat());
        lines.extend(end);
        lines.join("\n") + "\n"
    }
}

/// Cuts the longest points, the last of them first, until all together have `room`; of each a line stays.
fn shorten(points: &mut [Vec<String>], room: usize) {
    while points.iter().map(Vec::len).sum::<usize>() > room {
        let longest = points.iter_mut().max_by_key(|point| point.len());
        let Some(point) = longest.filter(|point| point.len() > 1) else {
            return;
        };
        let fewer = point.len() - 1;
        *point = cut(std::mem::take(point), fewer);
    }
}

/// The first `most` lines of a text, with a sign that there are more.
fn cut(mut lines: Vec<String>, most: usize) -> Vec<String> {
    if lines.len() <= most {
        return lines;
    }
    lines.truncate(most);
    if let Some(last) = lines.last_mut() {
        let words = last.strip_suffix(CUT).unwrap_or(last);
        let words = match words.rsplit_once(' ') {
            Some((rest, _)) if words.chars().count() + CUT.chars().count() > COLUMNS => rest,
            _ => words,
        };
        *last = format!("{words}{CUT}");
    }
    lines
}

/// Stands at the end of a text that is cut.
const CUT: &str = " …";

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.screen(&[], ""))
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
pub(crate) const COLUMNS: usize = 80;

/// Text in lines that a terminal holds, the first of them after `first`, the others after `next`; a word that is longer has a line of its own.
pub(crate) fn wrapped(text: &str, first: &str, next: &str) -> String {
    wrapped_lines(text, first, next).join("\n") + "\n"
}

/// The lines of [`wrapped`].
fn wrapped_lines(text: &str, first: &str, next: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = first.to_owned();
    let mut is_new = true;
    for word in text.split_whitespace() {
        let len = line.chars().count() + usize::from(!is_new) + word.chars().count();
        if !is_new && len > COLUMNS {
            lines.push(std::mem::replace(&mut line, next.to_owned()));
            is_new = true;
        }
        if !is_new {
            line.push(' ');
        }
        line += word;
        is_new = false;
    }
    lines.push(line);
    lines
}

/// A number to three digits.
pub(crate) fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        size if (1e-2..1e4).contains(&size) => {
            let digits = (2 - size.log10().floor() as i32).max(0) as usize;
            format!("{x:.digits$}")
        }
        _ => format!("{x:.2e}"),
    }
}

/// An estimate as a line of `--verbose`: name, value, standard deviation, status and unit.
pub(crate) struct ValueLine<'a> {
    pub(crate) name: &'a str,
    pub(crate) value: f64,
    pub(crate) std: f64,
    pub(crate) status: &'a str,
    pub(crate) unit: &'a str,
}

/// Estimates line by line, and what several witnesses measured of them.
pub(crate) fn value_lines<'a>(
    values: impl Iterator<Item = ValueLine<'a>>,
    witnesses: &[Witnessed],
) -> String {
    let mut out = String::from(
        "\nvalue                                    estimate            std  status\n",
    );
    for v in values {
        let [value, std] = [v.value, v.std].map(short);
        let (name, status, unit) = (v.name, v.status, v.unit);
        out += &format!("{name:<34} {value:>14} {std:>14}  {status} ({unit})\n");
    }
    for witnessed in witnesses {
        out += &format!("{witnessed}\n");
    }
    out
}

/// A torque error as it is told: three digits that count, N m.
pub(crate) fn torque(rms: f64) -> String {
    let digits = if rms < 0.1 { 4 } else { 3 };
    format!("{rms:.digits$}")
}

/// Most rows of a table on a first screen.
const MOST_ROWS: usize = 7;

/// Joints by kinds, each with its name: a joint each where they are few; `hips`, where names have kinds; all together otherwise.
pub(crate) fn by_kind(all: &[String]) -> Vec<(String, Vec<String>)> {
    if all.len() <= MOST_ROWS {
        let alone = |joint: &String| (joint.clone(), vec![joint.clone()]);
        return all.iter().map(alone).collect();
    }
    let mut kinds: Vec<(String, Vec<String>)> = Vec::new();
    for joint in all {
        let kind = joint
            .rsplit_once('_')
            .map_or(joint.as_str(), |(_, kind)| kind);
        match kinds.iter_mut().find(|(known, _)| known == kind) {
            Some((_, own)) => own.push(joint.clone()),
            None => kinds.push((kind.to_owned(), vec![joint.clone()])),
        }
    }
    if kinds.len() > MOST_ROWS {
        return vec![("all joints".to_owned(), all.to_vec())];
    }
    let named = kinds.into_iter().map(|(kind, own)| match own.len() {
        1 => (own[0].clone(), own),
        _ => (plural(&[kind]), own),
    });
    named.collect()
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

/// `EFFECT:JOINT`s by effects: `coulomb (all calves), bias:FR_hip`; joints that have no word in common are named.
pub(crate) fn places_in_words(places: &[String], all: &[String]) -> String {
    let mut effects: Vec<(&str, Vec<String>)> = Vec::new();
    for place in places {
        let (effect, joint) = place.split_once(':').unwrap_or((place, ""));
        match effects.iter_mut().find(|(known, _)| *known == effect) {
            Some((_, joints)) => joints.push(joint.to_owned()),
            None => effects.push((effect, vec![joint.to_owned()])),
        }
    }
    let words = effects.iter().map(|(effect, joints)| match &joints[..] {
        [joint] => format!("{effect}:{joint}"),
        _ => match joints_in_words(joints, all) {
            // Only how many they are.
            count if count == format!("{} joints", joints.len()) => {
                format!("{effect} ({})", joints.join(", "))
            }
            words => format!("{effect} ({words})"),
        },
    });
    words.collect::<Vec<_>>().join(", ")
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

/// The command that writes a model for MuJoCo, beside where it is typed.
pub(crate) fn export_command(model: &Path) -> String {
    let file = Path::new(model.file_name().unwrap_or_default()).with_extension("xml");
    format!(
        "proprio export -m {} --mjcf -o {}",
        word(model),
        word(&file)
    )
}

/// Whether any log is standard input, which is read once: no other command can be printed for it.
pub(crate) fn from_standard_input(logs: &[PathBuf]) -> bool {
    logs.iter().any(|log| log.as_os_str() == "-")
}

/// A path as a shell takes it.
pub(crate) fn word(path: &Path) -> String {
    quoted(&path.display().to_string())
}

/// A word as a shell takes it.
pub(crate) fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
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
    fn places_are_listed_by_effects() {
        let all = names("FR_hip FR_thigh FR_calf FL_hip FL_thigh FL_calf");
        let said = |places: &str| places_in_words(&names(places), &all);
        assert_eq!(
            said("coulomb:FR_calf bias:FR_hip coulomb:FL_calf base_tilt:base"),
            "coulomb (all calves), bias:FR_hip, base_tilt:base"
        );
        assert_eq!(
            said(
                "viscous:FR_hip viscous:FR_thigh viscous:FR_calf viscous:FL_hip viscous:FL_thigh viscous:FL_calf"
            ),
            "viscous (all joints)"
        );
        assert_eq!(
            said("bias:FR_hip bias:FR_thigh bias:FL_hip bias:FL_calf"),
            "bias (FR_hip, FR_thigh, FL_hip, FL_calf)"
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

    /// Whatever there is to say.
    #[test]
    fn a_screen_has_fifteen_lines_of_eighty_columns() {
        let text = |words: usize| "words ".repeat(words);
        for (headline, points) in [(5, [9, 90, 9]), (30, [90, 90, 90]), (40, [200, 5, 200])] {
            let summary = Summary {
                headline: text(headline),
                rows: vec!["row".to_owned(); 2],
                points: points.map(text).to_vec(),
                next: vec!["proprio compare log.csv".to_owned()],
            };
            let above = [text(50), text(3), String::new()];
            let screen = summary.screen(&above, "--verbose");
            let lines: Vec<&str> = screen.lines().collect();
            assert!(lines.len() <= LINES, "{screen}");
            assert!(lines.iter().all(|line| line.chars().count() <= COLUMNS));
            assert_eq!(lines.iter().filter(|line| line.contains('•')).count(), 3);
            assert!(screen.ends_with("\nNext: proprio compare log.csv\nMore: --verbose\n"));
            assert!(screen.contains(CUT), "{screen}");
        }
        // What there is room for is not cut.
        let points = [30, 30, 30].map(text).to_vec();
        let summary = Summary {
            points,
            ..Summary::default()
        };
        assert!(!summary.screen(&[], "").contains(CUT));
    }

    #[test]
    fn a_path_stays_one_word() {
        assert_eq!(word(Path::new("a/b-1.csv")), "a/b-1.csv");
        assert_eq!(word(Path::new("it's a log.csv")), "'it'\\''s a log.csv'");
        assert_eq!(word(Path::new("$(rm).csv")), "'$(rm).csv'");
    }
}

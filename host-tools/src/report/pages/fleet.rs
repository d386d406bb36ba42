//! The page of a fleet: robots × parameters in colours of deviation, drifts with dates, the missing effects' ladder by robot, what was refused.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use crate::fleet::answers::{Answers, Population};
use crate::model::Provenance;
use crate::report::data_table::{Cell, Column, DataTable};
use crate::report::{Finding, Header, Page, Section, escape};

/// Deviation that has the full colour, in standard deviations between robots.
const FULL: f64 = 5.0;

/// The page of answers, and of what was refused: file or block, kind, reason.
pub fn fleet(answers: &Answers, refused: &[[String; 3]]) -> Page {
    let no_logs: [std::path::PathBuf; 0] = [];
    let mut findings: Vec<String> = Vec::new();
    for own in answers.missing.iter().filter(|own| own.is_missing) {
        findings.push(format!(
            "A plain drive lacks {}: it explains {:.1} ± {:.1} % of the squared residual of robots that it was not fitted to.",
            own.effect,
            100.0 * own.gain,
            100.0 * own.std
        ));
    }
    for own in &answers.outliers {
        findings.push(format!(
            "{} differs: {} {:+.4} ± {:.4} {}.",
            own.robot, own.name, own.difference, own.std, own.unit
        ));
    }
    for own in &answers.drifts {
        findings.push(format!(
            "{} drifts: {} {:+.4} ± {:.4} {} from {} on.",
            own.robot,
            own.name,
            own.size,
            own.std,
            own.unit,
            date(own.between[1])
        ));
    }
    if !refused.is_empty() {
        findings.push(format!("{} files or blocks were refused.", refused.len()));
    }
    if findings.is_empty() {
        findings
            .push("No robot differs, nothing drifts, and no kept effect is missing.".to_owned());
    }
    Page {
        header: Header {
            title: "A fleet".to_owned(),
            headline: format!(
                "{} robots, {} blocks of time",
                answers.robots, answers.blocks
            ),
            findings: findings.into_iter().map(Finding::from).collect(),
            command: Provenance::of(&no_logs)
                .map(|p| p.command)
                .unwrap_or_default(),
            ..Header::default()
        },
        sections: vec![
            deviations(answers),
            drifts(answers),
            missing(answers),
            refusals(refused),
        ],
    }
}

/// Robots × parameters, each kind its own table.
fn deviations(answers: &Answers) -> Section {
    let common: BTreeMap<&str, &Population> = answers
        .population
        .iter()
        .map(|own| (own.name.as_str(), own))
        .collect();
    let mut kinds: BTreeMap<&str, BTreeMap<&str, BTreeMap<&str, f64>>> = BTreeMap::new();
    for own in &answers.values {
        let Some(common) = common.get(own.name.as_str()) else {
            continue;
        };
        let std = common.spread.hypot(own.std).hypot(common.std);
        if let (Some((kind, joint)), true) = (own.name.split_once(':'), std > 0.0) {
            let robots = kinds.entry(kind).or_default();
            let away = (own.value - common.value) / std;
            robots
                .entry(own.robot.as_str())
                .or_default()
                .insert(joint, away);
        }
    }
    let mut html = String::new();
    for (kind, robots) in kinds {
        let joints: BTreeSet<&str> = robots
            .values()
            .flat_map(|own| own.keys().copied())
            .collect();
        let _ = write!(
            html,
            "<h3>{}</h3><div class=\"scroll\" tabindex=\"0\"><table><thead><tr><th></th>",
            escape::html(kind)
        );
        for joint in &joints {
            let _ = write!(html, "<th>{}</th>", escape::html(joint));
        }
        html.push_str("</tr></thead><tbody>\n");
        for (robot, own) in robots {
            let _ = write!(html, "<tr><th>{}</th>", escape::html(robot));
            for joint in &joints {
                html.push_str(
                    &own.get(joint)
                        .map_or_else(|| "<td></td>".to_owned(), |away| cell(*away)),
                );
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table></div>\n");
    }
    Section {
        id: "deviations",
        title: "Robots and joints",
        text: format!(
            "How far each robot's value is from the fleet's median, in standard deviations (between robots and its own ±). \
             Orange is more, blue is less; {FULL:.0} have the full colour."
        ),
        html,
        ..Section::default()
    }
}

/// A deviation in its colour.
fn cell(away: f64) -> String {
    let share = (100.0 * (away.abs() / FULL).min(1.0)).round();
    let colour = if away > 0.0 { "#e8862e" } else { "#3d7fc4" };
    let text = format!("{away:+.1}").replace('-', "−");
    format!("<td style=\"background:color-mix(in srgb,{colour} {share}%,transparent)\">{text}</td>")
}

fn table(columns: &[(&'static str, bool)], rows: Vec<Vec<Cell>>) -> Option<DataTable> {
    let columns = columns
        .iter()
        .map(|&(title, numeric)| Column { title, numeric });
    (!rows.is_empty()).then(|| DataTable {
        columns: columns.collect(),
        rows,
    })
}

fn drifts(answers: &Answers) -> Section {
    let row = |own: &crate::fleet::answers::Drifting| {
        vec![
            Cell::text(&own.robot),
            Cell::text(&own.name),
            Cell::number(format!("{:+.4} ± {:.4}", own.size, own.std), own.size),
            Cell::text(&own.unit),
            Cell::number(date(own.between[1]), own.between[1]),
            Cell::text(if own.temperature {
                "taken out"
            } else {
                "not recorded"
            }),
        ]
    };
    let columns = [
        ("robot", false),
        ("parameter", false),
        ("change", true),
        ("unit", false),
        ("from", true),
        ("temperature", false),
    ];
    Section {
        id: "drifts",
        title: "Drifts",
        text: format!(
            "Of {} series, what changes beyond what all joints of the robot do together.",
            answers.series
        ),
        table: table(&columns, answers.drifts.iter().map(row).collect()),
        ..Section::default()
    }
}

fn missing(answers: &Answers) -> Section {
    let percent = |x: f64| format!("{:.2}", 100.0 * x);
    let rows = answers.missing.iter().flat_map(|own| {
        let all = (
            "all robots",
            own.gain,
            format!("{} ± {}", percent(own.gain), percent(own.std)),
        );
        let robots = own
            .robots
            .iter()
            .map(|(robot, gain)| (robot.as_str(), *gain, percent(*gain)));
        let rows = std::iter::once(all).chain(robots);
        rows.map(|(robot, gain, text)| {
            vec![
                Cell::text(&own.effect),
                Cell::text(robot),
                Cell::number(text, gain),
            ]
        })
    });
    let columns = [("effect", false), ("robot", false), ("explains, %", true)];
    Section {
        id: "missing",
        title: "What a plain drive lacks",
        text: "Share of each robot's squared residual that an effect explains with the other robots' values: negative where robots \
               do not agree."
            .to_owned(),
        table: table(&columns, rows.collect()),
        ..Section::default()
    }
}

fn refusals(refused: &[[String; 3]]) -> Section {
    let rows = refused
        .iter()
        .map(|cells| cells.iter().map(Cell::text).collect());
    let columns = [("file or block", false), ("kind", false), ("reason", false)];
    Section {
        id: "refused",
        title: "Refused",
        text: "Files and blocks that do not count, and why. The answers are as if they had never come.".to_owned(),
        table: table(&columns, rows.collect()),
        ..Section::default()
    }
}

/// A date of a Unix time (Hinnant's `civil_from_days`, 2013), or seconds of a clock that is none: before 2001.
fn date(t: f64) -> String {
    if !(1e9..1e11).contains(&t) {
        return format!("{t:.0} s");
    }
    let days = (t / 86_400.0).floor() as i64 + 719_468;
    let era = days.div_euclid(146_097);
    let day_of_era = days.rem_euclid(146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year_of_era + 400 * era + i64::from(month <= 2);
    format!("{year}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // date -u -d @N +%F
        for (t, day) in [
            (1e9, "2001-09-09"),
            (1_709_164_800.0, "2024-02-29"),
            (1_790_000_000.0, "2026-09-21"),
        ] {
            assert_eq!(date(t), day);
        }
        assert_eq!(date(12.0), "12 s");
    }
}

//! What the first screens of `identify` have in common: values by kinds of joints, and which of them the logs do not identify.

use std::path::Path;

use proprio_core::effect::EffectKind;

use crate::catalogue;
use crate::estimate::{ParameterEstimate, Status};
use crate::parameter;
use crate::summary::{COLUMNS, by_kind, export_command, joints_in_words, word};
use crate::table::{MOST_DECIMALS, RangeValue, Table, range};

/// Decimals that a value of a drive has in any case: a hundredth of a N m.
const LEAST_DECIMALS: usize = 2;

/// A table of what every drive has: a row for each kind of joints with the range of their values, or for each joint where a robot has few.
/// A value at its bound has a `*`. In as many decimals as lines of a screen have room for.
pub(crate) fn drive_rows(
    joints: &[String],
    find: impl Fn(&str) -> Option<RangeValue>,
) -> Vec<String> {
    let of = |effect: EffectKind, joint: &String| find(&parameter::name_at(effect.name(), joint));
    let has = |effect: &EffectKind| joints.iter().any(|joint| of(*effect, joint).is_some());
    let effects: Vec<EffectKind> = EffectKind::PLAIN.into_iter().filter(has).collect();
    if effects.is_empty() {
        return Vec::new();
    }
    let heading = |effect: &EffectKind| format!("{} {}", effect.name(), parameter::unit(*effect));
    let rows = |decimals: usize| -> Vec<String> {
        let mut table = Table::default();
        let first = [String::new()].into_iter();
        table.row(first.chain(effects.iter().map(heading)));
        for (kind, members) in by_kind(joints) {
            let cell = |effect: &EffectKind| {
                let values = members.iter().filter_map(|joint| of(*effect, joint));
                let values = range(&values.collect::<Vec<_>>(), decimals);
                values.unwrap_or_else(|| "–".to_owned())
            };
            table.row([kind].into_iter().chain(effects.iter().map(cell)));
        }
        let text = table.to_string();
        text.lines().map(|line| format!("  {line}")).collect()
    };
    let fits = |rows: &Vec<String>| rows.iter().all(|row| row.chars().count() <= COLUMNS);
    let mut all = (LEAST_DECIMALS..=MOST_DECIMALS).rev().map(rows);
    all.find(fits).unwrap_or_else(|| rows(LEAST_DECIMALS))
}

impl From<&ParameterEstimate> for RangeValue {
    fn from(of: &ParameterEstimate) -> Self {
        Self {
            value: of.value,
            std: Some(of.std),
            at_bound: of.at_bound,
        }
    }
}

/// The effects beyond the drive, each with its joints.
pub(super) fn other_effects(estimates: &[&ParameterEstimate], joints: &[String]) -> Option<String> {
    let is_other = |name: &str| {
        catalogue::effect_named(name).is_some_and(|effect| !effect.description().is_plain())
    };
    let named = estimates
        .iter()
        .filter(|e| !e.is_inertial())
        .filter_map(|e| e.name.split_once(':'))
        .filter(|(what, _)| is_other(what));
    let listed = by_effect(named, joints);
    (!listed.is_empty()).then(|| format!("Other effects: {listed}."))
}

/// The drive's values that the logs do not identify: those at a bound by name, the others by how many they are.
pub(super) fn not_identified(
    estimates: &[&ParameterEstimate],
    joints: &[String],
) -> Option<String> {
    let plain = |e: &&&ParameterEstimate| {
        let what = e.name.split(':').next().unwrap_or_default();
        EffectKind::PLAIN.iter().any(|effect| effect.name() == what)
    };
    let drive: Vec<&&ParameterEstimate> = estimates.iter().filter(plain).collect();
    let at_bound = drive.iter().filter(|e| e.at_bound);
    let bounds = by_effect(at_bound.filter_map(|e| e.name.split_once(':')), joints);
    let open = |e: &&&&ParameterEstimate| !e.at_bound && e.status != Status::Identified;
    let open = drive.iter().filter(open).count();
    let mut words = Vec::new();
    if !bounds.is_empty() {
        words.push(format!("* at a bound, not identified: {bounds}."));
    }
    if open > 0 {
        words.push(format!(
            "{open} of {} drive values are prior-dominated.",
            drive.len()
        ));
    }
    (!words.is_empty()).then(|| words.join(" "))
}

/// The command after a fit that was written: another log, which would judge it, has no name yet, so it is that which takes the model to where it is used;
/// a model of one log's time is for no simulator, and is shown.
pub(super) fn next_of_written(estimates: &[&ParameterEstimate], written: &Path) -> String {
    let over_time = |estimate: &&ParameterEstimate| {
        let what = estimate.name.split([':', '.']).next()?;
        catalogue::formula_of(catalogue::effect_named(what)?)?.over_time()
    };
    match estimates.iter().find_map(over_time) {
        Some(_) => format!("proprio show {}", word(written)),
        None => export_command(written),
    }
}

/// What to do with a fit that was written, before anything else.
pub(super) fn check(written: Option<&Path>) -> &'static str {
    written.map_or("", |_| " Compare the file with another log.")
}

/// `armature (all hips), coulomb (FR_calf)`.
pub(crate) fn by_effect<'a>(
    places: impl Iterator<Item = (&'a str, &'a str)>,
    joints: &[String],
) -> String {
    let mut effects: Vec<(&str, Vec<String>)> = Vec::new();
    for (effect, joint) in places {
        match effects.iter_mut().find(|(known, _)| *known == effect) {
            Some((_, own)) => own.push(joint.to_owned()),
            None => effects.push((effect, vec![joint.to_owned()])),
        }
    }
    let words = effects
        .iter()
        .map(|(effect, own)| format!("{effect} ({})", joints_in_words(own, joints)));
    words.collect::<Vec<_>>().join(", ")
}

/// How many of the bodies' numbers the logs identify.
pub(super) fn bodies(estimates: &[&ParameterEstimate]) -> String {
    let inertial: Vec<_> = estimates.iter().filter(|e| e.is_inertial()).collect();
    let identified = inertial
        .iter()
        .filter(|e| e.status == Status::Identified)
        .count();
    format!(
        "Bodies: {identified} of {} inertial parameters identified beyond the CAD.",
        inertial.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(name: &str, value: f64, at_bound: bool) -> ParameterEstimate {
        ParameterEstimate {
            name: name.to_owned(),
            unit: "N m",
            value,
            std: 0.02,
            prior: 0.0,
            prior_std: 1.0,
            status: if at_bound {
                Status::Prior
            } else {
                Status::Identified
            },
            at_bound,
        }
    }

    #[test]
    fn values_are_told_by_kinds_of_joints() {
        let joints: Vec<String> = ["FR", "FL", "RR", "RL"]
            .iter()
            .flat_map(|leg| ["hip", "thigh", "calf"].map(|kind| format!("{leg}_{kind}")))
            .collect();
        let all: Vec<ParameterEstimate> = joints
            .iter()
            .enumerate()
            .map(|(n, joint)| estimate(&format!("coulomb:{joint}"), 0.1 * n as f64, n == 0))
            .collect();
        let find = |name: &str| all.iter().find(|e| e.name == name).map(RangeValue::from);
        let rows = drive_rows(&joints, find);
        assert_eq!(rows.len(), 4, "{rows:#?}");
        assert!(rows[1].ends_with("0*–0.900"), "{rows:#?}");
        let all: Vec<&ParameterEstimate> = all.iter().collect();
        assert_eq!(
            not_identified(&all, &joints).as_deref(),
            Some("* at a bound, not identified: coulomb (FR_hip).")
        );
    }

    #[test]
    fn a_robot_of_few_joints_has_a_row_each() {
        let joints = ["shoulder".to_owned(), "elbow".to_owned()];
        let all = [
            estimate("coulomb:shoulder", 0.5, false),
            estimate("coulomb:elbow", 0.25, false),
        ];
        let rows = drive_rows(&joints, |name| {
            all.iter().find(|e| e.name == name).map(RangeValue::from)
        });
        assert_eq!(rows.len(), 3);
        assert!(rows[1].ends_with("0.500"), "{rows:#?}");
    }
}

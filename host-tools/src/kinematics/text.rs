//! The first screen of `calibrate`.

use std::path::Path;

use super::poses::Poses;
use super::result::{Calibration, Step};
use crate::summary::{Summary, ValueLine, short, typed, value_lines};

/// Digits of an error in mm.
pub(super) fn mm(x: f64) -> String {
    match x {
        x if x >= 9.995 => format!("{x:.1}"),
        x if x >= 0.1 => format!("{x:.2}"),
        x => format!("{x:.3}"),
    }
}

/// Joints by name, or how many.
fn listed(joints: &[String]) -> String {
    if joints.len() <= 3 {
        joints.join(", ")
    } else {
        format!("at {} joints", joints.len())
    }
}

/// What was added, in words: `elasticity A2, A3`.
fn added(step: &Step) -> String {
    let effect = step.effect.unwrap_or(step.step);
    if step.joints.is_empty() {
        effect.to_owned()
    } else {
        format!("{effect} {}", listed(&step.joints))
    }
}

impl Calibration {
    /// What matters most.
    pub fn summary(&self, poses: &Poses, model: Option<&Path>, applied: bool) -> Summary {
        let first = self.path.first().map_or(f64::NAN, |step| step.error);
        let last = self.path.last().map_or(f64::NAN, |step| step.error);
        let steps: Vec<&Step> = self
            .path
            .iter()
            .filter(|step| step.effect.is_some())
            .collect();
        let headline = if steps.is_empty() && self.candidates.is_empty() {
            format!(
                "Joint zeros gain nothing. Held-out error {} mm over {} poses",
                mm(last),
                self.poses
            )
        } else if steps.is_empty() {
            format!(
                "No effect of the catalogue gains. Held-out error {} mm over {} poses",
                mm(last),
                self.poses
            )
        } else {
            let mut causes: Vec<&str> = steps.iter().filter_map(|step| step.effect).collect();
            causes.dedup();
            let causes = causes.join(", ");
            format!(
                "Missing: {causes}. Held-out error {} → {} mm over {} poses",
                mm(first),
                mm(last),
                self.poses
            )
        };
        let mut points = Vec::new();
        if !steps.is_empty() {
            let rungs = self.path.iter().map(|step| match (step.step, step.effect) {
                ("as_given", _) => format!("as given {} mm", mm(step.error)),
                (_, None) => format!("mount and targets {} mm", mm(step.error)),
                _ => format!("{} → {}", added(step), mm(step.error)),
            });
            points.push(rungs.collect::<Vec<_>>().join("; "));
        }
        points.push(self.effects_in_words());
        points.extend(self.doubts());
        let logs = typed(&poses.files, model);
        let next = if steps.is_empty() {
            format!("proprio compare {logs}")
        } else if applied {
            let model = model.map_or_else(String::new, crate::summary::word);
            format!("proprio export -m {model} --urdf -o calibrated.urdf")
        } else {
            format!("proprio calibrate {logs} --apply")
        };
        Summary {
            headline,
            points,
            next: vec![next],
            ..Summary::default()
        }
    }

    /// Values of effects beyond geometry; or that none gains.
    fn effects_in_words(&self) -> String {
        let mut words = Vec::new();
        for candidate in self.candidates.iter().filter(|candidate| candidate.taken) {
            words.extend(self.values_in_words(candidate));
            if let Some(other) = candidate.alternatives.first() {
                words.push(format!(
                    "{} is confounded with {} {} on these poses",
                    candidate.effect,
                    other.effect,
                    listed(&other.joints)
                ));
            }
        }
        if !words.is_empty() {
            return words.join("; ");
        }
        let tried = self
            .candidates
            .iter()
            .find(|candidate| candidate.effect == "elasticity");
        match tried {
            Some(tried) => format!(
                "No effect beyond geometry gains. Elasticity changes the held-out error by {:+.3} mm (z {:.1}) and is refused",
                -tried.held_out_gain, tried.z
            ),
            None => "Joint frames and effects were not tried (`--only offsets`)".to_owned(),
        }
    }

    /// The best known values of an effect, two at most.
    fn values_in_words(&self, candidate: &super::result::Candidate) -> Vec<String> {
        let mut own: Vec<(&String, &super::result::Value)> = Vec::new();
        for joint in &candidate.joints {
            let end = format!(":{}:{joint}", candidate.effect);
            let values = self
                .parameters
                .iter()
                .filter(|value| value.name.ends_with(&end));
            own.extend(values.map(|value| (joint, value)));
        }
        own.sort_by(|(_, a), (_, b)| (b.value.abs() / b.std).total_cmp(&(a.value.abs() / a.std)));
        let say = |(joint, value): &(&String, &super::result::Value)| {
            let symbol = value.name.split(':').next().unwrap_or_default();
            if symbol == "1/k" && value.value > 0.0 {
                let k = 1.0 / value.value;
                let std = value.std * k * k;
                return format!(
                    "{joint} k {} ± {} {}",
                    short(k),
                    short(std),
                    inverse_unit(value.unit)
                );
            }
            format!(
                "{joint} {symbol} {} ± {} {}",
                short(value.value),
                short(value.std),
                value.unit
            )
        };
        own.iter().take(2).map(say).collect()
    }

    /// Outliers and what stays open.
    fn doubts(&self) -> Option<String> {
        let mut words = Vec::new();
        if !self.outliers.is_empty() {
            let named = self
                .outliers
                .iter()
                .take(3)
                .map(|o| format!("{} ({} mm)", o.pose, mm(o.error)));
            words.push(format!(
                "Left out: {}",
                named.collect::<Vec<_>>().join(", ")
            ));
        }
        let open = self
            .parameters
            .iter()
            .filter(|value| value.status == "unexcited")
            .count();
        if open > 0 {
            words.push(format!(
                "{open} of {} corrections are unexcited (the prior alone); {} of {} parameters are identifiable as combinations",
                self.parameters.len(),
                self.identifiable,
                self.unknowns
            ));
        }
        (!words.is_empty()).then(|| words.join(". "))
    }

    /// Every value, candidate and pose.
    pub fn details(&self) -> String {
        let values = self.parameters.iter().map(|value| ValueLine {
            name: &value.name,
            value: value.value,
            std: value.std,
            status: value.status,
            unit: value.unit,
        });
        let mut out = value_lines(values, &self.witnesses);
        out += "\ncandidate                                        gain mm        z\n";
        for candidate in &self.candidates {
            let joints = if candidate.joints.len() > 3 {
                format!("{} joints", candidate.joints.len())
            } else {
                candidate.joints.join(",")
            };
            let called = format!(
                "{} {joints}{}",
                candidate.effect,
                if candidate.taken { " (added)" } else { "" }
            );
            out += &format!(
                "{called:<44} {:>11.4} {:>8.1}\n",
                candidate.held_out_gain, candidate.z
            );
        }
        out += "\npose                 target         before mm   after mm\n";
        for error in &self.by_pose {
            out += &format!(
                "{:<20} {:<14} {:>9} {:>10}\n",
                error.pose,
                error.target,
                mm(error.before),
                mm(error.after)
            );
        }
        out
    }
}

/// The unit of a stiffness by that of its inverse.
fn inverse_unit(unit: &str) -> &'static str {
    if unit == "m/N" { "N/m" } else { "N m/rad" }
}

//! What logs could not identify, on one screen.

use std::path::{Path, PathBuf};

use super::{Advice, Advised, Learned, LimbAdvice, NOTHING, figure, unit_of};
use crate::parameter::name_at;
use crate::summary::{Summary, by_kind, typed};

/// Kinds of parameters that the screen names.
const NAMED: usize = 5;

/// One parameter of like joints, as `m` of all thighs.
struct Gain<'a> {
    /// `m:FR_thigh`; `m (thighs)`.
    label: String,
    /// Of its joints the one with most torque to gain.
    most: &'a Advice,
}

impl Advised {
    /// The first screen: how much is identified, where a better motion gains most, and that motion. `file` is the model's.
    pub fn summary(&self, file: Option<&Path>, logs: &[PathBuf]) -> Summary {
        let count = |learned: Learned| {
            let all = self.limbs.iter().flat_map(|limb| &limb.parameters);
            all.filter(|a| a.learned == learned).count()
        };
        let [told, partly, open, never] = [
            Learned::Identified,
            Learned::InPart,
            Learned::PriorDominated,
            Learned::NotIdentifiable,
        ]
        .map(count);
        let mut points = Vec::new();
        let gains = self.gains();
        if !gains.is_empty() {
            let named = gains.iter().take(NAMED).map(Gain::words);
            points.push(format!(
                "Most torque to gain by a better motion: {}",
                named.collect::<Vec<_>>().join("; ")
            ));
        }
        if never > 0 {
            points.push(format!(
                "Never identifiable with a fixed base, but in combination: {never} more"
            ));
        }
        points.push(self.conditions());
        let next = match self.command(file, logs) {
            Some(command) => command,
            None => format!("proprio identify {}", typed(logs, file)),
        };
        Summary {
            headline: format!(
                "{told} of {} parameters identified, {partly} in part, {open} prior-dominated",
                told + partly + open
            ),
            points,
            next: vec![next],
            ..Summary::default()
        }
    }

    /// Open parameters by kind, those first whose uncertainty leaves most torque open.
    fn gains(&self) -> Vec<Gain<'_>> {
        let joints: Vec<String> = self.joints();
        let open: Vec<&Advice> = (self.limbs.iter())
            .flat_map(|limb| limb.parameters.iter().filter(|a| a.is_open()))
            .collect();
        let mut kinds: Vec<&str> = open.iter().map(|a| a.split().0).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let mut gains = Vec::new();
        for (label, members) in by_kind(&joints) {
            for kind in &kinds {
                let own = |a: &&&Advice| {
                    let (what, joint) = a.split();
                    what == *kind && members.iter().any(|member| member == joint)
                };
                let most = (open.iter().filter(own)).max_by(|a, b| a.torque.total_cmp(&b.torque));
                gains.extend(most.map(|most| Gain {
                    label: match members.len() {
                        1 => name_at(kind, &members[0]),
                        _ => format!("{kind} ({label})"),
                    },
                    most,
                }));
            }
        }
        gains.sort_by(|a, b| b.most.torque.total_cmp(&a.most.torque));
        gains
    }

    /// The joints of the limbs, in the robot's order.
    fn joints(&self) -> Vec<String> {
        let mut joints: Vec<String> = Vec::new();
        for limb in &self.limbs {
            joints.extend(limb.joints.iter().cloned());
        }
        joints
    }

    fn conditions(&self) -> String {
        let all = self.limbs.iter().map(|limb| limb.condition_number);
        let low = all.clone().fold(f64::INFINITY, f64::min);
        let high = all.fold(0.0, f64::max);
        let words = match low == high {
            true => format!("{low:.0}"),
            false => format!("{low:.0}–{high:.0}"),
        };
        format!("Condition number of the identifiable inertias: {words}")
    }

    /// The command of the limb with most torque to gain.
    fn command(&self, file: Option<&Path>, logs: &[PathBuf]) -> Option<String> {
        let most = |limb: &&LimbAdvice| {
            let open = limb.parameters.iter().filter(|a| a.is_open());
            open.map(|a| a.torque).fold(0.0, f64::max)
        };
        let limb = (self.limbs.iter())
            .filter(|limb| limb.command.is_some())
            .max_by(|a, b| most(a).total_cmp(&most(b)))?;
        let mut open: Vec<&Advice> = limb.parameters.iter().filter(|a| a.is_open()).collect();
        open.sort_by(|a, b| b.torque.total_cmp(&a.torque));
        super::command(file, &limb.limb, &open, logs)
    }
}

impl Gain<'_> {
    fn words(&self) -> String {
        let most = self.most;
        // What a motion leaves of such a parameter is rounding: only that it is so small is said.
        let best = match most.is_all_told() {
            true => format!("below ±{}", figure(NOTHING * most.prior_std)),
            false => format!("±{}", figure(most.best_std)),
        };
        format!(
            "{} ±{} → {best} {} ({:.2} N m)",
            self.label,
            figure(most.std),
            unit_of(&most.parameter),
            most.torque
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_ends_at_a_number_that_says_something() {
        let words = |best_std: f64| {
            let most = Advice {
                parameter: "hz:FR_hip".to_owned(),
                learned: Learned::PriorDominated,
                share: 0.0,
                prior_std: 1.3e-3,
                std: 9.4e-4,
                best_std,
                torque: 0.02,
            };
            let label = "hz (hips)".to_owned();
            Gain { label, most: &most }.words()
        };
        assert_eq!(
            words(2e-14),
            "hz (hips) ±9.4e-4 → below ±1.3e-5 kg m (0.02 N m)"
        );
        assert_eq!(words(2.1e-4), "hz (hips) ±9.4e-4 → ±2.1e-4 kg m (0.02 N m)");
    }
}

//! A diagnosis on one screen.

use std::path::Path;

use super::{Diagnosis, Verdict};
use crate::catalogue;
use crate::model::Robot;
use crate::summary::{Summary, joints_in_words, torque, typed, word};

/// Missing effects that the headline names.
const NAMED: usize = 4;
/// Points of a summary.
const POINTS: usize = 3;
/// A model file, where none is named.
pub(crate) const NEW_MODEL: &str = "go2.toml";

/// An effect that the path has added and not taken out again.
struct Missing {
    effect: &'static str,
    joints: Vec<String>,
    /// Held-out error before and after its largest step, N m.
    step: [f64; 2],
}

impl Diagnosis {
    /// The first screen: how far the error falls, what is missing, and the command that adds it to the model file, if one is
    /// named.
    pub fn summary(&self, robot: &Robot, model: Option<&Path>) -> Summary {
        let missing = self.missing();
        let mut points: Vec<String> = self.second_encoder.iter().take(1).cloned().collect();
        if let Some(more @ 1..) = self.second_encoder.len().checked_sub(1) {
            points[0] += &format!(" (and {more} more)");
        }
        points.extend(self.bodies.first().cloned());
        if let Some(more @ 1..) = self.bodies.len().checked_sub(1) {
            points.push(format!("{more} more bodies are not the CAD's (--verbose)"));
        }
        let all = self.joint_names();
        for one in missing
            .iter()
            .filter(|m| m.step[1] < m.step[0])
            .take(POINTS - 1)
        {
            let words = catalogue::effect_named(one.effect).map_or("", |e| e.description().words);
            let [before, after] = one.step.map(torque);
            let joints = joints_in_words(&one.joints, &all);
            points.push(format!(
                "{}, {joints}: {before} → {after} N m; {words}",
                one.effect
            ));
        }
        points.extend(self.alike());
        points.truncate(POINTS - 1);
        points.push(self.rest());
        Summary {
            headline: self.headline(&missing),
            points,
            next: vec![self.command(&missing, robot, model)],
        }
    }

    fn headline(&self, missing: &[Missing]) -> String {
        let after = self
            .path
            .last()
            .map_or(self.held_out_rms, |step| step.held_out_rms);
        let mut text = String::new();
        if !self.joints.is_empty() {
            text += &torque(self.held_out_rms);
            if !self.path.is_empty() {
                text += &format!(" → {}", torque(after));
            }
            text += &format!(
                " N m on unseen data; floor {}; ",
                torque(self.noise_floor_rms)
            );
        }
        let all = self.joint_names();
        let mut names: Vec<String> = missing
            .iter()
            .take(NAMED)
            .map(|m| format!("{} ({})", m.effect, joints_in_words(&m.joints, &all)))
            .collect();
        if missing.len() > NAMED {
            names.push(format!("{} more", missing.len() - NAMED));
        }
        text + &match (self.verdict, names.is_empty()) {
            (_, false) => format!("missing: {}", names.join(", ")),
            (Verdict::Missing, true) => {
                "missing: something that the catalogue does not have".to_owned()
            }
            (Verdict::Complete, true) => "missing: nothing".to_owned(),
            (Verdict::Insufficient, true) => "too little motion to tell what is missing".to_owned(),
        }
    }

    /// What the path has added for good, the largest fall of the error first.
    fn missing(&self) -> Vec<Missing> {
        let mut missing: Vec<Missing> = Vec::new();
        let mut before = self.held_out_rms;
        for step in &self.path {
            let after = step.held_out_rms;
            let known = missing.iter_mut().find(|m| m.effect == step.effect);
            match known {
                Some(known) if step.removed => known.joints.retain(|j| !step.joints.contains(j)),
                Some(known) => {
                    known.joints.extend(step.joints.iter().cloned());
                    if before - after > known.step[0] - known.step[1] {
                        known.step = [before, after];
                    }
                }
                None if step.removed => (),
                None => missing.push(Missing {
                    effect: step.effect,
                    joints: step.joints.clone(),
                    step: [before, after],
                }),
            }
            before = after;
        }
        missing.retain(|m| !m.joints.is_empty());
        missing.sort_by(|a, b| (b.step[0] - b.step[1]).total_cmp(&(a.step[0] - a.step[1])));
        missing
    }

    fn joint_names(&self) -> Vec<String> {
        self.joints
            .iter()
            .map(|joint| joint.joint.clone())
            .collect()
    }

    /// What the first of the missing effects cannot be told from.
    fn alike(&self) -> Option<String> {
        let best = self.candidates.iter().find(|c| c.significant)?;
        let first = best.alternatives.first()?;
        let more = match best.alternatives.len() {
            1 => String::new(),
            n => format!(" and {} more", n - 1),
        };
        Some(format!(
            "{} cannot be told apart on these data from {}:{}{more}",
            best.name(),
            first.effect,
            first.joints.join(",")
        ))
    }

    /// What is left at the end.
    fn rest(&self) -> String {
        if self.joints.is_empty() {
            return format!("no leg is judged; {}", self.next);
        }
        match (self.outside_catalogue.as_slice(), self.verdict) {
            ([], Verdict::Insufficient) => self.reason.clone(),
            ([], _) => "what is left follows nothing beyond the noise".to_owned(),
            ([one], _) => one.clone(),
            ([first, rest @ ..], _) => format!("{first} (and {} more)", rest.len()),
        }
    }

    fn command(&self, missing: &[Missing], robot: &Robot, model: Option<&Path>) -> String {
        if missing.is_empty() {
            let with = typed(&self.logs, model);
            return format!("proprio compare {with} --html report.html");
        }
        let all: Vec<&String> = robot.bodies().iter().map(|body| &body.name).collect();
        let of = |m: &Missing| -> Vec<String> {
            if all.len() > 1 && all.iter().all(|name| m.joints.contains(name)) {
                return vec![m.effect.to_owned()];
            }
            m.joints
                .iter()
                .map(|joint| format!("{}:{joint}", m.effect))
                .collect()
        };
        let effects: Vec<String> = missing.iter().flat_map(of).collect();
        let model = model.unwrap_or(Path::new(NEW_MODEL));
        format!("proprio add {} -m {}", effects.join(" "), word(model))
    }
}

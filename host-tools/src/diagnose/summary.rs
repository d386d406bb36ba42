//! A diagnosis on one screen.

use std::path::Path;

use super::{Diagnosis, FoundFormula, LoadChangeReport, Verdict};
use crate::catalogue;
use crate::model::{LINK_GEOMETRY, Robot};
use crate::summary::{POINTS, Summary, joints_in_words, torque, typed, word};

/// Kinds of missing effects that the headline names, those of every drive last and together; of more it says how many, and the points name them.
const NAMED: usize = 3;
/// A command that is no longer stands on one line of a terminal, columns.
const ONE_LINE: usize = 76;
/// A model file, where none is named.
pub(crate) const NEW_MODEL: &str = "go2.toml";

/// An effect that the path has added and not taken out again.
struct Missing {
    effect: &'static str,
    /// What it is called on a screen: a formula by its torque.
    shown: String,
    joints: Vec<String>,
    /// Held-out error before and after its largest step, N m.
    step: [f64; 2],
}

impl Missing {
    /// Whether every drive has it: friction, rotor and offset.
    fn is_plain(&self) -> bool {
        catalogue::effect_named(self.effect).is_some_and(|e| e.description().is_plain())
    }

    /// Where, for people.
    fn at(&self, all: &[String]) -> String {
        joints_in_words(&self.joints, all)
    }
}

impl Diagnosis {
    /// The first screen: how far the error falls, what is missing, and the command that adds it to the model file, if one is
    /// named.
    pub fn summary(&self, robot: &Robot, model: Option<&Path>) -> Summary {
        let missing = self.missing();
        let all = self.joint_names();
        let mut points: Vec<String> = self.changes().into_iter().collect();
        let bodies = self.bodies.split_first();
        let bodies = bodies.map(|(first, rest)| and_more(first, rest.len()));
        if self.bodies_instead {
            points.extend(bodies.clone());
        }
        let frames = self.kinematics.split_first();
        points.extend(frames.map(|(first, rest)| and_more(&first.words, rest.len())));
        points.extend(self.found_formulas());
        // What every drive has goes together, so that what few have is never folded away.
        let (drive, beyond): (Vec<&Missing>, Vec<&Missing>) =
            missing.iter().partition(|m| m.is_plain());
        match &*beyond {
            // A formula has its own point, and so have frames.
            [one] if self.is_formula(one) || one.effect == LINK_GEOMETRY => (),
            [one] => points.push(explained(one, &all)),
            beyond => points.extend(listed("beyond the drive", beyond, &all)),
        }
        if let Some((first, rest)) = self.second_encoder.split_first() {
            points.push(and_more(first, rest.len()));
        }
        if !self.bodies_instead {
            points.extend(bodies);
        }
        match &*drive {
            [one] if beyond.is_empty() => points.push(explained(one, &all)),
            drive => points.extend(listed("drive", drive, &all)),
        }
        points.extend(self.alike());
        points.truncate(POINTS - 1);
        points.push(self.rest());
        Summary {
            headline: self.headline(&missing),
            points,
            next: vec![self.command(&missing, robot, model)],
            ..Summary::default()
        }
    }

    fn headline(&self, missing: &[Missing]) -> String {
        let mut text = self.what(missing);
        text += &match self.changed.len() {
            0 => String::new(),
            1 => "Changed: 1 value of the file. ".to_owned(),
            n => format!("Changed: {n} values of the file. "),
        };
        if self.joints.is_empty() {
            return text.trim_end().to_owned();
        }
        // The CAD's bodies fitted anew are no step to speak of.
        let given = torque(self.yardsticks.given_rms);
        let mut errors = match self.has_values {
            true => vec![
                format!("{given} as given"),
                format!("{} refitted", torque(self.held_out_rms)),
            ],
            false => vec![given],
        };
        let after = self.after_rms();
        if !self.has_values || !self.path.is_empty() {
            errors.push(torque(after));
        }
        let floor = self.yardsticks.floor_words(after);
        let errors = errors.join(" → ");
        text + &match self.has_values {
            true => format!("Held-out error, N m: {errors} ({floor})"),
            false => format!("Held-out error {errors} N m ({floor})"),
        }
    }

    /// What is missing, in a sentence. What the catalogue does not have comes first: the names after it explain the less.
    fn what(&self, missing: &[Missing]) -> String {
        if self.bodies_instead {
            return "Bodies differ from the model's; no effect beyond the drive's is needed. "
                .to_owned();
        }
        let all = self.joint_names();
        let (drive, beyond): (Vec<&Missing>, Vec<&Missing>) =
            missing.iter().partition(|m| m.is_plain());
        let mut names: Vec<String> = Vec::new();
        let load = |load: &LoadChangeReport| {
            let comes = if load.mass > 0.0 { "comes" } else { "goes" };
            format!("a load that {comes} at {:.1} s ({})", load.from, load.joint)
        };
        names.extend(self.load_changes.iter().map(load));
        if self.outside_catalogue.len() > self.load_changes.len() {
            names.push("an effect outside the catalogue".to_owned());
        }
        let named = |m: &&Missing| format!("{} ({})", m.shown, m.at(&all));
        names.extend(beyond.iter().map(named));
        if names.len() > NAMED {
            let rest = names.len() - (NAMED - 1);
            names.truncate(NAMED - 1);
            names.push(format!("{rest} more effects"));
        }
        match &*drive {
            [_] => names.extend(drive.iter().map(named)),
            more if names.is_empty() && more.len() <= NAMED => {
                names.extend(more.iter().map(named));
            }
            [] => (),
            more => names.push(format!("the drive's {} effects", more.len())),
        }
        match (self.verdict, names.is_empty()) {
            (_, false) => format!("Missing: {}. ", names.join(", ")),
            (Verdict::Missing, true) => "Missing: an effect outside the catalogue. ".to_owned(),
            (Verdict::Complete, true) => "Missing: nothing. ".to_owned(),
            (Verdict::Insufficient, true) => {
                "Too little motion to say what is missing. ".to_owned()
            }
        }
    }

    /// The values of the file that the logs contradict, the surest by name.
    fn changes(&self) -> Option<String> {
        let (first, rest) = self.changed.split_first()?;
        Some(and_more(&format!("changed: {}", first.words()), rest.len()))
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
                    shown: self.shown(step.effect),
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

    /// What an effect is called on a screen: a formula by its torque.
    fn shown(&self, effect: &'static str) -> String {
        let mut formulas = self.formulas.iter();
        let formula = formulas.find(|formula| formula.effect == effect);
        formula.map_or_else(|| effect.to_owned(), |formula| formula.torque.clone())
    }

    fn is_formula(&self, one: &Missing) -> bool {
        self.formulas
            .iter()
            .any(|formula| formula.effect == one.effect)
    }

    /// The formulas that were found, in words.
    fn found_formulas(&self) -> Option<String> {
        let (first, rest) = self.formulas.split_first()?;
        Some(and_more(&first.words(), rest.len()))
    }

    pub(crate) fn joint_names(&self) -> Vec<String> {
        self.joints
            .iter()
            .map(|joint| joint.joint.clone())
            .collect()
    }

    /// What the first of the missing effects cannot be told from.
    fn alike(&self) -> Option<String> {
        let best = self.candidates.iter().find(|c| c.significant)?;
        let first = best.alternatives.first()?;
        let words = format!(
            "{} is a look-alike on these data: {}:{}",
            best.name(),
            first.effect,
            first.joints.join(",")
        );
        Some(and_more(&words, best.alternatives.len() - 1))
    }

    /// What is left at the end.
    fn rest(&self) -> String {
        if self.joints.is_empty() {
            return format!("no leg is judged; {}", self.next);
        }
        match (self.outside_catalogue.as_slice(), self.verdict) {
            ([], Verdict::Insufficient) => self.reason.clone(),
            // Without a floor noise is what neighbours in time do not share: less than that tells.
            ([], _) if self.yardsticks.noise_floor_rms.is_none() => {
                "the residual shows no structure; without a noise floor more may be missing"
                    .to_owned()
            }
            ([], _) => match self.yardsticks.times_floor(self.after_rms()) {
                Some(times) => {
                    format!("the residual is {times:.1} times the noise, but shows no structure")
                }
                None => "no structure is left above the noise".to_owned(),
            },
            ([first, rest @ ..], _) => and_more(first, rest.len()),
        }
    }

    fn command(&self, missing: &[Missing], robot: &Robot, model: Option<&Path>) -> String {
        if let Some(load) = self.load_changes.first() {
            // One model holds for each part.
            let with = typed(&self.logs, model);
            return format!("proprio diagnose {with} --only 't < {:.1}'", load.from);
        }
        if self.bodies_instead && missing.iter().all(|m| !m.is_plain()) {
            let with = typed(&self.logs, model);
            return format!("proprio identify {with} -o refitted.toml");
        }
        if missing.is_empty() && !self.changed.is_empty() {
            let with = typed(&self.logs, model);
            return format!("proprio identify {with} -o refitted.toml");
        }
        if missing.is_empty() {
            let with = typed(&self.logs, model);
            return format!("proprio compare {with} --html report.html");
        }
        let all: Vec<&String> = robot.bodies().iter().map(|body| &body.name).collect();
        let of = |m: &Missing| -> Vec<String> {
            if all.len() > 1 && all.iter().all(|name| m.joints.contains(name)) {
                return vec![m.effect.to_owned()];
            }
            let of = |joint: &String| {
                let mut formulas = self.formulas.iter();
                let formula = formulas.find(|f| (f.effect, &f.joint) == (m.effect, joint));
                formula.map_or_else(|| format!("{}:{joint}", m.effect), FoundFormula::to_add)
            };
            m.joints.iter().map(of).collect()
        };
        // Where a body explains as much, what the drive has is added alone, and `identify` fits the body.
        let added = missing
            .iter()
            .filter(|m| !self.bodies_instead || m.is_plain());
        let effects: Vec<String> = added.flat_map(of).collect();
        let model = word(model.unwrap_or(Path::new(NEW_MODEL)));
        let add = format!("proprio add {} -m {model}", effects.join(" "));
        // Where frames are no list of effects says.
        if add.chars().count() <= ONE_LINE && self.kinematics.is_empty() {
            return add;
        }
        let logs = typed(&self.logs, None);
        format!("proprio diagnose {logs} --apply -m {model}")
    }
}

/// A sentence, and how many more there are.
fn and_more(sentence: &str, more: usize) -> String {
    match more {
        0 => sentence.to_owned(),
        more => format!("{sentence} (and {more} more)"),
    }
}

/// One effect with what it is.
fn explained(one: &Missing, all: &[String]) -> String {
    let words = catalogue::effect_named(one.effect).map_or("", |e| e.description().words);
    let [before, after] = one.step.map(torque);
    let at = one.at(all);
    match one.step[1] < one.step[0] {
        true => format!("{}, {at}: {before} → {after} N m; {words}", one.shown),
        false => format!("{}, {at}: {words}", one.shown),
    }
}

/// Several effects, each with the error after its largest step; where all are at the same joints, these once.
fn listed(what: &str, effects: &[&Missing], all: &[String]) -> Option<String> {
    let first = effects.first()?;
    let same = effects.iter().all(|m| m.at(all) == first.at(all));
    let one = |m: &&Missing| {
        let at = match same {
            true => String::new(),
            false => format!(" ({})", m.at(all)),
        };
        let [before, after] = m.step.map(torque);
        let after = match before == after {
            true => String::new(),
            false => format!(" → {after}"),
        };
        format!("{}{at}{after}", m.shown)
    };
    let mut effects = effects.to_vec();
    effects.sort_by(|a, b| b.step[1].total_cmp(&a.step[1]));
    let list: Vec<String> = effects.iter().map(one).collect();
    let at = match same {
        true => format!(", {}", first.at(all)),
        false => String::new(),
    };
    Some(format!("{what}{at}: {}", list.join(", ")))
}

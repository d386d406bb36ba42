//! A diagnosis for humans.

use std::fmt;

use proprio_core::effect::Form;

use super::{CandidateReport, Diagnosis, FoundFrame, PathStep, Verdict};
use crate::catalogue;
use crate::detect::black_box::{Explained, Inputs};
use crate::detect::frame::OtherFrame;
use crate::detect::load_change::LoadChange;
use crate::detect::twist::{Beside, Twist};
use crate::identify::OtherBody;
use crate::parameter::told;
use crate::select::criteria::{LEAST_Z, STRUCTURE};
use crate::select::drift::Drift;
use crate::table::{Table, with_std};

/// Candidates shown.
const SHOWN: usize = 8;
/// Logs that have a column in the ladder.
const MOST_LOGS_SHOWN: usize = 12;

impl Diagnosis {
    /// The way to a model that lacks nothing, one line per step with the error after it: of all data and, where each of several
    /// logs is held out, of each log as the others predict it.
    pub fn ladder(&self) -> String {
        let mut table = Table::default();
        let mut text = String::new();
        let heads = ["step", "held-out rms N m", "change"].map(str::to_owned);
        let shown = self.log_rms.len().min(MOST_LOGS_SHOWN);
        let letters = ('a'..='z').map(String::from).take(shown);
        table.row(heads.into_iter().chain(letters.clone()));
        let logs = |rms: &[f64]| -> Vec<String> {
            let rms = rms.iter().take(shown);
            rms.map(|rms| format!("{rms:.4}")).collect()
        };
        let given = self.yardsticks.given_rms;
        table.row(["the model as given".to_owned(), format!("{given:.4}")]);
        let start = [
            "its values fitted anew".to_owned(),
            format!("{:.4}", self.held_out_rms),
            format!("{:+.1} %", 100.0 * (self.held_out_rms / given - 1.0)),
        ];
        table.row(start.into_iter().chain(logs(&self.log_rms)));
        let mut before = self.held_out_rms;
        for step in &self.path {
            let change = 100.0 * (step.held_out_rms / before - 1.0);
            let cells = [
                step.to_string(),
                format!("{:.4}", step.held_out_rms),
                format!("{change:+.1} %"),
            ];
            table.row(cells.into_iter().chain(logs(&step.log_rms)));
            before = step.held_out_rms;
        }
        if let Some(floor) = self.yardsticks.floor_beside(self.after_rms()) {
            table.row(["noise floor".to_owned(), format!("{floor:.4}")]);
        }
        for (letter, log) in letters.zip(&self.logs) {
            text += &format!(
                "{letter}: {}, as the other logs predict it\n",
                log.display()
            );
        }
        if self.log_rms.len() > shown {
            text += "Of the other logs --json has each one's error.\n";
        }
        if !text.is_empty() {
            text.push('\n');
        }
        format!("{table}\n{text}{}", self.verdict_words())
    }

    fn verdict_words(&self) -> String {
        let verdict = match self.verdict {
            Verdict::Missing => "MISSING",
            Verdict::Complete => "COMPLETE",
            Verdict::Insufficient => "INSUFFICIENT",
        };
        let mut text = format!("{verdict}: {}\nNext: {}\n", self.reason, self.next);
        for changed in &self.changed {
            text += &format!("Changed: {}\n", changed.words());
        }
        for sentence in &self.second_encoder {
            text += &format!("{sentence}\n");
        }
        for formula in &self.formulas {
            text += &format!("{}\n", formula.words());
        }
        let frames = self.kinematics.iter().map(|frame| &frame.words);
        for sentence in frames.chain(&self.bodies).chain(&self.outside_catalogue) {
            text += sentence;
            text.push('\n');
        }
        text
    }
}

/// Bodies that are not the CAD's; `as_well`: without the effects beyond those of every drive.
pub(super) fn bodies(bodies: &[OtherBody], as_well: bool) -> Vec<String> {
    let told = |body: &OtherBody| match as_well {
        true => format!("{body}; so the drives' own effects predict as well as all that is named"),
        false => body.to_string(),
    };
    bodies.iter().map(told).collect()
}

impl fmt::Display for PathStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.removed { '-' } else { '+' };
        write!(f, "{sign} {} {}", self.effect, self.joints.join(" "))
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::default();
        let heads = ["effect", "held-out gain %", "z", "value", "unit", ""];
        table.row(heads.map(str::to_owned));
        for candidate in self.candidates.iter().take(SHOWN) {
            table.row(candidate.cells());
        }
        write!(f, "{table}")?;
        if let Some(best) = self
            .candidates
            .iter()
            .find(|c| c.significant && !c.alternatives.is_empty())
        {
            let names: Vec<String> = best
                .alternatives
                .iter()
                .map(|a| format!("{}:{}", a.effect, a.joints.join(",")))
                .collect();
            writeln!(
                f,
                "\n{} cannot be separated on these data from: {}",
                best.name(),
                names.join(", ")
            )?;
        }
        let after = self.after_rms();
        writeln!(
            f,
            "\nHeld-out error {:.4} N m; {after:.4} with {} added; {}.",
            self.held_out_rms,
            counted(self.path.len()),
            self.yardsticks.floor_words(after),
        )?;
        write!(f, "{}", self.verdict_words())
    }
}

/// Why the verdict, and what to do next.
pub(super) fn reason(
    verdict: Verdict,
    (candidates, frames): (&[CandidateReport], &[FoundFrame]),
    outside: &[String],
    still: &[&str],
) -> (String, String) {
    if let ([frame, ..], true) = (frames, outside.is_empty()) {
        return (
            frame.words.clone(),
            "proprio calibrate with measured poses, or diagnose with --apply for what these logs say".to_owned(),
        );
    }
    let best = candidates.iter().find(|c| c.significant);
    match (verdict, best) {
        (Verdict::Missing, Some(best)) if outside.is_empty() => (
            format!("{} is missing: {}", best.name(), best.words()),
            format!("proprio add {} -m MODEL, then compare", best.name()),
        ),
        (Verdict::Missing, Some(best)) => (
            format!("{} is the nearest effect of the catalogue, but something outside it is missing too", best.name()),
            "look at where the rest of the error lives; `proprio compare` shows it against q, q̇, load and time".to_owned(),
        ),
        (Verdict::Missing, None) => (
            "something is missing that the catalogue does not have".to_owned(),
            "look at where the error lives; `proprio compare` shows it against q, q̇, load and time".to_owned(),
        ),
        (Verdict::Insufficient, _) => (
            format!("{} hardly moves, so that nothing can be said of it", still.join(", ")),
            "record motion of all joints at several speeds".to_owned(),
        ),
        (Verdict::Complete, _) => (
            "no effect of the catalogue reduces the held-out error significantly".to_owned(),
            "nothing: the model explains these data".to_owned(),
        ),
    }
}

/// Where a joint's frame is, that is not where the description has it.
pub(super) fn frame(joint: &str, frame: &OtherFrame) -> String {
    let [size, std] = frame.size();
    let off = match frame.is_turned() {
        true => format!(
            "turned by {}°",
            with_std(size.to_degrees(), std.to_degrees())
        ),
        false => format!("displaced by {} mm", with_std(1e3 * size, 1e3 * std)),
    };
    format!(
        "{joint}: the joint's frame is {off} against the description: the kinematics differ (`proprio calibrate` measures them)"
    )
}

/// What is said of an effect that would explain much with a value that cannot be.
pub(super) fn unphysical(candidate: &CandidateReport) -> String {
    format!(
        "{} would take away {:.0} % of the squared error with a value that cannot be ({} {}): something that is not in the \
         catalogue looks like it",
        candidate.effect,
        100.0 * candidate.held_out_gain,
        // As it is: the stiffness of a negative compliance is none.
        with_std(candidate.value, candidate.std),
        candidate.parameters[0].unit,
    )
}

/// What a joint's two encoders say of its gear.
pub(super) fn twist(joint: &str, twist: &Twist) -> String {
    let number = |[value, std]: [f64; 2], unit: &str| format!("{} {unit}", with_std(value, std));
    let spring = format!("a spring of {}", number(twist.stiffness, "N m/rad"));
    let (gear, what) = match twist.beside {
        None => (spring, "the torque between them"),
        Some(Beside::Hysteresis {
            friction,
            displacement,
        }) => {
            let (inside, over) = (number(friction, "N m"), number(displacement, "rad"));
            let gear =
                format!("{spring} with friction of {inside} inside it, built up over {over}");
            (gear, "the torque between them")
        }
        Some(Beside::Backlash { gap }) => {
            (format!("a gap of {}", number(gap, "rad")), "that motion")
        }
    };
    format!(
        "{joint}'s second encoder: link and motor turn against each other by {:.2} mrad rms; {gear} explains {:.0} % of {what}",
        1e3 * twist.rms,
        100.0 * twist.told[0]
    )
}

/// What is said of a joint of whose error a black box takes away more than what noise and sampling leave to it; `None` of another.
pub(super) fn black_box(taken: &Explained) -> Option<String> {
    if taken.share < STRUCTURE || taken.share < LEAST_Z * taken.std {
        return None;
    }
    let sees = match taken.sees {
        Inputs::Joint => "the joint's position, velocity, acceleration and load at that moment",
        Inputs::Limb => "the motion of its limb at that moment",
        Inputs::Past => "what its limb did before",
    };
    Some(format!(
        "a non-parametric bound from {sees}, without the measured torque, explains {:.0} ±{:.0} % of the squared residual; no effect of the \
         catalogue does",
        100.0 * taken.share,
        100.0 * taken.std,
    ))
}

/// What is said of joints with windows that are large alone.
pub(super) fn alone(joints: &[String]) -> String {
    format!(
        "{}: a few windows carry much of the squared error and follow nothing: noise that is larger at times, readings of torque that jump, or knocks",
        joints.join(", ")
    )
}

/// A load that comes or goes.
pub(super) fn load_change(change: &LoadChange) -> String {
    let [mass, error] = change.mass;
    let more = if mass > 0.0 { "more" } else { "less" };
    let from = format!("{:.1}", change.from);
    format!(
        "its link carries {} kg {more} from {from} s on; `--only 't < {from}'` and `--only 't > {from}'` take the parts of the log.",
        with_std(mass.abs(), error)
    )
}

/// What is said of a parameter that changes with time.
pub(super) fn drift(drift: &Drift, by_log: bool) -> String {
    let parameter = &drift.effect.description().parameters[0];
    let [least, most] = drift.range;
    let (scale, unit) = match drift.effect.description().form {
        Form::Scale => (100.0, "%"),
        _ => (1.0, parameter.unit),
    };
    let (changes, fold) = if by_log {
        ("differs from log to log", "log")
    } else {
        ("changes with time", "stretch of the log")
    };
    format!(
        "{} {changes}, by {:+.2} {unit} in one {fold} and {:+.2} {unit} in another: warming, wear, a supply that sags, or what the \
         model lacks at the speeds of one of them",
        drift.effect.name(),
        scale * least,
        scale * most,
    )
}

fn counted(steps: usize) -> String {
    match steps {
        0 => "nothing".to_owned(),
        1 => "one effect".to_owned(),
        n => format!("{n} steps of effects (--apply shows them)"),
    }
}

impl CandidateReport {
    /// `coulomb:FR_calf`.
    pub fn name(&self) -> String {
        format!("{}:{}", self.effect, self.joints.join(","))
    }

    /// What the effect is, in words.
    fn words(&self) -> &'static str {
        catalogue::effect_named(self.effect).map_or("", |effect| effect.description().words)
    }

    fn cells(&self) -> [String; 6] {
        let note = match (self.in_bounds, self.significant) {
            (false, _) => "not physical",
            (true, true) => "significant",
            (true, false) => "",
        };
        let [value, unit] = told(self.value, self.std, self.parameters[0].unit);
        [
            self.name(),
            format!(
                "{:.1} ±{:.1}",
                100.0 * self.held_out_gain,
                100.0 * self.held_out_gain_error
            ),
            format!("{:.1}", self.z),
            value,
            unit,
            note.to_owned(),
        ]
    }
}

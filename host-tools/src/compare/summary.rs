//! A comparison on one screen.

use std::path::Path;

use super::words::named;
use super::{Comparison, black_box};
use crate::detect::residual::Criticism;
use crate::robust;
use crate::summary::{Summary, torque, typed};

/// Points of a summary.
const POINTS: usize = 3;
/// A pattern with less of the square error is no point, %.
const LEAST_PERCENT: f64 = 1.0;
/// Share of the square error above the noise from which on a model is worth a diagnosis, %.
const WORTH_A_DIAGNOSIS: f64 = 20.0;

/// Of a residual in which no test finds anything.
pub(super) const NO_STRUCTURE: &str = "The residual has no structure above the noise: it follows no position, velocity, acceleration, load, temperature or time";
/// A joint of whose squared error patterns explain less is not explained.
const EXPLAINED: f64 = 0.5;
/// A joint with so much of all joints' squared error is worth a sentence though no pattern explains it, %.
const OUTSTANDING_PERCENT: f64 = 20.0;
/// So many times the median joint's error stands out where a log is too short for the tests: normal noise of twelve joints alike is within 1.5 of their
/// median, and motors of one robot differ by less in size.
const STANDS_OUT: f64 = 4.0;

impl Comparison {
    /// Joints with much of the error that no pattern explains, a sentence each: those whose residual is structured, or far larger than other joints'.
    pub(super) fn unexplained(&self) -> Vec<String> {
        let square = |c: &Criticism| c.scores.rms.powi(2) * c.scores.n as f64;
        let all: f64 = self.criticism.iter().map(square).sum();
        let told = |c: &&Criticism| {
            let explained: f64 = c.patterns.iter().map(|pattern| pattern.share).sum();
            let others = self.criticism.iter().filter(|o| o.joint != c.joint);
            let usual = robust::median(others.map(|o| o.scores.rms)).unwrap_or(f64::INFINITY);
            let structured =
                c.structure() > EXPLAINED || c.whiteness.as_ref().is_some_and(|w| !w.white);
            explained < EXPLAINED
                && 100.0 * square(c) >= OUTSTANDING_PERCENT * all
                && (structured || c.scores.rms > STANDS_OUT * usual)
        };
        let words = |c: &Criticism| {
            let share = 100.0 * square(c) / all.max(f64::MIN_POSITIVE);
            let structure = match c.structure() {
                structure if structure > 0.0 => {
                    format!("{:.0} % of it is structure", 100.0 * structure)
                }
                _ if c.whiteness.as_ref().is_some_and(|w| !w.white) => {
                    "its residual is not white".to_owned()
                }
                _ => "far more than the other joints leave".to_owned(),
            };
            format!(
                "{share:.0} % of the square error: {}, {} N m rms: {structure}, and no simple pattern explains it",
                c.joint,
                torque(c.scores.rms)
            )
        };
        self.criticism.iter().filter(told).map(words).collect()
    }

    /// The first screen: how large the error is, where it lives, and what to ask next.
    pub fn summary(&self, model: Option<&Path>) -> Summary {
        let mut points: Vec<String> = self.contact_sentences().into_iter().take(1).collect();
        let patterns = self
            .patterns
            .iter()
            .filter(|p| p.share_percent >= LEAST_PERCENT);
        points.extend(patterns.map(|p| {
            format!(
                "{:.0} % of the square error: {}",
                p.share_percent, p.sentence
            )
        }));
        points.extend(self.unexplained());
        if points.is_empty() {
            points.push(NO_STRUCTURE.to_owned());
        }
        points.truncate(POINTS - usize::from(self.black_box.is_some()));
        points.extend(self.black_box.as_ref().map(black_box::sentence));
        let with = typed(&self.logs, model);
        let lacks = self
            .yardsticks
            .above_noise_percent
            .is_none_or(|share| share > WORTH_A_DIAGNOSIS);
        let next = match (lacks, model) {
            (true, _) => format!("proprio diagnose {with}"),
            (false, _) => format!("proprio identify {with}"),
        };
        Summary {
            headline: self.first_line(),
            points,
            next: vec![next],
        }
    }

    fn first_line(&self) -> String {
        let yardsticks = &self.yardsticks;
        let mut text = match yardsticks.before_rms {
            Some(before) => format!("Error {} → {} N m rms", torque(before), torque(self.rms)),
            None => format!("Error {} N m rms", torque(self.rms)),
        };
        if !self.added.is_empty() {
            text += &format!(" with {}", named(&self.added));
        }
        if !self.left_out.is_empty() {
            text += &format!(" without {}", named(&self.left_out));
        }
        let mut beside = vec![
            format!("CAD alone {}", torque(yardsticks.cad_rms)),
            format!("no model {}", torque(yardsticks.zero_rms)),
        ];
        if let Some(floor) = yardsticks.noise_floor_rms {
            let most = match yardsticks.noise_floor_is_upper_bound {
                true => "at most ",
                false => "",
            };
            beside.push(format!("noise floor {most}{}", torque(floor)));
        }
        format!("{text} ({})", beside.join(", "))
    }
}

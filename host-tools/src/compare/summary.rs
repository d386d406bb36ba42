//! A comparison on one screen.

use std::path::Path;

use super::text::{NO_STRUCTURE, WORTH_A_DIAGNOSIS, named};
use super::{Comparison, black_box};
use crate::summary::{POINTS, Summary, export_command, torque, typed};

/// A pattern with less of the square error is no point, %.
const LEAST_PERCENT: f64 = 1.0;

impl Comparison {
    /// The first screen: how large the error is, where it lives, and what to ask next.
    pub fn summary(&self, model: Option<&Path>) -> Summary {
        let mut points: Vec<String> = self.elastic.iter().cloned().collect();
        points.extend(self.contact_sentences().into_iter().take(1));
        let patterns = self
            .patterns
            .iter()
            .filter(|p| p.share_percent >= LEAST_PERCENT);
        let patterns = patterns.map(|p| {
            let words = format!(
                "{:.0} % of the square error: {}",
                p.share_percent, p.sentence
            );
            (p.share_percent, words)
        });
        let mut shares: Vec<(f64, String)> = patterns.chain(self.unexplained()).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0));
        points.extend(shares.into_iter().map(|(_, words)| words));
        let has_structure = !points.is_empty();
        if !has_structure {
            points.push(NO_STRUCTURE.to_owned());
        }
        let bound = self.black_box.as_ref().filter(|boxes| boxes.is_known());
        points.truncate(POINTS - usize::from(bound.is_some()));
        points.extend(bound.map(black_box::sentence));
        let with = typed(&self.logs, model);
        let lacks =
            (self.above_noise_percent).map_or(has_structure, |share| share > WORTH_A_DIAGNOSIS);
        let next = match (lacks, model) {
            _ if self.elastic.is_some() => format!("proprio frf {with}"),
            (true, _) => format!("proprio diagnose {with}"),
            // A model that lacks nothing, by its own values: it is ready for use.
            (false, Some(model)) if !self.fitted => export_command(model),
            (false, _) => format!("proprio identify {with}"),
        };
        Summary {
            headline: self.first_line(),
            points,
            next: vec![next],
            ..Summary::default()
        }
    }

    fn first_line(&self) -> String {
        let yardsticks = &self.yardsticks;
        let mut text = match self.before_rms {
            Some(before) => format!("Error {} → {} N m rms", torque(before), torque(self.rms)),
            None => format!("Error {} N m rms", torque(self.rms)),
        };
        if !self.added.is_empty() {
            text += &format!(" with {}", named(&self.added));
        }
        if !self.left_out.is_empty() {
            text += &format!(" without {}", named(&self.left_out));
        }
        let beside = [
            format!("CAD alone {}", torque(yardsticks.cad_rms)),
            format!("no model {}", torque(yardsticks.zero_rms)),
            yardsticks.floor_words(self.rms),
        ];
        format!("{text} ({})", beside.join(", "))
    }
}

//! A fit of a model on one screen.

use std::path::Path;

use super::result::Fitted;
use super::text::{between, unphysical};
use crate::estimate::ParameterEstimate;
use crate::identify::screen;
use crate::summary::{POINTS, Summary, from_standard_input, torque, typed};
use crate::table::RangeValue;

impl Fitted {
    /// The first screen: the error, what every drive has, what is not identified. `file`: the model that was fitted; `written`: the file
    /// that has the values.
    pub fn summary(&self, file: Option<&Path>, written: Option<&Path>) -> Summary {
        let all: Vec<&ParameterEstimate> = self.parameters.iter().map(|p| &p.estimate).collect();
        let joints = self.joint_names();
        let mut impossible = String::new();
        // Writing into a String cannot fail.
        let _ = unphysical(&mut impossible, &self.parameters);
        let runs = self.consistency.iter().filter(|c| !c.consistent).count();
        let time = match (runs, self.runs.is_empty()) {
            (0, false) => "The logs agree.".to_owned(),
            (0, true) => between(&self.parameters),
            (n, _) => format!(
                "The logs disagree beyond chance on {n} of {} parameters, {} the most.",
                self.consistency.len(),
                self.consistency[0].parameter
            ),
        };
        let check = screen::check(written);
        let points = [
            impossible,
            screen::other_effects(&all, &joints).unwrap_or_default(),
            screen::not_identified(&all, &joints).unwrap_or_default(),
            format!("{} {time}{check}", screen::bodies(&all)),
        ];
        let points = points.into_iter().filter(|point| !point.is_empty());
        let next = match written {
            _ if from_standard_input(&self.logs) => None,
            Some(written) => Some(screen::next_of_written(&all, written)),
            None => Some(format!("proprio advise {}", typed(&self.logs, file))),
        };
        Summary {
            headline: self.first_line(),
            rows: screen::drive_rows(&joints, |name| self.parameter(name).map(RangeValue::from)),
            points: points.take(POINTS).collect(),
            next: next.into_iter().collect(),
        }
    }

    fn first_line(&self) -> String {
        let fitted = torque(self.rms);
        let error = match self.held_out_rms {
            Some(held_out) => format!(
                "Held-out error {} N m (fitted data {fitted}",
                torque(held_out)
            ),
            None => format!("Error {fitted} N m (fitted data"),
        };
        format!(
            "Fitted {} parameters. {error}, CAD {}, {})",
            self.parameters.len(),
            torque(self.yardsticks.cad_rms),
            self.yardsticks
                .floor_words(self.held_out_rms.unwrap_or(self.rms))
        )
    }

    /// The joints whose values there are, in the order of the robot's.
    fn joint_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for parameter in self.parameters.iter().filter(|p| p.estimate.is_inertial()) {
            let joint = parameter.estimate.name.split(':').nth(1);
            let joint = joint.unwrap_or_default();
            if names.last().is_none_or(|last| last != joint) {
                names.push(joint.to_owned());
            }
        }
        names
    }
}

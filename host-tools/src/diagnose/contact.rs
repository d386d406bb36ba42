//! What a contact means for a diagnosis, in words.

use super::{CandidateReport, ParameterReport};
use crate::detect::contact::Contact;

impl Contact {
    /// For the list of candidates; `joint` carries the foot.
    pub(super) fn report(&self, joint: String) -> CandidateReport {
        let number = |symbol, unit, value, std| ParameterReport {
            symbol,
            unit,
            value,
            std,
        };
        let mut parameters = vec![
            number("force", "N", self.force, self.std),
            number("share of time", "1", self.share, 0.0),
            number("episodes", "1", self.episodes as f64, 0.0),
            number("share pushing", "1", self.pushing, 0.0),
        ];
        if let Some(sensor) = self.sensor {
            parameters.push(number("correlation with foot sensor", "1", sensor, 0.0));
        }
        CandidateReport {
            effect: Self::EFFECT.name(),
            joints: vec![joint],
            held_out_gain: self.gain,
            held_out_gain_error: self.gain_error,
            z: self.z,
            value: self.force,
            std: self.std,
            parameters,
            torque_error_percent: 0.0,
            in_bounds: true,
            significant: true,
            alternatives: Vec::new(),
        }
    }
}

/// Why contact is the verdict, and what to do next.
pub(crate) fn reason(candidates: &[CandidateReport], base_moves: bool) -> (String, String) {
    let contacts: Vec<String> = candidates
        .iter()
        .filter(|c| c.effect == Contact::EFFECT.name())
        .map(|c| {
            let percent = 100.0 * c.parameters[1].value;
            let joint = c.joints.join(", ");
            format!("{joint} ({:.0} N up, {percent:.0} % of the time)", c.value)
        })
        .collect();
    let why = format!(
        "contact is missing: a force pushes on the foot at {}, and no friction or load explains it",
        contacts.join(", ")
    );
    let next = if base_moves {
        "record the robot hung in the air; a Go2 that walks is for --free-base, which wants gyro/ and acc/ columns; --anyway judges the swing"
    } else {
        "record the robot hung in the air, or judge the rest by the swing alone as here"
    };
    (why, next.to_owned())
}

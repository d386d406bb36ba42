//! What a contact means for the rest of a diagnosis.

use proprio_core::effect::EffectKind;

use super::super::diagnosis::{CandidateReport, ParameterReport};
use super::super::limb::LimbCriticism;
use super::Contact;

/// Windows of swing that the other effects need at least: 4 s.
const LEAST_WINDOWS: f64 = 200.0;

/// A limb in contact, whose windows in contact have been left out.
#[derive(Debug, Clone)]
pub(crate) struct LeftOut {
    pub(crate) contact: Contact,
    /// Whether the model has the contact already.
    pub(crate) known: bool,
    /// Held-out sum of squares of each joint over all windows, times the share of the windows that remain, (N m)².
    pub(crate) before: Vec<f64>,
    /// The same over the windows that remain.
    pub(crate) after: Vec<f64>,
    /// Whether too few windows remain to judge any other effect.
    pub(crate) too_little_swing: bool,
}

/// Looks for a contact; where there is one, leaves its windows out of all that follows.
pub(crate) fn leave_out_contact(limb: &mut LimbCriticism) -> Option<LeftOut> {
    let contact = Contact::of(limb).filter(Contact::is_significant)?;
    let last = limb.recording.joints - 1;
    let rows = |limb: &LimbCriticism| -> Vec<f64> { limb.all.iter().map(|f| f.rows()).collect() };
    let (all, before) = (rows(limb), limb.fit.held_out_squares.by_joint.clone());
    limb.in_contact.clone_from(&contact.samples);
    // Its noise was that of forces.
    limb.fit.noise.clear();
    limb.rebuild();
    limb.scan_shapes();
    let left = rows(limb);
    let folds = limb.tests.len() as f64;
    let is_bare = |fold: &Vec<_>| {
        let fold: &[super::super::blocks::HeapFactor] = fold;
        fold.iter()
            .any(|joint| joint.rows() < LEAST_WINDOWS / folds / 2.0)
    };
    Some(LeftOut {
        known: limb.active.contains(&(EffectKind::Contact, last)),
        before: (before.iter().zip(&left).zip(&all))
            .map(|((rss, left), all)| rss * left / all.max(1.0))
            .collect(),
        after: limb.fit.held_out_squares.by_joint.clone(),
        too_little_swing: left.iter().any(|n| *n < LEAST_WINDOWS) || limb.tests.iter().any(is_bare),
        contact,
    })
}

impl Contact {
    /// For the list of candidates; `joint` carries the foot.
    pub(crate) fn report(&self, joint: String) -> CandidateReport {
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
            effect: EffectKind::Contact.name(),
            joints: vec![joint],
            held_out_gain: self.gain,
            held_out_gain_error: self.gain_error,
            z: self.z,
            value: self.force,
            std: self.std,
            parameters,
            in_bounds: true,
            significant: true,
            alternatives: Vec::new(),
        }
    }
}

/// Why contact is the verdict, and what to do next.
pub(crate) fn reason(candidates: &[CandidateReport]) -> (String, String) {
    let contacts: Vec<String> = candidates
        .iter()
        .filter(|c| c.effect == EffectKind::Contact.name())
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
    let next = "record the robot hung in the air, or judge the rest by the swing alone as here";
    (why, next.to_owned())
}

/// What a user should know of the rest of a diagnosis; each limb in contact with the joint that carries its foot.
pub(crate) fn words(limbs: &[(String, LeftOut)]) -> Vec<String> {
    let mut words = Vec::new();
    let names = |chosen: &dyn Fn(&LeftOut) -> bool| -> String {
        let names = limbs.iter().filter(|(_, left)| chosen(left));
        names
            .map(|(name, _)| name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let all = names(&|_| true);
    if !all.is_empty() {
        words.push(format!(
            "{all}: windows in which the foot carries a force are left out; every other effect is judged in swing only"
        ));
    }
    if limbs.len() > 1 {
        words.push(
            "more than one leg carries a force: the robot stands or walks, and its base moves, which this model takes as pinned. \
             Stance cannot be modelled without an IMU's data, and effects found in swing may be the base's motion: \
             confirm them with the robot hung in the air"
                .to_owned(),
        );
    }
    let little = names(&|left| left.too_little_swing);
    if !little.is_empty() {
        words.push(format!(
            "{little}: insufficient for any other effect, too little swing is left"
        ));
    }
    let guessed = names(&|left| !left.contact.described);
    if !guessed.is_empty() {
        words.push(format!(
            "{guessed}: the robot's description has no foot (a link fixed to the last body); the last body's centre of mass stands for it"
        ));
    }
    words
}

//! Forces at feet: found as a diagnosis finds them, left out of what is compared, and told.

use std::fmt;

use serde::Serialize;

use crate::detect::contact::{LeftOut, words};
use crate::detect::residual::Criticism;
use crate::model::Model;
use crate::recording::Recording;
use crate::table::with_std;

/// A force of the ground at a leg's foot; the windows under it are left out of all that is compared.
#[derive(Debug, Clone, Serialize)]
pub struct FootForce {
    /// The joint that carries the foot.
    pub joint: String,
    /// Upward force while there is one, N: its mean over episodes.
    pub force: f64,
    /// Standard deviation of that, N.
    pub std: f64,
    /// Share of time in which there is one, %.
    pub time_percent: f64,
    /// How often it comes.
    pub episodes: usize,
    /// Whether the model has `contact` at this foot.
    pub known: bool,
    /// Whether too little swing is left to judge the leg: its scores are told, no patterns, noise floor or moments.
    pub too_little_swing: bool,
    /// All joints of the leg.
    #[serde(skip)]
    leg: Vec<String>,
}

/// Of each limb of a recording, the force at its foot.
pub(super) type Feet = Vec<Option<LeftOut>>;

/// The forces that were found, and what they mean, a sentence each.
pub(super) fn told(
    feet: &Feet,
    recording: &Recording,
    model: &Model,
) -> (Vec<FootForce>, Vec<String>) {
    let (mut forces, mut left_out) = (Vec::new(), Vec::new());
    for ((limb, _), foot) in recording.limbs.iter().zip(feet) {
        let Some(foot) = foot else { continue };
        let leg = limb.bodies.clone().map(|b| model.joint_name(b).to_owned());
        let leg: Vec<String> = leg.collect();
        let joint = leg.last().cloned().unwrap_or_default();
        left_out.push((joint.clone(), foot.clone()));
        forces.push(FootForce {
            joint,
            force: foot.contact.force,
            std: foot.contact.std,
            time_percent: 100.0 * foot.contact.share,
            episodes: foot.contact.episodes,
            known: foot.known,
            too_little_swing: foot.too_little_swing,
            leg,
        });
    }
    (forces, words(&left_out, false))
}

/// Takes back what a criticism cannot know beside such forces: of a leg with too little swing all but its scores; and where
/// more than one leg carries a force the base moves, which errs like friction, a spring or a load and is none.
pub(super) fn restrain(criticism: &mut [Criticism], forces: &[FootForce]) {
    for joint in criticism {
        let of_leg = |force: &&FootForce| force.leg.contains(&joint.joint);
        if forces.iter().any(|f| f.too_little_swing && of_leg(&f)) {
            *joint = joint.scores_only();
        } else if forces.len() > 1 {
            joint.withhold_causes();
        }
    }
}

impl fmt::Display for FootForce {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: a force of {} N pushes on the foot {:.0} % of the time, {}; that time is left out",
            self.joint,
            with_std(self.force, self.std),
            self.time_percent,
            if self.known {
                "as the model has it"
            } else {
                "which the model does not have"
            }
        )?;
        if self.too_little_swing {
            write!(
                f,
                ", and too little swing is left to judge {}",
                self.leg.join(", ")
            )?;
        }
        Ok(())
    }
}

//! The limbs' steps as one path: the limbs' first steps, those of one effect together, then their second ones.

use proprio_core::effect::EffectKind;

use super::super::limb::Squares;
use super::{PathStep, Walked};
use crate::model::Model;

/// The limbs' errors at one point of the path.
struct Now<'a> {
    walked: &'a [Walked<'a>],
    model: &'a Model,
    /// Of each limb.
    squares: Vec<Squares>,
    /// Whether each log is held out as a whole, the same ones of every limb.
    by_log: bool,
    path: Vec<PathStep>,
}

/// The errors of the model as it was given in each log, and the path.
pub(super) fn path(walked: &[Walked], model: &Model) -> (Vec<f64>, Vec<PathStep>) {
    let squares: Vec<Squares> = walked.iter().map(|limb| limb.path.start.clone()).collect();
    let logs = squares.first().map_or(0, |squares| squares.by_fold.len());
    let is_same = |limb: &Walked| limb.windows_by_log().is_some_and(|of| of.len() == logs);
    let mut now = Now {
        walked,
        model,
        squares,
        by_log: walked.iter().all(is_same),
        path: Vec::new(),
    };
    let start = now.log_rms();
    now.take_contact();
    now.take_velocities();
    let rounds = walked.iter().map(|limb| limb.path.steps.len());
    for round in 0..rounds.max().unwrap_or(0) {
        now.take_round(round);
    }
    (start, now.path)
}

impl Now<'_> {
    /// Leaves the feet's stance out.
    fn take_contact(&mut self) {
        let mut feet = Vec::new();
        for (now, limb) in self.squares.iter_mut().zip(self.walked) {
            if let Some(contact) = limb.contact.as_ref().filter(|c| !c.known) {
                now.by_joint.clone_from(&contact.after);
                feet.push(limb.foot(self.model));
            }
        }
        if !feet.is_empty() {
            self.push(EffectKind::Contact, feet, false);
        }
    }

    /// Puts the velocities right: what positions tell comes before what torques do.
    fn take_velocities(&mut self) {
        let mut names = Vec::new();
        for (now, limb) in self.squares.iter_mut().zip(self.walked) {
            let joints = limb
                .velocity
                .iter()
                .map(|(joint, _)| limb.name(*joint, self.model));
            names.extend(joints);
            now.clone_from(&limb.path.after_velocity);
        }
        if !names.is_empty() {
            self.push(EffectKind::VelocityGain, names, false);
        }
    }

    /// Every limb's step of this round.
    fn take_round(&mut self, round: usize) {
        let mut groups: Vec<(EffectKind, bool, Vec<usize>)> = Vec::new();
        for (n, limb) in self.walked.iter().enumerate() {
            let Some(step) = limb.path.steps.get(round) else {
                continue;
            };
            let kind = (step.place.0, step.removed);
            match groups
                .iter_mut()
                .find(|(effect, removed, _)| (*effect, *removed) == kind)
            {
                Some((_, _, limbs)) => limbs.push(n),
                None => groups.push((kind.0, kind.1, vec![n])),
            }
        }
        let fall = |limbs: &[usize]| -> f64 {
            let of = |&n: &usize| -> f64 {
                let after = &self.walked[n].path.steps[round].squares.by_joint;
                self.squares[n].by_joint.iter().sum::<f64>() - after.iter().sum::<f64>()
            };
            limbs.iter().map(of).sum()
        };
        groups.sort_by(|a, b| fall(&b.2).total_cmp(&fall(&a.2)));
        for (effect, removed, limbs) in groups {
            let mut names = Vec::new();
            for n in limbs {
                let step = &self.walked[n].path.steps[round];
                self.squares[n].clone_from(&step.squares);
                let name = self.walked[n].name(step.place.1, self.model);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            self.push(effect, names, removed);
        }
    }

    fn push(&mut self, effect: EffectKind, joints: Vec<String>, removed: bool) {
        let windows: f64 = self.walked.iter().flat_map(|limb| limb.windows()).sum();
        let squares: f64 = self.squares.iter().flat_map(|s| &s.by_joint).sum();
        self.path.push(PathStep {
            effect: effect.name(),
            joints,
            held_out_rms: (squares / windows).sqrt(),
            log_rms: self.log_rms(),
            removed,
        });
    }

    /// Root mean square of each log, N m; none where logs are not held out as a whole.
    fn log_rms(&self) -> Vec<f64> {
        if !self.by_log {
            return Vec::new();
        }
        let windows: Vec<Vec<f64>> = (self.walked.iter())
            .filter_map(Walked::windows_by_log)
            .collect();
        let rms = |log: usize| {
            let squares: f64 = self.squares.iter().map(|of| of.by_fold[log]).sum();
            let windows: f64 = windows.iter().map(|of| of[log]).sum();
            (squares / windows).sqrt()
        };
        (0..windows[0].len()).map(rms).collect()
    }
}

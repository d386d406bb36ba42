//! The way from the model as it was given to one that lacks nothing, step by step, with the error after each.

use proprio_core::effect::EffectKind;

use super::{Diagnosed, PathStep};
use crate::detect::contact::Contact;
use crate::detect::twist::Twist;
use crate::equation::values::Place;
use crate::equation::velocity::VelocityGain;
use crate::estimate::limb_data::Squares;
use crate::model::LINK_GEOMETRY;
use crate::select::candidate::Member;

/// The errors of the model as it was given, of all data and of each log, and the path.
pub(super) fn path(d: &Diagnosed) -> (f64, Vec<f64>, Vec<PathStep>) {
    let start = d.before.as_ref().unwrap_or(&d.refitted);
    let mut steps = Vec::new();
    let stance: Vec<Member> = (d.feet.iter().enumerate())
        .filter(|(_, foot)| foot.as_ref().is_some_and(|foot| !foot.known))
        .map(|(n, _)| (n, (Contact::EFFECT, d.all[n].joints() - 1)))
        .collect();
    if !stance.is_empty() {
        let names = stance.iter().map(|(n, place)| d.name_in(*n, place.1));
        steps.push(d.step(Contact::EFFECT, names.collect(), start, false));
    }
    let wrong: Vec<String> = (d.velocity.iter().enumerate())
        .flat_map(|(n, wrong)| wrong.iter().map(move |(joint, _)| d.name(n, *joint)))
        .collect();
    if !wrong.is_empty() {
        steps.push(d.step(VelocityGain::EFFECT, wrong, &d.refitted, false));
    }
    for (effect, joints) in d.shown_by_encoders() {
        steps.push(d.step(effect, joints, &d.refitted, false));
    }
    if !d.frames.is_empty() {
        steps.push(PathStep {
            effect: LINK_GEOMETRY,
            joints: (d.frames.iter())
                .map(|(_, frame)| d.model.joint_name(frame.joint).to_owned())
                .collect(),
            held_out_rms: d.rms(&d.found.start),
            log_rms: d.log_rms(&d.found.start),
            removed: false,
        });
    }
    for step in &d.found.steps {
        let mut names: Vec<String> = Vec::new();
        for (limb, place) in &step.members {
            let name = d.name(*limb, place.1);
            if !names.contains(&name) {
                names.push(name);
            }
        }
        steps.push(d.step(step.effect, names, &step.errors, step.removed));
    }
    (d.rms(start), d.log_rms(start), steps)
}

impl Diagnosed<'_> {
    /// What second encoders show that the model lacks, each effect with its joints.
    pub(super) fn shown_by_encoders(&self) -> Vec<(EffectKind, Vec<String>)> {
        let mut shown: Vec<(EffectKind, Vec<String>)> = Vec::new();
        for (limb, twist) in self.each_twist() {
            for (place, _) in self.lacking(limb, twist) {
                let name = self.name(limb, place.1);
                match shown.iter_mut().find(|(effect, _)| *effect == place.0) {
                    Some((_, joints)) => joints.push(name),
                    None => shown.push((place.0, vec![name])),
                }
            }
        }
        shown
    }

    /// All gears that second encoders show, with their limbs.
    pub(super) fn each_twist(&self) -> impl Iterator<Item = (usize, &Twist)> {
        let limbs = self.twists.iter().enumerate();
        limbs.flat_map(|(limb, twists)| twists.iter().map(move |twist| (limb, twist)))
    }

    /// The effects that second encoders show of a gear and the model does not have.
    pub(super) fn lacking(
        &self,
        limb: usize,
        twist: &Twist,
    ) -> impl Iterator<Item = (Place, Vec<[f64; 2]>)> {
        let data = &self.all[self.judged[limb]];
        let own = twist.effects().into_iter();
        own.filter(|(place, _)| !data.has(*place))
    }

    fn step(
        &self,
        effect: EffectKind,
        joints: Vec<String>,
        squares: &[Squares],
        removed: bool,
    ) -> PathStep {
        PathStep {
            effect: effect.name(),
            joints,
            held_out_rms: self.rms(squares),
            log_rms: self.log_rms(squares),
            removed,
        }
    }

    /// Name of a joint of a limb that is judged.
    pub(super) fn name(&self, limb: usize, joint: usize) -> String {
        self.name_in(self.judged[limb], joint)
    }

    fn name_in(&self, limb: usize, joint: usize) -> String {
        let data = &self.all[limb];
        self.model.joint_name(data.body_of(joint)).to_owned()
    }

    /// Root mean square over the windows of all joints that are judged, N m.
    pub(super) fn rms(&self, squares: &[Squares]) -> f64 {
        let windows: f64 = self
            .judged
            .iter()
            .flat_map(|&n| self.all[n].windows())
            .sum();
        let sum: f64 = squares.iter().map(Squares::total).sum();
        (sum / windows.max(1.0)).sqrt()
    }

    /// The same of each log, where each is held out as a whole.
    pub(super) fn log_rms(&self, squares: &[Squares]) -> Vec<f64> {
        let data: Vec<_> = self.judged.iter().map(|&n| &self.all[n]).collect();
        let folds = data.first().map_or(0, |d| d.blocks.folds);
        if !data
            .iter()
            .all(|d| d.blocks.by_log && d.blocks.folds == folds)
        {
            return Vec::new();
        }
        let rms = |log: usize| {
            let count = |d: &&crate::estimate::limb_data::LimbData| {
                let windows = (0..d.motion.windows.len()).filter(|&w| d.fold(w) == log);
                windows
                    .map(|w| (0..d.joints()).filter(|&j| d.counts(w, j)).count())
                    .sum::<usize>()
            };
            let windows: usize = data.iter().map(count).sum();
            let sum: f64 = squares.iter().map(|s| s.by_fold()[log]).sum();
            (sum / windows.max(1) as f64).sqrt()
        };
        (0..folds).map(rms).collect()
    }
}

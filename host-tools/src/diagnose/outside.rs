//! What the catalogue's effects leave of joints that is more than noise: what may be told as outside the catalogue, and what noise of the motion makes.

use super::{Diagnosed, text};
use crate::detect::black_box::Explained;
use crate::detect::bursts::bursts;
use crate::detect::load_change::{self, LoadChange};
use crate::detect::regime::{self, Regime};
use crate::detect::residual::{self, Criticism};
use crate::detect::series::JointSeries;
use crate::parallel::{by_number, side_by_side};
use crate::select::criteria::step::is_by_noise;
use crate::select::criteria::{RESOLUTION, STRUCTURE};
use crate::select::drift::Drift;

/// What is left of a joint that is more than noise.
pub(super) struct Left {
    pub(super) joint: String,
    pub(super) words: String,
    /// Where of the joint's motion, or when, if not everywhere.
    pub(super) regime: Option<Regime>,
}

/// What is left of all joints.
pub(super) struct Outside {
    /// What may be an effect that the catalogue does not have.
    pub(super) told: Vec<Left>,
    /// Joints with windows that are large alone.
    pub(super) alone: Vec<String>,
    /// Joints of which all that could be told is noise.
    pub(super) noise: Vec<String>,
}

/// Windows that are large alone leave so much of a joint's squared error, and more is a law's.
const MOST_ALONE: f64 = 0.5;

/// What is said of a joint of a complete model.
struct ByNoise {
    /// The share of the squared error that has structure.
    structure: f64,
    /// The share that a black box takes.
    share: f64,
    /// How far the motion alone has each of the joint's windows off, N m.
    off: Vec<f64>,
}

impl Diagnosed<'_> {
    /// What the catalogue's effects leave, joint by joint, where it is more than noise: of the torque and of the motion.
    pub(super) fn outside(&self) -> Outside {
        let (mut series, mut drifting, mut boxes) = (Vec::new(), Vec::new(), Vec::new());
        let mut places: Vec<(usize, usize)> = Vec::new();
        let fits: Vec<_> = self.found.end.fits.iter().enumerate().collect();
        let left = side_by_side(&fits, |(_, fit)| {
            let below = fit.below_limits();
            let predicted = below.with_unfollowed(&fit.values, fit.predicted_held_out()?);
            let doubts: Vec<_> = (0..below.joints()).map(|n| fit.doubt(&below, n)).collect();
            let taken = |joint: usize| Explained::of(&below, &predicted, joint, &doubts[joint]);
            let boxes = by_number(0..below.joints(), taken);
            let own = JointSeries::of(&below, &predicted).into_iter().zip(doubts);
            Some((own.collect::<Vec<_>>(), boxes))
        });
        for ((limb, fit), left) in fits.into_iter().zip(left) {
            let Some((own, taken)) = left else { continue };
            let joint = |joint: usize| (limb, joint);
            places.extend((0..own.len()).map(joint));
            series.extend(own);
            boxes.extend(taken);
            let by_log = fit.data.blocks.by_log;
            let told = |drift: &Drift| (self.name(limb, drift.joint), text::drift(drift, by_log));
            drifting.extend(self.found.source.drifts(limb).iter().map(told));
        }
        for ((series, _), ladder) in series.iter_mut().zip(&self.ladder) {
            series.noise = ladder.noise;
        }
        let (mut lasting, mut alone, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        for (series, doubt) in &mut series {
            let moments = bursts(series, doubt);
            let before = series.rms();
            if let Some(moments) = moments.as_ref().filter(|moments| !moments.lasts) {
                // They tell of themselves, and nothing of what the others have in common.
                (moments.windows.iter()).for_each(|&w| series.residual[w] = 0.0);
                alone.push(series.joint.clone());
            }
            rest.push((series.rms() / before.max(f64::MIN_POSITIVE)).powi(2));
            lasting.push(moments.filter(|moments| moments.lasts));
        }
        let views: Vec<_> = series.iter().map(|(series, _)| series.view()).collect();
        let criticism = residual::criticise(&views);
        let structure = |joint: usize| rest[joint] * criticism[joint].structure();
        let may_be_told = |joint: usize| {
            structure(joint) > STRUCTURE
                || lasting[joint].is_some()
                || boxes[joint].as_ref().and_then(text::black_box).is_some()
        };
        let asked: Vec<bool> = (0..places.len()).map(may_be_told).collect();
        let by_noise = self.by_noise(&places, &asked);
        let is_more = |joint: usize, share: f64, noise: &dyn Fn(&ByNoise) -> f64| {
            !is_by_noise(by_noise[joint].as_ref().map_or(0.0, noise), share)
        };
        let lasting = lasting.into_iter().enumerate().filter_map(|(k, moments)| {
            let (own, moments) = (&series[k].0, moments?);
            let square = |all: &[f64]| moments.windows.iter().map(|&w| all[w].powi(2)).sum();
            let is_more = is_more(k, square(&own.residual), &|noise| square(&noise.off));
            is_more.then(|| (own.joint.clone(), moments.words))
        });
        let left = criticism.iter().enumerate().filter(|(k, _)| {
            let share = structure(*k);
            share > STRUCTURE && is_more(*k, share, &|noise| noise.structure)
        });
        let structures = left.map(|(k, joint)| {
            let share = 100.0 * structure(k);
            let place = joint
                .patterns
                .first()
                .map_or(String::new(), |p| format!(" {}", p.sentence));
            let words = format!(
                "no effect of the catalogue explains {share:.0} % of the error that is left.{place}"
            );
            (joint.joint.clone(), words)
        });
        let boxes = boxes.iter().enumerate().filter_map(|(k, taken)| {
            let taken = taken.as_ref()?;
            let is_more = is_more(k, taken.share, &|noise| noise.share);
            let joint = series[k].0.joint.clone();
            Some((joint, text::black_box(taken).filter(|_| is_more)?))
        });
        let total: f64 = self.found.end.squares.iter().map(|s| s.total()).sum();
        let unphysical = self.found.unphysical.iter().map(|judged| {
            let candidate = self.candidate(judged, total);
            (candidate.joints.join(", "), text::unphysical(&candidate))
        });
        // Of what a few windows ask for nothing is told but those.
        let joints = series.iter().zip(&rest);
        let few = joints.filter(|(_, rest)| **rest < MOST_ALONE);
        let few: Vec<String> = few.map(|((series, _), _)| series.joint.clone()).collect();
        let unphysical = unphysical.filter(|(joint, _)| !few.contains(joint));
        let mut resolved = self.resolved();
        let mut told: Vec<Left> = Vec::new();
        for (limb, change) in self.load_changes.iter().enumerate() {
            let Some(change) = change else { continue };
            // It is the cause of what is left at all joints of its limb.
            resolved.extend(self.all[self.judged[limb]].joint_names());
            told.push(Left {
                joint: self.name(limb, change.joint),
                words: text::load_change(change),
                regime: None,
            });
        }
        // One sentence a joint: they are of one cause, the first says most.
        for (joint, words) in (structures.chain(boxes))
            .chain(drifting)
            .chain(lasting)
            .chain(unphysical)
        {
            if resolved.contains(&joint) {
                continue;
            }
            if told.iter().all(|left| left.joint != joint) {
                told.push(Left {
                    joint,
                    words,
                    regime: None,
                });
            }
        }
        let joints = series.iter().zip(asked).filter(|(_, asked)| *asked);
        let names = joints.map(|((series, _), _)| series.joint.clone());
        let noise = names
            .chain(few)
            .filter(|joint| told.iter().all(|left| left.joint != *joint));
        Outside {
            noise: noise.collect(),
            told,
            alone,
        }
    }

    /// Adds to what is left of each joint where it lives; a load that comes or goes has its moment.
    pub(super) fn add_regimes(&self, outside: &mut Outside) {
        let mut ladder = self.ladder.iter().map(|joint| joint.noise);
        let mut places = Vec::new();
        for (limb, fit) in self.found.end.fits.iter().enumerate() {
            for joint in 0..fit.data.joints() {
                let noise = ladder.next().flatten().map(|noise| noise.rms);
                places.push((self.name(limb, joint), limb, (joint, noise)));
            }
        }
        let found = side_by_side(&outside.told, |left| {
            let (_, limb, of) = places.iter().find(|(name, ..)| *name == left.joint)?;
            if self.load_changes.get(*limb)?.is_some() {
                return None;
            }
            let fit = &self.found.end.fits[*limb];
            let below = fit.below_limits();
            let predicted = below.with_unfollowed(&fit.values, fit.predicted());
            regime::of(&below, &fit.values, &predicted, *of)
        });
        for (left, regime) in outside.told.iter_mut().zip(found) {
            if let Some(regime) = &regime {
                left.words += &format!("; {}", regime.words_with_conditions());
            }
            left.regime = regime;
        }
    }

    /// Of joints, by limb and number, what is said of those `asked` for where the model is complete and its motion measured once more.
    fn by_noise(&self, places: &[(usize, usize)], asked: &[bool]) -> Vec<Option<ByNoise>> {
        let mut limbs: Vec<usize> = places.iter().map(|place| place.0).collect();
        limbs.dedup();
        let of = |&limb: &usize| {
            let first = places.iter().position(|place| place.0 == limb)?;
            let fit = &self.found.end.fits[limb];
            let own = || first..first + fit.data.joints();
            if !own().any(|joint| asked[joint]) {
                return None;
            }
            let (again, [predicted, off]) = fit.below_limits().as_if_complete(&fit.values);
            let n = again.joints();
            let off = |joint: usize| -> Vec<f64> {
                let counting = (0..again.left_out.len()).filter(|&w| again.counts(w, joint));
                counting.map(|w| off[w * n + joint]).collect()
            };
            let predicted = again.with_unfollowed(&fit.values, predicted);
            let mut series = JointSeries::of(&again, &predicted);
            for (series, joint) in series.iter_mut().zip(own()) {
                series.noise = self.ladder[joint].noise;
            }
            let views: Vec<_> = series.iter().map(JointSeries::view).collect();
            let structures = residual::criticise(&views).into_iter();
            let share = |joint: usize| {
                let doubt = fit.doubt(&again, joint);
                Explained::of(&again, &predicted, joint, &doubt).map(|taken| taken.share)
            };
            let of = |(joint, criticism): (usize, Criticism)| ByNoise {
                off: off(joint),
                structure: criticism.structure(),
                share: share(joint).unwrap_or(0.0),
            };
            Some(structures.enumerate().map(of).collect::<Vec<_>>())
        };
        let found = side_by_side(&limbs, of);
        let joints = limbs.iter().zip(found).flat_map(|(limb, found)| {
            let count = places.iter().filter(|place| place.0 == *limb).count();
            match found {
                Some(found) => found.into_iter().map(Some).collect::<Vec<_>>(),
                None => (0..count).map(|_| None).collect(),
            }
        });
        joints.collect()
    }

    /// Of each limb the load that comes or goes within the log, if one does.
    pub(super) fn load_changes(&self) -> Vec<Option<LoadChange>> {
        let mut ladder = self.ladder.iter().map(|joint| joint.noise);
        let limbs: Vec<_> = (self.found.end.fits.iter())
            .map(|fit| {
                (
                    fit,
                    ladder.by_ref().take(fit.data.joints()).collect::<Vec<_>>(),
                )
            })
            .collect();
        side_by_side(&limbs, |(fit, noise)| {
            let below = fit.below_limits();
            // The whole fit: those that each leave a fold out have more of the load or less of it.
            load_change::of(&below, &fit.values, &fit.predicted(), noise)
        })
    }

    /// The limbs and joints of which more is left than a sampled log resolves, and than `outside` takes for noise.
    pub(super) fn unresolved(&self, outside: &Outside) -> Vec<(usize, usize)> {
        let mut resolved = self.resolved();
        resolved.extend(outside.noise.iter().cloned());
        let limbs = self.judged.iter().enumerate();
        // What a load that comes or goes leaves at each joint is no law of that joint.
        let limbs = limbs.filter(|(limb, _)| self.load_changes[*limb].is_none());
        let of = |(limb, &n): (usize, &usize)| {
            let names = self.all[n].joint_names().into_iter().enumerate();
            let open = names.filter(|(_, name)| !resolved.contains(name));
            open.map(move |(joint, _)| (limb, joint))
                .collect::<Vec<_>>()
        };
        limbs.flat_map(of).collect()
    }

    /// The joints of which no more is left than a sampled log resolves. A torque that is reported in steps may be off by as much as
    /// rounding leaves of one sample (a step over √12), however many a window holds: without noise they are all rounded alike.
    fn resolved(&self) -> Vec<String> {
        let mut resolved = Vec::new();
        for (fit, left) in self.found.end.fits.iter().zip(&self.found.end.squares) {
            let data = fit.data;
            let torque = data.squares(&vec![0.0; data.torque.len()]).by_joint();
            let told = left
                .by_joint()
                .into_iter()
                .zip(torque)
                .zip(fit.left_by_sampling());
            let names = data.joint_names().into_iter().enumerate();
            for ((j, name), ((left, torque), sampling)) in names.zip(told) {
                let windows = (0..data.motion.windows.len()).filter(|w| data.counts(*w, j));
                let rounding = windows.count() as f64 * self.torque_step(&name).powi(2) / 12.0;
                if left <= RESOLUTION.powi(2) * torque + sampling + rounding {
                    resolved.push(name);
                }
            }
        }
        resolved
    }

    /// The steps in which a joint's torque is reported, N m, the largest of all logs; zero if there are none.
    fn torque_step(&self, joint: &str) -> f64 {
        let gates = self
            .recording
            .gates
            .iter()
            .flat_map(|log| &log.report.joints);
        let steps = gates
            .filter(|gate| gate.joint == joint)
            .filter_map(|gate| gate.quantum[2]);
        steps.fold(0.0, f64::max)
    }
}

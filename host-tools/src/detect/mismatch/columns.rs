//! Readings of a log's columns: joints that count the other way, any two joints exchanged.

use super::reading::Reading;
use super::{EXCELLENT, FAR_BETTER, Left, MismatchKind};
use crate::model::Model;
use crate::parallel::side_by_side;
use crate::recording::{LimbRecording, Recording};
use crate::robust;

/// Most joints that count the other way, or pairs that are exchanged: more of them are another robot.
const MOST: usize = 6;
/// A joint that leaves less than this is in its place.
const IN_PLACE: f64 = 0.3;
/// In a log that fits but for a joint or two, these leave so many times the lower quartile of all joints' shares: not the median's, for the joints of their
/// limbs are spoilt too. Friction and offsets that no model knows yet make up to five times of it on real chirps.
const STANDS_OUT: f64 = 6.0;
const QUARTILE: f64 = 0.25;

/// Limbs whose columns are read in some way, and what their joints leave.
struct Way {
    limbs: Vec<LimbRecording>,
    left: Vec<Vec<f64>>,
}

/// A joint by its limb and its number there.
type At = (usize, usize);

/// Logs whose columns are read otherwise than they say.
pub(super) struct Columns<'a> {
    pub(super) recording: &'a Recording,
    pub(super) model: &'a Model,
    /// The limbs read as they say.
    pub(super) as_is: &'a [Reading],
    /// The log fits but for what stands out.
    pub(super) fits: bool,
}

impl Columns<'_> {
    /// What each joint of a limb leaves; `None` where its joints cannot be judged, as those that rest.
    fn left(&self, limb: usize, samples: &LimbRecording) -> Vec<f64> {
        let own = &self.recording.limbs[limb].0;
        let reading = Reading::of(self.model, own, samples, false);
        self.left_by(limb, reading.as_slice())
    }

    /// The same by readings that have been made.
    fn left_by(&self, limb: usize, readings: &[Reading]) -> Vec<f64> {
        let joints = || readings.iter().flat_map(|reading| &reading.joints);
        let of = |body: usize| {
            let name = self.model.joint_name(body);
            let joint = joints().find(|joint| joint.name == name);
            joint.map_or(0.0, |joint| joint.left().min(1.0))
        };
        let bodies = self.recording.limbs[limb].0.bodies.clone();
        bodies.map(of).collect()
    }

    /// The limbs as they say; `None` if no joint of a log that fits stands out.
    fn start(&self) -> Option<Way> {
        let limbs = &self.recording.limbs;
        let left = (0..limbs.len()).map(|n| self.left_by(n, self.as_is));
        let left: Vec<Vec<f64>> = left.collect();
        let is_plain = self.fits && self.astray(&left).is_empty();
        (!is_plain).then(|| Way {
            limbs: limbs.iter().map(|(_, own)| own.clone()).collect(),
            left,
        })
    }

    fn name(&self, (limb, joint): At) -> String {
        let first = self.recording.limbs[limb].0.bodies.start;
        self.model.joint_name(first + joint).to_owned()
    }

    /// The way with limbs changed that leaves least, of many changes; its change.
    fn best<T: Copy + Send + Sync>(
        &self,
        way: &Way,
        changes: &[T],
        change: impl Fn(T) -> Vec<(usize, LimbRecording)> + Sync,
    ) -> Option<(Way, T)> {
        let tried = |of: &T| {
            let limbs = change(*of);
            let left: Vec<(usize, LimbRecording, Vec<f64>)> = (limbs.into_iter())
                .map(|(n, samples)| {
                    let left = self.left(n, &samples);
                    (n, samples, left)
                })
                .collect();
            let of_limb = |n: usize| {
                let new = left.iter().find(|(m, ..)| *m == n).map(|(.., left)| left);
                new.unwrap_or(&way.left[n]).iter().sum::<f64>()
            };
            let sum: f64 = (0..way.left.len()).map(of_limb).sum();
            (sum, *of, left)
        };
        let all = side_by_side(changes, tried).into_iter();
        let best = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut next = Way {
            limbs: way.limbs.clone(),
            left: way.left.clone(),
        };
        let (_, of, changed) = best;
        let [mut before, mut after] = [0.0; 2];
        for (n, samples, left) in changed {
            before += way.left[n].iter().sum::<f64>();
            after += left.iter().sum::<f64>();
            next.limbs[n] = samples;
            next.left[n] = left;
        }
        // Each change has to mend what it changes.
        let mends = match self.fits {
            true => after < FAR_BETTER * before,
            false => after < before - IN_PLACE,
        };
        mends.then_some((next, of))
    }

    /// The joints that are not in their place.
    fn astray(&self, left: &[Vec<f64>]) -> Vec<At> {
        let all = left.iter().flatten().copied();
        let usual = robust::quantile(all, QUARTILE).unwrap_or(0.0);
        let most = match self.fits {
            true => f64::max(EXCELLENT, STANDS_OUT * usual),
            false => IN_PLACE,
        };
        let limbs = left.iter().enumerate();
        let joints =
            limbs.flat_map(|(n, left)| left.iter().enumerate().map(move |(j, x)| ((n, j), *x)));
        joints
            .filter(|(_, left)| *left > most)
            .map(|(at, _)| at)
            .collect()
    }
}

impl Way {
    fn sum(&self) -> f64 {
        self.left.iter().flatten().sum()
    }

    fn mean(&self) -> f64 {
        self.sum() / self.left.iter().flatten().count().max(1) as f64
    }
}

impl Columns<'_> {
    /// What is left with the joints that count the other way read as if they did not: position, velocity and torque together.
    pub(super) fn counted_the_other_way(&self) -> Option<Left> {
        let mut way = self.start()?;
        let mut found: Vec<At> = Vec::new();
        while found.len() < MOST {
            let astray = self.astray(&way.left);
            // A joint that counts the other way spoils those beside it too.
            let is_beside = |n: usize| !self.fits || astray.iter().any(|(limb, _)| *limb == n);
            let limbs = way.limbs.iter().enumerate().filter(|(n, _)| is_beside(*n));
            let all: Vec<At> = limbs
                .flat_map(|(n, limb)| (0..limb.joints).map(move |j| (n, j)))
                .filter(|at| !found.contains(at))
                .collect();
            let turned = |(limb, joint): At| {
                let mut own = way.limbs[limb].clone();
                own.replace(|j, x| if j == joint { x.map(|x| -x) } else { x });
                vec![(limb, own)]
            };
            let Some((next, at)) = self.best(&way, &all, turned) else {
                break;
            };
            found.push(at);
            way = next;
        }
        let names: Vec<String> = found.iter().map(|at| self.name(*at)).collect();
        (!names.is_empty()).then(|| (way.mean(), MismatchKind::OtherWay(names)))
    }

    /// What is left with pairs of joints exchanged, of any limbs.
    pub(super) fn exchanged(&self) -> Option<Left> {
        let mut way = self.start()?;
        let mut found: Vec<(At, At)> = Vec::new();
        while found.len() < MOST {
            let astray = self.astray(&way.left);
            let pairs: Vec<(At, At)> = (astray.iter().enumerate())
                .flat_map(|(n, a)| astray[..n].iter().map(move |b| (*b, *a)))
                // Limbs are followed by their own clock.
                .filter(|(a, b)| way.limbs[a.0].time_us == way.limbs[b.0].time_us)
                .collect();
            let swapped = |(a, b): (At, At)| swapped(&way.limbs, a, b);
            let Some((next, pair)) = self.best(&way, &pairs, swapped) else {
                break;
            };
            found.push(pair);
            way = next;
        }
        let names = found.iter().map(|(a, b)| [self.name(*a), self.name(*b)]);
        let names: Vec<[String; 2]> = names.collect();
        (!names.is_empty()).then(|| (way.mean(), MismatchKind::Exchanged(names)))
    }
}

/// The limbs with the columns of two joints exchanged.
fn swapped(limbs: &[LimbRecording], a: At, b: At) -> Vec<(usize, LimbRecording)> {
    let columns = |(limb, joint): At| {
        let samples = &limbs[limb];
        move |k: usize| {
            let at = k * samples.joints + joint;
            [samples.q[at], samples.dq[at], samples.tau[at]]
        }
    };
    let mut first = limbs[a.0].clone();
    first.replace_joint(a.1, columns(b));
    if a.0 == b.0 {
        first.replace_joint(b.1, columns(a));
        return vec![(a.0, first)];
    }
    let mut second = limbs[b.0].clone();
    second.replace_joint(b.1, columns(a));
    vec![(a.0, first), (b.0, second)]
}

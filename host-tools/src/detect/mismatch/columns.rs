//! Readings of a log's columns: joints that count the other way, any two joints exchanged.

use super::MismatchKind;
use super::reading::Reading;
use crate::model::Model;
use crate::parallel::{by_number, side_by_side};
use crate::recording::{LimbRecording, Recording};

/// Most joints that count the other way, or pairs that are exchanged: more of them are another robot.
const MOST: usize = 6;
/// A joint that leaves less than this is in its place.
const IN_PLACE: f64 = 0.3;

/// Limbs whose columns are read in some way, and what their joints leave.
struct Way {
    limbs: Vec<LimbRecording>,
    left: Vec<Vec<f64>>,
}

/// A joint by its limb and its number there.
type At = (usize, usize);

struct Columns<'a> {
    recording: &'a Recording,
    model: &'a Model,
}

impl Columns<'_> {
    /// What each joint of a limb leaves; `None` where its joints cannot be judged, as those that rest.
    fn left(&self, limb: usize, samples: &LimbRecording) -> Vec<f64> {
        let own = &self.recording.limbs[limb].0;
        let reading = Reading::of(self.model, own, samples, false);
        let joints = reading.map_or_else(Vec::new, |reading| reading.joints);
        let of = |body: usize| {
            let name = self.model.joint_name(body);
            let joint = joints.iter().find(|joint| joint.name == name);
            joint.map_or(0.0, |joint| joint.left().min(1.0))
        };
        own.bodies.clone().map(of).collect()
    }

    fn as_is(&self) -> Way {
        let limbs: Vec<LimbRecording> = self
            .recording
            .limbs
            .iter()
            .map(|(_, own)| own.clone())
            .collect();
        Way {
            left: by_number(0..limbs.len(), |n| self.left(n, &limbs[n])),
            limbs,
        }
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
        let (sum, of, changed) = best;
        for (n, samples, left) in changed {
            next.limbs[n] = samples;
            next.left[n] = left;
        }
        // Each change has to mend what it changes.
        (sum < way.sum() - IN_PLACE).then_some((next, of))
    }
}

impl Way {
    fn sum(&self) -> f64 {
        self.left.iter().flatten().sum()
    }

    fn mean(&self) -> f64 {
        self.sum() / self.left.iter().flatten().count().max(1) as f64
    }

    /// The joints that are not in their place.
    fn astray(&self) -> Vec<At> {
        let limbs = self.left.iter().enumerate();
        let joints =
            limbs.flat_map(|(n, left)| left.iter().enumerate().map(move |(j, x)| ((n, j), *x)));
        joints
            .filter(|(_, left)| *left > IN_PLACE)
            .map(|(at, _)| at)
            .collect()
    }
}

/// What is left with the joints that count the other way read as if they did not: position, velocity and torque together.
pub(super) fn counted_the_other_way(
    recording: &Recording,
    model: &Model,
) -> Option<(f64, MismatchKind)> {
    let columns = Columns { recording, model };
    let mut way = columns.as_is();
    let mut found: Vec<At> = Vec::new();
    while found.len() < MOST {
        // A joint that counts the other way spoils those beside it too.
        let limbs = way.limbs.iter().enumerate();
        let all: Vec<At> = limbs
            .flat_map(|(n, limb)| (0..limb.joints).map(move |j| (n, j)))
            .filter(|at| !found.contains(at))
            .collect();
        let turned = |(limb, joint): At| {
            let mut own = way.limbs[limb].clone();
            own.replace(|j, x| if j == joint { x.map(|x| -x) } else { x });
            vec![(limb, own)]
        };
        let Some((next, at)) = columns.best(&way, &all, turned) else {
            break;
        };
        found.push(at);
        way = next;
    }
    let names: Vec<String> = found.iter().map(|at| columns.name(*at)).collect();
    (!names.is_empty()).then(|| (way.mean(), MismatchKind::OtherWay(names)))
}

/// What is left with pairs of joints exchanged, of any limbs.
pub(super) fn exchanged(recording: &Recording, model: &Model) -> Option<(f64, MismatchKind)> {
    let columns = Columns { recording, model };
    let mut way = columns.as_is();
    let mut found: Vec<(At, At)> = Vec::new();
    while found.len() < MOST {
        let astray = way.astray();
        let pairs: Vec<(At, At)> = (astray.iter().enumerate())
            .flat_map(|(n, a)| astray[..n].iter().map(move |b| (*b, *a)))
            // Limbs are followed by their own clock.
            .filter(|(a, b)| way.limbs[a.0].time_us == way.limbs[b.0].time_us)
            .collect();
        let swapped = |(a, b): (At, At)| swapped(&way.limbs, a, b);
        let Some((next, pair)) = columns.best(&way, &pairs, swapped) else {
            break;
        };
        found.push(pair);
        way = next;
    }
    let names = found
        .iter()
        .map(|(a, b)| [columns.name(*a), columns.name(*b)]);
    let names: Vec<[String; 2]> = names.collect();
    (!names.is_empty()).then(|| (way.mean(), MismatchKind::Exchanged(names)))
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

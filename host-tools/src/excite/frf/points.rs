//! Where the robot is held: points within the limits, far from each other, with ways between them that are within the limits too.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::course::{Carrier, Way};
use super::lines::Signals;
use super::swing::{Peaks, Swing};
use super::{Part, sentence};
use crate::excite::proof::violations_of;
use crate::excite::{ExciteError, Violation};
use crate::model::Model;
use crate::spectrum::Foreseen;

/// The middle share of a joint's range where points are, and how far from its middle they are at most, rad or m.
const RANGE: f64 = 0.6;
const FARTHEST: f64 = std::f64::consts::FRAC_PI_2 * RANGE;
/// Random points that are tried for each that is asked for, and at least; and so many more than asked for are chosen from.
const TRIED: usize = 12;
const LEAST_TRIED: usize = 60;
const SPARE: usize = 4;
/// Peak over rms of random multisines: of 40 lines and some thousand samples 2.6 to 3.4.
const CREST: f64 = 3.5;

/// Random points.
pub(super) fn candidates(
    parts: &[Part],
    slow: &Carrier,
    wanted: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Vec<f64>> {
    let limits = || parts.iter().flat_map(|part| &part.problem.limits.joints);
    let count = (TRIED * wanted).max(LEAST_TRIED);
    let one = |rng: &mut ChaCha8Rng| {
        let place = |(limit, size): (&crate::excite::JointLimits, &f64)| {
            let [low, high] = limit.position;
            // A joint without stops about its zero.
            let half = (0.5 * RANGE * (high - low)).min(FARTHEST) - size;
            let middle = (0.5 * (low + high)).clamp(low + size, high - size);
            middle + half.max(0.0) * (2.0 * rng.random::<f64>() - 1.0)
        };
        limits().zip(&slow.sizes).map(place).collect()
    };
    (0..count).map(|_| one(rng)).collect()
}

/// What limits the joints.
pub(super) struct Room<'a> {
    pub(super) parts: &'a [Part],
    pub(super) slow: &'a Carrier,
    pub(super) signals: &'a Signals,
    pub(super) gains: &'a [[f64; 2]],
    /// Friction that the model does not state, N m.
    pub(super) unstated: &'a [f64],
    pub(super) model: &'a Model,
    pub(super) joints: &'a [usize],
}

impl Room<'_> {
    /// Of candidates, the points of `seen`, so many that keep the limits: one after the other the one farthest from those before, of those to which a way
    /// leads that keeps them.
    pub(super) fn choose(
        &self,
        seen: &Foreseen,
        candidates: &[Vec<f64>],
        count: usize,
        rate: f64,
    ) -> Result<Vec<Vec<f64>>, ExciteError> {
        let mut within: Vec<&Vec<f64>> = Vec::new();
        let mut beyond: Vec<(usize, Violation)> = Vec::new();
        for (p, point) in candidates.iter().enumerate() {
            if within.len() >= SPARE * count {
                break;
            }
            let Some(swing) = Swing::new(seen, p, self.signals, self.gains) else {
                continue;
            };
            let peaks = swing.usual_peaks(self.signals, CREST);
            let own = self.violations(&Way::held(point), &peaks);
            if own.is_empty() {
                within.push(point);
            }
            beyond.extend(own);
        }
        if within.len() < count {
            return Err(self.no_points(within.len(), count, candidates.len(), &beyond));
        }
        let apart = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
        };
        let mut chosen: Vec<Vec<f64>> = vec![within[0].clone()];
        while chosen.len() < count {
            let nearest = |q: &[f64]| {
                let all = chosen.iter().map(|own| apart(own, q));
                all.fold(f64::INFINITY, f64::min)
            };
            within.sort_by(|a, b| nearest(b).total_cmp(&nearest(a)));
            let mut found = None;
            for next in &within {
                let ends = [&chosen[chosen.len() - 1][..], next];
                let own = self.beyond(&Way::between(ends, [1.0; 2], self.parts, self.slow, rate));
                if own.is_empty() {
                    found = Some((*next).clone());
                    break;
                }
                beyond.extend(own);
            }
            let Some(next) = found else {
                return Err(self.no_points(chosen.len(), count, candidates.len(), &beyond));
            };
            chosen.push(next);
        }
        Ok(chosen)
    }

    /// The limit that most points exceed.
    fn no_points(
        &self,
        found: usize,
        wanted: usize,
        tried: usize,
        beyond: &[(usize, Violation)],
    ) -> ExciteError {
        let same = |a: &(usize, Violation), b: &(usize, Violation)| {
            a.0 == b.0 && a.1.what == b.1.what && a.1.joint == b.1.joint
        };
        let often = |v: &&(usize, Violation)| beyond.iter().filter(|w| same(v, w)).count();
        let worst = beyond.iter().max_by_key(often);
        ExciteError::NoPoints {
            found,
            wanted,
            tried,
            what: worst.map_or_else(
                || "the model has no inertia there".to_owned(),
                |(first, v)| match v.joint {
                    Some(j) => format!(
                        "{} of {}",
                        v.what,
                        self.model.joint_name(self.joints[first + j])
                    ),
                    None => v.what.clone(),
                },
            ),
        }
    }

    /// Limits that are not kept at a point, a sentence each.
    pub(super) fn held(&self, point: &[f64], peaks: &Peaks) -> Vec<String> {
        self.sentences(&self.violations(&Way::held(point), peaks))
    }

    /// The same on a way.
    pub(super) fn on(&self, way: &Way) -> Vec<String> {
        self.sentences(&self.beyond(way))
    }

    /// Limits that are not kept on a way, where nothing is excited.
    fn beyond(&self, way: &Way) -> Vec<(usize, Violation)> {
        let none = vec![0.0; self.gains.len()];
        let peaks = Peaks {
            q: none.clone(),
            dq: none.clone(),
            torque: none,
        };
        self.violations(way, &peaks)
    }

    fn sentences(&self, all: &[(usize, Violation)]) -> Vec<String> {
        let own = |(first, v): &(usize, Violation)| sentence(self.model, self.joints, *first, v);
        all.iter().map(own).collect()
    }

    /// Limits that are not kept, each with its limb's first joint.
    fn violations(&self, way: &Way, peaks: &Peaks) -> Vec<(usize, Violation)> {
        let mut all = Vec::new();
        for part in self.parts {
            let own = part.first..part.first + part.problem.joints();
            let stretch = |middle: f64, half: f64| {
                let swings = [&peaks.q[..], &peaks.dq[..]];
                way.enclosed(self.slow, own.clone(), [middle, half], swings)
            };
            let more: Vec<f64> = own
                .clone()
                .map(|j| peaks.torque[j] + self.unstated[j])
                .collect();
            let length = way.length(self.slow);
            let found = violations_of(&part.problem, length, &stretch, &more);
            all.extend(found.into_iter().map(|v| (part.first, v)));
        }
        all
    }

    /// The ways to each point and to rest at the end. The carrier grows at the first point and fades at the last.
    pub(super) fn ways(&self, points: &[Vec<f64>], rate: f64) -> Vec<Way> {
        let (Some(first), Some(last)) = (points.first(), points.last()) else {
            return Vec::new();
        };
        let way = |ends: [&[f64]; 2], fade| Way::between(ends, fade, self.parts, self.slow, rate);
        let mut ways = vec![way([first, first], [0.0, 1.0])];
        ways.extend(
            points
                .windows(2)
                .map(|two| way([&two[0], &two[1]], [1.0; 2])),
        );
        ways.push(way([last, last], [1.0, 0.0]));
        ways
    }
}

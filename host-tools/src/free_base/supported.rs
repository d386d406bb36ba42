//! Whether something beyond the feet carries the robot: a hand, a rope, a stand.
//!
//! Such a force acts on the trunk, and no sensor tells it. The base's equations would take it for a lack of mass: of a robot that is swung
//! by hand they say that it weighs nothing. So what the feet carry by their legs' torques is held against what the robot needs by its CAD
//! and its accelerometer. Where the feet carry much less, the base's equations are left out; those of legs in the air hold whatever moves
//! the base.

use super::walk::Walk;

/// Forces are means over this time to both sides, s: half a step of a slow gait, for impacts are short and hard.
const SPREAD: f64 = 0.2;
/// Feet that carry a smaller share of the weight are not alone. A Go2's torques read up to a fifth too low at rest, its CAD and what its
/// friction hides make a tenth: less than all of that together.
const LEAST_BY_FEET: f64 = 0.6;
/// In flight nothing carries the robot: its specific force is then less than this share of its weight.
const FLIGHT: f64 = 0.4;
/// Who holds a robot takes up its weight, and sets it down, over this time before and after, s.
const GUARD: f64 = 0.3;

/// Forces along the direction up, N.
#[derive(Debug, Clone, Copy)]
pub(super) struct Support {
    /// What moves the CAD's bodies as the IMU tells.
    pub(super) needed: f64,
    /// What the feet give by their legs' torques.
    pub(super) by_feet: f64,
}

/// The samples at which the feet are not alone; `weight` is that of the CAD, N.
pub(super) fn samples(walk: &Walk, support: &[Support], weight: f64) -> Vec<bool> {
    let sums = running(support);
    let at: Vec<f64> = (0..walk.len())
        .filter(|&n| {
            let [first, last] = [-SPREAD, SPREAD].map(|s| walk.index_at(walk.seconds(n) + s));
            let count = (last - first).max(1) as f64;
            let [needed, by_feet] = [0, 1].map(|k| (sums[last][k] - sums[first][k]) / count);
            needed > FLIGHT * weight && by_feet < LEAST_BY_FEET * needed
        })
        .map(|n| walk.seconds(n))
        .collect();
    (0..walk.len())
        .map(|n| {
            let t = walk.seconds(n);
            let next = at.partition_point(|held| *held < t - GUARD);
            at.get(next).is_some_and(|held| *held <= t + GUARD)
        })
        .collect()
}

/// Whether the feet would pull at the ground on the whole, which no foot can: the accelerometer's up is down, or the torques have the other sign. What
/// hangs has feet that do neither.
pub(super) fn is_overturned(support: &[Support]) -> bool {
    let [needed, by_feet] = running(support).last().copied().unwrap_or_default();
    by_feet < -LEAST_BY_FEET * needed
}

/// Sums of all samples before each, and of all.
fn running(support: &[Support]) -> Vec<[f64; 2]> {
    let mut sums = vec![[0.0; 2]];
    let mut sum = [0.0; 2];
    for own in support {
        sum = [sum[0] + own.needed, sum[1] + own.by_feet];
        sums.push(sum);
    }
    sums
}

//! A trajectory as it was some time before: where torque is reported late, it belongs to an earlier motion.

use std::ops::Range;

use super::Trajectory;

/// How far a delayed trajectory is continued beyond the first sample, s.
const BEYOND: f64 = 8.5e-3;

impl Trajectory {
    /// Position and velocity `since` seconds after sample `near`, or before it; at rest there where that is too far to know.
    pub(crate) fn after(&self, near: usize, since: f64) -> [f64; 2] {
        let [q, dq, ..] = moved(&self.state[near], since.clamp(-BEYOND, BEYOND));
        [q, if since.abs() > BEYOND { 0.0 } else { dq }]
    }

    /// The trajectory as it was some time before each sample.
    pub(crate) fn delayed(&self, before: &Before) -> Self {
        // Beyond the first and last sample the trajectory is a cubic for no longer than it was fitted.
        let state = |moment: &Moment| {
            let s = moment.since.clamp(-BEYOND, BEYOND);
            moved(&self.state[moment.near], s)
        };
        let speed = |moment: &Moment| {
            let [near, other] = [moment.near, moment.other].map(|k| self.speed[k]);
            near + (other - near) * moment.share
        };
        Self {
            state: before.moments.iter().map(state).collect(),
            speed: before.moments.iter().map(speed).collect(),
            regained: self.regained.clone(),
            ..*self
        }
    }
}

/// The moments so much time before each sample, as the samples about them tell.
pub(crate) struct Before {
    moments: Vec<Moment>,
}

/// A moment between two samples.
struct Moment {
    /// The sample nearest to it, and how long after that it is, s.
    near: usize,
    since: f64,
    /// The sample on its other side, and the share of the way there; the nearest itself beyond the ends of a stretch.
    other: usize,
    share: f64,
}

impl Before {
    /// What numbers of so many joints, sample by sample, were at these moments, on the line between the samples about each.
    pub(crate) fn of_joints(&self, numbers: &[[f64; 2]], joints: usize) -> Vec<[f64; 2]> {
        let at = |moment: &Moment, j: usize| {
            let [near, other] = [moment.near, moment.other].map(|k| numbers[k * joints + j]);
            [0, 1].map(|n| near[n] + (other[n] - near[n]) * moment.share)
        };
        let moments = self.moments.iter();
        moments
            .flat_map(|moment| (0..joints).map(move |j| at(moment, j)))
            .collect()
    }

    /// `delay` seconds before the samples at the times `t`, which lie in `stretches` one after the other.
    pub(crate) fn of(t: &[f64], stretches: &[Range<usize>], delay: f64) -> Self {
        let mut moments = Vec::with_capacity(t.len());
        for stretch in stretches {
            let mut near = stretch.start;
            for k in stretch.clone() {
                let wanted = t[k] - delay;
                let away = |near: usize| (t[near] - wanted).abs();
                while near + 1 < stretch.end && away(near + 1) <= away(near) {
                    near += 1;
                }
                while near > stretch.start && away(near - 1) < away(near) {
                    near -= 1;
                }
                let since = wanted - t[near];
                let next = if since < 0.0 {
                    near.checked_sub(1)
                } else {
                    Some(near + 1)
                };
                let other = next.filter(|k| stretch.contains(k)).unwrap_or(near);
                let share = match other == near {
                    true => 0.0,
                    false => since / (t[other] - t[near]),
                };
                moments.push(Moment {
                    near,
                    since,
                    other,
                    share,
                });
            }
        }
        Self { moments }
    }
}

/// A cubic's state `s` seconds later.
// A product with a constant: the smoother spends its time here, and a division takes that of several.
#[inline]
pub(super) fn moved(&[q, dq, ddq, jerk]: &[f64; 4], s: f64) -> [f64; 4] {
    const SIXTH: f64 = 1.0 / 6.0;
    [
        q + s * (dq + s * (0.5 * ddq + SIXTH * (s * jerk))),
        dq + s * (ddq + 0.5 * (s * jerk)),
        ddq + s * jerk,
        jerk,
    ]
}

#[cfg(test)]
mod tests {
    use super::super::Stretch;
    use super::super::tests::sine;
    use super::*;

    #[test]
    fn a_delayed_trajectory_is_the_motion_of_before() {
        let t: Vec<f64> = (0..1000).map(|k| 0.002 * f64::from(k)).collect();
        let [q, dq] = [0, 1].map(|n| t.iter().map(|&t| sine(t)[n]).collect::<Vec<f64>>());
        let found = Trajectory::of(
            &[Stretch {
                t: &t,
                q: &q,
                dq: &dq,
            }],
            0.002,
        );
        let whole = 0..t.len();
        let before = Before::of(&t, std::slice::from_ref(&whole), 0.0063);
        let late = found.delayed(&before);
        for k in 20..980 {
            assert!((late.state[k][0] - sine(t[k] - 0.0063)[0]).abs() < 2e-5);
            assert!((late.state[k][1] - sine(t[k] - 0.0063)[1]).abs() < 5e-3);
        }
    }
}

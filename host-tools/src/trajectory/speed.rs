//! When a joint changes its direction, to a fraction of a sample: there dry friction jumps.
//!
//! A window of 20 ms with 0.6 N m of Coulomb friction is wrong by 0.06 N m for each millisecond by which the reversal is
//! misplaced. Positions tell it best, whose quantum is fine. Friction kinks the velocity at the reversal, so it is
//! extrapolated from before; while the joint sticks, friction already holds it against the motion to come.

/// Velocity at each sample of a smooth `motion` (position, velocity, acceleration, jerk) at the times `t`: the mean of its positions' slopes before and
/// after.
///
/// About a reversal it stands for the *sign*: `noise` times the mean of the sign over the time that belongs to the sample, so
/// that sums over samples are right to a fraction of one.
pub(super) fn near_standstill(
    t: &[f64],
    motion: &[[f64; 4]],
    noise: f64,
    coarse: bool,
) -> Vec<f64> {
    let (n, q) = (t.len(), |k: usize| motion[k][0]);
    let slope: Vec<f64> = (1..n)
        .map(|k| (q(k) - q(k - 1)) / (t[k] - t[k - 1]))
        .collect();
    let mut speed: Vec<f64> = (0..n)
        .map(
            |k| match (k.checked_sub(1).map(|i| slope[i]), slope.get(k)) {
                (Some(before), Some(after)) => 0.5 * (before + after),
                (Some(one), None) => one,
                (None, Some(one)) => *one,
                (None, None) => 0.0,
            },
        )
        .collect();
    let mut moving: Option<usize> = None;
    for i in 0..slope.len() {
        if slope[i].abs() <= noise {
            continue;
        }
        if let Some(last) = moving
            && slope[last] * slope[i] < 0.0
        {
            let turn = reversal(t, (&slope, motion), [last, i], coarse);
            for k in last.saturating_sub(1)..=(i + 1).min(n - 1) {
                speed[k] = signed(t, k, turn, slope[last].signum(), speed[k], noise);
            }
        }
        moving = Some(i);
    }
    speed
}

/// When the velocity passes zero, between the interval `last`, the last one in the old direction, and the interval `next`, the
/// first in the new: as the motion goes on from before, by its positions' slopes straight on; where samples are `coarse`, along its curve.
fn reversal(
    t: &[f64],
    (slope, motion): (&[f64], &[[f64; 4]]),
    [last, next]: [usize; 2],
    coarse: bool,
) -> f64 {
    let along = match coarse {
        true => Some(curved(t[last], &motion[last])),
        false => straight(t, slope, last),
    };
    match along {
        Some(time) if time.is_finite() && time > t[last] => time.min(t[next + 1]),
        _ => 0.5 * (t[last + 1] + t[next]),
    }
}

/// The interval itself may hold the reversal; the two before it do not.
fn straight(t: &[f64], slope: &[f64], last: usize) -> Option<f64> {
    let middle = |i: usize| 0.5 * (t[i] + t[i + 1]);
    (last >= 2).then(|| {
        let (a, b) = (last - 2, last - 1);
        let slowing = (slope[a] - slope[b]) / (middle(b) - middle(a));
        middle(b) + slope[b] / slowing
    })
}

/// From a moment and the motion then: two of Newton's steps.
fn curved(t: f64, &[_, velocity, acceleration, jerk]: &[f64; 4]) -> f64 {
    let first = -velocity / acceleration;
    t - velocity / (acceleration + 0.5 * jerk * first)
}

/// Sample k's speed about a reversal at `turn` from the direction `old`.
fn signed(t: &[f64], k: usize, turn: f64, old: f64, speed: f64, noise: f64) -> f64 {
    let start = if k == 0 {
        t[k]
    } else {
        0.5 * (t[k - 1] + t[k])
    };
    let end = t.get(k + 1).map_or(t[k], |next| 0.5 * (t[k] + next));
    let share = ((turn - start) / (end - start)).clamp(0.0, 1.0);
    let mean = old * (2.0 * share - 1.0);
    if mean.abs() < 1.0 {
        noise * mean
    } else {
        mean * speed.abs().max(noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Stretch, Trajectory};

    /// A velocity that falls at 80 rad/s² before its reversal and at 20 after it, as under friction.
    #[test]
    fn the_reversal_is_found_within_a_fifth_of_a_sample() {
        for offset in [0.0, 0.0003, 0.0011, 0.0017] {
            let turn = 0.0401 + offset;
            let t: Vec<f64> = (0..40).map(|k| 0.002 * f64::from(k)).collect();
            let motion = |t: f64| {
                let by = t - turn;
                let slowing = if by < 0.0 { 80.0 } else { 20.0 };
                let exact = -0.5 * slowing * by * by;
                [(exact / 1.58e-5).round() * 1.58e-5, -slowing * by]
            };
            let [q, dq] = [0, 1].map(|n| t.iter().map(|t| motion(*t)[n]).collect::<Vec<_>>());
            let stretch = Stretch {
                t: &t,
                q: &q,
                dq: &dq,
            };
            let found = Trajectory::of(&[stretch], 0.002);
            let sign: f64 = (found.speed[1..39].iter())
                .map(|v| 0.002 * (v / found.speed_noise).clamp(-1.0, 1.0))
                .sum();
            let exact = (turn - 0.001) - (0.077 - turn);
            assert!((sign - exact).abs() < 8e-4, "{turn}: {sign} {exact}");
        }
    }

    #[test]
    fn a_steady_motion_has_its_velocity() {
        let t: Vec<f64> = (0..20).map(|k| 0.002 * f64::from(k)).collect();
        let motion: Vec<[f64; 4]> = t.iter().map(|t| [0.3 * t, 0.3, 0.0, 0.0]).collect();
        assert!(
            near_standstill(&t, &motion, 0.01, false)
                .iter()
                .all(|v| (v - 0.3).abs() < 1e-9)
        );
    }
}

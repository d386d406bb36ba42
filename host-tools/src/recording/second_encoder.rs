//! What a user should know of second encoders: where they are not used, and where they do not count as the motors' do.

use nalgebra::{Matrix4, Vector4};

use super::{LimbRecording, Recording};
use crate::model::Model;
use crate::robust;

/// A link farther from its motor than this, rad, throughout a recording, is counted from another zero, in another unit or without the
/// gear's ratio: a gear would have to give way by it under the load of half the time.
const FAR: f64 = 0.2;

/// A second encoder that is read later than the motor's by less than this, s, is read with it: half of a Go2's period, a quarter of a slow
/// drive's.
const LATE: f64 = 1e-3;
/// So much surer than independent samples would have it: neighbours in time are alike.
const ALIKE: f64 = 10.0;
const SURE: f64 = 4.0;

/// One line per joint whose second encoder is not what it should be.
pub(super) fn warnings(recording: &Recording, model: &Model) -> Vec<String> {
    let limbs = recording.limbs.iter();
    let joints =
        limbs.flat_map(|(limb, own)| limb.bodies.clone().zip(0..).map(move |at| (own, at)));
    let told = joints.filter_map(|(own, (body, joint))| told(own, joint, model.joint_name(body)));
    told.collect()
}

/// What is to be told of one joint, which logs call `name`.
fn told(limb: &LimbRecording, joint: usize, name: &str) -> Option<String> {
    let of = |channel: &[f64]| {
        channel
            .iter()
            .skip(joint)
            .step_by(limb.joints)
            .copied()
            .collect::<Vec<_>>()
    };
    let (link, motor) = (of(&limb.q_link), of(&limb.q));
    let apart: Vec<f64> = (link.iter().zip(&motor))
        .map(|(link, motor)| link - motor)
        .filter(|apart| apart.is_finite())
        .collect();
    let missing = link.len() - apart.len();
    let median = robust::median(apart.iter().copied())?;
    if missing > 0 {
        let share = 100.0 * missing as f64 / link.len() as f64;
        return Some(format!(
            "q_link/{name} is missing in {share:.2} % of the samples: the second encoder is not used"
        ));
    }
    let late = lag(&motor, &link, &of(&limb.dq), &of(&limb.tau));
    if let Some([late, std]) = late
        && late > LATE + SURE * std
    {
        return Some(format!(
            "q_link/{name} is read at least {:.1} ± {:.1} ms later than q/{name} (viscous friction hides some of it): shift it in time before use; \
             the stiffness of the joint is wrong by it",
            1e3 * late,
            1e3 * std
        ));
    }
    (median.abs() > FAR).then(|| {
        format!(
            "q_link/{name} is {median:.3} rad from q/{name} most of the time: both must count in rad of the joint, from one zero"
        )
    })
}

/// The time by which a link's encoder is read later than its motor's, s, and its standard deviation: the link is where the motor is, less what the
/// gear gives way under the torque and its friction, and less its velocity times this. Viscous friction alone would have it negative.
fn lag(motor: &[f64], link: &[f64], dq: &[f64], tau: &[f64]) -> Option<[f64; 2]> {
    let row = |k: usize| Vector4::new(1.0, dq[k], tau[k], dq[k].signum());
    let apart = |k: usize| link[k] - motor[k];
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for k in 0..motor.len() {
        normal += row(k) * row(k).transpose();
        right += row(k) * apart(k);
    }
    let inverse = normal.try_inverse()?;
    let found = inverse * right;
    let left = (0..motor.len()).map(|k| (apart(k) - row(k).dot(&found)).powi(2));
    let variance = left.sum::<f64>() / motor.len() as f64;
    let std = ALIKE * (variance * inverse[(1, 1)]).sqrt();
    (found[1].is_finite() && std.is_finite()).then_some([-found[1], std])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A link behind a gear that gives way, with friction, read at another time.
    #[test]
    fn a_link_that_is_read_late_is_told_with_its_time() {
        let made = |late: f64| {
            let at = |t: f64| {
                [
                    (3.0 * t).sin() + 0.2 * (11.0 * t).sin(),
                    3.0 * (3.0 * t).cos() + 2.2 * (11.0 * t).cos(),
                ]
            };
            let mut limb = LimbRecording {
                joints: 1,
                ..LimbRecording::default()
            };
            for k in 0..4000u32 {
                let t = 0.002 * f64::from(k);
                let tau = |t: f64| 20.0 * (at(t)[0]).sin() + 2.0 * at(t)[1];
                let ([q, dq], noise) = (at(t), 1e-5 * f64::from(k * 7919 % 13));
                let then = t - late;
                let link = at(then)[0] - (tau(then) - 2.0 * at(then)[1]) / 5e3 + noise;
                limb.push(
                    u64::from(2000 * k),
                    [&[q], &[dq], &[tau(t)], &[f64::NAN], &[link]],
                    f64::NAN,
                    k == 0,
                );
            }
            limb
        };
        assert_eq!(told(&made(0.0), 0, "A1"), None);
        assert_eq!(told(&made(0.0005), 0, "A1"), None);
        let late = told(&made(0.003), 0, "A1").unwrap();
        // The friction of 2 N m s/rad before a gear of 5 000 N m/rad is as 0.4 ms less.
        assert!(
            late.contains("at least 2.6 ± ") && late.contains("later"),
            "{late}"
        );
    }

    fn two_joints() -> LimbRecording {
        LimbRecording {
            joints: 2,
            ..LimbRecording::default()
        }
    }

    fn limb(link: impl Fn(f64) -> f64) -> LimbRecording {
        let mut limb = two_joints();
        for k in 0..200u32 {
            let q = (0.1 * f64::from(k)).sin();
            let pair = [q, -q];
            limb.push(
                u64::from(2000 * k),
                [&pair, &pair, &pair, &[f64::NAN; 2], &[link(q), -q]],
                f64::NAN,
                k == 0,
            );
        }
        limb
    }

    #[test]
    fn an_encoder_that_counts_as_the_motors_does_is_nothing_to_tell() {
        assert_eq!(told(&limb(|q| q + 0.01), 0, "calf"), None);
        assert_eq!(told(&two_joints(), 0, "calf"), None);
    }

    #[test]
    fn another_zero_and_gaps_are_told() {
        let other_zero = told(&limb(|q| q - 0.7), 0, "calf").unwrap();
        assert!(
            other_zero.contains("-0.700 rad from q/calf"),
            "{other_zero}"
        );
        assert_eq!(told(&limb(|q| q - 0.7), 1, "hip"), None);
        let gap = told(&limb(|q| if q > 0.99 { f64::NAN } else { q }), 0, "calf").unwrap();
        assert!(gap.contains("missing in"), "{gap}");
    }
}

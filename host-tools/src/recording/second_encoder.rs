//! What a user should know of second encoders: where they are not used, and where they do not count as the motors' do.

use super::{LimbRecording, Recording};
use crate::model::Model;
use crate::robust;

/// A link farther from its motor than this, rad, throughout a recording, is counted from another zero, in another unit or without the
/// gear's ratio: a gear would have to give way by it under the load of half the time.
const FAR: f64 = 0.2;

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
    (median.abs() > FAR).then(|| {
        format!(
            "q_link/{name} is {median:.3} rad from q/{name} most of the time: both must count in rad of the joint, from one zero"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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

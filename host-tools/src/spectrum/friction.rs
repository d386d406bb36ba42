//! Dry friction taken out of the torque before it becomes part of a response.
//!
//! A describing function of Coulomb friction looks like viscous friction of √(2/π) Fc/σ(q̇), several times the true one. The model's own
//! Coulomb friction, identified from a slow log, is subtracted instead: Fc times the mean sign of the velocity over each interval that the
//! drive holds its torque.

use super::record::Record;

/// The torque of each joint without dry friction of `friction` (N m, or N), which acts against the velocity.
pub(super) fn without_friction(record: &Record, friction: &[f64]) -> Vec<Vec<f64>> {
    let of = |joint: usize| {
        let own = &record.torque[joint];
        let coulomb = friction.get(joint).copied().unwrap_or(0.0);
        if coulomb == 0.0 {
            return own.clone();
        }
        let q = &record.q[joint];
        let signs = (0..own.len()).map(|k| mean_sign(q, k));
        own.iter().zip(signs).map(|(torque, sign)| torque - coulomb * sign).collect()
    };
    (0..record.torque.len()).map(of).collect()
}

/// The mean sign of the velocity between samples k and k + 1, by the parabola through positions around them.
fn mean_sign(q: &[f64], k: usize) -> f64 {
    if k + 1 >= q.len() {
        return 0.0;
    }
    // Velocities at both ends, by central differences, in units of distance per sample.
    let at = |k: usize| match (k.checked_sub(1), q.get(k + 1)) {
        (Some(before), Some(after)) => 0.5 * (after - q[before]),
        (None, Some(after)) => after - q[k],
        (Some(before), None) => q[k] - q[before],
        (None, None) => 0.0,
    };
    let (a, b) = (at(k), at(k + 1));
    if a * b >= 0.0 {
        return (a + b).signum() * f64::from(u8::from(a + b != 0.0));
    }
    // A reversal within the interval: the shares before and after it.
    (a.abs() - b.abs()) / (a.abs() + b.abs()) * a.signum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversal_shares_the_interval() {
        let q = [0.0, 1.0, 2.0, 2.5, 2.0, 1.0];
        let sign: Vec<f64> = (0..5).map(|k| mean_sign(&q, k)).collect();
        assert_eq!(sign[..2], [1.0, 1.0]);
        // The velocity falls from 0.75 to 0.
        assert_eq!(sign[2], 1.0);
        assert_eq!(sign[4], -1.0);
        let q = [0.0, 1.0, 1.9, 1.6, 0.4];
        // From 0.95 to 0.3 … from 0.3 to −0.75.
        assert!((mean_sign(&q, 2) - (0.3 - 0.75) / 1.05).abs() < 1e-12);
        assert_eq!(mean_sign(&[1.0; 3], 1), 0.0);
    }
}

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
        let of_positions = |k: usize| central(q, k);
        let signs = (0..own.len()).map(|k| match record.dq.get(joint) {
            // Sharper than differences: friction's own reversal bends the position within a sample.
            Some(dq) => mean_sign(dq[k], dq.get(k + 1).copied().unwrap_or(dq[k])),
            None => mean_sign(of_positions(k), of_positions((k + 1).min(own.len() - 1))),
        });
        own.iter().zip(signs).map(|(torque, sign)| torque - coulomb * sign).collect()
    };
    (0..record.torque.len()).map(of).collect()
}

/// Velocity at sample k by central differences, in units of distance per sample.
fn central(q: &[f64], k: usize) -> f64 {
    match (k.checked_sub(1), q.get(k + 1)) {
        (Some(before), Some(after)) => 0.5 * (after - q[before]),
        (None, Some(after)) => after - q[k],
        (Some(before), None) => q[k] - q[before],
        (None, None) => 0.0,
    }
}

/// The mean sign of a velocity that goes from `a` to `b` evenly.
fn mean_sign(a: f64, b: f64) -> f64 {
    if a == 0.0 && b == 0.0 {
        return 0.0;
    }
    if a * b >= 0.0 {
        return (a + b).signum();
    }
    // A reversal within the interval: the shares before and after it.
    (a.abs() - b.abs()) / (a.abs() + b.abs()) * a.signum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversal_shares_the_interval() {
        assert_eq!(mean_sign(0.3, 0.1), 1.0);
        assert_eq!(mean_sign(0.0, -0.1), -1.0);
        assert_eq!(mean_sign(0.0, 0.0), 0.0);
        assert!((mean_sign(0.3, -0.1) - 0.5).abs() < 1e-12);
        assert!((mean_sign(-0.1, 0.3) - 0.5).abs() < 1e-12);
        let q = [0.0, 1.0, 1.9, 1.6];
        let velocity: Vec<f64> = (0..4).map(|k| central(&q, k)).collect();
        for (own, exact) in velocity.iter().zip([1.0, 0.95, 0.3, -0.3]) {
            assert!((own - exact).abs() < 1e-12);
        }
    }
}

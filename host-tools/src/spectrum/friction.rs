//! Dry friction taken out of the torque before it becomes part of a response.
//!
//! A describing function of Coulomb friction looks like viscous friction of √(2/π) Fc/σ(q̇), several times the true one. The model's own
//! Coulomb friction, identified from a slow log, is subtracted instead: Fc times the mean sign of the velocity over each interval that the
//! drive holds its torque.

use std::borrow::Cow;

use super::record::Record;

/// What is known of a joint's drive from the model.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Drive {
    /// Coulomb friction, N m or N.
    pub(super) coulomb: f64,
    /// The motor's inertia, kg m² or kg; 0: unknown.
    pub(super) armature: f64,
}

/// The torque of each joint that overcomes dry friction, which acts against the velocity.
pub(super) fn dry_friction(record: &Record, drives: &[Drive]) -> Vec<Vec<f64>> {
    let of = |joint: usize| {
        let own = &record.torque[joint];
        let drive = drives.get(joint).copied().unwrap_or_default();
        if drive.coulomb == 0.0 {
            return vec![0.0; own.len()];
        }
        // Recorded velocity is sharper than differences: friction's own reversal bends the position within a sample.
        let velocity: Cow<[f64]> = match record.dq.get(joint) {
            Some(dq) => dq.into(),
            None => (0..own.len())
                .map(|k| central(&record.q[joint], k) / record.dt)
                .collect(),
        };
        let by_torque = if drive.armature > 0.0 {
            record.dt / drive.armature
        } else {
            0.0
        };
        let sign = |k: usize| interval_sign(&velocity, own, k, by_torque);
        (0..own.len()).map(|k| drive.coulomb * sign(k)).collect()
    };
    (0..record.torque.len()).map(of).collect()
}

/// The mean sign of the velocity between samples k and k + 1. Friction turns round with it, so that the velocity falls faster before a reversal
/// than it grows behind: each part has the slope of the interval beside it, corrected by the step of the torque times `by_torque`, Δt over the
/// motor's inertia.
fn interval_sign(v: &[f64], torque: &[f64], k: usize, by_torque: f64) -> f64 {
    let Some(&b) = v.get(k + 1) else {
        return mean_sign(v[k], v[k]);
    };
    let a = v[k];
    if a * b >= 0.0 || k == 0 || k + 2 >= v.len() {
        return mean_sign(a, b);
    }
    let before = a - v[k - 1] + by_torque * (torque[k] - torque[k - 1]);
    let behind = v[k + 2] - b - by_torque * (torque[k + 1] - torque[k]);
    // Shares of the interval until it stands, and since it moves again; where neighbours do not point that way, the straight line.
    if before * a >= 0.0 || behind * b <= 0.0 {
        return mean_sign(a, b);
    }
    let (until, since) = ((a / before).abs(), (b / behind).abs());
    let moving = until + since;
    if moving >= 1.0 {
        return a.signum() * (until - since) / moving;
    }
    // It stands in between; friction then goes over from one side to the other.
    a.signum() * (until - since)
}

/// Velocity at sample k by central differences, a sample being the unit of time.
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
        // Until the reversal it falls by 0.6 a sample, behind it by 0.2: 0.3 takes half of the interval, −0.1 the other half.
        let v = [0.9, 0.3, -0.1, -0.3];
        assert!(interval_sign(&v, &[0.0; 4], 1, 0.0).abs() < 1e-12);
        // It stands for half of the interval.
        let v = [0.9, 0.15, -0.05, -0.25];
        assert!((interval_sign(&v, &[0.0; 4], 1, 0.0) - (0.2 - 0.25)).abs() < 1e-12);
        let q = [0.0, 1.0, 1.9, 1.6];
        let velocity: Vec<f64> = (0..4).map(|k| central(&q, k)).collect();
        for (own, exact) in velocity.iter().zip([1.0, 0.95, 0.3, -0.3]) {
            assert!((own - exact).abs() < 1e-12);
        }
    }
}

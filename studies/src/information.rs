//! The Cramér-Rao bound of a leg's base parameters where nothing but the torque has noise, sample by sample.
//!
//! With exact motion every sample is an equation τ = W(q, q̇, q̈) β + e, and for Gaussian e of known covariance no unbiased
//! estimate has a smaller covariance than (Σ wᵀ w)⁻¹ over the whitened rows w (Kay 1993, §4.4). No windows, no blocks and no
//! prior are in it. Noise of first order with the coefficient a is whitened by (x_k − a x_{k−1}) / √(1 − a²).

use nalgebra::{DMatrix, SVector};
use proprio_core::effect::EffectKind;
use proprio_core::go2::{self, JOINTS_PER_LEG as JOINTS, Leg};
use proprio_core::inertia::{INERTIAL, NAMES};
use proprio_core::spatial::Transform;
use proprio_simulator::SimulatedSample;

/// Inertial parameters of a leg.
const BODIES: usize = INERTIAL * JOINTS;

/// Which column a parameter is: `Ixx:FR_hip`, `viscous:FR_calf`.
#[derive(Debug, Clone, Copy)]
enum Column {
    Inertial(usize),
    Effect(EffectKind, usize),
}

/// Noise of the torque.
#[derive(Debug, Clone, Copy)]
pub struct TorqueNoise {
    /// Standard deviation, N m.
    pub std: f64,
    /// Correlation of a sample with the one before.
    pub correlation: f64,
}

/// Smallest standard deviations of unbiased estimates of the base parameters that are named after `first`, each by its first
/// standard parameter, from samples of exact motion on a level base; `None` if a name is unknown or they are not all told.
///
/// Accelerations are fourth-order differences of the velocities: of no account for an information.
pub fn bound(
    leg: Leg,
    samples: &[SimulatedSample],
    first: &[&str],
    noise: TorqueNoise,
) -> Option<Vec<f64>> {
    let columns: Vec<Column> = first
        .iter()
        .map(|name| column(leg, name))
        .collect::<Option<_>>()?;
    let n = columns.len();
    let mut information = DMatrix::zeros(n, n);
    let mut before: Option<DMatrix<f64>> = None;
    let fresh = (1.0 - noise.correlation.powi(2)).sqrt();
    for around in samples.windows(5) {
        let rows = rows(leg, around, &columns);
        let white = match &before {
            None => rows.clone(),
            Some(before) => (&rows - before * noise.correlation) / fresh,
        };
        information.gemm_tr(1.0, &white, &white, 1.0);
        before = Some(rows);
    }
    // In units of each column's length the matrix is well enough conditioned to be inverted.
    let scale: Vec<f64> = information.diagonal().iter().map(|x| x.sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |r, c| information[(r, c)] / (scale[r] * scale[c]));
    let inverse = scaled.cholesky()?.inverse();
    let std = |k: usize| noise.std * inverse[(k, k)].sqrt() / scale[k];
    Some((0..n).map(std).collect())
}

fn column(leg: Leg, name: &str) -> Option<Column> {
    let (what, joint) = name.split_once(':')?;
    let names = leg.joint_names();
    let joint = names.iter().position(|name| *name == joint)?;
    let inertial = NAMES.iter().position(|name| *name == what);
    inertial
        .map(|n| Column::Inertial(INERTIAL * joint + n))
        .or_else(|| Some(Column::Effect(EffectKind::from_name(what)?, joint)))
}

/// The rows of all joints at the middle one of five samples.
fn rows(leg: Leg, around: &[SimulatedSample], columns: &[Column]) -> DMatrix<f64> {
    let at = |x: &[f64]| SVector::<f64, JOINTS>::from_column_slice(x);
    let now = &around[2];
    let step = 0.25 * (around[4].t - around[0].t);
    let differences = at(&around[3].dq) - at(&around[1].dq);
    let wider = at(&around[4].dq) - at(&around[0].dq);
    let ddq = (differences * 8.0 - wider) / (12.0 * step);
    let (q, dq) = (at(&now.q), at(&now.dq));
    let tree = go2::leg::<f64>(leg);
    let kinematics = tree.kinematics(&Transform::identity(), &q, &dq);
    let bodies = tree.inverse_dynamics_regressor::<BODIES>(&kinematics, &dq, &ddq);
    DMatrix::from_fn(JOINTS, columns.len(), |joint, c| match columns[c] {
        Column::Inertial(k) => bodies[(joint, k)],
        Column::Effect(effect, of) if of == joint => match effect {
            EffectKind::Viscous => dq[joint],
            EffectKind::Coulomb => dq[joint].signum(),
            EffectKind::Armature => ddq[joint],
            _ => 1.0,
        },
        Column::Effect(..) => 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a leg whose hip turns fast and slowly by turns.
    fn samples(count: u32) -> Vec<SimulatedSample> {
        let sample = |k: u32| {
            let t = 0.002 * f64::from(k);
            SimulatedSample {
                q_link: None,
                t,
                q: vec![0.0, 0.9, -1.7],
                dq: vec![(7.0 * t).sin(), 0.0, 0.0],
                tau: vec![0.0; JOINTS],
                temp: None,
            }
        };
        (0..count).map(sample).collect()
    }

    /// A constant torque: the standard deviation of a mean, σ/√n, and with memory √((1 + a)/(1 − a)) times as much.
    #[test]
    fn the_bound_of_a_constant_is_that_of_a_mean() {
        let samples = samples(10_000);
        for correlation in [0.0, 0.9] {
            let std = 0.1;
            let noise = TorqueNoise { std, correlation };
            let bound = bound(Leg::FR, &samples, &["bias:FR_calf"], noise).unwrap()[0];
            let memory = ((1.0 + correlation) / (1.0 - correlation)).sqrt();
            let mean = std * memory / (samples.len() as f64).sqrt();
            assert!((bound / mean - 1.0).abs() < 2e-3, "{bound} {mean}");
        }
    }

    /// Two that share a column cannot both be told; an unknown name has no bound.
    #[test]
    fn what_is_not_told_has_no_bound() {
        let noise = TorqueNoise {
            std: 0.1,
            correlation: 0.0,
        };
        let of = |names: &[&str]| bound(Leg::FR, &samples(500), names, noise);
        assert!(of(&["viscous:FR_hip", "bias:FR_hip", "armature:FR_hip"]).is_some());
        assert!(of(&["viscous:FR_thigh"]).is_none());
        assert!(of(&["viscous:FL_hip"]).is_none() && of(&["of:FR_hip"]).is_none());
    }
}

//! What the velocities' noise at a window's edges makes of its mean torque, where that is more than usual.
//!
//! A window's torque holds the change of the momentum between its edges. Where dry friction kinks a joint's velocity fewer samples tell it
//! ([`crate::trajectory`]), so that windows about a turn have more noise than others of the same joint. An effect at reversals would be found in
//! that noise.

use super::body::LimbBody;
use super::motion::Motion;
use super::values::Values;
use crate::robust;

/// Poses that the inertia is the mean of.
const POSES: usize = 16;

impl Motion {
    /// Standard deviation of each window's mean torque of each joint by its own velocity at the edges, beyond what is usual, N m.
    pub(crate) fn edge_noise(&self, body: &LimbBody, values: &Values) -> Vec<f64> {
        let n = self.joints;
        let inertia = self.usual_inertia(body, values);
        let variance = |j: usize, k: usize| self.joint[j].velocity_std[k].powi(2);
        let usual = |j: usize| {
            let all = (0..self.time.len()).map(|k| variance(j, k));
            robust::median(all).unwrap_or(0.0)
        };
        let usual: Vec<f64> = (0..n).map(usual).collect();
        let of = |window: &super::motion::Window| {
            let edges = |j: usize| window.samples.map(|k| variance(j, k) - usual[j]);
            let excess = |j: usize| edges(j).iter().sum::<f64>().max(0.0).sqrt();
            let own = (0..n).map(|j| inertia[j] * excess(j) / window.length);
            own.collect::<Vec<_>>()
        };
        self.windows.iter().flat_map(of).collect()
    }

    /// The inertia that each joint turns, the mean over some poses, kg m².
    fn usual_inertia(&self, body: &LimbBody, values: &Values) -> Vec<f64> {
        let n = self.joints;
        let (rigid, base) = (body.loaded(values), body.base(values));
        let (mut sum, mut own, mut torque) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let still = vec![0.0; n];
        for pose in 0..POSES {
            let k = pose * self.time.len() / POSES;
            let q: Vec<f64> = self.joint.iter().map(|joint| joint.state[k][0]).collect();
            rigid.torque_and_inertia(&base, [&q, &still, &still], &mut torque, &mut own);
            sum.iter_mut().zip(&own).for_each(|(sum, own)| *sum += own);
        }
        sum.iter_mut().for_each(|sum| *sum /= POSES as f64);
        sum
    }
}

//! What a window's mean torque may be off by where a joint moves faster than the noise of its channels lets one follow.
//!
//! A window's torque holds the change of the momentum between its edges. A smooth trajectory lacks what is beyond its cutoff, which noise pushes down:
//! after a turn under friction, where the acceleration rises within milliseconds, that is more than the rest of the residual. It is no effect of the
//! torque, and none is claimed from it.

use super::body::LimbBody;
use super::motion::{Motion, Window};
use super::values::Values;

/// Poses that the inertia is the mean of.
const POSES: usize = 16;

impl Motion {
    /// By how much each window's mean torque of a joint may be off, N m, and to which side: the momentum of the velocity that smoothing gave back
    /// ([`crate::trajectory::Trajectory::regained`]). With H the smoother's response that is H (1 − H) of the motion, and (1 − H)² still lacks: less, up to
    /// the cutoff, where H is a half.
    pub(crate) fn unfollowed(&self, body: &LimbBody, values: &Values, joint: usize) -> Vec<f64> {
        let inertia = self.usual_inertia(body, values, joint);
        let regained = &self.joint[joint].regained;
        let of = |window: &Window| {
            let [first, last] = window.samples;
            inertia * (regained[last] - regained[first]) / window.length
        };
        self.windows.iter().map(of).collect()
    }

    /// The inertia that a joint turns, the mean over some poses, kg m².
    pub(crate) fn usual_inertia(&self, body: &LimbBody, values: &Values, joint: usize) -> f64 {
        let n = self.joints;
        let (rigid, base) = (body.loaded(values), body.base(values));
        let (mut torque, mut inertia, still) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let at = |pose: usize| {
            let k = pose * self.time.len() / POSES;
            let q: Vec<f64> = self.joint.iter().map(|joint| joint.state[k][0]).collect();
            rigid.torque_and_inertia(&base, [&q, &still, &still], &mut torque, &mut inertia);
            inertia[joint]
        };
        (0..POSES).map(at).sum::<f64>() / POSES as f64
    }
}

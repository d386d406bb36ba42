//! What a window's mean torque may be off by where a joint moves faster than the noise of its channels lets one follow.
//!
//! A window's torque holds the change of the momentum between its edges. A smooth trajectory lacks what is beyond its cutoff, which noise pushes down:
//! after a turn under friction, where the acceleration rises within milliseconds, that is more than the rest of the residual. It is no effect of the
//! torque, and none is claimed from it.

use super::body::LimbBody;
use super::motion::{Motion, Window};
use super::values::Values;

impl Motion {
    /// By how much each window's mean torque of a joint may be off, N m, and to which side: the momentum of the velocity that smoothing gave back
    /// ([`crate::trajectory::Trajectory::regained`]). With H the smoother's response that is H (1 − H) of the motion, and (1 − H)² still lacks: less, up to
    /// the cutoff, where H is a half.
    pub(crate) fn unfollowed(&self, body: &LimbBody, values: &Values, joint: usize) -> Vec<f64> {
        let inertia = self.usual_inertia(body, values)[(joint, joint)];
        let regained = &self.joint[joint].regained;
        let of = |window: &Window| {
            let [first, last] = window.samples;
            inertia * (regained[last] - regained[first]) / window.length
        };
        self.windows.iter().map(of).collect()
    }
}

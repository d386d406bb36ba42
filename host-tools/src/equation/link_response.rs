//! How a limb's torques answer to a link that moves against its motor, to first order: the link's motion is worked out as the predictor
//! does, and what it changes of the torques by the slopes of momentum and rate along the motors' motion. Links move by hundredths of a
//! radian, to which the torques answer almost in proportion.

use crate::parallel::side_by_side;
use std::sync::Arc;

use super::body::LimbBody;
use super::joint_states::States;
use super::motion::Motion;
use super::rigid_body::Slopes;
use super::transmitted_torque_cache::Load;
use super::values::{Place, Values};

/// Loads that differ by no more than this share, root mean square of each joint, let links move alike: what responses explain differs
/// by a fifth.
const LIKE: f64 = 0.1;

/// How the torques of a limb's windows answer.
pub(crate) struct Responses {
    motion: Arc<Motion>,
    load: Arc<Load>,
    /// What gears have beside what is tried: friction inside a spring.
    values: Values,
    /// The windows, and at each of their samples how momentum and rate change with the motion.
    windows: Vec<usize>,
    slopes: Vec<Vec<Slopes>>,
}

impl Responses {
    /// Under a model, in these windows.
    pub(crate) fn of(
        motion: &Arc<Motion>,
        body: &LimbBody,
        values: &Values,
        windows: &[usize],
    ) -> Self {
        let (rigid, base) = (body.loaded(values), body.base(values));
        let encoders: Vec<_> = values.encoders().collect();
        let delay = values.delay(0);
        let joints = motion.late(delay);
        let of = |&w: &usize| -> Vec<Slopes> {
            let [first, last] = motion.windows[w].samples;
            let at = |k: usize| {
                let mut slopes = Slopes::of(motion.joints);
                let states = joints.iter().zip(&encoders).map(|(joint, encoder)| {
                    let [q, dq, ..] = joint.state[k];
                    let [q, dq] = encoder.motion([q, dq]);
                    (q, dq)
                });
                let (q, dq): (Vec<f64>, Vec<f64>) = states.unzip();
                rigid.slopes(&base, &q, &dq, &mut slopes);
                slopes
            };
            (first..=last).map(at).collect()
        };
        Self {
            load: motion.load(body, values, (true, delay)),
            slopes: side_by_side(windows, of),
            windows: windows.to_vec(),
            values: values.clone(),
            motion: motion.clone(),
        }
    }

    /// Whether they are much the same under another model.
    pub(crate) fn hold_for(&self, body: &LimbBody, values: &Values) -> bool {
        let load = (self.motion).load(body, values, (true, values.delay(0)));
        let n = self.motion.joints;
        (0..n).all(|joint| {
            let pairs = self.load.torque.iter().zip(&load.torque);
            let (mut change, mut square) = (0.0, 0.0);
            for (before, now) in pairs.skip(joint).step_by(n) {
                change += (now - before).powi(2);
                square += before.powi(2);
            }
            change <= LIKE * LIKE * square
        })
    }

    /// How many numbers a response has: of each window one of each joint.
    pub(crate) fn len(&self) -> usize {
        self.motion.joints * self.windows.len()
    }

    /// What a gap (rad) or a compliance (rad/(N m)) of this size changes of all joints' mean torques, N m, window by window.
    pub(crate) fn of_size(&self, place: Place, size: f64) -> Vec<f64> {
        let (motion, n) = (&self.motion, self.motion.joints);
        let mut links = States::still(n * motion.time.len());
        motion.loosen(&self.load, &self.values, (place, size), &mut links);
        let mut torque = vec![0.0; n * self.windows.len()];
        let windows = self.windows.iter().zip(&self.slopes);
        for ((&w, slopes), own) in windows.zip(torque.chunks_exact_mut(n)) {
            let window = &motion.windows[w];
            let [first, last] = window.samples;
            let moved = |k: usize| [links.q[k * n + place.1], links.dq[k * n + place.1]];
            for (j, own) in own.iter_mut().enumerate() {
                let at = |k: usize| slopes[k - first].along(place.1, moved(k), j);
                let (start, end) = (at(first).0, at(last).0);
                *own = (end - start) / window.length + motion.mean(window, |k| at(k).1);
            }
        }
        torque
    }
}

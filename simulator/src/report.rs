//! The torque that motors report: held between a controller's ticks, and as late as effects make it.

use std::collections::VecDeque;

use crate::effect::Effect;

/// Reported torques of joints, now and for as long before as the longest delay needs.
pub(super) struct ReportedTorque {
    /// Of each joint, s.
    delay: Vec<f64>,
    /// Period of the controller, s.
    period: f64,
    /// N m.
    now: Vec<f64>,
    /// Middles of the last holds, s, and what was reported in them; none if no joint's report is late.
    holds: VecDeque<(f64, Vec<f64>)>,
}

impl ReportedTorque {
    /// Of joints with these effects under a controller of this period, s.
    pub(super) fn new<'a>(
        period: f64,
        joints: impl Iterator<Item = &'a Vec<Box<dyn Effect>>>,
    ) -> Self {
        let delay: Vec<f64> = joints
            .map(|own| own.iter().map(|e| e.delay()).sum())
            .collect();
        Self {
            now: vec![0.0; delay.len()],
            delay,
            period,
            holds: VecDeque::new(),
        }
    }

    /// What is reported from the tick at `t` on, in a hold whose middle is at `middle`, s.
    pub(super) fn hold(&mut self, t: f64, middle: f64, torque: &[f64]) {
        self.now.copy_from_slice(torque);
        let longest = self.delay.iter().fold(0.0f64, |most, d| most.max(*d));
        if self.delay.iter().all(|delay| *delay == 0.0) {
            return;
        }
        self.holds.push_back((middle, torque.to_vec()));
        while self.holds.len() > 2 && self.holds[1].0 < t - longest - self.period {
            self.holds.pop_front();
        }
    }

    /// What each joint reports at time `t`: the torque of its delay ago, between the middles of two holds.
    pub(super) fn at(&self, t: f64) -> impl Iterator<Item = f64> {
        (0..self.now.len()).map(move |j| self.of_joint(j, t))
    }

    fn of_joint(&self, j: usize, t: f64) -> f64 {
        if self.delay[j] == 0.0 {
            return self.now[j];
        }
        let t = t - self.delay[j];
        let after = self.holds.partition_point(|(middle, _)| *middle <= t);
        let at = |n: usize| self.holds.get(n);
        match (after.checked_sub(1).and_then(at), at(after)) {
            (Some((t0, a)), Some((t1, b))) => a[j] + (b[j] - a[j]) * (t - t0) / (t1 - t0),
            (Some((_, held)), None) | (None, Some((_, held))) => held[j],
            (None, None) => self.now[j],
        }
    }
}

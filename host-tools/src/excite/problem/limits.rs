//! What a motion must keep to, as constraints that are satisfied where they are not positive.

use super::{Evaluation, Problem};
use crate::equation::dot::dot;
use crate::excite::clearance::{Clearance, Distances};
use crate::excite::limb::Instant;

/// What a joint may do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Least and greatest position, rad (m).
    pub position: [f64; 2],
    /// Greatest speed, rad/s (m/s).
    pub velocity: f64,
    /// Greatest acceleration, rad/s² (m/s²).
    pub acceleration: f64,
    /// Greatest torque, N m (N).
    pub torque: f64,
    /// Greatest mechanical power, W.
    pub power: f64,
}

/// Limits of a limb.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::excite) struct Limits {
    /// Joint by joint.
    pub joints: Vec<JointLimits>,
    /// By how much each inertial and effect parameter may be off, as a share of its value: the torque and power limits hold for
    /// all of them at once.
    pub uncertainty: f64,
    /// What must stay apart.
    pub clearance: Clearance,
    /// By how much, m.
    pub margin: f64,
}

/// Kinds of constraints of a joint at one instant: both sides of position, velocity, acceleration, torque and power.
const KINDS: usize = 10;
/// Their names.
const NAMES: [&str; 5] = ["position", "velocity", "acceleration", "torque", "power"];
/// The distance by which a clearance is counted, m.
const DISTANCE: f64 = 0.1;

impl Problem {
    /// Constraints at one instant.
    pub(super) fn per_sample(&self) -> usize {
        KINDS * self.joints() + self.limits.clearance.count()
    }

    /// How many constraints there are.
    pub(in crate::excite) fn constraints(&self) -> usize {
        self.per_sample() * self.basis.samples()
    }

    /// What the n-th constraint limits, and its joint.
    pub(in crate::excite) fn constraint(&self, n: usize) -> (String, Option<usize>) {
        let n = n % self.per_sample();
        if n < KINDS * self.joints() {
            (NAMES[n % KINDS / 2].to_owned(), Some(n / KINDS))
        } else {
            (self.limits.clearance.name(n - KINDS * self.joints()), None)
        }
    }

    /// All constraints at one instant, whatever the basis; W of that instant is `w`.
    pub(in crate::excite) fn constraints_at(&self, at: &Instant, w: &[f64]) -> Vec<f64> {
        let p = self.theta.len();
        let rigid = (0..self.joints()).map(|c| dot(&w[p * c..p * (c + 1)], &self.theta));
        let rigid: Vec<f64> = rigid.collect();
        let distances = self.limits.clearance.distances(self.limb.as_ref(), &at.q);
        let mut constraints = Vec::with_capacity(self.per_sample());
        self.constrain(at, w, &rigid, &distances, 1.0, &mut constraints);
        constraints
    }

    /// Torque foreseen at joint c and what it may be off by, N m.
    pub(in crate::excite) fn torque(
        &self,
        at: &Instant,
        w: &[f64],
        rigid: &[f64],
        c: usize,
    ) -> [f64; 2] {
        let p = self.theta.len();
        let row = &w[p * c..p * (c + 1)];
        let mut torque = rigid[c];
        let mut size: f64 = row
            .iter()
            .zip(&self.theta)
            .map(|(w, t)| (w * t).abs())
            .sum();
        for (column, value) in self.known.iter().filter(|(column, _)| column.joint == c) {
            let part = value * self.term(column, at, rigid).value;
            torque += part;
            size += part.abs();
        }
        [torque, self.limits.uncertainty * size]
    }

    pub(super) fn constrain(
        &self,
        at: &Instant,
        w: &[f64],
        rigid: &[f64],
        distances: &Distances,
        share: f64,
        to: &mut Vec<f64>,
    ) {
        for (c, limit) in self.limits.joints.iter().enumerate() {
            let [lower, upper] = limit.position;
            let range = (upper - lower).max(1e-9);
            let inset = (1.0 - share) * range / 2.0;
            let [torque, off] = self.torque(at, w, rigid, c);
            let both = |value: f64, most: f64| {
                [value / (most * share) - 1.0, -value / (most * share) - 1.0]
            };
            to.push((at.q[c] - upper + inset) / range);
            to.push((lower + inset - at.q[c]) / range);
            to.extend(both(at.dq[c], limit.velocity));
            to.extend(both(at.ddq[c], limit.acceleration));
            let most = limit.torque * share;
            to.extend([(torque + off) / most - 1.0, (off - torque) / most - 1.0]);
            let (power, off) = (torque * at.dq[c], off * at.dq[c].abs());
            let most = limit.power * share;
            to.extend([(power + off) / most - 1.0, (off - power) / most - 1.0]);
        }
        let margin = self.limits.margin + (1.0 - share) * DISTANCE;
        to.extend(distances.all.iter().map(|d| (margin - d.value) / DISTANCE));
    }

    pub(super) fn push_constraints(
        &self,
        of: &Evaluation,
        s: usize,
        pushes: &[f64],
        share: f64,
        by: &mut Instant,
        g: &mut [f64],
    ) {
        let p = self.theta.len();
        let at = &of.instants[s];
        for (c, limit) in self.limits.joints.iter().enumerate() {
            let push = &pushes[KINDS * c..KINDS * (c + 1)];
            if push.iter().all(|x| *x == 0.0) {
                continue;
            }
            let range = (limit.position[1] - limit.position[0]).max(1e-9);
            by.q[c] += (push[0] - push[1]) / range;
            by.dq[c] += (push[2] - push[3]) / (limit.velocity * share);
            by.ddq[c] += (push[4] - push[5]) / (limit.acceleration * share);
            let [torque, off] = self.torque(at, of.regressor(s), &of.torques[s], c);
            let (most, dq) = (limit.torque * share, at.dq[c]);
            let strongest = limit.power * share;
            by.dq[c] += ((push[8] - push[9]) * torque + (push[8] + push[9]) * off * dq.signum())
                / strongest;
            let on_torque = (push[6] - push[7]) / most + (push[8] - push[9]) * dq / strongest;
            let on_size = self.limits.uncertainty
                * ((push[6] + push[7]) / most + (push[8] + push[9]) * dq.abs() / strongest);
            let row = &of.regressor(s)[p * c..p * (c + 1)];
            for ((g, w), theta) in g[p * c..p * (c + 1)].iter_mut().zip(row).zip(&self.theta) {
                *g += theta * (on_torque + on_size * (w * theta).signum());
            }
            for (column, value) in self.known.iter().filter(|(column, _)| column.joint == c) {
                let term = self.term(column, at, &of.torques[s]);
                let sign = (value * term.value).signum();
                self.push_term(&term, value * (on_torque + on_size * sign), c, by, g);
            }
        }
        let own = &pushes[KINDS * self.joints()..];
        for (n, push) in own.iter().enumerate().filter(|(_, push)| **push != 0.0) {
            of.distances[s].push(n, -push / DISTANCE, &mut by.q);
        }
    }
}

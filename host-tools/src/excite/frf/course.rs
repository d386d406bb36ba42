//! Where the joints are asked to be: the carrier, and the ways between points.

use super::Part;
use super::lines::carrier_cycles;
use crate::excite::interval::Interval;
use crate::excite::proof::Stretch;

/// Size of the carrier, rad or m, at most: inertia changes by some per cent along it.
const SIZE: f64 = 0.06;
/// Shares of a joint's range, greatest speed and greatest acceleration that it takes at most.
const OF_RANGE: f64 = 0.05;
const OF_SPEED: f64 = 0.3;
const OF_ACCELERATION: f64 = 0.3;
/// Instants of a cycle of the carrier at which the robot's inertia is averaged: more than its fourth harmonic needs.
const INSTANTS: usize = 12;
/// The shortest way from point to point, s.
const SHORTEST: f64 = 2.0;

/// The slow sine of all joints.
pub(super) struct Carrier {
    /// rad/s.
    pub(super) omega: f64,
    /// Of each joint, rad or m.
    pub(super) sizes: Vec<f64>,
    /// The least number of cycles that are a whole number of samples.
    cycles: usize,
}

impl Carrier {
    /// Of these joints, with a whole number of cycles in a period of `period` seconds and `length` samples.
    pub(super) fn new(parts: &[Part], period: f64, length: usize) -> Self {
        let in_period = carrier_cycles(period);
        let omega = std::f64::consts::TAU * in_period as f64 / period;
        let whole = |n: &usize| (n * length).is_multiple_of(in_period);
        let cycles = (1..in_period).find(whole).unwrap_or(in_period);
        let limits = parts.iter().flat_map(|part| &part.problem.limits.joints);
        let size = |limit: &crate::excite::JointLimits| {
            let range = limit.position[1] - limit.position[0];
            SIZE.min(OF_RANGE * range)
                .min(OF_SPEED * limit.velocity / omega)
                .min(OF_ACCELERATION * limit.acceleration / (omega * omega))
        };
        Self {
            omega,
            sizes: limits.map(size).collect(),
            cycles,
        }
    }

    /// Hz.
    pub(super) fn frequency(&self) -> f64 {
        self.omega / std::f64::consts::TAU
    }

    /// A cycle, s.
    pub(super) fn cycle(&self) -> f64 {
        std::f64::consts::TAU / self.omega
    }

    /// Cycles that are a whole number of samples, s.
    fn step(&self) -> f64 {
        self.cycles as f64 * self.cycle()
    }

    /// Position, velocity, acceleration of joint j at `t`. Joints turn back one after the other, a radian of the cycle apart, so that no instant has all at
    /// rest.
    fn at(&self, j: usize, t: f64) -> [f64; 3] {
        let angle = self.omega * t + j as f64;
        let size = self.sizes[j];
        [
            size * angle.sin(),
            size * self.omega * angle.cos(),
            -size * self.omega * self.omega * angle.sin(),
        ]
    }
}

/// A way from one point to another, half a cosine long, with the carrier on it.
pub(super) struct Way {
    from: Vec<f64>,
    to: Vec<f64>,
    /// The carrier's share at the beginning and at the end.
    fade: [f64; 2],
    /// s; infinite: it stays where it is.
    duration: f64,
    pub(super) samples: usize,
}

impl Way {
    /// Staying at a point.
    pub(super) fn held(point: &[f64]) -> Self {
        Self {
            from: point.to_vec(),
            to: point.to_vec(),
            fade: [1.0; 2],
            duration: f64::INFINITY,
            samples: 0,
        }
    }

    /// A way whose speed and acceleration leave the carrier its part: as many of the carrier's cycles as that takes.
    pub(super) fn between(
        [from, to]: [&[f64]; 2],
        fade: [f64; 2],
        parts: &[Part],
        slow: &Carrier,
        rate: f64,
    ) -> Self {
        let limits = parts.iter().flat_map(|part| &part.problem.limits.joints);
        let mut shortest = SHORTEST;
        for (j, limit) in limits.enumerate() {
            let far = (to[j] - from[j]).abs();
            let half = std::f64::consts::FRAC_PI_2;
            // Greatest speed π/2 · far/T, greatest acceleration π²/2 · far/T².
            shortest = shortest
                .max(half * far / ((1.0 - OF_SPEED) * 0.9 * limit.velocity))
                .max(
                    (2.0 * half * half * far
                        / ((1.0 - OF_ACCELERATION) * 0.9 * limit.acceleration))
                        .sqrt(),
                );
        }
        // The carrier goes on without a jump: it begins anew at each part of the plan.
        let duration = (shortest / slow.step()).ceil() * slow.step();
        Self {
            from: from.to_vec(),
            to: to.to_vec(),
            fade,
            duration,
            samples: (duration * rate).round() as usize,
        }
    }

    /// s; of one that stays a cycle of the carrier.
    pub(super) fn length(&self, slow: &Carrier) -> f64 {
        if self.duration.is_finite() {
            self.duration
        } else {
            slow.cycle()
        }
    }

    /// Position, velocity, acceleration of each joint `t` after its begin, where the carrier begins a cycle.
    pub(super) fn at(&self, slow: &Carrier, t: f64) -> Vec<[f64; 3]> {
        let (share, rate, bend) = if self.duration.is_finite() {
            let w = std::f64::consts::PI / self.duration;
            let (sin, cos) = (w * t).sin_cos();
            (0.5 - 0.5 * cos, 0.5 * w * sin, 0.5 * w * w * cos)
        } else {
            (0.0, 0.0, 0.0)
        };
        let [f, g] = self.fade;
        let (w, dw, ddw) = (f + (g - f) * share, (g - f) * rate, (g - f) * bend);
        let of = |j: usize| {
            let far = self.to[j] - self.from[j];
            let [q, dq, ddq] = slow.at(j, t);
            [
                self.from[j] + far * share + w * q,
                far * rate + w * dq + dw * q,
                far * bend + w * ddq + 2.0 * dw * dq + ddw * q,
            ]
        };
        (0..self.from.len()).map(of).collect()
    }

    /// Positions at some instants of the carrier's cycle.
    pub(super) fn path(&self, slow: &Carrier) -> Vec<Vec<f64>> {
        let at = |k: usize| self.at(slow, k as f64 / INSTANTS as f64 * slow.cycle());
        let positions = |at: Vec<[f64; 3]>| at.iter().map(|x| x[0]).collect();
        (0..INSTANTS).map(|k| positions(at(k))).collect()
    }

    /// What joints `joints` may do about `middle`, grown by how far the excitation moves them and how fast. The k-th derivative is at most
    /// far/2 · (π/T)^k + A (ω + π/T)^k.
    pub(super) fn enclosed(
        &self,
        slow: &Carrier,
        joints: std::ops::Range<usize>,
        [middle, half]: [f64; 2],
        [swing, speed]: [&[f64]; 2],
    ) -> Stretch {
        let w = if self.duration.is_finite() {
            std::f64::consts::PI / self.duration
        } else {
            0.0
        };
        let at = self.at(slow, middle);
        let bend = half * half / 2.0;
        let mut of = Stretch {
            q: Vec::new(),
            dq: Vec::new(),
            ddq: Vec::new(),
        };
        for j in joints {
            let far = (self.to[j] - self.from[j]).abs();
            let bound = |k: i32| 0.5 * far * w.powi(k) + slow.sizes[j] * (slow.omega + w).powi(k);
            let [q, dq, ddq] = at[j];
            of.q.push(Interval::around(
                q,
                half * dq.abs() + bend * bound(2) + swing[j],
            ));
            of.dq.push(Interval::around(
                dq,
                half * ddq.abs() + bend * bound(3) + speed[j],
            ));
            of.ddq.push(Interval::around(ddq, half * bound(3)));
        }
        of
    }
}

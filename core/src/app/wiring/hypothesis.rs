//! What may be wrong with a leg's readings, and what they would then have been.
//!
//! Each hypothesis is a map of readings: applied to those of a leg that has the fault, it gives those of a leg as the CAD has it. So one model,
//! one prior and one fit serve all of them.
//!
//! Front and rear legs of one side move alike on a fixed base (their CAD differs where no torque tells: the hip's moment along its own axis), so
//! that no hypothesis is of them.

use crate::go2::{ACTUATORS, JOINTS_PER_LEG};
use crate::wire::Fault;
use core::f64::consts::TAU;

/// A closed window of a leg: what hypotheses need of it. Single precision, beyond what a bus tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    /// Its length, s.
    pub(super) seconds: f32,
    /// Positions, rad, and velocities, rad/s, at its start and its end.
    pub(super) q: [[f32; JOINTS_PER_LEG]; 2],
    pub(super) dq: [[f32; JOINTS_PER_LEG]; 2],
    /// Mean torques, N m.
    pub(super) tau: [f32; JOINTS_PER_LEG],
    /// Means of the velocities' signs: the column of Coulomb friction.
    pub(super) sign: [f32; JOINTS_PER_LEG],
}

impl Reading {
    /// None.
    pub(super) const ZERO: Self = Self {
        seconds: 0.0,
        q: [[0.0; JOINTS_PER_LEG]; 2],
        dq: [[0.0; JOINTS_PER_LEG]; 2],
        tau: [0.0; JOINTS_PER_LEG],
        sign: [0.0; JOINTS_PER_LEG],
    };
}

/// What the host said of a leg's joints when it set their zeros.
#[derive(Clone, Copy, Debug)]
pub(in crate::app) struct Said {
    /// Each joint's angle, rad.
    pub(in crate::app) angles: [f32; JOINTS_PER_LEG],
    /// Motors that turn against their joints, bit n for the n-th joint.
    pub(in crate::app) reversed: u8,
}

/// All hypotheses; the first is that nothing is wrong.
pub(super) const HYPOTHESES: [Option<Fault>; 17] = [
    None,
    Some(Fault::TorqueSign { joint: 0 }),
    Some(Fault::TorqueSign { joint: 1 }),
    Some(Fault::TorqueSign { joint: 2 }),
    Some(Fault::Reversed { joint: 0 }),
    Some(Fault::Reversed { joint: 1 }),
    Some(Fault::Reversed { joint: 2 }),
    Some(Fault::Exchanged { joints: [0, 1] }),
    Some(Fault::Exchanged { joints: [0, 2] }),
    Some(Fault::Exchanged { joints: [1, 2] }),
    Some(Fault::OtherSide),
    turn(0, 1),
    turn(0, -1),
    turn(1, 1),
    turn(1, -1),
    turn(2, 1),
    turn(2, -1),
];

const fn turn(joint: u8, turns: i8) -> Option<Fault> {
    Some(Fault::Turns { joint, turns })
}

/// The readings of a leg as it should be, from those of one that has this fault.
pub(super) fn mend(fault: Option<Fault>, said: &Said, reading: &mut Reading) {
    match fault {
        None | Some(Fault::Velocity { .. } | Fault::OtherSideOrReversed) => {}
        Some(Fault::TorqueSign { joint }) => {
            if let Some(tau) = reading.tau.get_mut(usize::from(joint)) {
                *tau = -*tau;
            }
        }
        // The zero was set where the joint is `angle`: there both directions agree.
        Some(Fault::Reversed { joint }) => {
            let joint = usize::from(joint);
            let angle = said.angles.get(joint).copied().unwrap_or_default();
            turn_round(reading, joint, angle);
        }
        // A mirrored leg moves as this one with its hip turning the other way about 0.
        Some(Fault::OtherSide) => turn_round(reading, 0, 0.0),
        Some(Fault::Exchanged { joints }) => exchange(reading, joints.map(usize::from), said),
        Some(Fault::Turns { joint, turns }) => {
            let joint = usize::from(joint);
            let gear = ACTUATORS.get(joint).map_or(1.0, |actuator| actuator.gear);
            let turned = f64::from(-turns) * TAU / gear;
            for q in &mut reading.q {
                if let Some(q) = q.get_mut(joint) {
                    *q += turned as f32;
                }
            }
        }
    }
}

fn turn_round(reading: &mut Reading, joint: usize, angle: f32) {
    for q in &mut reading.q {
        if let Some(q) = q.get_mut(joint) {
            *q = 2.0 * angle - *q;
        }
    }
    let [start, end] = &mut reading.dq;
    for of in [start, end, &mut reading.tau, &mut reading.sign] {
        if let Some(x) = of.get_mut(joint) {
            *x = -*x;
        }
    }
}

/// Each of two motors was heard in the other's place, when its zero was set as well: counts are its own, angles the other joint's.
fn exchange(reading: &mut Reading, joints: [usize; 2], said: &Said) {
    let before = *reading;
    let flag = |joint: usize| said.reversed >> joint & 1 == 1;
    for [to, from] in [joints, [joints[1], joints[0]]] {
        let (Some(own), Some(other)) = (ACTUATORS.get(to), ACTUATORS.get(from)) else {
            return;
        };
        let sign = if flag(to) == flag(from) { 1.0 } else { -1.0 };
        let speed = sign * (other.gear / own.gear) as f32;
        let angle = |joint: usize| said.angles.get(joint).copied().unwrap_or_default();
        let of = |numbers: &[f32; JOINTS_PER_LEG]| numbers.get(from).copied().unwrap_or_default();
        let put = |place: &mut [f32; JOINTS_PER_LEG], number: f32| {
            if let Some(place) = place.get_mut(to) {
                *place = number;
            }
        };
        for (q, read) in reading.q.iter_mut().zip(&before.q) {
            put(q, angle(to) + (of(read) - angle(from)) * speed);
        }
        for (dq, read) in reading.dq.iter_mut().zip(&before.dq) {
            put(dq, of(read) * speed);
        }
        let torque = sign * (own.gear / other.gear) as f32;
        put(&mut reading.tau, of(&before.tau) * torque);
        put(&mut reading.sign, of(&before.sign) * sign);
    }
}

//! References for the joints: smooth, within the limits, at rest at the start.

use std::f64::consts::TAU;

use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// The kind of reference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Sums of sines whose frequencies no two joints share, phases by the seed: excites every identifiable parameter.
    Multisine,
    /// One sweep from 0.1 to 9 Hz that all joints follow in phase, as in published recordings: excites friction and
    /// rotor inertia, but little of the links' inertia.
    Chirp,
}

/// Middle of each joint's motion, rad: a leg bent as in standing.
const CENTRE: [f64; JOINTS_PER_LEG] = [0.0, 0.9, -1.7];
/// Greatest excursion from it, rad.
const REACH: [f64; JOINTS_PER_LEG] = [0.6, 0.8, 0.75];
/// Sines per joint.
const SINES: usize = 6;
/// Spacing of the frequencies, Hz: the reference repeats after 10 s.
const BASE_FREQUENCY: f64 = 0.1;
/// The reference grows to its full size over this time, s.
const RAMP: f64 = 1.0;
/// Frequencies of the chirp at its start and end, Hz, and its length, s.
const CHIRP: (f64, f64, f64) = (0.1, 9.0, 20.0);
/// Excursion of the chirp, rad.
const CHIRP_REACH: [f64; JOINTS_PER_LEG] = [0.12, 0.2, 0.25];

/// A reference for one leg.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    motion: Motion,
    centre: [f64; JOINTS_PER_LEG],
    /// Frequency (rad/s), amplitude (rad), phase (rad) of each sine of each joint.
    sines: [[(f64, f64, f64); SINES]; JOINTS_PER_LEG],
}

impl Reference {
    pub(super) fn new(motion: Motion, leg: Leg, rng: &mut ChaCha8Rng) -> Self {
        // The legs' hips turn outwards a little, mirrored.
        let side = if matches!(leg, Leg::FL | Leg::RL) {
            1.0
        } else {
            -1.0
        };
        let mut centre = CENTRE;
        centre[0] += 0.1 * side;
        let sines = std::array::from_fn(|joint| {
            let mut sines: [_; SINES] = std::array::from_fn(|n| {
                // 0.1, 0.4, 0.9 … Hz for the hip, a step more for each further joint: no frequency is shared.
                let multiple = (n * n * JOINTS_PER_LEG + joint + 1) as f64;
                let frequency = TAU * BASE_FREQUENCY * multiple;
                // Equal speed at every frequency, within bounds on either side.
                (
                    frequency,
                    1.0 / (multiple + 5.0),
                    rng.random_range(0.0..TAU),
                )
            });
            let sum: f64 = sines.iter().map(|sine| sine.1).sum();
            sines
                .iter_mut()
                .for_each(|sine| sine.1 *= REACH[joint] / sum);
            sines
        });
        Self {
            motion,
            centre,
            sines,
        }
    }

    /// Position (rad) and velocity (rad/s) asked for at time `t`, s.
    pub(super) fn at(&self, t: f64) -> ([f64; JOINTS_PER_LEG], [f64; JOINTS_PER_LEG]) {
        let (size, growth) = ramp(t);
        let mut position = self.centre;
        let mut velocity = [0.0; JOINTS_PER_LEG];
        for joint in 0..JOINTS_PER_LEG {
            let (offset, rate) = match self.motion {
                Motion::Multisine => multisine(&self.sines[joint], t),
                Motion::Chirp => chirp(CHIRP_REACH[joint], t),
            };
            position[joint] += size * offset;
            velocity[joint] = size * rate + growth * offset;
        }
        (position, velocity)
    }
}

/// Size and its rate of change: a half cosine from 0 to 1, so that nothing jumps.
fn ramp(t: f64) -> (f64, f64) {
    let phase = (t / RAMP).clamp(0.0, 1.0) * TAU / 2.0;
    (
        0.5 - 0.5 * phase.cos(),
        0.5 * phase.sin() * TAU / 2.0 / RAMP,
    )
}

fn multisine(sines: &[(f64, f64, f64)], t: f64) -> (f64, f64) {
    sines
        .iter()
        .fold((0.0, 0.0), |(q, dq), &(frequency, amplitude, phase)| {
            let (sin, cos) = (frequency * t + phase).sin_cos();
            (q + amplitude * sin, dq + amplitude * frequency * cos)
        })
}

/// Sweeps up and starts anew; the phase is continuous within a sweep and zero at its ends.
fn chirp(reach: f64, t: f64) -> (f64, f64) {
    let (start, end, length) = CHIRP;
    let t = t.rem_euclid(length);
    let frequency = start + (end - start) * t / length;
    let (sin, cos) = (TAU * (start + frequency) / 2.0 * t).sin_cos();
    (reach * sin, reach * TAU * frequency * cos)
}

//! References for the joints: smooth, within the limits, at rest at the start.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
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
    /// Moves at constant speeds from 0.03 to 8 rad/s, each joint on its own, with rests between: excites what depends on
    /// speed near standstill as well as inertia.
    Moves,
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

/// Slowest and fastest constant speed of the moves, rad/s, log-uniform between.
const SPEEDS: (f64, f64) = (0.03, 8.0);
/// Shortest and longest move, s, and longest rest between two.
const MOVE: (f64, f64) = (0.2, 1.2);
const REST: f64 = 0.4;
/// Share of the moves that a rest follows.
const RESTING: f64 = 0.25;
/// Share of a move in which its speed grows, and in which it falls.
const EDGE: f64 = 0.3;

/// Position (rad), velocity (rad/s) and acceleration (rad/s²) asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wanted {
    pub(super) q: Vector3<f64>,
    pub(super) dq: Vector3<f64>,
    pub(super) ddq: Vector3<f64>,
}

/// A reference for one leg.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    motion: Motion,
    centre: [f64; JOINTS_PER_LEG],
    moves: [Vec<Move>; JOINTS_PER_LEG],
    /// Frequency (rad/s), amplitude (rad), phase (rad) of each sine of each joint.
    sines: [[(f64, f64, f64); SINES]; JOINTS_PER_LEG],
}

impl Reference {
    /// A reference for `duration` seconds.
    pub(super) fn new(motion: Motion, leg: Leg, duration: f64, rng: &mut ChaCha8Rng) -> Self {
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
        let moves = std::array::from_fn(|joint| match motion {
            Motion::Moves => moves(REACH[joint], duration, rng),
            Motion::Multisine | Motion::Chirp => Vec::new(),
        });
        Self {
            motion,
            centre: centre(leg),
            moves,
            sines,
        }
    }

    /// What is asked for at time `t`, s.
    pub(super) fn at(&self, t: f64) -> Wanted {
        let size = ramp(t);
        let mut wanted = Wanted {
            q: self.centre.into(),
            dq: Vector3::zeros(),
            ddq: Vector3::zeros(),
        };
        for joint in 0..JOINTS_PER_LEG {
            let [q, dq, ddq] = match self.motion {
                Motion::Multisine => product(size, multisine(&self.sines[joint], t)),
                Motion::Chirp => product(size, chirp(CHIRP_REACH[joint], t)),
                Motion::Moves => along(&self.moves[joint], t),
            };
            wanted.q[joint] += q;
            wanted.dq[joint] = dq;
            wanted.ddq[joint] = ddq;
        }
        wanted
    }
}

/// The middle of each joint's motion, rad: the legs' hips turn outwards a little, mirrored.
pub(super) fn centre(leg: Leg) -> [f64; JOINTS_PER_LEG] {
    let mut centre = CENTRE;
    let left = matches!(leg, Leg::FL | Leg::RL);
    centre[0] += if left { 0.1 } else { -0.1 };
    centre
}

/// Size and its first two derivatives: a half cosine from 0 to 1, so that nothing jumps.
fn ramp(t: f64) -> [f64; 3] {
    if t >= RAMP {
        return [1.0, 0.0, 0.0];
    }
    let rate = PI / RAMP;
    let (sin, cos) = (rate * t.max(0.0)).sin_cos();
    [0.5 - 0.5 * cos, 0.5 * rate * sin, 0.5 * rate * rate * cos]
}

/// A product and its first two derivatives.
fn product(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[0] * b[0],
        a[1] * b[0] + a[0] * b[1],
        a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2],
    ]
}

fn multisine(sines: &[(f64, f64, f64)], t: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for &(frequency, amplitude, phase) in sines {
        let (sin, cos) = (frequency * t + phase).sin_cos();
        sum[0] += amplitude * sin;
        sum[1] += amplitude * frequency * cos;
        sum[2] -= amplitude * frequency * frequency * sin;
    }
    sum
}

/// Sweeps up and starts anew; the phase is continuous within a sweep and zero at its ends.
fn chirp(reach: f64, t: f64) -> [f64; 3] {
    let (start, end, length) = CHIRP;
    let t = t.rem_euclid(length);
    let frequency = start + (end - start) * t / length;
    let (sin, cos) = (TAU * (start + frequency) / 2.0 * t).sin_cos();
    let rate = TAU * frequency;
    let growth = TAU * (end - start) / length;
    [
        reach * sin,
        reach * rate * cos,
        reach * (growth * cos - rate * rate * sin),
    ]
}

/// One move at constant speed, its ends rounded by half cosines of the velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Move {
    start: f64,
    length: f64,
    from: f64,
    speed: f64,
}

impl Move {
    fn end(&self) -> f64 {
        self.from + self.speed * self.length * (1.0 - EDGE)
    }

    fn at(&self, t: f64) -> [f64; 3] {
        let edge = EDGE * self.length;
        let t = t - self.start;
        if t <= 0.0 {
            return [self.from, 0.0, 0.0];
        }
        if t >= self.length {
            return [self.end(), 0.0, 0.0];
        }
        // The second half is the first one seen from the end.
        let from_end = t > self.length / 2.0;
        let s = if from_end { self.length - t } else { t };
        let rate = PI / edge;
        let (sin, cos) = (rate * s.min(edge)).sin_cos();
        let distance = if s < edge {
            0.5 * (s - sin / rate)
        } else {
            s - edge / 2.0
        };
        let [way, acceleration] = [self.speed * distance, self.speed * 0.5 * rate * sin];
        let velocity = self.speed * (0.5 - 0.5 * cos);
        if from_end {
            [self.end() - way, velocity, -acceleration]
        } else {
            [self.from + way, velocity, acceleration]
        }
    }
}

/// Moves within ±`reach` about zero, where they begin.
fn moves(reach: f64, duration: f64, rng: &mut ChaCha8Rng) -> Vec<Move> {
    let mut moves = Vec::new();
    let (mut t, mut at) = (0.2, 0.0f64);
    while t < duration {
        let speed = SPEEDS.0 * (SPEEDS.1 / SPEEDS.0).powf(rng.random_range(0.0..1.0));
        let length = rng.random_range(MOVE.0..MOVE.1);
        // To the side with more room; a fast move is as long as there is room.
        let backwards = rng.random_range(-reach..reach) < at;
        let room = reach + if backwards { at } else { -at };
        let longest = room / (speed * (1.0 - EDGE));
        // A move too short for its speed would ask for more acceleration than the motor has.
        let (speed, length) = if longest < MOVE.0 {
            (speed * longest / MOVE.0, MOVE.0)
        } else {
            (speed, length.min(longest))
        };
        let next = Move {
            start: t,
            length,
            from: at,
            speed: if backwards { -speed } else { speed },
        };
        at = next.end();
        t += length;
        moves.push(next);
        if rng.random_bool(RESTING) {
            t += rng.random_range(0.0..REST);
        }
    }
    moves
}

/// Where the moves are at time `t`.
fn along(moves: &[Move], t: f64) -> [f64; 3] {
    let begun = moves.partition_point(|m| m.start <= t);
    match begun.checked_sub(1).and_then(|n| moves.get(n)) {
        Some(current) => current.at(t),
        None => [0.0; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::go2::ACTUATORS;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn velocity_and_acceleration_are_the_slopes_of_the_position() {
        let h = 1e-5;
        for motion in [Motion::Multisine, Motion::Chirp, Motion::Moves] {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let reference = Reference::new(motion, Leg::RR, 20.0, &mut rng);
            for n in 1..3000 {
                let t = 0.00613 * f64::from(n);
                let [before, now, after] = [t - h, t, t + h].map(|t| reference.at(t));
                let dq = (after.q - before.q) / (2.0 * h);
                let ddq = (after.dq - before.dq) / (2.0 * h);
                assert!((dq - now.dq).amax() < 1e-4, "{motion:?} at {t} s");
                assert!((ddq - now.ddq).amax() < 0.3, "{motion:?} at {t} s");
            }
        }
    }

    #[test]
    fn moves_are_slow_and_fast_and_rest() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let reference = Reference::new(Motion::Moves, Leg::FL, 20.0, &mut rng);
        for joint in 0..JOINTS_PER_LEG {
            let speeds: Vec<f64> = (0..4000)
                .map(|n| reference.at(0.005 * f64::from(n)).dq[joint].abs())
                .collect();
            let share = |low: f64, high: f64| {
                speeds.iter().filter(|v| (low..high).contains(*v)).count() as f64 / 4000.0
            };
            assert!(share(0.0, 1e-9) > 0.02, "rests {}", share(0.0, 1e-9));
            assert!(share(0.01, 0.2) > 0.15, "slow {}", share(0.01, 0.2));
            assert!(share(1.0, 10.0) > 0.07, "fast {}", share(1.0, 10.0));
            assert!(share(ACTUATORS[joint].velocity, f64::INFINITY) == 0.0);
        }
    }
}

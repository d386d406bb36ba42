//! What a power-up makes of a simulated robot's motors: from where each counts, and in which direction it turns.

use proprio_core::bus::Reply;
use proprio_core::go2::{JOINTS_PER_LEG, LEGS, Leg};

/// Counts of a turn of the rotor.
const TURN: i32 = 32768;
/// Turns by which a simulated motor's zero is off at most.
const TURNS: i32 = 10;

/// Each motor's count where its joint's angle is 0, and whether the motor turns against the joint, by leg and joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PowerUp([[(i32, bool); JOINTS_PER_LEG]; LEGS]);

impl PowerUp {
    /// Positions are angles, and motors turn as their joints do: what no real power-up is.
    pub const NONE: Self = Self([[(0, false); JOINTS_PER_LEG]; LEGS]);

    /// One of many: any count within ten turns, either direction.
    pub fn random(seed: u64) -> Self {
        let mut state = seed;
        // SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014.
        let mut next = move || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            mixed ^ mixed >> 31
        };
        let span = 2 * TURNS * TURN;
        Self([(); LEGS].map(|()| {
            [(); JOINTS_PER_LEG].map(|()| {
                let count = (next() % span as u64) as i32 - span / 2;
                (count, next() % 2 == 1)
            })
        }))
    }

    /// Whether a joint's motor turns against it.
    pub fn is_reversed(&self, leg: Leg, joint: usize) -> bool {
        self.0[leg.index()][joint].1
    }

    /// A reply of a motor that counts from the joint's zero, as this power-up has it.
    pub fn counted(&self, leg: Leg, joint: usize, reply: Reply) -> Reply {
        let (zero, reversed) = self.0[leg.index()][joint];
        let sign = if reversed { -1 } else { 1 };
        Reply {
            position: reply.position.wrapping_mul(sign).wrapping_add(zero),
            speed: reply.speed.wrapping_mul(sign as i16),
            torque: reply.torque.wrapping_mul(sign as i16),
            ..reply
        }
    }
}

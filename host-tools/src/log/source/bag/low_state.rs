//! Unitree's `LowState` and `LowCmd`: arrays of fixed length only, so that every number has its place.
//!
//! The places follow from the message definitions of unitree_ros2 (packages `unitree_go` and `unitree_hg`) by the alignment of CDR, counted from
//! after the encapsulation header. A state says when it was made as `tick`, in milliseconds of the robot's controller; a command does not. Motors are
//! named by their number, as the message numbers them; which joint that is, is the robot's affair.

use super::Decoder;
use crate::log::error::Problem;

/// Bytes before the fields: the encapsulation header.
const HEADER: usize = 4;

#[derive(Debug, Clone, Copy)]
enum Number {
    F32,
    /// Single precision, of which such a number or a greater one stands for none.
    Below(f64),
    I16,
    I8,
}

/// What Unitree's controllers write as position and as velocity where there is none to follow: `PosStopF` and `VelStopF` of its SDK.
const STOPS: [f64; 2] = [2.146e9, 16_000.0];

/// Where a kind of message keeps what.
pub(super) struct LowLevel {
    kind: &'static str,
    /// Length of a message with its header, bytes.
    length: usize,
    tick: Option<usize>,
    cells: Vec<Cell>,
}

/// A number's name, place and kind.
type Cell = (String, usize, Number);

/// The part of a state that is an array of motors.
struct Motors {
    count: usize,
    /// Place of the first motor's position.
    q: usize,
    /// Bytes from motor to motor.
    stride: usize,
    tau: usize,
    temperature: (usize, Number),
}

impl LowLevel {
    /// Decodes messages of `kind`, if it is one of Unitree's that are read.
    pub(super) fn new(kind: &str) -> Option<Self> {
        let (kind, tick, cells) = match kind {
            "unitree_go/msg/LowState" => ("unitree_go/msg/LowState", Some(1096), Self::go()),
            "unitree_hg/msg/LowState" => ("unitree_hg/msg/LowState", Some(12), Self::hg()),
            "unitree_go/msg/LowCmd" => ("unitree_go/msg/LowCmd", None, commands(20, 24, 36)),
            "unitree_hg/msg/LowCmd" => ("unitree_hg/msg/LowCmd", None, commands(35, 4, 28)),
            _ => return None,
        };
        Some(Self {
            kind,
            length: Self::length(kind)?,
            tick,
            cells,
        })
    }

    /// Length of a message of `kind` with its header, bytes, if it is one of Unitree's that are read.
    pub(super) fn length(kind: &str) -> Option<usize> {
        let fields = match kind {
            "unitree_go/msg/LowState" => 1176,
            "unitree_hg/msg/LowState" => 2088,
            "unitree_go/msg/LowCmd" => 808,
            "unitree_hg/msg/LowCmd" => 1000,
            _ => return None,
        };
        Some(HEADER + fields)
    }

    /// Of the quadrupeds and the H1: twenty motors, four feet.
    fn go() -> Vec<Cell> {
        let mut cells = motors(&Motors {
            count: 20,
            q: 80,
            stride: 48,
            tau: 12,
            temperature: (28, Number::I8),
        });
        cells.extend(imu(24));
        cells.extend((0..4).map(|n| (format!("foot_force[{n}]"), 1080 + 2 * n, Number::I16)));
        cells
    }

    /// Of the humanoids: 35 motors.
    fn hg() -> Vec<Cell> {
        let mut cells = motors(&Motors {
            count: 35,
            q: 72,
            stride: 56,
            tau: 12,
            temperature: (16, Number::I16),
        });
        cells.extend(imu(16));
        cells
    }
}

fn motors(motors: &Motors) -> Vec<Cell> {
    let of = |n: usize| {
        let q = motors.q + n * motors.stride;
        let (temperature, number) = motors.temperature;
        [
            ("q", q, Number::F32),
            ("dq", q + 4, Number::F32),
            ("tau_est", q + motors.tau, Number::F32),
            ("temperature", q + temperature, number),
        ]
        .map(|(name, place, number)| (format!("motor_state[{n}]/{name}"), place, number))
    };
    (0..motors.count).flat_map(of).collect()
}

/// What `count` motors are asked to do: the first one's position is at `q`, the next motor's `stride` bytes on.
fn commands(count: usize, q: usize, stride: usize) -> Vec<Cell> {
    let signals = [
        ("q", Number::Below(STOPS[0])),
        ("dq", Number::Below(STOPS[1])),
        ("tau", Number::F32),
        ("kp", Number::F32),
        ("kd", Number::F32),
    ];
    let of = |n| {
        let cells = signals.into_iter().enumerate();
        cells.map(move |(k, (signal, number))| {
            let place = q + n * stride + 4 * k;
            (format!("motor_cmd[{n}]/{signal}"), place, number)
        })
    };
    (0..count).flat_map(of).collect()
}

/// Attitude, angular velocity and specific force, one after the other.
fn imu(first: usize) -> Vec<Cell> {
    let parts = [("quaternion", 4), ("gyroscope", 3), ("accelerometer", 3)];
    let names = parts
        .into_iter()
        .flat_map(|(name, axes)| (0..axes).map(move |n| format!("imu_state/{name}[{n}]")));
    names
        .enumerate()
        .map(|(n, name)| (name, first + 4 * n, Number::F32))
        .collect()
}

impl Decoder for LowLevel {
    fn names(&self) -> Vec<String> {
        self.cells.iter().map(|(name, ..)| name.clone()).collect()
    }

    fn take(&mut self, data: &[u8]) -> Result<bool, Problem> {
        if data.len() == self.length {
            return Ok(true);
        }
        Err(Problem::MessageLength {
            kind: self.kind,
            found: data.len(),
            expected: self.length,
        })
    }

    fn stamp(&self, data: &[u8]) -> i64 {
        let tick = self.tick.map_or([0; 4], |tick| bytes(data, tick));
        i64::from(u32::from_le_bytes(tick)) * 1_000_000
    }

    fn cell(&self, data: &[u8], cell: usize) -> f64 {
        let (_, place, number) = &self.cells[cell];
        match number {
            Number::F32 => f32::from_le_bytes(bytes(data, *place)).into(),
            Number::Below(none) => match f64::from(f32::from_le_bytes(bytes(data, *place))) {
                x if x >= *none => f64::NAN,
                x => x,
            },
            Number::I16 => i16::from_le_bytes(bytes(data, *place)).into(),
            Number::I8 => i8::from_le_bytes(bytes(data, *place)).into(),
        }
    }
}

/// The bytes at a place after the header; zero beyond the message, whose length has been checked.
fn bytes<const N: usize>(data: &[u8], place: usize) -> [u8; N] {
    let from = data.get(HEADER + place..);
    from.and_then(|from| from.first_chunk().copied())
        .unwrap_or([0; N])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The last number of every kind lies within the message, and the places do not overlap.
    #[test]
    fn every_number_has_a_place_of_its_own() {
        use super::super::{COMMANDS, KINDS};
        for kind in KINDS[..2].iter().chain(&COMMANDS) {
            let state = LowLevel::new(kind).unwrap();
            let width = |number| match number {
                Number::F32 | Number::Below(_) => 4,
                Number::I16 => 2,
                Number::I8 => 1,
            };
            let mut taken = vec![false; state.length - HEADER];
            let tick = state.tick.map(|tick| (String::new(), tick, Number::F32));
            for (name, place, number) in state.cells.iter().chain(&tick) {
                assert_eq!(place % width(*number), 0, "{name}");
                for byte in &mut taken[*place..place + width(*number)] {
                    assert!(!std::mem::replace(byte, true), "{name}");
                }
            }
        }
    }
}

//! What a board is set up for: what neither its buses nor its sensors say.

use crate::Real;
use crate::go2::{Go2, IMU, JOINTS_PER_LEG};
use crate::robot::{Robot, byte_ns};
use crate::scalar::real;
use crate::spatial::Transform;
use nalgebra::{Rotation3, Vector3};
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Kept in the board's flash and used from its next start on. Whole numbers, so that two are the same or not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Setup {
    /// Where the IMU's package is in the trunk's frame, 0.1 mm: from the middle between the hips, x forward, y left, z up.
    pub imu_at: [i16; 3],
    /// How its axes are turned against the trunk's, 0.1 mrad: roll about x, then pitch about y, then yaw about z, each about the trunk's axis.
    pub imu_turned: [i16; 3],
    /// Bits per second of the motor buses.
    pub bus_baud: u32,
}

/// The nearest 0.1 mm to a place, m.
const fn tenths(place: f64) -> i16 {
    let away = if place < 0.0 { -0.5 } else { 0.5 };
    (1e4 * place + away) as i16
}

impl Setup {
    /// A Go2 with its own IMU.
    pub const GO2: Self = Self {
        imu_at: [tenths(IMU[0]), tenths(IMU[1]), tenths(IMU[2])],
        imu_turned: [0; 3],
        bus_baud: <Go2 as Robot<JOINTS_PER_LEG>>::BAUD,
    };

    /// Farthest that an IMU can be from the trunk's middle, 0.1 mm: 1 m, more than any trunk of this size.
    const FARTHEST: u16 = 10_000;
    /// Most that an axis can be turned, 0.1 mrad: half around, to either side.
    const AROUND: u16 = 31_416;
    /// Bit rates of a bus: at the least a cycle of three motors' 99 bytes takes 10 ms, at the most a UART with a clock of 100 MHz samples each bit
    /// ten times (it needs eight: STM32H7's `OVER8`).
    const BAUDS: core::ops::RangeInclusive<u32> = 100_000..=10_000_000;

    /// Whether a board can be set up so.
    pub fn is_possible(&self) -> bool {
        let within = |of: &[i16; 3], most| of.iter().all(|x| x.unsigned_abs() <= most);
        within(&self.imu_at, Self::FARTHEST)
            && within(&self.imu_turned, Self::AROUND)
            && Self::BAUDS.contains(&self.bus_baud)
    }

    /// Time between two bytes that follow each other on a motor bus, ns.
    pub const fn byte_ns(&self) -> u32 {
        byte_ns(self.bus_baud)
    }

    /// From the IMU's axes to the trunk's.
    pub fn mounting<T: Real>(&self) -> Transform<T> {
        let parts = |x: i16| real::<T>(f64::from(x) / 1e4);
        let [roll, pitch, yaw] = self.imu_turned.map(parts);
        Transform {
            rotation: Rotation3::from_euler_angles(roll, pitch, yaw).into_inner(),
            translation: Vector3::from(self.imu_at.map(parts)),
        }
    }
}

//! The listener of a robot that walks, on the emulated board. The IMU's readings come over the link, of the Go2's own IMU.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt_semihosting as _;
use nalgebra::Vector3;
use proprio_core::go2;
use proprio_core::spatial::Transform;
use proprio_firmware::Scalar;
use proprio_firmware::application::Walking;
use proprio_firmware::board::mps2_an500::run;

#[entry]
fn main() -> ! {
    let imu = Vector3::from(go2::IMU.map(|x| x as Scalar));
    run(Walking::take(Transform::from_translation(imu)), 240_000)
}

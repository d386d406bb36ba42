//! The listener of a robot that walks, on the emulated board. The IMU's readings come over the link, of the Go2's own IMU.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt_semihosting as _;
use proprio_firmware::application::Walking;
use proprio_firmware::board::mps2_an500::run;

#[entry]
fn main() -> ! {
    run(Walking::take(), 240_000)
}

//! The listener of a robot that walks, on the NUCLEO-H743ZI2 with its own IMU, mounted as its flash or else `SETUP` says.
//!
//! Flash with `probe-rs run --chip STM32H743ZITx`, which shows the log as well.
#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use proprio_firmware::application::Walking;
use proprio_firmware::board::nucleo_h743zi2::Nucleo;
use proprio_firmware::listener::run;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let Some((board, imu)) = Nucleo::take(spawner) else {
        panic!("the board is taken once")
    };
    imu.start();
    run(board, Walking::take()).await
}

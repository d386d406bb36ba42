//! The listener of a robot that hangs, on the emulated board.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt_semihosting as _;
use proprio_firmware::application::Hanging;
use proprio_firmware::board::mps2_an500::run;

#[entry]
fn main() -> ! {
    run(Hanging::take(), 120_000)
}

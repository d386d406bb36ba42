//! Crashes on purpose, by a panic and by a fault, and says on semihosting's standard output what each start is told of the run before.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;
// Its log.
use defmt_semihosting as _;
use proprio_firmware::crash;

#[entry]
fn main() -> ! {
    let told = crash::take();
    hprintln!("{}|{}", told, crash::take());
    if told.is_empty() {
        panic!(
            "on purpose, and with more words after these than there is room for in what is kept"
        );
    }
    if told.contains("on purpose") {
        // No instruction: a fault.
        cortex_m::asm::udf();
    }
    exit(EXIT_SUCCESS);
    loop {
        cortex_m::asm::wfi();
    }
}

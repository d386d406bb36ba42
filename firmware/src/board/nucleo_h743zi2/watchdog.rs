//! The independent watchdog (RM0433, IWDG): it has a clock of its own, the LSI's 32 kHz, and cannot be stopped.

use embassy_stm32::pac;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// Clock of the watchdog, Hz.
const LSI_HZ: u32 = 32_000;
/// How long the start may take, µs: clocks, the legs' analysis, and reading all snapshots.
const START_US: u32 = 2_000_000;
/// And then each step: a hundred of them.
const STEP_US: u32 = 200_000;

/// Resets the board if the firmware stops, whatever it is at: also where it waits for a clock that never comes. While a debugger holds the
/// core it stands still. **Not tried on a board.**
pub(super) struct Watchdog(());

impl Watchdog {
    /// Starts it, with the time that a start may take. Before anything that may wait: the clocks.
    pub(super) fn start() -> Self {
        pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
        pac::IWDG1.kr().write(|w| w.set_key(Key::START));
        let watchdog = Self(());
        watchdog.allow(Pr::DIVIDE_BY16, reload(16, START_US));
        watchdog
    }

    /// From now on it allows what a step may take.
    pub(super) fn unleash(&mut self) {
        self.allow(Pr::DIVIDE_BY4, reload(4, STEP_US));
    }

    /// A step is done.
    pub(super) fn pet(&mut self) {
        pac::IWDG1.kr().write(|w| w.set_key(Key::RESET));
    }

    fn allow(&self, prescaler: Pr, reload: u16) {
        let registers = pac::IWDG1;
        registers.kr().write(|w| w.set_key(Key::ENABLE));
        registers.pr().write(|w| w.set_pr(prescaler));
        registers.rlr().write(|w| w.set_rl(reload));
        registers.kr().write(|w| w.set_key(Key::RESET));
    }
}

/// The counter's start for a time, with the clock divided so; it has twelve bits.
const fn reload(divisor: u32, time_us: u32) -> u16 {
    let count = (time_us as u64 * LSI_HZ as u64 / divisor as u64 / 1_000_000) as u32;
    assert!(count > 0 && count <= 4096);
    (count - 1) as u16
}

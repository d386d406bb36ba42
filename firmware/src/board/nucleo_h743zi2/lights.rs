//! The board's three lights.

use embassy_stm32::gpio::Output;
use proprio_core::app::Health;

/// Time between two looks at what the lights tell, µs.
const LIGHTS_US: u64 = 500_000;

/// The board's three lights, which tell what is what without a host. **Not tried on a board.**
///
/// | light | |
/// |---|---|
/// | LD1, green (PB0) | changes twice a second: steps are done |
/// | LD2, yellow (PE1) | samples come, of one leg at least |
/// | LD3, red (PB14) | lit: something was lost or refused in the last half second. Blinks: the run before ended in a panic, a fault or the watchdog |
///
/// Until steps are done they show a [`Stage`] of the start. One that does not end is reset by the watchdog after two seconds, and comes again.
pub(super) struct Lights {
    green: Output<'static>,
    yellow: Output<'static>,
    red: Output<'static>,
    before: Health,
    due_us: u64,
    crashed: bool,
}

/// What a start is at. Before these no light is lit: the clocks, or no image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Pins, UARTs and DMA: red and yellow.
    Drivers,
    /// The legs' analysis, and what the flash has kept: red and green.
    Memory,
}

impl Lights {
    /// All as their pins are.
    pub(super) fn new(
        green: Output<'static>,
        yellow: Output<'static>,
        red: Output<'static>,
    ) -> Self {
        Self {
            green,
            yellow,
            red,
            before: Health::default(),
            due_us: 0,
            crashed: false,
        }
    }

    /// Shows what the start is at.
    pub(super) fn starting(&mut self, stage: Stage) {
        self.red.set_high();
        self.yellow.set_level((stage == Stage::Drivers).into());
        self.green.set_level((stage == Stage::Memory).into());
    }

    /// Shows that the start is over: from now on [`show`](Self::show) says what is lit.
    pub(super) fn started(&mut self) {
        self.red.set_low();
        self.green.set_low();
    }

    /// Has the red light blink from now on, if the run before ended as it should not.
    pub(super) fn crashed(&mut self, crashed: bool) {
        self.crashed = crashed;
    }

    /// Shows what has happened since the last change; to be called every step.
    pub(super) fn show(&mut self, health: Health, now_us: u64) {
        if now_us < self.due_us {
            return;
        }
        self.due_us = now_us + LIGHTS_US;
        self.green.toggle();
        let comes = health.samples != self.before.samples;
        self.yellow.set_level(comes.into());
        match self.crashed {
            true => self.red.toggle(),
            false => self
                .red
                .set_level((health.losses != self.before.losses).into()),
        }
        self.before = health;
    }
}

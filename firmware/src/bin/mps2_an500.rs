//! The listener of a robot that hangs, on the emulated board.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt_semihosting as _;
use proprio_core::app::{App, Identity, Memory};
use proprio_core::wire::{DeviceMessage, HostMessage, LEGS, Losses};
use proprio_firmware::Scalar;
use proprio_firmware::board::mps2_an500::Flash;
use proprio_firmware::emulated::{Application, BUS_BUFFER, Buffers, identity, run};
use static_cell::ConstStaticCell;

// All zeros at first: no copies of them lie in flash.
static APP: ConstStaticCell<App<Scalar>> = ConstStaticCell::new(App::unset());
static MEMORY: ConstStaticCell<Memory<Scalar>> = ConstStaticCell::new(Memory::new());
static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new([[0; BUS_BUFFER]; LEGS]);

struct Hanging {
    app: &'static mut App<Scalar>,
    memory: &'static mut Memory<Scalar>,
}

#[entry]
fn main() -> ! {
    let hanging = Hanging {
        app: APP.take(),
        memory: MEMORY.take(),
    };
    run(hanging, identity(120_000), BUFFERS.take())
}

impl Application for Hanging {
    fn begin(&mut self, identity: Identity, flash: &mut Flash) {
        self.app.begin(self.memory, identity);
        self.app.restore(self.memory, flash);
    }

    fn handle(&mut self, message: &HostMessage) {
        self.app.handle(self.memory, message);
    }

    fn hear(&mut self, leg: usize, bytes: &[u8], end_us: u64) {
        self.app.hear(self.memory, leg, bytes, end_us);
    }

    fn step(&mut self, now_us: u64, out: &mut impl FnMut(&DeviceMessage)) {
        self.app.step(self.memory, now_us, out);
    }

    fn keep(&mut self, flash: &mut Flash, now_us: u64) {
        self.app.keep(self.memory, flash, now_us);
    }

    fn record_cost(&mut self, cost: u32, stack_bytes: u32) {
        self.app.record_cost(cost, stack_bytes);
    }

    fn record_losses(&mut self, losses: Losses) {
        self.app.record_losses(losses);
    }
}

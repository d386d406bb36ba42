//! The listener of a robot that walks, on the emulated board: an image of its own, for both at once would take more RAM than a
//! microcontroller has. The IMU's readings come over the link.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use defmt_semihosting as _;
use proprio_core::app::{Identity, WalkingApp, WalkingMemory};
use proprio_core::wire::{DeviceMessage, HostMessage, LEGS, Losses};
use proprio_firmware::Scalar;
use proprio_firmware::board::mps2_an500::Flash;
use proprio_firmware::emulated::{Application, BUS_BUFFER, Buffers, identity, run};
use static_cell::ConstStaticCell;

// All zeros at first: no copies of them lie in flash.
static APP: ConstStaticCell<WalkingApp<Scalar>> = ConstStaticCell::new(WalkingApp::unset());
static MEMORY: ConstStaticCell<WalkingMemory<Scalar>> = ConstStaticCell::new(WalkingMemory::new());
static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new([[0; BUS_BUFFER]; LEGS]);

struct Walking {
    app: &'static mut WalkingApp<Scalar>,
    memory: &'static mut WalkingMemory<Scalar>,
}

#[entry]
fn main() -> ! {
    let walking = Walking {
        app: APP.take(),
        memory: MEMORY.take(),
    };
    run(walking, identity(240_000), BUFFERS.take())
}

impl Application for Walking {
    fn begin(&mut self, identity: Identity, _: &mut Flash) {
        // Of the Go2's constants the priors can be made: a test does.
        let _ = self.app.begin(self.memory, identity);
    }

    fn handle(&mut self, message: &HostMessage) {
        self.app.handle(message);
    }

    fn hear(&mut self, leg: usize, bytes: &[u8], end_us: u64) {
        self.app.hear(self.memory, leg, bytes, end_us);
    }

    fn step(&mut self, now_us: u64, out: &mut impl FnMut(&DeviceMessage)) {
        self.app.step(self.memory, now_us, out);
    }

    fn keep(&mut self, _: &mut Flash, _: u64) {
        // A walk is short, and is not kept over the power.
    }

    fn record_cost(&mut self, cost: u32, stack_bytes: u32) {
        self.app.record_cost(cost, stack_bytes);
    }

    fn record_losses(&mut self, losses: Losses) {
        self.app.record_losses(losses);
    }
}

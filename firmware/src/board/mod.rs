//! Boards: what differs between them, and nothing else. A feature of the package picks one.

#[cfg(feature = "mps2-an500")]
pub mod mps2_an500;
#[cfg(feature = "nucleo-h743zi2")]
pub mod nucleo_h743zi2;

use embedded_storage::nor_flash::NorFlash;
use proprio_core::app::Health;
use proprio_core::wire::{Clock, DeviceMessage, HostMessage, Imu, Losses, Positions, Reset, Setup};

/// What a board has; [`crate::listener`] is the loop around it. No method waits but [`wait`](Self::wait), and [`read_host`](Self::read_host)
/// where the host decides what time it is.
pub trait Board {
    /// Name of the board, 24 bytes at most.
    const NAME: &'static str;
    /// What [`begin_cost`](Self::begin_cost) counts: "instructions" in emulation, "cycles" on a board.
    const LOAD_UNIT: &'static str;
    /// What positions on its buses are, until a host says otherwise.
    const POSITIONS: Positions;

    /// Where snapshots go.
    type Flash: NorFlash;

    /// A step that costs more is counted as over budget.
    fn budget(&self) -> u32;
    /// Why it started; `crashed` where the run before left words.
    fn reset(&self, crashed: bool) -> Reset;
    /// Below which supply it resets itself, as the chip's manual counts levels; nothing where it has no such reset.
    fn brown_out_level(&self) -> Option<u8> {
        None
    }
    /// Which clock its times are of.
    fn clock(&self) -> Clock;
    /// What it is set up for: [`setup_in`](proprio_core::app::setup_in) its flash at the start.
    fn setup(&self) -> Setup;
    /// Time between two bytes that follow each other on a motor bus, ns; 0 where all bytes that come at once have one time.
    fn byte_ns(&self) -> u32 {
        self.setup().byte_ns()
    }

    /// Shows that the application begins: the legs' analysis, and what the flash has kept.
    fn beginning(&mut self) {}
    /// The application has begun: steps follow. `crashed`: the run before ended as it should not.
    fn begun(&mut self, _crashed: bool) {}

    /// Until the next step may be due.
    fn wait(&mut self) -> impl Future<Output = ()>;
    /// What the host sent next, `buffer`'s beginning; nothing once the step is due.
    fn read_host<'a>(&mut self, buffer: &'a mut [u8]) -> &'a [u8];
    /// The host said this; the application hears it as well.
    fn heard(&mut self, _message: &HostMessage) {}
    /// Time of the step that is due, µs.
    fn now_us(&self) -> u64;
    /// Gives each leg's bytes that came without a pause, and when the last of them did, µs.
    fn hear(&mut self, take: impl FnMut(usize, &[u8], u64));
    /// Gives the readings of its own IMU, and when they were measured, µs.
    fn feel(&mut self, _take: impl FnMut(&Imu, u64)) {}
    /// Where snapshots go.
    fn flash(&mut self) -> &mut Self::Flash;
    /// Sends a frame to the host: all of it, or nothing.
    fn send(&mut self, frame: &[u8]);
    /// What the board itself has to say after a step.
    fn answer(&mut self) -> Option<DeviceMessage> {
        None
    }
    /// What its drivers lost since the start.
    fn losses(&self) -> Losses {
        Losses::ZERO
    }
    /// A step is done: for the watchdog, and for what can be seen without a host.
    fn stepped(&mut self, _health: impl FnOnce() -> Health) {}

    /// From where on a cost is counted.
    fn begin_cost(&self) -> u32;
    /// What was done since `begin`, in [`LOAD_UNIT`](Self::LOAD_UNIT)s.
    fn cost_since(&self, begin: u32) -> u32;
}

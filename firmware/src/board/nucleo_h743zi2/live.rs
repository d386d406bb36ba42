//! The board as a listener: every 2 ms it gives what its buses and its IMU have brought, with the times that their interrupts noted.

use super::bank2::{self, Bank2};
use super::imu::{self, READINGS};
use super::lights::Stage;
use super::listening::Listening;
use super::{CORE_HZ, Nucleo};
use crate::board::Board;
use cortex_m::peripheral::DWT;
use embassy_executor::Spawner;
use embassy_stm32::flash::{self, Flash};
use embassy_stm32::pac;
use embassy_stm32::{mode::Async, usart::UartTx};
use embassy_sync::{blocking_mutex::raw::CriticalSectionRawMutex, pipe::Pipe};
use embassy_time::Instant;
use proprio_core::app::Health;
use proprio_core::wire::{Clock, Imu, LineLosses, Losses, MAX_FRAME, Positions, Reset, Setup};
use static_cell::ConstStaticCell;

/// Time between two steps, µs.
pub(super) const TICK_US: u64 = 2000;

/// Frames on their way to the host. The step never waits for it; a frame that finds no room is dropped and counted.
static FRAMES: Pipe<CriticalSectionRawMutex, { 4 * MAX_FRAME }> = Pipe::new();
/// What DMA sends from, so static.
static SENDING: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);

/// Starts what goes on beside the steps: the sending of frames, and the flash for snapshots.
pub(super) fn spawn(
    spawner: Spawner,
    to_host: UartTx<'static, Async>,
    flash: Flash<'static, flash::Async>,
) {
    match (tell(to_host), keep(flash)) {
        (Ok(tell), Ok(keep)) => {
            spawner.spawn(tell);
            spawner.spawn(keep);
        }
        _ => panic!("the tasks are spawned once"),
    }
}

/// Carries frames to the host, as fast as the line takes them.
#[embassy_executor::task]
async fn tell(mut to_host: UartTx<'static, Async>) {
    let sending = SENDING.take();
    loop {
        let length = FRAMES.read(sending).await;
        if to_host.write(&sending[..length]).await.is_err() {
            defmt::warn!("the host link refused {} bytes", length);
        }
    }
}

/// Erases and writes the flash for snapshots, beside the steps.
#[embassy_executor::task]
async fn keep(flash: Flash<'static, flash::Async>) {
    bank2::program(flash).await
}

/// What a line's driver lost.
fn losses(line: &Listening) -> LineLosses {
    LineLosses {
        overruns: line.overruns(),
        errors: line.line_errors(),
    }
}

impl Board for Nucleo {
    const NAME: &'static str = "nucleo-h743zi2";
    const LOAD_UNIT: &'static str = "cycles";
    const POSITIONS: Positions = Positions::FromPowerUp;

    type Flash = Bank2;

    fn budget(&self) -> u32 {
        (u64::from(CORE_HZ) * TICK_US / 1_000_000) as u32
    }

    fn reset(&self, _: bool) -> Reset {
        self.reset
    }

    fn brown_out_level(&self) -> Option<u8> {
        // What an option byte says (RM0433, FLASH_OPTSR_CUR.BOR_LEV): 0 to 3. It is set with a programmer.
        Some(pac::FLASH.optsr_cur().read().bor_lev())
    }

    fn clock(&self) -> Clock {
        self.clock
    }

    fn setup(&self) -> Setup {
        self.setup
    }

    fn beginning(&mut self) {
        self.lights.starting(Stage::Memory);
    }

    fn begun(&mut self, crashed: bool) {
        self.lights.started();
        self.lights.crashed(crashed);
        self.watchdog.pet();
        self.watchdog.unleash();
        // What the start took is no reason to hurry.
        self.ticker.reset();
    }

    fn wait(&mut self) -> impl Future<Output = ()> {
        self.ticker.next()
    }

    fn read_host<'a>(&mut self, buffer: &'a mut [u8]) -> &'a [u8] {
        self.from_host.read(buffer)
    }

    fn now_us(&self) -> u64 {
        Instant::now().as_micros()
    }

    fn hear(&mut self, mut take: impl FnMut(usize, &[u8], u64)) {
        for (leg, bus) in self.buses.iter_mut().enumerate() {
            bus.note();
            while let Some((bytes, time_us)) = bus.piece(self.bus_buffer) {
                take(leg, bytes, time_us);
            }
        }
    }

    fn feel(&mut self, mut take: impl FnMut(&Imu, u64)) {
        while let Ok((time_us, imu)) = READINGS.try_receive() {
            take(&imu, time_us);
        }
    }

    fn flash(&mut self) -> &mut Bank2 {
        &mut self.bank2
    }

    fn send(&mut self, frame: &[u8]) {
        // All, or none, and the host sees the gap in the numbers of frames.
        if FRAMES.free_capacity() < frame.len() {
            self.frames_dropped = self.frames_dropped.wrapping_add(1);
            return;
        }
        let mut rest = frame;
        // The pipe takes a part where it wraps around.
        while !rest.is_empty()
            && let Ok(taken) = FRAMES.try_write(rest)
        {
            rest = &rest[taken..];
        }
    }

    fn losses(&self) -> Losses {
        Losses {
            frames_dropped: self.frames_dropped,
            buses: self.buses.each_ref().map(losses),
            host_line: losses(&self.from_host),
            imu: imu::losses(),
            ..Losses::ZERO
        }
    }

    fn stepped(&mut self, health: impl FnOnce() -> Health) {
        self.watchdog.pet();
        self.lights.show(health(), Instant::now().as_micros());
    }

    fn begin_cost(&self) -> u32 {
        DWT::cycle_count()
    }

    fn cost_since(&self, begin: u32) -> u32 {
        // Interrupts that came meanwhile are in it.
        DWT::cycle_count().wrapping_sub(begin)
    }
}

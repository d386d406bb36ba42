//! The loop around an application on the NUCLEO: every 2 ms it takes what its buses and its IMU have brought, with the times that their
//! interrupts noted, and does one step at the time that the board's clock shows.

use crate::application::Application;
use crate::board::nucleo_h743zi2::{
    BUS_BYTE_NS, Bank2, Board, CORE_HZ, CycleCounter, Lights, Listening, READINGS, RING, Stage,
    Watchdog, imu_losses, program,
};
use crate::{GIT, VERSION, crash, stack::HighWater};
use embassy_executor::Spawner;
use embassy_stm32::flash::{self, Flash};
use embassy_stm32::{mode::Async, usart::UartTx};
use embassy_sync::{blocking_mutex::raw::CriticalSectionRawMutex, pipe::Pipe};
use embassy_time::{Duration, Instant, Ticker};
use proprio_core::app::{Identity, Start};
use proprio_core::wire::{
    HostMessage, LEGS, LineLosses, Losses, MAX_FRAME, Positions, Receiver, Reset, Sender,
};
use static_cell::ConstStaticCell;

/// Time between two steps, µs.
const TICK_US: u64 = 2000;

/// What the lines bring.
static BUS_BUFFER: ConstStaticCell<[u8; RING]> = ConstStaticCell::new([0; RING]);
static HOST_BUFFER: ConstStaticCell<[u8; RING]> = ConstStaticCell::new([0; RING]);

/// Frames on their way to the host. The step never waits for it; a frame that finds no room is dropped and counted.
static FRAMES: Pipe<CriticalSectionRawMutex, { 4 * MAX_FRAME }> = Pipe::new();
/// What DMA sends from, so static.
static SENDING: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);

struct Listener<A> {
    watchdog: Watchdog,
    lights: Lights,
    bank2: Bank2,
    buses: [Listening; LEGS],
    from_host: Listening,
    counter: CycleCounter,
    app: A,
    bus_buffer: &'static mut [u8; RING],
    host_buffer: &'static mut [u8; RING],
    receiver: Receiver<HostMessage>,
    sender: Sender,
    frame: [u8; MAX_FRAME],
    stack: HighWater,
    frames_dropped: u32,
}

/// Runs an application for good.
pub async fn run(spawner: Spawner, board: Board, app: impl Application) -> ! {
    let start = Start {
        git: GIT,
        reset: board.reset,
        clock: board.clock,
        crash: crash::take(),
    };
    let identity = Identity {
        firmware: VERSION,
        board: "nucleo-h743zi2",
        start,
        load_unit: "cycles",
        budget: (u64::from(CORE_HZ) * TICK_US / 1_000_000) as u32,
        byte_ns: BUS_BYTE_NS,
        positions: Positions::FromPowerUp,
    };
    defmt::info!("proprio {} on {}", identity.firmware, identity.board);
    match (tell(board.to_host), keep(board.flash)) {
        (Ok(tell), Ok(keep)) => {
            spawner.spawn(tell);
            spawner.spawn(keep);
        }
        _ => panic!("the tasks are spawned once"),
    }
    let mut listener = Listener {
        watchdog: board.watchdog,
        lights: board.lights,
        bank2: board.bank2,
        buses: board.buses,
        from_host: board.from_host,
        counter: board.counter,
        app,
        bus_buffer: BUS_BUFFER.take(),
        host_buffer: HOST_BUFFER.take(),
        receiver: Receiver::default(),
        sender: Sender::default(),
        frame: [0; MAX_FRAME],
        stack: HighWater::new(),
        frames_dropped: 0,
    };
    listener.lights.starting(Stage::Memory);
    listener.app.begin(identity, &mut listener.bank2);
    listener.lights.started();
    listener.watchdog.pet();
    if !start.crash.is_empty() {
        defmt::error!("the run before ended: {}", start.crash);
    }
    listener
        .lights
        .crashed(!start.crash.is_empty() || start.reset == Reset::Watchdog);
    listener.watchdog.unleash();
    let mut ticker = Ticker::every(Duration::from_micros(TICK_US));
    loop {
        ticker.next().await;
        let now_us = Instant::now().as_micros();
        listener.obey();
        listener.step(now_us);
        listener.watchdog.pet();
        listener.lights.show(listener.app.health(), now_us);
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
    program(flash).await
}

/// What a line's driver lost.
fn losses(line: &Listening) -> LineLosses {
    LineLosses {
        overruns: line.overruns(),
        errors: line.line_errors(),
    }
}

impl<A: Application> Listener<A> {
    /// Takes what the host sent.
    fn obey(&mut self) {
        for &byte in self.from_host.read(self.host_buffer) {
            match self.receiver.push(byte) {
                None => {}
                Some(Ok(message)) => self.app.handle(&message),
                Some(Err(_)) => defmt::warn!("damaged frame from the host"),
            }
        }
        self.app.record_losses(Losses {
            host_frames_bad: self.receiver.bad(),
            host_frames_missed: self.receiver.missed(),
            frames_dropped: self.frames_dropped,
            buses: self.buses.each_ref().map(losses),
            host_line: losses(&self.from_host),
            imu: imu_losses(),
        });
    }

    /// One step of the application and of its snapshot, its message made a frame; all are counted, the copying of the bytes is not.
    fn step(&mut self, now_us: u64) {
        let Self {
            app,
            sender,
            frame,
            bank2,
            ..
        } = self;
        for (leg, bus) in self.buses.iter_mut().enumerate() {
            bus.note();
            while let Some((bytes, time_us)) = bus.piece(self.bus_buffer) {
                app.hear(leg, bytes, time_us);
            }
        }
        while let Ok((time_us, imu)) = READINGS.try_receive() {
            app.feel(&imu, time_us);
        }
        let mut told = 0;
        let ((), cycles) = self.counter.count(|| {
            app.step(now_us, &mut |message| {
                told = sender.encode(message, frame).len();
            });
            app.keep(bank2, now_us);
        });
        self.app.record_cost(cycles, self.stack.bytes());
        self.queue(told);
    }

    /// Hands over the first bytes of the frame: all, or none, and the host sees the gap in the numbers of frames.
    fn queue(&mut self, told: usize) {
        let mut rest = &self.frame[..told];
        if FRAMES.free_capacity() < rest.len() {
            self.frames_dropped = self.frames_dropped.wrapping_add(1);
            return;
        }
        // The pipe takes a part where it wraps around.
        while !rest.is_empty()
            && let Ok(taken) = FRAMES.try_write(rest)
        {
            rest = &rest[taken..];
        }
    }
}

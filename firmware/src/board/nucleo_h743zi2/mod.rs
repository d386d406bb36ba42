//! The NUCLEO-H743ZI2: an STM32H743ZI with a Cortex-M7 at 400 MHz.
//!
//! | link | UART | pin | Zio label | DMA | |
//! |---|---|---|---|---|---|
//! | FR bus | USART2 RX | PD6 | D52 | DMA1 stream 0 | 4 Mbit/s, 8N1 |
//! | FL bus | UART4 RX | PD0 | D67 | DMA1 stream 1 | 4 Mbit/s, 8N1 |
//! | RR bus | UART5 RX | PD2 | D48 | DMA1 stream 2 | 4 Mbit/s, 8N1 |
//! | RL bus | UART7 RX | PE7 | D41 | DMA1 stream 3 | 4 Mbit/s, 8N1 |
//! | host | USART3 | PD8 TX, PD9 RX | ST-LINK's USB | DMA1 streams 4, 5 | 921 600 bit/s, 8N1 |
//!
//! No pin of a bus's UART but RX is configured, so the board cannot transmit on a motor bus. The five kernel clocks are
//! PCLK1, 100 MHz: 4 Mbit/s is exact, 921 600 bit/s 0.5 % slow. Clocks come from the ST-LINK's 8 MHz, a crystal's, because
//! the estimates are only as good as the time.
//!
//! The time of a bus's bytes is noted by the UART's interrupt when the line falls idle, as it does after each frame, with how
//! far DMA has written: [`Listening::piece`] gives the bytes between two such notes, and when the last of them came.
//!
//! Snapshots go to the second bank of the flash while the first is executed from: [`Bank2`]. Neither that nor what the board does after a
//! word that a power failure left half written has been tried on a board.
//!
//! The data cache stays off: the buffers that DMA writes lie in the same SRAM as all data.
//!
//! Reference manual: RM0433; pins: UM2407 and the STM32H743xI data sheet.

use core::task::Poll;

use cortex_m::peripheral::{DCB, DWT, SCB};
use embassy_futures::poll_once;
use embassy_stm32::flash::{self, Flash};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::typelevel::{self, Handler};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{self, Error, RingBufferedUartRx, UartRx, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, bind_interrupts, dma, pac, peripherals, time::Hertz};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use embassy_time::Instant;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use proprio_core::app::Health;
use proprio_core::wire::Reset;
use static_cell::ConstStaticCell;

/// Frequency of the core and of its cycle counter, Hz.
pub const CORE_HZ: u32 = 400_000_000;

/// Bytes that a ring buffer holds: 10 ms of a full motor bus, 44 ms of the host link.
pub const RING: usize = 4096;

const BUS_BAUD: u32 = 4_000_000;
const HOST_BAUD: u32 = 921_600;

/// Time of a byte, eight data bits between start and stop bit, on a motor bus, ns.
pub const BUS_BYTE_NS: u32 = (10_000_000_000 / BUS_BAUD as u64) as u32;

/// Notes of one bus that may wait: six frames of a cycle, eight cycles, between two looks.
const NOTES: usize = 64;

/// What a bus's UART is, and the DMA stream that empties it, beside the driver that owns both: for notes of the time.
struct Bus {
    uart: pac::usart::Usart,
    stream: usize,
    notes: Channel<CriticalSectionRawMutex, Note, NOTES>,
}

/// How far DMA had written, and when.
#[derive(Clone, Copy)]
struct Note {
    position: usize,
    time_us: u64,
}

static BUSES: [Bus; 4] = [
    Bus::new(pac::USART2, 0),
    Bus::new(pac::UART4, 1),
    Bus::new(pac::UART5, 2),
    Bus::new(pac::UART7, 3),
];

impl Bus {
    const fn new(uart: pac::usart::Usart, stream: usize) -> Self {
        let notes = Channel::new();
        Self {
            uart,
            stream,
            notes,
        }
    }

    /// Notes that all that DMA has written came `ago_us` ago at the latest. A note that finds no room is no loss: the next
    /// speaks for its bytes as well, whose times are then less exact.
    fn note(&self, ago_us: u64) {
        let left = usize::from(pac::DMA1.st(self.stream).ndtr().read().ndt());
        let note = Note {
            position: RING - left.clamp(1, RING),
            time_us: Instant::now().as_micros().saturating_sub(ago_us),
        };
        let _ = self.notes.try_send(note);
    }

    /// Notes the time if the line has just fallen idle.
    fn on_interrupt(&self) {
        if self.uart.isr().read().idle() {
            // Before the driver sees it: the driver would not look again until it is read from.
            self.uart.icr().write(|w| w.set_idle(true));
            // The line is idle after one byte's time without a byte.
            self.note(u64::from(BUS_BYTE_NS) / 1000);
        }
    }
}

/// The interrupt of a bus's UART, beside the driver's own.
struct NotesTime<const BUS: usize>;

macro_rules! notes_time {
    ($($bus:literal $interrupt:ident),*) => {$(
        impl Handler<typelevel::$interrupt> for NotesTime<$bus> {
            unsafe fn on_interrupt() {
                BUSES[$bus].on_interrupt();
            }
        }
    )*};
}
notes_time!(0 USART2, 1 UART4, 2 UART5, 3 UART7);

bind_interrupts!(struct Interrupts {
    USART2 => NotesTime<0>, usart::InterruptHandler<peripherals::USART2>;
    UART4 => NotesTime<1>, usart::InterruptHandler<peripherals::UART4>;
    UART5 => NotesTime<2>, usart::InterruptHandler<peripherals::UART5>;
    UART7 => NotesTime<3>, usart::InterruptHandler<peripherals::UART7>;
    USART3 => usart::InterruptHandler<peripherals::USART3>;
    FLASH => flash::InterruptHandler;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
    DMA1_STREAM1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_STREAM2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
    DMA1_STREAM3 => dma::InterruptHandler<peripherals::DMA1_CH3>;
    DMA1_STREAM4 => dma::InterruptHandler<peripherals::DMA1_CH4>;
    DMA1_STREAM5 => dma::InterruptHandler<peripherals::DMA1_CH5>;
});

/// Written by DMA, so static: the stack lies in memory that DMA does not reach.
static RINGS: ConstStaticCell<[[u8; RING]; 5]> = ConstStaticCell::new([[0; RING]; 5]);

/// A UART that DMA empties into a ring buffer.
pub struct Listening {
    uart: RingBufferedUartRx<'static>,
    registers: pac::usart::Usart,
    /// Of a motor bus: the notes of its time.
    bus: Option<&'static Bus>,
    /// Where in the ring the next byte is read.
    position: usize,
    overruns: u32,
    line_errors: u32,
}

impl Listening {
    fn new(
        uart: Result<UartRx<'static, Async>, usart::ConfigError>,
        ring: &'static mut [u8; RING],
        registers: pac::usart::Usart,
        bus: Option<&'static Bus>,
    ) -> Self {
        let Ok(uart) = uart else {
            panic!("the baud rate divides the clock")
        };
        let mut listening = Self {
            uart: uart.into_ring_buffered(ring),
            registers,
            bus,
            position: 0,
            overruns: 0,
            line_errors: 0,
        };
        listening.start();
        listening
    }

    /// Starts DMA. The driver would have its interrupt stop DMA, and with it lose whole ticks, at each broken byte; buses
    /// that turn around bring such. Without that interrupt the next [`Self::read`] finds the error and DMA goes on.
    fn start(&mut self) {
        self.uart.start_uart();
        self.registers.cr3().modify(|w| w.set_eie(false));
        self.position = 0;
        if let Some(bus) = self.bus {
            bus.notes.clear();
        }
    }

    /// Notes the time for what has come since the line was idle last: then [`Self::piece`] gives all that has come, also of a
    /// line that is never idle.
    pub fn note(&self) {
        if let Some(bus) = self.bus {
            cortex_m::interrupt::free(|_| bus.note(0));
        }
    }

    /// The next bytes of a motor bus that came without a pause, and when the last of them did, µs. `None` where no more have
    /// come. Never waits.
    pub fn piece<'a>(&mut self, buffer: &'a mut [u8; RING]) -> Option<(&'a [u8], u64)> {
        let bus = self.bus?;
        while let Ok(note) = bus.notes.try_receive() {
            let length = (note.position + RING - self.position) % RING;
            let mut filled = 0;
            // Where the ring ends, a piece is read in two parts.
            for _ in 0..2 {
                let part = self
                    .read(buffer.get_mut(filled..length).unwrap_or_default())
                    .len();
                filled += part;
            }
            if filled > 0 {
                return Some((buffer.get(..filled).unwrap_or_default(), note.time_us));
            }
        }
        None
    }

    /// Bytes that came since the last call, `buffer`'s beginning. Never waits.
    pub fn read<'a>(&mut self, buffer: &'a mut [u8]) -> &'a [u8] {
        if buffer.is_empty() {
            return &[];
        }
        // A broken line is found first, then what it brought; what overran the ring is found by the second look.
        for _ in 0..3 {
            match poll_once(self.uart.read(buffer)) {
                Poll::Ready(Ok(length)) => {
                    self.position = (self.position + length) % RING;
                    return buffer.get(..length).unwrap_or_default();
                }
                Poll::Ready(Err(Error::Overrun)) => self.overruns = self.overruns.wrapping_add(1),
                Poll::Ready(Err(_)) => self.line_errors = self.line_errors.wrapping_add(1),
                Poll::Pending => break,
            }
            if !self.registers.cr3().read().dmar() {
                self.start();
            }
        }
        &[]
    }

    /// Times that bytes were lost because the ring buffer or the UART was full.
    pub fn overruns(&self) -> u32 {
        self.overruns
    }

    /// Reads that found a framing or noise error on the line since the one before; its bytes are read all the same.
    pub fn line_errors(&self) -> u32 {
        self.line_errors
    }
}

/// Where the second bank begins, from the flash's beginning; bytes of a sector and of all.
const BANK2: u32 = 0x10_0000;
const SECTOR: usize = 128 * 1024;
const BANK2_LEN: usize = 8 * SECTOR;
/// The flash's beginning.
const FLASH_START: usize = 0x0800_0000;

/// What the flash can be told to do; places are the second bank's.
#[derive(Clone, Copy, PartialEq)]
enum Job {
    Erase { from: u32, to: u32 },
    Write { offset: u32, bytes: [u8; 32] },
}

/// The job that the task has not taken yet, and whether it could do the last one.
static JOB: Signal<CriticalSectionRawMutex, Job> = Signal::new();
static DONE: Signal<CriticalSectionRawMutex, bool> = Signal::new();

/// The second bank of the flash, which [`program`] erases and writes in the background: what is not done yet is an error, and the same call
/// is made again in the next step.
pub struct Bank2 {
    /// What the task is at.
    job: Option<Job>,
}

/// The flash is at something, or refused it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotDone;

impl NorFlashError for NotDone {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Bank2 {
    type Error = NotDone;
}

impl Bank2 {
    /// Has the task do a job, unless it is at one; `Ok` once this job is done.
    fn ask(&mut self, job: Job) -> Result<(), NotDone> {
        let Some(present) = self.job else {
            self.job = Some(job);
            JOB.signal(job);
            return Err(NotDone);
        };
        let done = DONE.try_take().ok_or(NotDone)?;
        self.job = None;
        // What was done may be what a snapshot that was given up had asked for.
        if done && present == job {
            Ok(())
        } else {
            Err(NotDone)
        }
    }
}

impl ReadNorFlash for Bank2 {
    const READ_SIZE: usize = 32;

    /// A word that the power failed in has a wrong checksum of its own, which reading it makes a bus fault (RM0433, 4.7.6): it is read
    /// with faults masked and ignored, and is an error.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NotDone> {
        if self.job.is_some() || offset as usize + bytes.len() > BANK2_LEN {
            return Err(NotDone);
        }
        let bank = pac::FLASH.bank(1);
        bank.ccr().write(|w| w.set_clr_dbeccerr(true));
        let address = FLASH_START + BANK2 as usize + offset as usize;
        cortex_m::interrupt::free(|_| {
            // SAFETY: the addresses are the second bank's, which no code or data lies in; faults are ignored for these reads alone.
            unsafe {
                let ccr = &(*SCB::PTR).ccr;
                ccr.modify(|ccr| ccr | IGNORE_BUS_FAULTS);
                core::arch::asm!("cpsid f", "dsb", "isb");
                for (n, byte) in bytes.iter_mut().enumerate() {
                    *byte = ((address + n) as *const u8).read_volatile();
                }
                core::arch::asm!("dsb", "isb", "cpsie f");
                ccr.modify(|ccr| ccr & !IGNORE_BUS_FAULTS);
            }
        });
        match bank.sr().read().dbeccerr() {
            true => Err(NotDone),
            false => Ok(()),
        }
    }

    fn capacity(&self) -> usize {
        BANK2_LEN
    }
}

/// The core's CCR.BFHFNMIGN: bus faults are ignored at priority −1 and −2 (Arm DDI 0403E, B3.2.8).
const IGNORE_BUS_FAULTS: u32 = 1 << 8;

impl NorFlash for Bank2 {
    const WRITE_SIZE: usize = 32;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NotDone> {
        self.ask(Job::Erase { from, to })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NotDone> {
        let bytes = bytes.try_into().map_err(|_| NotDone)?;
        self.ask(Job::Write { offset, bytes })
    }
}

/// Erases and writes the second bank, for ever.
pub async fn program(mut flash: Flash<'static, flash::Async>) -> ! {
    loop {
        let done = match JOB.wait().await {
            Job::Erase { from, to } => flash.erase(BANK2 + from, BANK2 + to).await,
            Job::Write { offset, bytes } => flash.write(BANK2 + offset, &bytes).await,
        };
        DONE.signal(done.is_ok());
    }
}

/// Resets the board if no step is done within [`WATCHDOG_US`], whatever the firmware is at: it has a clock of its own and cannot be
/// stopped. While a debugger holds the core it stands still. **Not tried on a board.**
pub type Watchdog = IndependentWatchdog<'static, peripherals::IWDG1>;

/// A hundred steps.
const WATCHDOG_US: u32 = 200_000;

/// Why the board started (RM0433, 8.7.39), the most telling flag first: a watchdog or the firmware pulls the reset pin as well.
fn reset_reason() -> Reset {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    match flags {
        flags if flags.iwdg1rstf() || flags.wwdg1rstf() => Reset::Watchdog,
        flags if flags.sftrstf() => Reset::Software,
        flags if flags.porrstf() || flags.borrstf() => Reset::Power,
        flags if flags.pinrstf() => Reset::Pin,
        _ => Reset::Unknown,
    }
}

/// Time between two looks at what the lights tell, µs.
const LIGHTS_US: u64 = 500_000;

/// The board's three lights, which tell what is what without a host. **Not tried on a board.**
///
/// | light | |
/// |---|---|
/// | LD1, green (PB0) | changes twice a second: steps are done |
/// | LD2, yellow (PE1) | samples come, of one leg at least |
/// | LD3, red (PB14) | lit: something was lost or refused in the last half second. Blinks: the run before ended in a panic, a fault or the watchdog |
pub struct Lights {
    green: Output<'static>,
    yellow: Output<'static>,
    red: Output<'static>,
    before: Health,
    due_us: u64,
    crashed: bool,
}

impl Lights {
    /// Has the red light blink from now on, if the run before ended as it should not.
    pub fn crashed(&mut self, crashed: bool) {
        self.crashed = crashed;
    }

    /// Shows what has happened since the last change; to be called every step.
    pub fn show(&mut self, health: Health, now_us: u64) {
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

/// Counts the core's cycles.
pub struct CycleCounter(());

impl CycleCounter {
    fn new(mut dcb: DCB, mut dwt: DWT) -> Self {
        dcb.enable_trace();
        DWT::unlock();
        dwt.enable_cycle_counter();
        Self(())
    }

    /// Runs `work` and says how many cycles it took, up to ten seconds; interrupts that came meanwhile are in it.
    pub fn count<R>(&mut self, work: impl FnOnce() -> R) -> (R, u32) {
        let before = DWT::cycle_count();
        let result = work();
        (result, DWT::cycle_count().wrapping_sub(before))
    }
}

/// Everything on the board that the listener uses.
pub struct Board {
    /// From the host.
    pub from_host: Listening,
    /// To the host.
    pub to_host: UartTx<'static, Async>,
    /// USART2, UART4, UART5, UART7: in the order of the legs.
    pub buses: [Listening; 4],
    /// The core's cycles.
    pub counter: CycleCounter,
    /// Why the board started.
    pub reset: Reset,
    /// Not unleashed yet.
    pub watchdog: Watchdog,
    /// What can be seen without a host.
    pub lights: Lights,
    /// Where snapshots go.
    pub bank2: Bank2,
    /// Who writes them there: for [`program`].
    pub flash: Flash<'static, flash::Async>,
}

impl Board {
    /// The board; `None` the second time.
    pub fn take() -> Option<Self> {
        let mut core = cortex_m::Peripherals::take()?;
        core.SCB.enable_icache();
        let reset = reset_reason();
        let p = embassy_stm32::init(clocks());
        pac::DBGMCU.apb4fzr1().modify(|w| w.set_iwdg1(true));
        let [fr, fl, rr, rl, host] = RINGS.try_take()?.each_mut();
        let bus = uart(BUS_BAUD);
        let irqs = Interrupts;
        let buses = [
            Listening::new(
                UartRx::new(p.USART2, p.PD6, p.DMA1_CH0, irqs, bus),
                fr,
                pac::USART2,
                Some(&BUSES[0]),
            ),
            Listening::new(
                UartRx::new(p.UART4, p.PD0, p.DMA1_CH1, irqs, bus),
                fl,
                pac::UART4,
                Some(&BUSES[1]),
            ),
            Listening::new(
                UartRx::new(p.UART5, p.PD2, p.DMA1_CH2, irqs, bus),
                rr,
                pac::UART5,
                Some(&BUSES[2]),
            ),
            Listening::new(
                UartRx::new(p.UART7, p.PE7, p.DMA1_CH3, irqs, bus),
                rl,
                pac::UART7,
                Some(&BUSES[3]),
            ),
        ];
        let host_uart = usart::Uart::new(
            p.USART3,
            p.PD9,
            p.PD8,
            p.DMA1_CH4,
            p.DMA1_CH5,
            irqs,
            uart(HOST_BAUD),
        );
        let (to_host, from_host) = host_uart.ok()?.split();
        Some(Self {
            from_host: Listening::new(Ok(from_host), host, pac::USART3, None),
            to_host,
            buses,
            counter: CycleCounter::new(core.DCB, core.DWT),
            reset,
            watchdog: IndependentWatchdog::new(p.IWDG1, WATCHDOG_US),
            lights: Lights {
                green: Output::new(p.PB0, Level::Low, Speed::Low),
                yellow: Output::new(p.PE1, Level::Low, Speed::Low),
                red: Output::new(p.PB14, Level::Low, Speed::Low),
                before: Health::default(),
                due_us: 0,
                crashed: false,
            },
            bank2: Bank2 { job: None },
            flash: Flash::new(p.FLASH, irqs),
        })
    }
}

/// 8N1, the driver's default, with an input that reads idle while no receiver is wired.
fn uart(baudrate: u32) -> usart::Config {
    let mut config = usart::Config::default();
    config.baudrate = baudrate;
    config.rx_pull = embassy_stm32::gpio::Pull::Up;
    // Else samples that disagree are errors; frames have checksums.
    config.assume_noise_free = true;
    config
}

/// Core 400 MHz, AHB 200 MHz, each APB 100 MHz. 480 MHz would need voltage scale 0, which early chips lack.
fn clocks() -> Config {
    use embassy_stm32::rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
        Sysclk, VoltageScale,
    };
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse {
        freq: Hertz::mhz(8),
        mode: HseMode::Bypass,
    });
    rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV1,
        mul: PllMul::MUL100,
        fracn: None,
        divp: Some(PllDiv::DIV2),
        divq: Some(PllDiv::DIV8),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb3_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    rcc.voltage_scale = VoltageScale::Scale1;
    config
}

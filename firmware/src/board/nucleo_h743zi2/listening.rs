//! UARTs that DMA empties, and the times at which their lines fell idle.

use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Poll;

use crate::crash;
use embassy_futures::poll_once;
use embassy_stm32::interrupt::typelevel::{self, Handler};
use embassy_stm32::mode::Async;
use embassy_stm32::pac;
use embassy_stm32::usart::{self, Error, RingBufferedUartRx, UartRx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::Instant;

/// Bytes that a ring buffer holds: 10 ms of a full motor bus, 44 ms of the host link.
pub(super) const RING: usize = 4096;

/// Time of a byte on a motor bus, ns: what the board is set up for. Written once, before the buses are listened to.
static BYTE_NS: AtomicU32 = AtomicU32::new(0);

/// Says what a byte's time on a motor bus is.
pub(super) fn set_byte_ns(byte_ns: u32) {
    BYTE_NS.store(byte_ns, Ordering::Relaxed);
}

/// Notes of one bus that may wait: six frames of a cycle, eight cycles, between two looks.
const NOTES: usize = 64;

/// What a bus's UART is, and the DMA stream that empties it, beside the driver that owns both: for notes of the time.
pub(super) struct Bus {
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

pub(super) static BUSES: [Bus; 4] = [
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
            self.note(u64::from(BYTE_NS.load(Ordering::Relaxed) / 1000));
        }
    }
}

/// The interrupt of a bus's UART, beside the driver's own.
pub(super) struct NotesTime<const BUS: usize>;

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

/// The interrupt of a stream of DMA1, beside the driver's own, which panics at a transfer error without a word of which line it was.
pub(super) struct NamesError<const STREAM: usize>;

/// What each stream carries.
const CARRIES: [&str; 6] = [
    "FR's bus",
    "FL's bus",
    "RR's bus",
    "RL's bus",
    "to the host",
    "from the host",
];

impl<const STREAM: usize> NamesError<STREAM> {
    /// An address that DMA may not use, or a memory that fails: nothing that listening could mend, so the board starts anew.
    fn on_interrupt() {
        if pac::DMA1.isr(STREAM / 4).read().teif(STREAM % 4) {
            let carries = CARRIES[STREAM];
            crash::end(format_args!(
                "DMA transfer error, stream {STREAM}: {carries}"
            ));
        }
    }
}

macro_rules! names_error {
    ($($stream:literal $interrupt:ident),*) => {$(
        impl Handler<typelevel::$interrupt> for NamesError<$stream> {
            unsafe fn on_interrupt() {
                Self::on_interrupt();
            }
        }
    )*};
}
names_error!(0 DMA1_STREAM0, 1 DMA1_STREAM1, 2 DMA1_STREAM2, 3 DMA1_STREAM3, 4 DMA1_STREAM4, 5 DMA1_STREAM5);

/// A UART that DMA empties into a ring buffer.
pub(super) struct Listening {
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
    pub(super) fn new(
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
    pub(super) fn note(&self) {
        if let Some(bus) = self.bus {
            cortex_m::interrupt::free(|_| bus.note(0));
        }
    }

    /// The next bytes of a motor bus that came without a pause, and when the last of them did, µs. `None` where no more have
    /// come. Never waits.
    pub(super) fn piece<'a>(&mut self, buffer: &'a mut [u8; RING]) -> Option<(&'a [u8], u64)> {
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
    pub(super) fn read<'a>(&mut self, buffer: &'a mut [u8]) -> &'a [u8] {
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
    pub(super) fn overruns(&self) -> u32 {
        self.overruns
    }

    /// Reads that found a framing or noise error on the line since the one before; its bytes are read all the same.
    pub(super) fn line_errors(&self) -> u32 {
        self.line_errors
    }
}

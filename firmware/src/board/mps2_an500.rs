//! The Cortex-M7 board that QEMU emulates as `mps2-an500`.
//!
//! UART0 is the host link, UART1 to UART4 are the buses of FR, FL, RR and RL; or a bus's bytes come to memory, as by DMA ([`Bus`]).
//! Under `-icount shift=6` an instruction takes 2⁶ ns of emulated time and SysTick counts 40 ns, so that it counts instructions, the same in every run. The counts say
//! nothing of a real core's latencies: they guard against regressions.
//!
//! Registers: Arm DDI 0479, CMSDK APB UART; addresses: Arm DAI 0500.

mod played;

pub use played::run;

use cortex_m::peripheral::{NVIC, SYST, syst::SystClkSource};
use proprio_core::storage::{RamFlash, SECTOR};
use proprio_core::wire::rings;

/// One of the board's CMSDK UARTs.
struct Uart {
    base: *mut u32,
}

const STATE: usize = 1;
const CONTROL: usize = 2;
const INTERRUPT: usize = 3;
const BAUD_DIVIDER: usize = 4;

const TRANSMIT_FULL: u32 = 1 << 0;
const RECEIVE_FULL: u32 = 1 << 1;

const TRANSMIT_ENABLE: u32 = 1 << 0;
const RECEIVE_ENABLE: u32 = 1 << 1;
const RECEIVE_INTERRUPT: u32 = 1 << 3;

/// The receive interrupts of UART0 to UART4.
const RECEIVE_IRQS: u32 = 1 << 0 | 1 << 2 | 1 << 4 | 1 << 18 | 1 << 20;

impl Uart {
    const fn new(base: usize) -> Self {
        Self {
            base: base as *mut u32,
        }
    }

    fn read_register(&self, register: usize) -> u32 {
        // SAFETY: `base` is the address of a UART of this board, whose registers are `register` words further.
        unsafe { self.base.add(register).read_volatile() }
    }

    fn write_register(&mut self, register: usize, value: u32) {
        // SAFETY: as in `read_register`; `&mut self` makes this the only writer.
        unsafe { self.base.add(register).write_volatile(value) }
    }

    fn enable(&mut self) {
        // The emulator does not pace by the divider but refuses one below 16.
        self.write_register(BAUD_DIVIDER, 16);
        self.write_register(
            CONTROL,
            TRANSMIT_ENABLE | RECEIVE_ENABLE | RECEIVE_INTERRUPT,
        );
    }

    /// The next byte, if one is there. Bytes are never lost: the emulator sends no byte before the last one was read.
    fn read(&mut self) -> Option<u8> {
        (self.read_register(STATE) & RECEIVE_FULL != 0).then(|| self.read_register(0) as u8)
    }

    /// Takes back the interrupt of bytes that have been read.
    fn clear_interrupt(&mut self) {
        self.write_register(INTERRUPT, RECEIVE_FULL);
    }

    /// Sends `bytes`, waiting for room.
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            while self.read_register(STATE) & TRANSMIT_FULL != 0 {}
            self.write_register(0, u32::from(byte));
        }
    }
}

/// The last word before the [`RINGS`], if buses come to memory.
const RINGS_IN_USE: u32 = u32::from_le_bytes(rings::IN_USE);
/// Where the buses' rings are in the board's PSRAM.
const RINGS: usize = PSRAM + rings::OFFSET;

/// Where a motor bus's bytes come in.
///
/// The emulator takes some 8 µs for each byte of a UART, so that four buses run at half of a robot's speed. Who plays hours puts the bytes into
/// the PSRAM, which the emulator can share with its host, before it says that they are there.
enum Bus {
    /// Byte by byte.
    Uart(Uart),
    /// To a ring in memory.
    Ring {
        /// Its first byte.
        base: *const u8,
        /// The next to be read.
        at: usize,
    },
}

impl Bus {
    /// The next byte. Of a ring it is the caller who knows that one is there.
    fn read(&mut self) -> Option<u8> {
        match self {
            Self::Uart(uart) => uart.read(),
            Self::Ring { base, at } => {
                // SAFETY: `at` is less than a ring's length, and `base` begins that many bytes of the PSRAM which nothing else uses.
                let byte = unsafe { base.add(*at).read_volatile() };
                *at = (*at + 1) % rings::LENGTH;
                Some(byte)
            }
        }
    }

    /// The bus behind `uart`, the `index`th.
    fn new(index: usize, mut uart: Uart) -> Self {
        // SAFETY: a word of the PSRAM, which is always there.
        match unsafe { (RINGS as *const u32).sub(1).read_volatile() } {
            RINGS_IN_USE => Self::Ring {
                base: (RINGS + index * rings::LENGTH) as *const u8,
                at: 0,
            },
            _ => {
                uart.enable();
                Self::Uart(uart)
            }
        }
    }

    fn clear_interrupt(&mut self) {
        if let Self::Uart(uart) = self {
            uart.clear_interrupt();
        }
    }
}

/// Counts instructions with SysTick.
pub struct InstructionCounter(SYST);

const SYSTICK_NS: u32 = 40;
const INSTRUCTION_NS_LOG2: u32 = 6;
const SYSTICK_MAX: u32 = 0x00FF_FFFF;

impl InstructionCounter {
    fn new(mut syst: SYST) -> Self {
        syst.set_clock_source(SystClkSource::Core);
        syst.set_reload(SYSTICK_MAX);
        syst.clear_current();
        syst.enable_counter();
        Self(syst)
    }

    /// Where the counter is.
    #[inline]
    fn begin(&self) -> u32 {
        SYST::get_current()
    }

    /// Instructions since it was at `begin`, up to ten million.
    #[inline]
    fn since(&self, begin: u32) -> u32 {
        let ticks = begin.wrapping_sub(SYST::get_current()) & SYSTICK_MAX;
        (ticks * SYSTICK_NS) >> INSTRUCTION_NS_LOG2
    }

    /// Runs `work` and says how many instructions it took, up to ten million.
    pub fn count<R>(&mut self, work: impl FnOnce() -> R) -> (R, u32) {
        let begin = self.begin();
        let result = work();
        (result, self.since(begin))
    }
}

/// Where the board's PSRAM begins, which stands for flash: QEMU can be told to keep it in a file, and then it outlives the emulator as flash
/// outlives the power.
const PSRAM: usize = 0x6000_0000;
/// As many sectors as the NUCLEO's second bank has.
const FLASH_LEN: usize = 8 * SECTOR;
/// Bytes that a step erases: 64 KiB take half a second, as quick flash does.
const FLASH_PACE: u32 = 256;

/// RAM that behaves as flash does.
pub type Flash = RamFlash<&'static mut [u8]>;

/// Everything on the board that the listener uses.
pub struct Mps2An500 {
    /// UART0.
    host: Uart,
    /// UART1 to UART4 or their rings, in the order of the legs.
    buses: [Bus; 4],
    /// SysTick.
    pub counter: InstructionCounter,
    /// PSRAM.
    flash: Flash,
    nvic: NVIC,
}

impl Mps2An500 {
    /// The board; `None` the second time.
    pub fn take() -> Option<Self> {
        let core = cortex_m::Peripherals::take()?;
        let mut host = Uart::new(0x4000_4000);
        let mut index = 0..;
        let buses = [0x4000_5000, 0x4000_6000, 0x4000_7000, 0x4000_9000].map(|base| {
            let index = index.next().unwrap_or_default();
            Bus::new(index, Uart::new(base))
        });
        host.enable();
        // The interrupts wake the core from its sleep and are never taken.
        cortex_m::interrupt::disable();
        let nvic = core.NVIC;
        // SAFETY: with interrupts disabled no handler runs.
        unsafe { nvic.iser[0].write(RECEIVE_IRQS) };
        let counter = InstructionCounter::new(core.SYST);
        // SAFETY: the linker puts nothing in the PSRAM, this is the only place that takes its beginning, once (`Peripherals::take` above), and
        // the rings are further.
        let flash = unsafe { core::slice::from_raw_parts_mut(PSRAM as *mut u8, FLASH_LEN) };
        Some(Self {
            host,
            buses,
            counter,
            flash: RamFlash::with_pace(flash, FLASH_PACE),
            nvic,
        })
    }

    /// Sleeps until a byte has come to any UART since the last [`Self::clear`].
    fn sleep(&self) {
        cortex_m::asm::wfi();
    }

    /// Forgets which bytes have come. Then read again before sleeping: a byte may have come just before.
    fn clear(&mut self) {
        self.host.clear_interrupt();
        self.buses.iter_mut().for_each(Bus::clear_interrupt);
        // SAFETY: clearing pending interrupts that no handler waits for.
        unsafe { self.nvic.icpr[0].write(RECEIVE_IRQS) };
    }
}

//! What ended the run before: the words of a panic, a fault or a driver, in RAM that a reset leaves as it is.
//!
//! The board resets after either, so that it listens again within a second; the words are told with every hello until the power is
//! off or the next crash. `panic-persist` keeps a panic's words alike, but neither a fault's, nor does it leave the reset to the board.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

/// Most bytes that are kept, those that a hello tells.
const LENGTH: usize = 64;

/// What the record begins with if there is one: nothing that RAM has by itself.
const MAGIC: [u32; 2] = [0x70_72_6F_70, 0x72_69_6F_21];

#[repr(C)]
struct Record {
    magic: [u32; 2],
    length: u32,
    text: [u8; LENGTH],
    /// Written last: a microcontroller's RAM with checksums keeps the last word in a buffer that a reset loses.
    last: u32,
}

#[repr(transparent)]
struct Kept(UnsafeCell<MaybeUninit<Record>>);

// SAFETY: written once, by who never returns, with interrupts off; read once, before anything else runs (`take`).
unsafe impl Sync for Kept {}

#[unsafe(link_section = ".uninit.crash")]
static KEPT: Kept = Kept(UnsafeCell::new(MaybeUninit::uninit()));

/// What ended the run before, if that left words: for the start, once. Empty after any other end.
pub fn take() -> &'static str {
    let record = KEPT.0.get().cast::<Record>();
    // SAFETY: the static is valid for reads, and any bits are an integer. Whoever writes to it never returns.
    let (magic, length) = unsafe {
        (
            (&raw const (*record).magic).read_volatile(),
            (*record).length,
        )
    };
    // SAFETY: as above; what was kept stays until the next crash, after which nobody reads it any more in this run.
    unsafe { (&raw mut (*record).magic).write_volatile([0; 2]) };
    if magic != MAGIC {
        return "";
    }
    // SAFETY: as above.
    let text: &'static [u8; LENGTH] = unsafe { &(*record).text };
    let text = text.get(..length as usize).unwrap_or(&[]);
    core::str::from_utf8(text).unwrap_or("")
}

/// Writes as much as there is room for.
struct Words {
    length: usize,
    text: [u8; LENGTH],
}

impl Write for Words {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // What is not ASCII could be cut within a character.
        let text = text
            .bytes()
            .map(|byte| if byte.is_ascii() { byte } else { b'?' });
        for (place, byte) in self.text.iter_mut().skip(self.length).zip(text) {
            *place = byte;
            self.length += 1;
        }
        Ok(())
    }
}

/// Keeps words and resets the board.
pub fn end(words: fmt::Arguments) -> ! {
    cortex_m::interrupt::disable();
    let mut kept = Words {
        length: 0,
        text: [0; LENGTH],
    };
    // It writes what finds room, and no error.
    let _ = kept.write_fmt(words);
    let record = Record {
        magic: MAGIC,
        length: kept.length as u32,
        text: kept.text,
        last: 0,
    };
    // SAFETY: interrupts are off, and this never returns: nobody else reads or writes it.
    unsafe { KEPT.0.get().cast::<Record>().write_volatile(record) };
    cortex_m::asm::dsb();
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    // The end of a path says which file; its beginning finds no room.
    match info.location() {
        Some(place) => {
            let file = place.file();
            let name = file.rsplit('/').next().unwrap_or(file);
            end(format_args!("{name}:{}: {}", place.line(), info.message()))
        }
        None => end(format_args!("{}", info.message())),
    }
}

/// Configurable fault status register (Arm DDI 0403E, B3.2.15).
const CFSR: *const u32 = 0xE000_ED28 as *const u32;

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {:x}", frame.pc());
    // SAFETY: a register of every Cortex-M7; reading it changes nothing.
    let status = unsafe { CFSR.read_volatile() };
    let (pc, lr) = (frame.pc(), frame.lr());
    end(format_args!(
        "hard fault at {pc:08x} from {lr:08x}, CFSR {status:08x}"
    ))
}

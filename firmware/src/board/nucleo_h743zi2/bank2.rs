//! The second bank of the flash, where snapshots go while the first is executed from. **Not tried on a board**, nor what is read of a word that a
//! power failure left half written.

use cortex_m::peripheral::SCB;
use embassy_stm32::flash::{self, Flash};
use embassy_stm32::pac;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

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
#[derive(Default)]
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

    /// A word that the power failed in has a wrong checksum of its own, which reading it makes a bus fault (RM0433, error correction of the flash): it is read
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
pub(super) async fn program(mut flash: Flash<'static, flash::Async>) -> ! {
    loop {
        let done = match JOB.wait().await {
            Job::Erase { from, to } => flash.erase(BANK2 + from, BANK2 + to).await,
            Job::Write { offset, bytes } => flash.write(BANK2 + offset, &bytes).await,
        };
        DONE.signal(done.is_ok());
    }
}

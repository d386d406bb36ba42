//! The IMU of a robot that walks: an LSM6DSO at SPI1, read at each of its data-ready pulses. **Not tried on a board.**
//!
//! The task runs in an interrupt of its own, before the steps and behind the buses' interrupts: a reading bears the time of its pulse to some
//! microseconds, whatever a step is at. Which pulse a reading is of does not depend on who else is busy: it is read 25 µs after it, and
//! the next one comes 600 µs later.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_executor::InterruptExecutor;
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::mode::{Async, Blocking};
use embassy_stm32::spi::{self, Spi, mode::Master};
use embassy_stm32::{Peri, bind_interrupts, peripherals, time::Hertz};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_time::{Delay, Duration, Instant, Timer, with_timeout};
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use proprio_core::wire::{Imu, LineLosses};
use proprio_imu::{AccRange, Fault, GyroRange, Lsm6dso, Rate, SelfTest, Settings};

/// Three readings to a sample of the joints at 500 Hz, so that what vibrates faster than those can follow is averaged out. A step of a walk
/// is some g at the trunk, an impact on stone more; a quantum of the widest range is a quarter of the chip's own noise. No trunk of a dog turns
/// by a thousand degrees a second.
const SETTINGS: Settings = Settings {
    rate: Rate::Hz1666,
    acc: AccRange::G16,
    gyro: GyroRange::Dps1000,
};

/// The most that the chip takes. The prescaler makes 6.25 MHz of PLL1's 100 MHz.
const SPI_HZ: u32 = 10_000_000;

/// Without a reading for so long the chip is begun anew: seventeen of them.
const SILENT: Duration = Duration::from_millis(10);
/// Time until it is tried again.
const AGAIN: Duration = Duration::from_secs(1);

/// Readings that wait for a step, and when they were measured, µs: four steps' worth.
pub(super) static READINGS: Channel<CriticalSectionRawMutex, (u64, Imu), 16> = Channel::new();

/// Times that the chip was silent or a reading found no room; readings and chips that were refused.
static LOST: AtomicU32 = AtomicU32::new(0);
static REFUSED: AtomicU32 = AtomicU32::new(0);

/// What was lost of the IMU.
pub(super) fn losses() -> LineLosses {
    LineLosses {
        overruns: LOST.load(Ordering::Relaxed),
        errors: REFUSED.load(Ordering::Relaxed),
    }
}

fn count(counter: &AtomicU32) {
    counter.fetch_add(1, Ordering::Relaxed);
}

bind_interrupts!(struct Interrupts {
    EXTI15_10 => exti::InterruptHandler<interrupt::typelevel::EXTI15_10>;
});

/// The executor of an interrupt whose peripheral the board does not use.
static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

#[embassy_stm32::interrupt]
unsafe fn SAI4() {
    // SAFETY: the executor's own interrupt, unmasked when it is started.
    unsafe { EXECUTOR.on_interrupt() }
}

/// SPI1 and the pins that the IMU is wired to.
pub struct ImuPins {
    pub(super) spi: Peri<'static, peripherals::SPI1>,
    pub(super) sck: Peri<'static, peripherals::PA5>,
    pub(super) mosi: Peri<'static, peripherals::PB5>,
    pub(super) miso: Peri<'static, peripherals::PA6>,
    pub(super) select: Peri<'static, peripherals::PD14>,
    pub(super) ready: Peri<'static, peripherals::PD15>,
    pub(super) line: Peri<'static, peripherals::EXTI15>,
}

impl ImuPins {
    /// Has [`READINGS`] come from now on.
    pub fn start(self) {
        interrupt::SAI4.set_priority(Priority::P6);
        let spawner = EXECUTOR.start(interrupt::SAI4);
        match measure(self) {
            Ok(task) => spawner.spawn(task),
            Err(_) => panic!("the task is spawned once"),
        }
    }
}

type Chip = Lsm6dso<ExclusiveDevice<Spi<'static, Blocking, Master>, Output<'static>, NoDelay>>;

/// Begins the chip, tests it at the first start, delivers readings until it falls silent, and again.
#[embassy_executor::task]
async fn measure(pins: ImuPins) {
    let mut config = spi::Config::default();
    config.mode = spi::MODE_3;
    config.frequency = Hertz(SPI_HZ);
    let bus = Spi::new_blocking(pins.spi, pins.sck, pins.mosi, pins.miso, config);
    let select = Output::new(pins.select, Level::High, Speed::VeryHigh);
    let Ok(device) = ExclusiveDevice::new_no_delay(bus, select);
    let mut chip = Lsm6dso::new(device, SETTINGS);
    let mut ready = ExtiInput::new(pins.ready, pins.line, Pull::Down, Interrupts);
    let mut tested = false;
    loop {
        match begin(&mut chip, &mut tested).await {
            Ok(()) => deliver(&mut chip, &mut ready).await,
            Err(()) => {
                count(&REFUSED);
                Timer::after(AGAIN).await;
            }
        }
    }
}

/// Begins the chip. One whose self-test fails is none; one that moves meanwhile is taken as it is.
async fn begin(chip: &mut Chip, tested: &mut bool) -> Result<(), ()> {
    match chip.begin(&mut Delay).await {
        Ok(()) => {}
        Err(Fault::NotThere(who)) => {
            defmt::warn!("no LSM6DSO at SPI1: WHO_AM_I is {:x}", who);
            return Err(());
        }
        Err(_) => {
            defmt::warn!("the LSM6DSO does not take its settings");
            return Err(());
        }
    }
    if core::mem::replace(tested, true) {
        return Ok(());
    }
    match chip.self_test(&mut Delay).await {
        Ok(SelfTest::Passed) => defmt::info!("the LSM6DSO passed its self-test"),
        Ok(SelfTest::Moves) => defmt::info!("the robot moves: the LSM6DSO is not tested"),
        Ok(SelfTest::Failed(axis)) => {
            defmt::error!("the LSM6DSO fails its self-test, axis {}", axis);
            *tested = false;
            return Err(());
        }
        Err(_) => {
            defmt::warn!("the LSM6DSO was lost in its self-test");
            *tested = false;
            return Err(());
        }
    }
    Ok(())
}

/// Delivers readings until the chip is silent.
async fn deliver(chip: &mut Chip, ready: &mut ExtiInput<'static, Async>) {
    while with_timeout(SILENT, ready.wait_for_rising_edge())
        .await
        .is_ok()
    {
        let time_us = Instant::now().as_micros();
        match chip.read() {
            Ok(reading) => {
                let imu = Imu {
                    gyro: reading.gyro,
                    acc: reading.acc,
                };
                if READINGS.try_send((time_us, imu)).is_err() {
                    count(&LOST);
                }
            }
            Err(_) => count(&REFUSED),
        }
    }
    count(&LOST);
}

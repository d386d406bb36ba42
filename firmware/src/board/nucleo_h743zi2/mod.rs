//! The NUCLEO-H743ZI2: an STM32H743ZI with a Cortex-M7 at 400 MHz.
//!
//! | link | UART | pin | Zio label | DMA | |
//! |---|---|---|---|---|---|
//! | FR bus | USART2 RX | PD6 | D52 | DMA1 stream 0 | 4 Mbit/s, 8N1 |
//! | FL bus | UART4 RX | PD0 | D67 | DMA1 stream 1 | 4 Mbit/s, 8N1 |
//! | RR bus | UART5 RX | PD2 | D48 | DMA1 stream 2 | 4 Mbit/s, 8N1 |
//! | RL bus | UART7 RX | PE7 | D41 | DMA1 stream 3 | 4 Mbit/s, 8N1 |
//! | host | USART3 | PD8 TX, PD9 RX | ST-LINK's USB | DMA1 streams 4, 5 | 921 600 bit/s, 8N1 |
//! | IMU | SPI1 | PA5 SCK, PA6 MISO, PB5 MOSI, PD14 select, PD15 data ready | D13, D12, D11, D10, D9 | none | 6.25 MHz, mode 3 |
//!
//! No pin of a bus's UART but RX is configured, so the board cannot transmit on a motor bus. The five kernel clocks are
//! PCLK1, 100 MHz: 4 Mbit/s, a bus's unless the host has set up another, is exact, 921 600 bit/s 0.5 % slow. Clocks come from the ST-LINK's 8 MHz, a crystal's, because
//! the estimates are only as good as the time; where that does not come, from the chip's own oscillator, and the hello says so. The watchdog
//! runs before they are asked for.
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

mod bank2;
mod clocks;
mod imu;
mod lights;
mod listening;
mod live;
mod watchdog;

pub use bank2::{Bank2, NotDone};
pub use imu::ImuPins;

use clocks::{clock, clocks};
use cortex_m::peripheral::{DCB, DWT};
use embassy_executor::Spawner;
use embassy_stm32::flash::{self, Flash};
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};
use embassy_stm32::usart::{self, UartRx};
use embassy_stm32::{Peri, bind_interrupts, dma, pac, peripherals};
use embassy_time::{Duration, Ticker};
use lights::{Lights, Stage};
use listening::{BUSES, Listening, NamesError, NotesTime, RING};
use live::TICK_US;
use proprio_core::app::setup_in;
use proprio_core::wire::{Clock, HOST_BAUD, Reset, Setup};
use static_cell::ConstStaticCell;
use watchdog::Watchdog;

/// Frequency of the core and of its cycle counter, Hz.
const CORE_HZ: u32 = 400_000_000;

/// What it is set up for before a host has said so: a Go2's buses, and an IMU on the middle of the trunk's back, whose x points forward and whose z up.
const SETUP: Setup = Setup {
    imu_at: [0, 0, 700],
    ..Setup::GO2
};

bind_interrupts!(struct Interrupts {
    USART2 => NotesTime<0>, usart::InterruptHandler<peripherals::USART2>;
    UART4 => NotesTime<1>, usart::InterruptHandler<peripherals::UART4>;
    UART5 => NotesTime<2>, usart::InterruptHandler<peripherals::UART5>;
    UART7 => NotesTime<3>, usart::InterruptHandler<peripherals::UART7>;
    USART3 => usart::InterruptHandler<peripherals::USART3>;
    FLASH => flash::InterruptHandler;
    DMA1_STREAM0 => NamesError<0>, dma::InterruptHandler<peripherals::DMA1_CH0>;
    DMA1_STREAM1 => NamesError<1>, dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_STREAM2 => NamesError<2>, dma::InterruptHandler<peripherals::DMA1_CH2>;
    DMA1_STREAM3 => NamesError<3>, dma::InterruptHandler<peripherals::DMA1_CH3>;
    DMA1_STREAM4 => NamesError<4>, dma::InterruptHandler<peripherals::DMA1_CH4>;
    DMA1_STREAM5 => NamesError<5>, dma::InterruptHandler<peripherals::DMA1_CH5>;
});

/// Written by DMA, so static: the stack lies in memory that DMA does not reach.
static RINGS: ConstStaticCell<[[u8; RING]; 5]> = ConstStaticCell::new([[0; RING]; 5]);
/// What a bus has brought, taken out of its ring.
static BUS_BUFFER: ConstStaticCell<[u8; RING]> = ConstStaticCell::new([0; RING]);

/// Why the board started (RM0433, RCC_RSR), the most telling flag first: each reset pulls the pin as well, and the power's coming is also a brown-out.
fn reset_reason() -> Reset {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    match flags {
        flags if flags.iwdg1rstf() || flags.wwdg1rstf() => Reset::Watchdog,
        flags if flags.sftrstf() => Reset::Software,
        flags if flags.porrstf() => Reset::Power,
        flags if flags.borrstf() => Reset::BrownOut,
        flags if flags.pinrstf() => Reset::Pin,
        _ => Reset::Unknown,
    }
}

/// Everything on the board that the listener uses.
pub struct Nucleo {
    from_host: Listening,
    /// USART2, UART4, UART5, UART7: in the order of the legs.
    buses: [Listening; 4],
    bus_buffer: &'static mut [u8; RING],
    reset: Reset,
    clock: Clock,
    setup: Setup,
    /// It allows what a start may take until it is unleashed.
    watchdog: Watchdog,
    lights: Lights,
    bank2: Bank2,
    ticker: Ticker,
    /// Frames that found no room on the way to the host.
    frames_dropped: u32,
}

impl Nucleo {
    /// The board, with the tasks beside its steps, and what is its IMU's if that is [started](ImuPins::start); `None` the second time.
    pub fn take(spawner: Spawner) -> Option<(Self, ImuPins)> {
        let mut core = cortex_m::Peripherals::take()?;
        let reset = reset_reason();
        let watchdog = Watchdog::start();
        core.SCB.enable_icache();
        let clock = clock();
        let p = embassy_stm32::init(clocks(clock));
        let light = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
        let mut lights = Lights::new(
            light(p.PB0.into()),
            light(p.PE1.into()),
            light(p.PB14.into()),
        );
        lights.starting(Stage::Drivers);
        let [fr, fl, rr, rl, host] = RINGS.try_take()?.each_mut();
        let mut bank2 = Bank2::default();
        let setup = setup_in(&mut bank2, SETUP);
        listening::set_byte_ns(setup.byte_ns());
        let bus = uart(setup.bus_baud);
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
        live::spawn(spawner, to_host, Flash::new(p.FLASH, irqs));
        count_cycles(core.DCB, core.DWT);
        let board = Self {
            from_host: Listening::new(Ok(from_host), host, pac::USART3, None),
            buses,
            bus_buffer: BUS_BUFFER.try_take()?,
            reset,
            clock,
            setup,
            watchdog,
            lights,
            bank2,
            ticker: Ticker::every(Duration::from_micros(TICK_US)),
            frames_dropped: 0,
        };
        let imu = ImuPins {
            spi: p.SPI1,
            sck: p.PA5,
            mosi: p.PB5,
            miso: p.PA6,
            select: p.PD14,
            ready: p.PD15,
            line: p.EXTI15,
        };
        Some((board, imu))
    }
}

/// Has the core count its cycles.
fn count_cycles(mut dcb: DCB, mut dwt: DWT) {
    dcb.enable_trace();
    DWT::unlock();
    dwt.enable_cycle_counter();
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

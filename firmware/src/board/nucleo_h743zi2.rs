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
//! The data cache stays off: the buffers that DMA writes lie in the same SRAM as all data.
//!
//! Reference manual: RM0433; pins: UM2407 and the STM32H743xI data sheet.

use core::task::Poll;

use cortex_m::peripheral::{DCB, DWT};
use embassy_futures::poll_once;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{self, Error, RingBufferedUartRx, UartRx, UartTx};
use embassy_stm32::{Config, bind_interrupts, dma, pac, peripherals, time::Hertz};
use static_cell::ConstStaticCell;

/// Frequency of the core and of its cycle counter, Hz.
pub const CORE_HZ: u32 = 400_000_000;

/// Bytes that a ring buffer holds: 10 ms of a full motor bus, 44 ms of the host link.
pub const RING: usize = 4096;

const BUS_BAUD: u32 = 4_000_000;
const HOST_BAUD: u32 = 921_600;

bind_interrupts!(struct Interrupts {
    USART2 => usart::InterruptHandler<peripherals::USART2>;
    UART4 => usart::InterruptHandler<peripherals::UART4>;
    UART5 => usart::InterruptHandler<peripherals::UART5>;
    UART7 => usart::InterruptHandler<peripherals::UART7>;
    USART3 => usart::InterruptHandler<peripherals::USART3>;
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
    overruns: u32,
    line_errors: u32,
}

impl Listening {
    fn new(
        uart: Result<UartRx<'static, Async>, usart::ConfigError>,
        ring: &'static mut [u8; RING],
        registers: pac::usart::Usart,
    ) -> Self {
        let Ok(uart) = uart else {
            panic!("the baud rate divides the clock")
        };
        let mut listening = Self {
            uart: uart.into_ring_buffered(ring),
            registers,
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
    }

    /// The bytes that came since the last call, `buffer`'s beginning. Never waits.
    pub fn read<'a>(&mut self, buffer: &'a mut [u8; RING]) -> &'a [u8] {
        // A broken line is found first, then what it brought; what overran the ring is found by the second look.
        for _ in 0..3 {
            match poll_once(self.uart.read(buffer)) {
                Poll::Ready(Ok(length)) => return &buffer[..length.min(RING)],
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
}

impl Board {
    /// The board; `None` the second time.
    pub fn take() -> Option<Self> {
        let mut core = cortex_m::Peripherals::take()?;
        core.SCB.enable_icache();
        let p = embassy_stm32::init(clocks());
        let [fr, fl, rr, rl, host] = RINGS.try_take()?.each_mut();
        let bus = uart(BUS_BAUD);
        let irqs = Interrupts;
        let buses = [
            Listening::new(
                UartRx::new(p.USART2, p.PD6, p.DMA1_CH0, irqs, bus),
                fr,
                pac::USART2,
            ),
            Listening::new(
                UartRx::new(p.UART4, p.PD0, p.DMA1_CH1, irqs, bus),
                fl,
                pac::UART4,
            ),
            Listening::new(
                UartRx::new(p.UART5, p.PD2, p.DMA1_CH2, irqs, bus),
                rr,
                pac::UART5,
            ),
            Listening::new(
                UartRx::new(p.UART7, p.PE7, p.DMA1_CH3, irqs, bus),
                rl,
                pac::UART7,
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
            from_host: Listening::new(Ok(from_host), host, pac::USART3),
            to_host,
            buses,
            counter: CycleCounter::new(core.DCB, core.DWT),
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

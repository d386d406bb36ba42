//! The board's clocks: from the ST-LINK's 8 MHz, a crystal's, because the estimates are only as good as the time. Where that does not come, as
//! with the NUCLEO on another supply than its USB, from the chip's own oscillator, and the hello says so.

use embassy_stm32::Config;
use embassy_stm32::pac;
use embassy_stm32::time::Hertz;
use proprio_core::wire::Clock;

/// How long the crystal's clock may take, cycles of the 64 MHz that the chip starts with, each look being some: 10 ms at least, fifty times
/// what a crystal takes (data sheet: 2 ms at most) and far below what the watchdog allows.
const LOOKS: u32 = 100_000;

/// Which clock there is. Turns the crystal's off again, which the driver turns on without a limit to its patience.
pub(super) fn clock() -> Clock {
    pac::RCC.cr().modify(|w| {
        w.set_hsebyp(true);
        w.set_hseon(true);
    });
    let comes = (0..LOOKS).any(|_| pac::RCC.cr().read().hserdy());
    pac::RCC.cr().modify(|w| w.set_hseon(false));
    match comes {
        true => Clock::Crystal,
        false => Clock::Internal,
    }
}

/// Core 400 MHz, AHB 200 MHz, each APB 100 MHz, of either clock. 480 MHz would need voltage scale 0, which early chips lack.
pub(super) fn clocks(clock: Clock) -> Config {
    use embassy_stm32::rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource,
        Sysclk, VoltageScale,
    };
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    // Either way 8 MHz to the PLL: the internal oscillator's 64 MHz over 8.
    let (source, prediv) = match clock {
        Clock::Crystal => {
            rcc.hse = Some(Hse {
                freq: Hertz::mhz(8),
                mode: HseMode::Bypass,
            });
            (PllSource::HSE, PllPreDiv::DIV1)
        }
        Clock::Internal | Clock::Unknown => (PllSource::HSI, PllPreDiv::DIV8),
    };
    rcc.pll1 = Some(Pll {
        source,
        prediv,
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

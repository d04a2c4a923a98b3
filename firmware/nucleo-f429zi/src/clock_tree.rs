//! Clocks: 8 MHz HSE from the ST-LINK or the internal 16 MHz; the PLL gives 168 MHz. Timers: APB1 84 MHz, APB2 168 MHz.

use embassy_stm32::{
    Config,
    rcc::{
        AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
    },
    time::Hertz,
};

pub fn config(own_clock: bool) -> Config {
    let mut config = Config::default();
    let prediv = if own_clock {
        config.rcc.pll_src = PllSource::HSI;
        PllPreDiv::DIV8
    } else {
        config.rcc.hse = Some(Hse { freq: Hertz::mhz(8), mode: HseMode::Bypass });
        config.rcc.pll_src = PllSource::HSE;
        PllPreDiv::DIV4
    };
    config.rcc.pll = Some(Pll {
        prediv,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

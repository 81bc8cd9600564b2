//! Small firmwares with one mistake each: the referee has to name it, and has nothing against the same without the
//! mistake.

use std::path::PathBuf;

use tactus_emulator::board::referee::{Rule, Violation};
use tactus_emulator::board::{Emulator, Options};
use tactus_world::world::Setup;

/// The work of a small firmware: one access each.
#[derive(Clone, Copy)]
enum Do {
    /// Stores a word, a half-word, a byte.
    W(u32, u32),
    H(u32, u32),
    B(u32, u32),
    /// Loads a word.
    R(u32),
    /// Loads a word until it has these bits.
    Until(u32, u32),
}
use Do::{B, H, R, Until, W};

const FLASH: u32 = 0x0800_0000;
/// Vectors: of the core, and 91 of the chip (RM0090, table 62).
const VECTORS: usize = 16 + 91;

/// An ELF that does this once, and sleeps.
fn elf(steps: &[Do]) -> Vec<u8> {
    // address to r0, value to r1
    let mut code: Vec<u16> = Vec::new();
    for step in steps {
        let (address, value) = match *step {
            W(address, value) | H(address, value) | B(address, value) | Until(address, value) => {
                (address, value)
            }
            R(address) => (address, 0),
        };
        for (register, number) in [(0, address), (1, value)] {
            code.extend(load_half(0xF240, register, number as u16));
            code.extend(load_half(0xF2C0, register, (number >> 16) as u16));
        }
        match step {
            W(..) => code.push(0x6001),
            H(..) => code.push(0x8001),
            B(..) => code.push(0x7001),
            R(..) => code.push(0x6802),
            // ldr r2, [r0]; ands r2, r1; cmp r2, r1; bne to the first of them
            Until(..) => code.extend([0x6802, 0x400A, 0x428A, 0xD1FB]),
        }
    }
    // wfi; b to it
    code.extend([0xBF30, 0xE7FD]);
    let handler = FLASH as usize + 4 * VECTORS + 2 * code.len();
    // of everything that has no handler: b to itself
    code.push(0xE7FE);
    let mut image = Vec::new();
    let reset = FLASH as usize + 4 * VECTORS;
    image.extend(0x2000_4000_u32.to_le_bytes());
    image.extend((reset as u32 | 1).to_le_bytes());
    for _ in 2..VECTORS {
        image.extend((handler as u32 | 1).to_le_bytes());
    }
    image.extend(code.iter().flat_map(|half| half.to_le_bytes()));

    // the header of the file, and of its one segment
    let mut elf = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
    for half in [2_u16, 40] {
        elf.extend(half.to_le_bytes());
    }
    for word in [1, reset as u32 | 1, 52, 0, 0x0500_0400] {
        elf.extend(word.to_le_bytes());
    }
    for half in [52_u16, 32, 1, 40, 0, 0] {
        elf.extend(half.to_le_bytes());
    }
    let size = image.len() as u32;
    for word in [1, 84, FLASH, FLASH, size, size, 5, 4] {
        elf.extend(word.to_le_bytes());
    }
    elf.extend(image);
    elf
}

/// MOVW or MOVT (ARMv7-M, A7.7.76 and A7.7.79).
fn load_half(operation: u16, register: u16, number: u16) -> [u16; 2] {
    let first = operation | number >> 12 | (number >> 11 & 1) << 10;
    let second = (number >> 8 & 7) << 12 | register << 8 | number & 0xFF;
    [first, second]
}

/// The referee's verdicts on a firmware that does this.
fn judged(name: &str, steps: &[Do]) -> Vec<Violation> {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("referee-{name}.elf"));
    std::fs::write(&path, elf(steps)).unwrap();
    let mut board = Emulator::start(&path, Setup::default(), Options::default()).unwrap();
    // the clocks take milliseconds
    board.run_ms(20).unwrap();
    board.violations().unwrap()
}

const RCC: u32 = 0x4002_3800;
const CR: u32 = RCC;
const PLLCFGR: u32 = RCC + 0x04;
const CFGR: u32 = RCC + 0x08;
const APB2RSTR: u32 = RCC + 0x24;
const AHB1ENR: u32 = RCC + 0x30;
const APB1ENR: u32 = RCC + 0x40;
const APB2ENR: u32 = RCC + 0x44;
/// CCM's bit is 1 after a reset.
const CCM: u32 = 1 << 20;
const GPIOA: u32 = 0x4002_0000;
const GPIOB: u32 = 0x4002_0400;
const GPIOC: u32 = 0x4002_0800;
const MODER: u32 = 0x00;
const AFRL: u32 = 0x20;
const SPI1: u32 = 0x4001_3000;
const SYSCFG: u32 = 0x4001_3800;
const EXTI: u32 = 0x4001_3C00;
const ADC1: u32 = 0x4001_2000;
const TIM2: u32 = 0x4000_0000;
const TIM4: u32 = 0x4000_0800;
const DMA2_S0: u32 = 0x4002_6410;
const IWDG: u32 = 0x4000_3000;
const FLASH_IF: u32 = 0x4002_3C00;
const STORE: u32 = 0x0810_0000;

/// PA5 and PA6, or others, to SPI1, with port A's debugger pins left as they are.
const SPI_PINS: [Do; 4] = [
    W(AHB1ENR, CCM | 3),
    W(APB2ENR, 1 << 12),
    W(GPIOA + AFRL, 0x0550_0000),
    W(GPIOA + MODER, 0xA800_2800),
];
/// The PLL from the board's 8 MHz to 168 MHz, ready.
const PLL: [Do; 4] = [
    W(CR, 1 << 16 | 0x83),
    Until(CR, 1 << 17),
    W(PLLCFGR, 0x2740_2A04),
    W(CR, 1 << 24 | 1 << 16 | 0x83),
];

fn all(parts: &[&[Do]]) -> Vec<Do> {
    parts.concat()
}

/// Of each rule: what keeps it, and what breaks it.
fn cases() -> Vec<(Rule, Vec<Do>, Vec<Do>)> {
    let ports = W(AHB1ENR, CCM | 3);
    let syscfg = W(APB2ENR, 1 << 14);
    let adc = [ports, W(APB2ENR, 1 << 8), W(ADC1 + 0x34, 3)];
    // TIM2 counts 84 MHz for 6 us, or 16 for longer
    let waits = [W(APB1ENR, 1), W(TIM2, 1), Until(TIM2 + 0x24, 1 << 9)];
    let start = |setting: u32| W(ADC1 + 0x08, 1 << 30 | setting);
    let convert = all(&[&[W(ADC1 + 0x08, 1)], &waits, &[start(1)]]);
    let analog = all(&[&adc, &[W(GPIOA, 0xA800_00C0)]]);
    // from ADC1 to a ring of four
    let ring = [
        W(AHB1ENR, CCM | 3 | 1 << 22),
        W(DMA2_S0 + 0x08, ADC1 + 0x4C),
        W(DMA2_S0 + 0x0C, 0x2000_0000),
        W(DMA2_S0 + 0x04, 4),
        W(DMA2_S0, 0x2D01),
    ];
    let without_end = |setting: u32| {
        let on = [W(ADC1 + 0x08, setting)];
        all(&[&analog, &ring, &on, &waits, &[start(setting)]])
    };
    let dma = |request: u32, memory: u32| {
        [
            W(AHB1ENR, CCM | 3 | 1 << 22),
            W(APB2ENR, 1 << 12),
            W(DMA2_S0 + 0x08, SPI1 + 0x0C),
            W(DMA2_S0 + 0x0C, memory),
            W(DMA2_S0 + 0x04, 4),
            W(DMA2_S0, request << 25 | 1 << 10 | 1),
        ]
    };
    let unlock = [
        W(FLASH_IF + 0x04, 0x4567_0123),
        W(FLASH_IF + 0x04, 0xCDEF_89AB),
    ];
    let by_words = W(FLASH_IF + 0x10, 2 << 8 | 1);
    let by_bytes = W(FLASH_IF + 0x10, 1);
    // sector 16, by words, and its start
    let erase = [
        W(FLASH_IF + 0x10, 16 << 3 | 2 << 8 | 2),
        W(FLASH_IF + 0x10, 1 << 16 | 16 << 3 | 2 << 8 | 2),
    ];
    let to_pll = |cfgr: u32| [W(CFGR, cfgr | 2)];
    // APB1 / 4, APB2 / 2
    let divided = 5 << 10 | 4 << 13;
    let wait_states = [W(FLASH_IF, 5)];
    // TIM2 counts 84 MHz for 1.6 ms
    let later = [
        W(APB1ENR, 1),
        W(TIM2, 1),
        Until(TIM2 + 0x24, 1 << 17),
        R(RCC),
    ];
    let encoder = [W(AHB1ENR, CCM | 8), W(APB1ENR, 1 << 2)];
    let encoder_pins = [W(0x4002_0C24, 0x0022_0000), W(0x4002_0C00, 0x0A00_0000)];
    let nvic = [W(0xE000_E104, 1 << 6)];
    vec![
        (Rule::Clock, vec![ports, W(GPIOB, 0x280)], vec![W(GPIOC, 0)]),
        (
            Rule::HeldInReset,
            all(&[&SPI_PINS, &[R(SPI1 + 8)]]),
            all(&[&SPI_PINS, &[W(APB2RSTR, 1 << 12), R(SPI1 + 8)]]),
        ),
        (
            Rule::NoRegister,
            vec![ports, R(GPIOA + 0x24)],
            vec![ports, R(GPIOA + 0x30)],
        ),
        (
            Rule::Width,
            vec![W(APB1ENR, 1 << 2), H(TIM4 + 0x24, 1)],
            vec![W(APB1ENR, 1 << 2), B(TIM4 + 0x24, 1)],
        ),
        (
            Rule::ReadOnly,
            vec![ports, R(GPIOA + 0x10)],
            vec![ports, W(GPIOA + 0x10, 1)],
        ),
        (
            Rule::WriteOnly,
            vec![ports, W(GPIOA + 0x18, 1)],
            vec![ports, R(GPIOA + 0x18)],
        ),
        (
            Rule::ReservedBits,
            vec![syscfg, W(SYSCFG + 0x08, 0x3)],
            vec![syscfg, W(SYSCFG + 0x08, 0x3_0000)],
        ),
        (
            Rule::AlternateFunction,
            vec![ports, W(GPIOA + AFRL, 2), W(GPIOA, 0xA800_0002)],
            vec![ports, W(GPIOA + AFRL, 5), W(GPIOA, 0xA800_0002)],
        ),
        (
            Rule::NoPin,
            all(&[&SPI_PINS, &[W(SPI1, 0x344)]]),
            all(&[&SPI_PINS[..2], &[W(SPI1, 0x344)]]),
        ),
        (
            Rule::NoPin,
            all(&[
                &encoder,
                &encoder_pins,
                &[W(TIM4 + 0x08, 3), R(TIM4 + 0x24)],
            ]),
            all(&[
                &encoder,
                &encoder_pins[..1],
                &[W(TIM4 + 0x08, 3), R(TIM4 + 0x24)],
            ]),
        ),
        (
            Rule::NoPin,
            // a captured line needs none, an output does
            all(&[&encoder, &[W(TIM4 + 0x18, 1), W(TIM4 + 0x20, 1)]]),
            all(&[&encoder, &[W(TIM4 + 0x20, 1)]]),
        ),
        (
            Rule::TwoPins,
            all(&[&SPI_PINS, &[W(SPI1, 0x344)]]),
            // PB4 is SPI1's MISO as well as PA6
            all(&[
                &SPI_PINS,
                &[
                    W(GPIOB + AFRL, 0x0005_0000),
                    W(GPIOB, 0x280),
                    W(SPI1, 0x344),
                ],
            ]),
        ),
        (
            Rule::SpiRunning,
            // off, another mode, on; and another speed after a reset
            all(&[
                &SPI_PINS,
                &[
                    W(SPI1, 0x344),
                    W(SPI1, 0x304),
                    W(SPI1, 0x305),
                    W(SPI1, 0x345),
                ],
                &[W(APB2RSTR, 1 << 12), W(APB2RSTR, 0), W(SPI1, 0x374)],
            ]),
            all(&[&SPI_PINS, &[W(SPI1, 0x344), W(SPI1, 0x345)]]),
        ),
        (
            Rule::NotAnalog,
            all(&[&adc, &[W(GPIOA, 0xA800_00C0)], &convert]),
            all(&[&adc, &convert]),
        ),
        (
            Rule::Unsteady,
            all(&[&analog, &convert]),
            all(&[&analog, &[W(ADC1 + 0x08, 1), start(1)]]),
        ),
        (Rule::Unsteady, analog.clone(), all(&[&analog, &[start(0)]])),
        (
            Rule::RequestsEnd,
            // on and on, by DMA
            without_end(0x303),
            without_end(0x103),
        ),
        (
            Rule::ConverterClock,
            // 84 MHz / 4, and / 2
            all(&[
                &wait_states,
                &PLL,
                &to_pll(divided),
                &analog,
                &[W(ADC1 + 0x304, 1 << 16)],
                &convert,
            ]),
            all(&[&wait_states, &PLL, &to_pll(divided), &analog, &convert]),
        ),
        (
            Rule::DmaRequest,
            dma(3, 0x2000_0000).to_vec(),
            dma(4, 0x2000_0000).to_vec(),
        ),
        (
            Rule::DmaMemory,
            dma(3, 0x2000_0000).to_vec(),
            dma(3, 0x1000_0000).to_vec(),
        ),
        (
            Rule::DmaRunning,
            dma(3, 0x2000_0000).to_vec(),
            all(&[&dma(3, 0x2000_0000), &[W(DMA2_S0 + 0x04, 8)]]),
        ),
        (
            Rule::NoHandler,
            nvic.to_vec(),
            all(&[&nvic, &[W(0xE000_E204, 1 << 6)]]),
        ),
        (
            Rule::FlashProgram,
            all(&[&unlock, &[by_words, W(STORE, 7)]]),
            all(&[&unlock, &[by_bytes, W(STORE, 7)]]),
        ),
        (
            Rule::FlashBits,
            all(&[&unlock, &[by_words, W(STORE, 7), W(STORE, 3)]]),
            all(&[&unlock, &[by_words, W(STORE, 7), W(STORE, 8)]]),
        ),
        (
            Rule::DataCache,
            all(&[&unlock, &[by_words, W(STORE, 7)]]),
            all(&[&unlock, &[W(FLASH_IF, 1 << 10), by_words, W(STORE, 7)]]),
        ),
        (
            Rule::FlashBusy,
            all(&[&unlock, &erase]),
            all(&[&unlock, &erase, &[by_words]]),
        ),
        (
            Rule::WaitStates,
            all(&[&wait_states, &PLL, &to_pll(divided)]),
            all(&[&PLL, &to_pll(divided)]),
        ),
        (
            Rule::Accelerator,
            all(&[&[W(FLASH_IF, 0x305)], &PLL, &to_pll(divided), &later]),
            all(&[&[W(FLASH_IF, 0x205)], &PLL, &to_pll(divided), &later]),
        ),
        (
            Rule::BusClock,
            all(&[&wait_states, &PLL, &to_pll(divided)]),
            // APB1 / 2
            all(&[&wait_states, &PLL, &to_pll(4 << 10 | 4 << 13)]),
        ),
        (
            Rule::WatchdogKey,
            vec![W(IWDG, 0x5555), W(IWDG + 4, 3)],
            vec![W(IWDG + 4, 3)],
        ),
        (
            Rule::EdgeOfNoInput,
            vec![ports, syscfg, W(EXTI, 1)],
            vec![ports, syscfg, W(GPIOA, 0xA800_0001), W(EXTI, 1)],
        ),
    ]
}

#[test]
fn each_kind_of_mistake_is_named_and_nothing_else() {
    for (number, (rule, sound, wrong)) in cases().into_iter().enumerate() {
        let found = judged(&format!("{number}-sound"), &sound);
        assert_eq!(found, [], "{rule:?}, without the mistake");
        let found = judged(&format!("{number}-wrong"), &wrong);
        assert!(found.iter().any(|v| v.rule == rule), "{rule:?}: {found:?}");
        // what is wrong may be wrong to the models, too
        let other = |v: &&Violation| ![rule, Rule::Model, Rule::NoHandler].contains(&v.rule);
        let others: Vec<_> = found.iter().filter(other).collect();
        assert!(others.is_empty(), "{rule:?}: {others:?}");
    }
}

#[test]
fn a_violation_says_what_where_and_when() {
    let pend = W(0xE000_E204, 1 << 6);
    let found = judged("names-an-interrupt", &[W(0xE000_E104, 1 << 6), pend]);
    assert_eq!(found[0].what, "USART2");
    // code begins behind the vectors, and 16 bytes load address and value
    let found = judged("names-an-access", &[W(APB1ENR, 0), R(TIM4)]);
    let expected = "Clock: TIM4.CR1, by the instruction at 0x80001ce, first at 0.000000 s";
    assert_eq!(found[0].to_string(), expected);
}

//! Who touches the chip's registers: a peripheral has one owner. That is a file of the firmware, or one of embassy's drivers, and
//! then no file beside it.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use proc_macro2::{TokenStream, TokenTree};

use super::rules::{files, name};

type Listed = &'static [(&'static str, &'static [&'static str])];

/// The files that own peripherals wholly: no driver has them.
const OWNERS: Listed = &[
    ("chip/current.rs", &["ADC1", "ADC123_COMMON", "DMA2"]),
    ("chip/f7/bank2.rs", &["FLASH"]),
    ("chip/lever.rs", &["TIM1"]),
    ("chip/motion.rs", &["SPI4"]),
    ("chip/slots.rs", &["SPI1", "TIM2"]),
    ("chip/watchdog.rs", &["IWDG"]),
];
/// Start and end of an image, when no driver is at work: clocks, caches, and why the chip was reset.
const NO_DRIVER: Listed = &[
    ("board.rs", &["DBGMCU", "RCC"]),
    ("board/nucleo_f429zi.rs", &["FLASH"]),
    ("chip/rescue.rs", &["RCC"]),
];
/// What another image has, in which the owner is not at work.
const OTHER_IMAGE: Listed = &[("bench/silicon.rs", &["TIM2"])];
/// What a driver leaves as it is, set by the file that holds the driver: how wide the flash is erased.
const BESIDE_ITS_DRIVER: Listed = &[("chip/f4/bank2.rs", &["FLASH"])];
/// Files that look at registers and write none.
const LOOKS: Listed = &[
    ("board/nucleo_f767zi.rs", &["FLASH"]),
    ("selftest/chip.rs", &["FLASH", "GPIOA", "RCC"]),
];
/// How a register is written.
const WRITES: [&str; 3] = [".write(|", ".modify(|", ".write_value("];
/// embassy's drivers of what the files above own.
const DRIVERS: [&str; 4] = ["adc", "spi", "timer::low_level::Timer", "wdg"];

/// What is wrong with the registers in the firmware's source, a sentence each.
fn faults(source: &Path) -> Vec<String> {
    let mut faults = Vec::new();
    for file in files(source) {
        let here = name(source, &file);
        let text = fs::read_to_string(&file).unwrap();
        let listed = |list: Listed| {
            let of_here = list.iter().filter(|(file, _)| *file == here);
            of_here.flat_map(|(_, all)| *all).copied()
        };
        let known: Vec<&str> = [OWNERS, OTHER_IMAGE, NO_DRIVER, BESIDE_ITS_DRIVER, LOOKS]
            .into_iter()
            .flat_map(listed)
            .collect();
        for path in paths(text.parse().unwrap()) {
            let whole = path.join("::");
            let driver = whole.strip_prefix("embassy_stm32::").unwrap_or_default();
            if DRIVERS.iter().any(|known| driver.starts_with(known)) {
                faults.push(format!("{here}: `{whole}` drives what a file owns"));
            }
            // without the crate in front of it, it is a variable, P_AC
            let registers = path.iter().skip(1).position(|part| part == "pac");
            let Some(peripheral) = registers.map(|at| path.get(at + 2)) else {
                continue;
            };
            // what is not in capitals has the types of registers
            let is_owned = peripheral.is_some_and(|peripheral| {
                *peripheral != peripheral.to_uppercase() || known.contains(&&**peripheral)
            });
            if !is_owned || whole.ends_with("pac::*") {
                faults.push(format!("{here}: `{whole}` is not its own"));
            }
        }
        let is_written = WRITES.iter().any(|write| text.contains(write));
        if is_written && listed(LOOKS).next().is_some() {
            faults.push(format!("{here}: writes registers, and should only look"));
        }
    }
    faults
}

/// All paths of a file, also those in macros; of `use a::{b, c as d}` each one.
fn paths(tokens: TokenStream) -> Vec<Vec<String>> {
    let trees: Vec<TokenTree> = tokens.into_iter().collect();
    let is = |at: usize, what: char| matches!(trees.get(at), Some(TokenTree::Punct(p)) if p.as_char() == what);
    let (mut all, mut at) = (Vec::new(), 0);
    while let Some(tree) = trees.get(at) {
        at += 1;
        let mut path = match tree {
            TokenTree::Group(group) => {
                all.extend(paths(group.stream()));
                continue;
            }
            // the new name of what is imported
            TokenTree::Ident(word) if word == "as" => {
                at += 1;
                continue;
            }
            TokenTree::Ident(word) => vec![word.to_string()],
            TokenTree::Punct(star) if star.as_char() == '*' => vec!["*".to_owned()],
            _ => continue,
        };
        let mut after = vec![Vec::new()];
        while is(at, ':') && is(at + 1, ':') {
            match trees.get(at + 2) {
                Some(TokenTree::Ident(word)) => path.push(word.to_string()),
                Some(TokenTree::Group(group)) => after = paths(group.stream()),
                _ if is(at + 2, '*') => path.push("*".to_owned()),
                _ => break,
            }
            at += 3;
        }
        all.extend(after.iter().map(|after| [&path[..], after].concat()));
    }
    all
}

#[test]
fn a_peripheral_has_one_owner() {
    let firmware = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/src");
    let faults = faults(&firmware);
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
    let mut owners = BTreeMap::new();
    for (file, peripheral) in OWNERS
        .iter()
        .flat_map(|(file, all)| all.iter().map(move |peripheral| (file, peripheral)))
    {
        assert_eq!(owners.insert(peripheral, file), None, "{peripheral}");
    }
}

/// Critical sections do not mask the highest priority: who has it must not share data by them, as all drivers do.
#[test]
fn the_slots_alone_have_the_highest_priority() {
    let firmware = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/src");
    let texts = files(&firmware)
        .into_iter()
        .map(|file| fs::read_to_string(file).unwrap());
    let set = texts.flat_map(|text| {
        let lines = text.lines().filter(|line| line.contains("Priority::P0"));
        lines.map(|line| line.trim().to_owned()).collect::<Vec<_>>()
    });
    let slots =
        ["TIM2", "SPI1"].map(|name| format!("interrupt::{name}.set_priority(Priority::P0);"));
    assert_eq!(set.collect::<Vec<_>>(), slots);
    let slots = fs::read_to_string(firmware.join("chip/slots.rs")).unwrap();
    for shares in [
        "critical_section",
        "CriticalSection",
        "defmt",
        "interrupt::free",
    ] {
        assert!(!slots.contains(shares), "{shares}");
    }
}

#[test]
fn who_touches_what_another_file_or_a_driver_has_is_named() {
    let found = |file: &str, text: &str| {
        let top = tempfile::TempDir::new().unwrap();
        let file = top.path().join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, text).unwrap();
        faults(top.path())
    };
    for well in [
        "use embassy_stm32::pac::{SPI1, TIM2 as SLOTS, spi::vals::Br};\n// not pac::TIM3\nuse embassy_stm32::pac::spi::regs::*;",
        "use embassy_stm32::timer::simple_pwm::PwmPin;",
    ] {
        assert_eq!(found("chip/slots.rs", well), Vec::<String>::new());
    }
    for (file, text, what) in [
        (
            "tasks/servo.rs",
            "use embassy_stm32::pac::TIM2;",
            "embassy_stm32::pac::TIM2",
        ),
        (
            "chip/lever.rs",
            "use embassy_stm32::pac::{TIM1, TIM3};",
            "embassy_stm32::pac::TIM3",
        ),
        (
            "chip/slots.rs",
            "use embassy_stm32::{Peri, pac::{SPI1, RCC as CLOCKS}};",
            "embassy_stm32::pac::RCC",
        ),
        (
            "chip/slots.rs",
            "fn f() { log!(\"{}\", embassy_stm32::pac::TIM3.cnt()) }",
            "embassy_stm32::pac::TIM3",
        ),
        (
            "chip/slots.rs",
            "use embassy_stm32::pac;",
            "embassy_stm32::pac",
        ),
        (
            "chip/slots.rs",
            "use embassy_stm32::pac as chip;",
            "embassy_stm32::pac",
        ),
        (
            "chip/slots.rs",
            "use embassy_stm32::pac::*;",
            "embassy_stm32::pac::*",
        ),
        (
            "chip/slots.rs",
            "use embassy_stm32::pac::{*};",
            "embassy_stm32::pac::*",
        ),
    ] {
        assert_eq!(
            found(file, text),
            [format!("{file}: `{what}` is not its own")]
        );
    }
    for (text, what) in [
        (
            "use embassy_stm32::spi::{self, Spi};",
            "embassy_stm32::spi::self",
        ),
        (
            "use embassy_stm32::timer::low_level::Timer;",
            "embassy_stm32::timer::low_level::Timer",
        ),
        ("use embassy_stm32::{Peri, wdg};", "embassy_stm32::wdg"),
    ] {
        let found = found("tasks/servo.rs", text);
        assert_eq!(
            found[0],
            format!("tasks/servo.rs: `{what}` drives what a file owns")
        );
    }
    let looks = "fn f() { embassy_stm32::pac::FLASH.acr().modify(|w| w.set_dcen(true)); }";
    let wrong = "selftest/chip.rs: writes registers, and should only look";
    assert_eq!(found("selftest/chip.rs", looks), [wrong]);
}

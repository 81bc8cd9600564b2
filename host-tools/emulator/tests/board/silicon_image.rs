//! The image with what only silicon can answer, as far as the emulated board answers it: its kernels are compared to
//! the bit, its timers and its flash are models'.

use std::collections::BTreeMap;
use std::path::Path;

use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use tactus_emulator::board::{Emulator, Options};
use tactus_world::world::Setup;

use crate::common::elf_of;

/// Cycles per instruction of the kernels (docs/src/performance.md), and how far they may be off: compilers differ.
const RATIOS: [(&str, f64); 3] = [("band power", 1.5), ("frame", 2.0), ("slide", 1.8)];
const OFF: f64 = 0.2;

/// Runs the image to its end.
fn run(board: &mut Emulator) -> Vec<String> {
    let mut log: Vec<String> = Vec::new();
    while !log.iter().any(|line| line.contains("SILICON")) {
        assert!(board.now_ns() < 60_000_000_000, "no end: {log:#?}");
        board.run_ms(1).unwrap();
        log.extend(board.log().unwrap().into_iter().map(|(_, line)| line));
    }
    eprintln!("{}", log.join("\n"));
    log
}

fn start() -> Option<Emulator> {
    let elf = elf_of("TACTUS_SILICON_ELF")?;
    let board = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    Some(board)
}

fn failed(log: &[String]) -> Vec<&str> {
    let failed = log.iter().filter_map(|line| line.split_once("FAIL "));
    failed
        .map(|(_, line)| line.split(": ").next().unwrap())
        .collect()
}

#[test]
fn an_intact_chip_passes_and_its_kernels_take_what_the_image_says() {
    let Some(mut board) = start() else { return };
    let log = run(&mut board);
    assert_eq!(failed(&log), [""; 0]);
    assert_eq!(board.violations().unwrap(), []);
    for (name, ratio) in RATIOS {
        // "PASS cycles: 123 of NAME, 456 by the model"; the emulated core's counter has an instruction a cycle
        let mark = format!(" of {name}, ");
        let numbers = log.iter().find_map(|line| {
            let (counted, modelled) = line.split_once("cycles: ")?.1.split_once(&mark)?;
            let modelled = modelled.split(' ').next()?.parse::<f64>();
            Some((counted.parse::<f64>().ok()?, modelled.ok()?))
        });
        let (counted, modelled) = numbers.unwrap_or_else(|| panic!("no {name}: {log:?}"));
        let off = modelled / (ratio * counted) - 1.0;
        assert!(
            off.abs() < OFF,
            "{name}: {counted} instructions, {modelled} cycles"
        );
    }
}

/// The places of SMLAD in the image's code. What the ELF calls data ("$d") lies between its functions, and looks like
/// anything.
fn smlads(elf: &Path) -> Vec<u64> {
    let elf = std::fs::read(elf).unwrap();
    let file = object::File::parse(&*elf).unwrap();
    let text = file.section_by_name(".text").unwrap();
    let code: Vec<u16> = {
        let pairs = text.data().unwrap().as_chunks().0.iter();
        pairs.map(|pair| u16::from_le_bytes(*pair)).collect()
    };
    let marks: BTreeMap<u64, bool> = (file.symbols())
        .filter(|symbol| symbol.section_index() == Some(text.index()))
        .filter_map(|symbol| match symbol.name().unwrap().get(..2) {
            Some("$t") => Some((symbol.address(), true)),
            Some("$d") => Some((symbol.address(), false)),
            _ => None,
        })
        .collect();
    let ends = marks.keys().skip(1).copied();
    let ends = ends.chain([text.address() + text.size()]);
    let mut found = Vec::new();
    for ((&begin, _), end) in marks.iter().zip(ends).filter(|((_, is_code), _)| **is_code) {
        let mut at = begin;
        while at < end {
            let word = ((at - text.address()) / 2) as usize;
            let [first, second] = [code[word], code.get(word + 1).copied().unwrap_or(0)];
            // ARM DDI 0403E A5.1: these begin an instruction of two half-words
            let is_long = first >= 0xE800;
            if is_long && first & 0xFFF0 == 0xFB20 && second & 0x00F0 == 0 && second < 0xF000 {
                found.push(at);
            }
            at += if is_long { 4 } else { 2 };
        }
    }
    found
}

/// SMLAD with its halves crossed, SMLADX, in all places: nobody but the kernels in assembly has it.
pub(crate) fn cross_kernels(elf: &Path, board: &mut Emulator) {
    let smlads = smlads(elf);
    assert!(smlads.len() > 10, "{} SMLAD", smlads.len());
    for at in smlads {
        let mut second = [0; 2];
        second.copy_from_slice(&board.read(at + 2, 2).unwrap());
        board.write(at + 2, &[second[0] | 0x10, second[1]]).unwrap();
    }
}

#[test]
fn a_wrong_kernel_fails() {
    let Some(elf) = elf_of("TACTUS_SILICON_ELF") else {
        return;
    };
    let mut board = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    cross_kernels(&elf, &mut board);
    let log = run(&mut board);
    let failed = failed(&log);
    for name in ["band power", "slide"] {
        assert!(failed.contains(&name), "{name}: {failed:?}");
    }
    assert!(log.last().unwrap().contains("SILICON FAILED"));
}

//! The image with what only silicon can answer, as far as the emulated board answers it: its kernels are compared to the bit, its
//! timers and its flash are models'.

use std::collections::BTreeMap;
use std::path::Path;

use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use tactus_emulator::board::cycles::CycleCount;
use tactus_emulator::board::{Emulator, Options};
use tactus_world::world::Setup;

use crate::common::elf_of;

/// How far a kernel's cycles by the image may be off the model's: compilers differ. The image itself allows 30 %.
const OFF: f64 = 0.2;

/// Runs the image to its end, in steps of so many ns; `each` comes after each of them.
fn run(board: &mut Emulator, step_ns: u64, mut each: impl FnMut(&mut Emulator)) -> Vec<String> {
    let mut log: Vec<String> = Vec::new();
    while !log.iter().any(|line| line.contains("SILICON")) {
        assert!(board.now_ns() < 60_000_000_000, "no end: {log:#?}");
        board.run_until(board.now_ns() + step_ns).unwrap();
        each(board);
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
    let (counts, _) = board.symbol("BENCH_COUNTS").unwrap();
    // its clocks are up, and it waits for a probe
    board.run_ms(15).unwrap();
    board.trace_cycles(Vec::new(), Some(counts)).unwrap();
    // the cycles of each kernel, in the order in which they run: the image does something else between two of them
    let (mut spent, mut counts_on) = (Vec::<CycleCount>::new(), false);
    let log = run(&mut board, 20_000, |board| {
        let new = board.cycle_profile().unwrap().total(0..1);
        let counted = new.instructions > 0;
        if counted && !counts_on {
            spent.push(CycleCount::default());
        }
        if let Some(last) = spent.last_mut() {
            *last += new;
        }
        counts_on = counted;
    });
    assert_eq!(failed(&log), [""; 0]);
    assert_eq!(board.violations().unwrap(), []);
    // "PASS cycles: 123 of NAME, 456 by the model"
    let said = log.iter().filter_map(|line| {
        let (_, said) = line.split_once("cycles: ")?;
        let (name, rest) = said.split_once(" of ")?.1.rsplit_once(", ")?;
        Some((name, rest.split(' ').next()?.parse::<f64>().ok()?))
    });
    let said: Vec<(&str, f64)> = said.collect();
    assert_eq!((said.len(), spent.len()), (3, 3), "{said:?} {spent:?}");
    let mut stale = Vec::new();
    for ((name, modelled), spent) in said.into_iter().zip(spent) {
        eprintln!("{name}: {spent:?}");
        let off = spent.cycles as f64 / modelled - 1.0;
        if off.abs() >= OFF {
            let cycles = spent.cycles;
            stale.push(format!(
                "{name}: {cycles} cycles, the image says {modelled}"
            ));
        }
    }
    assert_eq!(stale, [""; 0]);
}

/// The places of SMLAD in the image's code. What the ELF calls data ("$d") lies between its functions, and looks like anything.
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
#[test]
fn a_wrong_kernel_fails() {
    let Some(elf) = elf_of("TACTUS_SILICON_ELF") else {
        return;
    };
    let mut board = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    let smlads = smlads(&elf);
    assert!(smlads.len() > 10, "{} SMLAD", smlads.len());
    for at in smlads {
        let mut second = [0; 2];
        second.copy_from_slice(&board.read(at + 2, 2).unwrap());
        board.write(at + 2, &[second[0] | 0x10, second[1]]).unwrap();
    }
    let log = run(&mut board, 1_000_000, |_| ());
    let failed = failed(&log);
    for name in ["band power", "slide"] {
        assert!(failed.contains(&name), "{name}: {failed:?}");
    }
    assert!(log.last().unwrap().contains("SILICON FAILED"));
}
